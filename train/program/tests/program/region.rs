//! The region of interest: what is outside does not count, and stays out of an export.

use std::fs;
use std::path::Path;

use gs_datasets::View;
use gs_pipelines::still::Still;
use gs_splats::{Keys, Law, Motion, Splats};
use gs_train::fit::density::ops::Draft;
use gs_train::fit::region::Region;
use gs_train::fit::session::{Data, Session};
use gs_train::run::exchange::{Format, Packed, read_packed};

use crate::common::program::{fails, fails_with, says};
use crate::common::{self, Begun};

/// A part of the tiny scene.
const BOX: &str = "data.region=[-0.6, -0.6, -0.2, 0.6, 0.6, 0.8]";

/// The means after three steps from the same state, with other photos.
fn learned(change: impl Fn(&Region, &mut View)) -> Vec<[f32; 3]> {
    let Begun { config, mut data, trainer, .. } = common::begun(&common::config(3, &[BOX]));
    let region = data.facts.region.expect("a region");
    data.scene.train.iter_mut().for_each(|view| change(&region, view));
    let data: Data<Still> = data;
    let mut session = Session::begin(&data, &config, Some(trainer), &common::device());
    (0..3).for_each(|_| drop(session.step()));
    Draft::read(session.trainer.gaussians()).means
}

#[test]
fn pixels_that_do_not_show_the_box_do_not_count() {
    let as_they_are = learned(|_, _| ());
    let with = |level: u8| {
        learned(move |region, view| {
            let mask = region.mask(view);
            assert!(mask.contains(&0) && mask.contains(&255));
            let pixels = view.image.data.chunks_exact_mut(3).zip(mask).filter(|(_, counts)| *counts == level);
            pixels.for_each(|(color, _)| color.fill(130));
        })
    };
    assert!(with(0) == as_they_are, "others");
    assert!(with(255) != as_they_are, "those that show it");
}

/// 216 Gaussians on the grid of whole numbers from 0 to 5, at an offset.
fn grid(folder: &Path, offset: [f64; 3]) {
    let splats = Splats {
        means: (0..216).map(|i| [(i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32]).collect(),
        offset,
        quats: vec![[1.0, 0.0, 0.0, 0.0]; 216],
        log_scales: vec![[-2.0; 3]; 216],
        opacity_logits: vec![1.0; 216],
        sh: vec![[0.5; 3]; 216],
        ..Splats::default()
    };
    let packed = Packed { splats, motion: None, samples: 0 };
    packed.write(&folder.join("grid.ply"), Format::Ply).expect("written");
}

/// Boxes are in the world to which the offset belongs; both corners are inside.
#[test]
fn an_export_has_what_is_in_the_box() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for offset in [[0.0; 3], [450_123.0, -5_200_456.0, 0.0]] {
        grid(folder, offset);
        let corners = |low: [f64; 3], high: [f64; 3]| {
            let numbers = [low, high].map(|corner| [0, 1, 2].map(|axis| corner[axis] + offset[axis]));
            numbers.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(",")
        };
        let asked = corners([0.5, -1.0, 2.0], [3.0, 1.5, 4.0]);
        for file in ["thing.ply", "thing.spz"] {
            let [said, _] = says(folder, &["export", "grid.ply", "--out", file, "--box", &asked]);
            assert!(said.contains("18 Gaussians, 198 Gaussians outside the box left out"), "{said}");
            let splats = read_packed(&folder.join(file)).expect("read").expect("a scene").splats;
            for mean in &splats.means {
                let [x, y, z] = [0, 1, 2].map(|axis| f64::from(mean[axis]) + splats.offset[axis] - offset[axis]);
                assert!((1.0..=3.0).contains(&x) && (0.0..=1.0).contains(&y) && (2.0..=4.0).contains(&z), "{mean:?}");
            }
        }
        let refused = fails(folder, &["export", "grid.ply", "--out", "x.ply", "--box", &corners([6.0; 3], [7.0; 3])]);
        let bounds = format!("x from {:.3} to {:.3}", offset[0], offset[0] + 5.0);
        assert!(refused.contains("--box") && refused.contains(&bounds), "{refused}");
        assert!(!folder.join("x.ply").exists());
    }
    for wrong in ["1,2,3", "0,0,0,1,1,0", "0,0,0,1,1,nan", "0,0,0,1,1,1e99", "a,b,c,d,e,f"] {
        let refused = fails_with(2, folder, &["export", "grid.ply", "--out", "x.ply", "--box", wrong]);
        assert!(refused.contains("x0 < x1"), "{refused}");
    }
}

/// Of three Gaussians the first stands in the box, the second passes it, and the third stays away.
#[test]
fn a_motion_that_passes_the_box_is_inside() {
    let splats = Splats {
        means: vec![[0.0; 3], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]],
        quats: vec![[1.0, 0.0, 0.0, 0.0]; 3],
        log_scales: vec![[-2.0; 3]; 3],
        opacity_logits: vec![1.0; 3],
        sh: vec![[0.5; 3]; 3],
        ..Splats::default()
    };
    let means = vec![[5.0, 0.0, 0.0], [0.5, 0.0, 0.0]];
    let keys = Keys { times: vec![0.0, 1.0], means, quats: vec![[1.0, 0.0, 0.0, 0.0]; 2], log_scales: Vec::new() };
    let motion = Motion { span: [0.0, 1.0], middle: 0.0, rows: vec![1], law: Law::Keys(keys) };
    let region = Region { corners: [[-1.0; 3], [1.0; 3]] };
    let packed = Packed { splats, motion: Some(motion), samples: 5 };
    assert_eq!(packed.within(&region), [0, 1]);
    assert_eq!(Packed { motion: None, ..packed }.within(&region), [0]);
}

/// A run exports its own region, and a box that holds nothing is refused before anything is written.
#[test]
fn a_run_has_a_region() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::tiny_scene(folder);
    let job = common::job(&scene, &folder.join("run"), &common::config(4, &[BOX]));
    common::finish(&job);
    let [said, _] = says(folder, &["export", "run", "--out", "a.ply"]);
    assert!(said.contains("outside the box left out"), "{said}");
    let [same, _] = says(folder, &["export", "run", "--out", "b.ply", "--box", "-0.6,-0.6,-0.2,0.6,0.6,0.8"]);
    assert_eq!(said.replace("a.ply", "b.ply"), same);
    assert!(fs::read(folder.join("a.ply")).expect("read") == fs::read(folder.join("b.ply")).expect("read"));
    let [said, _] = says(folder, &["export", "run", "--out", "c.ply", "--target-mb", "0.003"]);
    assert!(fs::metadata(folder.join("c.ply")).expect("a file").len() <= 3000 && !said.contains("PSNR"), "{said}");

    let refused = |set: &[&str]| {
        let args: Vec<&str> =
            ["train", "scene", "--out", "x"].into_iter().chain(set.iter().flat_map(|set| ["--set", set])).collect();
        fails(folder, &args)
    };
    for wrong in ["[0, 0, 0, 1, 1]", "[0, 0, 0, 1, 1, 0]", "[0, 0, 0, 1, 1, inf]", "[0, 0, nan, 1, 1, 1]"] {
        assert!(refused(&[&format!("data.region={wrong}")]).contains("`data.region` must be"), "{wrong}");
    }
    for pipeline in ["taylormode", "sparsedyn"] {
        assert!(refused(&[BOX, &format!("pipeline={pipeline}")]).contains("moving scenes"));
    }
    let empty = refused(&["data.region=[50, 50, 50, 51, 51, 51]"]);
    assert!(empty.contains("found none") && empty.contains("x from"), "{empty}");
    assert!(!folder.join("x").exists());
}
