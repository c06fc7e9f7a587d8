//! How a lens bends an image: [`Distortion`].

/// The OpenCV lens model, from ideal to observed normalised coordinates (`r2 = x^2 + y^2`):
///
/// ```text
/// g  = (1 + k1 r2 + k2 r2^2 + k3 r2^3 + k4 r2^4) / (1 + d1 r2 + d2 r2^2 + d3 r2^3)
/// x' = x g + 2 p1 x y + p2 (r2 + 2 x^2) + s1 r2
/// y' = y g + p1 (r2 + 2 y^2) + 2 p2 x y + s2 r2
/// ```
///
/// Every pinhole and radial model is a case of it: COLMAP's RADIAL has k1 and k2, OPENCV adds p1 and p2, FULL_OPENCV
/// adds k3 and d (its k4..k6); nerfstudio's polynomial has k1..k4. Fisheye models bend the angle to the optical axis in
/// place of its tangent: OPENCV_FISHEYE has k1..k4, THIN_PRISM_FISHEYE adds p1, p2 and s (its sx1 and sy1).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    /// k1 to k4.
    pub k: [f64; 4],
    /// d1 to d3.
    pub d: [f64; 3],
    /// p1 and p2.
    pub p: [f64; 2],
    /// s1 and s2.
    pub s: [f64; 2],
}

impl Distortion {
    /// Whether the lens is an ideal pinhole.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether all coefficients are finite.
    pub fn is_finite(&self) -> bool {
        self.k.iter().chain(&self.d).chain(&self.p).chain(&self.s).all(|value| value.is_finite())
    }

    /// The observed position of the ideal point (x, y), both in normalised coordinates.
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let g = self.radial(r2);
        let ([p1, p2], [s1, s2]) = (self.p, self.s);
        (
            x * g + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + s1 * r2,
            y * g + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + s2 * r2,
        )
    }

    /// Whether the lens bends alike in all directions from the principal point.
    pub(crate) fn is_radial(&self) -> bool {
        self.p == [0.0; 2] && self.s == [0.0; 2]
    }

    /// The determinant of the derivative of [`apply`](Self::apply) at the ideal point (x, y). From the middle on it is
    /// above 0 up to where the model folds.
    pub(crate) fn determinant(&self, x: f64, y: f64) -> f64 {
        let r2 = x * x + y * y;
        let [k1, k2, k3, k4] = self.k;
        let [d1, d2, d3] = self.d;
        let ([p1, p2], [s1, s2]) = (self.p, self.s);
        let (above, below) = (1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))), 1.0 + r2 * (d1 + r2 * (d2 + r2 * d3)));
        let above_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k4));
        let below_slope = d1 + r2 * (2.0 * d2 + r2 * 3.0 * d3);
        let (g, slope) = (above / below, (above_slope * below - above * below_slope) / (below * below));
        let xx = g + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * s1 * x;
        let yy = g + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + 2.0 * s2 * y;
        let xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        // Where both directions turn back at once, the product is above 0 again.
        if below > 0.0 && xx + yy > 0.0 { xx * yy - (xy + 2.0 * s1 * y) * (xy + 2.0 * s2 * x) } else { -1.0 }
    }

    fn radial(&self, r2: f64) -> f64 {
        let [k1, k2, k3, k4] = self.k;
        let [d1, d2, d3] = self.d;
        let g = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
        // A division is a third of the work per pixel, and only FULL_OPENCV needs it.
        if self.d == [0.0; 3] { g } else { g / (1.0 + r2 * (d1 + r2 * (d2 + r2 * d3))) }
    }

    /// The squared radius up to which the observed radius `r g(r^2)` grows with the ideal radius `r`, at most `limit`.
    /// Beyond it the polynomial folds back and would show parts of the photo a second time.
    pub(crate) fn valid_radius2(&self, limit: f64) -> f64 {
        const STEPS: usize = 1024;
        let end = limit.sqrt();
        let mut last = 0.0;
        for step in 1..=STEPS {
            let r = end * step as f64 / STEPS as f64;
            let observed = r * self.radial(r * r);
            // NaN is a pole of the rational form and ends the search too.
            if observed.is_nan() || observed <= last {
                let before = end * (step - 1) as f64 / STEPS as f64;
                return before * before;
            }
            last = observed;
        }
        limit
    }
}
