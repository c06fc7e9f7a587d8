//! The cost of opacity resets. Classic density control lowers all opacities at intervals; authors of deblurring
//! methods avoid it.

use anyhow::Result;
use gs_burn::render;
use gs_datasets::{Scene, View};
use gs_pipelines::fit::SceneMethod;
use gs_pipelines::still::Still;
use gs_train::fit::photos::{camera, to_tensor};
use gs_train::run::metrics::psnr;
use gs_worlds::deblur::{DeblurOptions, World};

use super::trial::{SHARED, trial};
use crate::experiments::lab::{Session, Trial, small};
use crate::experiments::{Findings, Lab, Series, largest};

/// Steps between measurements.
const EVERY: usize = 15;

/// Smallest drop below the best PSNR so far that counts, dB, and its longest duration, steps: a policy that costs more
/// is not recommended.
const DROP: f64 = 3.0;
const LASTING: f64 = 300.0;

/// The background of all three scenes: lowered opacities show it, so only falls before one colour compare.
const BACKGROUND: &str = "data.background=[0.0, 0.0, 0.0]";

const POLICIES: [&str; 3] = ["reset", "decay", "none"];

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let moving = lab.world(&small(World::Lychee, 6))?;
    let sharp = lab.world(&DeblurOptions { exposure: 0.0, ..small(World::Lychee, 6) })?;
    let static_scene = lab.world(&DeblurOptions { speed: 0.0, exposure: 0.0, ..small(World::Lychee, 2) })?;
    let scenes: [(&str, &Scene, &[&str]); 3] = [
        ("moving", &moving, &[]),
        ("sharp", &sharp, &["blur.mode=none", "prior.sharp=0"]),
        ("still", &static_scene, &[]),
    ];
    for scene in scenes {
        let name = scene.0;
        let curves = POLICIES.iter().map(|policy| along(lab, scene, policy)).collect::<Result<Vec<_>>>()?;
        let [reset, decay, none] = [0, 1, 2].map(|i| curves[i].last().map_or(f64::NAN, |(_, psnr)| *psnr));
        let what = format!("{name}: PSNR with decay above that with reset at the end");
        found.at_least(what, decay - reset, -0.1, "dB");
        let what = format!("{name}: longest fall of more than 3 dB, all policies");
        found.at_most(what, largest(curves.iter().map(|curve| longest_fall(curve))), LASTING, "steps");
        found.note(format!("{name}: {reset:.2} dB with reset, {decay:.2} dB with decay, {none:.2} dB with neither."));
        let series = POLICIES.iter().zip(curves).map(|(policy, curve)| Series::line(policy, curve));
        found.chart(name, format!("Opacity policy, {name} scene"), ["step", "held-out PSNR, dB"], series);
    }
    let interval = reset_interval(lab);
    found.note(format!(
        "Resets come every {interval} steps here, which is often; at the 3000 of the original recipe none would be \
         seen."
    ));
    Ok(())
}

/// Steps from one reset to the next: two in a run, with a third of it to recover from the second.
fn reset_interval(lab: &Lab) -> usize {
    lab.steps() / 3
}

/// PSNR of the held-out views along a run of a scene by classic density control with an opacity policy.
fn along(lab: &Lab, (name, scene, changes): (&str, &Scene, &[&str]), policy: &str) -> Result<Vec<(f64, f64)>> {
    let policy = format!("density.default.opacity_policy={policy}");
    let reset = format!("density.default.reset_every={}", reset_interval(lab));
    let fixed = [BACKGROUND, "density.strategy=default", "density.stop=0.7", &policy, &reset];
    match name {
        "still" => {
            curve(lab, Trial::<Still>::new(lab, scene.clone(), &[&SHARED[..], &fixed, changes].concat())?.begin(lab))
        }
        _ => curve(lab, trial(lab, scene, &[&fixed, changes].concat())?.begin(lab)),
    }
}

fn curve<M: SceneMethod>(lab: &Lab, mut session: Session<M>) -> Result<Vec<(f64, f64)>> {
    let mut points = Vec::new();
    for step in (EVERY..=session.fit.config.steps).step_by(EVERY) {
        session.until(step)?;
        points.push((step as f64, held_out(lab, &session)));
    }
    Ok(points)
}

/// PSNR over two held-out views: measurements take most of the time, and there are many.
fn held_out<M: SceneMethod>(lab: &Lab, session: &Session<M>) -> f64 {
    let (data, config) = (session.fit.data, session.fit.config);
    let model = session.fit.trainer.scene();
    let all: Vec<&View> = data.scene.held_out_views().collect();
    let views = all.iter().step_by(all.len().div_ceil(2).max(1));
    let each = views.map(|view| {
        let gaussians = model.at(view.time.unwrap_or(0.0));
        let options = data.facts.render_options(&config.render, gaussians.sh_degree());
        let image = render(&gaussians, &camera(view, &lab.device), &options).color.clamp(0.0, 1.0);
        psnr(image, to_tensor(view, &view.image.data, 3, &lab.device))
    });
    let each: Vec<f64> = each.collect();
    each.iter().sum::<f64>() / each.len() as f64
}

/// Steps of the longest stretch more than [`DROP`] below the best before it.
fn longest_fall(curve: &[(f64, f64)]) -> f64 {
    let (mut best, mut from, mut longest) = (f64::NEG_INFINITY, None, 0.0_f64);
    for (step, psnr) in curve {
        best = best.max(*psnr);
        if *psnr >= best - DROP {
            from = None;
            continue;
        }
        let begun = *from.get_or_insert(*step - EVERY as f64);
        longest = longest.max(step - begun);
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_are_timed() {
        let curve = [20.0, 25.0, 18.0, 21.0, 24.0, 10.0].map(|psnr| (0.0, psnr));
        let curve: Vec<(f64, f64)> =
            curve.iter().enumerate().map(|(i, (_, psnr))| ((i * EVERY) as f64, *psnr)).collect();
        assert_eq!(longest_fall(&curve), 2.0 * EVERY as f64);
        assert_eq!(longest_fall(&curve[..2]), 0.0);
    }
}
