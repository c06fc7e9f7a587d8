//! `gsburn render`.

mod film;
mod path;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use gs_base::{counted, write_atomic};
use gs_burn::{Camera, Extras, RenderOptions, Rendering, render_with};
use gs_datasets::CameraPose;
use gs_datasets::image_io::encode_exr;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::cli::{ImageFormat, RenderArgs};
use crate::commands::{device, print};
use crate::report::maps::{self, write_gif};
use gs_pipelines::load_scene;
use gs_train::fit::parameters::to_host;
use gs_train::fit::times::through_time;
use gs_train::run::outputs::{self, MARK, marked_png, write_png};
use gs_train::run::pixels::{image_bytes, velocity_colors};
use gs_train::run::scene::{LoadedScene, within_reach};

use film::Film;

/// Steps of depth in a 16-bit PNG per scene unit: millimetres if the unit is a metre, as in nerfstudio.
const DEPTH_STEPS: f32 = 1000.0;

/// Renders every camera of a file, or of a path.
///
/// # Errors
/// One sentence saying what was wrong with the scene, the cameras or the disk.
pub fn run(args: &RenderArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let loaded = load_scene(&args.scene, &device)?;
    let source = path::source(args, &loaded)?;
    let mut cameras = path::cameras(args, &source, &loaded)?;
    if args.time.is_some() || args.frames.is_some() {
        loaded.moves(&args.scene)?;
        loaded.warn_outside(args.time);
    } else {
        loaded.warn_outside(cameras.iter().filter_map(|pose| pose.time));
    }
    if args.frames.is_some() {
        keep_distinct(&mut cameras);
    }
    let degree = args.sh_degree.map_or(3, usize::from);
    let usual = loaded.render_options(degree);
    let options = RenderOptions {
        depth: true,
        antialiased: args.antialiased || usual.antialiased,
        background: args.background.as_deref().map_or(Ok(usual.background), parse_color)?,
        ..usual
    };
    let jobs: Vec<(&CameraPose, Vec<(PathBuf, f64)>)> = cameras
        .iter()
        .map(|pose| {
            let moments = moments(args, &loaded, pose.time).into_iter();
            (pose, moments.map(|(suffix, t)| (args.out.join(format!("{}{suffix}", pose.name)), t)).collect())
        })
        .collect();
    let origin = if args.time.is_some() { "--time".into() } else { source.display().to_string() };
    let times = jobs.iter().flat_map(|(_, moments)| moments.iter().map(|(_, t)| *t));
    within_reach(&*loaded.scene, &origin, times)?;
    check_outputs(args, &source, &jobs, loaded.scene.span().is_some())?;
    let mut count = 0;
    let mut film = None;
    let film_path = args.video.then(|| film_path(args));
    check_film(args, film_path.as_deref())?;
    for (pose, moments) in jobs {
        // A scene far from its world's origin was trained near zero.
        let c2w = glam::DMat4::from_translation(-loaded.origin) * pose.c2w;
        let camera = Camera::from_c2w(c2w, pose.intrinsics, pose.width, pose.height, &device);
        let mut animation = Vec::new();
        let times: Vec<f64> = moments.iter().map(|(_, t)| *t).collect();
        for ((stem, t), gaussians) in moments.into_iter().zip(through_time(&*loaded.scene, &times)) {
            let features = (args.maps && loaded.scene.span().is_some()).then(|| loaded.scene.velocity(t));
            let rendering = render_with(&gaussians, &camera, &options, Extras { features, ..Extras::default() });
            write(&stem, pose, &rendering, args.format)?;
            if let Some(path) = &film_path {
                let size = (pose.width, pose.height);
                let film = match &mut film {
                    Some(film) => film,
                    None => film.insert(Film::begin(path.clone(), size, args.fps)?),
                };
                film.add(size, &image_bytes(rendering.color.clone()))?;
            }
            if args.maps {
                write_maps(&stem, pose, &rendering)?;
            }
            if args.gif {
                animation.push(image_bytes(rendering.color));
            }
            count += 1;
        }
        if args.gif {
            write_gif(&gif(args, pose), pose.width, pose.height, &animation)?;
        }
    }
    print(format!("{} in {}", counted(count, "image"), args.out.display()));
    if let Some(film) = film {
        print(format!("{}: a film of them", film.finish()?.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks that nothing is written over but earlier renderings: neither photos that the cameras' file names, nor other
/// files of the user.
fn check_outputs(
    args: &RenderArgs,
    source: &Path,
    jobs: &[(&CameraPose, Vec<(PathBuf, f64)>)],
    moves: bool,
) -> Result<()> {
    let mut suffixes = match args.format {
        ImageFormat::Png => vec![".png", "_alpha.png", "_depth.png"],
        ImageFormat::Exr => vec![".exr"],
    };
    suffixes.extend(args.maps.then_some("_depth_color.png"));
    suffixes.extend((args.maps && moves).then_some("_velocity.png"));
    let stems = jobs.iter().flat_map(|(_, moments)| moments.iter().map(|(stem, _)| stem));
    let mut paths: Vec<PathBuf> = stems.flat_map(|stem| suffixes.iter().map(|suffix| appended(stem, suffix))).collect();
    paths.extend(jobs.iter().filter(|_| args.gif).map(|(pose, _)| gif(args, pose)));
    let folder = if source.is_dir() { source } else { source.parent().unwrap_or(Path::new("")) };
    // Names are those of the frames without their extension.
    let extensions = ["png", "exr", "gif"];
    let named: Vec<PathBuf> = jobs
        .iter()
        .flat_map(|(pose, _)| extensions.map(|extension| appended(&folder.join(&pose.name), &format!(".{extension}"))))
        .collect();
    outputs::check(&paths, &named)
}

/// OUT/video.mp4, or OUT/video.gif where there is no ffmpeg, which is said.
fn film_path(args: &RenderArgs) -> PathBuf {
    if film::has_ffmpeg() {
        return args.out.join("video.mp4");
    }
    tracing::warn!("ffmpeg is not installed: the film becomes a GIF, of 256 colours an image");
    args.out.join("video.gif")
}

fn check_film(args: &RenderArgs, film: Option<&Path>) -> Result<()> {
    if args.video && args.format == ImageFormat::Exr {
        bail!("--video: expected --format png, found exr");
    }
    film.map_or(Ok(()), outputs::check_one)
}

fn gif(args: &RenderArgs, pose: &CameraPose) -> PathBuf {
    args.out.join(format!("{}.gif", pose.name))
}

/// Each camera once: a file has as many of each as there are frames, and at times of our own they are all alike.
fn keep_distinct(cameras: &mut Vec<CameraPose>) {
    let mut seen = Vec::new();
    cameras.retain(|pose| {
        let camera = (pose.c2w, pose.intrinsics, pose.width, pose.height);
        let new = !seen.contains(&camera);
        if new {
            seen.push(camera);
        }
        new
    });
}

/// The times at which a camera is rendered, each with the suffix of its file name.
fn moments(args: &RenderArgs, loaded: &LoadedScene, own: Option<f64>) -> Vec<(String, f64)> {
    match args.frames {
        Some(count) => {
            let times = loaded.times(count as usize);
            times.into_iter().enumerate().map(|(index, t)| (format!("_{index:04}"), t)).collect()
        }
        None => vec![(String::new(), args.time.or(own).unwrap_or(loaded.middle))],
    }
}

/// `stem` with `suffix` appended to its last component.
fn appended(stem: &Path, suffix: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Writes depth and velocity in colour.
fn write_maps(stem: &Path, pose: &CameraPose, rendering: &Rendering) -> Result<()> {
    let (width, height) = (pose.width, pose.height);
    let alpha = to_host(rendering.alpha.clone());
    let depth = to_host(rendering.expected_depth().expect("depth was asked for"));
    write_png(&appended(stem, "_depth_color.png"), [width, height], &maps::depth_colors(&depth, &alpha))?;
    if let Some(velocity) = &rendering.features {
        let colors = velocity_colors(&to_host(velocity.clone()));
        write_png(&appended(stem, "_velocity.png"), [width, height], &colors)?;
    }
    Ok(())
}

fn write(stem: &Path, pose: &CameraPose, rendering: &Rendering, format: ImageFormat) -> Result<()> {
    let (width, height) = (pose.width, pose.height);
    let depth = to_host(rendering.expected_depth().expect("depth was asked for"));
    let path = |suffix: &str| appended(stem, suffix);
    match format {
        ImageFormat::Png => {
            write_png(&path(".png"), [width, height], &image_bytes(rendering.color.clone()))?;
            write_png(&path("_alpha.png"), [width, height], &image_bytes(rendering.alpha.clone()))?;
            write_depth_png(&path("_depth.png"), width, height, &depth)?;
        }
        ImageFormat::Exr => {
            let color = to_host(rendering.color.clone());
            let channel = |c: usize| -> Vec<f32> { color.iter().skip(c).step_by(3).copied().collect() };
            let (red, green, blue) = (channel(0), channel(1), channel(2));
            let alpha = to_host(rendering.alpha.clone());
            let channels: [(&str, &[f32]); 5] =
                [("R", &red), ("G", &green), ("B", &blue), ("A", &alpha), ("Z", &depth)];
            let exr = encode_exr(&path(".exr"), (width, height), &channels, Some(MARK))?;
            write_atomic(&path(".exr"), &exr)?;
        }
    }
    Ok(())
}

/// Writes depth in steps of 1/1000 scene unit as 16-bit grey, clamped at 65.535 scene units.
fn write_depth_png(path: &Path, width: usize, height: usize, depth: &[f32]) -> Result<()> {
    let bytes: Vec<u8> = depth.iter().flat_map(|d| ((d * DEPTH_STEPS + 0.5) as u16).to_ne_bytes()).collect();
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(&bytes, width as u32, height as u32, ExtendedColorType::L16)
        .with_context(|| format!("{}: cannot encode", path.display()))?;
    Ok(write_atomic(path, &marked_png(&png))?)
}

/// Parses black, white, or three numbers from 0 to 1.
fn parse_color(text: &str) -> Result<[f32; 3]> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|c| (0.0..=1.0).contains(c)) => Ok([r, g, b]),
        _ => bail!("--background: expected black, white or three numbers from 0 to 1 as r,g,b, found {text:?}"),
    }
}
