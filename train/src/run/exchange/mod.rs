//! Scenes as files of other programs: PLY, SPZ, glTF and OpenUSD, told by the ending.

pub mod host;
mod motion;

use std::path::Path;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use glam::{DMat3, DVec3};
use gs_burn::ply::{self, SplatRenderMode};
use gs_formats::{Law, Motion, Splats, glb, spz, turn, usda};

use super::scene::LoadedScene;

use host::{gaussians_of, splats_of};
pub use motion::{MotionScene, motion_of, time_function};

/// A format that is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// The layout of 3DGS.
    Ply,
    /// SPZ 3.
    Spz,
    /// Binary glTF with KHR_gaussian_splatting.
    Glb,
    /// OpenUSD as text.
    Usda,
}

impl Format {
    /// By the ending of a file's name.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "ply" => Some(Self::Ply),
            "spz" => Some(Self::Spz),
            "glb" => Some(Self::Glb),
            "usda" => Some(Self::Usda),
            _ => None,
        }
    }

    /// Whether one file holds a scene at all times.
    pub fn moves(self) -> bool {
        matches!(self, Self::Glb | Self::Usda)
    }
}

/// The endings that are written, for sentences.
pub const ENDINGS: &str = ".ply, .spz, .glb or .usda";

/// A scene on the host, as it goes into a file: in the data set's own world.
#[derive(Debug, Clone)]
pub struct Packed {
    /// The Gaussians: at one time, or at the middle of the recording.
    pub splats: Splats,
    /// How they move; `None`: at one time.
    pub motion: Option<Motion>,
    /// How many times OpenUSD samples the motion at.
    pub samples: usize,
}

impl Packed {
    /// A scene at time `t`, or at all times where there is none: at the middle of its recording, with its motion. One that is no series of
    /// functions of time has `samples` key frames.
    pub fn of(loaded: &LoadedScene, t: Option<f64>, samples: usize) -> Self {
        let motion = if t.is_none() { motion_of(&*loaded.scene, loaded.middle, samples) } else { None };
        // A file that says nothing of it may have been trained either way.
        let is_known = loaded.run.is_some() || loaded.render.antialiased;
        let antialiased = is_known.then_some(loaded.render.antialiased);
        let splats = splats_of(&loaded.scene.at(t.unwrap_or(loaded.middle)), antialiased);
        Self { splats, motion, samples }
    }

    /// Moved by `offset`, scene units.
    pub fn translated(mut self, offset: DVec3) -> Self {
        if offset == DVec3::ZERO {
            return self;
        }
        let shift = |mean: &mut [f32; 3]| {
            let moved = DVec3::from_array(mean.map(f64::from)) + offset;
            *mean = moved.to_array().map(|x| x as f32);
        };
        self.splats.means.iter_mut().for_each(shift);
        if let Some(Motion { law: Law::Keys(keys), .. }) = &mut self.motion {
            keys.means.iter_mut().for_each(shift);
        }
        self
    }

    /// Turned about the world's origin.
    pub fn turned(&self, rotation: DMat3) -> Self {
        let motion = self.motion.as_ref().map(|motion| turn::turn_motion(motion, rotation));
        Self { splats: turn::turn(&self.splats, rotation), motion, samples: self.samples }
    }

    /// With harmonics up to `degree` only.
    pub fn cut(self, degree: usize) -> Self {
        Self { splats: self.splats.cut(degree), ..self }
    }

    /// The Gaussians `rows` alone.
    pub fn select(&self, rows: &[u32]) -> Self {
        let motion = self.motion.as_ref().map(|motion| motion.select(rows));
        Self { splats: self.splats.select(rows), motion, samples: self.samples }
    }

    /// The Gaussians at the times that OpenUSD samples; none where nothing moves.
    fn sampled(&self) -> Vec<Splats> {
        let Some(motion) = &self.motion else { return Vec::new() };
        let [first, last] = motion.span;
        let step = (last - first) / (self.samples.max(2) - 1) as f64;
        (0..self.samples).map(|index| motion.at(&self.splats, first + step * index as f64)).collect()
    }

    /// How long the file is, bytes. Of PLY: its numbers, without the header of at most 2 kB.
    ///
    /// # Errors
    /// When the scene does not fit the format.
    pub fn length(&self, format: Format) -> Result<u64> {
        let length = match format {
            Format::Ply => self.splats.len() * 4 * (14 + 3 * self.splats.coefficients()),
            Format::Spz => spz::encode(&self.splats).map_err(anyhow::Error::msg)?.len(),
            Format::Glb => glb::encode(&self.splats, self.motion.as_ref(), false).map_err(anyhow::Error::msg)?.len(),
            Format::Usda => usda::encode(&self.splats, &self.sampled()).map_err(anyhow::Error::msg)?.len(),
        };
        Ok(length as u64)
    }

    /// The scene as a reader of the file finds it: SPZ rounds, the others keep every digit.
    ///
    /// # Errors
    /// When the scene does not fit the format.
    pub fn as_read(&self, format: Format) -> Result<Self> {
        if format != Format::Spz {
            return Ok(self.clone());
        }
        let splats = spz::encode(&self.splats).and_then(|bytes| spz::decode(&bytes)).map_err(anyhow::Error::msg)?;
        Ok(Self { splats, ..self.clone() })
    }

    /// Writes the file; makes its folder.
    ///
    /// # Errors
    /// One sentence that names the file; then no partial file is left.
    pub fn write(&self, path: &Path, format: Format, device: &Device) -> Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        }
        match format {
            Format::Ply => ply::write_ply_as(path, &gaussians_of(&self.splats, device), self.render_mode())?,
            Format::Spz => spz::write(path, &self.splats)?,
            Format::Glb => glb::write(path, &self.splats, self.motion.as_ref(), false)?,
            Format::Usda => usda::write(path, &self.splats, &self.sampled())?,
        }
        Ok(())
    }

    fn render_mode(&self) -> Option<SplatRenderMode> {
        self.splats.antialiased.map(render_mode)
    }
}

/// The comment of a PLY file.
pub fn render_mode(antialiased: bool) -> SplatRenderMode {
    if antialiased { SplatRenderMode::Mip } else { SplatRenderMode::Default }
}

/// Reads a file of Gaussians by its ending; `None` where it is another file.
///
/// # Errors
/// One sentence that names the file, what was expected and what was found.
pub fn read_packed(path: &Path, device: &Device) -> Result<Option<Packed>> {
    let still = |splats| Packed { splats, motion: None, samples: 0 };
    let Some(format) = Format::of(path).filter(|_| !path.is_dir()) else { return Ok(None) };
    Ok(Some(match format {
        Format::Ply => {
            let scene = ply::read_ply_scene(path, device)?;
            if scene.sh_degree > 3 {
                tracing::warn!(
                    "{}: spherical harmonics of degree {} were cut to degree 3",
                    path.display(),
                    scene.sh_degree
                );
            }
            if scene.render_mode == Some(SplatRenderMode::Flat) {
                tracing::warn!("{}: made for 2D Gaussians, which are drawn as thin 3D ones here", path.display());
            }
            let antialiased = scene.render_mode.map(|mode| mode == SplatRenderMode::Mip);
            still(splats_of(&scene.gaussians, antialiased))
        }
        Format::Spz => still(spz::read(path)?),
        Format::Glb => {
            let contents = glb::read(path)?;
            if contents.linear {
                tracing::warn!("{}: its colours are linear light, and are taken for encoded ones here", path.display());
            }
            Packed { splats: contents.splats, motion: contents.motion, samples: 0 }
        }
        Format::Usda => bail!("{}: OpenUSD is written and not read; expected .ply, .spz or .glb", path.display()),
    }))
}

/// Reads a file of Gaussians as a scene; `None` where it is another file.
///
/// # Errors
/// As [`read_packed`].
pub fn read_scene(path: &Path, device: &Device) -> Result<Option<LoadedScene>> {
    let Some(packed) = read_packed(path, device)? else { return Ok(None) };
    Ok(Some(scene_of(packed, device)))
}

/// What was read, as a scene.
pub fn scene_of(packed: Packed, device: &Device) -> LoadedScene {
    let gaussians = gaussians_of(&packed.splats, device);
    let mut loaded = LoadedScene::of_gaussians(gaussians);
    if let Some(antialiased) = packed.splats.antialiased {
        loaded.render.antialiased = antialiased;
    }
    if let Some(motion) = packed.motion {
        loaded.middle = motion.middle;
        loaded.scene = Box::new(MotionScene::new(packed.splats, motion, device));
    }
    loaded
}
