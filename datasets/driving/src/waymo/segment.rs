//! [`Segment`]: frames, images, sweeps and boxes of a segment of either version.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_base::{FileError, counted};
use gs_datasets::{DatasetError, RgbImage8, Undistortion, decode_photo, some_names};

use super::calibration::OPENCV;
use super::modular::Modular;
use super::names;
use super::parts::{BoxPart, CAMERAS, FramePart, LABELS, LASERS, Parts, Scan, name};
use super::range::{Points, seconds};
use super::record::Records;
use crate::boxes::{self, Boxed};
use crate::description::{Description, Frame, Shot, centred, without};
use crate::options::LogOptions;
use crate::sweep::{Cuboid, ObjectClass, Sweep};

/// Where a segment is read from.
#[derive(Debug)]
enum Source {
    Modular(Box<Modular>),
    Records(Records),
}

/// A segment.
#[derive(Debug)]
pub(crate) struct Segment {
    parts: Parts,
    source: Source,
    /// Numbers and lenses of the cameras of the description.
    cameras: Vec<(i64, Option<Undistortion>)>,
    max_width: Option<usize>,
    /// Whether second returns are points too.
    pub with_second_returns: bool,
}

impl Segment {
    /// Describes the segment at a path of [`names::is_segment`].
    ///
    /// # Errors
    /// One sentence: several segments, a missing component, a broken file, a lens that cannot be undistorted.
    pub fn open(path: &Path, options: &LogOptions) -> Result<(Self, Description), DatasetError> {
        let (parts, source) = if path.is_dir() {
            let found = names::segments(path);
            let [name] = &found[..] else { return Err(several(path, &found)) };
            let (parts, source) = Modular::open(path, name)?;
            (parts, Source::Modular(Box::new(source)))
        } else if let Some(name) = stem(path, names::PARQUET) {
            let root = path.parent().and_then(Path::parent).unwrap_or(Path::new(""));
            let (parts, source) = Modular::open(root, &name)?;
            (parts, Source::Modular(Box::new(source)))
        } else {
            let (parts, source) = Records::open(path)?;
            (parts, Source::Records(source))
        };
        let Some(first) = parts.frames.first() else {
            return Err(DatasetError::NoFrames { path: path.to_path_buf(), found: "no frame".to_string() });
        };
        let origin = first.pose.w_axis.truncate();
        let mut segment =
            Self { parts, source, cameras: Vec::new(), max_width: options.max_width, with_second_returns: false };
        let description = segment.describe(origin, options)?;
        Ok((segment, description))
    }

    /// The file with images, and the file with range images.
    fn files(&self) -> (PathBuf, PathBuf) {
        match &self.source {
            Source::Modular(source) => (source.images(), source.lidar()),
            Source::Records(source) => (source.path().to_path_buf(), source.path().to_path_buf()),
        }
    }

    fn describe(&mut self, origin: DVec3, options: &LogOptions) -> Result<Description, DatasetError> {
        let (images, _) = self.files();
        let mut warnings = std::mem::take(&mut self.parts.warnings);
        let (mut cameras, mut silent) = (Vec::new(), Vec::new());
        for (number, calibration) in &self.parts.cameras {
            let name = name(&CAMERAS, *number).unwrap_or_default();
            if !options.cameras.takes(name) {
                continue;
            }
            if !self.parts.frames.iter().any(|frame| frame.images.contains_key(number)) {
                silent.push(name);
                continue;
            }
            let (camera, lens) = calibration.camera(name, options.max_width).map_err(|found| {
                let expected = "a lens whose image is filled by focal lengths of at most twice its own";
                DatasetError::malformed(&images, format!("the calibration of {name}"), expected, found)
            })?;
            cameras.push(camera);
            self.cameras.push((*number, lens));
        }
        warnings.extend(without("an image", "camera", &silent));
        let dark: Vec<String> =
            self.parts.frames.iter().filter(|frame| !frame.has_sweep).map(|frame| frame.stamp.to_string()).collect();
        warnings.extend(without("a sweep", "frame", &dark));
        let shot = |frame: &FramePart, number: &i64| {
            let image = frame.images.get(number)?;
            let c2w = centred(image.pose * self.parts.cameras.get(number)?.extrinsic * OPENCV, origin);
            Some(Shot { time: image.time, c2w, image: Some(images.clone()) })
        };
        let frames = self.parts.frames.iter().map(|frame| Frame {
            name: frame.stamp.to_string(),
            time: seconds(frame.stamp),
            has_sweep: frame.has_sweep,
            ego: centred(frame.pose, origin),
        });
        let shots =
            self.parts.frames.iter().map(|frame| self.cameras.iter().map(|(number, _)| shot(frame, number)).collect());
        Ok(Description {
            name: self.parts.name.clone(),
            origin,
            frames: frames.collect(),
            shots: shots.collect(),
            cameras,
            warnings,
        })
    }

    /// Decodes an image and removes its distortion. The camera is that of the description.
    pub fn image(&self, frame: usize, camera: usize) -> Result<RgbImage8, DatasetError> {
        let (number, lens) = &self.cameras[camera];
        let stamp = self.parts.frames[frame].stamp;
        let bytes = match &self.source {
            Source::Modular(source) => source.jpeg(stamp, *number)?,
            Source::Records(source) => source.jpeg(frame, *number)?,
        };
        let place = self.files().0.join(format!("{stamp}/{}", name(&CAMERAS, *number).unwrap_or_default()));
        decode_photo(&place, &bytes, self.max_width, lens.as_ref())
    }

    /// The sweep of a frame.
    pub fn sweep(&self, frame: usize, origin: DVec3) -> Result<Sweep, DatasetError> {
        self.points(frame, origin).map(|points| points.sweep)
    }

    fn points(&self, frame: usize, origin: DVec3) -> Result<Points, DatasetError> {
        let this = &self.parts.frames[frame];
        let second = self.with_second_returns;
        let scans = match &self.source {
            Source::Modular(source) => source.scans(this.stamp, second)?,
            Source::Records(source) => source.scans(frame, second)?,
        };
        let (_, file) = self.files();
        if scans.is_empty() {
            let source = std::io::Error::new(std::io::ErrorKind::NotFound, format!("no range image of {}", this.stamp));
            return Err(FileError::Io { path: file, action: "read a sweep", source }.into());
        }
        let mut points = Points::default();
        for scan in &scans {
            let added = self.add(&mut points, scan, this, origin);
            added.map_err(|found| {
                let laser = name(&LASERS, scan.laser).unwrap_or_default();
                let place = format!("the range image of {laser} at {}", this.stamp);
                DatasetError::malformed(&file, place, "the pixels of the calibrated laser", found)
            })?;
        }
        Ok(points)
    }

    /// The sweep of a frame with labels by its boxes.
    pub fn labelled_sweep(&self, frame: usize, origin: DVec3) -> Result<Sweep, DatasetError> {
        let this = &self.parts.frames[frame];
        let Points { mut sweep, unlabelled } = self.points(frame, origin)?;
        let boxes = self.cuboids(frame, origin)?;
        if !boxes.is_empty() {
            let next = self.parts.frames.get(frame + 1);
            // Seconds since 1970 would leave six digits of the difference.
            let interval = next.map(|next| seconds(next.stamp.saturating_sub(this.stamp)));
            let later = || self.cuboids(frame + 1, origin).map(|boxes| Some(Boxed::at_frame_time(boxes)));
            let mut labels = boxes::labels(&sweep, &boxes, interval, later)?;
            // Nobody has looked for objects there.
            for (index, _) in unlabelled.iter().enumerate().filter(|(_, unlabelled)| **unlabelled) {
                if labels.class[index] == ObjectClass::Background && labels.instance[index] == 0 {
                    labels.flow[index] = None;
                }
            }
            sweep.labels = Some(labels);
        }
        Ok(sweep)
    }

    fn add(&self, points: &mut Points, scan: &Scan, frame: &FramePart, origin: DVec3) -> Result<(), String> {
        let laser = self.parts.lasers.get(&scan.laser).ok_or("no calibration")?;
        points.add(scan, laser, frame, origin)
    }

    /// The boxes of a frame; none where the segment has none.
    pub fn cuboids(&self, frame: usize, origin: DVec3) -> Result<Vec<Cuboid>, DatasetError> {
        let this = &self.parts.frames[frame];
        let boxes = match &self.source {
            Source::Modular(source) => source.boxes(this.stamp)?,
            Source::Records(source) => source.boxes(frame)?,
        };
        let ego = centred(this.pose, origin);
        Ok(boxes.into_iter().filter(is_sound).map(|part| cuboid(part, &ego)).collect())
    }
}

fn is_sound(part: &BoxPart) -> bool {
    let is_placed = part.centre.iter().chain([&part.heading]).all(|value| value.is_finite());
    is_placed && part.size.iter().all(|side| *side > 0.0 && side.is_finite())
}

/// A box in the world. The heading is taken; the small pitch and roll of the vehicle are not.
fn cuboid(part: BoxPart, ego: &DMat4) -> Cuboid {
    let (sin, cos) = part.heading.sin_cos();
    let ahead = ego.transform_vector3(DVec3::new(cos, sin, 0.0));
    let label = usize::try_from(part.kind).ok().and_then(|kind| LABELS.get(kind)).unwrap_or(&LABELS[0]);
    Cuboid {
        track: part.id.clone(),
        label: (*label).to_string(),
        centre: ego.transform_point3(DVec3::from_array(part.centre)),
        size: DVec3::from_array(part.size),
        yaw: ahead.y.atan2(ahead.x),
        sensor: None,
        id: part.id,
    }
}

fn several(path: &Path, found: &[String]) -> DatasetError {
    DatasetError::UnknownFormat {
        path: path.to_path_buf(),
        expected: format!(
            "the files of one segment; the file {0}/NAME{1} stands for one of several, and the folder {0} for all",
            names::VEHICLE_POSE,
            names::PARQUET
        ),
        found: format!("{}: {}", counted(found.len(), "segment"), some_names(found)),
    }
}

/// The name of a file without its end.
fn stem(path: &Path, end: &str) -> Option<String> {
    Some(path.file_name()?.to_string_lossy().strip_suffix(end)?.to_string())
}
