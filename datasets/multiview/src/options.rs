//! Heuristics of this crate as options, with today's values as defaults.
//!
//! Lengths in images are shares of the image width. They were chosen on photos 256 to 320 pixels wide; the defaults are
//! exact at the reference width of 256. Thresholds that follow from statistics (chi-squared, BIC, median absolute
//! deviation) are no options: they stand as constants beside their argument.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Image width at which the defaults were chosen, pixels: a share of the width times this is the length in pixels they
/// were tuned at.
pub const REFERENCE_WIDTH: f64 = 256.0;

/// Heuristics of masks, hulls and objects. Functions do not check their options: call [`validate`](Self::validate) on
/// those from outside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct CueOptions {
    /// Backgrounds and masks.
    pub masks: MaskOptions,
    /// Hulls.
    pub hull: HullOptions,
    /// Objects and their tracks.
    pub objects: ObjectOptions,
}

/// Heuristics of backgrounds and masks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MaskOptions {
    /// Scales the acceptance of shadows, 0 to 2. Tolerances of tint and smoothness are multiplied by it, limits of
    /// brightness raised to its power. Larger: dark or evenly lit objects vanish from the masks. Smaller: shadows join
    /// them and pull centres to the floor; at 0 only unchanged light is accepted. The limits of brightness come from
    /// physics (an umbra under the sky keeps about 0.4 of the encoded value); the tolerances were tuned for nearly
    /// white light, and shadows in coloured light need more than 1.
    pub shadow: f64,
    /// Smallest region that is kept, as a share of the image's area, 0 to 0.01; never under 8 pixels, because chance
    /// regions of the 3 x 3 score are equally large at any resolution. Larger: small objects vanish. Smaller: specks of
    /// flicker move centroids.
    pub speck: f64,
    /// Share of the outline that a doubtful region must have in common with moving pixels to join them, above 0 to 1.
    /// The middle that an object never uncovers lies within its moving edges; static surfaces of its colour touch them
    /// here and there. Larger: objects of one colour have holes. Smaller: static surfaces join.
    pub contact: f64,
    /// The same share for regions that look like shadow, above 0 to 1. A shirt in the wall's colour lies between head,
    /// arms and trousers; a shadow on the floor touches its object on one side. Larger: such shirts are holes. Smaller:
    /// shadows join.
    pub enclosed: f64,
    /// Largest hole that is filled, as a share of the region around it, 0 to 1: the inside of an object may have the
    /// background's colour. Larger: rings are filled. Smaller: holes stay, and hulls get tunnels.
    pub hole: f64,
    /// Bits of a channel by which colours are counted, 2 to 6. More: too few samples for each colour. Fewer: object and
    /// background share one.
    pub color_bits: u32,
    /// Ratio of likelihoods at which the picture's colours overturn the order in time of an ambiguous pixel's two
    /// colours, 1 or more. Larger: slow objects leave ghosts at both ends of their path. Smaller: rare colours of the
    /// background are taken for the object.
    pub overturn: f64,
    /// A background colour is doubtful from this many sightings on passing objects for each on the background, above 0
    /// to 10. Larger: the middle of an object of one colour is missed. Smaller: more of the background may join a mask.
    pub doubtful: f64,
}

/// How to make a hull, and how many masks may be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HullOptions {
    /// Points wanted; spread evenly over the surface or the volume. Fewer come where it has fewer voxels.
    pub points: usize,
    /// Whether points fill the volume. The hull is larger than the object, so its surface is right only where outlines
    /// touch it.
    pub filled: bool,
    /// Cameras that may have a position outside of their masks although it belongs to the object. `None`: none below
    /// `forgiving_from` cameras, then one, and another for every `cameras_per_miss`; always at least two must agree.
    pub misses: Option<usize>,
    /// Cameras from which on one mask may be wrong, 3 or more. The hull of all but one of n cameras is the union of n
    /// hulls of n - 1: with 3 or 4 cameras these are of 2 or 3 cones, which do not close around the object, so no mask
    /// may be wrong there. From 5 on four cones remain. Larger: one broken mask cuts the object off. Smaller: phantoms
    /// grow around it. A set of five cameras with masks that are known to be right is better off with 6.
    pub forgiving_from: usize,
    /// Cameras for each further wrong mask, 1 or more. Larger: broken masks of big rigs cut the object. Smaller: the
    /// hull swells, because the hull of all but k cameras is larger than the hull of all.
    pub cameras_per_miss: usize,
    /// Share of views, 0 to below 1, whose masks may be far too large without enlarging the first box. Larger: long
    /// objects are cut at first. Smaller: one wrong mask makes the box, and so the voxels, coarse.
    pub oversized: f64,
    /// Share of the core that a mask must contain to be used, 0 to 1. Larger: ragged masks are left out. Smaller: a
    /// mask of half the object cuts the other half off.
    pub believed: f64,
    /// Share of cameras that must agree on some position, 0 to 1; else there is no hull. Larger: occluded objects have
    /// none. Smaller: masks of different objects give a phantom.
    pub agreement: f64,
}

/// Heuristics of telling objects apart and following them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ObjectOptions {
    /// Root mean square distance of an object's centres from its path, share of the image width, above 0 to 0.1, for an
    /// object seen at 0.9 of the times or more; a quarter of it for one seen at half of them, linear in between. The
    /// default is 2 pixels of 256. Larger: fragments of ragged hulls, which come and go and jump, become objects.
    /// Smaller: real objects with rough masks get no path of their own.
    pub body_size: f64,
    /// The same distance for the centre of all that moves, above 0 to 0.1; beyond it nothing follows that path. The
    /// default is 4 pixels of 256; objects are mostly within 1.5. Larger: the centre of several people, which is
    /// nobody's (21 pixels), leads all Gaussians astray. Smaller: an object with rough masks starts without a path.
    pub followed: f64,
    /// Smallest component of the hull, as a share of the largest, 0 to 1. Where the cones of several objects cross,
    /// hulls have phantoms. Larger: small objects vanish beside large ones. Smaller: phantoms become objects.
    pub phantom: f64,
    /// Share of the voxels projecting into a mask region that must be of one component for the region to be its own,
    /// 0.5 to 1. Larger: touching outlines leave no camera. Smaller: overlapping objects pull each other's centres.
    pub owned: f64,
    /// Share of a component that must project into its own regions for the camera to count, 0 to 1. Larger: partly
    /// occluded objects lose cameras. Smaller: cut outlines bias the centre.
    pub shown: f64,
    /// Share of the times at which a track needs a centre, 0 to 1. Larger: objects that enter late are lost. Smaller:
    /// chance components stay.
    pub kept: f64,
    /// Times after which a track may contest another's component, 1 or more. Larger: merged objects are taken for one
    /// of them. Smaller: chance components contest.
    pub steady: usize,
}

impl Default for MaskOptions {
    fn default() -> Self {
        Self {
            shadow: 1.0,
            speck: 1e-4,
            contact: 0.4,
            enclosed: 0.5,
            hole: 0.25,
            color_bits: 4,
            overturn: 4.0,
            doubtful: 0.3,
        }
    }
}

impl Default for HullOptions {
    fn default() -> Self {
        Self {
            points: 4000,
            filled: false,
            misses: None,
            forgiving_from: 5,
            cameras_per_miss: 16,
            oversized: 0.25,
            believed: 0.6,
            agreement: 0.6,
        }
    }
}

impl Default for ObjectOptions {
    fn default() -> Self {
        Self {
            body_size: 2.0 / REFERENCE_WIDTH,
            followed: 4.0 / REFERENCE_WIDTH,
            phantom: 0.05,
            owned: 0.95,
            shown: 0.9,
            kept: 0.5,
            steady: 3,
        }
    }
}

/// An option outside its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{name}: expected {expected}, found {found}")]
pub struct OptionError {
    /// The option, without its group.
    pub name: &'static str,
    /// Its range.
    pub expected: &'static str,
    /// The value.
    pub found: f64,
}

impl CueOptions {
    /// The first option outside the range that its doc states, if any.
    ///
    /// # Errors
    /// On an option outside its range, NaN included.
    pub fn validate(&self) -> Result<(), OptionError> {
        let Self { masks, hull, objects } = self;
        let share = |x: f64| (0.0..=1.0).contains(&x);
        let positive_share = |x: f64| x > 0.0 && x <= 1.0;
        let width = |x: f64| x > 0.0 && x <= 0.1;
        let checks: [(&'static str, f64, bool, &'static str); 20] = [
            ("shadow", masks.shadow, (0.0..=2.0).contains(&masks.shadow), "0 to 2"),
            ("speck", masks.speck, (0.0..=0.01).contains(&masks.speck), "0 to 0.01"),
            ("contact", masks.contact, positive_share(masks.contact), "above 0 to 1"),
            ("enclosed", masks.enclosed, positive_share(masks.enclosed), "above 0 to 1"),
            ("hole", masks.hole, share(masks.hole), "0 to 1"),
            ("color_bits", masks.color_bits.into(), (2..=6).contains(&masks.color_bits), "2 to 6"),
            ("overturn", masks.overturn, masks.overturn >= 1.0, "1 or more"),
            ("doubtful", masks.doubtful, masks.doubtful > 0.0 && masks.doubtful <= 10.0, "above 0 to 10"),
            ("forgiving_from", hull.forgiving_from as f64, hull.forgiving_from >= 3, "3 or more"),
            ("cameras_per_miss", hull.cameras_per_miss as f64, hull.cameras_per_miss >= 1, "1 or more"),
            ("oversized", hull.oversized, (0.0..1.0).contains(&hull.oversized), "0 to below 1"),
            ("believed", hull.believed, share(hull.believed), "0 to 1"),
            ("agreement", hull.agreement, share(hull.agreement), "0 to 1"),
            ("body_size", objects.body_size, width(objects.body_size), "above 0 to 0.1"),
            ("followed", objects.followed, width(objects.followed), "above 0 to 0.1"),
            ("phantom", objects.phantom, share(objects.phantom), "0 to 1"),
            ("owned", objects.owned, (0.5..=1.0).contains(&objects.owned), "0.5 to 1"),
            ("shown", objects.shown, share(objects.shown), "0 to 1"),
            ("kept", objects.kept, share(objects.kept), "0 to 1"),
            ("steady", objects.steady as f64, objects.steady >= 1, "1 or more"),
        ];
        let wrong = checks.into_iter().find(|(_, _, is_right, _)| !is_right);
        wrong.map_or(Ok(()), |(name, found, _, expected)| Err(OptionError { name, expected, found }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_nothing_else_slips_through() {
        let good = CueOptions::default();
        assert_eq!(good.validate(), Ok(()));
        assert_eq!(good.objects.body_size * REFERENCE_WIDTH, 2.0);
        assert_eq!(good.objects.followed * REFERENCE_WIDTH, 4.0);
        let mut bad = good;
        bad.masks.shadow = f64::NAN;
        assert_eq!(bad.validate().expect_err("not a number").name, "shadow");
        let mut bad = good;
        bad.objects.body_size = 2.0;
        assert_eq!(bad.validate().expect_err("pixels").to_string(), "body_size: expected above 0 to 0.1, found 2");
        let mut bad = good;
        bad.hull.forgiving_from = 2;
        assert_eq!(bad.validate().expect_err("two cameras").name, "forgiving_from");
    }
}
