//! Finished scenes: read, moved, pruned and written as PLY.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use burn::tensor::{Device, Tensor};
use glam::{DMat4, DVec3};
use gs_base::local::is_far;
use gs_base::{agree, counted, median};
use gs_burn::{Gaussians, RenderOptions};
use gs_datasets::PoseConvention;
use gs_models::{DynamicScene, Shutter, Static};
use gs_splats::{Splats, ply};

use super::checkpoint::Checkpoint;
use super::exchange::host::{gaussians_of, splats_of};
use super::exchange::{MotionScene, Packed, READ, motion_of, offset_note, read_packed};
use super::folder::{RunFolder, full_path};
use super::presentation::{Camera, Presentation, PresentedScene};
use crate::config::{Config, RenderConfig, brief};
use crate::fit::density::ops::Draft;
use crate::fit::facts::SceneFacts;

/// A scene from a file, with its metadata.
pub struct LoadedScene {
    /// The Gaussians without motion, `origin` subtracted.
    pub gaussians: Gaussians,
    /// The scene at any time.
    pub scene: Box<dyn DynamicScene>,
    /// Position that was subtracted from the data set's world, scene units.
    pub origin: DVec3,
    /// Values fixed by its data set.
    pub facts: SceneFacts,
    /// Options of its renderer.
    pub render: RenderConfig,
    /// The default time at which it is shown.
    pub middle: f64,
    /// How the photos' exposures are formed, if it has a blur model.
    pub shutter: Option<Shutter>,
    /// Its run; `None` for a PLY file.
    pub run: Option<SceneRun>,
}

/// The run of a checkpoint.
#[derive(Debug, Clone)]
pub struct SceneRun {
    /// Name of the pipeline.
    pub pipeline: String,
    /// The data set.
    pub dataset: PathBuf,
    /// The convention by which its poses were read, if it is not its format's own.
    pub poses: Option<PoseConvention>,
    /// Steps taken.
    pub step: usize,
    /// Lines about the method: name and value.
    pub described: Vec<(&'static str, String)>,
}

impl SceneRun {
    /// The convention by which poses in a file are read: in the data set's folder its own, else `None`.
    pub fn poses_in(&self, file: &Path) -> Option<PoseConvention> {
        let folder = if self.dataset.is_dir() { &self.dataset } else { self.dataset.parent()? };
        self.poses.filter(|_| full_path(file).starts_with(folder))
    }
}

/// The file of a scene.
pub enum SceneFile {
    /// A saved state.
    Checkpoint(Box<Checkpoint>),
    /// Gaussians of a PLY, SPZ or glTF file.
    Ply(Box<Packed>),
}

impl LoadedScene {
    /// A scene of Gaussians alone.
    pub fn of_gaussians(gaussians: Gaussians) -> Self {
        let config = Config::default();
        Self {
            scene: Box::new(Static::new(gaussians.clone())),
            gaussians,
            origin: DVec3::ZERO,
            facts: SceneFacts::unknown(&config),
            render: config.render,
            middle: 0.0,
            shutter: None,
            run: None,
        }
    }

    /// The scene of a file.
    pub fn of_packed(packed: Packed, device: &Device) -> Self {
        let mut loaded = Self::of_gaussians(gaussians_of(&packed.splats, device));
        loaded.origin = DVec3::from_array(packed.splats.offset);
        if let Some(antialiased) = packed.splats.antialiased {
            loaded.render.antialiased = antialiased;
        }
        if let Some(motion) = packed.motion {
            loaded.middle = motion.middle;
            loaded.scene = Box::new(MotionScene::new(packed.splats, motion, device));
        }
        loaded
    }

    /// The scene as a file holds it, of `gaussians` at a time; those of all times (`moves`) are at the middle of its
    /// recording, and have its motion. One that is no series of functions of time has `samples` key frames.
    pub fn packed(&self, gaussians: &Gaussians, moves: bool, samples: usize) -> Packed {
        let motion = if moves { motion_of(&*self.scene, self.middle, samples) } else { None };
        // A file that says nothing of it may have been trained either way.
        let is_known = self.run.is_some() || self.render.antialiased;
        let antialiased = is_known.then_some(self.render.antialiased);
        let splats = splats_of(gaussians, antialiased);
        Packed { splats: Splats { offset: self.origin.to_array(), ..splats }, motion, samples }
    }

    /// The scene as it is shown with these cameras.
    pub fn presented(self, name: &str, cameras: Vec<Camera>) -> PresentedScene {
        let presentation = Presentation {
            name: name.into(),
            options: self.render_options(self.gaussians.sh_degree()),
            middle: self.middle,
            cameras,
            distance: self.facts.subject_distance,
            shutter: self.shutter,
            world: DMat4::from_translation(self.origin),
        };
        PresentedScene { scene: self.scene, presentation }
    }

    /// The options of a rendering at an SH degree.
    pub fn render_options(&self, sh_degree: usize) -> RenderOptions {
        self.facts.render_options(&self.render, sh_degree)
    }

    /// `count` times spread evenly over the recording, both ends included.
    pub fn times(&self, count: usize) -> Vec<f64> {
        let Some([first, last]) = self.scene.span() else { return vec![0.0; count] };
        let step = (last - first) / (count.max(2) - 1) as f64;
        (0..count).map(|i| first + step * i as f64).collect()
    }

    /// Warns once about times outside the recording: a path is an expansion, and diverges outside the window it was
    /// fitted in.
    pub fn warn_outside(&self, times: impl IntoIterator<Item = f64>) {
        let Some(span) = self.scene.span() else { return };
        if let Some(warning) = outside(&times.into_iter().collect::<Vec<_>>(), span) {
            tracing::warn!("{warning}");
        }
    }

    /// Checks that the scene has times.
    ///
    /// # Errors
    /// A sentence, for a static scene.
    pub fn moves(&self, path: &Path) -> Result<()> {
        if self.scene.span().is_none() {
            bail!(
                "{}: expected a scene that moves for --time or --frames, found one that stands still (a PLY file is one moment)",
                path.display()
            );
        }
        Ok(())
    }
}

/// A sentence about times outside a recording; `None` without any.
pub fn outside(times: &[f64], [first, last]: [f64; 2]) -> Option<String> {
    let outside = || times.iter().filter(|t| !(first..=last).contains(*t));
    let (t, count) = (outside().next()?, outside().count());
    let (times, lie) = (counted(count, "time"), agree(count, "lies", "lie"));
    let [first, last, t] = [first, last, *t].map(brief);
    Some(format!("{times} {lie} outside the recording, which is from {first} to {last}: {t} is the first"))
}

/// Checks that `scene` can be asked at `times`; `what` says where they come from.
///
/// # Errors
/// A sentence about the first time out of reach.
pub fn within_reach(scene: &dyn DynamicScene, what: &str, times: impl IntoIterator<Item = f64>) -> Result<()> {
    let Some([first, last]) = scene.reach() else { return Ok(()) };
    // NaN lies in no range.
    match times.into_iter().find(|time| !(first..=last).contains(time)) {
        Some(time) => {
            let [first, last, time] = [first, last, time].map(brief);
            bail!("{what}: expected times from {first} to {last}, as far as motion can be integrated, found {time}")
        }
        None => Ok(()),
    }
}

/// Reads a run folder's newest checkpoint, a checkpoint (`.safetensors`), or the Gaussians of a PLY, SPZ or glTF file.
///
/// # Errors
/// A sentence naming the file, what was expected and what was found.
pub fn read_file(path: &Path) -> Result<SceneFile> {
    if !path.exists() {
        bail!("{}: expected a run folder, a checkpoint or a PLY file, found nothing", path.display());
    }
    let checkpoint =
        |path: &Path| -> Result<SceneFile> { Ok(SceneFile::Checkpoint(Box::new(Checkpoint::load(path)?))) };
    if path.is_dir()
        && let Some((_, newest)) = RunFolder::at(path).saved().pop()
    {
        return checkpoint(&newest);
    }
    if path.extension().is_some_and(|extension| extension == "safetensors") {
        return checkpoint(path);
    }
    match read_packed(path)? {
        Some(packed) => Ok(SceneFile::Ply(Box::new(packed))),
        None if path.is_dir() => bail!("{}: expected a run folder with a checkpoint, found none", path.display()),
        None => {
            bail!("{}: expected a run folder, a .safetensors checkpoint or a scene ({READ})", path.display())
        }
    }
}

/// Writes Gaussians as PLY: in the data set's own world, or, where `origin` is far from it, in local positions with an
/// offset. Creates the folder if there is none.
///
/// # Errors
/// When the file cannot be written, one sentence that names it; then no partial file is left.
pub fn write_ply(path: &Path, gaussians: &Gaussians, origin: DVec3) -> Result<()> {
    write_ply_as(path, gaussians, origin, None)
}

/// [`write_ply`] with a comment that says whether the scene is to be drawn with antialiasing, where that is known.
///
/// # Errors
/// As [`write_ply`].
pub fn write_ply_as(path: &Path, gaussians: &Gaussians, origin: DVec3, antialiased: Option<bool>) -> Result<()> {
    let splats = if is_far(origin.to_array()) {
        Splats { offset: origin.to_array(), ..splats_of(gaussians, antialiased) }
    } else {
        splats_of(&translated(gaussians, origin), antialiased)
    };
    ply::write(path, &splats).context("cannot write the scene")
}

/// The note on the positions of a file that [`write_ply`] wrote with this `origin`; `None` where they are the world's.
pub fn placed_note(origin: DVec3) -> Option<String> {
    offset_note(origin.to_array()).filter(|_| is_far(origin.to_array()))
}

/// The Gaussians moved by `offset`, scene units.
pub fn translated(gaussians: &Gaussians, offset: DVec3) -> Gaussians {
    if offset == DVec3::ZERO {
        return gaussians.clone();
    }
    let means = gaussians.means.val().inner();
    let offset = Tensor::<1>::from_floats(offset.as_vec3().to_array(), &means.device()).unsqueeze::<2>();
    let [quats, log_scales] = [&gaussians.quats, &gaussians.log_scales].map(|p| p.val().inner());
    let (opacities, sh) = (gaussians.opacity_logits.val().inner(), gaussians.sh.val().inner());
    Gaussians::from_tensors(means + offset, quats, log_scales, opacities, sh)
}

/// Thresholds of [`no_floaters`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloaterFilter {
    /// Gaussians of lower opacity are removed.
    pub min_opacity: f64,
    /// Gaussians whose largest scale is more than this many times the median largest scale are removed.
    pub max_size: f64,
    /// Gaussians whose eighth-nearest neighbour is farther than this many times the median such distance are removed.
    pub max_gap: f64,
}

impl Default for FloaterFilter {
    fn default() -> Self {
        Self { min_opacity: 0.02, max_size: 50.0, max_gap: 20.0 }
    }
}

/// The rows that are neither nearly transparent nor oversized nor isolated.
pub fn no_floaters(gaussians: &Gaussians, filter: &FloaterFilter) -> Vec<u32> {
    use kiddo::{ImmutableKdTree, SquaredEuclidean};
    use rayon::prelude::*;

    let draft = Draft::read(gaussians);
    let rows = draft.len();
    if rows == 0 {
        return Vec::new();
    }
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&draft.means);
    let wanted = std::num::NonZero::new(9).expect("a positive constant");
    let gaps: Vec<f64> = draft
        .means
        .par_iter()
        .map(|mean| {
            tree.nearest_n::<SquaredEuclidean>(mean, wanted).last().map_or(0.0, |n| f64::from(n.distance).sqrt())
        })
        .collect();
    let sizes: Vec<f64> = (0..rows).map(|row| draft.size(row)).collect();
    let times = |factor: f64, values: &[f64]| factor * median(values.to_vec()).expect("there are Gaussians");
    let (largest, widest) = (times(filter.max_size, &sizes), times(filter.max_gap, &gaps));
    (0..rows)
        .filter(|row| draft.opacity(*row) >= filter.min_opacity && sizes[*row] <= largest && gaps[*row] <= widest)
        .map(|row| row as u32)
        .collect()
}
