//! The program as a user starts it, and what it says.

use std::path::Path;
use std::process::{Command, Output};

/// A training of a moment: twelve steps and 160 Gaussians.
pub const QUICK: [&str; 10] = [
    "--steps",
    "12",
    "--quiet",
    "--set",
    "eval.ms_ssim=false",
    "--set",
    "eval.images=1",
    "--set",
    "density.start=2",
    "--cap=160",
];

/// The program in `folder`. Mesa's Vulkan drivers write `error:` lines of their own where no such directory is named.
pub fn program(folder: &Path) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_gsburn"));
    program.current_dir(folder).env("XDG_RUNTIME_DIR", folder);
    program
}

/// Runs it to its end.
pub fn gsburn(folder: &Path, args: &[&str]) -> Output {
    program(folder).args(args).output().expect("the program starts")
}

/// Its text on both streams when it must succeed.
pub fn says(folder: &Path, args: &[&str]) -> [String; 2] {
    let output = gsburn(folder, args);
    let [said, errors] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success() && !errors.contains("panicked"), "{args:?}: {errors}");
    [said, errors]
}

/// Its standard output when it must succeed.
pub fn succeeds(folder: &Path, args: &[&str]) -> String {
    let [said, _] = says(folder, args);
    said
}

/// The one sentence of what must fail.
pub fn fails(folder: &Path, args: &[&str]) -> String {
    fails_with(1, folder, args)
}

/// The one sentence of what must fail with an exit code: 2 where the arguments themselves are refused.
pub fn fails_with(code: i32, folder: &Path, args: &[&str]) -> String {
    let output = gsburn(folder, args);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {errors}");
    assert!(!errors.contains("panicked"), "{args:?}: {errors}");
    let sentences: Vec<&str> = errors.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(sentences.len(), 1, "{args:?}: {errors}");
    sentences[0].to_string()
}
