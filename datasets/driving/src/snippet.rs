//! [`Snippet`]: the frames of a log that are reconstructed together (supplement of Flux4D, sections C.1 and C.2).

/// Logs of PandaSet that the paper tests on; all others train.
pub const TEST_LOGS: [&str; 10] = ["001", "011", "016", "065", "084", "090", "106", "115", "123", "158"];

/// Frames of a snippet for interpolation: one second at 10 Hz.
pub const INTERPOLATION_FRAMES: usize = 11;

/// Frames of a snippet for prediction: a second and a half.
pub const PREDICTION_FRAMES: usize = 16;

/// Frames that consecutive snippets share.
pub const OVERLAP: usize = 5;

/// What a snippet is for.
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

/// The snippets of a log with `frames` frames: each shares [`OVERLAP`] frames with the one before. Where the last would reach beyond the
/// log, it begins earlier instead, so that all frames are in one. A log that is shorter than one snippet is one short snippet, and an
/// empty log has none.
pub fn snippets(frames: usize, kind: SnippetKind) -> Vec<Snippet> {
    spaced(frames, kind, kind.frames() - OVERLAP)
}

/// Snippets that begin every `every` frames (20 in the main paper: four of a log with 80 frames); `every` of 0 counts as 1.
pub fn spaced(frames: usize, kind: SnippetKind, every: usize) -> Vec<Snippet> {
    let count = kind.frames();
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

/// Snippets of runs of frames that follow each other: a gap in the recording, longer than `gap` seconds, is in no snippet.
pub fn snippets_without_gaps(times: &[f64], kind: SnippetKind, gap: f64) -> Vec<Snippet> {
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=times.len() {
        if end < times.len() && times[end] - times[end - 1] <= gap {
            continue;
        }
        for mut snippet in snippets(end - start, kind) {
            for list in [&mut snippet.frames, &mut snippet.inputs, &mut snippet.targets, &mut snippet.future] {
                list.iter_mut().for_each(|frame| *frame += start);
            }
            found.push(snippet);
        }
        start = end;
    }
    found
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
        let starts =
            |every| spaced(80, SnippetKind::Interpolation, every).iter().map(|s| s.frames[0]).collect::<Vec<_>>();
        assert_eq!(starts(20), [0, 20, 40, 60]);
    }

    #[test]
    fn a_gap_is_in_no_snippet() {
        let mut times: Vec<f64> = (0..30).map(|i| 0.1 * f64::from(i)).collect();
        times.iter_mut().skip(13).for_each(|time| *time += 5.0);
        let list = snippets_without_gaps(&times, SnippetKind::Interpolation, 0.15);
        assert!(list.iter().all(|s| s.frames.iter().all(|f| *f < 13) || s.frames.iter().all(|f| *f >= 13)), "{list:?}");
        assert_eq!(list.last().map(|s| s.frames[10]), Some(29));
    }
}
