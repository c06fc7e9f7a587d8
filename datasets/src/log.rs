//! A data set whose frames are described first and decoded when asked: [`Log`].
//!
//! [`check`](crate::check()) does not go through a log: a log ends at the first error of its description, and `check`
//! lists all of them.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use glam::{DMat4, DVec3};
use gs_base::sentence::shown;
use gs_base::{Intrinsics, counted, printable};
use rayon::prelude::*;

use crate::consistency;
use crate::decode::Decoder;
use crate::description::{Description, check_options};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats;
use crate::frame::View;
use crate::notes::ViewNote;
use crate::options::LoadOptions;
use crate::raw::RawFrame;
use crate::scene::{PointCloud, SceneFormat, Split};
use crate::split::{self, SplitPlan};

/// A frame before its image is decoded.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameDescription {
    /// As [`View::name`].
    pub name: String,
    /// The split that the frame is in: [`Split::TRAIN`], or the name of a held-out split.
    pub split: String,
    /// As [`View::time`].
    pub time: Option<f64>,
    /// As [`View::camera_id`].
    pub camera_id: Option<String>,
    /// As [`View::c2w`].
    pub c2w: DMat4,
    /// Width and height that the view will have, pixels; `None` where the header of the image cannot be read.
    pub size: Option<(usize, usize)>,
    /// The view's intrinsics; `None` where the size is not known or contradicts the camera. Decoding then says why.
    pub intrinsics: Option<Intrinsics>,
    /// The image file; several views of a wide photo have one.
    pub image_path: PathBuf,
    /// As [`View::exposure`].
    pub exposure: Option<f64>,
}

/// Frames that are described, and decoded when asked. A reader of another kind of log implements it for the photos of
/// that log, and everything that serves frames (see [`LogCache`](crate::LogCache)) serves them too. Sweeps of a LiDAR
/// are not frames: they have times, poses and sizes of their own, so a reader of a log with sweeps offers them beside
/// this trait and not through it.
pub trait FrameSource: Sync {
    /// All frames. Their order does not change.
    fn frames(&self) -> &[FrameDescription];

    /// Decodes the frame at `index` of [`frames`](FrameSource::frames). May be called from several threads at once.
    ///
    /// # Errors
    /// When a file of the frame is missing or broken.
    ///
    /// # Panics
    /// When there is no frame at `index`.
    fn decode(&self, index: usize) -> Result<View, DatasetError>;
}

/// A data set in any layout that [`load`](crate::load) reads, described but not decoded. It holds descriptions and the
/// points to start from, and no pixel.
///
/// Frames come split by split, training frames first, sorted by name in each, as in a [`Scene`](crate::Scene); the view
/// of a frame is the one that `load` gives, to the bit.
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    format: SceneFormat,
    raw: Vec<RawFrame>,
    frames: Vec<FrameDescription>,
    /// Training frames first; the ranges follow each other.
    splits: Vec<(String, Range<usize>)>,
    points: Option<PointCloud>,
    decoder: Decoder,
    warnings: Vec<String>,
    disagreements: Vec<String>,
    /// Whether any mask of moving objects marks a pixel; found when the first mask that marks none is decoded.
    marks_motion: OnceLock<bool>,
}

impl Log {
    /// Describes the data set at `path`. Of images only the headers are read, for their sizes: an image that is cut
    /// short or missing is an error when it is decoded.
    ///
    /// # Errors
    /// As [`load`](crate::load), without the errors of images and masks.
    pub fn open(path: &Path, options: &LoadOptions) -> Result<Self, DatasetError> {
        let (mut log, mut findings) = Self::describe(path, options)?;
        findings.warn_all(log.disagreements());
        findings.log();
        log.warnings = findings.take_warnings();
        Ok(log)
    }

    /// [`open`](Log::open) without a word of its findings, for a second look at a data set.
    ///
    /// # Errors
    /// As [`open`](Log::open).
    pub fn describe_quietly(path: &Path, options: &LoadOptions) -> Result<Self, DatasetError> {
        Ok(Self::describe(path, options)?.0)
    }

    /// The log, and the findings of its description, which are not yet logged.
    pub(crate) fn describe(path: &Path, options: &LoadOptions) -> Result<(Self, Findings), DatasetError> {
        check_options(path, options)?;
        let mut findings = Findings::default();
        let raw = formats::read(path, options, &mut findings)?;
        let description = Description::of(raw, path, options, &mut findings)?;
        let plan = split::plan(&description.frames, options, path)?;
        if options.sparse.is_some() && description.points.is_some() {
            findings.warn_all(split::hidden_points(&description.frames, &plan, path));
        }
        let log = Self::of(description, &plan, path, options);
        let mut counts = log.splits().map(|(name, frames)| (name, frames.len()));
        let train = counts.next().map_or(0, |(_, count)| count);
        let held_out = format!("held out: {} ({})", split::counts(counts), plan.rule);
        tracing::info!("{}: {}, {}", shown(path), counted(train, "training view"), printable(&held_out));
        Ok((log, findings))
    }

    fn of(description: Description, plan: &SplitPlan, path: &Path, options: &LoadOptions) -> Self {
        let points = description.point_cloud();
        let mut by_index: Vec<Option<RawFrame>> = description.frames.into_iter().map(Some).collect();
        let (mut raw, mut splits) = (Vec::new(), Vec::new());
        let train = std::iter::once((Split::TRAIN, &plan.train));
        for (name, list) in train.chain(plan.held_out.iter().map(|(name, list)| (name.as_str(), list))) {
            let start = raw.len();
            let photos = list.iter().filter_map(|index| by_index[*index].take()).collect();
            raw.extend(description.decoder.frames(photos));
            splits.push((name.to_string(), start..raw.len()));
        }
        let trains = splits[0].1.len();
        if !plan.held_out.is_empty() && !options.training_truth {
            raw[..trains].iter_mut().for_each(|frame| frame.sides.files.retain(|file| file.kind.is_prior()));
        }
        let decoder = description.decoder;
        let frames = splits
            .iter()
            .flat_map(|(name, range)| range.clone().map(move |index| (name, index)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|(split, index)| describe(&raw[index], split, &decoder))
            .collect();
        let all: Vec<&RawFrame> = raw.iter().collect();
        let disagreements =
            consistency::compare_splits(&all[..trains], &all[trains..], options.expects_later_frames(), path);
        Self {
            path: path.to_path_buf(),
            format: description.format,
            frames,
            splits,
            points,
            decoder,
            warnings: Vec::new(),
            disagreements,
            marks_motion: OnceLock::new(),
            raw,
        }
    }

    /// The path given to [`open`](Log::open).
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The layout that was read.
    pub fn format(&self) -> SceneFormat {
        self.format
    }

    /// All frames, split by split.
    pub fn frames(&self) -> &[FrameDescription] {
        &self.frames
    }

    /// Names of the splits and the indices of their frames, training frames first.
    pub fn splits(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        self.splits.iter().map(|(name, range)| (name.as_str(), range.clone()))
    }

    /// Points to start from, where the data set has them.
    pub fn points(&self) -> Option<&PointCloud> {
        self.points.as_ref()
    }

    /// The vector that was subtracted from every position, as [`Scene::origin`](crate::Scene::origin).
    pub fn origin(&self) -> DVec3 {
        self.decoder.origin
    }

    /// Repairs and omissions while frames were described, in sentences.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Contradictions between training and held-out frames, in sentences.
    pub(crate) fn disagreements(&self) -> impl Iterator<Item = &str> {
        self.disagreements.iter().map(String::as_str)
    }

    /// Decodes one frame, see [`FrameSource::decode`].
    ///
    /// # Errors
    /// When its image or a mask is missing or broken, or contradicts its camera. Priors and truth that cannot be read
    /// are left out.
    ///
    /// # Panics
    /// When there is no frame at `index`.
    pub fn decode(&self, index: usize) -> Result<View, DatasetError> {
        let (mut view, note) = self.decode_noted(index, None)?;
        if note.sides.moving_share == Some(0.0) && !self.marks_motion() {
            view.priors.moving = None;
        }
        Ok(view)
    }

    /// The view, at a share of its width where one is given, without the rule that masks of moving objects are left out
    /// where all of them are black.
    pub(crate) fn decode_noted(&self, index: usize, share: Option<f64>) -> Result<(View, ViewNote), DatasetError> {
        let narrow = |share: f64| Some((share * self.frames[index].size?.0 as f64) as usize);
        let max_width = share.filter(|share| *share < 1.0).and_then(narrow).map(|width| width.max(1));
        let decoder = Decoder { max_width: max_width.or(self.decoder.max_width), ..self.decoder.clone() };
        let (mut view, note) = decoder.view(&self.raw[index])?;
        if !self.splits[0].1.contains(&index) {
            compare_with_sharp(&mut view);
        }
        Ok((view, note))
    }

    /// Memory that all views take, bytes, without the alpha that only a decoded file has.
    pub(crate) fn bytes(&self) -> usize {
        let bytes = |(frame, raw): (&FrameDescription, &RawFrame)| {
            let (width, height) = frame.size.unwrap_or_default();
            width * height * raw.bytes_per_pixel()
        };
        self.frames.par_iter().zip(&self.raw).map(bytes).sum()
    }

    fn marks_motion(&self) -> bool {
        *self.marks_motion.get_or_init(|| self.raw.iter().any(|frame| self.decoder.marks_motion(frame)))
    }
}

impl FrameSource for Log {
    fn frames(&self) -> &[FrameDescription] {
        Log::frames(self)
    }

    fn decode(&self, index: usize) -> Result<View, DatasetError> {
        Log::decode(self, index)
    }
}

impl<S: FrameSource + Send> FrameSource for Arc<S> {
    fn frames(&self) -> &[FrameDescription] {
        (**self).frames()
    }

    fn decode(&self, index: usize) -> Result<View, DatasetError> {
        (**self).decode(index)
    }
}

fn describe(frame: &RawFrame, split: &str, decoder: &Decoder) -> FrameDescription {
    let size = decoder.ideal_size(frame);
    FrameDescription {
        name: frame.name.clone(),
        split: split.to_string(),
        time: frame.time,
        camera_id: frame.camera_id.clone(),
        c2w: decoder.c2w(frame),
        size: size.map(|size| decoder.target(size)),
        intrinsics: size.and_then(|size| decoder.intrinsics(frame, size)),
        image_path: frame.image_path.clone(),
        exposure: frame.exposure,
    }
}

/// Puts the sharp truth of a blurry held-out view in place of its image: a sharp scene is measured against it.
fn compare_with_sharp(view: &mut View) {
    if let Some(sharp) = view.truth.sharp.take() {
        let blurry = std::mem::replace(&mut view.image, sharp);
        view.fine = None;
        view.truth.blurry.get_or_insert(blurry);
    }
}
