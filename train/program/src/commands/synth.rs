//! `gsburn synth`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use gs_datasets::{BlurFromFrames, blur_from_frames};
use gs_worlds::deblur::{self, DeblurOptions, PriorFaults, Shakes};
use gs_worlds::driving::StreetOptions;
use gs_worlds::extrapolation::{self, ExtrapolationOptions, PriorErrors};
use gs_worlds::still::{self, StillOptions};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::{
    BlurFromFramesArgs, Synth, SynthArgs, SynthDeblurArgs, SynthDrivingArgs, SynthExtrapolationArgs, SynthStillArgs,
};
use crate::commands::print;

/// Makes the data set.
///
/// # Errors
/// One sentence: options that are not valid, a data set that cannot be blurred, a full disk.
pub fn run(args: &SynthArgs) -> Result<ExitCode> {
    match &args.what {
        Synth::Still(args) => still_world(args),
        Synth::Deblur(args) => deblur_world(args),
        Synth::Extrapolation(args) => extrapolation_world(args),
        Synth::Driving(args) => driving_logs(args),
        Synth::BlurFromFrames(args) => blur(args),
    }
}

/// Fails if the folder has files: those of another data set would mix with the new ones.
fn vacant(folder: &Path) -> Result<()> {
    if folder.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("{}: expected an empty or a new folder, found files in it", folder.display());
    }
    Ok(())
}

fn still_world(args: &SynthStillArgs) -> Result<ExitCode> {
    vacant(&args.out)?;
    let (width, height) = parse_size(&args.size)?;
    let options = StillOptions {
        world: args.world,
        train_views: args.views as usize,
        test_views: args.held_out as usize,
        width,
        height,
        points: args.points,
        seed: args.seed,
    };
    with_bar(|progress| still::write(&args.out, &options, progress))?;
    print(format!("{}: {} photos to learn from, {} held out", args.out.display(), args.views, args.held_out));
    Ok(ExitCode::SUCCESS)
}

fn deblur_world(args: &SynthDeblurArgs) -> Result<ExitCode> {
    vacant(&args.out)?;
    let (width, height) = parse_size(&args.size)?;
    let options = DeblurOptions {
        world: args.world,
        width,
        height,
        cameras: args.cameras as usize,
        held_out: args.held_out as usize,
        ring: args.ring,
        frames: args.frames as usize,
        subframes: args.subframes as usize,
        exposure: args.exposure,
        speed: args.speed,
        shake: args.shake,
        shakes: Shakes::Own,
        readout: args.readout,
        seed: args.seed,
        points: args.points,
        priors: faults(args),
    };
    with_bar(|progress| deblur::write(&args.out, &options, progress))?;
    warn_of_overlap(args.exposure, options.exposure_time());
    print(format!("{}: {} cameras, {} frames each", args.out.display(), args.cameras, args.frames));
    Ok(ExitCode::SUCCESS)
}

fn extrapolation_world(args: &SynthExtrapolationArgs) -> Result<ExitCode> {
    vacant(&args.out)?;
    let (width, height) = parse_size(&args.size)?;
    let usual = ExtrapolationOptions::of(args.world);
    let errors = PriorErrors {
        scale: args.prior_scale,
        shift: args.prior_shift,
        noise: args.prior_noise,
        outliers: args.prior_outliers,
        ..PriorErrors::default()
    };
    let options = ExtrapolationOptions {
        width,
        height,
        cameras: args.cameras.map_or(usual.cameras, |count| count as usize),
        held_out: args.held_out.map_or(usual.held_out, |count| count as usize),
        frames: args.frames as usize,
        truth_every: args.truth_every as usize,
        priors: if args.perfect_priors { PriorErrors::none() } else { errors },
        seed: args.seed,
        ..usual
    };
    with_bar(|progress| extrapolation::write(&args.out, &options, progress))?;
    print(format!(
        "{}: {} cameras, {} held out, {} frames each, of which {} are for training",
        args.out.display(),
        options.cameras,
        options.held_out,
        options.frames,
        options.training_frames()
    ));
    Ok(ExitCode::SUCCESS)
}

fn driving_logs(args: &SynthDrivingArgs) -> Result<ExitCode> {
    vacant(&args.out)?;
    let (width, height) = parse_size(&args.size)?;
    let options = StreetOptions {
        frames: args.frames as usize,
        cameras: args.cameras as usize,
        width,
        height,
        movers: args.movers as usize,
        range_noise: args.range_noise,
        camera_delay: args.camera_delay,
        pose_noise: args.pose_noise,
        ..StreetOptions::default()
    };
    let logs = args.logs as usize;
    with_bar(|bar| {
        (0..logs).try_for_each(|log| {
            let folder = if logs == 1 { args.out.clone() } else { args.out.join(format!("{log:03}")) };
            let in_turn = |list: &[u32]| list[log % list.len()] as usize;
            let options = StreetOptions {
                beams: in_turn(&args.beams),
                columns: in_turn(&args.columns),
                lidars: args.lidars as usize,
                seed: args.seed.wrapping_add(log as u64),
                ..options.clone()
            };
            gs_worlds::driving::write(&folder, &options, |done, total| bar(done + total * log, total * logs))
        })
    })?;
    let sensors =
        [(args.cameras, "camera"), (args.lidars, "LiDAR")].map(|(n, name)| gs_base::counted(n as usize, name));
    let frames = format!("{} frames of {} and {}", args.frames, sensors[0], sensors[1]);
    print(format!("{}: {}, {frames} each", args.out.display(), gs_base::counted(args.logs as usize, "log")));
    Ok(ExitCode::SUCCESS)
}

/// The faults given by the arguments.
fn faults(args: &SynthDeblurArgs) -> PriorFaults {
    if args.perfect_priors { PriorFaults::none() } else { PriorFaults::of(&args.faults) }
}

fn blur(args: &BlurFromFramesArgs) -> Result<ExitCode> {
    vacant(&args.out)?;
    let options = BlurFromFrames {
        window: args.window,
        stride: args.stride,
        max_width: args.max_width,
        moving_masks: args.moving_masks,
    };
    let made = blur_from_frames(&args.dataset, &args.out, &options)?;
    for warning in &made.warnings {
        print(format!("warning: {warning}"));
    }
    warn_of_overlap(args.window as f64 / args.stride as f64, made.exposure);
    print(format!(
        "{}: {} blurry photos of {} cameras with their sharp frames as truth, {} cameras held out, exposure {:.4}",
        args.out.display(),
        made.photos,
        made.train_cameras,
        made.test_cameras,
        made.exposure
    ));
    Ok(ExitCode::SUCCESS)
}

/// Warns if exposures overlap: training takes them for a mistake. `share` is in frame intervals, `exposure` in the data
/// set's unit of time.
fn warn_of_overlap(share: f64, exposure: f64) {
    if share > 1.0 {
        print(format!(
            "warning: the shutter is open for {share:.2} frame intervals; training takes that for a mistake and the exposure for \
             unknown, unless told so: --set blur.exposure={exposure}"
        ));
    }
}

/// Runs `work` under a progress bar over images with the time left; it is told how many of how many are done.
pub(crate) fn with_bar<T, E>(work: impl FnOnce(&(dyn Fn(usize, usize) + Sync)) -> Result<T, E>) -> Result<T, E> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} images, {eta} left");
    let bar = ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let done = work(&|done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    Ok(done)
}

/// Parses "256x192".
fn parse_size(text: &str) -> Result<(usize, usize)> {
    let parts = text.split_once('x').context("--size: expected WIDTHxHEIGHT, as in 256x192");
    let (width, height) = parts.with_context(|| format!("found {text:?}"))?;
    match (width.parse(), height.parse()) {
        (Ok(width), Ok(height)) if (16..=4096).contains(&width) && (16..=4096).contains(&height) => Ok((width, height)),
        _ => bail!("--size: expected WIDTHxHEIGHT from 16 to 4096 pixels, as in 256x192, found {text:?}"),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use gs_worlds::deblur::PriorFault;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: SynthDeblurArgs,
    }

    fn parsed(more: &[&str]) -> Result<PriorFaults, clap::Error> {
        let line = Line::try_parse_from([&["x", "cube", "--out", "y"], more].concat());
        line.map(|line| faults(&line.args))
    }

    #[test]
    fn faults_are_those_asked_for() {
        assert_eq!(parsed(&[]).expect("valid"), PriorFaults::default());
        assert_eq!(parsed(&["--perfect-priors"]).expect("valid"), PriorFaults::none());
        let asked = parsed(&["--faults", "masks,inverse-depth"]).expect("valid");
        assert_eq!(asked, PriorFaults::of(&[PriorFault::Masks, PriorFault::InverseDepth]));
        assert!(parsed(&["--faults", "masks", "--perfect-priors"]).is_err());
    }
}
