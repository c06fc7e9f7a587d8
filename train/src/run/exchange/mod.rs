//! Scenes as files of other programs: PLY, SPZ, glTF and OpenUSD, told by the ending; `.splat`, `.ksplat`
//! and SOG are read.

mod foreign;
pub mod host;
mod motion;
mod spare;

use std::path::Path;

use anyhow::{Result, bail};
use glam::{DMat3, DVec3};
use gs_base::local::is_far;
use gs_base::{agree, counted};
use gs_splats::ply::{self, SplatRenderMode};
use gs_splats::{Motion, Splats, glb, ksplat, sog, splat, spz, turn, usda};

use crate::fit::region::Region;
use foreign::refuse_foreign;
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

/// The endings that are read, for sentences.
pub const READ: &str = ".ply, .spz, .glb, .sog, .splat or .ksplat";

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
    /// With an offset that is near zero added to the positions: only one that an `f32` cannot hold beside them stays
    /// apart.
    pub fn placed(self) -> Self {
        if is_far(self.splats.offset) { self } else { self.relative_to([0.0; 3]) }
    }

    /// With positions relative to another offset.
    fn relative_to(mut self, offset: [f64; 3]) -> Self {
        let shift = DVec3::from_array(self.splats.offset) - DVec3::from_array(offset);
        if shift != DVec3::ZERO {
            self.splats.means.iter_mut().for_each(|mean| *mean = turn::moved(*mean, shift));
            self.motion.iter_mut().for_each(|motion| turn::shift_motion(motion, shift));
        }
        self.splats.offset = offset;
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

    /// The rows in a region; of a motion those that are in it at any of the times that OpenUSD samples.
    pub fn within(&self, region: &Region) -> Vec<u32> {
        let frames = self.sampled();
        let is_inside = |row: &u32| {
            let mut all = frames.iter().chain([&self.splats]);
            all.any(|frame| region.contains(frame.means[*row as usize]))
        };
        (0..self.splats.len() as u32).filter(is_inside).collect()
    }

    /// The Gaussians at the times that OpenUSD samples; none where nothing moves.
    fn sampled(&self) -> Vec<Splats> {
        let Some(motion) = &self.motion else { return Vec::new() };
        let [first, last] = motion.span;
        let step = (last - first) / (self.samples.max(2) - 1) as f64;
        (0..self.samples).map(|index| motion.at(&self.splats, first + step * index as f64)).collect()
    }

    /// How long the file is, bytes.
    ///
    /// # Errors
    /// When the scene does not fit the format.
    pub fn length(&self, format: Format) -> Result<u64> {
        let length = match format {
            Format::Ply => ply::encoded_len(&self.splats),
            Format::Spz => spz::encode(&self.splats).map_err(anyhow::Error::msg)?.len(),
            Format::Glb => glb::encode(&self.splats, self.motion.as_ref(), false).map_err(anyhow::Error::msg)?.len(),
            Format::Usda => usda::encode(&self.splats, &self.sampled()).map_err(anyhow::Error::msg)?.len(),
        };
        Ok(length as u64)
    }

    /// The scene as a reader of the file finds it, relative to its own offset: SPZ rounds, the others keep every digit.
    ///
    /// # Errors
    /// When the scene does not fit the format.
    pub fn as_read(&self, format: Format) -> Result<Self> {
        if format != Format::Spz {
            return Ok(self.clone());
        }
        let splats = spz::encode(&self.splats).and_then(|bytes| spz::decode(&bytes)).map_err(anyhow::Error::msg)?;
        Ok(Self { splats, motion: None, samples: self.samples }.relative_to(self.splats.offset))
    }

    /// Writes the file; makes its folder.
    ///
    /// # Errors
    /// One sentence that names the file; then no partial file is left.
    pub fn write(&self, path: &Path, format: Format) -> Result<()> {
        match format {
            Format::Ply => ply::write(path, &self.splats)?,
            Format::Spz => spz::write(path, &self.splats)?,
            Format::Glb => glb::write(path, &self.splats, self.motion.as_ref(), false)?,
            Format::Usda => usda::write(path, &self.splats, &self.sampled())?,
        }
        Ok(())
    }
}

/// The note on an offset, for the sentence on a file; `None` where there is none.
pub fn offset_note(offset: [f64; 3]) -> Option<String> {
    let [x, y, z] = offset;
    (offset != [0.0; 3]).then(|| format!("positions are relative to ({x}, {y}, {z}), which the file names"))
}

/// Reads a file of Gaussians by its ending, or a folder of SOG; `None` where it is another file. Rows that are no
/// Gaussians are left out, which is said.
///
/// # Errors
/// One sentence that names the file, what was expected and what was found.
pub fn read_packed(path: &Path) -> Result<Option<Packed>> {
    refuse_foreign(path)?;
    let still = |splats| Packed { splats, motion: None, samples: 0 };
    let of_viewer = match path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("splat") => Some(splat::read(path)?),
        Some("ksplat") => Some(ksplat::read(path)?),
        Some("sog") => Some(sog::read(path)?),
        _ if path.ends_with(sog::DESCRIPTION) => Some(sog::read(path)?),
        _ if path.join(sog::DESCRIPTION).is_file() => Some(sog::read(&path.join(sog::DESCRIPTION))?),
        _ => None,
    };
    if let Some(splats) = of_viewer {
        return sound(path, still(splats)).map(Some);
    }
    let Some(format) = Format::of(path).filter(|_| !path.is_dir()) else { return Ok(None) };
    let packed = match format {
        Format::Ply => still(read_ply(path)?),
        Format::Spz => still(spz::read(path)?),
        Format::Glb => {
            let contents = glb::read(path)?;
            if contents.linear {
                tracing::warn!("{}: its colours are linear light, and are taken for encoded ones here", path.display());
            }
            Packed { splats: contents.splats, motion: contents.motion, samples: 0 }
        }
        Format::Usda => bail!("{}: OpenUSD is written and not read; expected {READ}", path.display()),
    };
    sound(path, packed).map(Some)
}

fn read_ply(path: &Path) -> Result<Splats> {
    let scene = ply::read(path)?;
    if let Some(left_out) = &scene.left_out {
        tracing::warn!("{}: {left_out}", path.display());
    }
    if scene.sh_degree > 3 {
        tracing::warn!("{}: spherical harmonics of degree {} were cut to degree 3", path.display(), scene.sh_degree);
    }
    if scene.render_mode == Some(SplatRenderMode::Flat) {
        tracing::warn!("{}: made for 2D Gaussians, which are drawn as thin 3D ones here", path.display());
    }
    Ok(scene.splats)
}

/// Without rows that are no Gaussians: numbers that are not finite, or a rotation of four zeros.
fn sound(path: &Path, packed: Packed) -> Result<Packed> {
    let broken = packed.splats.broken();
    let (Some(first), Some(last)) = (broken.first(), broken.last()) else { return Ok(packed) };
    let (count, all) = (broken.len(), packed.splats.len());
    let rows = counted(count, "row");
    let why = "no rotation (four zeros) or a number that is not finite";
    if count == all {
        bail!("{}: expected Gaussians, found {rows} with {why}", path.display());
    }
    tracing::warn!(
        "{}: {rows} of {all} {} {why} and {} left out: between row {first} and row {last}",
        path.display(),
        agree(count, "has", "have"),
        agree(count, "was", "were")
    );
    Ok(packed.select(&spare::others(all, &broken)))
}
