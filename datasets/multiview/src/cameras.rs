//! Groups of views: by static camera, and by time.

use gs_base::mean;
use gs_datasets::View;

/// Two views are of one static camera when no point of the scene moves by more than this between them, pixels. A
/// smaller shift changes ordinary texture by less than the noise. Poses estimated frame by frame for a camera on a
/// tripod usually agree this well.
const SHIFT_MAX: f64 = 0.5;

/// Times are equal up to this share of the whole range. It covers printed digits and lies far below a frame of any
/// video.
const SAME_TIME: f64 = 1e-6;

/// The views of a camera that does not move.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StaticCamera {
    /// Its `camera_id`, or the name of its first view where the data set gives none.
    pub name: String,
    /// Indices of its views, by time; views without a time come last, in their given order.
    pub views: Vec<usize>,
}

/// Groups views by static camera: equal pose, intrinsics, size and `camera_id` (where there is one). Groups come in
/// the order of their first views. A moving camera becomes one group a pose, mostly of one view.
///
/// The pose decides and not the id, because some formats number lenses and not cameras.
pub fn static_cameras(views: &[View]) -> Vec<StaticCamera> {
    let centres: Vec<_> = views.iter().map(|view| view.c2w.w_axis.truncate()).collect();
    // Rough distance of the scene, which turns a shift of the camera into pixels. It is zero when all cameras
    // coincide; then only equal poses agree.
    let distance = mean(&centres)
        .map_or(0.0, |middle| centres.iter().map(|centre| centre.distance(middle)).fold(0.0, f64::max))
        .max(f64::MIN_POSITIVE);
    let mut groups: Vec<StaticCamera> = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let known = groups.iter_mut().find(|group| stands_still(&views[group.views[0]], view, distance));
        match known {
            Some(group) => group.views.push(index),
            None => {
                let name = view.camera_id.clone().unwrap_or_else(|| view.name.clone());
                groups.push(StaticCamera { name, views: vec![index] });
            }
        }
    }
    for group in &mut groups {
        // Stable: views without a time keep their order, behind the others.
        group.views.sort_by(|a, b| time_key(&views[*a]).total_cmp(&time_key(&views[*b])));
    }
    groups
}

fn time_key(view: &View) -> f64 {
    view.time.filter(|time| time.is_finite()).unwrap_or(f64::INFINITY)
}

/// Whether two views agree to [`SHIFT_MAX`]; false when anything is not finite.
fn stands_still(a: &View, b: &View, distance: f64) -> bool {
    if a.camera_id != b.camera_id || (a.width, a.height) != (b.width, b.height) {
        return false;
    }
    let (k, l) = (&a.intrinsics, &b.intrinsics);
    let lens = (k.fx - l.fx).abs().max((k.fy - l.fy).abs()).max((k.cx - l.cx).abs()).max((k.cy - l.cy).abs());
    let focal = k.fx.max(k.fy);
    let moved = (a.c2w.w_axis - b.c2w.w_axis).truncate().length() * focal / distance;
    let axis = |i: usize| (a.c2w.col(i) - b.c2w.col(i)).truncate().length();
    let turned = axis(0).max(axis(1)).max(axis(2)) * focal;
    lens <= SHIFT_MAX && moved <= SHIFT_MAX && turned <= SHIFT_MAX
}

/// The views that were taken at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Instant {
    pub t: f64,
    pub views: Vec<usize>,
}

/// Views grouped by time, earliest first. Views without a finite time are left out.
pub(crate) fn instants(views: &[View]) -> Vec<Instant> {
    let mut timed: Vec<(f64, usize)> = views
        .iter()
        .enumerate()
        .filter_map(|(index, view)| view.time.filter(|time| time.is_finite()).map(|time| (time, index)))
        .collect();
    timed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let range = timed.last().map_or(0.0, |last| last.0 - timed[0].0);
    let mut instants: Vec<Instant> = Vec::new();
    for (t, index) in timed {
        match instants.last_mut() {
            Some(instant) if t - instant.t <= SAME_TIME * range => instant.views.push(index),
            _ => instants.push(Instant { t, views: vec![index] }),
        }
    }
    for instant in &mut instants {
        instant.views.sort_unstable();
    }
    instants
}
