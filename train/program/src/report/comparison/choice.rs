//! The choice of a model by a held-out split: the smallest that is as good as the best, within the precision of the
//! split's images.
//!
//! "As good" is within one standard error of the best run's mean PSNR over images (the rule of Breiman et al. 1984 for
//! pruning trees).

use super::Table;
use gs_train::run::memory::megabytes;

/// A run, measured on the split that chooses.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its name.
    pub name: String,
    /// PSNR of each image of the split, dB.
    pub scores: Vec<f64>,
    /// PSNR on the reported split, dB, which takes no part in the choice.
    pub reported: f64,
    /// Gaussians.
    pub gaussians: usize,
    /// Bytes of the finished scene.
    pub bytes: usize,
    /// Seconds of training: of processor time if every run knows it.
    pub seconds: f64,
}

/// The outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The split that chose.
    pub split: String,
    candidates: Vec<Candidate>,
    /// Mean and standard error of each candidate, dB; not finite with fewer than two finite scores.
    figures: Vec<(f64, f64)>,
    best: usize,
    chosen: usize,
}

impl Choice {
    /// The smallest of the candidates that are within one standard error of the best, the quicker one of equals; `None`
    /// if no candidate has two images.
    pub fn smallest(candidates: Vec<Candidate>, split: &str) -> Option<Self> {
        let figures: Vec<(f64, f64)> = candidates.iter().map(|candidate| mean_and_error(&candidate.scores)).collect();
        let known = |index: &usize| figures[*index].0.is_finite() && figures[*index].1.is_finite();
        let all: Vec<usize> = (0..candidates.len()).filter(known).collect();
        let best = all.iter().copied().max_by(|a, b| figures[*a].0.total_cmp(&figures[*b].0))?;
        let least = figures[best].0 - figures[best].1;
        let as_good = all.into_iter().filter(|index| figures[*index].0 >= least);
        let size = |index: usize| (candidates[index].bytes, candidates[index].seconds);
        let chosen = as_good.min_by(|a, b| {
            let (a, b) = (size(*a), size(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })?;
        Some(Self { split: split.into(), candidates, figures, best, chosen })
    }

    /// The chosen run.
    pub fn chosen(&self) -> &Candidate {
        &self.candidates[self.chosen]
    }

    /// The choice in one sentence: what it saves and what it costs, against the best run.
    pub fn sentence(&self) -> String {
        let (chosen, best) = (self.chosen(), &self.candidates[self.best]);
        let ((psnr, _), (highest, error)) = (self.figures[self.chosen], self.figures[self.best]);
        let images = best.scores.len();
        if self.chosen == self.best {
            return format!(
                "chosen: {}, {psnr:.2} dB over {images} images of {}: no smaller one is within one standard error \
                 ({error:.2} dB)",
                chosen.name, self.split
            );
        }
        format!(
            "chosen: {}, {psnr:.2} dB over {images} images of {}, within one standard error ({error:.2} dB) of the \
             best, {} with {highest:.2} dB: {} instead of {} ({}), {:.1} s instead of {:.1} s ({}), at a cost of {:.2} dB",
            chosen.name,
            self.split,
            best.name,
            megabytes(chosen.bytes as u64),
            megabytes(best.bytes as u64),
            change(chosen.bytes as f64, best.bytes as f64),
            chosen.seconds,
            best.seconds,
            change(chosen.seconds, best.seconds),
            highest - psnr
        )
    }

    /// One row a candidate, smallest first.
    pub fn table(&self) -> Table {
        let mut order: Vec<usize> = (0..self.candidates.len()).collect();
        order.sort_by_key(|index| self.candidates[*index].bytes);
        let number = |value: f64| if value.is_finite() { format!("{value:.2}") } else { String::new() };
        let of_split = format!("{} dB", self.split);
        let columns = ["run", of_split.as_str(), "standard error", "below the best dB", "Gaussians", "size", "seconds"];
        let columns = columns.into_iter().chain(["reported dB", "chosen"]).map(String::from).collect();
        let rows = order.into_iter().map(|index| {
            let (candidate, (psnr, error)) = (&self.candidates[index], self.figures[index]);
            let word = match (index == self.chosen, index == self.best) {
                (true, true) => "chosen, best",
                (true, false) => "chosen",
                (false, true) => "best",
                (false, false) => "",
            };
            vec![
                candidate.name.clone(),
                number(psnr),
                number(error),
                number(self.figures[self.best].0 - psnr),
                candidate.gaussians.to_string(),
                megabytes(candidate.bytes as u64),
                format!("{:.1}", candidate.seconds),
                number(candidate.reported),
                word.to_string(),
            ]
        });
        Table::of(columns, rows.collect())
    }
}

/// A change in per cent, with its sign.
fn change(from: f64, to: f64) -> String {
    if to > 0.0 { format!("{:+.0} %", 100.0 * (from / to - 1.0)) } else { "from nothing".into() }
}

/// Mean and standard error of the finite scores; NaN with fewer than two, for which the error is undefined.
pub(super) fn mean_and_error(scores: &[f64]) -> (f64, f64) {
    let finite: Vec<f64> = scores.iter().copied().filter(|score| score.is_finite()).collect();
    if finite.len() < 2 {
        return (f64::NAN, f64::NAN);
    }
    let count = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / count;
    let variance = finite.iter().map(|score| (score - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four images around `psnr`: their deviation is 2.58 dB, a half of that the standard error, 1.29 dB.
    fn candidate(name: &str, psnr: f64, bytes: usize, seconds: f64) -> Candidate {
        let scores = [-3.0, -1.0, 1.0, 3.0].map(|x| psnr + x).to_vec();
        Candidate { name: name.into(), scores, reported: psnr - 5.0, gaussians: bytes / 56, bytes, seconds }
    }

    #[test]
    fn the_smallest_within_one_standard_error_is_chosen() {
        let all = vec![
            candidate("large", 31.0, 4_000_000, 100.0),
            candidate("slow", 30.0, 1_000_000, 80.0),
            candidate("quick", 29.9, 1_000_000, 50.0),
            candidate("blurred", 29.6, 500_000, 20.0),
        ];
        let choice = Choice::smallest(all, "validation").expect("a choice");
        assert_eq!(choice.chosen().name, "quick", "blurred is 1.4 dB below, slow as large and slower");
        let sentence = choice.sentence();
        for part in
            ["chosen: quick", "4 images of validation", "(1.29 dB)", "large with 31.00", "-75 %", "-50 %", "1.10 dB"]
        {
            assert!(sentence.contains(part), "{part}: {sentence}");
        }
        let table = choice.table();
        assert_eq!(
            table.rows.iter().map(|row| row[0].as_str()).collect::<Vec<_>>(),
            ["blurred", "slow", "quick", "large"]
        );
        assert_eq!(table.rows[2].last().map(String::as_str), Some("chosen"));
        assert_eq!(table.rows[3].last().map(String::as_str), Some("best"));
    }

    #[test]
    fn the_reported_figure_takes_no_part_and_a_single_image_chooses_nothing() {
        let mut small = candidate("small", 25.0, 1, 1.0);
        small.reported = 99.0;
        let choice =
            Choice::smallest(vec![small.clone(), candidate("large", 31.0, 9, 9.0)], "validation").expect("one");
        assert!(
            choice.chosen().name == "large" && choice.sentence().contains("no smaller one"),
            "{}",
            choice.sentence()
        );
        small.scores.truncate(1);
        assert_eq!(Choice::smallest(vec![small], "validation"), None);
        let mut lost = candidate("lost", 40.0, 1, 1.0);
        lost.scores = vec![f64::NAN; 4];
        let choice = Choice::smallest(vec![lost, candidate("kept", 20.0, 9, 9.0)], "validation").expect("one");
        assert_eq!(choice.chosen().name, "kept");
    }
}
