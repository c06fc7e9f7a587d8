//! The flow of sweeps, and how far they show what moves.

use std::fs;
use std::path::Path;

use gs_worlds::driving::write;

use crate::common;
use crate::common::program::{fails, says, succeeds};
use crate::common::streets::{job, small_street, streets};

/// Before any training the sweeps alone show most of the motion, and nothing that rests moves: the bounds are half of
/// what no motion at all is off by, and the speed at rest that is asked of the method.
#[test]
fn the_sweeps_show_what_moves() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    // A rate of almost nothing: the measurement is of the start. All points: a merged point beside a car lends its
    // motion to what it was merged over.
    let still = ["learning.rate=1e-9", "learning.last_rate=1e-9", "lift.points=0"];
    let measured = |name: &str, velocity: &str| {
        let job = job(&data, &temporary.path().join(name), 1, &[&still[..], &[velocity]].concat());
        let eval = common::finish(&job);
        let of = |key: &str| eval.last.figure(key).expect("the street has labels");
        [of("epe_moving"), of("speed_at_rest")]
    };
    let [zero, _] = measured("zero", "lift.velocity=zero");
    let [aligned, resting] = measured("aligned", "lift.velocity=aligned");
    assert!(aligned < 0.5 * zero, "{aligned} m of {zero} m");
    assert!(resting < 0.05, "{resting} m/s at rest");
}

/// `gsburn flow` needs no image: an array for every sweep, figures where there are labels, and the same by a fit of
/// every pair.
#[test]
fn the_flow_of_sweeps_is_written_and_scored() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let log = streets(folder, 1).join("000");
    fs::remove_dir_all(log.join("camera/front_camera")).expect("a folder");
    let text = succeeds(folder, &["flow", "streets/000", "--out", "flow", "--window", "4"]);
    assert!(text.contains("11 sweeps") && text.contains("EPE3D, moving"), "{text}");
    let arrays = fs::read_dir(folder.join("flow")).expect("a folder").flatten();
    let sizes: Vec<u64> = arrays
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "npy"))
        .map(|entry| entry.metadata().expect("a file").len())
        .collect();
    // A header of 128 bytes at most (NumPy's alignment), then three floats a point.
    assert_eq!(sizes.len(), 11);
    assert!(sizes.iter().all(|size| size % 4 == 0 && *size > 12 * 100), "{sizes:?}");
    let figures = fs::read_to_string(folder.join("flow/flow.json")).expect("written");
    let figures: serde_json::Value = serde_json::from_str(&figures).expect("JSON");
    assert_eq!(figures["sweeps"], 11);
    // Again into the folder of an earlier flow, and not into another.
    succeeds(folder, &["flow", "streets/000", "--out", "flow"]);
    fs::create_dir(folder.join("mine")).expect("made");
    fs::write(folder.join("mine/00.npy"), "mine").expect("written");
    assert!(fails(folder, &["flow", "streets/000", "--out", "mine"]).contains("expected an empty folder"));
    assert_eq!(fs::read_to_string(folder.join("mine/00.npy")).expect("text"), "mine");
    // Of another log, which is shorter: nothing of the first is left.
    let other = folder.join("other");
    write(&other, &small_street(4, 7), |_, _| {}).expect("written");
    succeeds(folder, &["flow", "other", "--out", "flow"]);
    assert_eq!(arrays_in(&folder.join("flow")), ["00.npy", "01.npy", "02.npy", "03.npy"]);
    let fitted = succeeds(folder, &["flow", "streets/000", "--window", "2", "--fit", "2"]);
    assert!(fitted.contains("a fit of each pair") && fitted.contains("EPE3D, moving"), "{fitted}");
    let refused = fails(folder, &["flow", "streets/000", "--protocol", "av2"]);
    assert!(refused.contains("a log of Argoverse 2 with its map"), "{refused}");
    fs::remove_dir_all(&log).expect("a folder");
    assert!(fails(folder, &["flow", "streets/000"]).contains("streets/000"));
}

/// A log of Argoverse 2 whose 200 points lie from 8 to 28 m ahead: by its map the first 80 are ground, by all labels
/// none is, and the last sweep has no next one.
#[test]
fn the_protocol_of_argoverse_leaves_ground_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let log = folder.join("log");
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/driving/tests/fixtures/argoverse");
    let sweep = |stamp: &str| format!("sensors/lidar/{stamp}.feather");
    let tables =
        ["annotations", "city_SE3_egovehicle", "calibration/egovehicle_SE3_sensor"].map(|t| format!("{t}.feather"));
    for file in tables.into_iter().chain(["315966265259836000", "315966265359836000"].map(sweep)) {
        fs::create_dir_all(log.join(&file).parent().expect("a folder")).expect("made");
        fs::copy(fixture.join(&file), log.join(&file)).expect("copied");
    }
    let map = log.join("map");
    fs::create_dir(&map).expect("made");
    let row: [f32; 40] = std::array::from_fn(|x| if x < 16 { 61.3 } else { 55.0 });
    gs_base::npy::write_npy(&map.join("0_ground_height_surface____PIT.npy"), &[row; 8]).expect("written");
    let place = r#"{"R": [1.0, 0.0, 0.0, 1.0], "t": [-5000.0, 3004.0], "s": 1.0}"#;
    fs::write(map.join("0___img_Sim2_city.json"), place).expect("written");
    let scored = |arguments: &[&str]| {
        let text = succeeds(folder, &[&["flow", "log"], arguments].concat());
        let counts = text.lines().filter_map(|line| line.rsplit_once('|')?.1.trim().split_once(" / "));
        let points = |(rest, moving): (&str, &str)| Some(rest.parse::<usize>().ok()? + moving.parse::<usize>().ok()?);
        counts.filter_map(points).sum::<usize>()
    };
    // The box's 42 points of the last sweep have no flow, and 47 of the first sweep's move or rest with it.
    assert!(scored(&[]) > 300);
    assert_eq!(scored(&["--protocol", "av2"]), 120);
}

fn arrays_in(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.ends_with(".npy"));
    names.sort();
    names
}

/// A clock that jumps by 20 s is a gap, on both sides of which motion is looked for; a first time of 0 leaves one sweep
/// without another.
#[test]
fn the_flow_of_a_log_with_a_gap_stays_on_its_sides() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let log = streets(folder, 1).join("000");
    let path = log.join("lidar/timestamps.json");
    let times: Vec<f64> = serde_json::from_str(&fs::read_to_string(&path).expect("read")).expect("seconds");
    let jumping: Vec<f64> = (0..11).map(|i| times[i] + if i >= 6 { 20.0 } else { 0.0 }).collect();
    let alone: Vec<f64> = (0..11).map(|i| if i == 0 { 0.0 } else { times[i] }).collect();
    for (times, sweeps, said) in [
        (jumping, 11, "1 gap (20.1 s after frame 05), over which no motion is looked for"),
        (alone, 10, "1 sweep has no other without a gap before or after and is left out"),
    ] {
        fs::write(&path, serde_json::to_string(&times).expect("JSON")).expect("written");
        for fit in [&[][..], &["--fit", "2"]] {
            let [text, warned] = says(folder, &[&["flow", "streets/000"], fit].concat());
            assert!(text.contains(&format!("{sweeps} sweeps")), "{text}");
            assert!(warned.contains(said), "{warned}");
        }
    }
}
