//! Files as others write them: nodes, several primitives, whole numbers.

use glam::{DMat3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};

use super::*;
use crate::Splats;
use crate::bounded::Bytes;
use crate::sh_rotation::basis;
use crate::turn::flip;

/// The JSON and the buffer of a file.
fn parts(bytes: &[u8]) -> (Value, Vec<u8>) {
    let mut rest = Bytes(&bytes[12..]);
    let mut chunk = || {
        let length = rest.u32().expect("a length") as usize;
        rest.u32().expect("a kind");
        rest.take(length).expect("a chunk").to_vec()
    };
    (serde_json::from_slice(&chunk()).expect("JSON"), chunk())
}

fn changed(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut document, buffer) = parts(bytes);
    change(&mut document);
    write::container(&document, buffer).expect("short")
}

fn plain(degree: usize) -> (Splats, Vec<u8>) {
    let splats = random(12, degree, 5);
    let bytes = encode(&splats, None, false).expect("encoded");
    (splats, bytes)
}

fn with_nodes(bytes: &[u8], nodes: Value, roots: Value) -> Vec<u8> {
    changed(bytes, |document| {
        document["nodes"] = nodes;
        document["scenes"] = json!([{"nodes": roots}]);
    })
}

fn covariance(splats: &Splats, i: usize) -> DMat3 {
    let [w, x, y, z] = unit(splats.quats[i]);
    let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
    let m = axes * DMat3::from_diagonal(DVec3::from_array(splats.log_scales[i].map(|s| f64::from(s).exp())));
    m * m.transpose()
}

fn mean(splats: &Splats, i: usize) -> DVec3 {
    DVec3::from_array(splats.means[i].map(f64::from)) + DVec3::from_array(splats.offset)
}

fn color(splats: &Splats, i: usize, direction: DVec3) -> f64 {
    let sh = &splats.sh[i * splats.coefficients()..][..splats.coefficients()];
    basis(direction).iter().zip(sh).map(|(y, c)| y * f64::from(c[0])).sum()
}

/// Holds Gaussians of a file against `matrix` applied to others, both y up. A covariance `C` becomes `M C M^T`, and the
/// colour at a direction is the colour before at the direction turned back by the rotation in `M`. Rounding is 1e-6 of
/// values up to 20.
#[track_caller]
fn assert_moved(found: &Splats, before: &Splats, matrix: DMat4, turn: DMat3) {
    let linear = DMat3::from_mat4(matrix);
    let (found, before) = (flip(found), flip(before));
    assert_eq!(found.len(), before.len());
    for i in 0..before.len() {
        let expected = matrix.transform_point3(mean(&before, i));
        assert!((mean(&found, i) - expected).length() < 1e-5, "{} {expected}", mean(&found, i));
        let expected = linear * covariance(&before, i) * linear.transpose();
        let most = (covariance(&found, i) - expected).to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(most < 1e-5, "{most}");
        for direction in [DVec3::X, DVec3::new(0.48, -0.6, 0.64), DVec3::new(-0.6, 0.64, 0.48)] {
            let expected = color(&before, i, turn.transpose() * direction);
            assert!((color(&found, i, direction) - expected).abs() < 1e-5);
        }
    }
}

/// Scale 2, a turn and a shift, below a parent with a matrix that turns and shifts: the same whether written as matrix
/// or in parts.
#[test]
fn nodes_turn_scale_and_move() {
    let (splats, bytes) = plain(3);
    let before = decode(&bytes).expect("read").splats;
    assert_eq!(before.means, splats.means);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
    let own = DMat4::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::new(1.0, 0.0, -3.0));
    let parent = DMat4::from_rotation_translation(DQuat::from_rotation_z(1.1), DVec3::new(0.0, 5.0, 0.0));
    let in_parts = json!({"mesh": 0, "scale": [2, 2, 2], "rotation": turn.to_array(), "translation": [1, 0, -3]});
    let as_matrix = json!({"mesh": 0, "matrix": own.to_cols_array()});
    for child in [in_parts, as_matrix] {
        let nodes = json!([child, {"children": [0], "matrix": parent.to_cols_array()}, {"mesh": 0}]);
        let found = decode(&with_nodes(&bytes, nodes, json!([1]))).expect("read");
        assert_moved(&found.splats, &before, parent * own, DMat3::from_quat(DQuat::from_rotation_z(1.1) * turn));
    }
}

/// Sizes of their own along each axis, a shear (a turn below such sizes), and a mirror.
#[test]
fn uneven_scales_and_mirrors_change_the_shapes() {
    let (_, bytes) = plain(1);
    let before = decode(&bytes).expect("read").splats;
    let turn = DMat4::from_rotation_y(0.6);
    let uneven = DMat4::from_scale(DVec3::new(3.0, 1.0, 0.25));
    let mirror = DMat4::from_scale(DVec3::new(-2.0, 2.0, 2.0));
    let of = |matrix: DMat4| DMat3::from_mat4(matrix);
    let reflected = of(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    for (matrix, rotation) in
        [(turn * uneven, of(turn)), (turn * mirror, of(turn) * reflected), (uneven, DMat3::IDENTITY)]
    {
        let nodes = json!([{"mesh": 0, "matrix": matrix.to_cols_array()}]);
        let found = decode(&with_nodes(&bytes, nodes, json!([0]))).expect("read");
        assert_moved(&found.splats, &before, matrix, rotation);
    }
    let sheared = uneven * turn;
    let turned = json!({"mesh": 0, "rotation": [0.0, 0.3_f64.sin(), 0.0, 0.3_f64.cos()]});
    let nodes = json!([turned, {"scale": [3, 1, 0.25], "children": [0]}]);
    let found = flip(&decode(&with_nodes(&bytes, nodes, json!([1]))).expect("read").splats);
    for i in 0..found.len() {
        let expected = of(sheared) * covariance(&flip(&before), i) * of(sheared).transpose();
        let most = (covariance(&found, i) - expected).to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(most < 1e-5, "{most}");
    }
}

/// All primitives of all meshes, as often as they are shown. Those of a lower degree have no more harmonics; other
/// meshes are passed over.
#[test]
fn all_primitives_are_read() {
    let (splats, bytes) = plain(2);
    let twice = changed(&bytes, |document| {
        let own = document["meshes"][0]["primitives"][0].clone();
        let mut lower = own.clone();
        let attributes = lower["attributes"].as_object_mut().expect("attributes");
        attributes.retain(|name, _| !name.contains("DEGREE_1") && !name.contains("DEGREE_2"));
        let points = json!({"mode": 0, "attributes": {"POSITION": 0}});
        document["meshes"] = json!([{"primitives": [points, own]}, {"primitives": [lower]}, {"primitives": []}]);
        document["nodes"] = json!([{"mesh": 0}, {"mesh": 1}, {"mesh": 1, "translation": [0, 0, 7]}, {"mesh": 2}]);
        document["scenes"] = json!([{"nodes": []}, {"nodes": [0, 1, 2, 3]}]);
        document["scene"] = json!(1);
    });
    let found = decode(&twice).expect("read").splats;
    assert_eq!((found.len(), found.degree), (36, 2));
    assert_eq!((&found.means[..12], &found.means[12..24]), (&splats.means[..], &splats.means[..]));
    assert_eq!(&found.sh[..108], &splats.sh[..]);
    assert_eq!(&found.sh[108..117], &[&splats.sh[..1], &[[0.0; 3]; 8]].concat()[..]);
    assert!((found.means[24][2] - (splats.means[0][2] - 7.0)).abs() < 1e-5, "glTF's z is the other way");
    // Without scenes all nodes, without nodes all meshes.
    let found = |remove: &[&str]| {
        let file = changed(&twice, |document| {
            remove.iter().for_each(|key| drop(document.as_object_mut().expect("an object").remove(*key)));
        });
        decode(&file).expect("read").splats.len()
    };
    assert_eq!((found(&["scene", "scenes"]), found(&["scene", "scenes", "nodes"])), (36, 24));
    let hidden = changed(&twice, |document| document["scene"] = json!(0));
    assert!(decode(&hidden).expect_err("hidden").contains("no node of the scene shows"));
}

/// A file whose attributes are whole numbers: one Gaussian, by hand.
#[test]
fn whole_numbers_are_read() {
    let accessor = |view: usize, component: u64, kind: &str, normalised: bool| {
        let mut value = json!({"bufferView": view, "componentType": component, "count": 1, "type": kind});
        value["normalized"] = json!(normalised);
        value
    };
    let file = |values: [(u64, bool, Vec<u8>); 4]| {
        let mut buffer: Vec<u8> = Vec::new();
        let (mut views, mut accessors) = (Vec::new(), Vec::new());
        let names = ["POSITION", "ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0"];
        let harmonics = [0.25_f32, -0.5, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut attributes = json!({});
        for (i, (component, normalised, bytes)) in values.into_iter().chain([(FLOAT, false, harmonics)]).enumerate() {
            views.push(json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": bytes.len()}));
            accessors.push(accessor(i, component, ["VEC3", "VEC4", "VEC3", "SCALAR", "VEC3"][i], normalised));
            attributes[if i == 0 { names[0].into() } else { format!("{SPLATS}:{}", names[i]) }] = json!(i);
            buffer.extend(bytes);
        }
        let mut extensions = json!({});
        extensions[SPLATS] = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
        let primitive = json!({"mode": 0, "attributes": attributes, "extensions": extensions});
        let document = json!({"meshes": [{"primitives": [primitive]}], "bufferViews": views, "accessors": accessors});
        decode(&write::container(&document, buffer).expect("short"))
    };
    let shorts = |values: &[i16]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let words = |values: &[u16]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let found = file([
        (SHORT, false, shorts(&[-300, 20, 7])),
        (SHORT, true, shorts(&[0, 32_767, 0, 0])),
        (UNSIGNED_SHORT, true, words(&[65_535, 0, 6554])),
        (UNSIGNED_SHORT, true, words(&[32_768])),
    ]);
    let found = found.expect("read").splats;
    assert_eq!((&found.means, &found.sh), (&vec![[-300.0, -20.0, -7.0]], &vec![[0.25, -0.5, 1.0]]));
    assert_eq!(unit(found.quats[0]).map(f64::abs), [0.0, 0.0, 1.0, 0.0]);
    let sizes = found.log_scales[0];
    assert!(
        sizes[0] == 0.0 && (-28.0..-27.0).contains(&sizes[1]) && (sizes[2] - 0.1_f32.ln()).abs() < 1e-4,
        "{sizes:?}"
    );
    assert!((sigmoid(found.opacity_logits[0]) - 32_768.0 / 65_535.0).abs() < 1e-6);
    let bytes = |values: &[i8]| values.iter().map(|x| *x as u8).collect::<Vec<u8>>();
    let found = file([
        (BYTE, true, bytes(&[-128, 127, 0])),
        (BYTE, true, bytes(&[0, 0, 0, 127])),
        (UNSIGNED_BYTE, false, vec![2, 3, 255]),
        (UNSIGNED_BYTE, true, vec![51]),
    ]);
    let found = found.expect("read").splats;
    assert_eq!((found.means[0], unit(found.quats[0])), ([-1.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]));
    assert_eq!(found.log_scales[0], [2.0, 3.0, 255.0].map(f32::ln));
    assert!((sigmoid(found.opacity_logits[0]) - 0.2).abs() < 1e-6);
    let wrong = file([
        (UNSIGNED_INT, false, vec![0; 12]),
        (BYTE, true, vec![0; 4]),
        (UNSIGNED_BYTE, false, vec![1; 3]),
        (UNSIGNED_BYTE, true, vec![51]),
    ]);
    assert!(wrong.expect_err("words of 32 bits").contains("found type 5125"));
}

/// A motion is turned, scaled and moved with its Gaussians: at any time they are where the node brings them.
#[test]
fn a_motion_goes_with_its_node() {
    let splats = random(8, 1, 2);
    let keys = Keys {
        times: vec![0.0, 1.0],
        means: (0..6).map(|i| [i as f32, 1.0, -2.0]).collect(),
        quats: (0..6).map(|i| [1.0, 0.1 * i as f32, 0.2, -0.3]).collect(),
        log_scales: vec![[-2.0, -3.0, -4.0]; 6],
    };
    let by_keys = Motion { span: [0.0, 1.0], middle: 0.5, rows: vec![4, 0, 7], law: Law::Keys(keys) };
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.3);
    for motion in [moving(true), by_keys] {
        let bytes = encode(&splats, Some(&motion), false).expect("encoded");
        for sign in [1.0, -1.0] {
            let scale = DVec3::new(1.5 * sign, 1.5, 1.5);
            let matrix = DMat4::from_scale_rotation_translation(scale, turn, DVec3::new(3.0, 0.0, 1.0));
            // The second mesh stands before it.
            let nodes = json!([{"mesh": 1}, {"mesh": 0, "matrix": matrix.to_cols_array()}]);
            let file = changed(&with_nodes(&bytes, nodes, json!([0, 1])), |document| {
                let mut still = document["meshes"][0].clone();
                still["primitives"][0]["extensions"].as_object_mut().expect("an object").remove(MOTION);
                document["meshes"].as_array_mut().expect("a list").push(still);
            });
            let found = decode(&file).expect("read");
            let own = found.motion.expect("moves");
            assert_eq!(own.rows, [12, 8, 15]);
            let mirror = DMat3::from_diagonal(DVec3::new(sign, 1.0, 1.0));
            for t in [0.0, 0.3, 0.9] {
                let at = own.at(&found.splats, t).select(&(8..16).collect::<Vec<u32>>());
                assert_moved(&at, &motion.at(&splats, t), matrix, DMat3::from_quat(turn) * mirror);
            }
        }
        let uneven = with_nodes(&bytes, json!([{"mesh": 0, "scale": [1, 2, 1]}]), json!([0]));
        assert!(decode(&uneven).expect_err("uneven").contains("one scale"));
        let twice = with_nodes(&bytes, json!([{"mesh": 0}, {"mesh": 0}]), json!([0, 1]));
        assert!(decode(&twice).expect_err("twice").contains("found more"));
    }
}

/// An offset in the extras comes back, in the file's axes; a node in map coordinates is one. Positions stay as they
/// are.
#[test]
fn offsets_are_kept_apart() {
    let (splats, bytes) = plain(0);
    let offset = [450_123.125, -5_200_456.5, 300.25];
    let far = Splats { offset, ..splats.clone() };
    let written = encode(&far, None, false).expect("encoded");
    let (document, _) = parts(&written);
    let extras = &document["meshes"][0]["primitives"][0]["extras"];
    assert_eq!(extras["offset"], json!([450_123.125, 5_200_456.5, -300.25]));
    let found = decode(&written).expect("read").splats;
    assert_eq!((found.offset, found.means), (offset, splats.means.clone()));
    let node = with_nodes(&bytes, json!([{"mesh": 0, "translation": [450_123.125, 5_200_456.5, -300.25]}]), json!([0]));
    let found = decode(&node).expect("read").splats;
    assert_eq!((found.offset, found.means), (offset, splats.means));
    for wrong in [json!([1, 2]), json!("x"), json!([1, 2, 1e300])] {
        let file = changed(&bytes, |document| document["meshes"][0]["primitives"][0]["extras"]["offset"] = wrong);
        assert!(decode(&file).expect_err("wrong").contains("offset of three numbers"));
    }
}

#[test]
fn hostile_nodes_are_refused() {
    let (_, bytes) = plain(0);
    for (nodes, roots, word) in [
        (json!([{"children": [0]}]), json!([0]), "one parent"),
        (json!([{"children": [1]}, {"children": [0], "mesh": 0}]), json!([0]), "one parent"),
        (json!([{"mesh": 0}, {"children": [0]}]), json!([0, 1]), "one parent"),
        (json!([{"mesh": 0}]), json!([9]), "below 1"),
        (json!([{"mesh": 5}]), json!([0]), "/meshes/5"),
        (json!([{"mesh": 0, "scale": [1, 0, 1]}]), json!([0]), "three sizes"),
        (json!([{"mesh": 0, "scale": [1e300, 1e300, 1e300]}]), json!([0]), "three sizes"),
        (json!([{"mesh": 0, "scale": [1e39, 1e39, 1e39]}]), json!([0]), "32 bits"),
        (json!([{"mesh": 0, "translation": [1e300, 0, 0]}]), json!([0]), "32 bits"),
        (json!([{"mesh": 0, "rotation": [0, 0, 0, 0]}]), json!([0]), "norm 1"),
        (json!([{"mesh": 0, "matrix": [1, 2]}]), json!([0]), "16 numbers"),
        (json!([{"mesh": 0, "matrix": [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]), json!([0]), "last row"),
        (json!([{"mesh": -1}]), json!([0]), "/mesh"),
        (json!([{"children": "x"}]), json!([0]), "whole numbers"),
    ] {
        let error = decode(&with_nodes(&bytes, nodes.clone(), roots)).expect_err("hostile");
        assert!(error.contains(word), "{nodes}: {error}");
    }
    // A chain of 50,000 nodes is a chain; a mesh that each of 50,000 shows is a bomb.
    let chain: Vec<Value> = (1..50_000).map(|next| json!({"children": [next]})).chain([json!({"mesh": 0})]).collect();
    assert_eq!(decode(&with_nodes(&bytes, chain.into(), json!([0]))).expect("read").splats.len(), 12);
    let crowd: Vec<Value> = (0..50_000).map(|_| json!({"mesh": 0})).collect();
    let large = changed(&bytes, |document| {
        document["nodes"] = crowd.into();
        document["scenes"] = json!([{"nodes": (0..50_000).collect::<Vec<usize>>()}]);
        let own = document["meshes"][0]["primitives"][0].clone();
        document["meshes"][0]["primitives"] = vec![own; 100].into();
    });
    assert!(decode(&large).expect_err("a bomb").contains("at most"));
    let lying = changed(&bytes, |document| document["accessors"][1]["count"] = json!(11));
    assert!(
        decode(&lying).expect_err("lying").contains("expected 12 values of KHR_gaussian_splatting:ROTATION, found 11")
    );
    let other = changed(&bytes, |document| {
        document["meshes"][0]["primitives"][0]["extensions"][SPLATS]["kernel"] = json!("ellipse2d");
    });
    assert!(decode(&other).expect_err("another kernel").contains("ellipse2d"));
    let compressed =
        changed(&bytes, |document| document["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {}}));
    assert!(decode(&compressed).expect_err("compressed").contains("EXT_meshopt_compression"));
}

/// Any byte of a file with nodes and an offset may be another.
#[test]
fn broken_nodes_never_panic() {
    let (splats, _) = plain(1);
    let bytes = encode(&Splats { offset: [1e6, 2e6, 3e6], ..splats }, None, false).expect("encoded");
    let node = json!({"mesh": 0, "scale": [2, 1, 1], "rotation": [0, 0, 1, 0], "translation": [1e6, 2, 3]});
    let nodes = json!([node, {"children": [0]}]);
    let file = with_nodes(&bytes, nodes, json!([1]));
    for place in 12..file.len().min(6000) {
        for with in [b'9', b'"', b'-', b'e', 0xff] {
            let mut broken = file.clone();
            broken[place] = with;
            if let Ok(contents) = decode(&broken) {
                contents.splats.check().expect("sound");
            }
        }
    }
}
