//! Multi-view sets on disk, in the D-NeRF layout with more keys: photos of static cameras, images beside them, lists.

use std::path::Path;

use glam::DQuat;
use gs_base::write_atomic;
use gs_datasets::DatasetError;
use gs_datasets::image_io::{write_exr, write_png};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::film::{Exposure, Order, Shot, film};
use crate::points::Points;
use crate::tracer::camera::Camera;
use crate::tracer::scene::{MovingBody, Scene};

/// Pixels of all frames that are held in memory at a time, at about 60 bytes each. One camera's 16 frames of 640 x 480
/// fit; of larger sets the still part is traced again for every few frames.
const PIXELS_MAX: usize = 5_000_000;

/// A set in the making.
pub(crate) struct Set<'a> {
    pub dir: &'a Path,
    pub scene: &'a Scene,
    pub cameras: &'a [Camera],
    pub times: &'a [f64],
    pub order: Order,
}

/// One photo with its images and its entry in a list.
pub(crate) struct Photo<'a> {
    dir: &'a Path,
    pub camera: &'a Camera,
    /// The camera's place in the set, and the frame.
    pub number: usize,
    pub frame: usize,
    /// The list that it is in: "train", "val" or "test".
    pub list: &'static str,
    /// "train/cam00/0000", the name of all its files.
    stem: String,
    pub entry: Value,
    /// Points that it places in the world.
    pub points: Points,
}

/// The values of an image.
pub(crate) enum Image<'a> {
    /// As many channels as fit, 8 bits each.
    Png(&'a [u8]),
    /// Channels with their names.
    Exr(&'a [(&'a str, &'a [f32])]),
}

impl<'a> Photo<'a> {
    fn new(set: &Set<'a>, number: usize, frame: usize, list: &'static str) -> Self {
        let camera = &set.cameras[number];
        let stem = format!("{list}/{}/{frame:04}", camera.id);
        let entry = json!({
            "file_path": format!("{stem}.png"),
            "time": set.times[frame],
            "transform_matrix": camera.rows(),
            "camera_id": camera.id,
            "truth": {},
        });
        Self { dir: set.dir, camera, number, frame, list, stem, entry, points: Points::default() }
    }

    fn write(&self, path: &str, image: Image<'_>) -> Result<(), DatasetError> {
        let (path, width, height) = (self.dir.join(path), self.camera.width, self.camera.height);
        match image {
            Image::Png(data) => write_png(&path, width, height, data)?,
            Image::Exr(channels) => write_exr(&path, width, height, channels)?,
        }
        Ok(())
    }

    /// Writes the photo itself; `truth` is its key among the truth if it is true.
    pub fn photo(&mut self, truth: Option<&str>, data: &[u8]) -> Result<(), DatasetError> {
        if let Some(key) = truth {
            self.entry["truth"][key] = self.entry["file_path"].clone();
        }
        self.write(&format!("{}.png", self.stem), Image::Png(data))
    }

    /// Writes an image into a folder of `truth` and names it in the entry.
    pub fn truth(&mut self, key: &str, folder: &str, image: Image<'_>) -> Result<(), DatasetError> {
        let path = self.path("truth", folder, &image);
        self.entry["truth"][key] = json!(path);
        self.write(&path, image)
    }

    /// Writes an image into a folder of `priors` and names it in the entry.
    pub fn prior(&mut self, key: &str, folder: &str, image: Image<'_>) -> Result<(), DatasetError> {
        let path = self.path("priors", folder, &image);
        self.entry[key] = json!(path);
        self.write(&path, image)
    }

    fn path(&self, of: &str, folder: &str, image: &Image<'_>) -> String {
        let end = if matches!(image, Image::Png(_)) { "png" } else { "exr" };
        format!("{of}/{folder}/{}.{end}", self.stem)
    }

    /// Writes true depth and velocity.
    pub fn motion(&mut self, shot: &Shot) -> Result<(), DatasetError> {
        let [x, y, z] = &shot.velocity;
        self.truth("depth_path", "depth", Image::Exr(&[("Z", &shot.depth)]))?;
        self.truth("velocity_path", "velocity", Image::Exr(&[("X", x), ("Y", y), ("Z", z)]))
    }
}

impl<'a> Set<'a> {
    /// Films all frames with all cameras. `list` names the list that a photo is in; `write` writes its files and
    /// completes its entry; `progress` hears how many of all photos are done.
    pub fn photograph(
        &self,
        exposures: &[Exposure],
        list: impl Fn(&Camera, usize) -> &'static str + Sync,
        write: impl Fn(&mut Photo<'a>, &Shot) -> Result<(), DatasetError> + Sync,
        progress: impl Fn(usize, usize),
    ) -> Result<Vec<Photo<'a>>, DatasetError> {
        let total = self.cameras.len() * exposures.len();
        let mut photos = Vec::with_capacity(total);
        progress(0, total);
        for (number, camera) in self.cameras.iter().enumerate() {
            let together = (PIXELS_MAX / (camera.width * camera.height)).max(1);
            for (chunk, exposures) in exposures.chunks(together).enumerate() {
                let shots = film(self.scene, camera, exposures, self.order);
                let written = shots.par_iter().enumerate().map(|(i, shot)| {
                    let frame = chunk * together + i;
                    let mut photo = Photo::new(self, number, frame, list(camera, frame));
                    write(&mut photo, shot).map(|()| photo)
                });
                // Collected first, so that the error of the first frame is reported and not of the fastest.
                let written: Vec<Result<Photo<'a>, DatasetError>> = written.collect();
                for photo in written {
                    photos.push(photo?);
                }
                progress(photos.len(), total);
            }
        }
        Ok(photos)
    }

    /// Writes the lists that are not empty in the order of `lists`, each with the keys of `more`: a folder without the
    /// last is not finished.
    pub fn describe(&self, photos: Vec<Photo<'_>>, lists: &[&str], more: Value) -> Result<(), DatasetError> {
        let Some(camera) = self.cameras.first() else { return Ok(()) };
        let mut top = camera.intrinsics();
        for (key, value) in more.as_object().into_iter().flatten() {
            top[key] = value.clone();
        }
        top["movers"] = self.scene.moving.iter().map(|body| self.motion(body)).collect();
        for list in lists {
            let of_list = photos.iter().filter(|photo| photo.list == *list);
            let frames: Vec<Value> = of_list.map(|photo| photo.entry.clone()).collect();
            if !frames.is_empty() {
                top["frames"] = Value::Array(frames);
                write_atomic(&self.dir.join(format!("transforms_{list}.json")), format!("{top:#}\n").as_bytes())?;
            }
        }
        Ok(())
    }

    /// The pose (metres), velocity (metres per unit of time) and angular velocity (radians per unit of time, world
    /// axes) of a moving body at each time: the truth for motion models.
    fn motion(&self, body: &MovingBody) -> Value {
        let pose = |time: &f64| {
            let (pose, twist) = (body.motion.pose(*time), body.motion.twist(*time));
            let DQuat { x, y, z, w } = pose.rotation;
            json!({
                "time": time,
                "position": pose.position.to_array(),
                "quaternion_wxyz": [w, x, y, z],
                "velocity": twist.velocity.to_array(),
                "angular_velocity": twist.angular.to_array(),
            })
        };
        let poses: Vec<Value> = self.times.iter().map(pose).collect();
        json!({ "name": body.name, "radius": body.solid.radius, "poses": poses })
    }
}
