//! No more motion than a scene needs: every Gaussian keeps the lowest order whose path stays within a fraction of a pixel of
//! the present one in every training view; order 0 is a static Gaussian, which pays for no motion at all.
//!
//! A path is lowered by the polynomial of the next lower order that is nearest to it over the window in the largest
//! deviation: `s^k` minus `T_k(s) / 2^(k-1)`, `T_k` Chebyshev's, deviates by `2^(1-k)` at most (economisation). The constant
//! that this adds goes to the Gaussian's centre. Coefficient blocks are also shrunk by a soft threshold in pixels at each
//! selection (group lasso, proximal step), so that what the photos do not support fades.

use gs_datasets::View;

use crate::parameters::{Group, Parameters, from_host, to_host};
use crate::taylormode::config::MotionConfig;
use crate::taylormode::state::MotionState;

/// What a selection did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Selected {
    /// Orders taken from paths.
    pub lowered: usize,
    /// Gaussians that stopped moving.
    pub stopped: usize,
}

/// Selects once.
pub fn select(parameters: &mut Parameters, state: &mut MotionState, views: &[View], config: &MotionConfig) -> Selected {
    if state.rows.is_empty() {
        return Selected::default();
    }
    let device = parameters.device();
    let mut means = parameters.read(Group::Means);
    let log_scales = parameters.read(Group::LogScales);
    let scales: Vec<f64> = pixels_per_unit(&means, &state.rows, views);
    let (mut position, mut rotation) = (to_host(state.position.value.clone()), to_host(state.rotation.value.clone()));
    let columns = [state.position.value.dims()[1], state.rotation.value.dims()[1]];
    let mut selected = Selected::default();

    for (index, row) in state.rows.iter().enumerate() {
        let mean: &mut [f32; 3] = (&mut means[3 * *row as usize..][..3]).try_into().expect("three columns");
        let path = &mut position[columns[0] * index..][..columns[0]];
        shrink(path, config.shrink_pixels / scales[index]);
        let mut order = usize::from(state.orders[index]);
        while order > 0 && deviation(path, order) * scales[index] <= config.select_pixels {
            economise(path, order, mean);
            order -= 1;
            selected.lowered += 1;
        }
        state.orders[index] = order as u8;

        // A rotation moves the surface of a Gaussian by its angle times its size.
        let size = log_scales[3 * *row as usize..][..3].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        let pixels = f64::from(size).exp() * scales[index];
        let turn = &mut rotation[columns[1] * index..][..columns[1]];
        let mut order = usize::from(state.rotation_orders[index]);
        while order > 0 && deviation(turn, order) * pixels <= config.select_pixels {
            // The constant that economising a rotation adds is itself below the threshold and is left out.
            economise(turn, order, &mut [0.0; 3]);
            order -= 1;
        }
        state.rotation_orders[index] = order as u8;
    }
    *parameters.get_mut(Group::Means) = from_host(means, 3, &device);
    if columns[0] > 0 {
        state.position.value = from_host(position, columns[0], &device);
    }
    if columns[1] > 0 {
        state.rotation.value = from_host(rotation, columns[1], &device);
    }
    let moving: Vec<u32> = (0..state.rows.len() as u32)
        .filter(|i| state.orders[*i as usize] + state.rotation_orders[*i as usize] > 0)
        .collect();
    selected.stopped = state.rows.len() - moving.len();
    if selected.stopped > 0 {
        state.retain(&moving);
    }
    state.hold_orders();
    selected
}

/// Pixels that a displacement of one scene unit spans in the view that sees it largest, per moving row. Gaussians that no
/// camera has in front of it keep what they have.
pub(crate) fn pixels_per_unit(means: &[f32], rows: &[u32], views: &[View]) -> Vec<f64> {
    let mut cameras: Vec<(glam::DMat4, f64)> = Vec::new();
    for view in views {
        let camera = (view.c2w.inverse(), view.intrinsics.fx.max(view.intrinsics.fy));
        if !cameras.contains(&camera) {
            cameras.push(camera);
        }
    }
    rows.iter()
        .map(|row| {
            let mean: [f32; 3] = means[3 * *row as usize..][..3].try_into().expect("three columns");
            let place = glam::Vec3::from(mean).as_dvec3();
            let largest = cameras
                .iter()
                .filter_map(|(viewmat, focal)| {
                    let depth = viewmat.transform_point3(place).z;
                    (depth > 0.0).then(|| focal / depth)
                })
                .fold(0.0, f64::max);
            if largest > 0.0 { largest } else { f64::INFINITY }
        })
        .collect()
}

/// Largest deviation over the window of the path from the nearest of the next lower order, in the path's unit.
fn deviation(path: &[f32], order: usize) -> f64 {
    norm(block(path, order)) * 0.5f64.powi(order as i32 - 1)
}

/// Replaces the path of `order` by the nearest of the next lower order; what that adds to the constant goes to `centre`.
fn economise(path: &mut [f32], order: usize, centre: &mut [f32; 3]) {
    let leading: [f32; 3] = block(path, order).try_into().expect("three columns");
    let chebyshev = chebyshev(order);
    let unit = 0.5f64.powi(order as i32 - 1);
    for (power, coefficient) in chebyshev.iter().enumerate() {
        let part = leading.map(|x| (f64::from(x) * coefficient * unit) as f32);
        let target: &mut [f32] = if power == 0 { centre } else { &mut path[3 * (power - 1)..][..3] };
        for (value, part) in target.iter_mut().zip(part) {
            *value -= part;
        }
    }
    path[3 * (order - 1)..][..3].fill(0.0);
}

/// Coefficients of Chebyshev's polynomial by power, from the constant on: `T_{k+1} = 2 s T_k - T_{k-1}`.
fn chebyshev(order: usize) -> Vec<f64> {
    let (mut before, mut now) = (vec![1.0], vec![0.0, 1.0]);
    if order == 0 {
        return before;
    }
    for _ in 1..order {
        let mut next = vec![0.0; now.len() + 1];
        for (power, c) in now.iter().enumerate() {
            next[power + 1] += 2.0 * c;
        }
        for (power, c) in before.iter().enumerate() {
            next[power] -= c;
        }
        (before, now) = (now, next);
    }
    now
}

/// Soft threshold of every block.
fn shrink(path: &mut [f32], threshold: f64) {
    for block in path.chunks_exact_mut(3) {
        let length = norm(block);
        let factor = if length > threshold { 1.0 - threshold / length } else { 0.0 };
        block.iter_mut().for_each(|x| *x *= factor as f32);
    }
}

fn block(path: &[f32], order: usize) -> &[f32] {
    &path[3 * (order - 1)..][..3]
}

fn norm(block: &[f32]) -> f64 {
    block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(path: &[f32], s: f64) -> f64 {
        path.chunks_exact(3).enumerate().map(|(k, block)| f64::from(block[0]) * s.powi(k as i32 + 1)).sum()
    }

    #[test]
    fn a_lower_order_deviates_by_what_was_said() {
        for order in 1..=6 {
            let mut path: Vec<f32> = (0..18).map(|i| ((i * 7 + order) % 5) as f32 * 0.3 - 0.5).collect();
            path[3 * order..].fill(0.0);
            let (before, said) = (path.clone(), deviation(&path, order));
            let mut centre = [0.0; 3];
            economise(&mut path, order, &mut centre);
            let mut worst: f64 = 0.0;
            for i in 0..=2000 {
                let s = f64::from(i) * 1e-3 - 1.0;
                worst = worst.max((at(&before, s) - at(&path, s) - f64::from(centre[0])).abs());
            }
            // One axis of three deviates by at most the norm's share, and by exactly its own leading coefficient's.
            let own = f64::from(before[3 * (order - 1)]).abs() * 0.5f64.powi(order as i32 - 1);
            assert!((worst - own).abs() < 1e-5 && worst <= said + 1e-5, "order {order}: {worst} {own} {said}");
        }
    }

    #[test]
    fn a_soft_threshold_takes_its_length_off() {
        let mut path = [3.0, 0.0, 4.0, 0.01, 0.0, 0.0];
        shrink(&mut path, 1.0);
        assert!((norm(&path[..3]) - 4.0).abs() < 1e-6);
        assert_eq!(path[3..], [0.0; 3]);
    }
}
