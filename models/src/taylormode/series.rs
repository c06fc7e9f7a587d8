//! The paths written out as series of functions of time, for programs that know neither tensors nor networks: the crate
//! [`gs_formats`].
//!
//! Nothing is lost: polynomial, remainder and kinks are sums of fixed functions of time with a vector for each Gaussian, and so are
//! the returns to straight lines outside the window.

use burn::tensor::Tensor;
use gs_formats::{Beyond, Series, SeriesLaw, Shape, TimeFunction};

use super::paths::Paths;
use super::window::{FADE, Sample, best_line, powers};

impl Paths {
    /// The law of the moving rows.
    pub fn series(&self) -> SeriesLaw {
        let (order, turning) = (self.order(), self.rotation_order());
        let power = |order: usize| (1..=order as u32).map(Shape::Power).collect::<Vec<_>>();
        let mut position = functions(power(order), |s| powers(s, order).collect());
        let mut blocks = vec![self.position.clone()];
        if let Some(rest) = &self.remainder {
            position.extend(functions(rest.shapes(), |s| rest.functions(s)));
            blocks.push(rest.weights.clone());
        }
        if let Some(kinks) = &self.kinks {
            let ramps = kinks.contacts.iter().map(|contact| Shape::Ramp { near: contact.near, far: contact.far });
            position.extend(functions(ramps.collect(), |s| kinks.functions(s)));
            blocks.push(kinks.jumps.val());
        }
        let rotation = functions(power(turning), |s| powers(s, turning).collect());
        SeriesLaw {
            t0: self.window.t0,
            half: self.window.half,
            position: Series { functions: position, vectors: vectors(blocks) },
            rotation: Series { functions: rotation, vectors: vectors(vec![self.rotation.clone()]) },
        }
    }
}

/// Each shape with its return to a straight line; `at` gives values and slopes inside the window.
fn functions(shapes: Vec<Shape>, at: impl Fn(f64) -> Vec<Sample>) -> Vec<TimeFunction> {
    let edges = [-1.0, 1.0].map(&at);
    let edge = |index: usize| [0, 1].map(|side: usize| [edges[side][index].value, edges[side][index].slope]);
    let line = |index: usize| best_line(|s| at(s)[index].value);
    let beyond = |index: usize| Beyond { line: line(index), edges: edge(index), fade: FADE };
    shapes.into_iter().enumerate().map(|(i, shape)| TimeFunction { shape, beyond: Some(beyond(i)) }).collect()
}

/// The blocks of three of each row, from tensors `[M, 3 K]` side by side.
fn vectors(blocks: Vec<Tensor<2>>) -> Vec<[f32; 3]> {
    let rows = blocks.first().map_or(0, |block| block.dims()[0]);
    let host = |block: Tensor<2>| (block.dims()[1], block.inner().into_data().iter::<f32>().collect::<Vec<f32>>());
    let blocks: Vec<(usize, Vec<f32>)> = blocks.into_iter().filter(|block| block.dims()[1] > 0).map(host).collect();
    let row = |row: usize| blocks.iter().flat_map(move |(each, values)| values[row * each..][..*each].chunks_exact(3));
    (0..rows).flat_map(row).map(|v| [v[0], v[1], v[2]]).collect()
}
