//! [`DrivingLog`]: a log that is described first and decoded when asked.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_datasets::{DatasetError, FrameDescription, FrameSource, RgbImage8, Split, View, read_photo};

use crate::argoverse;
use crate::argoverse::ground::MapGround;
use crate::description::{Camera, Description, Frame, Shot};
use crate::options::LogOptions;
use crate::pandaset;
use crate::sweep::{Cuboid, Sweep};
use crate::waymo;
#[cfg(feature = "waymo")]
use crate::waymo::segment::Segment;

/// The layouts that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogFormat {
    /// A sequence of PandaSet, or synthetic streets in its layout.
    PandaSet,
    /// A log of Argoverse 2 Sensor.
    Argoverse,
    /// A segment of the Waymo Open Dataset, read with the feature `waymo`.
    Waymo,
}

impl LogFormat {
    /// For messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::PandaSet => "PandaSet",
            Self::Argoverse => "Argoverse 2 Sensor",
            Self::Waymo => "Waymo Open Dataset",
        }
    }

    /// The places of the LiDARs, metres, in the axes of the ego vehicle, the one that turns first. They are those of
    /// the data set's vehicles; logs do not have them (PandaSet) or differ by centimetres.
    fn lidars(self) -> &'static [[f64; 3]] {
        match self {
            Self::PandaSet => &[[0.0, 0.8, 1.85], [0.0, 1.41, 1.55]],
            Self::Argoverse => &[[1.35, 0.0, 1.64]; 2],
            Self::Waymo => {
                &[[1.43, 0.0, 2.18], [4.07, 0.0, 0.69], [3.25, 1.03, 0.98], [3.25, -1.03, 0.98], [-1.15, 0.0, 0.47]]
            }
        }
    }

    /// The layout of a folder, or of a file of a Waymo segment; `None` where it is no driving log.
    pub fn of(folder: &Path) -> Option<Self> {
        if pandaset::names::is_sequence(folder) {
            Some(Self::PandaSet)
        } else if folder.join(argoverse::poses::EGO).is_file() {
            Some(Self::Argoverse)
        } else if waymo::names::is_segment(folder) {
            Some(Self::Waymo)
        } else {
            None
        }
    }
}

/// The driving logs of a folder, or of the folders in it where it holds none itself, by name.
///
/// # Errors
/// When the folder cannot be read.
pub fn logs_in(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let unread = |source| DatasetError::read(folder, source);
    let entries: Vec<PathBuf> =
        std::fs::read_dir(folder).map_err(unread)?.flatten().map(|entry| entry.path()).collect();
    let logs = |paths: &[PathBuf]| -> Vec<PathBuf> {
        paths.iter().filter(|path| LogFormat::of(path).is_some()).cloned().collect()
    };
    let mut found = logs(&entries);
    if found.is_empty() {
        // Splits, as `val` of Argoverse 2.
        let inner = entries.iter().filter_map(|path| std::fs::read_dir(path).ok()).flatten().flatten();
        found = logs(&inner.map(|entry| entry.path()).collect::<Vec<_>>());
    }
    found.sort();
    Ok(found)
}

/// A driving log. It holds descriptions and no pixel or point: less than 1 KB for each frame and camera. A sweep or
/// image belongs to who asked for it; [`LogCache`](gs_datasets::LogCache) keeps images under a bound in bytes, since a
/// log is a [`FrameSource`].
///
/// Positions are in the world of the data set with [`origin`](DrivingLog::origin) subtracted in f64, so that f32 keeps
/// millimetres. The axes are the data set's: z is up. Camera axes are OpenCV's, poses are camera to world.
#[derive(Debug)]
pub struct DrivingLog {
    path: PathBuf,
    format: LogFormat,
    description: Description,
    options: LogOptions,
    views: Vec<FrameDescription>,
    /// Frame and camera of each entry of `views`.
    places: Vec<(usize, usize)>,
    /// `[frames][cameras]`: the place in `views`.
    index: Vec<Vec<Option<usize>>>,
    /// The files of a Waymo segment.
    #[cfg(feature = "waymo")]
    segment: Option<Segment>,
}

impl DrivingLog {
    /// Describes the log in a folder. A Waymo segment may also be given by a file: `vehicle_pose/NAME.parquet` or that
    /// of another component, or `NAME.tfrecord`.
    ///
    /// # Errors
    /// One sentence: no known layout, a description that is missing or broken, times that do not ascend, no frame; a
    /// Waymo segment without the feature `waymo`.
    pub fn open(path: &Path, options: &LogOptions) -> Result<Self, DatasetError> {
        let format = LogFormat::of(path).ok_or_else(|| unknown(path))?;
        let description = match format {
            LogFormat::PandaSet => pandaset::describe::describe(path, options)?,
            LogFormat::Argoverse => argoverse::describe::describe(path, options)?,
            LogFormat::Waymo => return Self::open_waymo(path, options),
        };
        Ok(Self::of(path, format, description, options))
    }

    #[cfg(feature = "waymo")]
    fn open_waymo(path: &Path, options: &LogOptions) -> Result<Self, DatasetError> {
        let (segment, description) = Segment::open(path, options)?;
        let mut log = Self::of(path, LogFormat::Waymo, description, options);
        log.segment = Some(segment);
        Ok(log)
    }

    #[cfg(not(feature = "waymo"))]
    fn open_waymo(path: &Path, _: &LogOptions) -> Result<Self, DatasetError> {
        Err(DatasetError::Unsupported {
            path: path.to_path_buf(),
            what: "a segment of the Waymo Open Dataset".to_string(),
            expected: "a program built with the feature `waymo` (cargo build --release --features waymo)".to_string(),
        })
    }

    /// Second returns of the lasers of a Waymo segment become points too, behind the first ones. Other logs stay as
    /// they are.
    #[must_use]
    #[cfg(feature = "waymo")]
    pub fn with_second_returns(mut self) -> Self {
        if let Some(segment) = &mut self.segment {
            segment.with_second_returns = true;
        }
        self
    }

    fn of(path: &Path, format: LogFormat, description: Description, options: &LogOptions) -> Self {
        let (mut views, mut places) = (Vec::new(), Vec::new());
        let mut index = vec![vec![None; description.cameras.len()]; description.frames.len()];
        for (f, (frame, shots)) in description.frames.iter().zip(&description.shots).enumerate() {
            for (c, (camera, shot)) in description.cameras.iter().zip(shots).enumerate() {
                let Some(Shot { time, c2w, image: Some(image) }) = shot else { continue };
                index[f][c] = Some(views.len());
                places.push((f, c));
                views.push(FrameDescription {
                    name: format!("{}/{}", camera.name, frame.name),
                    split: Split::TRAIN.to_string(),
                    time: Some(*time),
                    camera_id: Some(camera.name.clone()),
                    c2w: *c2w,
                    size: Some((camera.width, camera.height)),
                    intrinsics: Some(camera.intrinsics),
                    image_path: image.clone(),
                    exposure: None,
                });
            }
        }
        Self {
            path: path.to_path_buf(),
            format,
            description,
            options: options.clone(),
            views,
            places,
            index,
            #[cfg(feature = "waymo")]
            segment: None,
        }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The layout.
    pub fn format(&self) -> LogFormat {
        self.format
    }

    /// The log's name: that of its folder, "002" in PandaSet.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// The position in the data set's world that is (0, 0, 0) here: that of the ego vehicle at the first frame, metres.
    pub fn origin(&self) -> DVec3 {
        self.description.origin
    }

    /// The frames, times ascending.
    pub fn frames(&self) -> &[Frame] {
        &self.description.frames
    }

    /// LiDARs of the data set's vehicles.
    pub fn lidars(&self) -> usize {
        self.format.lidars().len()
    }

    /// Where a LiDAR, as numbered in [`Sweep::sensor`], is at a frame, metres, centred world. One of another number is
    /// at the place of the first.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn lidar_position(&self, frame: usize, sensor: u8) -> DVec3 {
        let lidars = self.format.lidars();
        let place = lidars.get(usize::from(sensor)).unwrap_or(&lidars[0]);
        self.frames()[frame].ego.transform_point3(DVec3::from_array(*place))
    }

    /// The cameras.
    pub fn cameras(&self) -> &[Camera] {
        &self.description.cameras
    }

    /// Omissions, in sentences.
    pub fn warnings(&self) -> &[String] {
        &self.description.warnings
    }

    /// The image of a frame and camera before it is decoded; `None` where neither image nor pose is there.
    ///
    /// # Panics
    /// When there is no such frame or camera.
    pub fn shot(&self, frame: usize, camera: usize) -> Option<&Shot> {
        self.description.shots[frame][camera].as_ref()
    }

    /// Camera to centred world, OpenCV axes, at the time of the image.
    ///
    /// # Panics
    /// When there is no such frame or camera.
    pub fn camera_pose(&self, frame: usize, camera: usize) -> Option<DMat4> {
        self.shot(frame, camera).map(|shot| shot.c2w)
    }

    /// The place of an image in the list of the [`FrameSource`], for caches; `None` where it is missing.
    ///
    /// # Panics
    /// When there is no such frame or camera.
    pub fn view_index(&self, frame: usize, camera: usize) -> Option<usize> {
        self.index[frame][camera]
    }

    /// Decodes an image; the lens distortion of Waymo's is removed.
    ///
    /// # Errors
    /// When it is missing, broken, or of another size than the first image of its camera (Waymo: than the calibration
    /// says).
    ///
    /// # Panics
    /// When there is no such frame or camera.
    pub fn image(&self, frame: usize, camera: usize) -> Result<RgbImage8, DatasetError> {
        let described = &self.cameras()[camera];
        let Some(Shot { image: Some(path), .. }) = self.shot(frame, camera) else {
            let path = self.path.join(&described.name).join(&self.frames()[frame].name);
            let source = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(DatasetError::read(&path, source));
        };
        #[cfg(feature = "waymo")]
        if let Some(segment) = &self.segment {
            return self.sized(segment.image(frame, camera)?, camera, path);
        }
        self.sized(read_photo(path, self.options.max_width)?, camera, path)
    }

    /// The image, if it has the size of its camera.
    fn sized(&self, image: RgbImage8, camera: usize, path: &Path) -> Result<RgbImage8, DatasetError> {
        let described = &self.cameras()[camera];
        if (image.width, image.height) != (described.width, described.height) {
            let expected = format!("{} x {} pixels, as the first of the camera", described.width, described.height);
            let found = format!("{} x {}", image.width, image.height);
            return Err(DatasetError::malformed(path, "the image", expected, found));
        }
        Ok(image)
    }

    /// Reads a sweep, without labels.
    ///
    /// # Errors
    /// When its file is missing or broken.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn sweep(&self, frame: usize) -> Result<Sweep, DatasetError> {
        let this = &self.frames()[frame];
        match self.format {
            LogFormat::PandaSet => pandaset::sweep::read(&self.path, this, self.origin()),
            LogFormat::Argoverse => argoverse::sweep::read(&self.path, this),
            #[cfg(feature = "waymo")]
            LogFormat::Waymo => self.segment().sweep(frame, self.origin()),
            #[cfg(not(feature = "waymo"))]
            LogFormat::Waymo => unreachable!("a Waymo segment does not open"),
        }
    }

    /// The ground by the map of the log.
    ///
    /// # Errors
    /// When the map is missing or broken; for logs of other data sets than Argoverse 2.
    pub fn map_ground(&self) -> Result<MapGround, DatasetError> {
        if self.format != LogFormat::Argoverse {
            let (path, what) = (self.path.clone(), format!("the ground of a log of {}", self.format.name()));
            let expected = "a log of Argoverse 2 with its map".to_string();
            return Err(DatasetError::Unsupported { path, what, expected });
        }
        MapGround::read(&self.path, self.origin())
    }

    /// Reads a sweep with its labels, for which the sweep of the next frame is read as well.
    ///
    /// # Errors
    /// When a file is missing or broken.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn labelled_sweep(&self, frame: usize) -> Result<Sweep, DatasetError> {
        let (this, next) = (&self.frames()[frame], self.frames().get(frame + 1));
        match self.format {
            LogFormat::PandaSet => pandaset::sweep::labelled(&self.path, this, next, self.origin()),
            LogFormat::Argoverse => argoverse::sweep::labelled(&self.path, this, next),
            #[cfg(feature = "waymo")]
            LogFormat::Waymo => self.segment().labelled_sweep(frame, self.origin()),
            #[cfg(not(feature = "waymo"))]
            LogFormat::Waymo => unreachable!("a Waymo segment does not open"),
        }
    }

    /// The labelled boxes of a frame; none where the log has none. PandaSet has two for an object that both LiDARs see.
    ///
    /// # Errors
    /// When their file is broken.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn cuboids(&self, frame: usize) -> Result<Vec<Cuboid>, DatasetError> {
        let this = &self.frames()[frame];
        match self.format {
            LogFormat::PandaSet => {
                Ok(pandaset::cuboids::read(&self.path, &this.name, self.origin())?.unwrap_or_default())
            }
            LogFormat::Argoverse => argoverse::sweep::cuboids(&self.path, this),
            #[cfg(feature = "waymo")]
            LogFormat::Waymo => self.segment().cuboids(frame, self.origin()),
            #[cfg(not(feature = "waymo"))]
            LogFormat::Waymo => unreachable!("a Waymo segment does not open"),
        }
    }

    #[cfg(feature = "waymo")]
    fn segment(&self) -> &Segment {
        self.segment.as_ref().expect("every log of this layout has its segment")
    }
}

impl FrameSource for DrivingLog {
    fn frames(&self) -> &[FrameDescription] {
        &self.views
    }

    fn decode(&self, index: usize) -> Result<View, DatasetError> {
        let (frame, camera) = self.places[index];
        let described = &self.views[index];
        let image = self.image(frame, camera)?;
        let hidden = self.cameras()[camera].ego_rows.min(image.height);
        let seen = image.width * (image.height - hidden);
        let mask =
            (hidden > 0).then(|| (0..image.width * image.height).map(|i| if i < seen { 255 } else { 0 }).collect());
        Ok(View {
            name: described.name.clone(),
            image_path: described.image_path.clone(),
            time: described.time,
            camera_id: described.camera_id.clone(),
            mask,
            ..View::new(described.c2w, self.cameras()[camera].intrinsics, image)
        })
    }
}

fn unknown(path: &Path) -> DatasetError {
    let found = if !path.exists() {
        "nothing there"
    } else if path.is_dir() {
        "a folder with none of them"
    } else {
        "another file"
    };
    DatasetError::UnknownFormat {
        path: path.to_path_buf(),
        expected:
            "a driving log: PandaSet (lidar/timestamps.json), Argoverse 2 (city_SE3_egovehicle.feather) or Waymo \
                   (vehicle_pose/NAME.parquet, NAME.tfrecord)"
                .to_string(),
        found: found.to_string(),
    }
}
