//! Operations of density control on a host copy of the table, [`Draft`]: read once, changed row by row, written back
//! once.
//!
//! A draft holds only the columns whose numbers change (means, scales, opacities). All others (rotations, SH, the
//! optimiser's moments) follow by row number when the draft is committed, so that rows stay consistent.

use glam::{Quat, Vec3};
use gs_burn::Gaussians;
use rand::Rng;

use crate::fit::parameters::{Group, Table, from_host, indices};
use gs_burn::RowMap;
use gs_burn::adam::Adam;

/// Most copies of one Gaussian in one refinement (3DGS-MCMC tabulates its binomials up to here).
pub const MAX_COPIES: usize = 51;

/// Highest opacity that an operation writes: its logit must be finite.
const OPACITY_MAX: f64 = 1.0 - 1e-6;

/// A table of Gaussians being changed.
#[derive(Debug, Clone)]
pub struct Draft {
    /// For each new row, the old row of its other columns.
    from: Vec<u32>,
    /// Whether the row's moments are reset to zero.
    reset: Vec<bool>,
    /// Means, scene units.
    pub means: Vec<[f32; 3]>,
    /// Logarithms of the scales.
    pub log_scales: Vec<[f32; 3]>,
    /// Opacity logits.
    pub opacity_logits: Vec<f32>,
}

impl Draft {
    /// A draft equal to the table.
    pub fn read(gaussians: &Gaussians) -> Self {
        let triples = |group| gaussians.read(group).as_chunks::<3>().0.to_vec();
        Self {
            from: (0..gaussians.len() as u32).collect(),
            reset: vec![false; gaussians.len()],
            means: triples(Group::Means),
            log_scales: triples(Group::LogScales),
            opacity_logits: gaussians.read(Group::Opacity),
        }
    }

    /// Rows of the draft.
    pub fn len(&self) -> usize {
        self.from.len()
    }

    /// Whether the draft has no rows.
    pub fn is_empty(&self) -> bool {
        self.from.is_empty()
    }

    /// The opacity of a row, 0 to 1.
    pub fn opacity(&self, row: usize) -> f64 {
        sigmoid(f64::from(self.opacity_logits[row]))
    }

    /// The largest of a row's three scales, scene units.
    pub fn size(&self, row: usize) -> f64 {
        let largest = self.log_scales[row].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        f64::from(largest).exp()
    }

    /// Sets a row's opacity, 0 to 1.
    pub fn set_opacity(&mut self, row: usize, opacity: f64) {
        self.opacity_logits[row] = logit(opacity.min(OPACITY_MAX)) as f32;
    }

    /// Multiplies a row's scales.
    pub fn scale(&mut self, row: usize, factor: f64) {
        self.log_scales[row] = self.log_scales[row].map(|s| s + factor.ln() as f32);
    }

    /// Resets a row's moments to zero.
    pub fn forget(&mut self, row: usize) {
        self.reset[row] = true;
    }

    /// Appends a copy of a row, with zero moments, and returns its number.
    pub fn duplicate(&mut self, row: usize) -> usize {
        self.from.push(self.from[row]);
        self.reset.push(true);
        self.means.push(self.means[row]);
        self.log_scales.push(self.log_scales[row]);
        self.opacity_logits.push(self.opacity_logits[row]);
        self.len() - 1
    }

    /// Makes row `to` a copy of row `from`, with zero moments.
    pub fn overwrite(&mut self, to: usize, from: usize) {
        self.from[to] = self.from[from];
        self.reset[to] = true;
        self.means[to] = self.means[from];
        self.log_scales[to] = self.log_scales[from];
        self.opacity_logits[to] = self.opacity_logits[from];
    }

    /// Lowers opacity and scale of every row in `rows` so that, with one copy per mention, it looks as before; see
    /// [`relocation`]. The moments are reset.
    pub fn share_out(&mut self, rows: &[usize], min_opacity: f64) {
        let copies = self.mentions(rows);
        for row in 0..copies.len() {
            if copies[row] > 0 {
                let (opacity, factor) = relocation(self.opacity(row), copies[row] + 1);
                self.set_opacity(row, opacity.max(min_opacity));
                self.scale(row, factor);
                self.forget(row);
            }
        }
    }

    /// Moves every row in `rows` and its copies, one per mention, apart along the row's longest axis: `separation`,
    /// below 1, is their root mean square distance from its mean in standard deviations. They shrink along that axis so
    /// that together they keep the variance, and their opacity rises by as much. Returns the copies' means in the order
    /// of mention. To be called after [`Draft::share_out`]; `quats` are the table's, `[N, 4]`. A row whose numbers are
    /// not finite stays, with its copies.
    pub fn spread_out(&mut self, rows: &[usize], quats: &[f32], separation: f64) -> Vec<[f32; 3]> {
        if separation == 0.0 {
            return rows.iter().map(|row| self.means[*row]).collect();
        }
        let copies = self.mentions(rows);
        let moved = |draft: &Self, row: usize, part: usize| match draft.longest(row, quats) {
            Some((_, axis)) => {
                let offset = place(part, copies[row], separation) as f32;
                (Vec3::from(draft.means[row]) + axis * offset).to_array()
            }
            None => draft.means[row],
        };
        let mut parts = vec![0usize; self.len()];
        let mut next = |row: usize| {
            parts[row] += 1;
            parts[row]
        };
        let means = rows.iter().map(|row| moved(self, *row, next(*row))).collect();
        let shrunk = (1.0 - separation * separation).sqrt();
        for row in (0..copies.len()).filter(|row| copies[*row] > 0) {
            let Some((longest, _)) = self.longest(row, quats) else { continue };
            self.means[row] = moved(self, row, 0);
            self.log_scales[row][longest] += shrunk.ln() as f32;
            self.set_opacity(row, self.opacity(row) / shrunk);
        }
        means
    }

    /// The number of mentions of each row.
    fn mentions(&self, rows: &[usize]) -> Vec<usize> {
        let mut mentions = vec![0; self.len()];
        rows.iter().for_each(|row| mentions[*row] += 1);
        mentions
    }

    /// The longest axis of a row: which of the three, and as a vector of a standard deviation; `None` if it is zero or
    /// not finite.
    fn longest(&self, row: usize, quats: &[f32]) -> Option<(usize, Vec3)> {
        let axis = Vec3::from(self.log_scales[row]).max_position();
        let size = self.log_scales[row][axis].exp();
        let along = rotation(quats, self.from[row] as usize) * Vec3::AXES[axis] * size;
        (along.is_finite() && along != Vec3::ZERO).then_some((axis, along))
    }

    /// Keeps the rows for which `keep` is true.
    pub fn retain(&mut self, keep: impl Fn(&Self, usize) -> bool) {
        let kept: Vec<usize> = (0..self.len()).filter(|row| keep(self, *row)).collect();
        *self = Self {
            from: kept.iter().map(|row| self.from[*row]).collect(),
            reset: kept.iter().map(|row| self.reset[*row]).collect(),
            means: kept.iter().map(|row| self.means[*row]).collect(),
            log_scales: kept.iter().map(|row| self.log_scales[*row]).collect(),
            opacity_logits: kept.iter().map(|row| self.opacity_logits[*row]).collect(),
        };
    }

    /// Writes the draft back: its own columns from here, the others by row number. Other tables with a row per Gaussian
    /// follow by the returned map.
    pub fn commit(self, gaussians: &mut Gaussians, adam: &mut Adam) -> RowMap {
        let device = gaussians.device();
        let rows = RowMap { from: self.from, reset: self.reset };
        let from = (!rows.is_identity(gaussians.len())).then(|| indices(&rows.from, &device));
        gaussians.set(Group::Means, from_host(self.means.into_flattened(), 3, &device));
        gaussians.set(Group::LogScales, from_host(self.log_scales.into_flattened(), 3, &device));
        gaussians.set(Group::Opacity, from_host(self.opacity_logits, 1, &device));
        if let Some(from) = from {
            for group in [Group::Quats, Group::Sh] {
                gaussians.set(group, gaussians.group(group).select(0, from.clone()));
            }
        }
        for group in Group::ALL {
            adam.follow(group.path(), &rows);
        }
        rows
    }
}

/// The rotation of a row of `quats` `[N, 4]`, w x y z of any length.
pub fn rotation(quats: &[f32], row: usize) -> Quat {
    let [w, x, y, z] = [0, 1, 2, 3].map(|c| quats[4 * row + c]);
    Quat::from_xyzw(x, y, z, w).normalize()
}

/// The place of part `part` of a Gaussian and its `copies`: evenly spaced about 0, with a root mean square of
/// `separation`.
fn place(part: usize, copies: usize, separation: f64) -> f64 {
    // Of `n` places from -1 to 1 the mean square is (n + 1) / (3 (n - 1)).
    let copies = copies as f64;
    let farthest = separation * (3.0 * copies / (copies + 2.0)).sqrt();
    farthest * (2.0 * part as f64 / copies - 1.0)
}

/// New opacity, and factor of the scales, of each of `n` coincident Gaussians that together replace one of `opacity`
/// (3DGS-MCMC, Eq. 9):
///
/// ```text
/// o' = 1 - (1 - o)^(1/n)
/// factor = o / sum_{i=1..n} sum_{k=0..i-1} C(i-1, k) (-1)^k o'^(k+1) / sqrt(k+1)
///        = o / sum_{j=1..n} C(n, j) (-1)^(j-1) o'^j / sqrt(j)        (summing the binomials over i)
/// ```
///
/// The opacity preserves the blended centre exactly; the factor preserves the integral of the blended profile.
pub fn relocation(opacity: f64, n: usize) -> (f64, f64) {
    let n = n.clamp(1, MAX_COPIES);
    let opacity = opacity.clamp(0.0, OPACITY_MAX);
    let new = 1.0 - (1.0 - opacity).powf(1.0 / n as f64);
    let (mut sum, mut term) = (0.0, -1.0);
    for j in 1..=n {
        // term = C(n, j) (-1)^(j-1) o'^j, from the one before.
        term *= -new * (n + 1 - j) as f64 / j as f64;
        sum += term / (j as f64).sqrt();
    }
    (new, if sum > 0.0 { opacity / sum } else { 1.0 })
}

/// `count` rows drawn with replacement, each with probability proportional to its weight. A weight that is not a
/// positive finite number counts as zero; if all are, the result is empty.
pub fn sample(weights: &[f64], count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut total = 0.0;
    let sums: Vec<f64> = weights
        .iter()
        .map(|weight| {
            if weight.is_finite() && *weight > 0.0 {
                total += weight;
            }
            total
        })
        .collect();
    if total <= 0.0 {
        return Vec::new();
    }
    let last = sums.partition_point(|sum| *sum < total);
    (0..count)
        .map(|_| {
            let target = rng.random::<f64>() * total;
            // The first row whose sum exceeds the target has a positive weight.
            sums.partition_point(|sum| *sum <= target).min(last)
        })
        .collect()
}

/// `1 / (1 + exp(-x))`.
pub fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The inverse of [`sigmoid`].
pub fn logit(p: f64) -> f64 {
    (p / (1.0 - p)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::random::{Purpose, stream};

    #[test]
    fn copies_blend_to_the_opacity_they_replace() {
        for opacity in [0.001, 0.1, 0.5, 0.9, 0.99] {
            for n in 1..=MAX_COPIES {
                let (new, factor) = relocation(opacity, n);
                let together = 1.0 - (1.0 - new).powi(n as i32);
                assert!((together - opacity).abs() < 1e-12, "{opacity} {n}");
                assert!(factor > 0.0 && factor <= 1.0 + 1e-9, "{opacity} {n} {factor}");
            }
        }
        let (alone, factor) = relocation(0.3, 1);
        assert!((alone - 0.3).abs() < 1e-12 && (factor - 1.0).abs() < 1e-12);
    }

    /// A flat row on its side, and how it and its copies lie afterwards.
    #[test]
    fn parts_stand_apart_and_keep_mean_and_variance() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        for copies in [1, 2, 5] {
            let mut draft = Draft {
                from: vec![0, 1],
                reset: vec![false; 2],
                means: vec![[9.0; 3], [1.0, 2.0, 3.0]],
                log_scales: vec![[0.0; 3], [0.5_f32.ln(), 2.0_f32.ln(), 0.1_f32.ln()]],
                opacity_logits: vec![0.0, -2.0],
            };
            // A quarter turn about z: the second axis points along -x.
            let quats = [1.0, 0.0, 0.0, 0.0, half, 0.0, 0.0, half];
            let mut means = draft.spread_out(&vec![1; copies], &quats, 0.6);
            means.push(draft.means[1]);
            assert_eq!(draft.means[0], [9.0; 3], "others stay");
            assert!(means.iter().all(|mean| (mean[1] - 2.0).abs() < 1e-5 && mean[2] == 3.0), "{means:?}");
            let xs: Vec<f64> = means.iter().map(|mean| f64::from(mean[0])).collect();
            let n = xs.len() as f64;
            let middle = xs.iter().sum::<f64>() / n;
            let between = xs.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / n;
            let within = f64::from(draft.log_scales[1][1]).exp().powi(2);
            assert!((middle - 1.0).abs() < 1e-5, "{xs:?}");
            assert!((between.sqrt() / 2.0 - 0.6).abs() < 1e-5, "{xs:?}");
            assert!((between + within - 4.0).abs() < 1e-4, "the variance along the axis was 4: {between} + {within}");
            assert_eq!([draft.log_scales[1][0], draft.log_scales[1][2]], [0.5_f32.ln(), 0.1_f32.ln()]);
            let mut distances: Vec<f64> = xs.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
            distances.pop();
            assert!(distances.iter().all(|x| (x - distances[0]).abs() < 1e-5), "evenly spaced: {xs:?}");
        }
    }

    #[test]
    fn copies_keep_the_integral_of_the_profile() {
        // Along a line: 1 - (1 - o' exp(-x^2 / 2 s^2))^n must have the integral of o exp(-x^2 / 2).
        for (opacity, n) in [(0.5, 2), (0.9, 5), (0.3, 20)] {
            let (new, factor) = relocation(opacity, n);
            let (mut before, mut after) = (0.0, 0.0);
            for i in -8000..=8000 {
                let x = f64::from(i) * 1e-3;
                before += opacity * (-0.5 * x * x).exp();
                after += 1.0 - (1.0 - new * (-0.5 * (x / factor).powi(2)).exp()).powi(n as i32);
            }
            assert!((after / before - 1.0).abs() < 1e-9, "{opacity} {n}: {}", after / before);
        }
    }

    #[test]
    fn the_double_sum_of_the_paper_is_the_single_sum() {
        let binomial = |n: usize, k: usize| (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64);
        for (opacity, n) in [(0.2, 3), (0.8, 7), (0.95, 12)] {
            let (new, factor) = relocation(opacity, n);
            let mut sum = 0.0;
            for i in 1..=n {
                for k in 0..i {
                    sum += binomial(i - 1, k) * (-1.0f64).powi(k as i32) * new.powi(k as i32 + 1)
                        / ((k + 1) as f64).sqrt();
                }
            }
            assert!((factor - opacity / sum).abs() < 1e-9);
        }
    }

    #[test]
    fn sampling_ignores_weights_that_are_none() {
        let mut rng = stream(5, Purpose::Density, 0);
        let weights = [f64::NAN, 0.0, 2.0, -1.0, 1.0, f64::INFINITY, 0.0];
        let drawn = sample(&weights, 3000, &mut rng);
        let twos = drawn.iter().filter(|row| **row == 2).count();
        assert!(drawn.iter().all(|row| [2, 4].contains(row)));
        assert!((1900..2100).contains(&twos), "{twos} of 3000 with weight 2 to 1");
        assert!(sample(&[f64::NAN, 0.0], 5, &mut rng).is_empty());
        assert!(sample(&[], 5, &mut rng).is_empty());
    }
}
