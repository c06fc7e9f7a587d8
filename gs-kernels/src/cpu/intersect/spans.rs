//! The tiles that a Gaussian touches, row of tiles by row of tiles, in closed form.

use crate::constants::{ALPHA_MIN, FEATURE_MAX, TILE};
use crate::cpu::Real;
use crate::cpu::real::{LANES, LaneTask, Lanes, Number};
use crate::cpu::wide::Wide;
use crate::rows::ProjectedRow;

/// Relative and absolute slack of the cut-off, in units of sigma. The exact decision is made per pixel; the slack only
/// ensures that rounding never omits a tile.
pub(crate) const SLACK: (f64, f64) = (1e-5, 1e-3);
/// Slack of a pixel bound, pixels.
pub(crate) const PIXEL_SLACK: f64 = 0.02;

/// Tiles of one row that a Gaussian touches: columns `first..=last`.
#[derive(Clone, Copy)]
pub(super) struct Span {
    pub(super) row: u16,
    pub(super) first: u16,
    pub(super) last: u16,
}

/// Spans of a run of Gaussians.
pub(in crate::cpu) struct Spans {
    pub(super) spans: Vec<Span>,
    /// Per Gaussian of the run: end in `spans`.
    pub(super) ends: Vec<u32>,
    /// Per Gaussian of the run: number of tiles.
    pub(super) counts: Vec<u32>,
}

impl Spans {
    /// Number of tiles that Gaussian `k` of the run touches.
    pub(in crate::cpu) fn count(&self, k: usize) -> u32 {
        self.counts[k]
    }

    /// The tiles that Gaussian `k` of the run touches, in a grid of `columns`.
    pub(in crate::cpu) fn tiles(&self, k: usize, columns: usize) -> impl Iterator<Item = usize> + '_ {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] as usize };
        self.spans[begin..self.ends[k] as usize].iter().flat_map(move |span| {
            let row = span.row as usize * columns;
            row + span.first as usize..=row + span.last as usize
        })
    }
}

/// Spans of the Gaussians `members`.
pub(in crate::cpu) fn spans_of<F: Real>(
    members: std::ops::Range<usize>,
    projected: &[F],
    opacities: &[F],
    features: &[F],
    channels: usize,
    size: [u32; 2],
) -> Spans {
    F::with_lanes(FindSpans { members, projected, opacities, features, channels, size })
}

struct FindSpans<'a, F> {
    members: std::ops::Range<usize>,
    projected: &'a [F],
    opacities: &'a [F],
    features: &'a [F],
    channels: usize,
    size: [u32; 2],
}

/// Edges of sixteen ellipses in one row of tiles each, pixels; a lane without any has its right edge left of the left
/// one.
#[derive(Clone, Copy)]
struct Edges<F> {
    left: [F; LANES],
    right: [F; LANES],
}

impl<F: Real> LaneTask<F> for FindSpans<'_, F> {
    type Output = Spans;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> Spans {
        let (first, end) = (self.members.start, self.members.end);
        let mut out = Spans {
            spans: Vec::with_capacity(2 * (end - first)),
            ends: Vec::with_capacity(end - first),
            counts: Vec::with_capacity(end - first),
        };
        let mut edges = Vec::new();
        let mut next = first;
        while next < end {
            let (mut ids, mut count) = ([next; LANES], 0);
            while next < end && count < LANES {
                if self.is_drawn(next) {
                    ids[count] = next;
                    count += 1;
                }
                next += 1;
            }
            if count == 0 {
                break;
            }
            // Lanes behind the last one repeat a Gaussian, and are ignored.
            let rows = self.edges::<L>(&ids, &mut edges);
            for lane in 0..count {
                let member = ids[lane] - first;
                out.ends.resize(member, out.spans.len() as u32);
                out.counts.resize(member, 0);
                let begin = out.spans.len();
                let (top, bottom) = rows[lane];
                for (edges, row) in edges.iter().zip(top..bottom) {
                    if let Some((first, last)) = pixel_range(edges.left[lane], edges.right[lane], self.size[0]) {
                        let (first, last) = (first / TILE as u32, last / TILE as u32);
                        out.spans.push(Span { row: row as u16, first: first as u16, last: last as u16 });
                    }
                }
                let mut tiles = 0;
                for span in &out.spans[begin..] {
                    tiles += u32::from(span.last - span.first) + 1;
                }
                out.ends.push(out.spans.len() as u32);
                out.counts.push(tiles);
            }
        }
        out.ends.resize(end - first, out.spans.len() as u32);
        out.counts.resize(end - first, 0);
        out
    }
}

impl<F: Real> FindSpans<'_, F> {
    /// Whether Gaussian `id` is drawn at all.
    #[inline(always)]
    fn is_drawn(&self, id: usize) -> bool {
        let (opacity, limit) = (self.opacities[id], F::of(FEATURE_MAX));
        let mut usable = opacity >= F::of(ALPHA_MIN) && opacity.is_finite();
        for feature in &self.features[id * self.channels..][..self.channels] {
            usable &= feature.abs() < limit;
        }
        usable && ProjectedRow::read(self.projected, id).radius > F::ZERO
    }

    /// Edges of the ellipses `d1 (dx + l dy)^2 + d2 dy^2 <= k` about their means, in as many rows of tiles as the
    /// tallest has, each from its own first row on. Returns the rows of tiles of each, `first..end`.
    ///
    /// In a strip of `dy`, the rightmost point is the whole ellipse's rightmost point clamped to the strip, because the
    /// right edge is a concave function of `dy`; likewise on the left.
    #[inline(always)]
    fn edges<L: Lanes<Real = F>>(&self, ids: &[usize; LANES], edges: &mut Vec<Edges<F>>) -> [(u32, u32); LANES] {
        let mut columns = [[F::ZERO; LANES]; 6];
        let [x, y, d1, l, d2, k] = &mut columns;
        for lane in 0..LANES {
            let row = ProjectedRow::read(self.projected, ids[lane]);
            [x[lane], y[lane]] = row.mean;
            [d1[lane], l[lane], d2[lane]] = row.conic;
            k[lane] = F::of(2.0) * (self.opacities[ids[lane]] / F::of(ALPHA_MIN)).ln();
        }
        let [x, y, d1, l, d2] = [Wide::<L>::load(x), Wide::load(y), Wide::load(d1), Wide::load(l), Wide::load(d2)];
        let k = Wide::load(k) * Wide::of(1.0 + SLACK.0) + Wide::of(SLACK.1);
        let reach = (k / d2).sqrt();
        // dy of the rightmost point: Cxy / sqrt(Cxx) sqrt(k), with Cxy = -l / d2 and Cxx = 1 / d1 + l^2 / d2.
        let turn = -(l / d2) * (k / (Wide::of(1.0) / d1 + l * l / d2)).sqrt();

        let (low, high) = ((y - reach).0.to_array(), (y + reach).0.to_array());
        let (mut rows, mut tallest, mut starts) = ([(0, 0); LANES], 0, [F::ZERO; LANES]);
        for lane in 0..LANES {
            if let Some((first, last)) = pixel_range(low[lane], high[lane], self.size[1]) {
                rows[lane] = (first / TILE as u32, last / TILE as u32 + 1);
                starts[lane] = F::of(rows[lane].0.into());
                tallest = tallest.max(rows[lane].1 - rows[lane].0);
            }
        }
        let tile = Wide::<L>::of(TILE as f64);
        let (half, end) = (Wide::of(0.5), Wide::<L>::of(f64::from(self.size[1]) - 0.5));
        let starts = Wide::load(&starts);
        edges.clear();
        for step in 0..tallest {
            let top = (starts + Wide::of(step.into())) * tile + half;
            let bottom = Wide(((top + tile - Wide::of(1.0)).0).min(end.0));
            let low = Wide((top - y).0.max((-reach).0));
            let high = Wide((bottom - y).0.min(reach.0));
            let empty = low.above(high + Wide::of(PIXEL_SLACK));
            let left_dy = Wide((-turn).0.max(low.0).min(high.0));
            let right_dy = Wide(turn.0.max(low.0).min(high.0));
            let left = x + (-half_width(k, d1, d2, left_dy) - l * left_dy);
            let right = x + (half_width(k, d1, d2, right_dy) - l * right_dy);
            let mut found = Edges { left: [F::ZERO; LANES], right: [F::ZERO; LANES] };
            left.0.store(&mut found.left);
            Wide::select(empty, left - Wide::of(1.0), right).0.store(&mut found.right);
            edges.push(found);
        }
        rows
    }
}

/// Half the width of the ellipse at `dy`.
#[inline(always)]
fn half_width<L: Lanes>(k: Wide<L>, d1: Wide<L>, d2: Wide<L>, dy: Wide<L>) -> Wide<L> {
    ((k - d2 * dy * dy).max(Wide::of(0.0)) / d1).sqrt()
}

/// Pixels whose centres lie in `low..=high`, with slack, inside an image of `size` pixels.
#[inline(always)]
fn pixel_range<F: Real>(low: F, high: F, size: u32) -> Option<(u32, u32)> {
    // NaN or an empty range fails this comparison.
    let ordered = low <= high;
    if !ordered {
        return None;
    }
    let slack = F::of(PIXEL_SLACK + 0.5);
    let last_pixel = size as i32 - 1;
    let first = (-((slack - low).floor_i32())).max(0);
    let last = (high + slack - F::ONE).floor_i32().min(last_pixel);
    (first <= last_pixel && last >= 0 && first <= last).then_some((first as u32, last as u32))
}
