//! `gsburn import`: depth of a network as priors of a data set.
//!
//! Networks give depth, or inverse depth, up to a scale and a shift that differ from photo to photo. Both are fitted
//! for each photo to the data set's own points, and the depth is written in scene units.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use glam::Vec3;
use gs_base::{counted, write_atomic};
use gs_datasets::image_io::encode_exr;
use gs_datasets::{DepthMap, DepthSpace, FrameDescription, LoadOptions, Log, PriorUse, find_depth, read_depth};
use gs_models::depth_prior::{self, Alignment, align};
use gs_multiview::Pinhole;
use rayon::prelude::*;

use crate::cli::ImportArgs;
use crate::commands::print;
use gs_train::run::folder::utf8;
use gs_train::run::outputs::{self, MARK};

/// Where a data set with times is searched for depth.
const FOLDER: &str = "priors/depth";

/// Writes the priors and prints a line for each photo.
///
/// # Errors
/// One sentence: a data set that cannot be read or has no points, no depth of any of its photos, a file that is no
/// depth, a full disk.
pub fn run(args: &ImportArgs) -> Result<ExitCode> {
    // A path that training would refuse.
    utf8(&args.into)?;
    let options = LoadOptions { priors: PriorUse::NONE, ..LoadOptions::default() };
    let log = Log::open(&args.into, &options)?;
    let Some(points) = log.points() else {
        bail!("{}: expected a data set with points, to which depth is fitted, found none", args.into.display());
    };
    let depths: Vec<(&FrameDescription, PathBuf)> =
        log.frames().iter().filter_map(|frame| Some((frame, find_depth(&args.depths, &frame.name)?))).collect();
    if depths.is_empty() {
        let (found, into) = (args.depths.display(), args.into.display());
        bail!("{found}: expected depth named after the photos of {into}, found none");
    }
    let folder = args.out.clone().unwrap_or_else(|| root(&args.into).join(FOLDER));
    let files = depths.iter().map(|(frame, _)| folder.join(format!("{}.exr", frame.name))).collect::<Vec<_>>();
    let read: Vec<PathBuf> = depths.iter().map(|(_, path)| path.clone()).collect();
    outputs::check(&files, &read)?;
    let fits: Vec<Result<Option<Alignment>>> = depths
        .par_iter()
        .zip(&files)
        .map(|((frame, depth), file)| import(frame, &read_depth(depth, args.kind)?, &points.positions, file))
        .collect();
    report(&depths, fits, &folder)
}

/// The folder in which a description of a data set lies.
fn root(dataset: &Path) -> &Path {
    if dataset.is_dir() { dataset } else { dataset.parent().unwrap_or(Path::new("")) }
}

/// Fits a photo's depth and writes it; `None` where too few points say where its surfaces are.
fn import(frame: &FrameDescription, map: &DepthMap, points: &[[f32; 3]], file: &Path) -> Result<Option<Alignment>> {
    let (Some((width, height)), Some(intrinsics)) = (frame.size, frame.intrinsics) else { return Ok(None) };
    let scaled = intrinsics.scaled(map.width as f64 / width as f64, map.height as f64 / height as f64);
    let camera = Pinhole::posed(frame.c2w, scaled, map.width, map.height);
    let (prior, known) = samples(map, &nearest_points(&camera, points));
    let space = match map.space {
        DepthSpace::Depth => depth_prior::DepthSpace::Depth,
        DepthSpace::InverseDepth => depth_prior::DepthSpace::InverseDepth,
    };
    let Some(alignment) = align(&prior, &known, None, space) else { return Ok(None) };
    let depth = alignment.depth(&map.values);
    let bytes = encode_exr(file, (map.width, map.height), &[("Z", &depth)], Some(MARK))?;
    write_atomic(file, &bytes)?;
    Ok(Some(alignment))
}

/// The depth of the nearest point in each pixel that shows one, by the pixel's index. A point behind it is hidden.
fn nearest_points(camera: &Pinhole, points: &[[f32; 3]]) -> HashMap<usize, f64> {
    let mut nearest = HashMap::new();
    for (pixel, depth) in points.iter().filter_map(|point| camera.sees(Vec3::from(*point).as_dvec3())) {
        let known = nearest.entry(pixel).or_insert(depth);
        *known = known.min(depth);
    }
    nearest
}

/// The prior and the known depth of the pixels with a point, in the order of the pixels.
fn samples(map: &DepthMap, nearest: &HashMap<usize, f64>) -> (Vec<f32>, Vec<f32>) {
    let mut pixels: Vec<(usize, f64)> = nearest.iter().map(|(pixel, depth)| (*pixel, *depth)).collect();
    pixels.sort_unstable_by_key(|(pixel, _)| *pixel);
    pixels.into_iter().map(|(pixel, depth)| (map.values[pixel], depth as f32)).unzip()
}

fn report(
    depths: &[(&FrameDescription, PathBuf)],
    fits: Vec<Result<Option<Alignment>>>,
    folder: &Path,
) -> Result<ExitCode> {
    let mut written = 0;
    print(format!("{:<32} {:>10} {:>10} {:>8} {:>10}", "photo", "scale", "shift", "fitted", "deviation"));
    for ((frame, _), fit) in depths.iter().zip(fits) {
        let Some(fit) = fit? else {
            print(format!("{:<32} left out: too few points, or depth that contradicts them", frame.name));
            continue;
        };
        written += 1;
        let share = 100.0 * fit.inliers;
        print(format!(
            "{:<32} {:>10.5} {:>10.5} {share:>6.1} % {:>10.5}",
            frame.name, fit.scale, fit.shift, fit.deviation
        ));
    }
    if written == 0 {
        bail!("{}: no depth was fitted to the points, nothing was written", folder.display());
    }
    print(format!(
        "{}: {} of {}; data.depth_kind=metric_z takes them as they are",
        folder.display(),
        counted(written, "depth prior"),
        counted(depths.len(), "photo")
    ));
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use gs_base::npy::write_npy;
    use gs_datasets::image_io::write_png;
    use gs_datasets::load;
    use serde_json::json;

    use super::*;

    const SIZE: (usize, usize) = (32, 24);
    const FOCAL: f64 = 30.0;
    /// A point counts for the centre of its pixel, from which it is up to half a pixel away in each direction. The
    /// plane's depth changes by this share over that, most at the corner where `1 - 0.5 u - 0.25 v` is 0.646.
    const HALF_A_PIXEL: f64 = 0.5 * (0.5 + 0.25) / FOCAL / 0.646;

    /// Camera z of a tilted plane in a photo from `x`.
    fn plane(x: f64, column: usize, row: usize) -> f64 {
        let (u, v) = ((column as f64 + 0.5 - 16.0) / FOCAL, (row as f64 + 0.5 - 12.0) / FOCAL);
        // z = 4 + 0.5 X + 0.25 Y of the world, along the ray (x + u z, v z, z).
        (4.0 + 0.5 * x) / (1.0 - 0.5 * u - 0.25 * v)
    }

    /// Three cameras side by side, and points of the plane; every tenth lies far behind it.
    fn dataset(folder: &Path) {
        // Photos of one colour would be refused.
        let photo: Vec<u8> = (0..3 * SIZE.0 * SIZE.1).map(|i| (i * 37 % 251) as u8).collect();
        let frames: Vec<_> = (0..3)
            .map(|index| {
                let name = format!("images/{index:02}.png");
                write_png(&folder.join(&name), SIZE.0, SIZE.1, &photo).expect("a photo");
                let x = f64::from(index) * 0.2;
                json!({ "file_path": name, "time": index, "transform_matrix":
                    [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]] })
            })
            .collect();
        let top = json!({ "fl_x": FOCAL, "fl_y": FOCAL, "cx": 16.0, "cy": 12.0, "w": SIZE.0, "h": SIZE.1,
            "ply_file_path": "points.ply", "frames": frames });
        write_atomic(&folder.join("transforms.json"), top.to_string().as_bytes()).expect("written");
        let mut rows = String::new();
        for index in 0..400 {
            let (column, row) = (index * 7 % 32, index * 5 % 24);
            let z = plane(0.2, column, row) * if index % 10 == 0 { 3.0 } else { 1.0 };
            let ray = [(column as f64 + 0.5 - 16.0) / FOCAL, (row as f64 + 0.5 - 12.0) / FOCAL];
            rows += &format!("{} {} {z}\n", 0.2 + ray[0] * z, ray[1] * z);
        }
        let header =
            "ply\nformat ascii 1.0\nelement vertex 400\nproperty double x\nproperty double y\nproperty double z\n";
        write_atomic(&folder.join("points.ply"), format!("{header}end_header\n{rows}").as_bytes()).expect("written");
    }

    fn arguments(folder: &Path, kind: Option<gs_datasets::DepthKind>) -> ImportArgs {
        ImportArgs { depths: folder.join("arrays"), into: folder.to_path_buf(), out: None, kind }
    }

    #[test]
    fn depth_comes_to_the_units_of_the_points() {
        use gs_datasets::DepthKind::{Depth, InverseDepth};
        for (kind, network) in [
            (None, &(|z: f64| 0.5 * z - 0.3) as &dyn Fn(f64) -> f64),
            (Some(Depth), &|z| 20.0 * z + 7.0),
            (Some(InverseDepth), &|z| 3.0 / z + 0.2),
        ] {
            let folder = tempfile::tempdir().expect("a folder");
            dataset(folder.path());
            for index in 0..3 {
                let row = |row| std::array::from_fn(|column| network(plane(0.2 * index as f64, column, row)) as f32);
                let rows: Vec<[f32; SIZE.0]> = (0..SIZE.1).map(row).collect();
                write_npy(&folder.path().join(format!("arrays/images/{index:02}.npy")), &rows).expect("an array");
            }
            run(&arguments(folder.path(), kind)).expect("imported");
            let options = LoadOptions { depth_kind: Some(gs_datasets::DepthKind::MetricZ), ..LoadOptions::default() };
            let scene = load(folder.path(), &options).expect("a scene");
            let views = scene.train.iter().chain(scene.held_out_views());
            for view in views {
                let x = view.c2w.w_axis.x;
                let prior = view.priors.depth.as_ref().expect("a prior");
                let off = (0..SIZE.0 * SIZE.1)
                    .map(|i| (f64::from(prior.values[i]) / plane(x, i % SIZE.0, i / SIZE.0) - 1.0).abs());
                let worst = off.fold(0.0, f64::max);
                assert!(prior.metric && worst < HALF_A_PIXEL, "{}: {worst}", view.name);
            }
            // A second time over files of its own.
            run(&arguments(folder.path(), kind)).expect("imported");
        }
    }

    #[test]
    fn missing_points_and_depths_are_sentences() {
        let folder = tempfile::tempdir().expect("a folder");
        dataset(folder.path());
        let refused = || run(&arguments(folder.path(), None)).expect_err("refused").to_string();
        assert!(refused().contains("expected depth named after the photos"), "{}", refused());
        let flat = vec![[1.0; SIZE.0]; SIZE.1];
        write_npy(&folder.path().join("arrays/images/00.npy"), &flat).expect("an array");
        assert!(refused().contains("nothing was written"), "{}", refused());
        let text = std::fs::read_to_string(folder.path().join("transforms.json")).expect("read");
        let without = text.replace("ply_file_path", "other_path");
        std::fs::write(folder.path().join("transforms.json"), without).expect("written");
        assert!(refused().contains("expected a data set with points"), "{}", refused());
    }
}
