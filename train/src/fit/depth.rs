//! Depth priors of photos: brought into scene units by the points that photos show, compared with the depth that a
//! scene renders, and a source of first points.

use std::sync::Arc;

use burn::tensor::{Tensor, TensorData};
use gs_base::median;
use gs_burn::Rendering;
use gs_datasets::{PointCloud, View, surveyed};
use gs_models::depth_prior::{Alignment, DepthSpace, align, depth_loss};
use gs_multiview::Pinhole;
use rand::seq::index;

use super::parameters::to_host;
use super::photos::Extra;
use super::random::{Purpose, stream};

/// Least share of the points in a photo that an alignment of its prior must fit: those behind what the photo shows do
/// not, and are less than half of a reconstruction's.
const FITTED: f64 = 0.5;

/// Median ratio of metric depth and points beyond which the prior's unit is another than the scene's. LiDAR and a
/// reconstruction in metres agree within 2 %.
const UNIT: f64 = 1.1;

/// Least relative difference of the depths of neighbouring pixels between two surfaces: a point of their edge may lie
/// on either, or between them.
const EDGE: f32 = 0.05;

/// The depth priors of the training views.
#[derive(Debug, Default)]
pub struct Depths {
    /// Of the [`surveyed`] views, by index.
    shown: Vec<PhotoDepth>,
    /// The scene's points, where priors are read with the photos when they are asked for.
    on_demand: Option<PointCloud>,
}

impl Depths {
    /// The depth priors of views, in scene units where the scene's points tell how.
    pub fn of(views: &[View], points: Option<&PointCloud>) -> Self {
        let shown = surveyed(views).iter().map(|view| PhotoDepth::among(view, points)).collect();
        let is_on_demand = views.first().is_some_and(|view| view.source.is_some());
        Self { shown, on_demand: is_on_demand.then(|| points.cloned().unwrap_or_default()) }
    }

    /// The prior of the `index`-th view; none at a reduced width.
    pub fn of_view(&self, view: &View, index: usize) -> PhotoDepth {
        if let Some(points) = &self.on_demand {
            return PhotoDepth::among(view, Some(points));
        }
        let is_whole = view.priors.depth.is_some();
        self.shown.get(index).filter(|_| is_whole).cloned().unwrap_or_default()
    }

    /// `points`, filled up to `wanted` with pixels of the [`surveyed`] views whose priors are in scene units; `None`
    /// without any.
    pub fn with_points(
        &self,
        views: &[View],
        points: Option<&PointCloud>,
        wanted: usize,
        seed: u64,
    ) -> Option<PointCloud> {
        let mut points = points.cloned().unwrap_or_default();
        let pixels: Vec<(usize, Vec<u32>)> =
            self.shown.iter().enumerate().map(|(i, depth)| (i, depth.inner_pixels(&views[i]))).collect();
        let all: usize = pixels.iter().map(|(_, pixels)| pixels.len()).sum();
        let count = wanted.saturating_sub(points.len()).min(all);
        let mut chosen = index::sample(&mut stream(seed, Purpose::Init, 1), all, count).into_vec();
        chosen.sort_unstable();
        let (mut chosen, mut before) = (chosen.into_iter().peekable(), 0);
        for (view, pixels) in pixels {
            while let Some(place) = chosen.next_if(|place| *place < before + pixels.len()) {
                self.shown[view].push_point(&views[view], pixels[place - before] as usize, &mut points);
            }
            before += pixels.len();
        }
        (!points.is_empty()).then_some(points)
    }
}

/// Camera z of the points in a view, `[H * W]`, of the nearest in each pixel; 0 where there is none.
fn seen(view: &View, points: &PointCloud) -> Vec<f32> {
    let (camera, mut seen) = (Pinhole::new(view), vec![0.0; view.width * view.height]);
    for position in &points.positions {
        if let Some((pixel, z)) = camera.sees(glam::Vec3::from(*position).as_dvec3()) {
            let nearest: &mut f32 = &mut seen[pixel];
            *nearest = if *nearest == 0.0 { z as f32 } else { nearest.min(z as f32) };
        }
    }
    seen
}

/// The depth prior of a photo, on the host, where priors are aligned; without one nothing is compared.
#[derive(Debug, Clone, Default)]
pub struct PhotoDepth(Option<Prior>);

#[derive(Debug, Clone)]
struct Prior {
    /// `[H * W]`, 0 where unknown.
    values: Arc<Vec<f32>>,
    space: DepthSpace,
    /// Whether the numbers are camera z in scene units.
    metric: bool,
}

impl Prior {
    /// Whether points `[H * W]`, 0 where there is none, say that its numbers are not in scene units.
    fn is_of_another_unit(&self, seen: &[f32]) -> bool {
        let both = self.values.iter().zip(seen).filter(|(value, seen)| **value > 0.0 && **seen > 0.0);
        let ratio = median(both.map(|(value, seen)| f64::from(value / seen)).collect());
        ratio.is_some_and(|ratio| ratio.max(1.0 / ratio) > UNIT)
    }
}

impl PhotoDepth {
    /// The depth prior of a view. Pixels that its mask leaves out are unknown.
    pub fn of(view: &View) -> Self {
        let prior = |prior: &gs_datasets::DepthPrior| {
            let mut values = prior.values.clone();
            for (value, counts) in values.iter_mut().zip(view.mask.iter().flatten()) {
                if *counts == 0 {
                    *value = 0.0;
                }
            }
            Prior { values: Arc::new(values), space: in_space(prior.space), metric: prior.metric }
        };
        Self(view.priors.depth.as_ref().map(prior))
    }

    /// The depth prior of a view, in scene units where these points of the scene tell how.
    fn among(view: &View, points: Option<&PointCloud>) -> Self {
        let depth = Self::of(view);
        match points.filter(|_| depth.is_known()) {
            Some(points) => depth.placed(&seen(view, points)),
            None => depth,
        }
    }

    /// Whether there is one.
    pub fn is_known(&self) -> bool {
        self.0.is_some()
    }

    /// The prior in scene units by the depths of points `[H * W]`, 0 where there is none; as it is where they do not
    /// tell.
    fn placed(self, seen: &[f32]) -> Self {
        let Some(prior) = &self.0 else { return self };
        if prior.metric && !prior.is_of_another_unit(seen) {
            return self;
        }
        let Some(fit) = align(&prior.values, seen, None, prior.space).filter(|fit| fit.inliers >= FITTED) else {
            return self;
        };
        let values = Arc::new(fit.depth(&prior.values));
        Self(Some(Prior { values, space: DepthSpace::Depth, metric: true }))
    }

    /// The pixels whose depth is known in scene units and whose neighbours are of the same surface.
    fn inner_pixels(&self, view: &View) -> Vec<u32> {
        let Some(prior) = self.0.as_ref().filter(|prior| prior.metric) else { return Vec::new() };
        let depth = &prior.values;
        let (width, height) = (view.width, view.height);
        let is_inner = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let is_inside = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            let is_same = |other: usize| (depth[other] - depth[pixel]).abs() <= EDGE * depth[pixel];
            is_inside
                && depth[pixel] > 0.0
                && [pixel - 1, pixel + 1, pixel - width, pixel + width].map(is_same) == [true; 4]
        };
        (0..depth.len()).filter(|pixel| is_inner(*pixel)).map(|pixel| pixel as u32).collect()
    }

    /// Adds the point of a pixel, with the photo's colour.
    fn push_point(&self, view: &View, pixel: usize, points: &mut PointCloud) {
        let Some(prior) = &self.0 else { return };
        let (position, color) = view.point_at(pixel, f64::from(prior.values[pixel]));
        points.positions.push(position);
        points.colors.push(color);
    }

    /// Its numbers `[H, W, 1]` on the device of `like`, 0 where unknown, and their space, unless they are in scene
    /// units.
    pub fn relative(&self, like: &Tensor<3>) -> Option<(Tensor<3>, DepthSpace)> {
        let Prior { values, space, .. } = self.0.as_ref().filter(|prior| !prior.metric)?;
        Some((Tensor::from_data(TensorData::new(values.to_vec(), like.dims()), &like.device()), *space))
    }

    /// The prior as camera z in scene units, `[H, W, 1]`, 0 where unknown. One up to a scale and a shift is aligned
    /// with the rendered depth and alpha `[H, W, 1]`, unless `as_it_is`. `None` without a prior, or if nothing that was
    /// rendered fits it.
    pub fn aligned(&self, rendered: &Tensor<3>, alpha: &Tensor<3>, as_it_is: bool) -> Option<Tensor<3>> {
        let Prior { values, space, metric } = self.0.as_ref()?;
        let alignment = if *metric || as_it_is {
            Alignment { space: *space, scale: 1.0, shift: 0.0, inliers: 1.0, deviation: 0.0 }
        } else {
            let (rendered, alpha) = (to_host(rendered.clone().inner()), to_host(alpha.clone().inner()));
            align(values, &rendered, Some(&alpha), *space)?
        };
        Some(Tensor::from_data(TensorData::new(alignment.depth(values), rendered.dims()), &rendered.device()))
    }

    /// The mean difference of the logarithms of rendered and prior depth, `[1]`, over the pixels of `mask` `[H, W, 1]`
    /// (`None`: all); `None` where nothing can be compared.
    pub fn misfit(&self, rendering: &Rendering, mask: Option<&Tensor<3>>) -> Option<Tensor<1>> {
        let depth = rendering.expected_depth()?;
        let prior = self.aligned(&depth, &rendering.alpha, false)?;
        let counted = mask.map_or(prior.clone(), |mask| prior * mask.clone());
        Some(depth_loss(depth, counted))
    }
}

impl Extra for PhotoDepth {
    fn floats_per_pixel(&self) -> usize {
        usize::from(self.is_known())
    }
}

/// The space of a data set's depth as a type of `gs-models`.
pub fn in_space(space: gs_datasets::DepthSpace) -> DepthSpace {
    match space {
        gs_datasets::DepthSpace::Depth => DepthSpace::Depth,
        gs_datasets::DepthSpace::InverseDepth => DepthSpace::InverseDepth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat4, DVec3};

    /// A wall at depth 2 left of the middle and at depth 4 right of it, seen from the origin.
    fn view(depth: impl Fn(f32) -> f32, space: gs_datasets::DepthSpace, metric: bool) -> View {
        let mut view = View::blank(40, 30);
        let values = (0..40 * 30).map(|pixel| depth(truth(pixel))).collect();
        view.priors.depth = Some(gs_datasets::DepthPrior { values, space, metric });
        view
    }

    fn truth(pixel: usize) -> f32 {
        if pixel % 40 < 20 { 2.0 } else { 4.0 }
    }

    /// Every third pixel in space; a fifth of the points are behind what the photo shows.
    fn points(view: &View) -> PointCloud {
        let mut points = PointCloud::default();
        for (i, pixel) in (0..40 * 30).step_by(3).enumerate() {
            let ray = view.intrinsics.ray((pixel % 40) as f64 + 0.5, (pixel / 40) as f64 + 0.5);
            let behind = if i % 5 == 0 { 1.7 } else { 1.0 };
            points.positions.push((ray * f64::from(truth(pixel)) * behind).as_vec3().to_array());
            points.colors.push([0; 3]);
        }
        points
    }

    #[test]
    fn points_bring_priors_into_scene_units() {
        use gs_datasets::DepthSpace::{Depth, InverseDepth};
        let millimetres = view(|z| 1000.0 * z, Depth, true);
        let affine = view(|z| 0.3 * z + 0.1, Depth, false);
        let inverse = view(|z| 40.0 / z + 3.0, InverseDepth, false);
        for (name, view) in [("millimetres", millimetres), ("affine", affine), ("inverse", inverse)] {
            let depths = Depths::of(std::slice::from_ref(&view), Some(&points(&view)));
            let placed = depths.of_view(&view, 0).0.expect("a prior");
            assert!(placed.metric && placed.space == DepthSpace::Depth, "{name}");
            let off = placed.values.iter().enumerate().map(|(i, z)| (z - truth(i)).abs()).fold(0.0, f32::max);
            assert!(off < 1e-3, "{name}: {off}");
            assert!(!depths.of_view(&View::blank(20, 15), 0).is_known(), "a photo at a reduced width");
        }
        // Without points nothing tells; metric depth near the points' stays as it is.
        let kept = |view: View, has_points: bool| {
            let given = view.priors.depth.clone().expect("a prior").values;
            let points = points(&view);
            let depths = Depths::of(std::slice::from_ref(&view), has_points.then_some(&points));
            *depths.of_view(&view, 0).0.expect("a prior").values == given
        };
        assert!(kept(view(|z| 0.3 * z + 0.1, Depth, false), false));
        assert!(kept(view(|z| 1.02 * z, Depth, true), true));
        // A prior that the points contradict is not bent to them.
        assert!(kept(view(|z| 5.0 - z, Depth, false), true));
    }

    #[test]
    fn points_are_pixels_inside_of_surfaces() {
        let mut view = view(|z| z, gs_datasets::DepthSpace::Depth, true);
        view.c2w = DMat4::from_translation(DVec3::new(1.0, 0.0, 0.0));
        // A masked row says nothing.
        view.mask = Some((0..40 * 30).map(|pixel| if pixel / 40 == 10 { 0 } else { 255 }).collect());
        let views = [view];
        let depths = Depths::of(&views, None);
        let some = |wanted: usize| depths.with_points(&views, None, wanted, 1);
        let points = some(10_000).expect("points");
        // Without the border, the two columns at the step, and the masked row with its neighbours.
        assert_eq!(points.len(), (40 - 2 - 2) * (30 - 2 - 3));
        assert!(points.positions.iter().all(|p| (p[2] == 2.0 && p[0] < 1.0) || (p[2] == 4.0 && p[0] > 1.0)));
        assert_eq!(some(100).expect("points").len(), 100);
        assert_eq!(some(100), some(100));
        assert!(some(0).is_none());
    }
}
