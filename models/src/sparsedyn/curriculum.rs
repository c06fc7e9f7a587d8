//! Progressive physics learning (Eq. 8 to 10): which frames a step compares.
//!
//! Frames count from 0, the first; `T` is the last frame that is seen. In the short-horizon phase one frame is drawn
//! from the active window `{0 .. H(n) - 1}`, which grows by `s_H` frames every `M` steps. Once it holds all frames, the
//! long-horizon phase draws one frame from `{t' .. T}` and `K` more from `{0 .. t' - 1}`, whose losses count
//! `lambda_early / K` each.

/// The schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curriculum {
    /// `T`, the last frame that is seen, at least 0.
    pub last_frame: usize,
    /// `s_H`, frames by which the window grows; 0: all frames from the start.
    pub growth: usize,
    /// `M`, steps from one growth to the next, at least 1.
    pub interval: usize,
    /// Share of the draws from a growing window that are of its newest frames, 0 to 1; 0 (the paper): all frames are
    /// drawn alike. In a long window a new frame is else drawn so seldom that fast motion is lost.
    pub newest: f64,
    /// Share of the replays that are of the first frame, 0 to 1; 0 (the paper): earlier frames are drawn alike. The
    /// first frame is else drawn so seldom that Gaussians stay where later frames want them, and the motion begins with
    /// a jump.
    pub first: f64,
    /// `t'`, the first frame of the late horizon; 0: the late horizon holds all frames ("full-horizon").
    pub late_from: usize,
    /// `K`, frames replayed in each step of the long-horizon phase.
    pub replays: usize,
    /// `lambda_early`, the weight of the replays' mean loss.
    pub replay_weight: f64,
}

/// Newest frames of a window, as many as the paper's window grows by.
const NEWEST_FRAMES: usize = 4;

/// Fineness of the shares of draws.
const FINENESS: usize = 1000;

/// The phase of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The window holds this many frames, from the first on.
    Short {
        /// `H(n)`.
        frames: usize,
    },
    /// The window holds all frames.
    Long,
}

/// A frame of a step, and the weight of its loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampled {
    /// The frame, 0 to `T`.
    pub frame: usize,
    /// The factor of its loss.
    pub weight: f64,
}

impl Curriculum {
    /// The phase of physics step `n`, from 1 (Eq. 8).
    ///
    /// The paper's `H(n) = min(T, s_H (floor((n - 1) / M) + 1))` gives the window `{0 .. H(n) - 1}`, which never holds
    /// frame `T`; the long-horizon phase, which begins where `H(n) = T`, does.
    pub fn phase(&self, n: usize) -> Phase {
        if self.growth == 0 {
            return Phase::Long;
        }
        let frames = self.growth * ((n.max(1) - 1) / self.interval.max(1) + 1);
        if frames >= self.last_frame { Phase::Long } else { Phase::Short { frames } }
    }

    /// The first step of the long-horizon phase, from 1.
    pub fn long_from(&self) -> usize {
        if self.growth == 0 { 1 } else { (self.last_frame.div_ceil(self.growth).max(1) - 1) * self.interval.max(1) + 1 }
    }

    /// The frames of physics step `n`, from 1, the late one first. `draw(below)` gives a number from 0 to below
    /// `below`, evenly distributed.
    pub fn frames(&self, n: usize, mut draw: impl FnMut(usize) -> usize) -> Vec<Sampled> {
        match self.phase(n) {
            Phase::Short { frames } => {
                let first = if happens(self.newest, &mut draw) { frames.saturating_sub(NEWEST_FRAMES) } else { 0 };
                vec![Sampled { frame: first + draw(frames - first), weight: 1.0 }]
            }
            Phase::Long => {
                let late = self.late_from.min(self.last_frame);
                let first = Sampled { frame: late + draw(self.last_frame - late + 1), weight: 1.0 };
                let replays = if late == 0 { 0 } else { self.replays };
                let weight = self.replay_weight / replays.max(1) as f64;
                let replayed = (0..replays)
                    .map(|_| Sampled { frame: if happens(self.first, &mut draw) { 0 } else { draw(late) }, weight });
                std::iter::once(first).chain(replayed).collect()
            }
        }
    }
}

/// Whether an event of this probability happens.
fn happens(share: f64, draw: &mut impl FnMut(usize) -> usize) -> bool {
    share > 0.0 && (draw(FINENESS) as f64) < share * FINENESS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Curriculum = Curriculum {
        last_frame: 45,
        growth: 4,
        interval: 500,
        newest: 0.0,
        first: 0.0,
        late_from: 35,
        replays: 4,
        replay_weight: 0.5,
    };

    /// Draws of a generator that begins alike each time.
    fn draws() -> impl FnMut(usize) -> usize {
        let mut state = 1_u64;
        move |below| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 33) as usize) % below
        }
    }

    #[test]
    fn the_window_grows_as_in_equation_8() {
        assert_eq!(PAPER.phase(1), Phase::Short { frames: 4 });
        assert_eq!(PAPER.phase(500), Phase::Short { frames: 4 });
        assert_eq!(PAPER.phase(501), Phase::Short { frames: 8 });
        assert_eq!(PAPER.phase(5500), Phase::Short { frames: 44 });
        assert_eq!(PAPER.phase(5501), Phase::Long);
        assert_eq!(PAPER.long_from(), 5501);
    }

    #[test]
    fn short_steps_stay_in_the_window_and_long_ones_replay() {
        let mut draw = draws();
        for n in (1..5501).step_by(37) {
            let Phase::Short { frames } = PAPER.phase(n) else { panic!("short at {n}") };
            let sampled = PAPER.frames(n, &mut draw);
            assert!(sampled.len() == 1 && sampled[0].frame < frames && sampled[0].weight == 1.0);
        }
        let mut seen = [false; 46];
        for n in 5501..7000 {
            let sampled = PAPER.frames(n, &mut draw);
            assert_eq!(sampled.len(), 5);
            assert!((35..=45).contains(&sampled[0].frame));
            assert!(sampled[1..].iter().all(|one| one.frame < 35 && one.weight == 0.125));
            sampled.iter().for_each(|one| seen[one.frame] = true);
        }
        assert!(seen.iter().all(|seen| *seen), "every frame is drawn");
    }

    #[test]
    fn the_newest_frames_have_their_share_of_the_draws() {
        let mut draw = draws();
        let half = Curriculum { newest: 0.5, ..PAPER };
        // A window of 40 frames: half of the draws are of the last four, and a tenth of the other half.
        let drawn: Vec<usize> = (0..4000).map(|_| half.frames(5000, &mut draw)[0].frame).collect();
        assert!(drawn.iter().all(|frame| *frame < 40));
        let newest = drawn.iter().filter(|frame| **frame >= 36).count();
        // 0.55 of 4000 draws; their standard deviation is 31, five of which are 157.
        assert!((2200 - 157..=2200 + 157).contains(&newest), "{newest}");
        let all = Curriculum { newest: 1.0, ..PAPER };
        assert!((1..500).all(|n| all.frames(n, &mut draw)[0].frame < 4), "a window of four frames");
    }

    #[test]
    fn the_first_frame_has_its_share_of_the_replays() {
        let mut draw = draws();
        let quarter = Curriculum { first: 0.25, ..PAPER };
        let replayed: Vec<Sampled> = (0..1000).flat_map(|_| quarter.frames(6000, &mut draw).split_off(1)).collect();
        let first = replayed.iter().filter(|one| one.frame == 0).count();
        // A quarter of 4000, and a 35th of the others; their standard deviation is 28, five of which are 140.
        assert!(replayed.len() == 4000 && (1086 - 140..=1086 + 140).contains(&first), "{first}");
        assert!(replayed.iter().all(|one| one.frame < 35 && one.weight == 0.125));
    }

    #[test]
    fn rows_of_table_3_without_replay_or_late_horizon() {
        let draw = |below: usize| below - 1;
        assert_eq!(Curriculum { replays: 0, ..PAPER }.frames(6000, draw), [Sampled { frame: 45, weight: 1.0 }]);
        assert_eq!(Curriculum { late_from: 0, ..PAPER }.frames(6000, draw), [Sampled { frame: 45, weight: 1.0 }]);
        assert_eq!(Curriculum { growth: 0, ..PAPER }.phase(1), Phase::Long);
        let single = Curriculum { last_frame: 0, ..PAPER };
        assert_eq!(single.frames(1, draw)[0].frame, 0, "one frame alone");
    }
}
