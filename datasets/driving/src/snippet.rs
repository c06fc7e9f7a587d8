//! [`Snippet`]: the frames of a log that are reconstructed together (supplement of Flux4D, sections C.1 and C.2).

use std::ops::Range;

use gs_base::counted;
use gs_datasets::some_names;

use crate::description::Frame;

/// Logs of PandaSet that the paper tests on; all others train.
pub const TEST_LOGS: [&str; 10] = ["001", "011", "016", "065", "084", "090", "106", "115", "123", "158"];

/// Logs of Argoverse 2 that the paper tests on: the first ones by name. All others train.
pub const TEST_LOGS_ARGOVERSE: usize = 100;

/// Frames of a snippet for interpolation: one second at 10 Hz.
pub const INTERPOLATION_FRAMES: usize = 11;

/// Frames of a snippet for prediction: a second and a half.
pub const PREDICTION_FRAMES: usize = 16;

/// Frames that consecutive snippets share.
pub const OVERLAP: usize = 5;

/// Longest time between two frames of a snippet, in usual times between frames (their median). Where one frame is
/// missing it is 2; clocks vary by a few percent.
const GAP: f64 = 1.5;

/// The purpose of a snippet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SnippetKind {
    /// Inputs 0, 2, ..., 10; targets 1, 3, ..., 9.
    Interpolation,
    /// The same, and the frames 11 to 15 to be predicted.
    Prediction,
}

impl SnippetKind {
    /// Frames of a whole snippet.
    pub fn frames(self) -> usize {
        match self {
            Self::Interpolation => INTERPOLATION_FRAMES,
            Self::Prediction => PREDICTION_FRAMES,
        }
    }
}

/// Frames that are reconstructed together. All numbers are places in the log's list of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snippet {
    /// All frames, ascending.
    pub frames: Vec<usize>,
    /// Frames whose sweeps and images are given.
    pub inputs: Vec<usize>,
    /// Frames between inputs, to be interpolated.
    pub targets: Vec<usize>,
    /// Frames after the last input, to be predicted.
    pub future: Vec<usize>,
}

impl Snippet {
    /// The snippet of `count` frames from `start`.
    pub fn new(start: usize, count: usize) -> Self {
        let pasts = count.min(INTERPOLATION_FRAMES);
        let at = |offset: usize| start + offset;
        Self {
            frames: (0..count).map(at).collect(),
            inputs: (0..pasts).step_by(2).map(at).collect(),
            targets: (1..pasts).step_by(2).map(at).collect(),
            future: (pasts..count).map(at).collect(),
        }
    }
}

/// The snippets of a log with `frames` frames: each shares [`OVERLAP`] frames with the one before. Where the last would
/// reach beyond the log, it begins earlier instead, so that all frames are in one. A log that is shorter than one
/// snippet is one short snippet, and an empty log has none.
pub fn snippets(frames: usize, kind: SnippetKind) -> Vec<Snippet> {
    spaced(frames, kind.frames(), kind.frames() - OVERLAP)
}

/// Snippets of `count` frames that begin every `every` frames (20 in the main paper: four of a log with 80 frames);
/// `every` of 0 counts as 1. Ends are as in [`snippets`].
pub fn spaced(frames: usize, count: usize, every: usize) -> Vec<Snippet> {
    if frames == 0 {
        return Vec::new();
    }
    if frames <= count {
        return vec![Snippet::new(0, frames)];
    }
    let mut starts: Vec<usize> = (0..=frames - count).step_by(every.max(1)).collect();
    let covers_all = every < count;
    if covers_all && starts.last().is_some_and(|last| last + count < frames) {
        starts.push(frames - count);
    }
    starts.into_iter().map(|start| Snippet::new(start, count)).collect()
}

/// Runs of frames that follow each other without a gap in the recording; `times` are those of all frames, seconds,
/// ascending. A gap is longer than 1.5 times the median time between frames.
pub fn runs(times: &[f64]) -> Vec<Range<usize>> {
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = intervals.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len().saturating_sub(1) / 2).copied().unwrap_or(0.0);
    let begins: Vec<usize> =
        (0..times.len()).filter(|frame| *frame == 0 || intervals[frame - 1] > GAP * usual).collect();
    let ends = begins.iter().skip(1).copied().chain([times.len()]);
    begins.iter().copied().zip(ends).map(|(begin, end)| begin..end).collect()
}

/// The gaps between the [`runs`] of the frames of a recording, in a phrase: "2 gaps (20.1 s after frame 10, ...)";
/// `None` without any.
pub fn gaps(frames: &[Frame]) -> Option<String> {
    let runs = runs(&frames.iter().map(|frame| frame.time).collect::<Vec<_>>());
    let gap = |pair: &[Range<usize>]| {
        let (before, after) = (&frames[pair[0].end - 1], &frames[pair[1].start]);
        format!("{:.1} s after frame {}", after.time - before.time, before.name)
    };
    let found: Vec<String> = runs.windows(2).map(gap).collect();
    (!found.is_empty()).then(|| format!("{} ({})", counted(found.len(), "gap"), some_names(&found)))
}

/// [`spaced`] snippets of each of the [`runs`] of a recording: a gap lies inside no snippet.
pub fn snippets_without_gaps(times: &[f64], count: usize, every: usize) -> Vec<Snippet> {
    let of_run = |run: Range<usize>| {
        let list = spaced(run.len(), count, every).into_iter();
        list.map(move |snippet| Snippet::new(run.start + snippet.frames[0], snippet.frames.len()))
    };
    runs(times).into_iter().flat_map(of_run).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snippet_is_as_the_paper_says() {
        let one = Snippet::new(0, INTERPOLATION_FRAMES);
        assert_eq!((one.inputs, one.targets), (vec![0, 2, 4, 6, 8, 10], vec![1, 3, 5, 7, 9]));
        assert!(one.future.is_empty());
        let future = Snippet::new(3, PREDICTION_FRAMES);
        assert_eq!((future.inputs[5], future.future), (13, vec![14, 15, 16, 17, 18]));
    }

    #[test]
    fn all_frames_are_covered_and_neighbours_overlap() {
        for frames in 1..100 {
            for kind in [SnippetKind::Interpolation, SnippetKind::Prediction] {
                let list = snippets(frames, kind);
                let covered: std::collections::BTreeSet<usize> = list.iter().flat_map(|s| s.frames.clone()).collect();
                assert_eq!(covered, (0..frames).collect(), "{frames} frames");
                for pair in list.windows(2) {
                    assert!(
                        pair[1].frames[0] + OVERLAP <= pair[0].frames[0] + pair[0].frames.len(),
                        "{frames}: {pair:?}"
                    );
                }
            }
        }
        assert!(snippets(0, SnippetKind::Interpolation).is_empty());
        let starts = |every| spaced(80, INTERPOLATION_FRAMES, every).iter().map(|s| s.frames[0]).collect::<Vec<_>>();
        assert_eq!(starts(20), [0, 20, 40, 60]);
    }

    /// Gaps at every place of a recording, a missing frame and five seconds: no snippet has frames of both sides, and
    /// every frame is in one. Clocks that vary by a tenth have no gap.
    #[test]
    fn a_gap_is_in_no_snippet() {
        let times = |gap: usize, seconds: f64| -> Vec<f64> {
            (0..30).map(|i| 0.1 * i as f64 + if i >= gap { seconds } else { 0.0 }).collect()
        };
        for gap in 1..30 {
            for seconds in [0.1, 5.0] {
                for (count, every) in [(INTERPOLATION_FRAMES, 6), (PREDICTION_FRAMES, 11), (4, 2)] {
                    let list = snippets_without_gaps(&times(gap, seconds), count, every);
                    let is_whole =
                        |s: &Snippet| s.frames.iter().all(|f| *f < gap) || s.frames.iter().all(|f| *f >= gap);
                    assert!(list.iter().all(is_whole), "gap of {seconds} s before {gap}: {list:?}");
                    let covered: std::collections::BTreeSet<usize> =
                        list.iter().flat_map(|s| s.frames.clone()).collect();
                    assert_eq!(covered, (0..30).collect(), "gap before {gap}");
                }
            }
        }
        let list = snippets_without_gaps(&times(13, 5.0), INTERPOLATION_FRAMES, 6);
        assert_eq!(list.last().map(|s| (s.frames[10], s.inputs[5])), Some((29, 29)));
        let uneven: Vec<f64> = (0..30).map(|i| 0.1 * f64::from(i) + 0.005 * f64::from(i % 2)).collect();
        let lengths = |times: &[f64]| runs(times).iter().map(Range::len).collect::<Vec<_>>();
        assert_eq!(lengths(&uneven), [30]);
        assert_eq!((lengths(&[]), lengths(&[3.0]), lengths(&[3.0, 9.0])), (vec![], vec![1], vec![2]));
    }

    #[test]
    fn gaps_are_named() {
        let frame =
            |i: usize, time: f64| Frame { name: format!("{i:02}"), time, has_sweep: true, ego: glam::DMat4::IDENTITY };
        let frames = |later: f64| -> Vec<Frame> {
            (0..22).map(|i| frame(i, 0.1 * i as f64 + if i >= 11 { later } else { 0.0 })).collect()
        };
        assert_eq!(gaps(&frames(20.0)).as_deref(), Some("1 gap (20.1 s after frame 10)"));
        assert_eq!((gaps(&frames(0.0)), gaps(&[])), (None, None));
    }
}
