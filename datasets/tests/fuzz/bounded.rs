//! Cases of damage, and the work of a case in bytes of memory, which no machine's speed changes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use proptest::prelude::*;
use proptest::test_runner::{Config, TestCaseError, TestCaseResult, TestRunner};

use crate::mutate::Step;

/// Cases of the long run: as many as the variable says, or `otherwise`.
pub fn asked(otherwise: u32) -> u32 {
    std::env::var("GS_FUZZ_CASES").map_or(otherwise, |text| text.parse().expect("GS_FUZZ_CASES is a number"))
}

/// Damage to one file.
pub fn steps() -> impl Strategy<Value = Vec<Step>> {
    proptest::collection::vec((any::<u8>(), any::<u32>(), any::<u64>()), 1..6)
}

/// Runs cases, and panics with the smallest that fails.
pub fn run<S: Strategy>(name: &str, cases: u32, strategy: S, case: impl Fn(S::Value) -> TestCaseResult) {
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    runner.run(&strategy, case).unwrap_or_else(|error| panic!("{name}: {error}"));
}

/// Whether a case neither panics nor works beyond its bounds.
pub fn kept(file: &str, case: impl FnOnce()) -> TestCaseResult {
    catch_unwind(AssertUnwindSafe(|| bounded(case))).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map_or("a panic, which is printed above", String::as_str);
        TestCaseError::fail(format!("{file}: {text}"))
    })
}

/// Most memory that a case may hold at once, bytes. Its files have some KB.
pub const HELD_MAX: usize = 64 << 20;

/// Most memory that a case may ask for in all, bytes.
pub const ASKED_MAX: usize = 256 << 20;

/// The system's allocator, counting.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
static ASKED: AtomicUsize = AtomicUsize::new(0);

fn count(bytes: usize) {
    ASKED.fetch_add(bytes, Relaxed);
    MOST.fetch_max(HELD.fetch_add(bytes, Relaxed) + bytes, Relaxed);
}

// SAFETY: every call goes on to the system's allocator as it came; beside that only numbers are added.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(memory, layout) }
    }
}

/// One case at a time: the counts are those of the whole program.
static ONE: Mutex<()> = Mutex::new(());

/// Runs a case and asserts that its work is within bounds.
pub fn bounded<T>(case: impl FnOnce() -> T) -> T {
    let _one = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let (held, asked) = (HELD.load(Relaxed), ASKED.load(Relaxed));
    MOST.store(held, Relaxed);
    let result = case();
    let (held, asked) = (MOST.load(Relaxed).saturating_sub(held), ASKED.load(Relaxed) - asked);
    assert!(held <= HELD_MAX && asked <= ASKED_MAX, "{held} bytes held, {asked} bytes asked for");
    result
}
