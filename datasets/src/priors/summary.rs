//! The sentences about the side files of many photos.

use std::collections::BTreeMap;
use std::path::Path;

use gs_base::{clause, counted, median};

use super::attach::{Reason, SideNotes};
use crate::findings::Findings;
use crate::frame::DepthSpace;
use crate::mask::SUSPECT_SHARE;
use crate::names::some_names;
use crate::side_files::Kind;

/// One view's files.
pub(crate) struct Noted<'a> {
    pub name: &'a str,
    /// Whether the view trains. A held-out view needs no prior, so a missing prior of it is not reported.
    pub trains: bool,
    pub notes: &'a SideNotes,
}

/// Warnings about files that were left out, resampled or look wrong.
pub(crate) fn warn(scene: &Path, views: &[Noted], findings: &mut Findings) {
    left_out(scene, views, findings);
    resampled(scene, views, findings);
    guessed(scene, views, findings);
    masks(scene, views, findings);
}

fn left_out(scene: &Path, views: &[Noted], findings: &mut Findings) {
    // Grouped by kind and reason, in a fixed order; the detail of the first is shown for all.
    let mut groups: BTreeMap<(Kind, &str), (Vec<&str>, String)> = BTreeMap::new();
    for view in views {
        for (kind, reason) in &view.notes.left_out {
            if kind.is_prior() && !view.trains && *reason == Reason::Missing {
                continue;
            }
            let (why, detail) = match reason {
                Reason::Missing => ("do not exist", String::new()),
                Reason::Size(sizes) => ("have another shape than their photos", sizes.clone()),
                Reason::Broken(error) => ("cannot be read", error.clone()),
                Reason::Distorted => (
                    "show the lens distortion or the wide angle of their photos, and are not resampled with them",
                    String::new(),
                ),
                Reason::Flat => ("hold one value, or none above 0", String::new()),
            };
            let group = groups.entry((*kind, why)).or_insert_with(|| (Vec::new(), detail));
            group.0.push(view.name);
        }
    }
    for ((kind, why), (names, detail)) in groups {
        let of = views.iter().filter(|view| view.trains || !kind.is_prior()).count();
        let detail = if detail.is_empty() { detail } else { format!(": {detail}") };
        findings.warn(format!(
            "{}: {kind} of {} of {} {why}; they are left out ({}{detail})",
            scene.display(),
            names.len(),
            counted(of, "view"),
            some_names(&names)
        ));
    }
}

fn resampled(scene: &Path, views: &[Noted], findings: &mut Findings) {
    let mut counts: BTreeMap<Kind, usize> = BTreeMap::new();
    for kind in views.iter().flat_map(|view| &view.notes.resampled) {
        *counts.entry(*kind).or_default() += 1;
    }
    for (kind, count) in counts {
        findings.warn(format!(
            "{}: {kind} of {} have another size than their photos, though the same proportions; each pixel takes the \
             nearest value",
            scene.display(),
            counted(count, "view")
        ));
    }
}

fn guessed(scene: &Path, views: &[Noted], findings: &mut Findings) {
    let spaces: Vec<DepthSpace> = views
        .iter()
        .filter_map(|view| view.notes.depth)
        .filter(|(_, _, guessed)| *guessed)
        .map(|(space, _, _)| space)
        .collect();
    if let Some(first) = spaces.first() {
        findings.warn(format!(
            "{}: nothing says what the depth files of {} mean; they are taken for {}, up to scale and shift; \
             data.depth_kind=metric-z, depth or inverse-depth says otherwise",
            scene.display(),
            counted(spaces.len(), "view"),
            describe(*first)
        ));
    }
}

fn masks(scene: &Path, views: &[Noted], findings: &mut Findings) {
    let shares: Vec<(&str, f64)> =
        views.iter().filter_map(|view| Some((view.name, view.notes.moving_share?))).collect();
    let empty: Vec<&str> = shares.iter().filter(|(_, share)| *share == 0.0).map(|(name, _)| *name).collect();
    if no_mask_marks_anything(views) {
        findings.warn(format!(
            "{}: no mask marks a moving pixel in any of {}; the masks are left out",
            scene.display(),
            counted(shares.len(), "view")
        ));
    } else if !empty.is_empty() {
        findings.warn(format!(
            "{}: the masks of {} of {} mark no moving pixel; nothing is taken to move there ({})",
            scene.display(),
            empty.len(),
            counted(shares.len(), "view"),
            some_names(&empty)
        ));
    }
    if let Some(median) = median(shares.iter().map(|(_, share)| *share).collect())
        && median > SUSPECT_SHARE
    {
        findings.warn(format!(
            "{}: THE MASKS MARK {:.0} % OF THE MEDIAN VIEW AS MOVING. They may mean the opposite: look at one; \
             data.masks=keep-black, keep-white and ignore read them otherwise",
            scene.display(),
            100.0 * median
        ));
    }
}

/// Whether there are masks and all of them are black. As evidence they would freeze what moves.
pub(crate) fn no_mask_marks_anything(views: &[Noted]) -> bool {
    let mut shares = views.iter().filter_map(|view| view.notes.moving_share).peekable();
    shares.peek().is_some() && shares.all(|share| share == 0.0)
}

/// The priors that were found, for a report.
pub(crate) fn facts(views: &[Noted]) -> Vec<String> {
    let mut counts: BTreeMap<Kind, usize> = BTreeMap::new();
    for kind in views.iter().flat_map(|view| &view.notes.used) {
        *counts.entry(*kind).or_default() += 1;
    }
    let depth = views.iter().find_map(|view| view.notes.depth);
    let shares: Vec<f64> = views.iter().filter_map(|view| view.notes.moving_share).collect();
    let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
    counts
        .into_iter()
        .map(|(kind, count)| {
            let detail = match (kind, depth) {
                (Kind::Depth, Some((space, true, _))) => format!(", {} in scene units", describe(space)),
                (Kind::Depth, Some((space, false, _))) => {
                    format!(", {}, to be aligned by scale and shift in each", describe(space))
                }
                (Kind::Moving, _) => format!(", {:.1} % of the pixels on average", 100.0 * mean),
                _ => String::new(),
            };
            format!("{} {kind}{detail}.", clause(count, "view", "has", "have"))
        })
        .collect()
}

fn describe(space: DepthSpace) -> &'static str {
    match space {
        DepthSpace::Depth => "depth",
        DepthSpace::InverseDepth => "inverse depth",
    }
}
