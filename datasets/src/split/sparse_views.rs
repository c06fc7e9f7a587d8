//! Few training cameras, and a past that is seen and a future that is not: the protocols of sparse-view physics.
//!
//! Training cameras stand on one part of the rig, so that some of the others look from between them and some from
//! outside. The choice depends on the cameras' names and poses alone.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DMat4, DVec3};
use gs_base::{agree, counted};

use crate::error::DatasetError;
use crate::options::SparseViews;
use crate::raw::{RawFrame, SplitName};
use crate::scene::Split;

use super::SplitPlan;

/// How a held-out camera looks at a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewKind {
    /// From between training cameras.
    Interpolating,
    /// From outside of them.
    Extrapolating,
}

/// Share of the cameras, nearest to the first by name, among which training cameras are chosen: the others look from
/// outside.
const PART: f64 = 0.6;

/// How a camera looks at a scene that others were trained on: from between them if it is no farther from their middle
/// than the farthest of them.
pub fn view_kind(train: &[DMat4], camera: &DMat4) -> ViewKind {
    let centres: Vec<DVec3> = train.iter().map(position).collect();
    let middle = centres.iter().sum::<DVec3>() / centres.len().max(1) as f64;
    let reach = centres.iter().map(|centre| centre.distance(middle)).fold(0.0, f64::max);
    if position(camera).distance(middle) <= reach { ViewKind::Interpolating } else { ViewKind::Extrapolating }
}

fn position(c2w: &DMat4) -> DVec3 {
    c2w.w_axis.truncate()
}

/// Splits frames, sorted by name, of cameras with names.
pub(crate) fn plan(frames: &[RawFrame], options: &SparseViews, scene: &Path) -> Result<SplitPlan, DatasetError> {
    let bad = |expected: String, found: String| DatasetError::Option {
        path: scene.to_path_buf(),
        option: "train_cameras",
        expected,
        found,
    };
    let mut cameras: BTreeMap<&str, DMat4> = BTreeMap::new();
    for frame in frames {
        let Some(id) = &frame.camera_id else {
            return Err(bad("cameras that film, told apart by name or pose".into(), "a frame without a camera".into()));
        };
        cameras.entry(id).or_insert(frame.c2w);
    }
    let trains = |id: &str| {
        let own = |frame: &&RawFrame| frame.camera_id.as_deref() == Some(id);
        frames.iter().filter(own).any(|frame| SplitName::trains(frame.split.as_ref()))
    };
    let candidates: Vec<(&str, DVec3)> =
        cameras.iter().filter(|(id, _)| trains(id)).map(|(id, c2w)| (*id, position(c2w))).collect();
    let wanted = if options.train == 0 { candidates.len() } else { options.train };
    if wanted > candidates.len() || wanted == 0 {
        return Err(bad(format!("at most {}", counted(candidates.len(), "training camera")), wanted.to_string()));
    }
    let chosen = training_cameras(&candidates, wanted);
    let poses: Vec<DMat4> = chosen.iter().map(|id| cameras[id]).collect();
    let others: Vec<(&str, DMat4)> =
        cameras.iter().filter(|(id, _)| !chosen.contains(*id)).map(|(id, c2w)| (*id, *c2w)).collect();
    let held = validation_cameras(&others, &poses, options.validation);
    let last = last_seen(frames, options.seen);
    let is_seen = |frame: &RawFrame| frame.time.is_none_or(|time| time <= last);
    let list = |ids: &[&str], seen: bool| -> Vec<usize> {
        let is_in = |frame: &RawFrame| frame.camera_id.as_deref().is_some_and(|id| ids.contains(&id));
        (0..frames.len()).filter(|i| is_in(&frames[*i]) && is_seen(&frames[*i]) == seen).collect()
    };
    let train = list(&chosen, true);
    if train.is_empty() {
        return Err(DatasetError::NoTrainingViews { path: scene.to_path_buf(), found: "only later frames".into() });
    }
    let held_ids: Vec<&str> = held.iter().map(|(id, _)| *id).collect();
    let named = [
        (Split::TEST, list(&held_ids, false)),
        (Split::VALIDATION, list(&held_ids, true)),
        (Split::TEST_SEEN, list(&chosen, false)),
    ];
    let held_out = named.into_iter().filter(|(_, list)| !list.is_empty()).map(|(name, list)| (name.to_string(), list));
    let between = held.iter().filter(|(_, kind)| *kind == ViewKind::Interpolating).count();
    let rule = format!(
        "cameras {} train up to time {last}, {} held out ({between} between them, {} outside), later frames are the \
         future",
        chosen.join(", "),
        counted(held.len(), "camera"),
        held.len() - between
    );
    Ok(SplitPlan { train, held_out: held_out.collect(), rule })
}

/// Warns that the points to start from may show what only cameras see that train no longer: figures of few cameras
/// would profit from them.
pub(crate) fn hidden_points(frames: &[RawFrame], plan: &SplitPlan, scene: &Path) -> Option<String> {
    let ids = |frames: &mut dyn Iterator<Item = &RawFrame>| -> BTreeSet<String> {
        frames.filter_map(|frame| frame.camera_id.clone()).collect()
    };
    let own = ids(&mut frames.iter().filter(|frame| SplitName::trains(frame.split.as_ref())));
    let chosen = ids(&mut plan.train.iter().map(|index| &frames[*index]));
    let hidden = own.difference(&chosen).count();
    (hidden > 0).then(|| {
        format!(
            "{}: the points of the data set may come from {} that {} not train here; start from depth priors of the \
             training cameras",
            scene.display(),
            counted(hidden, "camera"),
            agree(hidden, "does", "do")
        )
    })
}

/// The last time that is seen: that of the data set's own training list if another list goes on after it, else by share
/// of the recording.
fn last_seen(frames: &[RawFrame], seen: f64) -> f64 {
    let times = |trains: bool| {
        let of = frames.iter().filter(move |frame| SplitName::trains(frame.split.as_ref()) == trains);
        of.filter_map(|frame| frame.time)
    };
    let most = |trains: bool| times(trains).fold(f64::NEG_INFINITY, f64::max);
    let (own, later) = (most(true), most(false));
    if later > own {
        return own;
    }
    let least = times(true).chain(times(false)).fold(f64::INFINITY, f64::min);
    if seen < 1.0 && own.is_finite() { least + seen * (own.max(later) - least) } else { f64::INFINITY }
}

/// Cameras far from each other among those nearest to the first by name.
fn training_cameras<'a>(candidates: &[(&'a str, DVec3)], wanted: usize) -> Vec<&'a str> {
    let Some((_, first)) = candidates.first() else { return Vec::new() };
    let mut near: Vec<(&str, DVec3)> = candidates.to_vec();
    near.sort_by(|a, b| a.1.distance(*first).total_cmp(&b.1.distance(*first)).then(a.0.cmp(b.0)));
    let part = ((PART * candidates.len() as f64).ceil() as usize).max(wanted).min(candidates.len());
    near.truncate(part);
    let mut chosen = spread(&near, wanted);
    chosen.sort_unstable();
    chosen
}

/// About half of `wanted` cameras from between and half from outside, each far from the others of its kind.
fn validation_cameras<'a>(others: &[(&'a str, DMat4)], train: &[DMat4], wanted: usize) -> Vec<(&'a str, ViewKind)> {
    let of = |kind: ViewKind| -> Vec<(&'a str, DVec3)> {
        others.iter().filter(|(_, c2w)| view_kind(train, c2w) == kind).map(|(id, c2w)| (*id, position(c2w))).collect()
    };
    let (between, outside) = (of(ViewKind::Interpolating), of(ViewKind::Extrapolating));
    let inner = wanted.div_ceil(2).max(wanted.saturating_sub(outside.len())).min(between.len());
    let outer = (wanted - inner.min(wanted)).min(outside.len());
    let label = |kind: ViewKind| move |id: &'a str| (id, kind);
    let mut held: Vec<(&str, ViewKind)> =
        spread(&between, inner).into_iter().map(label(ViewKind::Interpolating)).collect();
    held.extend(spread(&outside, outer).into_iter().map(label(ViewKind::Extrapolating)));
    held.sort_by_key(|(id, _)| *id);
    held
}

/// `wanted` of `cameras`, the first and then always the one farthest from all that are chosen.
fn spread<'a>(cameras: &[(&'a str, DVec3)], wanted: usize) -> Vec<&'a str> {
    let mut left: Vec<(&str, DVec3)> = cameras.to_vec();
    let mut chosen: Vec<(&str, DVec3)> = Vec::new();
    while chosen.len() < wanted && !left.is_empty() {
        let distance = |at: &DVec3| chosen.iter().map(|(_, own)| own.distance(*at)).fold(f64::INFINITY, f64::min);
        // The first of equal ones: `max_by` alone would return the last.
        let mut best = 0;
        for index in 1..left.len() {
            if distance(&left[index].1) > distance(&left[best].1) {
                best = index;
            }
        }
        chosen.push(left.remove(best));
    }
    chosen.into_iter().map(|(id, _)| id).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LoadOptions, Scene, load};
    use gs_worlds::extrapolation::{ExtrapolationOptions, World, write};

    fn loaded(world: World, sparse: SparseViews) -> Result<Scene, DatasetError> {
        let folder = tempfile::tempdir().expect("a folder");
        let options = ExtrapolationOptions { width: 16, height: 12, frames: 8, ..ExtrapolationOptions::of(world) };
        write(folder.path(), &options, |_, _| {}).expect("written");
        load(folder.path(), &LoadOptions { sparse: Some(sparse), ..LoadOptions::default() })
    }

    #[test]
    fn protocols_of_3_and_5_views_hold_out_cameras_of_both_kinds() {
        for (world, train, validation) in
            [(World::Fan, 3, 5), (World::Fan, 5, 7), (World::Room, 3, 4), (World::Room, 5, 4)]
        {
            let scene = loaded(world, SparseViews { train, validation, seen: 1.0 }).expect("loaded");
            let cameras = |views: &[crate::View]| {
                let mut ids: Vec<String> = views.iter().filter_map(|view| view.camera_id.clone()).collect();
                ids.sort();
                ids.dedup();
                ids
            };
            let own = cameras(&scene.train);
            assert_eq!(own.len(), train, "{world}");
            let test = scene.split(Split::TEST).expect("future frames");
            assert_eq!(cameras(test), cameras(scene.split(Split::VALIDATION).expect("held-out cameras")));
            assert_eq!(cameras(test).len(), validation, "{world}");
            assert!(cameras(test).iter().all(|id| !own.contains(id)));
            assert_eq!(cameras(scene.split(Split::TEST_SEEN).expect("the training cameras' future")), own);
            assert!(scene.train.iter().all(|view| view.time <= Some(0.75)));
            assert!(test.iter().all(|view| view.time > Some(0.75)));
            let poses: Vec<DMat4> = scene.train.iter().map(|view| view.c2w).collect();
            let kinds: Vec<ViewKind> = test.iter().map(|view| view_kind(&poses, &view.c2w)).collect();
            assert!(kinds.contains(&ViewKind::Interpolating) && kinds.contains(&ViewKind::Extrapolating), "{world}");
        }
    }

    #[test]
    fn too_many_cameras_are_refused_and_all_of_them_may_train() {
        let error = loaded(World::Fan, SparseViews { train: 99, ..SparseViews::default() }).expect_err("too many");
        assert!(error.to_string().contains("at most 12 training cameras"), "{error}");
        let scene = loaded(World::Fan, SparseViews { train: 0, ..SparseViews::default() }).expect("loaded");
        assert_eq!(scene.train.len(), 12 * 7);
    }
}
