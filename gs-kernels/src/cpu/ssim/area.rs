//! SSIM of one area of the images, row by row.

use std::ops::Range;

use super::clean;
use crate::constants::{PIXEL_MAX, SSIM_C1, SSIM_C2, SSIM_SHIFT, SSIM_SIGMA, SSIM_WINDOW};
use crate::cpu::Real;
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::real::{Aligned, LANES, LaneTask, Lanes, Number};

/// Pixels around one that its window covers.
const HALO: usize = SSIM_WINDOW / 2;

/// Both images, `[H, W, C]`.
#[derive(Clone, Copy)]
pub(super) struct Images<'a, F> {
    pub image: &'a [F],
    pub target: &'a [F],
    /// Numbers in a row.
    pub row: usize,
    pub height: usize,
    pub channels: usize,
}

/// The window's taps.
fn taps<F: Real>() -> [F; SSIM_WINDOW] {
    let raw: [f64; SSIM_WINDOW] = std::array::from_fn(|i| {
        let d = i as f64 - HALO as f64;
        (-d * d / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp()
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| F::of(w / sum))
}

/// The first sixteen numbers of `row`; zeros behind its end.
#[inline(always)]
fn lanes_or_zeros<L: Lanes>(row: &[L::Real]) -> L {
    if let Some(whole) = row.first_chunk() {
        return L::load(whole);
    }
    let mut values = [L::Real::ZERO; LANES];
    values[..row.len()].copy_from_slice(row);
    L::load(&values)
}

/// Pixels as the loss reads them, shifted; and which of them count.
#[inline(always)]
fn shifted<L: Lanes>(values: L) -> (L::Mask, L) {
    let [shift, zero, largest] = [SSIM_SHIFT, 0.0, PIXEL_MAX].map(L::Real::of);
    let counts = L::splat(largest).ge(values.abs());
    (counts, L::select(counts, values, L::splat(zero)).sub(L::splat(shift)))
}

/// The last 11 horizontally filtered rows of `K` maps, vector by vector: what one vertical filter reads lies together.
/// Row `y` is in slot `y` modulo 11.
struct Ring<F, const K: usize> {
    vectors: Vec<[[Aligned<F>; K]; SSIM_WINDOW]>,
}

impl<F: Real, const K: usize> Ring<F, K> {
    fn new(vectors: usize) -> Self {
        Self { vectors: vec![[[Aligned([F::ZERO; LANES]); K]; SSIM_WINDOW]; vectors] }
    }

    fn slot(y: i64) -> usize {
        y.rem_euclid(SSIM_WINDOW as i64) as usize
    }

    /// A row of one value per map.
    fn fill(&mut self, y: i64, values: [F; K]) {
        for vector in &mut self.vectors {
            vector[Self::slot(y)] = values.map(|value| Aligned([value; LANES]));
        }
    }

    /// The taps of the window around row `y`, by slot.
    #[inline(always)]
    fn taps<L: Lanes<Real = F>>(taps: &[F; SSIM_WINDOW], y: i64) -> [L; SSIM_WINDOW] {
        std::array::from_fn(|slot| L::splat(taps[Self::slot(slot as i64 - (y - HALO as i64))]))
    }

    /// Vertical filter of vector `at`.
    #[inline(always)]
    fn vertical<L: Lanes<Real = F>>(&self, at: usize, taps: &[L; SSIM_WINDOW]) -> [L; K] {
        let mut sums = [L::splat(F::ZERO); K];
        for (row, &w) in self.vectors[at].iter().zip(taps) {
            for (sum, values) in sums.iter_mut().zip(row) {
                *sum = w.mul_add(L::load(&values.0), *sum);
            }
        }
        sums
    }
}

/// Some rows, and some numbers of each.
pub(super) struct Area {
    pub rows: Range<usize>,
    pub columns: Range<usize>,
}

/// The comparison in an area; `C` is the number of channels, or 0 for any.
pub(super) struct Task<'a, F, const C: usize> {
    pub images: Images<'a, F>,
    pub area: Area,
    /// [`SsimForward::gradient`](super::SsimForward::gradient), if it is asked for.
    pub gradient: Option<&'a Disjoint<'a, F>>,
}

impl<F: Real, const C: usize> LaneTask<F> for Task<'_, F, C> {
    /// Sums of L1 and SSIM over the area.
    type Output = [f64; 2];

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> [f64; 2] {
        Block::<F, C>::new(self.images, self.area).run::<L>(self.gradient)
    }
}

/// An area and the rows in work.
///
/// Three ranges of columns lie inside each other: the area's own; *wide*, with what the windows of the own ones cover,
/// in whole vectors; and *input*, with what the windows of the wide ones cover.
struct Block<'a, F, const C: usize> {
    images: Images<'a, F>,
    area: Area,
    /// Numbers before the area's own in a wide row, and before a wide one's in an input row.
    lead: [usize; 2],
    /// Sum and difference of the shifted images, input columns.
    inputs: [Vec<F>; 2],
    /// `mu_s`, `mu_d`, `E_ss`, `E_dd`, wide columns.
    moments: Ring<F, 4>,
    /// SSIM's derivatives by `mu_x`, `E_xx`, `E_xy`, and SSIM itself; wide columns.
    maps: [Vec<F>; 4],
    /// The filtered derivatives, the area's own columns.
    derivatives: Ring<F, 3>,
}

impl<'a, F: Real, const C: usize> Block<'a, F, C> {
    fn new(images: Images<'a, F>, area: Area) -> Self {
        let window = HALO * images.channels;
        let lead = [window.next_multiple_of(LANES), window];
        let own = area.columns.len().next_multiple_of(LANES);
        let wide = own + 2 * lead[0];
        // Outside the images the shifted sum is twice the shift.
        let outside = F::of(-2.0 * SSIM_SHIFT);
        Self {
            images,
            area,
            lead,
            inputs: [outside, F::ZERO].map(|value| vec![value; wide + 2 * lead[1]]),
            moments: Ring::new(wide / LANES),
            maps: [(); 4].map(|()| zeros(wide)),
            derivatives: Ring::new(own / LANES),
        }
    }

    #[inline(always)]
    fn channels(&self) -> usize {
        if C > 0 { C } else { self.images.channels }
    }

    /// Sums of L1 and SSIM over the area, and its gradient if it is asked for.
    #[inline(always)]
    fn run<L: Lanes<Real = F>>(&mut self, gradient: Option<&Disjoint<'_, F>>) -> [f64; 2] {
        let taps = taps::<F>();
        let halo = HALO as i64;
        let (first, end) = (self.area.rows.start as i64, self.area.rows.end as i64);
        // Rows around the area whose SSIM the gradient needs.
        let reach = if gradient.is_some() { halo } else { 0 };
        let inside = 0..self.images.height as i64;
        let [mut l1, mut ssim] = [0.0; 2];
        for y in first - reach - halo..end + reach + halo {
            if inside.contains(&y) {
                self.read(y as usize);
                self.filter_inputs::<L>(&taps, y);
                if (first..end).contains(&y) {
                    l1 += self.own_sum::<L, true>(&self.inputs[1][self.lead[0] + self.lead[1]..]);
                }
            } else {
                let s = F::of(-2.0 * SSIM_SHIFT);
                self.moments.fill(y, [s, F::ZERO, s * s, F::ZERO]);
            }
            let middle = y - halo;
            if middle < first - reach {
                continue;
            }
            if inside.contains(&middle) {
                self.compare::<L>(&taps, middle);
                if (first..end).contains(&middle) {
                    ssim += self.own_sum::<L, false>(&self.maps[3][self.lead[0]..]);
                }
            }
            let Some(gradient) = gradient else { continue };
            if inside.contains(&middle) {
                self.filter_maps::<L>(&taps, middle);
            } else {
                self.derivatives.fill(middle, [F::ZERO; 3]);
            }
            if middle - halo >= first {
                let row = (middle - halo) as usize;
                let at = row * self.images.row + self.area.columns.start;
                // SAFETY: areas do not overlap.
                let own = unsafe { gradient.slice_mut(at, self.area.columns.len()) };
                self.write::<L>(&taps, row, own);
            }
        }
        [l1, ssim]
    }

    /// Image row `y` as sum and difference.
    #[inline(always)]
    fn read(&mut self, y: usize) {
        let row = self.images.row;
        let before = self.lead[0] + self.lead[1];
        let start = self.area.columns.start.saturating_sub(before);
        let input = self.inputs[0].len();
        let end = (self.area.columns.start + input - before).min(row);
        let at = start + before - self.area.columns.start;
        let shift = F::of(SSIM_SHIFT);
        let (image, target) = (&self.images.image[y * row..][start..end], &self.images.target[y * row..][start..end]);
        let [sums, differences] = &mut self.inputs;
        let rows = sums[at..].iter_mut().zip(&mut differences[at..]);
        for ((s, d), (&x, &y)) in rows.zip(image.iter().zip(target)) {
            let (x, y) = (clean(x) - shift, clean(y) - shift);
            *s = x + y;
            *d = x - y;
        }
    }

    /// Sum of the area's own columns, or of their magnitudes; `row` begins with them.
    #[inline(always)]
    fn own_sum<L: Lanes<Real = F>, const MAGNITUDES: bool>(&self, row: &[F]) -> f64 {
        let own = &row[..self.area.columns.len()];
        let mut sum = L::splat(F::ZERO);
        for at in (0..own.len()).step_by(LANES) {
            let values: L = lanes_or_zeros(&own[at..]);
            sum = sum.add(if MAGNITUDES { values.abs() } else { values });
        }
        sum.sum().to_f64()
    }

    /// Filters sum, difference and their squares along row `y`.
    #[inline(always)]
    fn filter_inputs<L: Lanes<Real = F>>(&mut self, taps: &[F; SSIM_WINDOW], y: i64) {
        let channels = self.channels();
        let taps = taps.map(L::splat);
        let slot = Ring::<F, 4>::slot(y);
        let span = LANES + 2 * HALO * channels;
        let [sums, differences] = &self.inputs;
        for (vector, at) in self.moments.vectors.iter_mut().zip((0..).step_by(LANES)) {
            let (s, d) = (&sums[at..at + span], &differences[at..at + span]);
            let [mut mu_s, mut mu_d, mut ss, mut dd] = [L::splat(F::ZERO); 4];
            for (i, &w) in taps.iter().enumerate() {
                let (s, d) = (L::load_at(s, i * channels), L::load_at(d, i * channels));
                let (ws, wd) = (w.mul(s), w.mul(d));
                mu_s = mu_s.add(ws);
                mu_d = mu_d.add(wd);
                ss = ws.mul_add(s, ss);
                dd = wd.mul_add(d, dd);
            }
            for (to, value) in vector[slot].iter_mut().zip([mu_s, mu_d, ss, dd]) {
                value.store(&mut to.0);
            }
        }
    }

    /// SSIM and its derivatives in row `y`; zero outside the images.
    #[inline(always)]
    fn compare<L: Lanes<Real = F>>(&mut self, taps: &[F; SSIM_WINDOW], y: i64) {
        let taps = Ring::<F, 4>::taps::<L>(taps, y);
        for vector in 0..self.moments.vectors.len() {
            let moments = self.moments.vertical(vector, &taps);
            for (map, value) in self.maps.iter_mut().zip(similarity(moments)) {
                value.store_at(map, vector * LANES);
            }
        }
        let before = self.lead[0].saturating_sub(self.area.columns.start);
        let after = self.lead[0] + self.images.row - self.area.columns.start;
        for map in &mut self.maps[..3] {
            map[..before].fill(F::ZERO);
            if let Some(outside) = map.get_mut(after..) {
                outside.fill(F::ZERO);
            }
        }
    }

    /// Filters the derivatives along row `y`.
    #[inline(always)]
    fn filter_maps<L: Lanes<Real = F>>(&mut self, taps: &[F; SSIM_WINDOW], y: i64) {
        let channels = self.channels();
        let taps = taps.map(L::splat);
        let slot = Ring::<F, 3>::slot(y);
        let span = LANES + 2 * HALO * channels;
        let first = self.lead[0] - self.lead[1];
        for (vector, at) in self.derivatives.vectors.iter_mut().zip((first..).step_by(LANES)) {
            for (to, map) in vector[slot].iter_mut().zip(&self.maps) {
                let map = &map[at..at + span];
                let mut sum = L::splat(F::ZERO);
                for (i, &w) in taps.iter().enumerate() {
                    sum = w.mul_add(L::load_at(map, i * channels), sum);
                }
                sum.store(&mut to.0);
            }
        }
    }

    /// The gradient in the area's columns of image row `y`.
    #[inline(always)]
    fn write<L: Lanes<Real = F>>(&mut self, taps: &[F; SSIM_WINDOW], y: usize, gradient: &mut [F]) {
        let taps = Ring::<F, 3>::taps::<L>(taps, y as i64);
        let at = y * self.images.row + self.area.columns.start;
        let (image, target) = (&self.images.image[at..], &self.images.target[at..]);
        let (two, zero) = (L::splat(F::of(2.0)), L::splat(F::ZERO));
        for (vector, gradient) in gradient.chunks_mut(LANES).enumerate() {
            let [mean, square, product] = self.derivatives.vertical(vector, &taps);
            let at = vector * LANES;
            let (counts, x) = shifted::<L>(lanes_or_zeros(&image[at..]));
            let (_, y) = shifted::<L>(lanes_or_zeros(&target[at..]));
            let v = two.mul(x).mul_add(square, y.mul_add(product, mean));
            let v = L::select(counts, v, zero);
            match gradient.first_chunk_mut() {
                Some(whole) => v.store(whole),
                None => gradient.copy_from_slice(&v.to_array()[..gradient.len()]),
            }
        }
    }
}

/// The derivatives with respect to `mu_x`, `E_xx`, `E_xy`, and SSIM itself, from the shifted `[mu_s, mu_d, E_ss,
/// E_dd]`.
#[inline(always)]
fn similarity<L: Lanes>([ms, md, ss, dd]: [L; 4]) -> [L; 4] {
    let c = |x: f64| L::splat(L::Real::of(x));
    let [half, one, two] = [0.5, 1.0, 2.0].map(c);
    let (mx, my) = (half.mul(ms.add(md)), half.mul(ms.sub(md)));
    let (vs, vd) = (ms.neg_mul_add(ms, ss), md.neg_mul_add(md, dd));
    let (mean_x, mean_y) = (mx.add(c(SSIM_SHIFT)), my.add(c(SSIM_SHIFT)));
    let a1 = two.mul(mean_x).mul_add(mean_y, c(SSIM_C1));
    let a2 = half.mul_add(vs.sub(vd), c(SSIM_C2));
    let b1 = mean_x.mul_add(mean_x, mean_y.mul_add(mean_y, c(SSIM_C1)));
    let b2 = half.mul_add(vs.add(vd), c(SSIM_C2));
    // One division serves for both factors.
    let both = one.div(b1.mul(b2));
    let (inv1, inv2) = (b2.mul(both), b1.mul(both));
    let ssim = a1.mul(a2).mul(both);
    let d_xy = two.mul(a1).mul(both);
    let d_xx = c(0.0).sub(ssim.mul(inv2));
    // The means enter A1 and B1 unshifted, and A2 and B2 shifted.
    let numerator = mean_y.mul(a2).sub(my.mul(a1)).mul(both);
    let denominator = ssim.mul(mean_x.mul(inv1).sub(mx.mul(inv2)));
    let d_mu = two.mul(numerator.sub(denominator));
    [d_mu, d_xx, d_xy, ssim]
}
