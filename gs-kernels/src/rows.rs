//! The packed rows that kernels exchange, as named fields; this module alone knows the offsets.

/// Floats in a projected row.
pub const PROJECTED: usize = 8;

/// Floats in a screen-gradient row: the gradient with respect to the 2D mean in pixels (x, y), summed over pixels, and
/// the sum over pixels of its absolute contributions (x, y). Density control reads it.
pub const SCREEN: usize = 4;

/// A projected Gaussian.
///
/// The conic (inverse 2D covariance) is kept in `L D L^T` form,
/// `sigma(dx, dy) = 1/2 (d1 (dx + l dy)^2 + d2 dy^2)`: in the usual form (xx, xy, yy) the terms of a long needle cancel
/// and `f32` loses it. `xx = d1`, `xy = d1 l`, `yy = d1 l^2 + d2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedRow<F> {
    /// Projected centre, pixels; the centre of the first pixel is (0.5, 0.5).
    pub mean: [F; 2],
    /// `[d1, l, d2]`, see above: per square pixel, none, per square pixel.
    pub conic: [F; 3],
    /// Camera z of the centre, scene units.
    pub depth: F,
    /// Factor of the opacity that compensates the dilation's brightening (1 unless anti-aliased).
    pub compensation: F,
    /// Bounding radius in pixels of the opaque ellipse at the alpha cut-off; 0 for a culled Gaussian, whose other
    /// fields are 0 too.
    pub radius: F,
}

/// Offset of the depth inside a projected row.
pub const DEPTH: usize = 5;

impl<F: Copy> ProjectedRow<F> {
    /// Row `index` of a packed buffer.
    #[inline(always)]
    pub fn read(rows: &[F], index: usize) -> Self {
        let r: &[F; PROJECTED] = rows[index * PROJECTED..][..PROJECTED].try_into().expect("a whole row");
        Self { mean: [r[0], r[1]], conic: [r[2], r[3], r[4]], depth: r[DEPTH], compensation: r[6], radius: r[7] }
    }

    /// The row as packed floats.
    #[inline(always)]
    pub fn pack(&self) -> [F; PROJECTED] {
        let [x, y] = self.mean;
        let [d1, l, d2] = self.conic;
        [x, y, d1, l, d2, self.depth, self.compensation, self.radius]
    }
}
