//! One step on one blurry photo: form its image, compare, add the priors (Eq. 13 to 19).

use std::cell::Cell;

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::exposure::ExposureOptions;
use gs_burn::ops::intersect::Room;
use gs_burn::ops::rows::add_rows;
use gs_burn::{Extras, Gaussians, RenderOptions, Rendering, render_with};
use gs_models::Pixels;
use gs_models::depth_prior::{depth_correlation_loss, depth_loss};
use gs_models::light::Mixing;
use gs_models::taylormode::blur_path::{back_project, blur_path, camera_velocity, hybrid_depth, to_world};
use gs_models::taylormode::blur_synthesis::{blurred_color, decoupled};
use gs_models::taylormode::{Exposure, Paths, PhotoShutter, Samples, losses};

use super::blur::expose;
use super::config::{BlurMode, DepthFit, VelocitySource};
use super::extra::ComparedPixels;
use super::{Config, PhotoPriors, Step, Taylormode};
use gs_train::fit::losses::photometric;
use gs_train::fit::method::{Drawn, Forward, Note};
use gs_train::fit::photos::Photo;
use gs_train::fit::shutter::{Instant, formed};

/// Smallest share of the steps at which a misfit of depth priors is told, per cent: the first renderings of a scene
/// show almost nothing.
const MISFIT_PERCENT: u32 = 10;

/// The note on a depth prior that cannot be aligned.
fn depth_misfit(config: &Config) -> Note {
    let last = ((config.method.prior.until * config.steps as f64) as usize).clamp(1, config.steps);
    let sentence = "in {count} of {steps} steps the photo's depth prior fitted nothing that was rendered, and the depth term (Eq. 16) was left \
                    out; is it depth, or its inverse (depth_kind)?";
    Note { sentence, last, often_percent: MISFIT_PERCENT }
}

/// An image with its loss.
struct Formed {
    /// The image that is compared with the photo: blurred where blur is modelled, `[H, W, 3]`.
    color: Tensor<3>,
    /// All terms but the regularisers, `[1]`.
    loss: Tensor<1>,
    /// The quantities of the renderings that the trainer needs.
    drawn: Drawn,
}

impl Taylormode {
    /// Forms the image of a scene that moved while `photo` was exposed, and compares it. `self` and `gaussians` are
    /// leaves of this step's graph.
    pub(super) fn formed_and_compared(
        &self,
        gaussians: &Gaussians,
        photo: &Photo<PhotoPriors>,
        screen: Option<Tensor<2>>,
        at: &Step,
    ) -> Forward {
        let step = Formation {
            model: self,
            paths: self.motion.paths(&gaussians.means.val()),
            gaussians,
            photo,
            config: at.config,
            options: at.facts.render_options(&at.config.render, gaussians.sh_degree()),
            progress: at.progress(),
            room: at.room,
            misfit: Cell::new(false),
        };
        let Formed { color, loss, drawn } = match at.config.method.blur.mode {
            BlurMode::None => step.unblurred(screen),
            BlurMode::Integrate if photo.path.as_ref().is_some_and(|path| !path.is_still()) => {
                step.along_the_path(screen)
            }
            BlurMode::Integrate => step.integrated(screen),
            BlurMode::Warp => step.warped(screen),
        };
        Forward {
            images: vec![photo.taken(color)],
            loss,
            drawn: vec![drawn],
            notes: step.misfit.get().then(|| depth_misfit(at.config)).into_iter().collect(),
            remainder: None,
        }
    }
}

struct Formation<'a> {
    model: &'a Taylormode,
    paths: Paths,
    gaussians: &'a Gaussians,
    photo: &'a Photo<PhotoPriors>,
    config: &'a Config,
    options: RenderOptions,
    /// Share of the run before this step, 0 to 1.
    progress: f64,
    room: Option<Room>,
    /// Whether the photo's depth prior could not be aligned with the rendering.
    misfit: Cell<bool>,
}

impl Formation<'_> {
    /// ITG (Table 1): the sharp rendering is fitted to the blurry photo.
    fn unblurred(&self, screen: Option<Tensor<2>>) -> Formed {
        let centre = self.centre(screen.clone());
        let color = centre.color.clone();
        let loss = self.add_depth(self.photometric(color.clone(), self.photo.image.clone(), None), &centre);
        Formed { color, loss, drawn: Drawn::of(&centre, screen.as_ref()) }
    }

    /// The exact formation: the mean of renderings at times inside the exposure.
    fn integrated(&self, screen: Option<Tensor<2>>) -> Formed {
        let blur = &self.config.method.blur;
        let decoupled = blur.decouple && self.photo.extra.moving.is_some();
        let gaussians = if decoupled { self.static_detached() } else { self.gaussians.clone() };
        let render = RenderOptions { depth: self.needs_depth(), ..self.options };
        let options = ExposureOptions { render, linear: blur.linear, room: self.room };
        // Midpoints: their mean is exact to second order, and covers the shutter's interval for any count.
        let (exposure, shutter) = self.exposure();
        let instants =
            exposure.instants(self.photo.time, &Samples::Middles.offsets(blur.samples_at(self.progress)), shutter);
        let rows = &self.model.motion.rows;
        let formed = expose(&gaussians, &self.paths, rows, &instants, &self.photo.middle(), &options, screen.clone());
        let image = self.photo.image.clone();
        let (mut intersections, tiles) = (vec![formed.intersections.clone()], vec![formed.tiles.clone()]);
        let mut loss = if decoupled {
            self.photometric(formed.color.clone(), image, self.photo.extra.moving.clone())
                * self.config.method.prior.blur
        } else {
            self.photometric(formed.color.clone(), image, None)
        };
        if decoupled || self.priors_count() {
            // An odd number of samples includes the centre, which has been rendered already.
            let centre = if decoupled || instants.len().is_multiple_of(2) {
                let centre = self.centre(None);
                intersections.push(centre.intersections.clone());
                centre
            } else {
                formed.middle()
            };
            let sharp = if decoupled { Some(self.sharp_term(&centre, None)) } else { self.pseudo_term(&centre) };
            if let Some(sharp) = sharp.filter(|_| self.config.method.prior.sharp > 0.0) {
                loss = loss + sharp * self.config.method.prior.sharp;
            }
            loss = self.add_depth(loss, &centre);
        }
        let radii = screen.map(|_| formed.radii().unsqueeze_dim(1));
        Formed { color: formed.color, loss, drawn: Drawn { radii, intersections, tiles } }
    }

    /// The exact formation by a camera that moves too: every instant is rendered whole, from the camera's pose then.
    fn along_the_path(&self, screen: Option<Tensor<2>>) -> Formed {
        let photo = self.photo;
        let cameras = photo.instants(self.config.method.blur.samples_at(self.progress));
        let (exposure, PhotoShutter { exposure: own, share }) = self.exposure();
        // Where rows are exposed one after another the frame is longer than an exposure.
        let shutter = PhotoShutter { exposure: own, share: share * photo.frame() };
        let offsets: Vec<f64> = cameras.iter().map(|instant| 0.5 * instant.at).collect();
        let scenes = self.paths.scenes(self.gaussians, &exposure.instants(photo.time, &offsets, shutter));
        let extras = Extras { features: None, screen: screen.clone(), room: self.room.map(|room| room.pairs) };
        let rendered = |(scene, instant): (&Gaussians, &Instant)| {
            render_with(scene, &instant.camera, &instant.options(&self.options), extras.clone())
        };
        let renderings: Vec<Rendering> = scenes.iter().zip(&cameras).map(rendered).collect();
        let mixing = if self.config.method.blur.linear { Mixing::Linear } else { Mixing::Encoded };
        let color = formed(&cameras, &renderings, mixing);
        let mut drawn = Drawn::of_all(&renderings, screen.as_ref());
        let mut loss = self.photometric(color.clone(), photo.image.clone(), None);
        if self.priors_count() {
            let centre = self.centre(None);
            drawn.intersections.push(centre.intersections.clone());
            if let Some(sharp) = self.pseudo_term(&centre) {
                loss = loss + sharp * self.config.method.prior.sharp;
            }
            loss = self.add_depth(loss, &centre);
        }
        Formed { color, loss, drawn }
    }

    /// The paper's formation: the sharp image gathered along the velocity at each moving pixel (Eq. 5 to 12).
    fn warped(&self, screen: Option<Tensor<2>>) -> Formed {
        let (blur, prior) = (&self.config.method.blur, &self.config.method.prior);
        let photo = self.photo;
        let centre = self.centre(screen.clone());
        let finished = |color: Tensor<3>, loss: Tensor<1>| Formed {
            color,
            loss: self.add_depth(loss, &centre),
            drawn: Drawn::of(&centre, screen.as_ref()),
        };
        let all = Pixels::all(photo.camera.width, photo.camera.height, &self.gaussians.device());
        let pixels = match &photo.extra.compared {
            ComparedPixels::All => &all,
            ComparedPixels::Some(pixels) => pixels,
            ComparedPixels::None => {
                return finished(centre.color.clone(), self.sharp_term(&centre, None) * prior.sharp);
            }
        };
        let count = photo.camera.width * photo.camera.height;

        let depth = pixels.of(self.hybrid_depth(&centre));
        let velocity = camera_velocity(self.velocity(pixels, &centre, &depth), &photo.camera.viewmat);
        let (exposure, shutter) = self.exposure();
        let offsets = exposure.offsets(Samples::Ends, blur.samples, shutter);
        let path = blur_path(pixels, depth.clone(), velocity.clone(), &photo.camera.intrinsics, offsets);
        let weights = self.model.weights.as_ref().map(|network| network.forward(depth, velocity.clone()));
        // Section 3.4 and Figure 1 split the image by its mask: the colours of static pixels get no gradient from the
        // blur. Depth and velocity at moving pixels, which determine the samples' positions, keep their gradient,
        // static Gaussians under the mask included.
        let sharp = match &photo.extra.moving {
            Some(moving) if blur.decouple => decoupled(centre.color.clone(), moving.clone()),
            _ => centre.color.clone(),
        };
        let mixing = if blur.linear { Mixing::Linear } else { Mixing::Encoded };
        let blurred = blurred_color(sharp, path, weights.clone(), mixing);
        let formed = pixels.paste(blurred.clone(), centre.color.clone());

        let taken = photo.taken(blurred.unsqueeze()).squeeze_dim(0);
        let mut loss = self.sharp_term(&centre, Some(formed.clone())) * prior.sharp
            + losses::blur_loss(taken, pixels.of(photo.image.clone()), count) * prior.blur;
        if let Some(weights) = weights.filter(|_| prior.smooth > 0.0) {
            loss = loss + losses::smoothness_loss(weights, count) * prior.smooth;
        }
        if let Some(guide) = photo.extra.guide.filter(|_| prior.velocity > 0.0 && self.progress < prior.until) {
            let guide: Tensor<2> = Tensor::<1>::from_floats(guide.map(|x| x as f32), &velocity.device()).unsqueeze();
            let guide = camera_velocity(guide, &photo.camera.viewmat);
            loss = loss + losses::velocity_loss(velocity, guide, count) * prior.velocity;
        }
        finished(formed, loss)
    }

    /// Hybrid depth (Eq. 6): the prior, aligned to the rendered depth, and the rendered depth.
    fn hybrid_depth(&self, centre: &Rendering) -> Tensor<3> {
        let rendered = centre.expected_depth().expect("the centre is rendered with depth");
        match self.aligned_prior(&rendered, &centre.alpha) {
            Some(prior) => hybrid_depth(rendered, prior, self.config.method.blur.depth_beta),
            None => rendered,
        }
    }

    /// World velocity at the pixels, `[P, 3]`.
    fn velocity(&self, pixels: &Pixels, centre: &Rendering, depth: &Tensor<2>) -> Tensor<2> {
        let splatted = || pixels.of(centre.features.clone().expect("the centre is rendered with velocities"));
        let camera = &self.photo.camera;
        let positions = || to_world(back_project(pixels, depth.clone().detach(), &camera.intrinsics), &camera.viewmat);
        self.model.pixel_velocity(self.paths.window.normalised(self.photo.time), splatted, positions)
    }

    /// The sharp image at the exposure's centre, with depth and splatted velocity (Eq. 4).
    fn centre(&self, screen: Option<Tensor<2>>) -> Rendering {
        let t = self.photo.time;
        let scene = self.paths.moved(self.gaussians, t);
        let features = self.needs_velocity().then(|| self.paths.velocities(self.gaussians.len(), t));
        let options = RenderOptions { depth: self.needs_depth(), ..self.options };
        render_with(
            &scene,
            &self.photo.middle(),
            &options,
            Extras { features, screen, room: self.room.map(|room| room.pairs) },
        )
    }

    fn needs_velocity(&self) -> bool {
        self.config.method.blur.mode == BlurMode::Warp && self.config.method.blur.velocity == VelocitySource::Taylor
    }

    fn needs_depth(&self) -> bool {
        let compared = self.config.method.prior.depth > 0.0 && self.photo.extra.depth.is_known();
        self.config.method.blur.mode == BlurMode::Warp || (compared && self.progress < self.config.method.prior.until)
    }

    /// Whether any prior beside the photo itself is used in this step.
    fn priors_count(&self) -> bool {
        let (prior, extra) = (&self.config.method.prior, &self.photo.extra);
        let pseudo = prior.pseudo && prior.sharp > 0.0 && extra.sharp.is_some() && extra.moving.is_some();
        let depth = prior.depth > 0.0 && extra.depth.is_known();
        self.progress < prior.until && (pseudo || depth)
    }

    /// The exposure, as a leaf of the graph if it is learned, and the photo's shutter.
    fn exposure(&self) -> (Exposure, PhotoShutter) {
        let exposure = self.model.exposure.clone();
        let exposure = if self.config.method.blur.learn_exposure { exposure } else { exposure.valid() };
        let extra = &self.photo.extra;
        (exposure, self.model.shutter_of(extra.camera.as_deref(), extra.exposure))
    }

    /// The scene with its static Gaussians out of the graph (section 3.4).
    fn static_detached(&self) -> Gaussians {
        let (scene, rows) = (self.gaussians, &self.paths.rows);
        let device = rows.device();
        let ones = Tensor::<2>::ones([rows.dims()[0], 1], &device);
        let moves = add_rows(Tensor::zeros([scene.len(), 1], &device), rows, ones);
        // The value is x either way, because x - x is exactly zero for every finite x; the gradient of static rows is
        // zero.
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

    /// The sharp term, Eq. 14 with the hybrid target of Eq. 13. A photo without a pseudo-sharp one shows moving parts
    /// blurred: there the blurred rendering `formed` is compared, or nothing without it.
    fn sharp_term(&self, centre: &Rendering, formed: Option<Tensor<3>>) -> Tensor<1> {
        let (extra, image) = (&self.photo.extra, self.photo.image.clone());
        let color = centre.color.clone();
        let Some(moving) = extra.moving.clone() else {
            return self.photometric(color, image, None);
        };
        let pseudo = extra
            .sharp
            .clone()
            .filter(|_| self.config.method.prior.pseudo && self.progress < self.config.method.prior.until);
        match (pseudo, formed.filter(|_| extra.sharp.is_none())) {
            (Some(sharp), _) => self.photometric(color, losses::hybrid_target(sharp, image, moving), None),
            (None, _) if !self.config.method.prior.pseudo => self.photometric(color, image, None),
            (None, Some(formed)) => self.photometric(formed, image, None),
            (None, None) => self.photometric(color, image, Some(moving.neg() + 1.0)),
        }
    }

    /// The sharp term over moving pixels alone; the photo itself constrains the others.
    fn pseudo_term(&self, centre: &Rendering) -> Option<Tensor<1>> {
        let (moving, sharp) = (self.photo.extra.moving.clone()?, self.photo.extra.sharp.clone()?);
        self.config.method.prior.pseudo.then(|| self.photometric(centre.color.clone(), sharp, Some(moving)))
    }

    /// [`photometric`] over the pixels of `region` that count.
    fn photometric(&self, color: Tensor<3>, truth: Tensor<3>, region: Option<Tensor<3>>) -> Tensor<1> {
        let region = match (region, self.photo.mask.clone()) {
            (Some(region), Some(mask)) => Some(region * mask),
            (region, mask) => region.or(mask),
        };
        photometric(self.photo.taken(color), truth, region, &self.config.loss)
    }

    /// Adds the depth term of Eq. 16.
    fn add_depth(&self, loss: Tensor<1>, centre: &Rendering) -> Tensor<1> {
        let prior = &self.config.method.prior;
        if prior.depth <= 0.0 || self.progress >= prior.until {
            return loss;
        }
        let Some(depth) = centre.expected_depth() else { return loss };
        if prior.depth_fit == DepthFit::Correlation
            && let Some((values, space)) = self.photo.extra.depth.relative(&depth)
        {
            return loss + depth_correlation_loss(depth, values, space) * prior.depth;
        }
        match self.aligned_prior(&depth, &centre.alpha) {
            Some(aligned) => loss + depth_loss(depth, aligned) * prior.depth,
            None => loss,
        }
    }

    /// The depth prior in scene units, `[H, W, 1]`, 0 where unknown; `None` if it cannot be aligned with the rendering.
    fn aligned_prior(&self, rendered: &Tensor<3>, alpha: &Tensor<3>) -> Option<Tensor<3>> {
        let depth = &self.photo.extra.depth;
        let aligned = depth.aligned(rendered, alpha, self.config.method.prior.depth_fit == DepthFit::None);
        self.misfit.set(depth.is_known() && aligned.is_none());
        aligned
    }
}
