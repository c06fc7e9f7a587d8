//! Cameras: the frames that one physical camera took, whether it is static, and whether training and held-out frames
//! agree on it.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DMat4, DVec3};
use gs_base::{agree, mean, median};

use crate::findings::Findings;
use crate::lens::{Focal, Lens};
use crate::projection::Projection;
use crate::raw::{RawFrame, SplitName};
use crate::subject::{STRAY, strays, subject};

/// Rotations closer than this are the same, radians: half a pixel at a focal length of 500.
const SAME_ANGLE: f64 = 1e-3;

/// Camera centres closer than this share of the cameras' spread are the same.
const SAME_POSITION: f64 = 1e-3;

/// Lenses whose focal lengths and principal points differ by less than this share of the image are the same: 1 pixel of
/// 1000, what calibrating the same camera twice may give.
const SAME_LENS: f64 = 1e-3;

/// A held-out camera this many times farther from (or nearer to) the subject of the training cameras is in other units.
const FAR_RATIO: f64 = 3.0;

/// Gives frames a camera by their pose where the data set names none: frames of equal pose and different times are one
/// camera's. In a set where no pose returns (a moving camera), nothing is named.
pub(super) fn name_by_pose(frames: &mut [RawFrame], findings: &mut Findings) {
    if frames.iter().any(|frame| frame.camera_id.is_some()) || frames.iter().all(|frame| frame.time.is_none()) {
        return;
    }
    let spread = spread(frames);
    // The first frame of each group, and how many times differ from its own.
    let mut groups: Vec<(usize, usize)> = Vec::new();
    let mut group_of = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let known = groups.iter().position(|(first, _)| same_pose(&frames[*first], frame, spread));
        let group = known.unwrap_or(groups.len());
        match groups.get_mut(group) {
            Some((first, others)) => *others += usize::from(frames[*first].time != frame.time),
            None => groups.push((i, 0)),
        }
        // Many groups mean a moving camera; comparing on would take the square of the frames.
        if groups.len() > GROUPS_MAX {
            return;
        }
        group_of.push(group);
    }
    if groups.iter().filter(|(_, others)| *others > 0).count() * 2 < groups.len() {
        return;
    }
    for (frame, group) in frames.iter_mut().zip(group_of) {
        frame.camera_id = Some(format!("pose{group:02}"));
    }
    findings.fact(format!(
        "No camera is named; {} {} told apart by their poses.",
        groups.len(),
        agree(groups.len(), "was", "were")
    ));
}

/// More camera poses than any rig has.
const GROUPS_MAX: usize = 1000;

/// Whether two frames have one pose, up to [`SAME_POSITION`] of `spread` and [`SAME_ANGLE`].
pub(super) fn same_pose(a: &RawFrame, b: &RawFrame, spread: f64) -> bool {
    let (position_a, position_b) = (a.c2w.w_axis.truncate(), b.c2w.w_axis.truncate());
    let rounding = 1e-9 * position_a.length().max(1.0);
    position_a.distance(position_b) <= (SAME_POSITION * spread).max(rounding) && angle(a, b) <= SAME_ANGLE
}

/// The angle between two cameras' orientations, radians.
fn angle(a: &RawFrame, b: &RawFrame) -> f64 {
    // |Ra - Rb| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm: exact for small angles, where the trace is not.
    let difference = DMat3::from_mat4(a.c2w) - DMat3::from_mat4(b.c2w);
    let norm = difference.to_cols_array().iter().map(|value| value * value).sum::<f64>().sqrt();
    2.0 * (norm / 8.0_f64.sqrt()).min(1.0).asin()
}

/// The median distance of camera centres from their mean; 0 for one camera.
pub(super) fn spread(frames: &[RawFrame]) -> f64 {
    let centres: Vec<DVec3> = frames.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    let middle = mean(&centres).unwrap_or_default();
    median(centres.iter().map(|centre| centre.distance(middle)).collect()).unwrap_or(0.0)
}

/// The number of cameras with several times, and how many of them are static; `None` without such cameras.
pub(crate) fn static_cameras(frames: &[RawFrame]) -> Option<(usize, usize)> {
    let spread = spread(frames);
    let cameras = by_camera(frames);
    let several: Vec<_> = cameras.values().filter(|group| group.iter().any(|f| f.time != group[0].time)).collect();
    let still = several.iter().filter(|group| group.iter().all(|frame| same_pose(group[0], frame, spread))).count();
    (!several.is_empty()).then_some((several.len(), still))
}

/// Frames with a time by camera; no group is empty.
fn by_camera(frames: &[RawFrame]) -> BTreeMap<&str, Vec<&RawFrame>> {
    let mut cameras: BTreeMap<&str, Vec<&RawFrame>> = BTreeMap::new();
    for frame in frames.iter().filter(|frame| frame.time.is_some()) {
        if let Some(camera) = &frame.camera_id {
            cameras.entry(camera).or_default().push(frame);
        }
    }
    cameras
}

/// Warns about training cameras far from all others: one wrong pose would make the rig huge.
pub(super) fn find_strays(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    let frames = frames.iter().filter(|frame| SplitName::trains(frame.split.as_ref()));
    let (names, positions): (Vec<&str>, Vec<DVec3>) =
        frames.map(|frame| (frame.name.as_str(), frame.c2w.w_axis.truncate())).unzip();
    let strays: Vec<&str> =
        names.into_iter().zip(strays(&positions)).filter(|(_, stray)| *stray).map(|(name, _)| name).collect();
    findings.warn_of(scene, &strays, ["camera", "stands", "stand"], |stand, names| {
        format!(
            "{stand} more than {STRAY} times as far out as three quarters of all do ({names}); are their poses right? \
             The scene's extent, by which rates and thresholds go, is that of the others"
        )
    });
}

/// Whether two frames are the same in one respect.
type Same<'a> = &'a dyn Fn(&RawFrame, &RawFrame) -> bool;

/// Warns about cameras that move, and about train and test sets that disagree.
pub(super) fn compare(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    let spread = spread(frames);
    let (mut moved, mut disagree, mut zoomed) = (Vec::new(), Vec::new(), Vec::new());
    for (camera, group) in by_camera(frames) {
        let (train, test): (Vec<&RawFrame>, Vec<&RawFrame>) =
            group.into_iter().partition(|frame| SplitName::trains(frame.split.as_ref()));
        let pose = |a: &RawFrame, b: &RawFrame| same_pose(a, b, spread);
        let lens = |a: &RawFrame, b: &RawFrame| same_lens(&a.lens, &b.lens);
        let looks: [(Same, _); 2] = [(&pose, &mut moved), (&lens, &mut zoomed)];
        for (same, changed) in looks {
            let is_one = |group: &[&RawFrame]| group.iter().all(|frame| same(group[0], frame));
            if !is_one(&train) || !is_one(&test) {
                changed.push(camera);
            } else if train.first().zip(test.first()).is_some_and(|(a, b)| !same(a, b)) {
                disagree.push(camera);
            }
        }
    }
    disagree.dedup();
    let change = ["camera", "changes its", "change their"];
    findings.warn_of(scene, &moved, change, |change, names| {
        format!(
            "{change} pose over time ({names}); blur from their own motion is not modelled, and what moves cannot be \
             told from their photos alone"
        )
    });
    findings.warn_of(scene, &zoomed, change, |change, names| format!("{change} intrinsics over time ({names})"));
    findings.warn_of(scene, &disagree, ["camera", "has", "have"], |have, names| {
        format!(
            "{have} another pose or other intrinsics in the test set than in the training set ({names}); figures on \
             them will be low"
        )
    });
    compare_sets(frames, scene, findings);
}

/// Differences between the training and the test set as wholes.
fn compare_sets(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    let (train, test): (Vec<&RawFrame>, Vec<&RawFrame>) =
        frames.iter().partition(|frame| SplitName::trains(frame.split.as_ref()));
    let (Some(first_train), Some(first_test)) = (train.first(), test.first()) else { return };
    let uniform = |set: &[&RawFrame]| set.iter().all(|frame| same_lens(&set[0].lens, &frame.lens));
    let shared_id = test.iter().any(|frame| frame.camera_id.is_some() && frame.camera_id == first_train.camera_id);
    if !shared_id && uniform(&train) && uniform(&test) && !same_lens(&first_train.lens, &first_test.lens) {
        findings.warn(format!(
            "{}: all training cameras share one set of intrinsics and all test cameras another (focal lengths of {} \
             and {}); is one of the files wrong?",
            scene.display(),
            focal_length(&first_train.lens),
            focal_length(&first_test.lens)
        ));
    }
    // A photo that shows what is behind its camera, too, may be turned anywhere.
    let is_wide = frames.iter().any(|frame| frame.lens.projection != Projection::Pinhole);
    let poses: Vec<DMat4> = train.iter().map(|frame| frame.c2w).collect();
    if let Some(target) = subject(&poses).filter(|_| !is_wide) {
        let distance = |frame: &RawFrame| frame.c2w.w_axis.truncate().distance(target);
        let mut distances: Vec<f64> = train.iter().map(|frame| distance(frame)).collect();
        distances.sort_by(f64::total_cmp);
        let usual = distances[distances.len() / 2];
        let strange = |frame: &&RawFrame| {
            let depth = (target - frame.c2w.w_axis.truncate()).dot(frame.c2w.z_axis.truncate());
            let ratio = distance(frame) / usual;
            depth <= 0.0 || !(1.0 / FAR_RATIO..=FAR_RATIO).contains(&ratio)
        };
        let names: Vec<&str> = test.iter().copied().filter(strange).map(|frame| frame.name.as_str()).collect();
        let stand = agree(names.len(), "stands", "stand");
        findings.warn_of(scene, &names, ["held-out view", "turns its", "turn their"], |turn, names| {
            format!(
                "{turn} back on what all training cameras look at, or {stand} more than {FAR_RATIO} times nearer or \
                 farther ({names}); do both sets use one world and one convention?"
            )
        });
    }
}

/// Focal lengths and principal point as shares of the image's sides; `None` where that takes the image's own size.
fn shares(lens: &Lens) -> [Option<f64>; 4] {
    let focal = |focal: Option<Focal>, side: Option<f64>| match focal? {
        Focal::Pixels(pixels) => side.map(|side| pixels / side),
        Focal::Angle(angle) => Some(0.5 / (0.5 * angle).tan()),
    };
    let centre = |centre: Option<f64>, side: Option<f64>| match centre {
        Some(centre) => side.map(|side| centre / side),
        None => Some(0.5),
    };
    [
        focal(lens.focal_x, lens.width),
        focal(lens.focal_y, lens.height),
        centre(lens.cx, lens.width),
        centre(lens.cy, lens.height),
    ]
}

/// Whether two lenses agree in all values that both files give.
fn same_lens(a: &Lens, b: &Lens) -> bool {
    let shares = shares(a).into_iter().zip(shares(b));
    let close = shares.into_iter().all(|pair| match pair {
        (Some(a), Some(b)) => (a - b).abs() <= SAME_LENS,
        _ => true,
    });
    let same_pixels = match (a.focal_x, b.focal_x) {
        (Some(Focal::Pixels(x)), Some(Focal::Pixels(y))) if a.width.is_none() && b.width.is_none() => {
            (x - y).abs() <= SAME_LENS * x
        }
        _ => true,
    };
    close && same_pixels
}

/// For messages: the focal length in widths of the image, or in pixels where the file gives no width.
fn focal_length(lens: &Lens) -> String {
    match (shares(lens)[0], lens.focal_x.or(lens.focal_y)) {
        (Some(share), _) => format!("{share:.4} image widths"),
        (None, Some(Focal::Pixels(pixels))) => format!("{pixels} pixels"),
        _ => "unknown".to_string(),
    }
}
