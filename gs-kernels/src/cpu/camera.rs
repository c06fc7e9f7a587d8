//! A camera's pose and the pinhole projection of a point with its Jacobian.

use crate::config::ProjectionConfig;
use crate::cpu::Real;
use crate::cpu::math::{Mat3, Vec3, combine, dot, mat_vec};

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

    /// The camera's place in the world, `-R^T t`.
    pub fn centre(&self) -> Vec3<F> {
        crate::cpu::math::mat_t_vec(&self.rotation, self.translation).map(|c| -c)
    }

    /// A world point in camera axes.
    #[inline(always)]
    pub fn apply(&self, point: Vec3<F>) -> Vec3<F> {
        let p = mat_vec(&self.rotation, point);
        std::array::from_fn(|i| p[i] + self.translation[i])
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

    /// As the gradient of a row-major 4x4 `viewmat`; not finite sums become zero.
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

    /// Rows of `J R`: how the pixel moves with the world point, `[2][3]`, linearised inside the limits.
    #[inline(always)]
    pub fn jacobian(&self, p: Vec3<F>, rotation: &Mat3<F>) -> [Vec3<F>; 2] {
        std::array::from_fn(|k| {
            let scale = self.focal[k] / p[2];
            combine(scale, rotation[k], -scale * self.slope(k, p).0, rotation[2])
        })
    }

    /// Adds to `v_p` (camera point) and `v_rotation` the gradients from `v`, the gradient by [`Pinhole::jacobian`].
    #[inline(always)]
    pub fn jacobian_vjp(
        &self,
        p: Vec3<F>,
        rotation: &Mat3<F>,
        v: [Vec3<F>; 2],
        v_p: &mut Vec3<F>,
        v_rotation: &mut Mat3<F>,
    ) {
        for k in 0..2 {
            let scale = self.focal[k] / p[2];
            let (slope, free) = self.slope(k, p);
            let v_scale = dot(v[k], rotation[k]) - slope * dot(v[k], rotation[2]);
            let v_slope = -scale * dot(v[k], rotation[2]);
            v_p[2] -= v_scale * scale / p[2];
            if free {
                v_p[k] += v_slope / p[2];
                v_p[2] -= v_slope * slope / p[2];
            }
            for j in 0..3 {
                v_rotation[k][j] += scale * v[k][j];
                v_rotation[2][j] -= scale * slope * v[k][j];
            }
        }
    }

    /// `p[k] / z` held inside the limits, and whether it was free.
    #[inline(always)]
    fn slope(&self, k: usize, p: Vec3<F>) -> (F, bool) {
        let slope = p[k] / p[2];
        let [low, high] = self.limits[k];
        if slope < low {
            (low, false)
        } else if slope > high {
            (high, false)
        } else {
            (slope, true)
        }
    }
}
