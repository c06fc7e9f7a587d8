//! Fewer Gaussians in place of many: neighbours are merged, and those that are missed least are left out.
//!
//! Pairs of neighbours are merged in rounds, as NanoGS does: in each, those whose merging [costs](cost) the photos
//! least, among them no Gaussian twice. Leaving one out is a choice like merging it. Left aside: a queue of all pairs,
//! whose neighbours would have to be renewed with each merging and whose costs are found on one thread.

mod cost;
mod moments;

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::Splats;
use crate::splats::{ALPHA_LEAST, SH_C0, logit};
use cost::{of_dropping, of_merging};
use moments::Shape;

/// Neighbours that a Gaussian may be merged with. With 16 the photos have the same error.
const NEIGHBOURS: usize = 8;

/// At most this share of the Gaussians is merged or left out in a round; costs are then found anew. A tenth takes more
/// than twice as long for the same error of the photos.
const ROUND: f64 = 0.25;

/// The contribution of a Gaussian that no photo shows, pixels: two of these must have weights, too.
const UNSEEN: f64 = 1e-9;

/// Gaussians in place of more of them.
#[derive(Debug, Clone)]
pub struct Merged {
    /// The Gaussians. Those that were not merged have every bit of before.
    pub splats: Splats,
    /// The Gaussian of before that each of them was, or was merged from first; rising.
    pub rows: Vec<u32>,
    /// Pixels of the photos, above 0.
    contributions: Vec<f64>,
    /// Which of them may be merged.
    free: Vec<bool>,
}

/// Something to do: the pair, which is twice the same row where it is left out, and its cost.
type Choice = (f64, [u32; 2]);

impl Merged {
    /// All of `splats` whose values are finite, with the `contributions` `[N]` to photos, pixels. The rows `fixed` may
    /// be left out and are not merged.
    ///
    /// # Panics
    /// When there are fewer contributions than Gaussians, or no such row is to be fixed.
    pub fn of(splats: &Splats, contributions: &[f64], fixed: &[u32]) -> Self {
        let rows: Vec<u32> = (0..splats.len() as u32).filter(|row| splats.is_finite(*row as usize)).collect();
        let shown = |row: &u32| Some(contributions[*row as usize]).filter(|x| x.is_finite()).unwrap_or(0.0).max(UNSEEN);
        let mut free = vec![true; splats.len()];
        fixed.iter().for_each(|row| free[*row as usize] = false);
        Self {
            splats: splats.select(&rows),
            contributions: rows.iter().map(shown).collect(),
            free: rows.iter().map(|row| free[*row as usize]).collect(),
            rows,
        }
    }

    /// Merges and leaves out until there are `count`.
    pub fn reduce(&mut self, count: usize) {
        while self.splats.len() > count {
            let most = ((ROUND * self.splats.len() as f64) as usize).clamp(1, self.splats.len() - count);
            self.round(most);
        }
    }

    /// One round, after which there are `fewer` less.
    fn round(&mut self, fewer: usize) {
        let count = self.splats.len();
        let shape = |row: usize| Shape::of(&self.splats, row, self.contributions[row]);
        let shapes: Vec<Shape> = (0..count).into_par_iter().map(shape).collect();
        let mut choices = self.choices(&shapes);
        // Of equal costs the lower rows come first.
        choices.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut partner = vec![None; count];
        let mut left = fewer;
        for (_, [a, b]) in choices {
            if left > 0 && partner[a as usize].is_none() && partner[b as usize].is_none() {
                (partner[a as usize], partner[b as usize]) = (Some(b), Some(a));
                left -= 1;
            }
        }
        let mut kept = Vec::with_capacity(count - fewer);
        for (row, partner) in (0..count as u32).zip(partner) {
            match partner {
                Some(other) if other > row => {
                    self.merge(row as usize, other as usize, &shapes);
                    kept.push(row);
                }
                Some(_) => {}
                None => kept.push(row),
            }
        }
        self.keep(&kept);
    }

    /// Leaving out each Gaussian, and merging it with each of its neighbours.
    fn choices(&self, shapes: &[Shape]) -> Vec<Choice> {
        let free: Vec<u32> = (0..shapes.len() as u32).filter(|row| self.free[*row as usize]).collect();
        let points: Vec<[f64; 3]> = free.iter().map(|row| shapes[*row as usize].mean.to_array()).collect();
        let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&points);
        // The nearest is the point itself.
        let wanted = NonZero::<usize>::MIN.saturating_add(NEIGHBOURS);
        let merging = |(a, point): (&u32, &[f64; 3])| {
            let near = tree.nearest_n::<SquaredEuclidean>(point, wanted);
            let pair = |b: u32| self.merging([(*a).min(b), (*a).max(b)], shapes);
            near.iter().map(|near| free[near.item as usize]).filter(|b| b != a).filter_map(pair).collect::<Vec<_>>()
        };
        let mut choices: Vec<Choice> = free.par_iter().zip(&points).flat_map_iter(merging).collect();
        choices.extend((0..).zip(shapes).map(|(row, shape)| (of_dropping(shape), [row, row])));
        choices
    }

    /// The choice to merge a pair; `None` if its numbers are too large for its cost to be one.
    fn merging(&self, pair: [u32; 2], shapes: &[Shape]) -> Option<Choice> {
        let [a, b] = pair.map(|row| row as usize);
        let s = self.splats.coefficients();
        let [sh_a, sh_b] = [a, b].map(|row| self.splats.sh[row * s..][..s].as_flattened());
        let squared: f32 = sh_a.iter().zip(sh_b).map(|(a, b)| (a - b) * (a - b)).sum();
        // The mean over all directions and the three colours.
        let difference = f64::from(squared) * SH_C0 * SH_C0 / 3.0;
        let cost = of_merging(&shapes[a], &shapes[b], difference);
        cost.is_finite().then_some((cost, pair))
    }

    /// Makes the row `a` the Gaussian in place of `a` and `b`.
    fn merge(&mut self, a: usize, b: usize, shapes: &[Shape]) {
        let merged = shapes[a].merged_with(&shapes[b]);
        let share = shapes[a].share_of(&shapes[b]) as f32;
        let splats = &mut self.splats;
        splats.means[a] = merged.mean.as_vec3().to_array();
        (splats.quats[a], splats.log_scales[a]) = merged.axes();
        splats.opacity_logits[a] = logit(merged.opacity, ALPHA_LEAST);
        let s = splats.coefficients();
        for k in 0..s {
            let other = splats.sh[b * s + k];
            splats.sh[a * s + k].iter_mut().zip(other).for_each(|(value, other)| *value += share * (other - *value));
        }
        self.contributions[a] = merged.contribution;
    }

    /// The Gaussians `kept` alone.
    fn keep(&mut self, kept: &[u32]) {
        self.splats = self.splats.select(kept);
        self.rows = kept.iter().map(|row| self.rows[*row as usize]).collect();
        self.contributions = kept.iter().map(|row| self.contributions[*row as usize]).collect();
        self.free = kept.iter().map(|row| self.free[*row as usize]).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::testing::random;

    fn reduced(splats: &Splats, contributions: &[f64], fixed: &[u32], count: usize) -> Merged {
        let mut merged = Merged::of(splats, contributions, fixed);
        merged.reduce(count);
        merged
    }

    #[test]
    fn a_coincident_pair_merges_by_its_contributions() {
        let one = random(1, 3, 7);
        let mut splats = one.select(&[0, 0]);
        splats.sh[16..].iter_mut().for_each(|sh| *sh = sh.map(|x| x + 0.01));
        let merged = reduced(&splats, &[3.0, 1.0], &[], 1).splats;
        assert_eq!(merged.len(), 1);
        let error = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
        assert!(error(merged.means[0], one.means[0]) < 1e-6);
        let shares = |(a, b): (&[f32; 3], &[f32; 3])| error(*a, b.map(|x| x + 0.0025)) < 1e-6;
        assert!(merged.sh.iter().zip(&one.sh).all(shares), "{:?}", merged.sh);
        let sorted = |mut scales: [f32; 3]| {
            scales.sort_by(f32::total_cmp);
            scales
        };
        assert!(error(sorted(merged.log_scales[0]), sorted(one.log_scales[0])) < 1e-5);
    }

    #[test]
    fn the_count_is_kept_and_threads_do_not_matter() {
        let splats = random(300, 1, 3);
        let contributions: Vec<f64> = (0..300).map(|row| f64::from(row % 7)).collect();
        let on = |threads: usize, count: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| reduced(&splats, &contributions, &[], count))
        };
        for count in [0, 1, 2, 37, 299, 300, 400] {
            let merged = on(1, count);
            assert_eq!(merged.splats.len(), count.min(300));
            merged.splats.check().expect("finite");
            assert!(merged.rows.is_sorted_by(|a, b| a < b));
            let again = on(3, count);
            assert!(merged.splats == again.splats && merged.rows == again.rows, "{count}");
        }
        assert_eq!(on(1, 300).splats, splats, "nothing to do");
    }

    #[test]
    fn fixed_ones_are_never_merged() {
        let splats = random(200, 0, 5);
        let fixed: Vec<u32> = (0..200).step_by(3).collect();
        let merged = reduced(&splats, &[1.0; 200], &fixed, 60);
        let mut found = 0;
        for (row, old) in merged.rows.iter().enumerate().filter(|(_, old)| fixed.contains(old)) {
            assert_eq!(merged.splats.select(&[row as u32]), splats.select(&[*old]));
            found += 1;
        }
        assert!(found > 0 && found < fixed.len(), "{found}: some are left out");
        assert_eq!(reduced(&splats, &[1.0; 200], &(0..200).collect::<Vec<u32>>(), 50).splats.len(), 50);
    }

    #[test]
    fn hidden_ones_go_first() {
        let splats = random(50, 0, 9);
        let contributions: Vec<f64> = (0..50).map(|row| f64::from(row % 2) * 100.0).collect();
        let merged = reduced(&splats, &contributions, &[], 25);
        let seen = splats.select(&(1..50).step_by(2).collect::<Vec<u32>>());
        assert_eq!(merged.splats, seen, "those that are seen are as they were");
    }

    #[test]
    fn degenerate_ones_leave_finite_ones() {
        let mut splats = random(600, 1, 11);
        // Coincident ones, needles, points, planes without an end, opaque and invisible ones, far ones.
        splats.means[..200].fill([1.0; 3]);
        splats.log_scales[..50].fill([-3.0e38, 3.0e38, 0.0]);
        splats.log_scales[50..100].fill([-100.0; 3]);
        splats.log_scales[100..150].fill([90.0, 90.0, -90.0]);
        splats.quats[150..200].fill([0.0; 4]);
        splats.opacity_logits[200..250].fill(3.0e38);
        splats.opacity_logits[250..300].fill(-3.0e38);
        splats.means[300..320].fill([3.0e38; 3]);
        splats.means[320..340].fill([-3.0e38; 3]);
        splats.sh[680..720].fill([3.0e38; 3]);
        splats.means[340][1] = f32::NAN;
        splats.log_scales[341][0] = f32::INFINITY;
        splats.sh[4 * 342 + 1][2] = f32::NAN;
        let mut contributions = vec![2.0; 600];
        contributions[400..410].fill(f64::NAN);
        contributions[410..420].fill(f64::INFINITY);
        contributions[420..430].fill(-1.0);
        contributions[430..440].fill(1e300);
        for count in [500, 100, 3] {
            let merged = reduced(&splats, &contributions, &[], count);
            assert_eq!(merged.splats.len(), count);
            merged.splats.check().expect("finite");
        }
        let empty = Splats { sh: Vec::new(), ..Splats::default() };
        assert!(reduced(&empty, &[], &[], 0).splats.is_empty());
    }
}
