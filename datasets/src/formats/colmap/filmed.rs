//! A COLMAP model of static cameras, one image a camera, beside the frames that they filmed: the multipleview layout of
//! 4DGaussians.
//!
//! ```text
//! sparse_/cameras.bin images.bin      a model whose image `image7.jpg` is of the camera cam07
//! cam07/frame_00001.jpg               its frames
//! points3D_multipleview.ply           points, in place of the model's
//! ```
//!
//! Time is the index among all frame names over the last index, 0 to 1.

use std::path::{Path, PathBuf};

use gs_base::{counted, printable};

use super::find::{self, ModelFiles};
use super::lenses::Lenses;
use super::{points_of, read_model};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{file_name, stem};
use crate::formats::llff::{TimeLine, frames_of};
use crate::raw::{RawFrame, RawScene};
use crate::scene::SceneFormat;
use crate::{names, ply, pose};

/// The folder of the model.
const MODEL: &str = "sparse_";

/// The points of the layout.
const POINTS: &str = "points3D_multipleview.ply";

/// A model and the folder with its cameras' frames.
pub(crate) struct Filmed {
    folder: PathBuf,
    pub files: ModelFiles,
}

/// The layout in a folder.
pub(crate) fn find(path: &Path) -> Option<Filmed> {
    let files = find::find(&path.join(MODEL))?;
    Some(Filmed { folder: path.to_path_buf(), files })
}

/// The folder with the frames of the camera whose image is `image7.jpg`: cam07, or cam7.
fn camera_of(folder: &Path, image: &str) -> Option<PathBuf> {
    let stem = stem(Path::new(image));
    let number: u32 = stem.trim_start_matches(|c: char| !c.is_ascii_digit()).parse().ok()?;
    let folders = [format!("cam{number:02}"), format!("cam{number}")].map(|name| folder.join(name));
    folders.into_iter().find(|path| path.is_dir())
}

/// Reads the description. A camera without frames is left out with a warning.
pub(crate) fn read(filmed: &Filmed, findings: &mut Findings) -> Result<RawScene, DatasetError> {
    let Filmed { folder, files } = filmed;
    let model = read_model(files, false, findings)?;
    let (cameras_file, images_file) = (files.file("cameras"), files.file("images"));
    let mut lenses = Lenses::of(&model, files);
    let mut missing = Vec::new();
    let mut cameras = Vec::new();
    for image in &model.images {
        let frames = camera_of(folder, &image.name)
            .map(|camera| (printable(&file_name(&camera)).into_owned(), frames_of(&camera)));
        match frames.filter(|(_, frames)| !frames.is_empty()) {
            Some((name, frames)) => cameras.push((image, name, frames)),
            None => missing.push(&image.name),
        }
    }
    let times = TimeLine::of(cameras.iter().flat_map(|(_, _, frames)| frames));
    let mut frames = Vec::new();
    for (image, camera, paths) in cameras {
        let c2w = pose::from_world_to_camera(image.q, image.t, &images_file, &image.name);
        let (Some(lens), Some(c2w)) = (lenses.lens(image), findings.take_posed(c2w)?) else { continue };
        for path in paths {
            let name = names::text_below(folder, &path).and_then(|text| names::output_name(folder, text, &images_file));
            let Some(name) = findings.take(name)? else { continue };
            frames.push(RawFrame {
                time: times.time(&path),
                camera_id: Some(camera.clone()),
                ..RawFrame::posed(name, path, c2w, lens.clone(), cameras_file.clone())
            });
        }
    }
    lenses.report(findings)?;
    findings.warn_of(folder, &missing, ["image", "has", "have"], |have, names| {
        format!("{have} no folder of frames ({names}): image7.jpg is of the camera in cam07")
    });
    findings.need_frames(&frames, folder, || format!("no frames of {}", counted(model.images.len(), "camera")))?;
    let file = folder.join(POINTS);
    let points = if file.is_file() { findings.take(ply::read(&file))? } else { points_of(&model) };
    Ok(RawScene { format: SceneFormat::Filmed, frames, points })
}
