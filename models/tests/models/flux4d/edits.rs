//! Edits of actors, from their script to the scene.

use gs_models::DynamicScene;
use gs_models::flux4d::FluxScene;
use gs_models::flux4d::actors::{Edit, EditScript, Edited, apply_edits};
use gs_tests::devices::{everywhere, reference};
use gs_tests::tolerance::{assert_near, values};

use super::actors::{found, street};

fn edited(scene: &FluxScene, edits: Vec<Edit>) -> Edited {
    apply_edits(scene, &found(scene), &EditScript { edits }).expect("edits")
}

fn mean(scene: &FluxScene, rows: &[u32], t: f64) -> [f64; 3] {
    let means = values(&scene.moving_means(t));
    [0, 1, 2].map(|axis| rows.iter().map(|row| means[3 * *row as usize + axis]).sum::<f64>() / rows.len() as f64)
}

#[test]
fn a_script_is_toml() {
    let script: EditScript = toml::from_str(
        "[[edits]]\ndo = \"remove\"\nactor = 1\n[[edits]]\ndo = \"insert\"\nactor = 0\noffset = [0.0, 3.5, 0.0]\n\
         turn = 90.0\n\
         [[edits]]\ndo = \"recolor\"\nactor = 0\ncolor = [1.0, 0.0, 0.0]\nshare = 0.5\n\
         [[edits]]\ndo = \"move\"\nactor = 2\n",
    )
    .expect("a script");
    assert_eq!(script.edits[0], Edit::Remove { actor: 1 });
    assert_eq!(script.edits[1], Edit::Insert { actor: 0, offset: [0.0, 3.5, 0.0], turn: 90.0 });
    assert_eq!(script.edits[3], Edit::Move { actor: 2, offset: [0.0; 3], turn: 0.0 });
    let text = toml::to_string(&script).expect("text");
    assert_eq!(toml::from_str::<EditScript>(&text).expect("a script"), script);
    assert!(toml::from_str::<EditScript>("[[edits]]\ndo = \"paint\"\nactor = 1\n").is_err());
    assert!(toml::from_str::<EditScript>("[[edit]]\ndo = \"remove\"\nactor = 1\n").is_err());
}

#[test]
fn no_edits_change_nothing() {
    for place in everywhere() {
        let scene = street(place);
        let same = edited(&scene, Vec::new()).scene;
        for (a, b) in [(scene.at(5.7), same.at(5.7)), (scene.at(9.0), same.at(9.0))] {
            assert_eq!(values(&a.means.val()), values(&b.means.val()), "{}", place.name);
            assert_eq!(values(&a.sh.val()), values(&b.sh.val()), "{}", place.name);
        }
    }
}

#[test]
fn actors_vanish_move_and_appear() {
    let scene = street(reference());
    let actors = found(&scene);
    let removed = edited(&scene, vec![Edit::Remove { actor: 0 }]);
    assert_eq!((removed.scene.moving(), removed.scene.resting()), (60, 100));
    assert_eq!(removed.actors, [Vec::new(), (0..60).collect::<Vec<u32>>()]);
    assert_eq!(removed.scene.at(5.5).len(), 160);
    let empty = edited(&scene, vec![Edit::Remove { actor: 0 }, Edit::Remove { actor: 1 }]).scene;
    assert_eq!((empty.at(5.5).len(), empty.span()), (100, None));

    let offset = [1.0, 2.0, 0.5];
    let moved = edited(&scene, vec![Edit::Move { actor: 1, offset, turn: 0.0 }]);
    for t in [5.0, 5.5, 6.5] {
        let before = mean(&scene, &actors[1].rows, t);
        let after = mean(&moved.scene, &moved.actors[1], t);
        assert_near("moved", &after, &[0, 1, 2].map(|axis| before[axis] + offset[axis]), 1e-9);
    }

    let twice =
        edited(&scene, vec![Edit::Insert { actor: 1, offset, turn: 0.0 }, Edit::Move { actor: 2, offset, turn: 0.0 }]);
    assert_eq!((twice.scene.moving(), twice.actors.len()), (180, 3));
    assert_near(
        "the first stays",
        &mean(&twice.scene, &twice.actors[1], 5.2),
        &mean(&scene, &actors[1].rows, 5.2),
        1e-12,
    );
    let before = mean(&scene, &actors[1].rows, 5.2);
    assert_near(
        "the copy",
        &mean(&twice.scene, &twice.actors[2], 5.2),
        &[0, 1, 2].map(|a| before[a] + 2.0 * offset[a]),
        1e-9,
    );
}

#[test]
fn a_turn_turns_body_and_path() {
    let scene = street(reference());
    let actors = found(&scene);
    let turned = edited(&scene, vec![Edit::Move { actor: 0, offset: [0.0; 3], turn: 90.0 }]);
    let [x, y, z] = actors[0].bounds.centre;
    for t in [5.0, 5.5, 6.0] {
        let [a, b, c] = mean(&scene, &actors[0].rows, t);
        let expected = [x - (b - y), y + (a - x), c];
        assert_near("path", &mean(&turned.scene, &turned.actors[0], t), &expected, 1e-9);
    }
    // (cos 45, 0, 0, sin 45) of the identity.
    let quats = values(&turned.scene.gaussians.quats.val());
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert_near("body", &quats[400..404], &[half, 0.0, 0.0, half], 1e-12);
    assert_near("z", &[z], &[0.5], 0.1);
}

#[test]
fn colours_are_mixed() {
    let scene = street(reference());
    let edit = Edit::Recolor { actor: 1, color: [1.0, 0.5, 0.0], share: 0.5 };
    let mixed = edited(&scene, vec![edit]);
    let sh = values(&mixed.scene.gaussians.sh.val());
    let first = 3 * (100 + mixed.actors[1][0] as usize);
    let pure = 0.5 / 0.282_094_791_773_878_14;
    assert_near("mixed", &sh[first..first + 3], &[0.5 * (0.25 + pure), 0.125, 0.5 * (0.25 - pure)], 1e-12);
    assert_eq!(sh[300..303], [0.25; 3]);
}

#[test]
fn an_edit_that_cannot_be_made_is_told() {
    let scene = street(reference());
    let told = |edit: Edit| {
        apply_edits(&scene, &found(&scene), &EditScript { edits: vec![edit] }).map(|_| ()).unwrap_err().to_string()
    };
    assert_eq!(told(Edit::Remove { actor: 2 }), "the edit names actor 2, the scene has actors 0 to 1");
    let turn = told(Edit::Move { actor: 0, offset: [0.0; 3], turn: f64::NAN });
    assert_eq!(turn, "an edit's turn is NaN; -360 to 360 degrees is expected");
    assert!(
        told(Edit::Insert { actor: 0, offset: [0.0, f64::INFINITY, 0.0], turn: 0.0 }).starts_with("an edit's offset")
    );
    assert!(told(Edit::Recolor { actor: 0, color: [2.0, 0.0, 0.0], share: 1.0 }).starts_with("an edit's colour is 2"));
    let gone =
        EditScript { edits: vec![Edit::Remove { actor: 1 }, Edit::Move { actor: 1, offset: [0.0; 3], turn: 0.0 }] };
    let told = apply_edits(&scene, &found(&scene), &gone).unwrap_err().to_string();
    assert_eq!(told, "the edit names actor 1, which an earlier edit removed");
    let none = apply_edits(&scene, &[], &EditScript { edits: vec![Edit::Remove { actor: 0 }] });
    assert_eq!(none.unwrap_err().to_string(), "the edit names actor 0, the scene has no actors");
}
