//! One step on one blurry photo: form the image, compare, add the priors, go back (Eq. 13 to 19).

use burn::tensor::{IndexingUpdateOp, Tensor, TensorData};
use gs_burn::exposure::{ExposureOptions, MovingSample, render_exposure};
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Extras, Gaussians, RenderOptions, Rendering, profile, render_with};
use gs_models::light::Mixing;
use gs_models::taylormode::blur_path::{back_project, blur_path, camera_velocity, hybrid_depth, to_world};
use gs_models::taylormode::blur_synthesis::{blurred_color, decoupled};
use gs_models::taylormode::{
    Alignment, BlurWeights, DepthSpace, DirectVelocity, Exposure, PeanoMap, Pixels, Samples, align, losses,
};

use crate::data::Photo;
use crate::density::Observation;
use crate::experiment::Config;
use crate::losses::regularisers;
use crate::parameters::{Gradients, to_host};
use crate::step::{Compared, Trainer};
use crate::taylormode::config::{BlurMode, VelocitySource};
use crate::taylormode::state::{Lent, MotionGradients, MotionState, Network};

/// Compares the scene with a photo that was exposed for a while, and goes back.
pub(crate) fn compare(trainer: &Trainer, state: &MotionState, photo: &Photo, config: &Config) -> Compared {
    let tracked = trainer.parameters.tracked();
    let lent = state.lend(&tracked);
    let options = config.render.options(trainer.parameters.sh_degree(), config.data.background);
    let screen = trainer.wants_screen(config).then(|| {
        Tensor::<2>::zeros([trainer.parameters.len(), 4], &trainer.parameters.device()).autodiff().require_grad()
    });
    let step = Step {
        state,
        lent: &lent,
        tracked: &tracked,
        photo,
        config,
        options,
        progress: trainer.progress(config),
        units: units(trainer.extent, state),
    };
    let formed = match config.blur.mode {
        BlurMode::None => step.unblurred(screen.clone()),
        BlurMode::Integrate => step.integrated(screen.clone()),
        BlurMode::Warp => step.warped(screen.clone()),
    };
    let loss = formed.loss + regularisers(&tracked, trainer.extent, &config.loss);
    let mut gradients = profile::timed("backward, rest of the graph", || loss.backward());

    let observation = Observation {
        screen: screen.and_then(|screen| screen.grad_remove(&mut gradients)),
        radii: formed.radii.inner(),
        width: photo.camera.width,
        height: photo.camera.height,
    };
    let of_table = Gradients::take(&tracked, &mut gradients);
    let of_motion: MotionGradients = MotionState::take(&lent, &mut gradients);
    let _stage = profile::stage("check of the gradients");
    let checked = Tensor::cat(vec![loss.inner(), of_table.finiteness() + of_motion.finiteness()], 0).into_data();
    let checked = checked.as_slice::<f32>().expect("tensors of this crate hold f32");
    let finite = checked.iter().all(|value| value.is_finite());
    Compared {
        color: formed.color.inner(),
        intersections: formed.intersections,
        observation,
        loss: checked[0],
        gradients: finite.then_some((of_table, Some(of_motion))),
    }
}

/// Depths of about the scene's size, and speeds that cross a tenth of it in half the recording, are 1 to the networks.
pub fn units(extent: f64, state: &MotionState) -> (f64, f64) {
    (extent, 0.1 * extent / state.window.half)
}

/// What an image formation hands to the step.
struct Formed {
    /// What stands beside the photo: blurred where blur is modelled, `[H, W, 3]`.
    color: Tensor<3>,
    loss: Tensor<1>,
    radii: Tensor<1>,
    intersections: usize,
}

struct Step<'a> {
    state: &'a MotionState,
    lent: &'a Lent,
    tracked: &'a Gaussians,
    photo: &'a Photo,
    config: &'a Config,
    options: RenderOptions,
    /// Share of the run done, 0 to 1.
    progress: f64,
    /// What depths (scene units) and speeds (scene units per unit of time) are divided by before a network sees them.
    units: (f64, f64),
}

impl Step<'_> {
    /// ITG (Table 1): displacement fitted to the blurry frame as if it were sharp.
    fn unblurred(&self, screen: Option<Tensor<2>>) -> Formed {
        let centre = self.centre(screen);
        let color = centre.color.clone();
        let loss = self.add_depth(self.photometric(color.clone(), self.photo.image.clone(), None), &centre);
        Formed { color, loss, radii: centre.radii(), intersections: centre.intersections }
    }

    /// The exact formation: rendered at times inside the exposure and averaged.
    fn integrated(&self, screen: Option<Tensor<2>>) -> Formed {
        let blur = &self.config.blur;
        let decoupled = blur.decouple && self.photo.hints.moving.is_some();
        let scene = if decoupled { self.static_detached() } else { self.tracked.clone() };
        let render = RenderOptions { depth: self.needs_depth(), ..self.options };
        let options = ExposureOptions { render, linear: blur.linear };
        let samples = self.samples(&scene);
        let formed = render_exposure(&scene, &self.state.rows, &samples, &self.photo.camera, &options, screen);
        let image = self.photo.image.clone();
        let mut intersections = formed.intersections;
        let mut loss = if decoupled {
            self.photometric(formed.color.clone(), image, self.photo.hints.moving.clone()) * self.config.prior.blur
        } else {
            self.photometric(formed.color.clone(), image, None)
        };
        if decoupled || self.priors_count() {
            // An odd number of samples has one at the centre, which is drawn already.
            let centre = if decoupled || samples.len().is_multiple_of(2) {
                let centre = self.centre(None);
                intersections += centre.intersections;
                centre
            } else {
                formed.middle()
            };
            let sharp = if decoupled { self.sharp_term(&centre) } else { self.pseudo_term(&centre) };
            if let Some(sharp) = sharp.filter(|_| self.config.prior.sharp > 0.0) {
                loss = loss + sharp * self.config.prior.sharp;
            }
            loss = self.add_depth(loss, &centre);
        }
        Formed { radii: formed.radii(), color: formed.color, loss, intersections }
    }

    /// The paper's formation: the sharp image gathered along the velocity at each moving pixel (Eq. 5 to 12).
    fn warped(&self, screen: Option<Tensor<2>>) -> Formed {
        let (blur, prior) = (&self.config.blur, &self.config.prior);
        let photo = self.photo;
        let centre = self.centre(screen);
        let mut loss = self.add_depth(self.sharp_loss(&centre), &centre);
        let finished = |color: Tensor<3>, loss: Tensor<1>| Formed {
            color,
            loss,
            radii: centre.radii(),
            intersections: centre.intersections,
        };
        let all = Pixels::all(photo.camera.width, photo.camera.height, &self.state.row_tensor().device());
        let pixels = match (&photo.hints.moving, &photo.hints.pixels) {
            (None, _) => &all,
            (Some(_), Some(pixels)) => pixels,
            // Nothing moves in this photo: there is no blur to form.
            (Some(_), None) => return finished(centre.color.clone(), loss),
        };
        let count = photo.camera.width * photo.camera.height;

        let depth = pixels.of(self.hybrid_depth(&centre));
        let velocity = camera_velocity(self.velocity(pixels, &centre, &depth), &photo.camera.viewmat);
        let offsets = self.exposure().offsets(Samples::Ends, blur.samples);
        let path = blur_path(pixels, depth.clone(), velocity.clone(), &photo.camera.intrinsics, offsets);
        let weights = self.lent.network(Network::Weights).filter(|_| blur.weights).map(|mlp| {
            let (depth_unit, velocity_unit) = self.units;
            BlurWeights { mlp, depth_unit, velocity_unit }.forward(depth, velocity.clone())
        });
        let sharp = match &photo.hints.moving {
            Some(moving) if blur.decouple => decoupled(centre.color.clone(), moving.clone()),
            _ => centre.color.clone(),
        };
        let mixing = if blur.linear { Mixing::Linear } else { Mixing::Encoded };
        let blurred = blurred_color(sharp, path, weights.clone(), mixing);

        loss = loss + losses::blur_loss(blurred.clone(), pixels.of(photo.image.clone()), count) * prior.blur;
        if let Some(weights) = weights.filter(|_| prior.smooth > 0.0) {
            loss = loss + losses::smoothness_loss(weights, count) * prior.smooth;
        }
        if let Some(guide) = photo.hints.guide.filter(|_| prior.velocity > 0.0 && self.progress < prior.until) {
            let guide: Tensor<2> = Tensor::<1>::from_floats(guide.map(|x| x as f32), &velocity.device()).unsqueeze();
            let guide = camera_velocity(guide, &photo.camera.viewmat);
            loss = loss + losses::velocity_loss(velocity, guide, count) * prior.velocity;
        }
        finished(pixels.paste(blurred, centre.color.clone()), loss)
    }

    /// Eq. 6: the prior, aligned to what is rendered, and the rendering.
    fn hybrid_depth(&self, centre: &Rendering) -> Tensor<3> {
        let rendered = centre.expected_depth().expect("the centre is rendered with depth");
        match self.aligned_prior(&rendered, &centre.alpha) {
            Some(prior) => hybrid_depth(rendered, prior, self.config.blur.depth_beta),
            None => rendered,
        }
    }

    /// World velocity at the pixels, `[P, 3]`: splatted (Eq. 4) and corrected (Eq. 5), or predicted directly.
    fn velocity(&self, pixels: &Pixels, centre: &Rendering, depth: &Tensor<2>) -> Tensor<2> {
        let blur = &self.config.blur;
        let s = self.state.window.normalised(self.photo.time);
        let (depth_unit, velocity_unit) = self.units;
        if blur.velocity == VelocitySource::Network {
            let mlp = self.lent.network(Network::Velocity).expect("the recipe has this network");
            let camera = &self.photo.camera;
            let places = to_world(back_project(pixels, depth.clone().detach(), &camera.intrinsics), &camera.viewmat);
            let network = DirectVelocity {
                mlp,
                centre: Tensor::zeros([1, 3], &places.device()),
                scale: depth_unit,
                unit: velocity_unit,
            };
            return network.forward(places, s);
        }
        let splatted = pixels.of(centre.features.clone().expect("the centre is rendered with velocities"));
        match self.lent.network(Network::Peano).filter(|_| blur.peano) {
            Some(mlp) => PeanoMap { mlp, unit: velocity_unit }.forward(splatted, s),
            None => splatted,
        }
    }

    /// The sharp image at the exposure's centre, with depth and splatted velocity (Eq. 4).
    fn centre(&self, screen: Option<Tensor<2>>) -> Rendering {
        let t = self.photo.time;
        let scene = self.lent.motion.moved(self.tracked, t);
        let features = self.needs_velocity().then(|| self.lent.motion.velocities(self.tracked.len(), t));
        let options = RenderOptions { depth: self.needs_depth(), ..self.options };
        render_with(&scene, &self.photo.camera, &options, Extras { features, screen })
    }

    fn needs_velocity(&self) -> bool {
        self.config.blur.mode == BlurMode::Warp && self.config.blur.velocity == VelocitySource::Taylor
    }

    fn needs_depth(&self) -> bool {
        let compared = self.config.prior.depth > 0.0 && self.photo.hints.depth.is_some();
        self.config.blur.mode == BlurMode::Warp || (compared && self.progress < self.config.prior.until)
    }

    /// Whether any prior beside the photo itself has a say now.
    fn priors_count(&self) -> bool {
        let (prior, hints) = (&self.config.prior, &self.photo.hints);
        let pseudo = prior.pseudo && prior.sharp > 0.0 && hints.sharp.is_some() && hints.moving.is_some();
        let depth = prior.depth > 0.0 && hints.depth.is_some();
        self.progress < prior.until && (pseudo || depth)
    }

    /// Where the moving Gaussians are at times inside the exposure.
    fn samples(&self, scene: &Gaussians) -> Vec<MovingSample> {
        let exposure = self.exposure();
        let (means, quats) = (scene.means.val(), scene.quats.val());
        // Middles: the mean over them is exact to second order, and their extent is that of the shutter for any count.
        let instants = exposure.instants(self.photo.time, Samples::Middles, self.config.blur.samples);
        instants
            .into_iter()
            .map(|instant| {
                let (means, quats) = self.lent.motion.sample_rows(&means, &quats, instant);
                MovingSample { means, quats }
            })
            .collect()
    }

    /// The exposure, tracked where it is learned.
    fn exposure(&self) -> Exposure {
        let exposure = self.lent.exposure.clone();
        if self.config.blur.learn_exposure { exposure } else { exposure.map(Tensor::inner) }
    }

    /// The scene with its static Gaussians out of the graph (section 3.4).
    fn static_detached(&self) -> Gaussians {
        let (scene, rows) = (self.tracked, &self.lent.motion.rows);
        let device = rows.device();
        let ones = Tensor::<2>::ones([rows.dims()[0], 1], &device);
        let moves =
            Tensor::zeros([scene.len(), 1], &device).select_assign(0, rows.clone(), ones, IndexingUpdateOp::Add);
        // The value is x either way, since x - x is exactly zero for every finite x; the gradient of static rows is zero.
        let two = |x: Tensor<2>| (x.clone() - x.clone().detach()) * moves.clone() + x.detach();
        let sh = scene.sh.val();
        let [count, coefficients, channels] = sh.dims();
        let flat = two(sh.reshape([count, coefficients * channels]));
        Gaussians::from_tensors(
            two(scene.means.val()),
            two(scene.quats.val()),
            two(scene.log_scales.val()),
            two(scene.opacity_logits.val().unsqueeze_dim(1)).squeeze_dim(1),
            flat.reshape([count, coefficients, channels]),
        )
    }

    fn sharp_loss(&self, centre: &Rendering) -> Tensor<1> {
        match self.sharp_term(centre) {
            Some(term) => term * self.config.prior.sharp,
            None => Tensor::zeros([1], &centre.color.device()),
        }
    }

    /// Eq. 14 against the hybrid target of Eq. 13. Where things move and no pseudo-sharp photo is there, nothing is compared.
    fn sharp_term(&self, centre: &Rendering) -> Option<Tensor<1>> {
        let (hints, image) = (&self.photo.hints, self.photo.image.clone());
        let color = centre.color.clone();
        let Some(moving) = hints.moving.clone() else {
            return Some(self.photometric(color, image, None));
        };
        let pseudo =
            hints.sharp.clone().filter(|_| self.config.prior.pseudo && self.progress < self.config.prior.until);
        Some(match pseudo {
            Some(sharp) => self.photometric(color, losses::hybrid_target(sharp, image, moving), None),
            None if self.config.prior.pseudo => self.photometric(color, image, Some(moving.neg() + 1.0)),
            None => self.photometric(color, image, None),
        })
    }

    /// The sharp term inside the moving part alone, where the photo itself says everything about the rest.
    fn pseudo_term(&self, centre: &Rendering) -> Option<Tensor<1>> {
        let (moving, sharp) = (self.photo.hints.moving.clone()?, self.photo.hints.sharp.clone()?);
        self.config.prior.pseudo.then(|| self.photometric(centre.color.clone(), sharp, Some(moving)))
    }

    /// `(1 - dssim) L1 + dssim (1 - SSIM)` over the pixels of `region` that count.
    fn photometric(&self, color: Tensor<3>, truth: Tensor<3>, region: Option<Tensor<3>>) -> Tensor<1> {
        let region = match (region, self.photo.mask.clone()) {
            (Some(region), Some(mask)) => Some(region * mask),
            (region, mask) => region.or(mask),
        };
        match region {
            None => photometric_loss(color, truth, self.config.loss.dssim),
            // Pixels outside are black in both, so neither term sees a difference there.
            Some(region) => photometric_loss(color * region.clone(), truth * region, self.config.loss.dssim),
        }
    }

    /// The term of Eq. 16.
    fn add_depth(&self, loss: Tensor<1>, centre: &Rendering) -> Tensor<1> {
        let prior = &self.config.prior;
        if prior.depth <= 0.0 || self.progress >= prior.until {
            return loss;
        }
        let Some(depth) = centre.expected_depth() else { return loss };
        match self.aligned_prior(&depth, &centre.alpha) {
            Some(aligned) => loss + losses::depth_loss(depth, aligned) * prior.depth,
            None => loss,
        }
    }

    /// The depth prior in scene units, `[H, W, 1]`, 0 where unknown; `None` where it fits nothing that is rendered.
    fn aligned_prior(&self, rendered: &Tensor<3>, alpha: &Tensor<3>) -> Option<Tensor<3>> {
        let (values, space, metric) = self.photo.hints.depth.as_ref()?;
        let space = match space {
            gs_datasets::DepthSpace::Depth => DepthSpace::Depth,
            gs_datasets::DepthSpace::InverseDepth => DepthSpace::InverseDepth,
        };
        let aligned = if *metric || !self.config.prior.align_depth {
            Alignment { space, scale: 1.0, shift: 0.0, inliers: 1.0, deviation: 0.0 }
        } else {
            let (rendered, alpha) = (to_host(rendered.clone().inner()), to_host(alpha.clone().inner()));
            align(values, &rendered, Some(&alpha), space)?
        };
        Some(Tensor::from_data(TensorData::new(aligned.depth(values), rendered.dims()), &rendered.device()))
    }
}
