//! Barriers as browsers judge them: all units of a cube must reach each, and a compiler must be able to see it.
//!
//! naga, through which wgpu compiles, does not ask for that. Tint, Chrome's compiler, refuses the shader, and so does
//! an older one of DirectX 12. The shaders are those of a native build, in which every buffer may be written.

use std::path::Path;
use std::process::{Command, Stdio};

use gs_kernels::cpu::sparse_conv::{Channels, Neighbours};
use gs_kernels::cube::sparse_conv::{Table, device_table, forward};

use super::support::{client, down, up, up_u32};

/// Tests that launch all kernels whose loops with barriers have their length from a buffer, in all their forms.
const LAUNCHING: [&str; 4] = [
    "cube_twins::rasterize::three_channels",
    "cube_twins::rasterize::one_channel_and_many",
    "cube_twins::instants::a_few_move",
    "cube_twins::uniformity::one_row_is_convolved",
];

#[test]
fn one_row_is_convolved() {
    let neighbours = Neighbours { inputs: 1, outputs: 1, offsets: 33, table: [vec![-1; 32], vec![0]].concat() };
    let values: Vec<u32> = device_table(&neighbours).into_iter().map(|value| value as u32).collect();
    let table = Table { values: &up_u32(&values), inputs: 1, outputs: 1, offsets: 33, flip: false };
    let weights: Vec<f32> = (0..33).map(|k| k as f32).collect();
    let channels = Channels { input: 1, output: 1 };
    let found = forward(client(), &up(&[2.0]), &up(&weights), &table, channels).expect("forward");
    assert_eq!(down(&found), [64.0]);
}

/// The names and texts of the shaders in a log of CubeCL's.
fn shaders(log: &str) -> Vec<(&str, &str)> {
    let logged = log.split("[START_KERNEL_COMPILATION]").skip(1);
    let parts = logged.filter_map(|part| {
        let (head, rest) = part.split_once("```wgsl\n")?;
        let name = head.lines().find_map(|line| line.strip_prefix("name: ")).unwrap_or("a kernel");
        Some((name, rest.split_once("\n```")?.0))
    });
    parts.collect()
}

/// The log of the shaders that [`LAUNCHING`] compile: in a process of its own, because a device is opened with its log.
fn compiled(folder: &Path) -> String {
    let log = folder.join("shaders.log");
    let _ = std::fs::remove_file(&log);
    let mut tests = Command::new(std::env::current_exe().expect("this program"));
    let done = tests.args(LAUNCHING).arg("--exact").env("CUBECL_DEBUG_LOG", &log).stdout(Stdio::null()).status();
    assert!(done.expect("this program again").success(), "a test that launches kernels fails");
    std::fs::read_to_string(log).expect("the shaders' log")
}

#[test]
fn a_browser_accepts_the_barriers() {
    if Command::new("tint").arg("--help").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        println!("no `tint` here: barriers are not judged");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let log = compiled(folder);
    let shaders = shaders(&log);
    if shaders.is_empty() {
        println!("this build makes no WGSL: barriers are not judged");
        return;
    }
    for kernel in ["rasterize_forward", "rasterize_backward", "class_count", "fill_kernel", "rows_kernel"] {
        assert!(
            shaders.iter().any(|(name, _)| name.contains(kernel)),
            "{kernel} is not among {} shaders",
            shaders.len()
        );
    }
    let (file, written) = (folder.join("shader.wgsl"), folder.join("written.wgsl"));
    for (name, text) in shaders {
        std::fs::write(&file, text).expect("a file in the tests' folder");
        let judged =
            Command::new("tint").args(["--format", "wgsl", "-o"]).arg(&written).arg(&file).output().expect("tint");
        assert!(judged.status.success(), "{name}: {}", String::from_utf8_lossy(&judged.stderr));
    }
}
