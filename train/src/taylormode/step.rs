//! One step on one blurry photo: form the image, compare, add the priors, go back (Eq. 13 to 19).

use burn::tensor::Tensor;
use gs_burn::exposure::{ExposureOptions, MovingSample, render_exposure};
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Extras, Gaussians, RenderOptions, Rendering, render_with};
use gs_models::taylormode::{losses, warp};

use crate::data::Photo;
use crate::density::Observation;
use crate::experiment::Config;
use crate::losses::regularisers;
use crate::parameters::Gradients;
use crate::step::{Compared, Trainer};
use crate::taylormode::config::{BlurMode, VelocitySource};
use crate::taylormode::state::{Lent, MotionGradients, MotionState, Network};

/// Compares the scene with a photo that was exposed for a while, and goes back.
pub fn compare(trainer: &Trainer, state: &MotionState, photo: &Photo, config: &Config) -> Compared {
    let tracked = trainer.parameters.tracked();
    let lent = state.lend();
    let options = config.render.options(trainer.parameters.sh_degree(), config.data.background);
    let screen = trainer.wants_screen(config).then(|| {
        Tensor::<2>::zeros([trainer.parameters.len(), 4], &trainer.parameters.device()).autodiff().require_grad()
    });
    let step = Step { state, lent: &lent, tracked: &tracked, photo, config, options, progress: trainer.progress(config) };
    let formed = match config.blur.mode {
        BlurMode::None => step.unblurred(screen.clone()),
        BlurMode::Integrate => step.integrated(screen.clone()),
        BlurMode::Warp => step.warped(screen.clone()),
    };
    let loss = formed.loss + regularisers(&tracked, trainer.extent, &config.loss);
    let mut gradients = loss.backward();

    let observation = Observation {
        screen: screen.and_then(|screen| screen.grad_remove(&mut gradients)),
        radii: formed.radii.inner(),
        width: photo.camera.width,
        height: photo.camera.height,
    };
    let of_table = Gradients::take(&tracked, &mut gradients);
    let of_motion: MotionGradients = MotionState::take(&lent, &mut gradients);
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
}

impl Step<'_> {
    /// ITG (Table 1): displacement fitted to the blurry frame as if it were sharp.
    fn unblurred(&self, screen: Option<Tensor<2>>) -> Formed {
        let centre = self.centre(screen);
        let color = centre.color.clone();
        let mut loss = self.photometric(color.clone(), self.photo.image.clone(), None);
        loss = self.add_priors(loss, &centre, None);
        Formed { color, loss, radii: centre.radii(), intersections: centre.intersections }
    }

    /// The exact formation: rendered at times inside the exposure and averaged.
    fn integrated(&self, screen: Option<Tensor<2>>) -> Formed {
        let blur = &self.config.blur;
        let decoupled = blur.decouple && self.photo.hints.moving.is_some();
        let scene = if decoupled { self.static_detached() } else { self.tracked.clone() };
        let options = ExposureOptions { render: self.options, linear: blur.linear };
        let samples = self.samples(&scene);
        let formed = render_exposure(&scene, &self.state.rows, &samples, &self.photo.camera, &options, screen);
        let image = self.photo.image.clone();
        let mut loss = if decoupled {
            self.photometric(formed.color.clone(), image, self.photo.hints.moving.clone()) * self.config.prior.blur
        } else {
            self.photometric(formed.color.clone(), image, None)
        };
        let mut intersections = formed.intersections;
        if decoupled || self.priors_count() {
            let centre = self.centre(None);
            intersections += centre.intersections;
            let sharp = if decoupled { self.sharp_term(&centre) } else { self.pseudo_term(&centre) };
            loss = self.add(loss, sharp, self.config.prior.sharp);
            loss = self.add_priors(loss, &centre, None);
        }
        Formed { color: formed.color, loss, radii: formed.radii, intersections }
    }

    /// The paper's formation: the sharp image gathered along the velocity at each pixel (Eq. 7 to 12).
    fn warped(&self, screen: Option<Tensor<2>>) -> Formed {
        let blur = &self.config.blur;
        let centre = self.centre(screen);
        let s = self.state.window.normalised(self.photo.time);
        let velocity = centre.features.clone().expect("the centre is rendered with velocities");
        let depth = centre.expected_depth().expect("the centre is rendered with depth");
        let velocity = match blur.velocity {
            VelocitySource::Taylor => match self.lent.network(Network::Peano).filter(|_| blur.peano) {
                Some(network) => warp::peano(&network, velocity, s, self.state.window.half),
                None => velocity,
            },
            VelocitySource::Network => {
                let network = self.lent.network(Network::Velocity).expect("the recipe has this network");
                warp::direct(&network, depth.clone(), &self.photo.camera, s, self.state.window.half)
            }
        };
        let prior = self.photo.hints.depth.as_ref().filter(|_| self.config.prior.align_depth);
        let hybrid = match prior {
            Some((values, space, metric)) => {
                let aligned = losses::align_depth(values.clone(), depth.clone().detach(), *space, *metric);
                warp::hybrid_depth(aligned, depth, blur.depth_beta)
            }
            None => depth,
        };
        let weights = self.lent.network(Network::Weights).filter(|_| blur.weights);
        let warped = warp::blur(&warp::Inputs {
            color: centre.color.clone(),
            depth: hybrid,
            velocity: velocity.clone(),
            exposure: self.exposure(),
            mask: self.photo.hints.moving.clone().filter(|_| blur.decouple),
            weights,
            camera: &self.photo.camera,
            samples: blur.samples,
            linear: blur.linear,
        });
        let moving = self.photo.hints.moving.clone();
        let blurred = losses::blur(warped.color.clone(), self.photo.image.clone(), moving.clone());
        let mut loss = self.sharp_term(&centre).expect("always there") * self.config.prior.sharp;
        loss = loss + blurred * self.config.prior.blur;
        if let Some(weights) = warped.weights {
            loss = loss + losses::smooth(weights, moving) * self.config.prior.smooth;
        }
        loss = self.add_priors(loss, &centre, Some(velocity));
        Formed { color: warped.color, loss, radii: centre.radii(), intersections: centre.intersections }
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
        self.config.blur.mode == BlurMode::Warp || (self.config.prior.velocity > 0.0 && self.photo.hints.guide.is_some())
    }

    fn needs_depth(&self) -> bool {
        self.config.blur.mode == BlurMode::Warp || (self.config.prior.depth > 0.0 && self.photo.hints.depth.is_some())
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
        let count = self.config.blur.samples;
        let exposure = self.state.exposure();
        // Its value is zero: means already stand where the exposure's present value puts them. Its gradient is the exposure's.
        let stretch = self.exposure() - exposure;
        (0..count)
            .map(|i| {
                // Midpoints of equal parts of the exposure: the mean over them is exact to second order, and their extent
                // is that of the shutter for any count. (Eq. 7 puts the outermost at the ends.)
                let share = (i as f64 + 0.5) / count as f64 - 0.5;
                let t = self.photo.time + share * exposure;
                let (mut means, quats) = self.lent.motion.sample_rows(scene.means.val(), scene.quats.val(), t);
                if self.config.blur.learn_exposure && means.dims()[0] > 0 {
                    let velocity = self.lent.motion.velocity(t).detach();
                    means = means + velocity * (stretch.clone() * share);
                }
                MovingSample { means, quats }
            })
            .collect()
    }

    /// The exposure, tracked where it is learned, `[1, 1]`.
    fn exposure(&self) -> Tensor<2> {
        let exposure = self.lent.log_exposure.clone().exp();
        if self.config.blur.learn_exposure { exposure } else { exposure.detach() }
    }

    /// The scene with its static Gaussians out of the graph (section 3.4).
    fn static_detached(&self) -> Gaussians {
        self.lent.motion.static_detached(self.tracked)
    }

    /// Eq. 14 against the hybrid target of Eq. 13. Where things move and no pseudo-sharp photo is there, nothing is compared.
    fn sharp_term(&self, centre: &Rendering) -> Option<Tensor<1>> {
        let (hints, image) = (&self.photo.hints, self.photo.image.clone());
        let color = centre.color.clone();
        let Some(moving) = hints.moving.clone() else {
            return Some(self.photometric(color, image, None));
        };
        let pseudo = hints.sharp.clone().filter(|_| self.config.prior.pseudo && self.progress < self.config.prior.until);
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

    /// The terms of Eq. 16 and 17.
    fn add_priors(&self, mut loss: Tensor<1>, centre: &Rendering, velocity: Option<Tensor<3>>) -> Tensor<1> {
        let (prior, hints) = (&self.config.prior, &self.photo.hints);
        if self.progress >= prior.until {
            return loss;
        }
        if let (Some((values, space, metric)), Some(depth)) = (&hints.depth, centre.expected_depth().filter(|_| prior.depth > 0.0)) {
            let aligned = if prior.align_depth {
                losses::align_depth(values.clone(), depth.clone().detach(), *space, *metric)
            } else {
                losses::as_depth(values.clone(), *space)
            };
            loss = loss + losses::depth(depth, aligned) * prior.depth;
        }
        let velocity = velocity.or_else(|| centre.features.clone()).filter(|_| prior.velocity > 0.0);
        if let (Some(velocity), Some(guide), Some(moving)) = (velocity, hints.guide, hints.moving.clone()) {
            let camera_frame = warp::to_camera(velocity, &self.photo.camera);
            loss = loss + losses::velocity(camera_frame, guide, &self.photo.camera, moving) * prior.velocity;
        }
        loss
    }

    fn add(&self, loss: Tensor<1>, term: Option<Tensor<1>>, weight: f64) -> Tensor<1> {
        match term {
            Some(term) if weight > 0.0 => loss + term * weight,
            _ => loss,
        }
    }
}
