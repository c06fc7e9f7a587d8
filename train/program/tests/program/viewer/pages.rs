//! Pages as commands write and serve them.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use gs_models::Static;
use gs_train::run::exchange::host::splats_of;
use gsburn::report::viewer::{self, Packed};
use serde_json::Value;

use crate::common::program::{fails, program, says};
use crate::common::{config, finish, job, tiny_scene};
use crate::viewer::browser::dom;
use crate::viewer::{cloud, viewed};

#[test]
fn names_stay_text() {
    let hostile = "</script><img src=x onerror=\"document.title='injected'\">";
    let scene = Static::new(cloud(20, 0, 1));
    let packed = viewer::packed(&scene, &viewed(hostile));
    assert!(!packed.json.contains('<'));
    let page = viewer::page(hostile, &packed);
    assert!(
        page.contains("<h1><bdi>&lt;")
            && !page.contains("<img src=x")
            && !viewer::section(&packed).contains("<img src=x")
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("page.html");
    std::fs::write(&path, page).expect("written");
    let Some(dom) = dom(&path, "picture=0@0") else { return };
    assert!(dom.contains("class=\"picture\"") && !dom.contains("<title>injected"), "{dom:.400}");
}

/// A picture of a few pixels is magnified four times at most, and one of photo size as the page is wide.
#[test]
fn a_small_picture_stays_small() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = Static::new(cloud(20, 0, 1));
    for (size, shown) in [([32, 24], "max-width: 128px"), ([1600, 1200], "max-width: 6400px")] {
        let mut viewed = viewed("small");
        let factor = size[0] as f64 / viewed.cameras[0].size[0] as f64;
        viewed.cameras[0].size = size;
        viewed.cameras[0].k.iter_mut().for_each(|pixels| *pixels *= factor);
        let path = folder.path().join("page.html");
        std::fs::write(&path, viewer::page("small", &viewer::packed(&scene, &viewed))).expect("written");
        let Some(dom) = dom(&path, "picture=0@0") else { return };
        let stage = dom.split("class=\"stage\"").nth(1).and_then(|rest| rest.split('>').next()).expect("a stage");
        assert!(stage.contains(shown), "{stage}");
        assert_eq!(stage.contains("data-small"), size[0] == 32, "{stage}");
    }
}

#[test]
fn many_gaussians_lose_their_harmonics_and_the_page_says_so() {
    let scene = Static::new(cloud(viewer::WITH_SH_MAX + 1, 1, 2));
    let Packed { json, .. } = viewer::packed(&scene, &viewed("many"));
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((json["degree"].as_u64(), json["trained_degree"].as_u64()), (Some(0), Some(1)));
    assert!(json["notes"][0].as_str().is_some_and(|note| note.contains("300000")), "{}", json["notes"]);
}

#[test]
fn a_ply_alone_has_a_page() {
    let folder = tempfile::tempdir().expect("a folder");
    gs_splats::ply::write(&folder.path().join("scene.ply"), &splats_of(&cloud(50, 1, 3), None)).expect("written");
    says(folder.path(), &["view", "scene.ply"]);
    let page = std::fs::read_to_string(folder.path().join("scene.html")).expect("a page");
    assert!(page.contains("Content-Security-Policy") && !page.contains("src=\"http"));
    // Written over, since it is ours; another file is not.
    says(folder.path(), &["view", "scene.ply", "--out", "scene.html"]);
    std::fs::write(folder.path().join("mine.html"), "mine").expect("written");
    let refused = fails(folder.path(), &["view", "scene.ply", "--out", "mine.html"]);
    assert!(refused.contains("mine.html"), "{refused}");
}

/// `gsburn watch` of a run; the process ends with the test.
struct Watched {
    child: Child,
    address: String,
}

impl Watched {
    fn begin(folder: &Path, run: &str) -> Self {
        let mut child = program(folder).args(["watch", run]).stdout(Stdio::piped()).spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.split(['/', ' ']).find(|part| part.starts_with("127.0.0.1:")).expect("an address").into();
        Self { child, address }
    }

    fn ask(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).expect("connected");
        stream.write_all(request.as_bytes()).expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    }

    fn json(&self, name: &str) -> Value {
        let answer = self.ask(&format!("GET {name} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address));
        serde_json::from_str(answer.split_once("\r\n\r\n").expect("a body").1).expect("JSON")
    }

    /// The state, once its sentence contains `text`.
    fn told(&self, text: &str) -> Value {
        for _ in 0..LOOKS {
            let state = self.json("/state.json");
            if state["text"].as_str().is_some_and(|sentence| sentence.contains(text)) {
                return state;
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        panic!("{text} is never told: {}", self.json("/state.json")["text"]);
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Most looks at a state that is awaited, a fifth of a second apart: it changes within two seconds, and a busy machine
/// is slower.
const LOOKS: usize = 600;

/// A damaged checkpoint, another run in the same folder, another data set, no folder.
#[test]
fn a_watched_folder_is_shown_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let [run, other] = ["run", "other"].map(|name| folder.path().join(name));
    let scene = tiny_scene(folder.path());
    finish(&job(&scene, &run, &config(4, &[])));
    let moved = folder.path().join("moved");
    std::fs::rename(&scene, &moved).expect("moved");
    finish(&job(&moved, &other, &config(6, &[])));
    std::fs::rename(&moved, &scene).expect("moved back");
    let watched = Watched::begin(folder.path(), "run");
    let first = watched.told("scene is that of step 4");
    assert!(first["charts"].is_array() && watched.json("/scene.json")["version"] == first["version"]);

    // A newest checkpoint that is damaged: the older one is shown still.
    let damaged = run.join("checkpoints/step-0000099.safetensors");
    std::fs::write(&damaged, [7; 5000]).expect("written");
    let state = watched.told("checkpoint of step 99 cannot be read");
    assert_eq!(state["version"], first["version"]);
    std::fs::remove_file(&damaged).expect("removed");

    // The same steps with another seed: another scene.
    std::fs::remove_dir_all(&run).expect("removed");
    let gone = watched.told("the run is gone");
    assert!(gone["version"].is_null(), "{gone}");
    finish(&job(&scene, &run, &config(4, &["seed=7"])));
    let second = watched.told("scene is that of step 4");
    assert_ne!(second["version"], first["version"]);
    let shown = watched.json("/scene.json");
    assert_eq!(shown["version"], second["version"]);
    assert!(shown["scene"]["cameras"][0]["photo"].is_string());

    // A run of a data set that is not there any more has no cameras of the run before it.
    std::fs::remove_dir_all(&run).expect("removed");
    std::fs::rename(&other, &run).expect("moved");
    watched.told("scene is that of step 6");
    assert!(watched.json("/scene.json")["scene"]["cameras"][0]["photo"].is_null());
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

    let watched = Watched::begin(folder.path(), "run");
    let address = watched.address.clone();
    let ask = |request: String| watched.ask(&request);
    let get = |name: &str, host: &str| ask(format!("GET {name} HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    assert!(get("/", &address).contains("data-place=\"live\""));
    let state = get("/state.json", &address);
    assert!(state.starts_with("HTTP/1.1 200") && state.contains("\"version\":\"4-"), "{state:.400}");
    let scene = get("/scene.json", &address);
    let body = scene.split_once("\r\n\r\n").expect("a body").1;
    let json: serde_json::Value = serde_json::from_str(body).expect("JSON");
    assert!(json["scene"]["count"].as_u64() > Some(0) && json["block"].is_string());
    assert!(get("/../config.toml", &address).starts_with("HTTP/1.1 404"));
    assert!(get("/", "evil.example").starts_with("HTTP/1.1 403"));
    assert!(ask(format!("POST / HTTP/1.1\r\nHost: {address}\r\n\r\n")).starts_with("HTTP/1.1 405"));
}
