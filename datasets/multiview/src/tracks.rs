//! Objects that move apart from each other, each with the path of its centre.

use gs_datasets::{Scene, View};

use crate::centres::Centre;
use crate::objects::object_centres;
use crate::options::{CueOptions, ObjectOptions};
use crate::trajectory::Trajectory;

/// An object with its path; all that moves, where objects cannot be told apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Its centres, earliest first.
    pub centres: Vec<Centre>,
    /// Path of its centre.
    pub path: Trajectory,
}

/// Size of a scene unit in the images, at the distance of the moving object.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImageScale {
    /// Pixels for each scene unit, mean over the views; 0 without centres.
    pub pixels_per_unit: f64,
    /// Image widths for each scene unit, mean over the views; 0 without centres.
    pub widths_per_unit: f64,
}

impl ImageScale {
    /// The scale at the middle one of `centres`, over the views that have it before them.
    pub fn at(views: &[View], centres: &[Centre]) -> Self {
        let Some(middle) = centres.get(centres.len() / 2) else { return Self::default() };
        let (mut pixels, mut widths, mut count) = (0.0, 0.0, 0_usize);
        for view in views {
            let depth = (middle.position - view.c2w.w_axis.truncate()).dot(view.c2w.z_axis.truncate());
            if depth > 0.0 {
                pixels += view.intrinsics.fx / depth;
                widths += view.intrinsics.fx / view.width as f64 / depth;
                count += 1;
            }
        }
        let count = count.max(1) as f64;
        Self { pixels_per_unit: pixels / count, widths_per_unit: widths / count }
    }
}

/// Shares of the times between which [`ObjectOptions::body_size`] grows from a quarter to the whole: the less an object
/// is seen, the closer it must keep to its path. Fragments of a hull come and go; objects that touch are one component
/// for a while and keep to their paths before and after.
const SEEN: [f64; 2] = [0.5, 0.9];

/// Whether centres at a share `seen` of the times, at a root mean square distance of `widths` image widths from their
/// path, are an object's.
fn is_object(seen: f64, widths: f64, options: &ObjectOptions) -> bool {
    let [least, all] = SEEN;
    let [near, far] = [0.25 * options.body_size, options.body_size];
    let between = ((seen - least) / (all - least)).min(1.0);
    between >= 0.0 && widths <= near + (far - near) * between
}

/// Objects that move apart from each other, the one with most centres first, each with a path of at most `max_order`
/// and `max_kinks`; all that moves as one track if fewer than two objects are certain, and none if its centre follows
/// no path. `masks` holds one mask per training view, `centres` the centre of all that moves.
pub fn tracks(
    scene: &Scene,
    masks: &[Option<Vec<u8>>],
    centres: &[Centre],
    max_order: usize,
    max_kinks: usize,
    options: &CueOptions,
) -> Vec<Track> {
    let track = |centres: Vec<Centre>| {
        let path = Trajectory::fit(&centres, max_order, max_kinks)?;
        Some(Track { centres, path })
    };
    let scale = ImageScale::at(&scene.train, centres).widths_per_unit;
    let mut objects: Vec<Track> = object_centres(scene, masks, options).into_iter().filter_map(track).collect();
    let times = objects.iter().map(|object| object.centres.len()).max().unwrap_or(0).max(centres.len()) as f64;
    objects.retain(|object| {
        let (seen, widths) = (object.centres.len() as f64 / times, object.path.residual * scale);
        let kept = 1.0 - object.path.outliers as f64 / object.centres.len() as f64;
        tracing::debug!(seen, kept, widths, order = object.path.order(), kinks = object.path.kinks.len(), "an object");
        is_object(seen * kept, widths, &options.objects)
    });
    if objects.len() > 1 {
        return objects;
    }
    let whole = track(centres.to_vec()).filter(|whole| whole.path.residual * scale <= options.objects.followed);
    whole.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An object seen always may be rough, one seen half the time must be exact, one seen less is none; in pixels at a
    /// width of 256.
    #[test]
    fn the_less_an_object_is_seen_the_closer_it_keeps_to_its_path() {
        let is = |seen, pixels: f64| is_object(seen, pixels / 256.0, &ObjectOptions::default());
        assert!(is(1.0, 2.0) && is(0.9, 2.0) && is(0.5, 0.5));
        assert!(is(0.7, 1.2) && !is(0.7, 1.3));
        assert!(!is(1.0, 2.1) && !is(0.5, 0.6) && !is(0.49, 0.0));
    }
}
