//! `gsburn view`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use burn::tensor::Device;
use gs_base::write_atomic;

use crate::cli::ViewArgs;
use crate::commands::{device, print};
use crate::report::viewer::{self, Packed as Page};
use gs_pipelines::{Opened, of_checkpoint};
use gs_train::run::exchange::Packed;
use gs_train::run::folder::full_path;
use gs_train::run::memory::megabytes;
use gs_train::run::outputs;
use gs_train::run::presentation::{self, Camera, PresentedScene};
use gs_train::run::scene::{LoadedScene, SceneFile, read_file};
use gs_train::sentence::one_sentence;

/// Name of the page in a run folder.
const PAGE: &str = "view.html";

/// Writes the page of a scene.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the disk.
pub fn run(args: &ViewArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let default = || if args.scene.is_dir() { args.scene.join(PAGE) } else { args.scene.with_extension("html") };
    let out: PathBuf = args.out.clone().unwrap_or_else(default);
    outputs::check_one(&out)?;
    let name = name_of(&args.scene);
    let file = read_file(&args.scene)?;
    let packed = PageScene::with_photos(&file, args.data.as_deref(), &device)?.packed(&name);
    write_atomic(&out, viewer::page(&name, &packed).as_bytes())?;
    let size = std::fs::metadata(&out).map_or(0, |metadata| metadata.len());
    print(format!("{}: {}, to be opened in a browser", out.display(), megabytes(size)));
    Ok(ExitCode::SUCCESS)
}

/// The name of a scene: of its folder, or of its file without the ending.
fn name_of(path: &Path) -> String {
    let path = full_path(path);
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    name.map_or_else(|| "scene".into(), |name| name.to_string_lossy().into_owned())
}

/// A scene with everything that its page shows.
pub struct PageScene {
    /// The scene.
    pub loaded: LoadedScene,
    /// Its cameras; empty where no data set is known.
    pub cameras: Vec<Camera>,
}

impl PageScene {
    /// A scene with the cameras and photos of `data`, or of its run's data set, where that can be read.
    ///
    /// # Errors
    /// A sentence when the scene cannot be opened.
    pub fn with_photos(file: &SceneFile, data: Option<&Path>, device: &Device) -> Result<Self> {
        let SceneFile::Checkpoint(checkpoint) = file else { return Self::alone(file, device) };
        let dataset = data.unwrap_or(&checkpoint.origin.dataset);
        match of_checkpoint(checkpoint)?.open(checkpoint, Some(dataset), device) {
            Ok(Opened { loaded, photos }) => {
                let cameras = photos.as_ref().map(presentation::cameras).unwrap_or_default();
                Ok(Self { loaded, cameras })
            }
            Err(error) => {
                let opened = Self::alone(file, device)?;
                tracing::warn!("the page has no cameras and photos: {}", one_sentence(&error));
                Ok(opened)
            }
        }
    }

    /// A scene without cameras.
    ///
    /// # Errors
    /// A sentence when the scene cannot be opened.
    pub fn alone(file: &SceneFile, device: &Device) -> Result<Self> {
        let loaded = match file {
            SceneFile::Ply(packed) => LoadedScene::of_packed(Packed::clone(packed), device),
            SceneFile::Checkpoint(checkpoint) => of_checkpoint(checkpoint)?.open(checkpoint, None, device)?.loaded,
        };
        Ok(Self { loaded, cameras: Vec::new() })
    }

    /// The scene for its page.
    pub fn packed(self, name: &str) -> Page {
        let PresentedScene { scene, presentation } = self.loaded.presented(name, self.cameras);
        viewer::packed(&*scene, &presentation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_keeps_its_whole_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let [run, file] = ["v1.2-test", "scene.ply"].map(|name| folder.path().join(name));
        std::fs::create_dir(&run).expect("made");
        std::fs::write(&file, "").expect("written");
        assert_eq!((name_of(&run).as_str(), name_of(&file).as_str()), ("v1.2-test", "scene"));
    }
}
