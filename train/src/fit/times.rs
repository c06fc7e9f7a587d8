//! A scene at many times: views in groups of one time, and Gaussians at a few times at once.

use gs_burn::Gaussians;
use gs_datasets::View;
use gs_models::DynamicScene;

/// Times at which a scene is held at once: a rollout is integrated once for all of them, and each holds its Gaussians.
pub const TIMES_AT_ONCE: usize = 16;

/// The Gaussians at each of `times`, of which a few are held at once.
pub fn through_time<'a>(scene: &'a dyn DynamicScene, times: &'a [f64]) -> impl Iterator<Item = Gaussians> + 'a {
    times.chunks(TIMES_AT_ONCE).flat_map(|times| scene.at_times(times))
}

/// Calls `f` with the Gaussians at the time of each of `views` and its index, times ascending.
pub fn each_view(scene: &dyn DynamicScene, views: &[&View], mut f: impl FnMut(&Gaussians, usize)) {
    let groups = by_time(views.iter().copied());
    let times: Vec<f64> = groups.iter().map(|(time, _)| *time).collect();
    for ((_, indices), gaussians) in groups.into_iter().zip(through_time(scene, &times)) {
        indices.into_iter().for_each(|index| f(&gaussians, index));
    }
}

/// The views of each time by index, times ascending; 0 for a view without a time.
pub fn by_time<'a>(views: impl IntoIterator<Item = &'a View>) -> Vec<(f64, Vec<usize>)> {
    let mut order: Vec<(f64, usize)> =
        views.into_iter().enumerate().map(|(index, view)| (view.time.unwrap_or(0.0), index)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
    for (time, index) in order {
        match groups.last_mut() {
            Some((last, indices)) if *last == time => indices.push(index),
            _ => groups.push((time, vec![index])),
        }
    }
    groups
}
