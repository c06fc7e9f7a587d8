//! Bodies as least squares fits to the paths of their rows, on the host, for [`select`](super::select).

use burn::module::Param;
use burn::tensor::Device;
use glam::DVec3;
use gs_base::dense::solve_columns;
use gs_base::median;
use gs_models::taylormode::bodies::turn_of;
use gs_models::taylormode::window::amplitude;
use gs_models::taylormode::{Body, BodyFrame};
use gs_train::fit::parameters::from_host;

/// The paths of all moving rows on the host.
pub struct PathTable {
    /// `[M]`, centres at `t0`.
    pub positions: Vec<[f32; 3]>,
    /// `[M][3 (K + J)]`: blocks of the polynomials, then of the contacts.
    pub paths: Vec<Vec<f32>>,
    /// `[M]`, pixels that a scene unit spans.
    pub scales: Vec<f64>,
    /// `K`.
    pub order: usize,
}

impl PathTable {
    /// How far block `k` (from 0) of a path goes, in lengths of the block: a ramp of slope 1 over half a window goes as
    /// far as the first polynomial.
    pub fn reach(&self, k: usize) -> f64 {
        if k < self.order { amplitude(k + 1) } else { 1.0 }
    }

    /// Distance of a row's path from `carried`, pixels: the sum over the blocks.
    pub fn missed(&self, row: usize, carried: &[f32]) -> f64 {
        let blocks = self.paths[row].chunks_exact(3).zip(carried.chunks_exact(3)).enumerate();
        let missed = |(k, (own, carried)): (usize, (&[f32], &[f32]))| {
            let square: f64 = own.iter().zip(carried).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            square.sqrt() * self.reach(k)
        };
        blocks.map(missed).sum::<f64>() * self.scales[row]
    }
}

/// A body that carries rows.
#[derive(Debug, Clone)]
pub struct Carrier {
    /// Where it is.
    pub frame: BodyFrame,
    /// `[K + J]`: `W_k`, for each of the four numbers of the basis a vector.
    blocks: Vec<[DVec3; 4]>,
    /// `[3 Kr]`, its turn.
    pub turn: Vec<f64>,
}

/// Fewest rows that a body is fitted to: three times its numbers of one block.
pub const FEWEST: usize = 12;

/// Added to the diagonal of the normal equations, as a share of its sum: a direction in which the rows do not extend
/// gets no gradient.
const RIDGE: f64 = 1e-6;

/// Rows that are farther from a fit than this many medians do not take part in the next: they belong to another body,
/// or to none.
const OUTLIER: f64 = 3.0;

/// Fits of a body, each without the outliers of the one before.
const FITS: usize = 3;

impl Carrier {
    /// The body whose motion is nearest to the paths of `rows`; `None` for fewer than [`FEWEST`].
    pub fn fit(frame: BodyFrame, rows: &[usize], table: &PathTable, rotation_order: usize) -> Option<Self> {
        if rows.len() < FEWEST {
            return None;
        }
        let mut fitted = Self::through(frame, rows, table);
        for _ in 1..FITS {
            let missed: Vec<f64> = rows.iter().map(|row| table.missed(*row, &fitted.carried(*row, table))).collect();
            let limit = OUTLIER * median(missed.clone())?;
            let near = rows.iter().zip(&missed).filter(|(_, missed)| **missed <= limit);
            fitted = Self::through(frame, &near.map(|(row, _)| *row).collect::<Vec<_>>(), table);
        }
        let linear: Vec<[DVec3; 3]> = fitted.blocks[..usize::from(frame.order)]
            .iter()
            .map(|block| [block[1] / frame.scale, block[2] / frame.scale, block[3] / frame.scale])
            .collect();
        fitted.turn = turn_of(&linear, rotation_order);
        Some(fitted)
    }

    fn through(frame: BodyFrame, rows: &[usize], table: &PathTable) -> Self {
        let bases: Vec<[f64; 4]> = rows.iter().map(|row| frame.basis_at(&table.positions[*row])).collect();
        let count = table.paths.first().map_or(0, |path| path.len() / 3);
        let mut square = [[0.0; 4]; 4];
        for basis in &bases {
            (0..16).for_each(|i| square[i / 4][i % 4] += basis[i / 4] * basis[i % 4]);
        }
        let ridge = RIDGE * (0..4).map(|i| square[i][i]).sum::<f64>().max(f64::MIN_POSITIVE);
        (0..4).for_each(|i| square[i][i] += ridge);
        let block = |k: usize| {
            let mut normal: Vec<Vec<f64>> = square.iter().map(|row| [row.as_slice(), &[0.0; 3]].concat()).collect();
            for (row, basis) in rows.iter().zip(&bases) {
                let own = &table.paths[*row][3 * k..][..3];
                (0..12).for_each(|i| normal[i / 3][4 + i % 3] += basis[i / 3] * f64::from(own[i % 3]));
            }
            let solved = solve_columns::<3>(normal);
            [0, 1, 2, 3].map(|i| DVec3::from(solved[i]))
        };
        Self { frame, blocks: (0..count).map(block).collect(), turn: Vec::new() }
    }

    /// The path of a row that follows, `[3 (K + J)]`.
    pub fn carried(&self, row: usize, table: &PathTable) -> Vec<f32> {
        let basis = self.frame.basis_at(&table.positions[row]);
        let sum = |block: &[DVec3; 4]| -> DVec3 { block.iter().zip(basis).map(|(vector, x)| *vector * x).sum() };
        self.blocks.iter().flat_map(|block| sum(block).as_vec3().to_array()).collect()
    }

    /// The body as a parameter of the motion.
    pub fn body(&self, like: &Body, device: &Device) -> Body {
        let value = |index: usize| {
            let (row, column) = (index / (3 * self.blocks.len()), index % (3 * self.blocks.len()));
            self.blocks[column / 3][row][column % 3] as f32
        };
        let columns = 3 * self.blocks.len();
        let blocks = from_host((0..4 * columns).map(value).collect(), columns, device);
        let turn = from_host(self.turn.iter().map(|x| *x as f32).collect(), self.turn.len(), device);
        Body {
            blocks: Param::initialized(like.blocks.id, blocks),
            turn: Param::initialized(like.turn.id, turn),
            frame: self.frame,
        }
    }
}
