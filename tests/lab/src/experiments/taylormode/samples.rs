//! How many instants does an exposure need?

use anyhow::Result;
use burn::tensor::Tensor;
use gs_burn::exposure::ExposureOptions;
use gs_burn::render;
use gs_datasets::View;
use gs_models::DynamicScene;
use gs_models::taylormode::{Samples, TaylorScene};
use gs_pipelines::taylormode::Step;
use gs_pipelines::taylormode::blur::expose;
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::camera;
use gs_worlds::deblur::World;

use super::trial::trial;
use crate::experiments::lab::small;
use crate::experiments::{Findings, Lab, Series, largest};

/// Instants of the reference.
const REFERENCE: usize = 129;

/// A pixel is blurred when it differs from the sharp rendering by more than this, encoded values.
const BLURRED: f32 = 1.0 / 255.0;

/// Share of the moving Gaussians that the pixels of motion bound; outliers do not count.
const SHARE: f64 = 0.95;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let scene = lab.world(&small(World::Cube, 6))?;
    let trial = trial(lab, &scene, &[])?;
    let session = trial.trained(lab)?;
    let (model, exposure) = (session.scene(), session.method().exposure_on_host());
    let at = session.fit.at();
    let middle = model.motion.window.t0;
    let views: Vec<&View> = scene.train.iter().filter(|view| view.time == Some(middle)).take(2).collect();
    let counts: &[usize] = lab.either(&[3, 5, 7, 9, 13, 17, 33], &[3, 9, 33]);
    let (mut series, mut bound) = (Vec::new(), Vec::new());
    for factor in [0.5, 1.0, 2.0] {
        let tau = factor * exposure;
        let mut points = Vec::new();
        for view in &views {
            let former = Former { model: &model, tau, view, at: &at };
            let truth = former.form(REFERENCE);
            let sharp = former.sharp();
            let pixels = former.pixels_of_motion();
            for count in counts {
                let error = mean_difference(&former.form(*count), &truth, &sharp);
                let per_sample = pixels / *count as f64;
                points.push((per_sample, 255.0 * error));
                if per_sample <= 1.0 {
                    bound.push(255.0 * error);
                }
            }
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        series.push(Series::line_and_dots(&format!("{factor} x the exposure"), points));
    }
    let what = "mean difference from 129 instants over blurred pixels, where things move at most 1 pixel an instant";
    found.at_most(what, largest(bound), 1.0, "/255");
    let axes = ["pixels of motion per instant", "mean difference, 1/255"];
    found.chart("", "Too few instants in an exposure", axes, series);
    found.note(
        "The mean is over pixels that the blur changes by more than 1/255, not over the whole image, most of which no \
         motion reaches.",
    );
    Ok(())
}

struct Former<'a> {
    model: &'a TaylorScene,
    tau: f64,
    view: &'a View,
    at: &'a Step<'a>,
}

impl Former<'_> {
    fn time(&self) -> f64 {
        self.view.time.unwrap_or(0.0)
    }

    /// The blurred image from `count` instants, `[H, W, 3]`.
    fn form(&self, count: usize) -> Vec<f32> {
        let gaussians = &self.model.gaussians;
        let instants = Samples::Middles.instants(self.time(), self.tau, count);
        let render = self.at.facts.render_options(&self.at.config.render, gaussians.sh_degree());
        let options = ExposureOptions { render, linear: true, room: None };
        let camera = camera(self.view, &gaussians.device());
        let (paths, rows) = (self.model.paths(), &self.model.motion.rows);
        to_host(expose(gaussians, &paths, rows, &instants, &camera, &options, None).color)
    }

    fn sharp(&self) -> Vec<f32> {
        let gaussians = self.model.at(self.time());
        let options = self.at.facts.render_options(&self.at.config.render, gaussians.sh_degree());
        to_host(render(&gaussians, &camera(self.view, &gaussians.device()), &options).color)
    }

    /// Pixels of motion of the moving Gaussians during the exposure.
    fn pixels_of_motion(&self) -> f64 {
        let motion = self.model.paths();
        let moved =
            motion.displacement(self.time() + 0.5 * self.tau) - motion.displacement(self.time() - 0.5 * self.tau);
        let lengths = to_host((moved.clone() * moved).sum_dim(1).sqrt());
        let positions: Tensor<2> = motion.means_at(self.model.gaussians.means.val(), self.time());
        let positions = to_host(positions.select(0, motion.rows.clone()));
        let inverse = self.view.c2w.inverse();
        let pixels = lengths.iter().zip(positions.as_chunks::<3>().0).map(|(length, position)| {
            let depth = inverse.transform_point3(glam::Vec3::from(*position).as_dvec3()).z;
            // The largest possible motion in the image, in any direction.
            f64::from(*length) * self.view.intrinsics.fx / depth.max(f64::MIN_POSITIVE)
        });
        let mut pixels: Vec<f64> = pixels.collect();
        pixels.sort_by(f64::total_cmp);
        pixels.get((SHARE * pixels.len() as f64) as usize).copied().unwrap_or(f64::NAN)
    }
}

/// Mean absolute difference of two images over the values in which the second differs from `sharp`; NaN if there is
/// none.
fn mean_difference(image: &[f32], truth: &[f32], sharp: &[f32]) -> f64 {
    let blurred = (0..truth.len()).filter(|i| (truth[*i] - sharp[*i]).abs() > BLURRED);
    let (sum, count) =
        blurred.fold((0.0, 0), |(sum, count), i| (sum + f64::from((image[i] - truth[i]).abs()), count + 1));
    sum / f64::from(count)
}
