//! Gaussians compared with the true velocity of the surface they lie on.

use glam::DVec3;
use gs_datasets::{Scene, View};
use gs_models::taylormode::TaylorScene;
use gs_multiview::Pinhole;
use gs_train::fit::parameters::to_host;

/// A Gaussian lies on the visible surface if its depth is the true one up to this share: a tenth of a metre in the
/// small worlds, a third of the objects' half width. Gaussians inside an object are visible in no photo, and nothing
/// constrains them.
const ON_SURFACE: f64 = 0.03;

/// Opacity below which a Gaussian has little effect on any photo.
const OPACITY_SEEN: f32 = 0.1;

/// A Gaussian's velocity and the true one, scene units per unit of time.
#[derive(Debug, Clone, Copy)]
pub struct Compared {
    /// Velocity of the Gaussian.
    pub found: DVec3,
    /// Velocity of the surface at its position.
    pub truth: DVec3,
}

/// Velocities of every moving Gaussian on a moving surface, in a training photo at `t`, whose truth must be loaded.
pub fn on_surface(model: &TaylorScene, scene: &Scene, t: f64) -> Vec<Compared> {
    let (rows, paths) = (&model.motion.rows, model.paths());
    let means = to_host(paths.means_at(model.gaussians.means.val(), t));
    let velocities = to_host(paths.velocity(t));
    let opacities = to_host(model.gaussians.opacities());
    let vector = |values: &[f32], row: usize| glam::Vec3::from_slice(&values[3 * row..]).as_dvec3();
    let views: Vec<&View> = scene.train.iter().filter(|view| view.time.is_some_and(|x| (x - t).abs() < 1e-9)).collect();
    let compare = |(index, row): (usize, &u32)| {
        let row = *row as usize;
        let truth = views.iter().find_map(|view| velocity_at(view, vector(&means, row)))?;
        (opacities[row] > OPACITY_SEEN).then(|| Compared { found: vector(&velocities, index), truth })
    };
    rows.iter().enumerate().filter_map(compare).collect()
}

/// The true velocity at a position on the visible moving surface.
fn velocity_at(view: &View, position: DVec3) -> Option<DVec3> {
    let truth = &view.truth;
    let (moving, depth, velocity) = (truth.moving.as_ref()?, truth.depth.as_ref()?, truth.velocity.as_ref()?);
    let (pixel, z) = Pinhole::new(view).sees(position)?;
    let near = (z - f64::from(depth[pixel])).abs() <= ON_SURFACE * z;
    (moving[pixel] > 0 && near).then(|| glam::Vec3::from_slice(&velocity[3 * pixel..]).as_dvec3())
}
