//! Logs on stderr beside progress, with -v.

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
    // `--device auto` tries GPUs that may be absent, and CubeCL warns about each; a named device that fails is an error
    // of this program.
    let absent = if verbose > 1 { "debug" } else { "error" };
    let default = format!(
        "{others},cubecl_common={absent},gs_train={ours},gs_pipelines={ours},gs_datasets={ours},gs_burn={ours},gs_kernels={ours},gsburn={ours}"
    );
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .init();
}
