//! Ctrl-C and its like: the first asks the run to save and leave, the second leaves at once.

use std::sync::Once;
use std::sync::atomic::{AtomicI32, Ordering};

/// The signal of Ctrl-C, where a system does not say which it was.
const SIGINT: i32 = 2;

/// The signal that came; 0 while none has.
static SIGNAL: AtomicI32 = AtomicI32::new(0);
static INSTALL: Once = Once::new();

/// From now on Ctrl-C, SIGTERM and SIGHUP set [`asked`] instead of ending the program.
pub fn watch() {
    INSTALL.call_once(|| {
        if let Err(error) = install() {
            tracing::warn!("Ctrl-C will end the program without saving: {error}");
        }
    });
}

/// Whether the program was asked to end.
pub fn asked() -> bool {
    SIGNAL.load(Ordering::SeqCst) != 0
}

/// The exit code of a program that was asked to end, 128 + the signal: 130 after Ctrl-C, 143 after SIGTERM, 129 after
/// SIGHUP.
pub fn exit_code() -> u8 {
    code(SIGNAL.load(Ordering::SeqCst))
}

fn code(signal: i32) -> u8 {
    let signal = if signal == 0 { SIGINT } else { signal };
    u8::try_from(128 + signal).unwrap_or(u8::MAX)
}

fn ask(signal: i32) {
    if SIGNAL.swap(signal, Ordering::SeqCst) != 0 {
        std::process::exit(i32::from(code(signal)));
    }
}

#[cfg(unix)]
fn install() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::Builder::new().name("signals".into()).spawn(move || signals.forever().for_each(ask))?;
    Ok(())
}

#[cfg(not(unix))]
fn install() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| ask(SIGINT))
}

#[cfg(test)]
mod tests {
    use super::code;

    #[test]
    fn exit_codes_name_the_signal() {
        assert_eq!([0, 2, 15, 1].map(code), [130, 130, 143, 129]);
    }
}
