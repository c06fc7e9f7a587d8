//! Does the blur model absorb the scene's own blur? A blur model that explains the photos perfectly can leave the scene
//! as blurry as they are.

use anyhow::Result;
use gs_burn::render;
use gs_datasets::Scene;
use gs_models::DynamicScene;
use gs_pipelines::taylormode::Taylormode;
use gs_train::fit::parameters::to_host;
use gs_train::run::metrics::psnr_of_mse;
use gs_worlds::deblur::{DeblurOptions, World};

use super::trial::trial;
use crate::experiments::lab::{Session, moving_psnr, small};
use crate::experiments::{Findings, Lab, Series};

/// Measurements along a run.
const LOOKS: usize = 6;

/// Formations of a blurry photo, with the changes to the lab's recipe: the exact formation, the paper's warp with its
/// weights network, and no blur model. None uses a pseudo-sharp photo, which would keep any scene sharp.
const MODES: [(&str, &[&str]); 3] = [
    ("integrate", &["blur.mode=integrate", "prior.pseudo=false"]),
    ("warp", &["blur.mode=warp", "blur.decouple=true", "blur.samples=7", "prior.pseudo=false"]),
    ("none", &["blur.mode=none", "prior.pseudo=false"]),
];

struct Trained {
    /// PSNR over moving parts of training photos as formed, and of held-out sharp ones, at each measurement.
    along: Vec<(f64, f64)>,
    /// Sharp PSNR over moving parts, by step.
    sharp: Vec<(f64, f64)>,
    /// Mean change of moving pixels by blur at the end, 0 to 1.
    blur: f64,
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let blurry = lab.world(&small(World::Cube, 6))?;
    let sharp = lab.world(&DeblurOptions { exposure: 0.0, ..small(World::Cube, 6) })?;
    let train = |scene: &Scene| -> Result<Vec<Trained>> {
        MODES.iter().map(|(_, changes)| trained(lab, scene, changes)).collect()
    };
    let (on_blurry, on_sharp) = (train(&blurry)?, train(&sharp)?);
    let last = |trained: &Trained| trained.sharp.last().map_or(f64::NAN, |(_, psnr)| *psnr);
    for (index, (name, _)) in MODES.iter().enumerate().take(2) {
        let gain = last(&on_blurry[index]) - last(&on_blurry[2]);
        let what = format!("{name}: sharp PSNR of moving parts above that without a blur model");
        found.at_least(what, gain, 0.0, "dB");
    }
    for (index, (name, _)) in MODES.iter().enumerate().take(2) {
        let what = format!("{name}, sharp photos: mean change that the blur makes to moving pixels, of 1");
        found.at_most(what, on_sharp[index].blur, 0.02, "");
        let gain = last(&on_sharp[index]) - last(&on_sharp[2]);
        let what = format!("{name}, sharp photos: PSNR of moving parts against that without a blur model");
        found.at_least(what, gain, -0.1, "dB");
    }
    let lines = |trained: Vec<Trained>, points: fn(Trained) -> Vec<(f64, f64)>| -> Vec<Series> {
        let named = MODES.iter().zip(trained);
        named.map(|((name, _), trained)| Series::line_and_dots(name, points(trained))).collect()
    };
    let y = "sharp PSNR of moving parts, dB";
    let x = "training photos as the run forms them, PSNR of moving parts, dB";
    let along = lines(on_blurry, |trained| trained.along);
    found.chart("", "Forming the photos against being sharp", [x, y], along);
    found.chart("null", "Null test: photos without blur", ["step", y], lines(on_sharp, |trained| trained.sharp));
    found.note(
        "The set of sharp photos says that its exposure is 0, so runs begin with half a frame interval and must find \
         that there is none.",
    );
    found.note(
        "What a weight network gives away from the exposure's centre is measured by what that does to the image.",
    );
    Ok(())
}

fn trained(lab: &Lab, scene: &Scene, changes: &[&str]) -> Result<Trained> {
    // The exposure can change as much as in 4000 steps of a real run; a quick one has no time for that.
    let rate = lab.either("blur.exposure_lr=8e-3", "blur.exposure_lr=3e-2");
    let changes: Vec<&str> = changes.iter().copied().chain([rate]).collect();
    let trial = trial(lab, scene, &changes)?;
    let mut session = trial.begin(lab);
    let mut trained = Trained { along: Vec::new(), sharp: Vec::new(), blur: 0.0 };
    for look in 1..=LOOKS {
        session.until(look * lab.steps() / LOOKS)?;
        let found = session.measure();
        let formed = formed(&mut session, scene);
        trained.along.push((formed.psnr, moving_psnr(&found)));
        trained.blur = formed.change;
        trained.sharp.push((session.fit.trainer.step as f64, moving_psnr(&found)));
    }
    Ok(trained)
}

/// Some training photos as the run forms them, over their moving pixels.
struct FormedPhotos {
    /// PSNR against the photos, dB.
    psnr: f64,
    /// Mean difference from the sharp rendering, 0 to 1.
    change: f64,
}

fn formed(session: &mut Session<Taylormode>, scene: &Scene) -> FormedPhotos {
    let (mut squares, mut change, mut count) = (0.0, 0.0, 0.0);
    for index in (0..scene.train.len()).step_by(4) {
        let (photo, formed) = session.fit.formed(index);
        let Some(moving) = &scene.train[index].truth.moving else { continue };
        let gaussians = session.scene().at(photo.time);
        let (facts, config) = (session.fit.data.facts, session.fit.config);
        let options = facts.render_options(&config.render, gaussians.sh_degree());
        let sharp = to_host(render(&gaussians, &photo.camera, &options).color);
        let (formed, truth) = (to_host(formed), to_host(photo.image));
        for pixel in (0..moving.len()).filter(|pixel| moving[*pixel] > 0) {
            let channels = 3 * pixel..3 * pixel + 3;
            let mean = |f: &dyn Fn(usize) -> f32| channels.clone().map(|c| f64::from(f(c)) / 3.0).sum::<f64>();
            squares += mean(&|c| (formed[c] - truth[c]).powi(2));
            change += mean(&|c| (formed[c] - sharp[c]).abs());
            count += 1.0;
        }
    }
    FormedPhotos { psnr: psnr_of_mse(squares / count), change: change / count }
}
