//! Headless Chromium with software GL.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use burn::tensor::Tensor;
use gs_train::fit::parameters::to_host;

/// Least PSNR against the rasterizer, dB: half of a step of 8 bits everywhere is 54 dB. The page rounds its numbers,
/// and adds half floats.
const LEAST: f64 = 45.0;

/// Chromium one after the other: each takes all cores for its GL.
static BROWSER: Mutex<()> = Mutex::new(());

/// The installed Chromium, which `GSBURN_TEST_BROWSER` requires.
fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    let found = folders.iter().flat_map(|folder| names.map(|name| folder.join(name))).find(|path| path.is_file());
    if found.is_none() {
        let required = std::env::var_os("GSBURN_TEST_BROWSER").is_some();
        assert!(!required, "GSBURN_TEST_BROWSER is set, and there is no Chromium in PATH");
        println!("no Chromium on this machine: the viewer's pictures are not compared");
    }
    found
}

/// The page's elements after its script has run with a fragment.
pub fn dom(page: &Path, fragment: &str) -> Option<String> {
    let chromium = chromium()?;
    let _turn = BROWSER.lock();
    let profile = tempfile::tempdir().expect("a folder");
    let output = Command::new(chromium)
        .args([
            "--headless",
            "--no-sandbox",
            "--use-gl=angle",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
        ])
        .args(["--disable-background-networking", "--disable-component-update", "--no-first-run"])
        .args(["--disable-dev-shm-usage", "--virtual-time-budget=20000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}#{fragment}", page.display()))
        .stderr(Stdio::null())
        .output()
        .expect("Chromium starts");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A page in which a script runs before the viewer's.
pub fn with_script(page: &str, script: &str) -> String {
    page.replacen("<main>", &format!("<main>\n<script>\n{script}</script>\n"), 1)
}

/// The pictures that a page draws, `asked` as in its script; `None` without Chromium.
pub fn pictures(page: &Path, asked: &str) -> Option<Vec<Vec<u8>>> {
    let dom = dom(page, &format!("picture={asked}"))?;
    let parts: Vec<&str> = dom.split("data:image/png;base64,").skip(1).collect();
    assert_eq!(parts.len(), asked.split(',').count(), "{}: {dom:.400}", page.display());
    Some(parts.iter().map(|part| decoded(part.split('<').next().unwrap_or_default())).collect())
}

/// The bytes of a picture in base64.
pub fn decoded(picture: &str) -> Vec<u8> {
    let bytes = STANDARD.decode(picture).expect("base64");
    image::load_from_memory(&bytes).expect("a picture").to_rgb8().into_raw()
}

pub fn bytes(image: Tensor<3>) -> Vec<u8> {
    to_host(image).into_iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect()
}

pub fn agrees(what: &str, picture: &[u8], truth: &[u8]) {
    assert_eq!(picture.len(), truth.len(), "{what}");
    let squares: f64 = picture.iter().zip(truth).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    let psnr = 20.0 * 255.0_f64.log10() - 10.0 * (squares / truth.len() as f64).log10();
    println!("{what}: {psnr:.2} dB");
    assert!(psnr >= LEAST, "{what}: {psnr:.2} dB");
}
