//! The cameras of a rendering: those of a file, or a path made from them.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use gs_base::Intrinsics;
use gs_datasets::{CameraPose, camera_path, load_cameras_by, some_names};

use crate::cli::RenderArgs;
use gs_train::run::scene::LoadedScene;

/// Images of a path where the arguments say nothing: five seconds of film.
const IMAGES: usize = 120;

/// The file or folder of the cameras: as given, or the data set of the run.
pub(super) fn source(args: &RenderArgs, loaded: &LoadedScene) -> Result<PathBuf> {
    // A path goes by the cameras of the training, which are most.
    let train =
        |dataset: PathBuf| Some(dataset.join("transforms_train.json")).filter(|file| args.is_path() && file.is_file());
    let known = || loaded.run.as_ref().map(|run| train(run.dataset.clone()).unwrap_or(run.dataset.clone()));
    args.cameras.clone().or_else(known).with_context(|| {
        format!("{}: a file of Gaussians has no cameras; name some with --cameras", args.scene.display())
    })
}

/// The cameras of `source`, or the path that was asked for.
pub(super) fn cameras(args: &RenderArgs, source: &std::path::Path, loaded: &LoadedScene) -> Result<Vec<CameraPose>> {
    let poses = loaded.run.as_ref().and_then(|run| run.poses_in(source));
    let given = load_cameras_by(source, poses)?;
    let count = args.images.map_or(IMAGES, |count| count as usize);
    let nowhere = || format!("{}: its cameras look at no common point; try --between", source.display());
    let mut path = if args.orbit {
        camera_path::orbit(&given, count).with_context(nowhere)?
    } else if args.spiral {
        camera_path::spiral(&given, count).with_context(nowhere)?
    } else if let [first, last] = args.between.as_slice() {
        camera_path::between(named(&given, first, source)?, named(&given, last, source)?, count)
    } else {
        given
    };
    if let Some(span) = loaded.scene.span().filter(|_| args.is_path()) {
        camera_path::spread_times(&mut path, span);
    }
    if let Some(size) = &args.size {
        let (width, height) = parsed(size)?;
        path.iter_mut().for_each(|camera| resize(camera, width, height));
    }
    Ok(path)
}

fn named<'a>(cameras: &'a [CameraPose], name: &str, source: &std::path::Path) -> Result<&'a CameraPose> {
    let Some(camera) = cameras.iter().find(|camera| camera.name == name) else {
        let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
        bail!("{}: expected the name of a camera ({}), found {name:?}", source.display(), some_names(&names));
    };
    Ok(camera)
}

/// The same angle of view over the height, the middle in the middle.
fn resize(camera: &mut CameraPose, width: usize, height: usize) {
    let scale = height as f64 / camera.height as f64;
    let Intrinsics { fx, fy, .. } = camera.intrinsics;
    let (cx, cy) = (0.5 * width as f64, 0.5 * height as f64);
    camera.intrinsics = Intrinsics { fx: fx * scale, fy: fy * scale, cx, cy };
    (camera.width, camera.height) = (width, height);
}

fn parsed(text: &str) -> Result<(usize, usize)> {
    let side = |text: &str| text.parse::<usize>().ok().filter(|side| (1..=16_384).contains(side));
    match text.split_once('x').map(|(width, height)| (side(width), side(height))) {
        Some((Some(width), Some(height))) => Ok((width, height)),
        _ => bail!("--size: expected WIDTHxHEIGHT with sides of 1 to 16384 pixels, found {text:?}"),
    }
}
