//! A pattern of dots drawn through a lens must come out where an ideal pinhole puts it.

use serde_json::json;

use crate::colmap::{Camera, Image, Model};
use crate::fixtures::{Folder, all, ring};

const SIZE: (usize, usize) = (320, 240);
const F: (f64, f64) = (250.0, 245.0);
const C: (f64, f64) = (163.0, 118.0);

/// OpenCV's formulas in full, written apart from the crate's: k1 k2 p1 p2 k3 k4 k5 k6.
fn distort(x: f64, y: f64, k: [f64; 8]) -> (f64, f64) {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = k;
    let r2 = x.powi(2) + y.powi(2);
    let radial =
        (1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3)) / (1.0 + k4 * r2 + k5 * r2.powi(2) + k6 * r2.powi(3));
    (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x.powi(2)),
        y * radial + p1 * (r2 + 2.0 * y.powi(2)) + 2.0 * p2 * x * y,
    )
}

fn dots() -> impl Iterator<Item = (f64, f64)> {
    (0..35).map(|i| (38.0 + 40.3 * f64::from(i % 7), 30.0 + 44.7 * f64::from(i / 7)))
}

/// White Gaussian spots on black where the lens shows the dots.
fn draw(folder: &Folder, name: &str, k: [f64; 8]) {
    let places: Vec<(f64, f64)> = dots()
        .map(|(u, v)| distort((u - C.0) / F.0, (v - C.1) / F.1, k))
        .map(|(x, y)| (x * F.0 + C.0, y * F.1 + C.1))
        .collect();
    folder.rgb(name, SIZE.0, SIZE.1, |x, y| {
        let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
        let light: f64 = places.iter().map(|(a, b)| (-((u - a).powi(2) + (v - b).powi(2)) / 8.0).exp()).sum();
        [(250.0 * light.min(1.0)).round() as u8; 3]
    });
}

/// Largest distance between where a dot should be and the centre of light around it, pixels.
fn worst(folder: &Folder) -> (f64, usize) {
    let view = folder.load(&all()).train.remove(0);
    assert_eq!((view.intrinsics.fx, view.intrinsics.cy), (F.0, C.1), "the pinhole keeps the lens's intrinsics");
    let mut worst = 0.0_f64;
    for (u, v) in dots() {
        let (mut sum, mut at) = (0.0, (0.0, 0.0));
        for y in v as usize - 9..v as usize + 10 {
            for x in u as usize - 9..u as usize + 10 {
                let light = f64::from(view.image.data[3 * (y * SIZE.0 + x)]);
                sum += light;
                at = (at.0 + light * (x as f64 + 0.5), at.1 + light * (y as f64 + 0.5));
            }
        }
        worst = worst.max((at.0 / sum - u).hypot(at.1 / sum - v));
    }
    (worst, view.mask.map_or(0, |mask| mask.iter().filter(|keep| **keep == 0).count()))
}

#[test]
fn transforms_json() {
    for (k, masked) in
        [([0.12, -0.03, 0.002, -0.0015, 0.0, 0.0, 0.0, 0.0], true), ([-0.2, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], false)]
    {
        let folder = Folder::new();
        draw(&folder, "images/a.png", k);
        let frames = json!([{ "file_path": "images/a.png", "transform_matrix": ring(0) }]);
        folder.write_json(
            "transforms.json",
            &json!({
                "fl_x": F.0, "fl_y": F.1, "cx": C.0, "cy": C.1, "w": SIZE.0, "h": SIZE.1, "frames": frames,
                "k1": k[0], "k2": k[1], "p1": k[2], "p2": k[3], "camera_model": "OPENCV",
            }),
        );
        let (worst, ignored) = worst(&folder);
        assert!(worst < 0.1, "{worst} pixels");
        assert_eq!(ignored > 0, masked, "a pincushion lens leaves the corners empty: {ignored} pixels");
    }
}

#[test]
fn colmap_models() {
    let [fx, fy] = [F.0, F.1];
    let k = [-0.15, 0.04, 0.001, -0.002, 0.01, 0.05, -0.02, 0.003];
    let cases: [(i32, Vec<f64>, [f64; 8]); 2] = [
        (4, vec![fx, fy, C.0, C.1, k[0], k[1], k[2], k[3]], [k[0], k[1], k[2], k[3], 0., 0., 0., 0.]),
        (6, [&[fx, fy, C.0, C.1], &k[..]].concat(), k),
    ];
    for (model, params, k) in cases {
        let folder = Folder::new();
        draw(&folder, "images/a.png", k);
        write_model(&folder, model, params);
        let (worst, _) = worst(&folder);
        assert!(worst < 0.1, "{worst} pixels with model {model}");
    }
}

/// SIMPLE_RADIAL and RADIAL are RADIAL and OPENCV with zeros: the loaded images must be the same.
#[test]
fn smaller_colmap_models_are_cases_of_larger_ones() {
    let load_as = |model: i32, params: &[f64]| {
        let folder = Folder::new();
        draw(&folder, "images/a.png", [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        write_model(&folder, model, params.to_vec());
        let view = folder.load(&all()).train.remove(0);
        (view.image, view.mask, view.intrinsics)
    };
    let f = F.0;
    let opencv = load_as(4, &[f, f, C.0, C.1, -0.15, 0.0, 0.0, 0.0]);
    assert_eq!(load_as(2, &[f, C.0, C.1, -0.15]), opencv);
    assert_eq!(load_as(3, &[f, C.0, C.1, -0.15, 0.0]), opencv);
    let opencv = load_as(4, &[f, f, C.0, C.1, -0.15, 0.04, 0.0, 0.0]);
    assert_eq!(load_as(3, &[f, C.0, C.1, -0.15, 0.04]), opencv);
    let pinhole = load_as(1, &[f, f, C.0, C.1]);
    assert_eq!(load_as(0, &[f, C.0, C.1]), pinhole);
    assert_ne!(pinhole.0, opencv.0);
}

fn write_model(folder: &Folder, model: i32, params: Vec<f64>) {
    let image = Image { id: 1, q: [1.0, 0.0, 0.0, 0.0], t: [0.0; 3], camera_id: 1, name: "a.png".into(), seen: vec![] };
    let camera = Camera { id: 1, model, width: SIZE.0 as u64, height: SIZE.1 as u64, params };
    Model { cameras: vec![camera], images: vec![image], points: vec![] }.write_binary(folder, "sparse/0");
}
