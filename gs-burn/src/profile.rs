//! Time of each stage of a step: wall-clock and processor seconds, measured on the thread that starts the work.
//!
//! Stages nest, and each is charged only for time outside its inner stages, so the stages of a [`step`] add up to it;
//! outside a step nothing is charged. The operations of [`ops`](crate::ops) are stages already, forward and backward; a
//! caller adds its own. A recording belongs to the thread that began it, which calls the operations and runs the
//! backward pass. The threads of an operation are included in the processor time, which is that of the whole process.
//! Without a recording a stage costs the reading of one thread-local flag.
//!
//! ```
//! use gs_burn::profile;
//!
//! profile::begin(profile::Clock { cpu: || None, wait: Box::new(|| ()) });
//! {
//!     let _step = profile::step();
//!     profile::timed("loss", || 1 + 1);
//! }
//! let stages = profile::end();
//! assert_eq!(stages.iter().map(|stage| stage.name).collect::<Vec<_>>(), [profile::REST, "loss"]);
//! ```

use std::cell::{Cell, RefCell};
use std::time::Instant;

/// The stage for everything in a step outside other stages; it is entered once per step.
pub const REST: &str = "everything else";

/// The clocks that a recording reads at each boundary of a stage.
pub struct Clock {
    /// Processor time of the process so far, all threads, seconds; `None` if the system does not report it.
    pub cpu: fn() -> Option<f64>,
    /// Waits until the device has finished its work. Nothing on the CPU; on a GPU, whose work is queued, a stage would
    /// otherwise be charged for queueing alone. The waits slow a profiled step down.
    pub wait: Box<dyn Fn()>,
}

impl std::fmt::Debug for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Clock").finish_non_exhaustive()
    }
}

/// Time of a stage, without the stages inside it.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTime {
    /// Its name.
    pub name: &'static str,
    /// How often it was entered.
    pub calls: u64,
    /// Wall-clock time, seconds.
    pub wall: f64,
    /// Processor time of all threads, seconds; `None` if the system does not report it.
    pub cpu: Option<f64>,
}

thread_local! {
    static ON: Cell<bool> = const { Cell::new(false) };
    static RECORDER: RefCell<Option<Recorder>> = const { RefCell::new(None) };
}

struct Recorder {
    clock: Clock,
    /// In the order in which they were first entered.
    stages: Vec<StageTime>,
    open: Vec<Open>,
}

/// A stage that was entered and not yet left.
struct Open {
    stage: usize,
    whole: bool,
    since: Reading,
    /// Time charged to stages inside it.
    inside: Reading,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Step,
    Part,
    Whole,
}

#[derive(Clone, Copy)]
struct Reading {
    wall: f64,
    cpu: Option<f64>,
}

impl Reading {
    const ZERO: Self = Self { wall: 0.0, cpu: Some(0.0) };

    fn minus(self, other: Self) -> Self {
        Self { wall: self.wall - other.wall, cpu: self.cpu.zip(other.cpu).map(|(a, b)| a - b) }
    }

    fn plus(self, other: Self) -> Self {
        Self { wall: self.wall + other.wall, cpu: self.cpu.zip(other.cpu).map(|(a, b)| a + b) }
    }
}

impl Recorder {
    fn read(&self) -> Reading {
        thread_local! {
            static ORIGIN: Instant = Instant::now();
        }
        (self.clock.wait)();
        Reading { wall: ORIGIN.with(Instant::elapsed).as_secs_f64(), cpu: (self.clock.cpu)() }
    }

    /// Whether the stage is charged: not outside a step, and not inside a stage that is charged as a whole.
    fn enter(&mut self, name: &'static str, kind: Kind) -> bool {
        let within = match self.open.last() {
            None => kind == Kind::Step,
            Some(open) => !open.whole,
        };
        if !within {
            return false;
        }
        let found = self.stages.iter().position(|stage| stage.name == name);
        let stage = found.unwrap_or_else(|| {
            self.stages.push(StageTime { name, calls: 0, wall: 0.0, cpu: Some(0.0) });
            self.stages.len() - 1
        });
        let since = self.read();
        self.open.push(Open { stage, whole: kind == Kind::Whole, since, inside: Reading::ZERO });
        true
    }

    fn leave(&mut self) {
        let now = self.read();
        let Some(open) = self.open.pop() else { return };
        let spent = now.minus(open.since);
        let own = spent.minus(open.inside);
        let stage = &mut self.stages[open.stage];
        stage.calls += 1;
        stage.wall += own.wall;
        stage.cpu = stage.cpu.zip(own.cpu).map(|(sum, own)| sum + own);
        if let Some(around) = self.open.last_mut() {
            around.inside = around.inside.plus(spent);
        }
    }
}

/// Begins a recording on this thread; one in progress is dropped.
pub fn begin(clock: Clock) {
    RECORDER.set(Some(Recorder { clock, stages: Vec::new(), open: Vec::new() }));
    ON.set(true);
}

/// Ends this thread's recording: its stages in the order in which they were first entered. None without a recording;
/// stages still open are left out.
pub fn end() -> Vec<StageTime> {
    ON.set(false);
    RECORDER.take().map_or_else(Vec::new, |recorder| recorder.stages)
}

/// The stages of this thread's recording so far.
pub fn so_far() -> Vec<StageTime> {
    RECORDER.with_borrow(|recorder| recorder.as_ref().map_or_else(Vec::new, |recorder| recorder.stages.clone()))
}

/// A stage in progress; it ends when this is dropped.
#[derive(Debug)]
#[must_use = "the stage ends where this is dropped"]
pub struct Stage {
    charged: bool,
}

/// Enters a step. It is the stage [`REST`], and all others are charged only inside it.
pub fn step() -> Stage {
    enter(REST, Kind::Step)
}

/// Enters a stage.
pub fn stage(name: &'static str) -> Stage {
    enter(name, Kind::Part)
}

/// Enters a stage that is charged for everything inside it, including inner stages.
pub fn whole_stage(name: &'static str) -> Stage {
    enter(name, Kind::Whole)
}

/// Runs `work` as a stage and returns its result.
pub fn timed<T>(name: &'static str, work: impl FnOnce() -> T) -> T {
    let _stage = stage(name);
    work()
}

fn enter(name: &'static str, kind: Kind) -> Stage {
    let charged = ON.get()
        && RECORDER.with_borrow_mut(|recorder| recorder.as_mut().is_some_and(|recorder| recorder.enter(name, kind)));
    Stage { charged }
}

impl Drop for Stage {
    fn drop(&mut self) {
        if self.charged {
            RECORDER.with_borrow_mut(|recorder| recorder.as_mut().into_iter().for_each(Recorder::leave));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    thread_local! {
        static NOW: Cell<f64> = const { Cell::new(0.0) };
    }

    fn work(seconds: f64) {
        NOW.set(NOW.get() + seconds);
    }

    /// A recording whose processor time is set by [`work`].
    fn begin_told() {
        begin(Clock { cpu: || Some(NOW.get()), wait: Box::new(|| ()) });
    }

    fn seconds(stages: &[StageTime]) -> Vec<(&'static str, u64, f64)> {
        stages.iter().map(|stage| (stage.name, stage.calls, stage.cpu.expect("told"))).collect()
    }

    #[test]
    fn a_stage_is_charged_for_what_is_not_inside_another() {
        begin_told();
        for _ in 0..2 {
            let _step = step();
            work(1.0);
            timed("inner", || {
                work(2.0);
                timed("innermost", || work(4.0));
            });
            work(8.0);
        }
        let stages = end();
        assert_eq!(seconds(&stages), [(REST, 2, 18.0), ("inner", 2, 4.0), ("innermost", 2, 8.0)]);
        assert!(stages.iter().all(|stage| stage.wall >= 0.0));
    }

    #[test]
    fn a_whole_stage_takes_what_is_inside() {
        begin_told();
        let step = step();
        {
            let _whole = whole_stage("whole");
            timed("inner", || timed("innermost", || work(4.0)));
        }
        timed("inner", || work(1.0));
        drop(step);
        assert_eq!(seconds(&end()), [(REST, 1, 0.0), ("whole", 1, 4.0), ("inner", 1, 1.0)]);
    }

    #[test]
    fn outside_a_step_nothing_is_charged() {
        begin_told();
        timed("before", || work(1.0));
        drop(step());
        timed("after", || work(1.0));
        assert_eq!(seconds(&end()), [(REST, 1, 0.0)]);
    }

    #[test]
    fn without_a_recording_nothing_is_kept() {
        assert!(!ON.get());
        assert_eq!(timed("nothing", || 3), 3);
        assert!(end().is_empty());
        // A recording may also end or begin inside a stage.
        begin_told();
        let open = step();
        end();
        drop(open);
        let before = step();
        begin_told();
        drop(before);
        assert!(end().is_empty());
    }
}
