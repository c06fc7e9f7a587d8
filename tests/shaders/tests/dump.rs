//! The text of every kernel.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Once;

use gs_shaders::device::Record;

use crate::kernels::runs;

/// Names a folder into which the texts are written, for other tools.
const FOLDER: &str = "GSBURN_TEST_SHADERS";

/// The kernels that the cases launch.
pub fn record() -> &'static Record {
    static WRITTEN: Once = Once::new();
    let record = &runs()[0].record;
    if let Some(folder) = std::env::var_os(FOLDER) {
        WRITTEN.call_once(|| write(record, Path::new(&folder)));
    }
    record
}

fn write(record: &Record, folder: &Path) {
    std::fs::create_dir_all(folder).expect("a folder");
    for (number, shader) in record.shaders.iter().enumerate() {
        let path =
            folder.join(format!("{number:03}_{}.wgsl", shader.function().rsplit("::").next().unwrap_or("kernel")));
        std::fs::write(path, &shader.wgsl).expect("a file");
    }
}

/// The functions marked as kernels in a file or below a folder, as paths.
fn written(path: &Path, module: &str, functions: &mut BTreeSet<String>) {
    if path.is_dir() {
        for entry in std::fs::read_dir(path).expect("a folder of the sources") {
            let path = entry.expect("an entry of the sources").path();
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            let inner = if name == "mod" { module.to_string() } else { format!("{module}::{name}") };
            written(&path, &inner, functions);
        }
        return;
    }
    let text = std::fs::read_to_string(path).expect("a source file");
    for kernel in text.split("#[cube(launch").skip(1) {
        let name = kernel.split_once("fn ").expect("a function behind the mark").1;
        let name = name.split(['(', '<']).next().expect("a name");
        functions.insert(format!("{module}::{name}"));
    }
}

#[test]
fn every_kernel_is_launched() {
    let sources = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../gs-kernels/src/cube");
    let mut functions = BTreeSet::new();
    written(&sources, "gs_kernels::cube", &mut functions);
    let launched: BTreeSet<String> = record().shaders.iter().map(|shader| shader.function().to_string()).collect();
    println!("{} kernels, {} shaders", functions.len(), record().shaders.len());
    let missed: Vec<_> = functions.symmetric_difference(&launched).collect();
    assert!(missed.is_empty(), "a case of `cases/` must launch each kernel; these differ: {missed:#?}");
}
