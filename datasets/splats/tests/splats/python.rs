//! The reader of the motion in `docs/read_motion.py`, run where there is a `python3`, against the crate's own.

use std::path::Path;
use std::process::Command;

use gs_splats::{
    Beyond, Carried, Carrier, Keys, Law, Motion, Series, SeriesLaw, Shape, Splats, TimeFunction, glb, turn,
};
use serde_json::Value;

/// Python's figures against ours: both compute in f64 and ours are stored as f32, of values below 10.
const ROUNDING: f64 = 1e-6;

fn splats() -> Splats {
    let at = |i: usize, k: usize| ((7 * i + 3 * k) as f32).sin();
    Splats {
        offset: [0.0; 3],
        means: (0..6).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect(),
        quats: (0..6).map(|i| [1.5 + at(i, 3), at(i, 4), at(i, 5), at(i, 6)]).collect(),
        log_scales: vec![[-2.0; 3]; 6],
        opacity_logits: vec![1.0; 6],
        degree: 0,
        sh: vec![[0.5; 3]; 6],
        antialiased: None,
    }
}

fn series() -> Law {
    let beyond = Some(Beyond { line: [0.25, 0.5], edges: [[-1.0, 3.0], [1.0, 2.0]], fade: 0.25 });
    let shapes = [
        Shape::Power(1),
        Shape::Power(3),
        Shape::Ramp { near: 0.2, far: 0.5 },
        Shape::Ramp { near: -0.1, far: -0.6 },
        Shape::Wave { power: 2, n: 0, sine: false },
        Shape::Wave { power: 2, n: 1, sine: true },
    ];
    let functions: Vec<TimeFunction> = shapes.map(|shape| TimeFunction { shape, beyond }).to_vec();
    let vectors = |count: usize| (0..count).map(|i| [(i as f32).cos(), (2.0 * i as f32).sin(), 0.3]).collect();
    let turning = vec![TimeFunction { shape: Shape::Power(1), beyond: None }; 2];
    Law::Series(SeriesLaw {
        t0: 0.4,
        half: 0.5,
        position: Series { vectors: vectors(2 * functions.len()), functions },
        rotation: Series { vectors: vectors(2 * turning.len()), functions: turning },
        carried: None,
    })
}

/// The same functions; row 4 follows a body, row 1 has vectors of its own alone.
fn carried() -> Law {
    let Law::Series(mut law) = series() else { panic!("a series") };
    let (j, k) = (law.position.functions.len(), law.rotation.functions.len());
    let block = [[0.1, 0.2, -0.3], [0.0, 0.4, 0.1], [-0.2, 0.0, 0.3], [0.5, -0.1, 0.0]];
    let body =
        Carrier { centre: [0.5, 1.0, -0.5], scale: 2.0, position: vec![block; j], rotation: vec![[0.2, -0.1, 0.4]; k] };
    let mean = splats().means[4];
    let basis = [1.0, 0.5 * (mean[0] - 0.5), 0.5 * (mean[1] - 1.0), 0.5 * (mean[2] + 0.5)];
    let vector = [0, 1, 2].map(|axis| basis.iter().zip(block).map(|(x, v): (&f32, [f32; 3])| x * v[axis]).sum());
    law.position.vectors[..j].fill(vector);
    law.rotation.vectors[..k].fill([0.2, -0.1, 0.4]);
    let own = vec![[0, 0], [j as u16, k as u16]];
    law.carried = Some(Carried { body_of: vec![0, Carried::NO_BODY], own, bodies: vec![body] });
    Law::Series(law)
}

fn keys() -> Law {
    Law::Keys(Keys {
        times: vec![0.0, 0.25, 1.0],
        means: (0..6).map(|i| [i as f32, 1.0, -1.0]).collect(),
        quats: (0..6).map(|i| [1.0 - 0.4 * i as f32, 0.5, 0.1, 0.2]).collect(),
        log_scales: Vec::new(),
    })
}

#[test]
fn python_reads_the_motion_as_it_is() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("there is no python3");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/read_motion.py");
    let lines = std::fs::read_to_string(&script).expect("the script").lines().count();
    assert!(lines <= 80, "it fits on a page: {lines}");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.glb");
    // Before, in and after the window; a program starts for each.
    let every = &[-0.4, 0.0, 0.3, 0.95, 1.4][..];
    for (law, middle, times) in [(series(), 0.5, every), (carried(), 0.4, every), (keys(), 0.5, &[-0.4, 0.3, 1.4])] {
        let motion = Motion { span: [0.0, 1.0], middle, rows: vec![4, 1], law };
        glb::write(&path, &splats(), Some(&motion), false).expect("written");
        for &t in times {
            let said = Command::new("python3").arg(&script).arg(&path).arg(t.to_string()).output().expect("run");
            assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
            let said: Value = serde_json::from_slice(&said.stdout).expect("JSON");
            let ours = turn::flip(&motion.at(&splats(), t));
            for row in 0..6 {
                let read = |name: &str, i: usize| said[name][row][i].as_f64().expect("a number");
                for axis in 0..3 {
                    let (a, b) = (read("positions", axis), f64::from(ours.means[row][axis]));
                    assert!((a - b).abs() < ROUNDING, "row {row} at {t}: {a} and {b}");
                }
                let q = ours.quats[row].map(f64::from);
                let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                let theirs = [3, 0, 1, 2].map(|i| read("rotations", i));
                let dot: f64 = theirs.iter().zip(q).map(|(a, b)| a * b / norm).sum();
                // 1 - cos of half the angle between them.
                assert!((dot.abs() - 1.0).abs() < ROUNDING, "row {row} at {t}: {theirs:?} and {q:?}");
            }
        }
    }
}
