//! The progress bar: loss, PSNR, count, steps per second and time left. Without a terminal, lines: soon, and then more
//! and more rarely.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use gs_base::printable;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Time to the first line where there is no terminal: a log shows at once that a run is alive, and how long it will
/// take.
const FIRST_LINE: Duration = Duration::from_secs(2);

/// Longest time between lines; from the first on it doubles, so that the log of a day stays short.
const LINE_EVERY: Duration = Duration::from_secs(60);

/// Weight of the newest value in the running means of loss and PSNR: about the last 20 photos.
const SMOOTHING: f64 = 0.05;

/// Prints a line before there is a bar.
pub fn say(line: &str, quiet: bool) {
    if !quiet {
        print(line);
    }
}

/// A line on stderr. Names from data sets are in it. A closed stderr is no reason to end a run.
fn print(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", printable(line));
}

/// The progress bar, updated from outside the step.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    terminal: bool,
    quiet: bool,
    last_line: Instant,
    /// Time to the next line.
    wait: Duration,
    first_step: usize,
    steps: usize,
    begun: Instant,
    loss: Option<f64>,
    psnr: Option<f64>,
}

impl Progress {
    /// A bar for a run of `steps` that has taken `step` already; a `quiet` one shows nothing.
    pub fn new(step: usize, steps: usize, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal() && !quiet;
        let bar = ProgressBar::with_draw_target(
            Some(steps as u64),
            if terminal { ProgressDrawTarget::stderr_with_hz(8) } else { ProgressDrawTarget::hidden() },
        );
        let style = "{bar:30.cyan/blue} {pos}/{len} {per_sec} left {eta} {msg}";
        bar.set_style(ProgressStyle::with_template(style).expect("a valid template"));
        bar.set_position(step as u64);
        bar.reset_eta();
        let now = Instant::now();
        Self {
            bar,
            terminal,
            quiet,
            last_line: now,
            wait: FIRST_LINE,
            first_step: step,
            steps,
            begun: now,
            loss: None,
            psnr: None,
        }
    }

    /// Shows a step; `psnr` if it was measured. The first of `counts` is shown.
    pub fn step(&mut self, step: usize, loss: f32, psnr: Option<f64>, counts: &[(&str, f64)]) {
        let smooth = |mean: Option<f64>, new: f64| Some(mean.map_or(new, |mean| mean + SMOOTHING * (new - mean)));
        if loss.is_finite() {
            self.loss = smooth(self.loss, f64::from(loss));
        }
        if let Some(psnr) = psnr {
            self.psnr = smooth(self.psnr, psnr);
        }
        let loss = self.loss.map_or(String::new(), |loss| format!("loss {loss:.4} "));
        let psnr = self.psnr.map_or(String::new(), |psnr| format!("PSNR {psnr:.2} "));
        let count = counts.first().map_or(String::new(), |(name, count)| format!("{count} {name}"));
        let message = format!("{loss}{psnr}{count}");
        if self.terminal {
            self.bar.set_position(step as u64);
            self.bar.set_message(message);
        } else if !self.quiet && (self.last_line.elapsed() >= self.wait || step == self.steps) {
            self.last_line = Instant::now();
            self.wait = (2 * self.wait).min(LINE_EVERY);
            let rate = (step - self.first_step) as f64 / self.begun.elapsed().as_secs_f64();
            let left = (self.steps - step) as f64 / rate;
            let spent = self.begun.elapsed().as_secs_f64();
            // A closed stderr is no reason to end a run.
            let _ = writeln!(
                std::io::stderr(),
                "step {step} of {}, {spent:.0} s, {rate:.2} a second, {left:.0} s left; {message}",
                self.steps
            );
        }
    }

    /// Prints a line above the bar.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        if self.terminal { self.bar.suspend(|| print(line)) } else { print(line) }
    }

    /// Restores the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
