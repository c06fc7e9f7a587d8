//! From coarse to fine: in the first share of a run photos are compared at a reduced width.
//!
//! A step costs nearly as much as its pixels do, and first shapes need few. The width is a function of the step and the
//! configuration alone, so that a resumed run compares the same. Views are reduced once, filtered by area; the scene
//! itself keeps its full size.

use gs_datasets::View;

/// Smallest reduced width, pixels: below it texture that tells Gaussians apart is gone.
const WIDTH_MIN: usize = 200;

/// Most steps with reduced photos: those of a run of 1000. On lund-door at 480 pixels the held-out photo has 29.6 dB at
/// step 200 after 10 s if the first 210 steps are reduced, and 31.9 dB after 15 s if 70 are.
const STEPS_MOST: usize = 70;

/// Most halvings of the width: a quarter.
const HALVINGS: usize = 2;

/// Steps with reduced photos in a run of `steps`.
fn steps_of(share: f64, steps: usize) -> usize {
    ((share * steps as f64) as usize).min(STEPS_MOST)
}

/// The dilation of splats, square pixels of a photo whose pixels are `pixel` times as wide as those of the scene's
/// photos, at which they look as they do in the scene's photo after the area filter.
///
/// In pixels of the scene's photo, a filter over `pixel` of them adds the variance `(pixel^2 - 1) / 12` to the dilation
/// `eps2d` there. The same dilation in wide pixels would teach the Gaussians to be thinner than they are.
pub fn dilation(eps2d: f64, pixel: f64) -> f64 {
    (eps2d + (pixel * pixel - 1.0) / 12.0) / (pixel * pixel)
}

/// Reduced views, by how often their width is halved.
#[derive(Debug, Clone, Default)]
pub struct Coarse {
    /// Views at a half, then at a quarter of their width.
    levels: Vec<Vec<View>>,
    /// Share of a run's steps with reduced photos.
    share: f64,
    /// Steps of the run.
    steps: usize,
}

impl Coarse {
    /// Reduced views for a run of `steps` whose first `share`, 0 to 1, compares photos at a reduced width.
    pub fn of(views: &[View], share: f64, steps: usize) -> Self {
        let narrowest = views.iter().map(|view| view.width).min().unwrap_or(0);
        let fits = |halvings: &usize| narrowest >> halvings >= WIDTH_MIN;
        let halvings = if steps_of(share, steps) > 0 { (0..=HALVINGS).rev().find(fits).unwrap_or(0) } else { 0 };
        let reduced = |halvings: usize| views.iter().map(|view| view.reduced(view.width >> halvings)).collect();
        Self { levels: (1..=halvings).map(reduced).collect(), share, steps }
    }

    /// How often the width of the photos of `step` (from 1) is halved. Each level has an equal share of the coarse
    /// steps, the coarsest first.
    pub fn halvings(&self, step: usize) -> usize {
        self.halvings_in(step, self.steps)
    }

    /// The same in a run of another number of steps.
    pub fn halvings_in(&self, step: usize, steps: usize) -> usize {
        let (levels, until) = (self.levels.len(), steps_of(self.share, steps));
        match step <= until {
            true => levels - (step - 1) * levels / until,
            false => 0,
        }
    }

    /// The views of `halvings`, at least 1.
    pub fn views(&self, halvings: usize) -> &[View] {
        &self.levels[halvings - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn halvings(width: usize, share: f64, steps: usize) -> Vec<usize> {
        let coarse = Coarse::of(&[View::blank(width, 10), View::blank(1000, 10)], share, steps);
        (1..=steps).map(|step| coarse.halvings(step)).collect()
    }

    #[test]
    fn wide_photos_begin_at_a_quarter() {
        assert_eq!(halvings(960, 0.4, 10), [2, 2, 1, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(halvings(480, 0.4, 10), [1, 1, 1, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(halvings(960, 0.1, 10)[..2], [2, 0]);
    }

    #[test]
    fn long_runs_have_no_more_reduced_photos_than_short_ones() {
        let reduced = |steps| halvings(480, 0.07, steps).iter().filter(|halvings| **halvings > 0).count();
        assert_eq!([reduced(100), reduced(3000), reduced(7000), reduced(30_000)], [7, 70, 70, 70]);
    }

    #[test]
    fn narrow_photos_and_a_share_of_nothing_are_never_reduced() {
        assert_eq!(halvings(399, 1.0, 10), [0; 10]);
        assert_eq!(halvings(960, 0.0, 10), [0; 10]);
        assert_eq!(halvings(960, 0.05, 10), [0; 10]);
        assert_eq!(Coarse::of(&[], 1.0, 10).halvings(1), 0);
    }

    #[test]
    fn dilation_is_the_variance_of_both_filters() {
        assert_eq!(dilation(0.3, 1.0), 0.3);
        assert!((dilation(0.3, 2.0) - 0.55 / 4.0).abs() < 1e-15);
        // Many pixels in one: the variance of a box of width 1.
        assert!((dilation(0.3, 1e6) - 1.0 / 12.0).abs() < 1e-9);
    }

    #[test]
    fn reduced_views_keep_their_order_and_names() {
        let views: Vec<View> = (0..3).map(|i| View { name: i.to_string(), ..View::blank(480, 717) }).collect();
        let coarse = Coarse::of(&views, 0.5, 10);
        let names: Vec<&str> = coarse.views(1).iter().map(|view| view.name.as_str()).collect();
        assert_eq!(names, ["0", "1", "2"]);
        assert_eq!((coarse.views(1)[0].width, coarse.views(1)[0].height), (240, 359));
    }
}
