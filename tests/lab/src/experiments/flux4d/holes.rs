//! Black images, missing sweeps and nearly empty ones.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use gs_base::write_atomic;
use gs_worlds::driving::StreetOptions;

use super::along::REST;
use super::trial::{Outcome, applied, network, street};
use crate::experiments::lab::whole as whole_folder;
use crate::experiments::{Findings, Lab};

/// The frame whose image or sweep is spoiled: an input in the middle.
const FRAME: &str = "04";

/// PSNR that one black image or missing sweep of six may cost, dB.
const BOUND: f64 = 1.0;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let saved = network(lab)?;
    let apply = |path: &Path| applied(lab, path, &saved.network, &saved.config);
    let whole = lab.street(&street())?;
    let exact = apply(&whole)?;
    let black = spoiled(&whole, "black", |folder| {
        let path = folder.join("camera/front_camera").join(format!("{FRAME}.jpg"));
        let image = image::RgbImage::new(street().width as u32, street().height as u32);
        let mut bytes = Vec::new();
        image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Jpeg)?;
        Ok(write_atomic(&path, &bytes)?)
    })?;
    let missing = spoiled(&whole, "missing", |folder| {
        let path = folder.join("lidar").join(format!("{FRAME}.pkl.gz"));
        fs::remove_file(&path).with_context(|| format!("{}: cannot be removed", path.display()))
    })?;
    let one_beam = lab.street(&StreetOptions { beams: 1, ..street() })?;
    for (name, path) in [("a black input image", &black), ("a missing input sweep", &missing)] {
        let outcome = apply(path)?;
        let lost = exact.psnr - outcome.psnr;
        found.at_most(format!("{name}: PSNR lost"), lost, BOUND, "dB");
        found.note(said(name, &outcome));
    }
    let outcome = apply(&one_beam)?;
    found.at_most("a LiDAR of one beam: speed of what rests", outcome.resting, REST, "m/s");
    found.note(said("a LiDAR of one beam", &outcome));
    found.note(said("nothing spoiled", &exact));
    Ok(())
}

fn said(name: &str, outcome: &Outcome) -> String {
    let Outcome { psnr, moving, resting, skipped, .. } = outcome;
    format!("{name}: {psnr:.2} dB, moving EPE {moving:.3} m, at rest {resting:.3} m/s, {skipped} snippets skipped.")
}

/// A copy of a street that is spoiled, made once.
fn spoiled(whole: &Path, name: &str, spoil: impl FnOnce(&Path) -> Result<()>) -> Result<PathBuf> {
    let mut target = whole.as_os_str().to_owned();
    target.push(format!("-{name}"));
    let target = PathBuf::from(target);
    whole_folder(&target, |part| {
        copy(whole, part)?;
        spoil(part)
    })?;
    Ok(target)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        match entry.file_type()?.is_dir() {
            true => copy(&entry.path(), &target)?,
            false => drop(fs::copy(entry.path(), target)?),
        }
    }
    Ok(())
}
