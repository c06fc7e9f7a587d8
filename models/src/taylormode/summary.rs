//! Size of a scene: its numbers, and the numbers of the same scene at one fixed order for all Gaussians.

/// Numbers of one Gaussian besides colour and motion: centre 3, orientation 4, size 3, opacity 1.
const SHAPE: usize = 11;
/// Bytes of a stored number, and of a row number.
const BYTES: usize = 4;

/// Counts of what a scene stores.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Size {
    /// Gaussians, static ones included.
    pub gaussians: usize,
    /// SH coefficients in use, of all Gaussians together: 1, 4, 9 or 16 each.
    pub sh_coefficients: usize,
    /// Order of the position of each moving Gaussian.
    pub position_orders: Vec<usize>,
    /// Order of the rotation of each moving Gaussian.
    pub rotation_orders: Vec<usize>,
    /// Numbers of the networks that are needed to render.
    pub network: usize,
}

/// The same scene at one fixed order: every Gaussian moves, all at these orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FixedOrder {
    /// Gaussians.
    pub gaussians: usize,
    /// SH coefficients of one Gaussian.
    pub sh_coefficients: usize,
    /// Order of every position.
    pub position: usize,
    /// Order of every rotation.
    pub rotation: usize,
}

impl FixedOrder {
    /// How many numbers it stores.
    pub fn parameters(&self) -> usize {
        self.gaussians * (SHAPE + 3 * self.sh_coefficients + 3 * self.position + 3 * self.rotation)
    }
}

/// For reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Gaussians.
    pub count: usize,
    /// Share of them that does not move, 0 to 1.
    pub static_share: f64,
    /// Mean order of the position over all Gaussians, static ones being order 0.
    pub mean_order: f64,
    /// How many Gaussians have each order of position, from 0. A Gaussian that only turns has order 0 here and is not
    /// static.
    pub histogram: Vec<usize>,
    /// Numbers stored.
    pub parameters: usize,
    /// Bytes of them, with the numbers of the rows that move.
    pub bytes: usize,
    /// Numbers of the fixed-order model beside it.
    pub fixed_order_parameters: usize,
}

impl Summary {
    /// Counts `size`, beside `fixed`.
    pub fn new(size: &Size, fixed: &FixedOrder) -> Self {
        let moving = size.position_orders.len().max(size.rotation_orders.len());
        let highest = size.position_orders.iter().max().copied().unwrap_or(0);
        let mut histogram = vec![0; highest + 1];
        size.position_orders.iter().for_each(|order| histogram[*order] += 1);
        histogram[0] += size.gaussians.saturating_sub(size.position_orders.len());
        let blocks: usize = size.position_orders.iter().chain(&size.rotation_orders).sum();
        let parameters = size.gaussians * SHAPE + 3 * size.sh_coefficients + 3 * blocks + size.network;
        let all = size.gaussians.max(1) as f64;
        Self {
            count: size.gaussians,
            static_share: size.gaussians.saturating_sub(moving) as f64 / all,
            mean_order: size.position_orders.iter().sum::<usize>() as f64 / all,
            histogram,
            parameters,
            bytes: BYTES * (parameters + moving),
            fixed_order_parameters: fixed.parameters(),
        }
    }

    /// Share of the fixed-order model's numbers that this one does without; negative when it has more.
    pub fn saved(&self) -> f64 {
        1.0 - self.parameters as f64 / self.fixed_order_parameters.max(1) as f64
    }
}
