//! Nothing hangs in the air before a camera, nor before one that could stand between two.
//!
//! Of what all cameras see as one colour (sky, a plain wall) the photos do not say how far it is. Where cameras stand around a scene,
//! Gaussians of it then end up high in the air close before the place of a camera that is not there, and a held-out view sees fog.
//! A training camera draws nothing nearer than the near plane; here the same is asked of the places between neighbouring
//! cameras: what is found there is made transparent, so that density control moves it where it is of use.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};
use gs_datasets::{Scene, View};

use crate::density::ops::logit;
use crate::parameters::{Group, Parameters, from_host};

/// Two cameras are neighbours when the angle between them, seen from the subject, is at most this many times that from either to its
/// nearest: on a ring with one place left empty those at both sides of it are, also where steps differ by a quarter.
const NEIGHBOURS: f64 = 2.5;

/// Places between two neighbours, as shares of the way.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];

/// Cameras nearer to each other than this share of their distance from the subject stand in one place.
const ONE_PLACE: f64 = 1e-3;

/// Places where cameras stand or could stand, and how far each must see nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Clearance {
    /// Place and unit direction of view (world, scene units).
    sights: Vec<(DVec3, DVec3)>,
    /// Scene units.
    near: f64,
}

impl Clearance {
    /// The places of `views` and between neighbours on the way around what they look at; none where they look at no one thing.
    /// `near` in scene units.
    pub fn new(views: &[View], near: f64) -> Self {
        let poses: Vec<_> = views.iter().map(|view| view.c2w).collect();
        let Some(subject) = Scene::subject_of(&poses) else { return Self { sights: Vec::new(), near } };
        let mut arms: Vec<DVec3> = Vec::new();
        for arm in poses.iter().map(|c2w| c2w.w_axis.truncate() - subject) {
            if arms.iter().all(|other| other.distance(arm) > ONE_PLACE * arm.length()) {
                arms.push(arm);
            }
        }
        let angle = |i: usize, j: usize| arms[i].angle_between(arms[j]);
        let nearest = |i: usize| (0..arms.len()).filter(|j| *j != i).map(|j| angle(i, j)).fold(f64::INFINITY, f64::min);
        let nearest: Vec<f64> = (0..arms.len()).map(nearest).collect();
        let mut places = arms.clone();
        for i in 0..arms.len() {
            for j in 0..i {
                let apart = angle(i, j);
                if apart <= (NEIGHBOURS * nearest[i].max(nearest[j])).min(FRAC_PI_2) {
                    places.extend(BETWEEN.map(|share| between(arms[i], arms[j], share)));
                }
            }
        }
        let sights = places.into_iter().map(|arm| (subject + arm, -arm.normalize())).collect();
        Self { sights, near }
    }

    /// Whether a Gaussian at `place` hangs before one of the cameras: within the near distance of it, and not behind it.
    pub fn is_blocked_by(&self, place: DVec3) -> bool {
        self.sights.iter().any(|(centre, axis)| {
            let to = place - *centre;
            to.length_squared() < self.near * self.near && to.dot(*axis) > 0.0
        })
    }
}

/// Makes Gaussians transparent that hang within `near` (scene units) before the cameras of `views` or between them; returns how many.
/// `min_opacity` as of [`DensityConfig`](super::DensityConfig): less is dead to density control, which puts it to use elsewhere.
pub fn clear(parameters: &mut Parameters, views: &[View], near: f64, min_opacity: f64) -> usize {
    let clearance = Clearance::new(views, near);
    let (means, mut logits) = (parameters.read(Group::Means), parameters.read(Group::Opacity));
    let dead = logit(0.5 * min_opacity) as f32;
    let mut cleared = 0;
    for (mean, opacity) in means.as_chunks::<3>().0.iter().zip(&mut logits) {
        if *opacity > dead && clearance.is_blocked_by(DVec3::from(mean.map(f64::from))) {
            *opacity = dead;
            cleared += 1;
        }
    }
    if cleared > 0 {
        tracing::debug!(cleared, "Gaussians hung before cameras");
        let device = parameters.device();
        *parameters.get_mut(Group::Opacity) = from_host(logits, 1, &device);
    }
    cleared
}

/// The arm that is `share` of the way from `a` to `b`, along the arc.
fn between(a: DVec3, b: DVec3, share: f64) -> DVec3 {
    let turn = DQuat::from_rotation_arc(a.normalize(), b.normalize());
    let length = a.length() + share * (b.length() - a.length());
    DQuat::IDENTITY.slerp(turn, share) * a.normalize() * length
}

#[cfg(test)]
mod tests {
    use glam::DMat4;
    use gs_datasets::{Intrinsics, RgbImage8, View};

    use super::*;

    /// A camera at `place` that looks at the origin.
    fn view(place: DVec3) -> View {
        let z = -place.normalize();
        let x = DVec3::Y.cross(z).normalize();
        let column = |v: DVec3, w: f64| v.extend(w);
        let c2w = DMat4::from_cols(column(x, 0.0), column(z.cross(x), 0.0), column(z, 0.0), column(place, 1.0));
        View {
            name: String::new(),
            image_path: String::new().into(),
            c2w,
            intrinsics: Intrinsics { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5 },
            width: 1,
            height: 1,
            time: Some(0.0),
            camera_id: None,
            image: RgbImage8 { width: 1, height: 1, data: vec![0; 3] },
            mask: None,
            exposure: None,
            priors: Default::default(),
            truth: Default::default(),
        }
    }

    fn on_ring(degrees: f64, radius: f64) -> DVec3 {
        let turn = degrees.to_radians();
        DVec3::new(radius * turn.cos(), 0.0, radius * turn.sin())
    }

    #[test]
    fn the_places_between_neighbours_are_kept_clear() {
        // Every 30 degrees but for the one at 60; each twice, as at two times.
        let ring = (0..12).filter(|i| *i != 2).flat_map(|i| [i, i]);
        let views: Vec<View> = ring.map(|i| view(on_ring(30.0 * f64::from(i), 4.0))).collect();
        let clearance = Clearance::new(&views, 1.2);
        for degrees in [0.0, 15.0, 52.0, 60.0, 100.0] {
            assert!(clearance.is_blocked_by(on_ring(degrees, 3.5)), "before the ring at {degrees} degrees");
            assert!(!clearance.is_blocked_by(on_ring(degrees, 2.5)), "in the middle at {degrees} degrees");
            assert!(!clearance.is_blocked_by(on_ring(degrees, 4.5)), "behind the ring at {degrees} degrees");
        }
        assert!(!clearance.is_blocked_by(DVec3::new(f64::NAN, 0.0, 0.0)));
    }

    #[test]
    fn cameras_that_look_at_no_one_thing_keep_nothing_clear() {
        let ahead = |x: f64| {
            let mut view = view(DVec3::new(0.0, 0.0, -1.0));
            view.c2w.w_axis.x = x;
            view
        };
        let clearance = Clearance::new(&[ahead(0.0), ahead(1.0), ahead(2.0)], 1.0);
        assert!(!clearance.is_blocked_by(DVec3::new(0.0, 0.0, -0.9)));
        // Opposite cameras are no neighbours: the way from one to the other would go through the scene.
        let clearance = Clearance::new(&[view(on_ring(0.0, 4.0)), view(on_ring(170.0, 4.0))], 1.2);
        assert!(!clearance.is_blocked_by(on_ring(85.0, 3.5)));
    }
}
