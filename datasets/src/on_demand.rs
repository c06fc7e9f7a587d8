//! Photo sets larger than memory: views without pixels, whose photos are decoded when they are asked for.
//!
//! [`load`](crate::load) makes such views where the photos of a set take more than [`LoadOptions::memory`]. Of each it
//! reads the header alone. [`View::decoded`] gives the view with its pixels, as it would have been loaded, to the bit;
//! the photos that were asked for last are kept under the bound. Whatever looks at many photos at once before training
//! looks at [`surveyed`] ones.
//!
//! [`LoadOptions::memory`]: crate::LoadOptions::memory

use std::ops::Deref;
use std::sync::Arc;

use gs_base::counted;
use rayon::prelude::*;

use crate::error::DatasetError;
use crate::frame::{PhotoSet, PhotoSource, RgbImage8, View};
use crate::log::{FrameDescription, FrameSource, Log};
use crate::log_cache::LogCache;
use crate::notes::{ViewNote, ViewsWithNotes};

/// Most photos that are surveyed, evenly spaced by name. A plane sweep finds neighbours among as many, and decoding
/// them takes seconds.
const SURVEYED: usize = 128;

/// Most bytes of the surveyed photos' colours: larger ones are surveyed at a smaller width. 128 photos of 4000 x 3000
/// pixels are 960 wide, which is above the widths at which photos are compared before training.
const SURVEYED_BYTES: usize = 256 << 20;

/// The photos of a log, and the surveyed ones.
struct LoggedPhotos {
    cache: LogCache<Arc<Log>>,
    survey: Vec<View>,
}

impl PhotoSet for LoggedPhotos {
    fn decode(&self, index: usize) -> Result<Arc<View>, DatasetError> {
        self.cache.get(index)
    }

    fn survey(&self) -> &[View] {
        &self.survey
    }
}

/// A view with its pixels.
#[derive(Debug)]
pub enum Decoded<'a> {
    /// One that had them.
    Given(&'a View),
    /// One whose photo was asked for.
    Asked(Arc<View>),
}

impl Deref for Decoded<'_> {
    type Target = View;

    fn deref(&self) -> &View {
        match self {
            Self::Given(view) => view,
            Self::Asked(view) => view,
        }
    }
}

impl View {
    /// The view with its pixels, priors and truth, decoded if it has none. No pixel counts of a photo that cannot be
    /// read any more; a warning says so.
    pub fn decoded(&self) -> Decoded<'_> {
        self.asked().map_or(Decoded::Given(self), Decoded::Asked)
    }

    /// The decoded view; `None` where this one has its pixels.
    pub fn asked(&self) -> Option<Arc<View>> {
        let PhotoSource { set, index, width } = self.source.as_ref()?;
        let whole = set.decode(*index);
        let found = match whole.map(|view| width.map_or(view.clone(), |width| Arc::new(view.reduced(width)))) {
            Ok(view) if (view.width, view.height) == (self.width, self.height) => Ok(view),
            Ok(view) => Err(format!("{}: another size than before: {} x {}", self.name, view.width, view.height)),
            Err(error) => Err(error.to_string()),
        };
        Some(match found {
            // The pose of a view may have been changed after loading.
            Ok(view) if view.c2w == self.c2w => view,
            Ok(view) => Arc::new(Self { c2w: self.c2w, ..(*view).clone() }),
            Err(found) => {
                tracing::warn!("{found}; no pixel of it counts");
                Arc::new(self.without_pixels_that_count())
            }
        })
    }

    fn without_pixels_that_count(&self) -> Self {
        let (width, height) = (self.width, self.height);
        let image = RgbImage8 { width, height, data: vec![0; 3 * width * height] };
        Self { image, mask: Some(vec![0; width * height]), source: None, ..self.clone() }
    }
}

/// The views whose pixels are looked at before training: `views` themselves, or, where photos are decoded when they
/// are asked for, at most 128 training views spread evenly over the set, at a width at which their colours take at
/// most 256 MB.
pub fn surveyed(views: &[View]) -> &[View] {
    views.first().and_then(|view| view.source.as_ref()).map_or(views, |source| source.set.survey())
}

/// The views of a log without their pixels, in its order, and the notes of its surveyed training frames with their
/// indices. All views together never hold more than about `bound` bytes, surveyed ones included.
pub(crate) fn views(log: &Arc<Log>, bound: usize) -> Result<ViewsWithNotes, DatasetError> {
    let frames = log.frames();
    // A frame whose header cannot be read, or contradicts its camera, is an error as if all were decoded.
    for index in (0..frames.len()).filter(|index| frames[*index].intrinsics.is_none()) {
        log.decode(index)?;
    }
    let trains = log.splits().next().map_or(0, |(_, range)| range.len());
    let chosen = spread(trains);
    let share = survey_share(&chosen.iter().map(|index| &frames[*index]).collect::<Vec<_>>());
    let found: Vec<Result<(View, ViewNote), DatasetError>> =
        chosen.par_iter().map(|index| log.decode_noted(*index, Some(share))).collect();
    let (survey, notes): (Vec<View>, Vec<ViewNote>) =
        found.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    tracing::info!(
        "photos are decoded when they are asked for; before training, {} are looked at",
        counted(survey.len(), "photo")
    );
    let left = bound.saturating_sub(survey.iter().map(View::bytes).sum());
    let set: Arc<dyn PhotoSet> = Arc::new(LoggedPhotos { cache: LogCache::new(log.clone(), left), survey });
    let source = |index| PhotoSource { set: set.clone(), index, width: None };
    let views = frames.iter().enumerate().map(|(index, frame)| described(frame, source(index))).collect();
    Ok((views, chosen.into_iter().zip(notes).collect()))
}

/// At most [`SURVEYED`] of `count` indices, evenly spaced.
fn spread(count: usize) -> Vec<usize> {
    let chosen = count.min(SURVEYED);
    (0..chosen).map(|i| (2 * i + 1) * count / (2 * chosen)).collect()
}

/// The share of their widths at which frames are surveyed, at most 1.
fn survey_share(frames: &[&FrameDescription]) -> f64 {
    let bytes: usize = frames.iter().filter_map(|frame| frame.size).map(|(width, height)| 3 * width * height).sum();
    (SURVEYED_BYTES as f64 / bytes.max(1) as f64).sqrt().min(1.0)
}

fn described(frame: &FrameDescription, source: PhotoSource) -> View {
    let (width, height) = frame.size.unwrap_or_default();
    let intrinsics = frame.intrinsics.unwrap_or(gs_base::Intrinsics { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 });
    View {
        name: frame.name.clone(),
        image_path: frame.image_path.clone(),
        width,
        height,
        time: frame.time,
        camera_id: frame.camera_id.clone(),
        exposure: frame.exposure,
        source: Some(source),
        ..View::new(frame.c2w, intrinsics, RgbImage8 { width: 0, height: 0, data: Vec::new() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_is_spread_over_all() {
        assert_eq!(spread(0), [0; 0]);
        assert_eq!(spread(5), [0, 1, 2, 3, 4]);
        let many = spread(7000);
        assert_eq!((many.len(), many[0], many[127]), (128, 27, 6972));
        assert!(many.windows(2).all(|pair| (54..=55).contains(&(pair[1] - pair[0]))));
    }
}
