//! Gaussians on the host.

/// The zeroth real spherical harmonic, `1 / (2 sqrt(pi))`.
pub(crate) const SH_C0: f64 = 0.282_094_791_773_878_14;

/// The half-step by which opacities of the bytes 0 and 255 are read: their logits would be infinite.
pub(crate) const ALPHA_LEAST: f64 = 0.5 / 255.0;

/// `N` Gaussians, axes as in the [crate's documentation](crate).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Splats {
    /// Means, scene units, relative to [`offset`](Self::offset).
    pub means: Vec<[f32; 3]>,
    /// The position in the world that is to be added to every mean, scene units: zero but for scenes far from their
    /// world's origin, whose places an `f32` cannot hold.
    pub offset: [f64; 3],
    /// Orientations, w x y z of any norm; zeros are drawn as the identity.
    pub quats: Vec<[f32; 4]>,
    /// Natural logarithms of the standard deviations, scene units.
    pub log_scales: Vec<[f32; 3]>,
    /// Opacities before the sigmoid.
    pub opacity_logits: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to 3.
    pub degree: usize,
    /// Spherical harmonics `[N, (degree + 1)^2]`, red green blue, the basis of 3DGS.
    pub sh: Vec<[f32; 3]>,
    /// Whether they were trained with antialiasing (the compensation of Mip-Splatting); `None` where nobody said.
    pub antialiased: Option<bool>,
}

impl Splats {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Coefficients a Gaussian and colour: `(degree + 1)^2`.
    pub fn coefficients(&self) -> usize {
        (self.degree + 1).pow(2)
    }

    /// Checks that all arrays are as long as they must be and every value is finite.
    ///
    /// # Errors
    /// A sentence without the file's name.
    pub fn check(&self) -> Result<(), String> {
        let n = self.len();
        let lengths = [self.quats.len(), self.log_scales.len(), self.opacity_logits.len()];
        if lengths != [n; 3] || self.sh.len() != n * self.coefficients() {
            return Err(format!("expected arrays of {n} Gaussians, found {lengths:?} and {} of SH", self.sh.len()));
        }
        fn bad<const D: usize>(values: &[[f32; D]]) -> Option<usize> {
            values.iter().position(|value| !value.iter().all(|x| x.is_finite()))
        }
        let opacity = || self.opacity_logits.iter().position(|x| !x.is_finite());
        let sh = || bad(&self.sh).map(|index| index / self.coefficients());
        let found = bad(&self.means)
            .map(|i| (i, "position"))
            .or_else(|| bad(&self.quats).map(|i| (i, "rotation")))
            .or_else(|| bad(&self.log_scales).map(|i| (i, "scale")))
            .or_else(|| opacity().map(|i| (i, "opacity")))
            .or_else(|| sh().map(|i| (i, "colour")));
        let Some((index, what)) = found else { return Ok(()) };
        let broken = (0..n).filter(|index| !self.is_finite(*index)).count();
        Err(format!(
            "Gaussian {index}: expected a {what} of finite numbers, found another ({broken} of {n} are broken)"
        ))
    }

    /// Whether every value of the Gaussian `index` is finite.
    pub(crate) fn is_finite(&self, index: usize) -> bool {
        let s = self.coefficients();
        let all = |values: &[f32]| values.iter().all(|x| x.is_finite());
        all(&self.means[index])
            && all(&self.quats[index])
            && all(&self.log_scales[index])
            && self.opacity_logits[index].is_finite()
            && all(self.sh[index * s..][..s].as_flattened())
    }

    /// The rows that are no Gaussians: a value is not finite, or the rotation is four zeros, as in rows that a program
    /// wrote beyond its last Gaussian.
    pub fn broken(&self) -> Vec<u32> {
        let is_broken = |row: &u32| !self.is_finite(*row as usize) || self.quats[*row as usize] == [0.0; 4];
        (0..self.len() as u32).filter(is_broken).collect()
    }

    /// With more harmonics, which are zero, up to `degree`.
    pub(crate) fn padded(mut self, degree: usize) -> Self {
        if degree > self.degree {
            let (before, after) = (self.coefficients(), (degree + 1).pow(2));
            let zeros = std::iter::repeat_n([0.0; 3], after - before);
            self.sh = self.sh.chunks(before).flat_map(|sh| sh.iter().copied().chain(zeros.clone())).collect();
            self.degree = degree;
        }
        self
    }

    /// The Gaussians with harmonics up to `degree` only.
    pub fn cut(mut self, degree: usize) -> Self {
        if degree < self.degree {
            let (before, after) = (self.coefficients(), (degree + 1).pow(2));
            self.sh = self.sh.chunks(before).flat_map(|sh| sh[..after].iter().copied()).collect();
            self.degree = degree;
        }
        self
    }

    /// The Gaussians `rows`, in this order.
    ///
    /// # Panics
    /// When there is no such row.
    pub fn select(&self, rows: &[u32]) -> Self {
        let s = self.coefficients();
        let pick = |row: &u32| *row as usize;
        Self {
            means: rows.iter().map(|row| self.means[pick(row)]).collect(),
            offset: self.offset,
            quats: rows.iter().map(|row| self.quats[pick(row)]).collect(),
            log_scales: rows.iter().map(|row| self.log_scales[pick(row)]).collect(),
            opacity_logits: rows.iter().map(|row| self.opacity_logits[pick(row)]).collect(),
            degree: self.degree,
            sh: rows.iter().flat_map(|row| self.sh[pick(row) * s..][..s].iter().copied()).collect(),
            antialiased: self.antialiased,
        }
    }
}

/// A quaternion of norm 1; the identity for one of norm 0.
pub(crate) fn unit(q: [f32; 4]) -> [f64; 4] {
    let q = q.map(f64::from);
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm > 0.0 { q.map(|x| x / norm) } else { [1.0, 0.0, 0.0, 0.0] }
}

/// [`unit`] in the order x y z w.
pub(crate) fn unit_xyzw(q: [f32; 4]) -> [f32; 4] {
    let [w, x, y, z] = unit(q);
    [x, y, z, w].map(|x| x as f32)
}

/// `1 / (1 + exp(-x))`.
pub(crate) fn sigmoid(logit: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(logit)).exp())
}

/// The inverse of [`sigmoid`] for an opacity between `least` and `1 - least`; others are clamped to these.
pub(crate) fn logit(opacity: f64, least: f64) -> f32 {
    let p = opacity.clamp(least, 1.0 - least);
    (p / (1.0 - p)).ln() as f32
}

#[cfg(test)]
pub(crate) mod testing {
    use super::Splats;

    /// A generator of numbers in -1 to 1 without a crate.
    pub fn numbers(mut seed: u64) -> impl FnMut() -> f32 {
        move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f32 / (1 << 23) as f32 - 1.0
        }
    }

    /// Gaussians of usual sizes and colours.
    pub fn random(count: usize, degree: usize, seed: u64) -> Splats {
        let mut x = numbers(seed);
        let mut splats = Splats { degree, antialiased: Some(false), ..Splats::default() };
        for _ in 0..count {
            splats.means.push([4.0 * x(), 4.0 * x(), 4.0 * x()]);
            splats.quats.push([x(), x(), x(), 0.2 + x().abs()]);
            splats.log_scales.push([x() - 3.0, x() - 3.0, x() - 3.0]);
            splats.opacity_logits.push(4.0 * x());
            splats.sh.push([x(), x(), x()]);
            splats.sh.extend((1..splats.coefficients()).map(|_| [0.5 * x(), 0.5 * x(), 0.5 * x()]));
        }
        splats
    }
}
