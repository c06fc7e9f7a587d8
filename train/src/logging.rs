//! Output to stderr beside progress: logs with -v, and one sentence for an error.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;

/// Shows warnings, and more with each `-v`; the environment variable RUST_LOG takes precedence.
pub fn init(verbose: u8) {
    let ours = match verbose {
        0 => "warn",
        1 => "info",
        2 => "debug",
        _ => "trace",
    };
    // Other crates stay at warnings until -vvv: a GPU backend logs every kernel.
    let others = if verbose > 2 { "debug" } else { "warn" };
    // `--device auto` tries GPUs that may be absent, and CubeCL warns about each; a named device that fails is an error of this
    // program.
    let absent = if verbose > 1 { "debug" } else { "error" };
    let default = format!(
        "{others},cubecl_common={absent},gs_train={ours},gs_datasets={ours},gs_burn={ours},gs_kernels={ours},gsburn={ours}"
    );
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .init();
}

/// An error and its causes on one line. A cause that is already part of the text is not repeated.
pub fn one_sentence(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string().replace('\n', " ");
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::one_sentence;

    #[test]
    fn causes_are_said_once() {
        let inner = anyhow::anyhow!("disk full");
        assert_eq!(one_sentence(&inner.context("a.ply: cannot write")), "a.ply: cannot write: disk full");
        let repeated = anyhow::anyhow!("disk full").context("a.ply: cannot write: disk full");
        assert_eq!(one_sentence(&repeated), "a.ply: cannot write: disk full");
    }
}
