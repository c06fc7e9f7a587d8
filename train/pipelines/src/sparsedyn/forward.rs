//! One step: the first frame with its regularisers (Eq. 5 to 7), or a rollout to one or several frames (Eq. 9 and 10).

use burn::tensor::Tensor;
use gs_burn::ops::rows::add_rows;
use gs_burn::{Extras, Gaussians, Rendering, render_with};
use gs_models::sparsedyn::refinement::{masked_depth, opacity_sparsity, outline_misfit};
use gs_models::sparsedyn::{Ask, Recorded, Rollout, State};
use rand::Rng;

use super::config::MotionModel;
use super::cues::warmup_steps;
use super::extra::PhotoCues;
use super::motion::{Direction, Moved};
use super::order::weight;
use super::sources::Source;
use super::{Sparsedyn, Step};
use gs_train::fit::losses::photometric;
use gs_train::fit::method::{Drawn, Forward, Remainder};
use gs_train::fit::photos::Photo;
use gs_train::fit::random::{Purpose, stream};

/// Factor of the opacity's weight on the hull of outlines, which holds more Gaussians than surfaces need. On four
/// object sets of five cameras, held-out cameras gain 0.1 to 2.7 dB by 3 over 1, and lose by 6.
const ON_HULL: f64 = 3.0;

/// Weight of what oscillations leave of the seen time, in pixels: a tube that bends, whose rates were 9 % off at the
/// choice of its law, gains 3.4 dB over the last state with it and 2.8 without.
const UNSAID: f64 = 1e-2;

impl Sparsedyn {
    /// The images of a step and their loss. `self` and `gaussians` are leaves of this step's graph.
    pub(super) fn compared(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<PhotoCues>],
        screens: &[Tensor<2>],
        at: &Step,
    ) -> Forward {
        if at.step <= warmup_steps(at.config) {
            return self.first_frame(gaussians, &photos[0], screens.first().cloned(), at);
        }
        let times: Vec<f64> = photos.iter().map(|photo| self.frame.clock.inner(photo.time)).collect();
        let Scenes { scenes, remainder } = self.scenes(gaussians, &times, at);
        let mut forward = Forward { remainder, ..Forward::empty(&gaussians.device()) };
        // At one of the times: over steps all are drawn alike.
        if let Some(strain) = self.bodies.as_ref().and_then(|bodies| bodies.strain(times[0], self.frame.pixel)) {
            forward.loss = forward.loss + strain * at.config.method.bodies.strain;
        }
        if let Some(unsaid) = self.bodies.as_ref().and_then(|bodies| bodies.unsaid(times[0], self.frame.pixel)) {
            forward.loss = forward.loss + unsaid * UNSAID;
        }
        let count = photos.len();
        for (index, (photo, scene)) in photos.iter().zip(&scenes).enumerate() {
            let rendering = drawn(scene, photo, screens.get(index).cloned(), false, at);
            let image = photo.taken(rendering.color.clone());
            let loss = photometric(image.clone(), photo.image.clone(), photo.mask.clone(), &at.config.loss);
            forward.loss = forward.loss + loss * weight(index, count, at);
            forward.drawn.push(Drawn::of(&rendering, screens.get(index)));
            forward.images.push(image);
        }
        forward
    }

    /// The warm-up (Eq. 7): one photo of the first frame.
    fn first_frame(
        &self,
        gaussians: &Gaussians,
        photo: &Photo<PhotoCues>,
        screen: Option<Tensor<2>>,
        at: &Step,
    ) -> Forward {
        let warmup = &at.config.method.warmup;
        let prior = photo.extra.depth.as_ref().filter(|_| warmup.depth > 0.0);
        let rendering = drawn(gaussians, photo, screen.clone(), prior.is_some(), at);
        let image = photo.taken(rendering.color.clone());
        let mut loss = photometric(image.clone(), photo.image.clone(), photo.mask.clone(), &at.config.loss);
        if warmup.opacity > 0.0 && !gaussians.is_empty() {
            let factor = if at.cues.source == Source::Hull { ON_HULL } else { 1.0 };
            loss = loss + opacity_sparsity(gaussians.opacities()) * (factor * warmup.opacity);
        }
        if let Some(sides) = photo.extra.outline.clone().filter(|_| warmup.outline > 0.0) {
            loss = loss + outline_misfit(rendering.alpha.clone(), sides) * warmup.outline;
        }
        if let (Some((depth, weights)), Some(rendered)) = (prior, rendering.expected_depth()) {
            let term = masked_depth(rendered, depth.clone(), weights.clone());
            loss = loss + term * (warmup.depth / at.facts.extent);
        }
        Forward {
            loss,
            drawn: vec![Drawn::of(&rendering, screen.as_ref())],
            images: vec![image],
            ..Forward::empty(&gaussians.device())
        }
    }

    /// The Gaussians at `times`, in the graph of `gaussians` and the fields.
    fn scenes(&self, gaussians: &Gaussians, times: &[f64], at: &Step) -> Scenes {
        if self.frame.rows.is_empty() {
            return Scenes { scenes: vec![gaussians.clone(); times.len()], remainder: None };
        }
        let placed = |moved: Vec<Moved>| moved.iter().map(|moved| self.placed(gaussians, moved)).collect();
        let first = self.first_positions(gaussians);
        match (&self.field, self.model) {
            // A field that alone moves everything and is asked more than once: its activations over the horizon are
            // computed again in the backward pass. Elsewhere they are stored: asked once, they are small; beside bodies
            // or a deformation, the field is differentiated in the graph of the loss.
            (Some(field), MotionModel::Rollout) if self.options.ask != Ask::Start && self.bodies.is_none() => {
                let rollout = Rollout { field, options: self.options };
                let recorded = rollout.record(&State::at_rest(first.inner()), times);
                let leaves: Vec<State> = recorded.states.iter().map(|state| state.clone().leaf()).collect();
                let moved = leaves.iter().map(|state| Moved { state: state.clone(), growth: None }).collect();
                let rows = self.row_tensor(&gaussians.device().inner());
                let remainder = Some(remainder(recorded, leaves, rows, gaussians.len()));
                Scenes { scenes: placed(moved), remainder }
            }
            (_, MotionModel::Rollout | MotionModel::Hybrid) => {
                Scenes { scenes: placed(self.moved(&first, times)), remainder: None }
            }
            (_, MotionModel::Trace | MotionModel::Freegave) => {
                let mut rng = stream(at.config.seed, Purpose::Direction, at.step as u64);
                let mut one = |time: &f64| {
                    let direction = if rng.random_bool(0.5) { Direction::Forwards } else { Direction::Backwards };
                    self.moved_by_one_step(&first, *time, direction)
                };
                Scenes { scenes: placed(times.iter().map(&mut one).collect()), remainder: None }
            }
        }
    }
}

/// The Gaussians at several times.
struct Scenes {
    scenes: Vec<Gaussians>,
    remainder: Option<Remainder>,
}

/// The part of the backward pass that computes the rollout again.
fn remainder(recorded: Recorded, leaves: Vec<State>, rows: Tensor<1, burn::tensor::Int>, count: usize) -> Remainder {
    Box::new(move |graph, gradients| {
        let of_states: Vec<State> = leaves.iter().map(|leaf| leaf.take_gradient(graph)).collect();
        let (of_start, of_field) = recorded.backward(&of_states);
        gradients.add(of_field.under("method.field"));
        let positions = of_start.positions;
        let zeros = Tensor::zeros([count, 3], &positions.device());
        let of_means = add_rows(zeros, &rows, positions);
        let mut own = gs_burn::NamedGradients::default();
        own.insert("gaussians.means", of_means);
        gradients.add(own);
    })
}

/// The rendering of a photo's view.
fn drawn(
    gaussians: &Gaussians,
    photo: &Photo<PhotoCues>,
    screen: Option<Tensor<2>>,
    depth: bool,
    at: &Step,
) -> Rendering {
    let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
    let options = gs_burn::RenderOptions { depth, ..options };
    render_with(gaussians, &photo.camera, &options, Extras { screen, features: None, room: at.pair_room() })
}
