//! From one described frame to a view: its image decoded, undistorted, masked and downscaled, with the files beside it.
//! A photo of which several views are made is decoded for each of them: only one view is held at a time.

use glam::{DMat4, DVec3};
use gs_base::Intrinsics;
use rayon::prelude::*;

use crate::behind::Behind;
use crate::error::DatasetError;
use crate::face::Face;
use crate::faces;
use crate::frame::{RgbImage8, View};
use crate::lens::Resolved;
use crate::mask::{self, Mask};
use crate::names;
use crate::notes::ViewNote;
use crate::one_color;
use crate::options::LoadOptions;
use crate::pixels::{self, Opened};
use crate::priors::attach::{Attached, PhotoShape, SideNotes, attach};
use crate::projection::Projection;
use crate::raw::RawFrame;
use crate::resample::resample;
use crate::resize::target_size;
use crate::side_files::{Kind, SideFiles};
use crate::undistort::Undistortion;

/// How all frames of a data set are decoded.
#[derive(Debug, Clone)]
pub(crate) struct Decoder {
    pub max_width: Option<usize>,
    pub behind: Behind,
    /// Subtracted from positions.
    pub origin: DVec3,
}

/// A frame's camera and masks, at the size of its image file.
struct Camera {
    size: (usize, usize),
    resolved: Resolved,
    masks: Vec<Mask>,
    masked: Option<f64>,
}

impl Decoder {
    pub fn new(options: &LoadOptions, behind: Behind, origin: DVec3) -> Self {
        Self { max_width: options.max_width, behind, origin }
    }

    /// The frame's view.
    pub fn view(&self, frame: &RawFrame) -> Result<(View, ViewNote), DatasetError> {
        let Opened { photo, alpha, range, clipped } = pixels::open_whole(&frame.image_path, self.behind)?;
        let size = photo.size();
        let camera = Camera::of(frame, size)?;
        let one_color = one_color::of(&photo);
        let of_photo = camera.resolved.intrinsics;
        let face = match &frame.face {
            Some(face) => Some(face.clone()),
            None => self.faces(frame, size)?.into_iter().next(),
        };
        let (undistortion, intrinsics, ideal) = match &face {
            Some(face) => {
                let undistortion = Undistortion::wide(&frame.lens, of_photo, size).onto(face);
                (Some(undistortion), face.intrinsics, face.size)
            }
            None => (Undistortion::new(frame.lens.distortion, of_photo, size), of_photo, size),
        };
        let target = self.target(ideal);
        let (data, rests, mask) = resample(photo, &camera.masks, undistortion.as_ref(), target);
        let fine = (range.is_some() || clipped.is_some()).then_some(rests);
        let one_channel = |levels: Vec<u8>| levels.as_chunks::<3>().0.iter().map(|level| level[0]).collect();
        let alpha = alpha.map(|alpha| one_channel(resample(alpha, &[], undistortion.as_ref(), target).0));
        let is_blank = mask.as_ref().is_some_and(|mask| mask.iter().all(|keep| *keep == 0));
        let image = RgbImage8 { width: target.0, height: target.1, data };
        let intrinsics = scaled(intrinsics, ideal, target);
        let Attached { priors, truth, notes } = attach(&frame.sides, &self.photo(frame, size));
        let note = ViewNote { is_blank, one_color, range, clipped, ..camera.note(frame, notes) };
        let view = View {
            name: frame.name.clone(),
            image_path: frame.image_path.clone(),
            time: frame.time,
            camera_id: frame.camera_id.clone(),
            fine,
            alpha,
            mask,
            exposure: frame.exposure,
            priors,
            truth,
            ..View::new(self.c2w(frame), intrinsics, image)
        };
        Ok((view, note))
    }

    /// Decodes the frame's files without making a view of them.
    pub fn examine(&self, frame: &RawFrame) -> Result<ViewNote, DatasetError> {
        let Opened { photo, range, clipped, .. } = pixels::open_whole(&frame.image_path, self.behind)?;
        let (size, one_color) = (photo.size(), one_color::of(&photo));
        drop(photo);
        let camera = Camera::of(frame, size)?;
        let faces = self.faces(frame, size)?;
        let note = camera.note(frame, attach(&frame.sides, &self.photo(frame, size)).notes);
        Ok(ViewNote { faces, one_color, is_turned: pixels::is_turned(&frame.image_path), range, clipped, ..note })
    }

    /// Camera to world of the frame's view.
    pub fn c2w(&self, frame: &RawFrame) -> DMat4 {
        let mut c2w = frame.c2w;
        c2w.w_axis -= self.origin.extend(0.0);
        c2w
    }

    /// The pinhole views of a wide photo of this size, see [`faces::of`]; none of a pinhole's.
    pub fn faces(&self, photo: &RawFrame, size: (usize, usize)) -> Result<Vec<Face>, DatasetError> {
        if photo.lens.projection == Projection::Pinhole {
            return Ok(Vec::new());
        }
        let resolved = photo.lens.resolve((size.0 as u32, size.1 as u32), &photo.image_path, &photo.file)?;
        let faces = faces::of(&photo.lens, resolved.intrinsics, size);
        if faces.is_empty() {
            let location = format!("frame {:?}", photo.image_path.display().to_string());
            let expected = "a lens that shows something in the photo";
            let found = "one that shows next to nothing in it";
            return Err(DatasetError::malformed(&photo.file, location, expected, found));
        }
        Ok(faces)
    }

    /// The frames of the views of some photos, sorted by name. A photo by a pinhole is one, and so is one whose views
    /// are not known, since its size or its lens cannot be read; decoding says why.
    pub fn frames(&self, photos: Vec<RawFrame>) -> Vec<RawFrame> {
        if photos.iter().all(|photo| photo.lens.projection == Projection::Pinhole) {
            return photos;
        }
        let views = photos.into_par_iter().flat_map_iter(|photo| {
            let faces = self.size(&photo).and_then(|size| self.faces(&photo, size).ok()).unwrap_or_default();
            let views: Vec<RawFrame> = faces.into_iter().map(|face| photo.seen_by(face)).collect();
            if views.is_empty() { vec![photo] } else { views }
        });
        let mut frames: Vec<RawFrame> = views.collect();
        frames.sort_by(|a, b| a.name.cmp(&b.name));
        names::make_unique(frames.iter_mut().map(|frame| &mut frame.name));
        frames
    }

    /// How many views are made of a photo.
    pub fn views(&self, photo: &RawFrame) -> usize {
        let faces = self.size(photo).and_then(|size| self.faces(photo, size).ok());
        faces.map_or(1, |faces| faces.len().max(1))
    }

    /// Width and height of the frame's image by its header, pixels; `None` where that cannot be read.
    pub fn size(&self, frame: &RawFrame) -> Option<(usize, usize)> {
        let (width, height) = pixels::size_of(&frame.image_path).ok()?;
        Some((width as usize, height as usize))
    }

    /// Width and height of a view whose image file has this size.
    pub fn target(&self, size: (usize, usize)) -> (usize, usize) {
        target_size(size, self.max_width)
    }

    /// Width and height of the frame's view before it is downscaled; `None` where they cannot be read.
    pub fn ideal_size(&self, frame: &RawFrame) -> Option<(usize, usize)> {
        frame.face.as_ref().map(|face| face.size).or_else(|| self.size(frame))
    }

    /// Intrinsics of the frame's view, whose [ideal size](Self::ideal_size) this is; `None` where they contradict each
    /// other.
    pub fn intrinsics(&self, frame: &RawFrame, size: (usize, usize)) -> Option<Intrinsics> {
        if let Some(face) = &frame.face {
            return Some(scaled(face.intrinsics, size, self.target(size)));
        }
        let actual = (size.0 as u32, size.1 as u32);
        let resolved = frame.lens.resolve(actual, &frame.image_path, &frame.file).ok()?;
        Some(scaled(resolved.intrinsics, size, self.target(size)))
    }

    /// Whether the frame has a mask of moving objects that marks a pixel. No image but the mask is decoded.
    pub fn marks_motion(&self, frame: &RawFrame) -> bool {
        let files: Vec<_> = frame.sides.files.iter().filter(|file| file.kind == Kind::Moving).cloned().collect();
        if files.is_empty() {
            return false;
        }
        let Some(size) = self.size(frame) else { return false };
        let sides = SideFiles { files, depth: frame.sides.depth };
        let share = attach(&sides, &self.photo(frame, size)).notes.moving_share;
        share.is_some_and(|share| share > 0.0)
    }

    fn photo(&self, frame: &RawFrame, size: (usize, usize)) -> PhotoShape {
        let target = self.target(size);
        PhotoShape { size, target, undistorted: !frame.lens.is_ideal(), behind: self.behind }
    }
}

impl Camera {
    fn of(frame: &RawFrame, size: (usize, usize)) -> Result<Self, DatasetError> {
        let resolved = frame.lens.resolve((size.0 as u32, size.1 as u32), &frame.image_path, &frame.file)?;
        let masks: Vec<Mask> = frame.masks.iter().map(|file| Mask::open(file, size)).collect::<Result<_, _>>()?;
        let masked = (!masks.is_empty()).then(|| mask::ignored_share(&masks, size));
        Ok(Self { size, resolved, masks, masked })
    }

    fn note(&self, frame: &RawFrame, sides: SideNotes) -> ViewNote {
        ViewNote {
            projection: frame.lens.projection,
            faces: Vec::new(),
            name: frame.name.clone(),
            size: self.size,
            intrinsics: self.resolved.intrinsics,
            rescaled: self.resolved.rescaled_from,
            off_photo: self.resolved.off_photo,
            masked: self.masked,
            is_blank: self.masked == Some(1.0),
            one_color: None,
            is_turned: false,
            range: None,
            clipped: None,
            sides,
        }
    }
}

fn scaled(intrinsics: Intrinsics, size: (usize, usize), target: (usize, usize)) -> Intrinsics {
    intrinsics.scaled(target.0 as f64 / size.0 as f64, target.1 as f64 / size.1 as f64)
}
