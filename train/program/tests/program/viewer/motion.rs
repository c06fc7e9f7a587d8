//! Every kind of motion that a scene may have, at the begin, the middle and the end.

use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use gs_burn::{Extras, Gaussians, render, render_with};
use gs_models::basis::MotionBasis;
use gs_models::flux4d::{FluxScene, PolynomialMotion};
use gs_models::light::Mixing;
use gs_models::taylormode::{Contact, Kinks, MotionFrame, RemainderFrame, TaylorScene, TimeWindow};
use gs_models::{DynamicScene, Shutter};
use gs_train::run::presentation::Presentation;
use gsburn::report::viewer::{self, Packed};

use crate::common::device;
use crate::viewer::browser::{agrees, bytes, pictures};
use crate::viewer::{Draw, bytes_of, camera, cloud, options, viewed};

/// Compares the page of a moving scene at the begin, the middle and the end, and at a time that is no simple share of
/// its span.
fn compare_through_time(what: &str, scene: &dyn DynamicScene) {
    let [first, last] = scene.span().expect("it moves");
    let times = [first, 0.5 * (first + last), last, first + 0.3719 * (last - first)];
    compare_at(what, scene, &viewer::packed(scene, &viewed(what)), times);
}

/// Compares the page of a scene that moves between the first of some times and the third.
fn compare_at(what: &str, scene: &dyn DynamicScene, packed: &Packed, times: [f64; 4]) {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    std::fs::write(&page, viewer::page(what, packed)).expect("written");
    let Some(drawn) = pictures(&page, &times.map(|t| format!("0@{t}")).join(",")) else { return };
    for (picture, t) in drawn.iter().zip(times) {
        agrees(&format!("{what} at {t}"), picture, &bytes_of(scene, t));
    }
    assert_ne!(drawn[0], drawn[2], "{what} moves");
}

/// A Taylor motion with everything that it may have: orders, turns, a remainder, kinks on both sides.
pub fn taylor() -> TaylorScene {
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

/// The picture of an exposure about a time, by the light of eight instants.
pub fn exposed(scene: &dyn DynamicScene, time: f64, shutter: Shutter) -> Vec<u8> {
    let instants = (0..8).map(|i| time + ((f64::from(i) + 0.5) / 8.0 - 0.5) * shutter.exposure);
    let light = instants.map(|t| Mixing::Linear.decode(render(&scene.at(t), &camera(), &options()).color));
    let mean = light.reduce(|sum, image| sum + image).expect("instants") / 8.0;
    bytes(Mixing::Linear.encode(mean))
}

#[test]
fn velocities_and_exposures_agree() {
    let scene = taylor();
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let shutter = Shutter { exposure: 0.2, linear: true };
    let packed = viewer::packed(&scene, &Presentation { shutter: Some(shutter), ..viewed("blur") });
    std::fs::write(&page, viewer::page("blur", &packed)).expect("written");
    let Some(drawn) = pictures(&page, "0@0.3@exposure,0@0.3@velocity") else { return };
    agrees("exposure", &drawn[0], &exposed(&scene, 0.3, shutter));
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
            self.0.sh.val(),
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
    let json: serde_json::Value = serde_json::from_str(&viewer::packed(&scene, &viewed("circles")).json).expect("JSON");
    assert!(json["clock"]["knots"].as_u64() >= Some(17), "{}", json["clock"]);
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
    for (time, shown) in [(0.4, [0.0, 1.3]), (1.7, [0.0, 1.7]), (2.5, [0.0, 2.0]), (-0.3, [0.0, 1.3])] {
        let packed = seen_at(&scene, time, shown, [0.0, 1.3]);
        if time == 1.7 {
            compare_at("future", &scene, &packed, [0.0, 1.3, 1.7, 1.52]);
        }
    }
}

/// A motion without bounds is shown at every time at which there is a photo, so that a photo is held against the state
/// of its own time.
#[test]
fn photos_before_and_after_the_recording_are_reached() {
    let scene = taylor();
    let seen = scene.span().expect("it moves");
    seen_at(&scene, -0.4, [-0.4, seen[1]], seen);
    let packed = seen_at(&scene, 1.6, [seen[0], 1.6], seen);
    compare_at("past the recording", &scene, &packed, [seen[1], 1.2, 1.6, 1.37]);
}

/// The page of a scene with a photo at a time, whose slider goes over the times `shown`.
fn seen_at(scene: &dyn DynamicScene, time: f64, shown: [f64; 2], seen: [f64; 2]) -> Packed {
    let mut viewed = viewed("future");
    viewed.cameras[0].time = Some(time);
    let packed = viewer::packed(scene, &viewed);
    let json: serde_json::Value = serde_json::from_str(&packed.json).expect("JSON");
    assert_eq!([&json["span"], &json["seen"]], [&serde_json::json!(shown), &serde_json::json!(seen)]);
    packed
}
