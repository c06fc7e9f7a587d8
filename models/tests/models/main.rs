//! Models against numbers that are known, on every device of the build.
//!
//! Files carry the name of the file they check. Bounds that are not argued where they stand are those of
//! `gs_tests::tolerance`.
#![recursion_limit = "256"]

mod camera_path;
mod depth_prior;
mod flux4d;
mod light;
mod mlp;
mod rotation;
mod scene;
mod sparsedyn;
mod taylormode;
mod training;

use burn::module::Module;
use burn::tensor::{Int, Tensor, TensorData};
use gs_burn::{Gaussians, map_parameters};
use gs_models::taylormode::{Paths, TimeWindow};
use gs_tests::devices::Place;
use gs_tests::scenes::Random;

/// A window that is neither centred at 0 nor of length 1.
const WINDOW: TimeWindow = TimeWindow { t0: 0.4, half: 0.25 };

/// Row numbers as a tensor.
fn rows(place: &Place, rows: &[i32]) -> Tensor<1, Int> {
    Tensor::from_data(TensorData::new(rows.to_vec(), [rows.len()]), &place.device)
}

/// Six Gaussians.
fn gaussians(place: &Place, random: &mut Random) -> Gaussians {
    let mut tensor = |columns: usize| random.values(6 * columns, -1.0, 1.0);
    Gaussians::from_tensors(
        place.tensor(&tensor(3), [6, 3]),
        place.tensor(&tensor(4), [6, 4]),
        place.tensor(&tensor(3), [6, 3]),
        place.tensor(&tensor(1), [6]),
        place.tensor(&tensor(3), [6, 1, 3]),
    )
}

/// Rows 4, 1 and 2 of the six move: position of order 3, rotation of order 2.
fn paths(place: &Place, random: &mut Random) -> Paths {
    Paths {
        rows: rows(place, &[4, 1, 2]),
        position: place.tensor(&random.values(27, -1.0, 1.0), [3, 9]),
        rotation: place.tensor(&random.values(18, -1.0, 1.0), [3, 6]),
        window: WINDOW,
        remainder: None,
        kinks: None,
    }
}

/// Rows that do not move, at orders 0.
fn standing(place: &Place, listed: &[i32]) -> Paths {
    let none = place.tensor(&[], [listed.len(), 0]);
    Paths {
        rows: rows(place, listed),
        position: none.clone(),
        rotation: none,
        window: WINDOW,
        remainder: None,
        kinks: None,
    }
}

/// `module` in the float type of `place`.
fn cast<M: Module>(module: M, place: &Place) -> M {
    map_parameters(module, |_, table| table.cast(place.dtype))
}

/// `module` with random numbers up to `size` in place of all it has learned, in the float type of `place`.
fn randomised<M: Module>(module: M, size: f64, place: &Place, random: &mut Random) -> M {
    map_parameters(module, |_, table| {
        let [rows, columns] = table.dims();
        place.tensor(&random.values(rows * columns, -size, size), [rows, columns])
    })
}

/// Slope of a line through `ln y` over `ln x`, least squares.
fn log_slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = x.iter().zip(y).map(|(x, y)| (x.ln(), y.ln())).unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let above: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    above / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}
