//! The tests of bits in the shaders under a compiler that assumes away NaN and infinity, as Metal's does by default.
//!
//! The expressions are taken from the kernels' source and compiled by `rustc`, whose LLVM applies the same assumptions
//! to operations marked `fast`. A test that depends on them alone is folded to a constant and leaves no comparison.

use std::path::Path;
use std::process::{Command, Stdio};

const MATH: &str = include_str!("../src/cube/math.rs");
const OPACITY: &str = include_str!("../src/cube/opacity.rs");

/// A test of the exponent's bits alone, which LLVM 19 and newer recognise.
const FOLDED: &str = "(u32::reinterpret(value) & 0x7f80_0000u32) != 0x7f80_0000u32";

/// The body of `name` in a kernel's source.
fn body<'a>(source: &'a str, name: &str) -> &'a str {
    let (_, rest) = source.split_once(&format!("fn {name}(value: f32) -> bool {{")).expect("the function is there");
    rest.split_once("\n}").expect("it ends").0.trim()
}

/// A library in which `tests` look at a value that fast operations have made.
fn library(tests: &[(&str, &str)]) -> String {
    let mut source = "#![feature(core_intrinsics)]\n#![allow(internal_features)]\n#![crate_type = \"lib\"]\n\
        trait Bits { fn reinterpret(value: f32) -> u32; }\n\
        impl Bits for u32 { fn reinterpret(value: f32) -> u32 { value.to_bits() } }\n"
        .to_owned();
    for (name, test) in tests {
        source += &format!(
            "#[unsafe(no_mangle)] pub fn {name}(a: f32, b: f32, c: f32) -> bool {{\n\
             let value = unsafe {{ core::intrinsics::fadd_fast(core::intrinsics::fmul_fast(a, b), c) }};\n{test}\n}}\n"
        );
    }
    source
}

/// LLVM's text for `source`; `None` without a compiler that can be called and knows the intrinsics.
fn compiled(source: &str, folder: &Path) -> Option<String> {
    let (input, output) = (folder.join("fast_math.rs"), folder.join("fast_math.ll"));
    std::fs::write(&input, source).expect("a file in the tests' folder");
    let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
    // The intrinsics are not stable; this switch of the compiler's own lets a stable one use them.
    rustc.env("RUSTC_BOOTSTRAP", "1").args(["--edition=2024", "--emit=llvm-ir", "-O", "-o"]).arg(&output).arg(&input);
    let done = rustc.stdout(Stdio::null()).stderr(Stdio::null()).status();
    done.is_ok_and(|status| status.success()).then(|| std::fs::read_to_string(output).expect("its output"))
}

/// Whether the function `name` still compares.
fn compares(text: &str, name: &str) -> bool {
    let (_, rest) = text.split_once(&format!("@{name}(")).expect("the function is there");
    rest.split_once("\n}").expect("it ends").0.contains("icmp")
}

#[test]
fn bits_are_compared_under_fast_math() {
    let tests = [("folded", FOLDED), ("finite", body(MATH, "finite")), ("is_number", body(OPACITY, "is_number"))];
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let Some(text) = compiled(&library(&tests), folder) else {
        println!("no rustc to call: what fast math does to the kernels' tests of bits is not checked");
        return;
    };
    assert!(!compares(&text, "folded"), "this compiler keeps every test, so it shows nothing of the others");
    assert!(compares(&text, "finite"));
    assert!(compares(&text, "is_number"));
}
