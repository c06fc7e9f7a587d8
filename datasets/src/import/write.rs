//! Where an import writes: the side folder of a data set, or a new folder with a copy of its description.

use std::path::{Path, PathBuf};

use gs_base::write_atomic;

use super::descriptions::{self, ByImage, POINTS, PriorFiles};
use super::points;
use super::view::MappedView;
use crate::error::DatasetError;
use crate::formats::Layout;
use crate::image_io::write_exr;
use crate::options::DepthKind;
use crate::raw::RawFrame;
use crate::side_files::Kind;

/// A place that was checked before any work is done.
pub(super) enum Target {
    /// The root of the data set: priors are found there by the names of photos.
    Beside(PathBuf),
    /// A new folder.
    Folder(PathBuf),
}

/// Counts and a sentence about what was written.
pub(super) struct Written {
    /// Points written, and pixels with a depth.
    pub points: (usize, usize),
    pub sentence: String,
}

impl Target {
    /// Checks that priors can be written to `out`, or beside the photos of the data set where it is `None`.
    ///
    /// # Errors
    /// When `out` has files in it; without `out`, when priors beside the photos would not be found or be misread.
    pub fn check(
        out: Option<&Path>,
        dataset: &Path,
        layout: &Layout,
        frames: &[RawFrame],
    ) -> Result<Self, DatasetError> {
        let wrong = |expected: &str, found: &str| {
            let path = out.unwrap_or(dataset).to_path_buf();
            Err(DatasetError::Option { path, option: "out", expected: expected.to_string(), found: found.to_string() })
        };
        if let Some(out) = out {
            return match out.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
                true => wrong("an empty or a new folder", "files in it"),
                false => Ok(Self::Folder(out.to_path_buf())),
            };
        }
        let expected =
            "a folder for a copy of the description (--out), since priors beside the photos would not be read";
        let Layout::Transforms(sources) = layout else { return wrong(expected, "a set without transforms.json") };
        let lists = |kind| frames.iter().any(|frame| frame.sides.lists(kind));
        if lists(Kind::Depth) || lists(Kind::Confidence) {
            return wrong(expected, "a set that has depth priors");
        }
        if frames.iter().any(|frame| frame.sides.files.iter().any(|file| !file.kind.is_prior())) {
            return wrong(expected, "a set that names its truth");
        }
        if frames.iter().all(|frame| frame.time.is_none()) {
            return wrong(expected, "a set without times");
        }
        if frames.iter().any(|frame| frame.sides.depth.kind == Some(DepthKind::InverseDepth)) {
            return wrong(expected, "a set whose depth_kind is inverse depth");
        }
        let file = sources.files.first().map_or(dataset, |(file, _)| file);
        let root = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Ok(Self::Beside(root.to_path_buf()))
    }

    /// Writes depth and confidence of each view, the points, and in a new folder the description, which comes last.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(
        &self,
        views: &[MappedView],
        assigned: &[usize],
        frames: &[RawFrame],
        layout: &Layout,
        (keep, most): (f64, usize),
    ) -> Result<Written, DatasetError> {
        let (Self::Beside(root) | Self::Folder(root)) = self;
        let mut priors = ByImage::new();
        for (view, frame) in views.iter().zip(assigned) {
            let files = PriorFiles {
                depth: format!("priors/depth/{}.exr", view.name),
                confidence: format!("priors/confidence/{}.exr", view.name),
            };
            let (width, height) = view.size;
            write_exr(&root.join(&files.depth), width, height, &[("Z", &view.depth)])?;
            write_exr(&root.join(&files.confidence), width, height, &[("Y", &view.confidence)])?;
            priors.insert(frames[*frame].image_path.clone(), files);
        }
        let (bytes, count, pixels) = points::ply(views, keep, most);
        let sentence = match self {
            Self::Beside(root) => {
                let path = root.join("priors").join(POINTS);
                write_atomic(&path, &bytes)?;
                format!(
                    "{}: priors/depth and priors/confidence are found by the names of photos; {} is read when the JSON says so \
                     (ply_file_path)",
                    root.display(),
                    path.display()
                )
            }
            Self::Folder(out) => {
                write_atomic(&out.join(POINTS), &bytes)?;
                match layout {
                    Layout::Transforms(sources) => descriptions::copy(sources, out, &priors)?,
                    _ => descriptions::make(frames, out, &priors)?,
                }
                format!("{}: a data set with priors, whose photos stay where they are", out.display())
            }
        };
        Ok(Written { points: (count, pixels), sentence })
    }
}
