//! Processor time and memory of this process, as far as the system reports them (Linux).

use std::fs;
use std::time::Instant;

/// Largest buffer, bytes, that the process keeps when it is freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const KEPT: i32 = 256 << 20;

/// Keeps freed buffers instead of giving them back to the system.
///
/// A step allocates and frees the same few large buffers. The C library's default returns each to the system and gets
/// it back page by page, zeroed, which cost a quarter of the processor time of a step (lund-door at 480 pixels). Has an
/// effect only on Linux with glibc.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `mallopt` only changes parameters of the allocator, and is called before any other thread exists.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, KEPT);
        libc::mallopt(libc::M_TRIM_THRESHOLD, 4 * KEPT - 1);
    }
}

/// Peak resident memory, bytes.
pub fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}

/// Returns freed buffers to the system. Buffers of training steps and of evaluation differ in size, so both would stay
/// allocated.
pub fn release_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `malloc_trim` may be called at any time.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Returns freed buffers to the system and resets [`peak_memory`] to what is resident now, so that each of several runs
/// in a process has its own peak. `false` if the system does not allow it.
pub fn forget_peak_memory() -> bool {
    release_freed_memory();
    // 5 resets VmHWM (proc(5), since Linux 4.0).
    fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// Processor time of all threads so far, seconds.
pub fn cpu_seconds() -> Option<f64> {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: `time` is a valid pointer for the result.
        let status = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
        if status == 0 {
            return Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9);
        }
    }
    cpu_ticks()
}

/// Seconds: wall-clock, and of the processor where the system reports it.
pub type Spent = (f64, Option<f64>);

/// Time since a moment, wall-clock and of the processor.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    begun: Instant,
    cpu_begun: Option<f64>,
}

impl Stopwatch {
    /// Begins now.
    pub fn start() -> Self {
        Self { begun: Instant::now(), cpu_begun: cpu_seconds() }
    }

    /// Seconds since then.
    pub fn spent(&self) -> Spent {
        let cpu = cpu_seconds().zip(self.cpu_begun).map(|(now, begun)| now - begun);
        (self.begun.elapsed().as_secs_f64(), cpu)
    }
}

/// The same in steps of 10 ms, for a C library without a clock for it.
fn cpu_ticks() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is the program's name in parentheses and may hold spaces; user and system time are the 12th and
    // 13th after it, in ticks of 1/100 s (USER_HZ, the same on every Linux).
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    Some(ticks as f64 / 100.0)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn linux_says_so() {
        assert!(super::peak_memory().expect("VmHWM") > 1 << 20);
        let (ticks, clock) = (super::cpu_ticks().expect("stat"), super::cpu_seconds().expect("a clock"));
        // A tick is 10 ms, and other tests of this process may run on several cores between the two readings.
        assert!(ticks >= 0.0 && clock >= ticks - 0.05, "{clock} {ticks}");
    }
}
