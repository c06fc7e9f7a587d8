//! Fingers, mouse, keys and buttons, by synthetic events (controls.js); key frames tell where the camera is.

use glam::DVec3;
use gs_base::Intrinsics;
use gs_burn::{Camera, render};
use gs_datasets::load_cameras;
use gs_models::{DynamicScene, Shutter};
use gs_train::run::presentation::Presentation;
use gsburn::report::viewer;
use serde_json::Value;

use crate::common::device;
use crate::viewer::browser::{agrees, bytes, decoded, dom, with_script};
use crate::viewer::motion::taylor;
use crate::viewer::{PHOTO, SIZE, options, viewed};

/// Distance of the point that the camera turns about.
const DISTANCE: f64 = 3.0;

/// Where the camera was after an action.
struct State<'a>(&'a Value);

impl State<'_> {
    fn vector(&self, name: &str) -> DVec3 {
        let number = |axis: usize| self.0["frame"][name][axis].as_f64().expect("a number");
        DVec3::new(number(0), number(1), number(2))
    }

    fn eye(&self) -> DVec3 {
        self.vector("position")
    }

    /// The point that the camera turns about.
    fn target(&self) -> DVec3 {
        self.vector("look_at")
    }

    fn ahead(&self) -> DVec3 {
        (self.target() - self.eye()).normalize()
    }

    fn distance(&self) -> f64 {
        self.eye().distance(self.target())
    }

    fn time(&self) -> f64 {
        self.0["frame"]["time"].as_f64().expect("a time")
    }

    fn is_pressed(&self, value: &str) -> bool {
        self.0["pressed"].as_array().expect("a list").iter().any(|pressed| pressed == value)
    }
}

/// Two lengths are the same: a browser keeps the places of fingers, and the steps of its matrices, in single precision.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

fn near(a: DVec3, b: DVec3) -> bool {
    same(a.distance(b), 0.0)
}

#[test]
fn fingers_mouse_and_keys_do_what_the_page_says() {
    let scene = taylor();
    let mut viewed = viewed("controls");
    // Key frames have their principal point in the middle, and one focal length.
    let focal = SIZE[0] as f64;
    viewed.cameras[0].k = [focal, focal, 0.5 * SIZE[0] as f64, 0.5 * SIZE[1] as f64];
    viewed.cameras[0].photo = Some(PHOTO.into());
    let mut second = viewed.cameras[0].clone();
    second.c2w[12] += 0.7;
    viewed.cameras.push(second);
    viewed.distance = Some(DISTANCE);
    let shift = DVec3::new(100.0, -20.0, 3.0);
    let world = glam::DMat4::from_translation(shift);
    let shutter = Some(Shutter { exposure: 0.2, linear: true });
    let packed = viewer::packed(&scene, &Presentation { shutter, world, ..viewed });

    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    std::fs::write(&page, with_script(&viewer::page("controls", &packed), include_str!("controls.js")))
        .expect("written");
    let Some(dom) = dom(&page, "") else { return };
    let json = dom.split_once("<pre class=\"told\">").and_then(|(_, rest)| rest.split_once("</pre>"));
    let told: Value = serde_json::from_str(&json.expect("a story").0.replace("&amp;", "&")).expect("JSON");
    let state = |name: &str| State(&told[name]);

    let begin = state("begin");
    assert!(near(begin.eye(), crate::viewer::pose().w_axis.truncate() + shift) && same(begin.distance(), DISTANCE));
    // The hint on the picture goes with the first key.
    assert_eq!(told["hints"], serde_json::json!([false, true]));
    let side = |axis: usize| SIZE[axis] as f64 / begin.0["shown"][axis].as_f64().expect("pixels");
    let pixel = side(0).max(side(1)) / focal;

    // One finger: about the target, as far as before.
    let orbit = state("orbit");
    let angle = begin.ahead().angle_between(orbit.ahead()).to_degrees();
    assert!(near(orbit.target(), begin.target()) && same(orbit.distance(), DISTANCE));
    assert!(same(angle, 17.0), "{angle} degrees for 50 pixels of 0.34");

    // Two fingers: twice as far apart is half as far away; together they move the scene along.
    let (pinch, pan) = (state("pinch"), state("two fingers"));
    assert!(same(pinch.distance(), 0.5 * DISTANCE) && near(pinch.ahead(), orbit.ahead()));
    let moved = pan.target() - pinch.target();
    assert!(near(pan.ahead(), pinch.ahead()) && same(moved.dot(pan.ahead()), 0.0));
    // Each of the fingers moves the scene by half of its way, the first at 5/4 of the distance.
    let expected = 0.5 * DISTANCE * pixel * (10.0 + 10.0 * 100.0 / 80.0);
    assert!(same(moved.length(), expected), "{} and {expected}", moved.length());
    assert!(same(pan.distance(), pinch.distance()));
    assert!(near(state("released").eye(), pan.eye()));

    // The mouse with Shift or its right button; with Alt; its wheel.
    let (shifted, right) = (state("shift"), state("right button"));
    let by_shift = shifted.eye() - pan.eye();
    let expected = pan.distance() * pixel * 20.0_f64.hypot(10.0);
    assert!(near(by_shift, right.eye() - shifted.eye()) && same(by_shift.length(), expected));
    let (looked, wheel) = (state("alt"), state("wheel"));
    assert!(near(looked.eye(), right.eye()) && looked.ahead().angle_between(right.ahead()) > 0.05);
    assert!(same(wheel.distance() / looked.distance(), 0.1_f64.exp()));

    // Keys: fly while held, home, cameras, photo, modes, pixels, time.
    let (fly, flown) = (state("fly"), state("flown"));
    assert!((fly.eye() - wheel.eye()).normalize().dot(wheel.ahead()) > 1.0 - 1e-6 && near(fly.eye(), flown.eye()));
    assert!(near(state("home").eye(), begin.eye()) && state("home").is_pressed("0"));
    assert!(near(state("2").eye() - begin.eye(), 0.7 * DVec3::X) && state("2").is_pressed("1"));
    let photos =
        ["p", "o", "o again", "wiped"].map(|name| state(name).0["photo"].as_str().expect("a name").to_string());
    assert_eq!(photos, ["wipe", "beside", "off", "wipe"]);
    assert_eq!([&told["p"]["line"], &told["wiped"]["line"]].map(|line| line.as_f64()), [Some(50.0), Some(25.0)]);
    let modes = [("v", "velocity"), ("b", "exposure"), ("b again", "colour"), ("f", "screen")];
    assert!(modes.iter().all(|(key, value)| state(key).is_pressed(value)));
    assert!(told["f"]["width"].as_u64() > told["v"]["width"].as_u64(), "{}", told["f"]["width"]);
    let [first, last] = scene.span().expect("it moves");
    let span = last - first;
    assert!(same(state("ArrowRight").time() - state("f").time(), span / 48.0));
    assert!(same(state("slider").time(), first + 0.25 * span));
    assert!(state("played").time() > state("slider").time() && state("played").time() == state("paused").time());

    // What a key frame says is what `gsburn render --cameras` shows.
    let file = folder.path().join("keyframes.json");
    std::fs::write(&file, told["file"].to_string()).expect("written");
    let pose = load_cameras(&file).expect("key frames").remove(0);
    let c2w = glam::DMat4::from_translation(-shift) * pose.c2w;
    let gs_base::Intrinsics { fx, fy, cx, cy } = pose.intrinsics;
    let camera = Camera::from_c2w(c2w, Intrinsics { fx, fy, cx, cy }, pose.width, pose.height, &device());
    let truth = bytes(render(&scene.at(orbit.time()), &camera, &options()).color);
    let picture = told["picture"].as_str().and_then(|url| url.split_once("base64,")).expect("a picture").1;
    agrees("a key frame", &decoded(picture), &truth);
}
