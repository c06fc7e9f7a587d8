//! Pages as commands write and serve them.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};

use gs_models::Static;
use gs_train::report::viewer::{self, Packed};

use crate::browser::dom;
use crate::common::program::{fails, program, says};
use crate::common::{config, finish, job, tiny_scene};
use crate::{cloud, viewed};

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
    let refused = fails(folder.path(), &["view", "scene.ply", "--out", "mine.html"]);
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
