//! CPU time of this process: on a machine that does other work too, it tells more than the time that passes.

/// Seconds of processor time of all threads so far.
#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
pub fn cpu_seconds() -> f64 {
    #[repr(C)]
    struct Timespec {
        seconds: i64,
        nanoseconds: i64,
    }
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut Timespec) -> i32;
    }
    const PROCESS_CPUTIME: i32 = 2;
    let mut time = Timespec { seconds: 0, nanoseconds: 0 };
    // SAFETY: the C library's function, with its own layout of the argument on 64-bit Linux.
    let failed = unsafe { clock_gettime(PROCESS_CPUTIME, &mut time) };
    assert_eq!(failed, 0, "Linux knows the processor time of a process");
    time.seconds as f64 + 1e-9 * time.nanoseconds as f64
}

/// Elsewhere the time that passes.
#[cfg(not(all(target_os = "linux", target_pointer_width = "64")))]
pub fn cpu_seconds() -> f64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
}
