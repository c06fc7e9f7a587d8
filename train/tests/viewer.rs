//! The viewer's page against the rasterizer, in headless Chromium with software GL, and everything of it that needs no browser.
//!
//! Where there is no Chromium, the comparisons say so and pass.

mod common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use gs_burn::{Camera, Extras, Gaussians, Intrinsics, RenderOptions, render, render_with};
use gs_models::basis::MotionBasis;
use gs_models::flux4d::{FluxScene, PolynomialMotion};
use gs_models::light::Mixing;
use gs_models::taylormode::{Contact, Kinks, MotionFrame, RemainderFrame, TaylorScene, TimeWindow};
use gs_models::{DynamicScene, Shutter, Static};
use gs_train::fit::parameters::to_host;
use gs_train::report::viewer::{self, Packed, Viewed};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use common::program::{program, says};
use common::{config, device, finish, job, tiny_scene};

/// Size of the pictures: software GL draws some frames a second of them.
const SIZE: [usize; 2] = [256, 192];

/// Least PSNR against the rasterizer, dB: half of a step of 8 bits everywhere is 54 dB. The page rounds its numbers, and adds half floats.
const LEAST: f64 = 45.0;

/// Chromium one after the other: each takes all cores for its GL.
static BROWSER: Mutex<()> = Mutex::new(());

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn numbers(&mut self, count: usize, [low, high]: [f32; 2]) -> Vec<f32> {
        (0..count).map(|_| self.0.random_range(low..high)).collect()
    }

    fn table(&mut self, rows: usize, columns: usize, range: [f32; 2]) -> Tensor<2> {
        Tensor::from_data(TensorData::new(self.numbers(rows * columns, range), [rows, columns]), &device())
    }
}

/// Overlapping Gaussians of all shapes before the camera of [`pose`].
fn cloud(count: usize, degree: usize, seed: u64) -> Gaussians {
    let mut draw = Draw::new(seed);
    let coefficients = (degree + 1) * (degree + 1);
    let mut sh = draw.numbers(3 * coefficients * count, [-0.3, 0.3]);
    for row in sh.chunks_exact_mut(3 * coefficients) {
        row[..3].iter_mut().for_each(|value| *value *= 5.0);
    }
    let means = draw.table(count, 3, [-1.2, 1.2]);
    let quats = draw.table(count, 4, [-1.0, 1.0]);
    let log_scales = draw.table(count, 3, [-4.0, -1.5]);
    let logits = Tensor::from_data(TensorData::new(draw.numbers(count, [-2.0, 4.0]), [count]), &device());
    let sh = Tensor::from_data(TensorData::new(sh, [count, coefficients, 3]), &device());
    Gaussians::from_tensors(means, quats, log_scales, logits, sh)
}

fn pose() -> glam::DMat4 {
    let turn = glam::DMat4::from_rotation_y(0.2) * glam::DMat4::from_rotation_z(0.1);
    glam::DMat4::from_translation(glam::DVec3::new(-0.5, -0.1, -3.0)) * turn
}

const INTRINSICS: Intrinsics = Intrinsics { fx: 260.0, fy: 255.0, cx: 125.0, cy: 99.0 };

fn camera() -> Camera {
    Camera::from_c2w(pose(), INTRINSICS, SIZE[0], SIZE[1], &device())
}

fn options() -> RenderOptions {
    RenderOptions { background: [0.1, 0.2, 0.3], ..RenderOptions::default() }
}

fn viewed<'a>(scene: &'a dyn DynamicScene, name: &str) -> Viewed<'a> {
    let Intrinsics { fx, fy, cx, cy } = INTRINSICS;
    let camera = viewer::Camera {
        name: name.into(),
        split: "held out".into(),
        time: None,
        c2w: viewer::rows(pose()),
        k: [fx, fy, cx, cy],
        size: SIZE,
        photo: None,
    };
    let (middle, distance) = (0.0, Some(3.0));
    Viewed { name: name.into(), scene, options: options(), middle, cameras: vec![camera], distance, shutter: None }
}

/// The installed Chromium.
fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    let found = folders.iter().flat_map(|folder| names.map(|name| folder.join(name))).find(|path| path.is_file());
    if found.is_none() {
        println!("no Chromium on this machine: the viewer's pictures are not compared");
    }
    found
}

/// The page's elements after its script has run with a fragment.
fn dom(page: &Path, fragment: &str) -> Option<String> {
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

/// The pictures that a page draws, `asked` as in its script; `None` without Chromium.
fn pictures(page: &Path, asked: &str) -> Option<Vec<Vec<u8>>> {
    let dom = dom(page, &format!("picture={asked}"))?;
    let parts: Vec<&str> = dom.split("data:image/png;base64,").skip(1).collect();
    assert_eq!(parts.len(), asked.split(',').count(), "{}: {dom:.400}", page.display());
    let png = |part: &&str| {
        let bytes = STANDARD.decode(part.split('<').next().unwrap_or_default()).expect("base64");
        image::load_from_memory(&bytes).expect("a picture").to_rgb8().into_raw()
    };
    Some(parts.iter().map(png).collect())
}

fn bytes(image: Tensor<3>) -> Vec<u8> {
    to_host(image).into_iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect()
}

fn agrees(what: &str, picture: &[u8], truth: &[u8]) {
    assert_eq!(picture.len(), truth.len(), "{what}");
    let squares: f64 = picture.iter().zip(truth).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    let psnr = 20.0 * 255.0_f64.log10() - 10.0 * (squares / truth.len() as f64).log10();
    println!("{what}: {psnr:.2} dB");
    assert!(psnr >= LEAST, "{what}: {psnr:.2} dB");
}

/// Compares the page of a moving scene at the begin, the middle and the end, and at a time that is no simple share of its span.
fn compare_through_time(what: &str, scene: &dyn DynamicScene) {
    let [first, last] = scene.span().expect("it moves");
    let times = [first, 0.5 * (first + last), last, first + 0.3719 * (last - first)];
    compare_at(what, scene, &viewed(scene, what).packed(), times);
}

/// Compares the page of a scene that moves between the first of some times and the third.
fn compare_at(what: &str, scene: &dyn DynamicScene, packed: &Packed, times: [f64; 4]) {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    std::fs::write(&page, viewer::page(what, packed)).expect("written");
    let Some(drawn) = pictures(&page, &times.map(|t| format!("0@{t}")).join(",")) else { return };
    for (picture, t) in drawn.iter().zip(times) {
        let truth = bytes(render(&scene.at(t), &camera(), &options()).color);
        agrees(&format!("{what} at {t}"), picture, &truth);
    }
    assert_ne!(drawn[0], drawn[2], "{what} moves");
}

#[test]
fn colours_of_every_degree_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    for degree in 0..=3 {
        let scene = Static::new(cloud(300, degree, degree as u64));
        let mut viewed = viewed(&scene, "cloud");
        viewed.options.antialiased = degree == 2;
        let page = folder.path().join("page.html");
        std::fs::write(&page, viewer::page("cloud", &viewed.packed())).expect("written");
        let Some(drawn) = pictures(&page, "0@0") else { return };
        let truth = bytes(render(&scene.gaussians, &camera(), &viewed.options).color);
        agrees(&format!("SH {degree}"), &drawn[0], &truth);
    }
}

/// A Taylor motion with everything that it may have: orders, turns, a remainder, kinks on both sides.
fn taylor() -> TaylorScene {
    let gaussians = cloud(200, 1, 7);
    let mut draw = Draw::new(8);
    let window = TimeWindow { t0: 0.4, half: 0.6 };
    let contacts = [(0.1, 0.15), (0.6, 0.7)].map(|(a, b)| Contact::new(a, b, &window).expect("beside t0"));
    let mut frame = MotionFrame::new((0..120).collect(), 3, 2, window);
    frame.recording = [0.0, 1.0];
    frame.remainder = Some(RemainderFrame { centre: [0.0; 3], scale: 1.0, order: 3 });
    let mut motion = frame.init(1, &device());
    motion.position = Param::from_tensor(draw.table(120, 9, [-0.3, 0.3]));
    motion.rotation = Param::from_tensor(draw.table(120, 6, [-0.8, 0.8]));
    motion.kinks = Some(Kinks::new(contacts.to_vec(), draw.table(120, 6, [-0.8, 0.8])));
    if let Some(remainder) = &mut motion.remainder {
        // Its last layer begins at zero.
        remainder.mlp = gs_models::MlpConfig::new(vec![3, 32, 32, 15]).with_seed(5).init(&device());
    }
    TaylorScene { gaussians, motion }
}

#[test]
fn powers_remainder_and_kinks_agree() {
    let scene = taylor();
    let MotionBasis { functions, turns, .. } = scene.basis().expect("a basis");
    assert_eq!((functions.len(), turns.len()), (3 + 5 + 2, 2));
    compare_through_time("powers, remainder, kinks", &scene);
}

#[test]
fn velocities_and_exposures_agree() {
    let scene = taylor();
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let shutter = Shutter { exposure: 0.2, linear: true };
    let packed = Viewed { shutter: Some(shutter), ..viewed(&scene, "blur") }.packed();
    std::fs::write(&page, viewer::page("blur", &packed)).expect("written");
    let Some(drawn) = pictures(&page, "0@0.3@exposure,0@0.3@velocity") else { return };
    let instants = (0..8).map(|i| 0.3 + ((f64::from(i) + 0.5) / 8.0 - 0.5) * shutter.exposure);
    let light = instants.map(|t| Mixing::Linear.decode(render(&scene.at(t), &camera(), &options()).color));
    let mean = light.reduce(|sum, image| sum + image).expect("instants") / 8.0;
    agrees("exposure", &drawn[0], &bytes(Mixing::Linear.encode(mean)));
    let json: serde_json::Value = serde_json::from_str(&packed.json).expect("JSON");
    let full = json["full_speed"].as_f64().expect("a speed");
    let colors = (scene.velocity(0.3) / full).clamp(-1.0, 1.0) * 0.5;
    let extras = Extras { features: Some(colors), ..Extras::default() };
    let features = render_with(&scene.at(0.3), &camera(), &options(), extras).features.expect("features");
    agrees("velocity", &drawn[1], &bytes(features + 0.5));
}

/// Polynomial motion from own times.
#[test]
fn polynomials_of_own_times_agree() {
    let gaussians = cloud(200, 0, 11);
    let mut draw = Draw::new(12);
    let motion = PolynomialMotion::new(2).expect("a degree");
    let velocity = draw.table(200, motion.columns(), [-0.6, 0.6]);
    let times = draw.numbers(200, [0.0, 1.0]);
    let scene = FluxScene::new(gaussians, velocity, &times, motion, [100.0, 102.0], 0.2).expect("a scene");
    compare_through_time("polynomials", &scene);
}

/// Circles, turns, growth and fading that no basis describes.
#[derive(Debug)]
struct Circles(Gaussians);

impl DynamicScene for Circles {
    fn at(&self, t: f64) -> Gaussians {
        let Gaussians { means, quats, log_scales, opacity_logits, .. } = &self.0;
        let count = self.0.len();
        let moving = |row: usize| if row.is_multiple_of(2) { 1.0 } else { 0.0 };
        let table = |columns: usize, value: &dyn Fn(usize, usize) -> f64| {
            let values: Vec<f32> =
                (0..count * columns).map(|i| (moving(i / columns) * value(i / columns, i % columns)) as f32).collect();
            Tensor::<2>::from_data(TensorData::new(values, [count, columns]), &device())
        };
        let angle = |row: usize| 4.0 * t + row as f64;
        let shift = table(3, &|row, axis| 0.3 * [angle(row).cos(), angle(row).sin(), t * t][axis]);
        let turned = table(4, &|row, axis| (t * (1.0 + axis as f64) + row as f64).sin());
        let grown = table(3, &|_, axis| 0.5 * t * (1.0 + axis as f64));
        let faded: Tensor<1> = table(1, &|_, _| -2.0 * t).squeeze_dim(1);
        Gaussians::from_tensors(
            means.val() + shift,
            quats.val() + turned * 0.4,
            log_scales.val() + grown,
            opacity_logits.val() + faded,
            self.0.sh_coefficients(),
        )
    }

    fn velocity(&self, _t: f64) -> Tensor<2> {
        self.0.means.val().zeros_like()
    }

    fn span(&self) -> Option<[f64; 2]> {
        Some([0.0, 1.3])
    }
}

#[test]
fn key_frames_agree() {
    let scene = Circles(cloud(200, 1, 13));
    let json: serde_json::Value = serde_json::from_str(&viewed(&scene, "circles").packed().json).expect("JSON");
    assert!(json["clock"]["keys"]["count"].as_u64() >= Some(17), "{}", json["clock"]);
    assert_eq!(json["moving"], 100);
    compare_through_time("key frames", &scene);
}

/// Circles that roll on after the last time that was seen, 1.3, up to 2.
#[derive(Debug)]
struct Predicted(Circles);

impl DynamicScene for Predicted {
    fn at(&self, t: f64) -> Gaussians {
        self.0.at(t)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        self.0.velocity(t)
    }

    fn span(&self) -> Option<[f64; 2]> {
        self.0.span()
    }

    fn reach(&self) -> Option<[f64; 2]> {
        Some([0.0, 2.0])
    }
}

#[test]
fn the_future_is_shown_up_to_the_last_photo() {
    let scene = Predicted(Circles(cloud(200, 1, 13)));
    for (time, shown) in [(0.4, 1.3), (1.7, 1.7), (2.5, 2.0)] {
        let mut viewed = viewed(&scene, "future");
        viewed.cameras[0].time = Some(time);
        let packed = viewed.packed();
        let json: serde_json::Value = serde_json::from_str(&packed.json).expect("JSON");
        assert_eq!((&json["span"], &json["seen_to"]), (&serde_json::json!([0.0, shown]), &serde_json::json!(1.3)));
        if time == 1.7 {
            compare_at("future", &scene, &packed, [0.0, 1.3, 1.7, 1.52]);
        }
    }
}

#[test]
fn names_stay_text() {
    let hostile = "</script><img src=x onerror=\"document.title='injected'\">";
    let scene = Static::new(cloud(20, 0, 1));
    let packed = viewed(&scene, hostile).packed();
    assert!(!packed.json.contains('<'));
    let page = viewer::page(hostile, &packed);
    assert!(!page.contains("<img src=x") && !viewer::section(&packed).contains("<img src=x"));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("page.html");
    std::fs::write(&path, page).expect("written");
    let Some(dom) = dom(&path, "picture=0@0") else { return };
    assert!(dom.contains("class=\"picture\"") && !dom.contains("<title>injected"), "{dom:.400}");
}

#[test]
fn many_gaussians_lose_their_harmonics_and_the_page_says_so() {
    let scene = Static::new(cloud(viewer::WITH_SH_MAX + 1, 1, 2));
    let Packed { json, .. } = viewed(&scene, "many").packed();
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((json["degree"].as_u64(), json["trained_degree"].as_u64()), (Some(0), Some(1)));
    assert!(json["notes"][0].as_str().is_some_and(|note| note.contains("300000")), "{}", json["notes"]);
}

#[test]
fn a_ply_alone_has_a_page() {
    let folder = tempfile::tempdir().expect("a folder");
    gs_burn::ply::write_ply(folder.path().join("scene.ply"), &cloud(50, 1, 3)).expect("written");
    says(folder.path(), &["view", "scene.ply"]);
    let page = std::fs::read_to_string(folder.path().join("scene.html")).expect("a page");
    assert!(page.contains("Content-Security-Policy") && !page.contains("src=\"http"));
    // Written over, since it is ours; another file is not.
    says(folder.path(), &["view", "scene.ply", "--out", "scene.html"]);
    std::fs::write(folder.path().join("mine.html"), "mine").expect("written");
    let refused = common::program::fails(folder.path(), &["view", "scene.ply", "--out", "mine.html"]);
    assert!(refused.contains("mine.html"), "{refused}");
}

/// Ends the process when the test ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_run_has_a_viewer_in_its_report_and_can_be_watched() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    finish(&job(&tiny_scene(folder.path()), &run, &config(4, &[])));
    let report = std::fs::read_to_string(run.join("report.html")).expect("a report");
    assert!(report.contains("id=\"viewer-block\"") && report.contains("data:image/jpeg"));
    says(folder.path(), &["view", "run"]);
    assert!(run.join("view.html").is_file());

    let mut child =
        Running(program(folder.path()).args(["watch", "run"]).stdout(Stdio::piped()).spawn().expect("starts"));
    let mut line = String::new();
    BufReader::new(child.0.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
    let address = line.split(['/', ' ']).find(|part| part.starts_with("127.0.0.1:")).expect("an address").to_string();
    let ask = |request: String| {
        let mut stream = TcpStream::connect(&address).expect("connected");
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    };
    let get = |name: &str, host: &str| ask(format!("GET {name} HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    assert!(get("/", &address).contains("data-place=\"live\""));
    let state = get("/state.json", &address);
    assert!(state.starts_with("HTTP/1.1 200") && state.contains("\"version\":4"), "{state}");
    let scene = get("/scene.json", &address);
    let body = scene.split_once("\r\n\r\n").expect("a body").1;
    let json: serde_json::Value = serde_json::from_str(body).expect("JSON");
    assert!(json["scene"]["count"].as_u64() > Some(0) && json["block"].is_string());
    assert!(get("/../config.toml", &address).starts_with("HTTP/1.1 404"));
    assert!(get("/", "evil.example").starts_with("HTTP/1.1 403"));
    assert!(ask(format!("POST / HTTP/1.1\r\nHost: {address}\r\n\r\n")).starts_with("HTTP/1.1 405"));
}
