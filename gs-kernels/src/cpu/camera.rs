//! A camera's pose and the pinhole projection of a point with its Jacobian.

use crate::config::ProjectionConfig;
use crate::cpu::Real;
use crate::cpu::math::{Mat3, Vec3, combine, dot, mat_vec};
use crate::cpu::real::{Lanes, Number};
use crate::cpu::wide::Wide;

/// World-to-camera rotation and translation.
#[derive(Clone, Copy, Debug)]
pub struct Pose<F> {
    /// Rows of the rotation.
    pub rotation: Mat3<F>,
    /// Translation, scene units.
    pub translation: Vec3<F>,
}

impl<F: Real> Pose<F> {
    /// From a row-major 4x4 `viewmat`.
    ///
    /// # Panics
    /// When `viewmat` does not hold 16 values.
    pub fn read(viewmat: &[F]) -> Self {
        assert_eq!(viewmat.len(), 16, "viewmat must hold 16 values");
        let m = |i: usize, j: usize| viewmat[4 * i + j];
        Self {
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| m(i, j))),
            translation: std::array::from_fn(|i| m(i, 3)),
        }
    }

    /// The camera's centre in the world, `-R^T t`.
    pub fn centre(&self) -> Vec3<F> {
        crate::cpu::math::mat_t_vec(&self.rotation, self.translation).map(|c| -c)
    }

    /// The same pose for sixteen points.
    #[inline(always)]
    pub fn wide<L: Lanes<Real = F>>(&self) -> Pose<Wide<L>> {
        let mut wide = Pose { rotation: [[Wide::of(0.0); 3]; 3], translation: [Wide::of(0.0); 3] };
        for i in 0..3 {
            wide.translation[i] = Wide::splat(self.translation[i]);
            for j in 0..3 {
                wide.rotation[i][j] = Wide::splat(self.rotation[i][j]);
            }
        }
        wide
    }
}

impl<N: Number> Pose<N> {
    /// A world point in camera axes.
    #[inline(always)]
    pub fn apply(&self, point: Vec3<N>) -> Vec3<N> {
        let p = mat_vec(&self.rotation, point);
        [p[0] + self.translation[0], p[1] + self.translation[1], p[2] + self.translation[2]]
    }
}

/// Sums of gradients by a [`Pose`].
#[derive(Clone, Copy, Debug, Default)]
pub struct PoseGradient<F> {
    /// By the rotation's entries.
    pub rotation: Mat3<F>,
    /// By the translation.
    pub translation: Vec3<F>,
}

impl<L: Lanes> PoseGradient<Wide<L>> {
    /// No gradient.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { rotation: [[Wide::of(0.0); 3]; 3], translation: [Wide::of(0.0); 3] }
    }

    /// Adds the lanes of another sum where the mask holds.
    #[inline(always)]
    pub fn add_where(&mut self, mask: L::Mask, other: &Self) {
        let zero = Wide::of(0.0);
        for i in 0..3 {
            self.translation[i] += Wide::select(mask, other.translation[i], zero);
            for j in 0..3 {
                self.rotation[i][j] += Wide::select(mask, other.rotation[i][j], zero);
            }
        }
    }

    /// Sum over the lanes.
    #[inline(always)]
    pub fn sum(&self) -> PoseGradient<L::Real> {
        let mut sum = PoseGradient::default();
        for i in 0..3 {
            sum.translation[i] = self.translation[i].0.sum();
            for j in 0..3 {
                sum.rotation[i][j] = self.rotation[i][j].0.sum();
            }
        }
        sum
    }
}

impl<F: Real> PoseGradient<F> {
    /// Adds another sum.
    pub fn add(&mut self, other: &Self) {
        for i in 0..3 {
            self.translation[i] += other.translation[i];
            for j in 0..3 {
                self.rotation[i][j] += other.rotation[i][j];
            }
        }
    }

    /// The gradient of a row-major 4x4 `viewmat`; sums that are not finite become zero.
    pub fn into_viewmat(self) -> Vec<F> {
        let mut v = vec![F::ZERO; 16];
        for i in 0..3 {
            v[4 * i..4 * i + 3].copy_from_slice(&self.rotation[i]);
            v[4 * i + 3] = self.translation[i];
        }
        if v.iter().any(|x| !x.is_finite()) {
            v.fill(F::ZERO);
        }
        v
    }
}

/// The intrinsics a kernel uses, in its own float type.
#[derive(Clone, Copy, Debug)]
pub struct Pinhole<F> {
    /// Focal lengths, pixels.
    pub focal: [F; 2],
    /// Principal point, pixels.
    pub principal: [F; 2],
    /// Bounds of `x / z` then `y / z` for the Jacobian: `[[x_min, x_max], [y_min, y_max]]`.
    pub limits: [[F; 2]; 2],
}

impl<F: Real> Pinhole<F> {
    /// From a projection's configuration.
    pub fn new(config: &ProjectionConfig) -> Self {
        let [x0, x1, y0, y1] = config.frustum_limits().map(F::of);
        Self {
            focal: [F::of(config.fx), F::of(config.fy)],
            principal: [F::of(config.cx), F::of(config.cy)],
            limits: [[x0, x1], [y0, y1]],
        }
    }

    /// The same intrinsics for sixteen points.
    #[inline(always)]
    pub fn wide<L: Lanes<Real = F>>(&self) -> Pinhole<Wide<L>> {
        let two = |[a, b]: [F; 2]| [Wide::splat(a), Wide::splat(b)];
        Pinhole {
            focal: two(self.focal),
            principal: two(self.principal),
            limits: [two(self.limits[0]), two(self.limits[1])],
        }
    }
}

impl<L: Lanes> Pinhole<Wide<L>> {
    /// Rows of `J R`: how the pixel moves with the world point, `[2][3]`, linearised inside the limits.
    #[inline(always)]
    pub fn jacobian(&self, p: Vec3<Wide<L>>, rotation: &Mat3<Wide<L>>) -> [Vec3<Wide<L>>; 2] {
        let mut rows = [[Wide::of(0.0); 3]; 2];
        for (k, row) in rows.iter_mut().enumerate() {
            let scale = self.focal[k] / p[2];
            *row = combine(scale, rotation[k], -scale * self.slope(k, p).0, rotation[2]);
        }
        rows
    }

    /// Adds to `v_p` (camera point) and `v_rotation` the gradients from `v`, the gradient by [`Pinhole::jacobian`].
    #[inline(always)]
    pub fn jacobian_vjp(
        &self,
        p: Vec3<Wide<L>>,
        rotation: &Mat3<Wide<L>>,
        v: [Vec3<Wide<L>>; 2],
        v_p: &mut Vec3<Wide<L>>,
        v_rotation: &mut Mat3<Wide<L>>,
    ) {
        for k in 0..2 {
            let scale = self.focal[k] / p[2];
            let (slope, free) = self.slope(k, p);
            let v_scale = dot(v[k], rotation[k]) - slope * dot(v[k], rotation[2]);
            let v_slope = -scale * dot(v[k], rotation[2]);
            v_p[2] -= v_scale * scale / p[2];
            let v_slope = Wide::select(free, v_slope, Wide::of(0.0));
            v_p[k] += v_slope / p[2];
            v_p[2] -= v_slope * slope / p[2];
            for j in 0..3 {
                v_rotation[k][j] += scale * v[k][j];
                v_rotation[2][j] -= scale * slope * v[k][j];
            }
        }
    }

    /// `p[k] / z` clamped to the limits, and a mask of the lanes inside them.
    #[inline(always)]
    fn slope(&self, k: usize, p: Vec3<Wide<L>>) -> (Wide<L>, L::Mask) {
        let slope = p[k] / p[2];
        let [low, high] = self.limits[k];
        (Wide(slope.0.max(low.0).min(high.0)), slope.within(low, high))
    }
}
