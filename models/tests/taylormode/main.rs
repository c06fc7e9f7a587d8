//! TaylorMoDe-GS: motion, blur, losses and model size against numbers that are known, on every device of the build.
//!
//! Files carry the name of the file they check. Bounds that are not argued where they stand are those of
//! `gs_tests::tolerance`.
#![recursion_limit = "256"]

mod bilinear;
mod blur_path;
mod blur_synthesis;
mod blur_weights;
mod depth_alignment;
mod exposure;
mod kinks;
mod light;
mod losses;
mod network;
mod order;
mod remainder;
mod rotation;
mod shrinkage;
mod summary;
mod taylor_motion;
mod velocity_map;
mod window;

use burn::tensor::{Int, Tensor, TensorData};
use gs_burn::Gaussians;
use gs_models::taylormode::{TaylorMotion, TimeWindow};
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
fn motion(place: &Place, random: &mut Random) -> TaylorMotion {
    TaylorMotion {
        rows: rows(place, &[4, 1, 2]),
        position: place.tensor(&random.values(27, -1.0, 1.0), [3, 9]),
        rotation: place.tensor(&random.values(18, -1.0, 1.0), [3, 6]),
        window: WINDOW,
        remainder: None,
        kinks: None,
    }
}

/// Slope of a line through `ln y` over `ln x`, least squares.
fn log_slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (x, y): (Vec<f64>, Vec<f64>) = x.iter().zip(y).map(|(x, y)| (x.ln(), y.ln())).unzip();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let above: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    above / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}
