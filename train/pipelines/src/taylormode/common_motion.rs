//! The common motion of a body: an update of all its paths together, in addition to each Gaussian's own.
//!
//! A path's blocks belong to one Gaussian and are learned from the few pixels it covers. On a body that turns, texture
//! repeats, and a Gaussian alone may converge to the wrong repetition or lag behind. Adam on the body's blocks `W`
//! ([`bodies`](gs_models::taylormode::bodies)), whose gradient is the sum of the gradients of all its Gaussians through
//! their basis, moves all their paths by `dW_k [1, (x - centre) / scale]`. Not part of the paper.

use burn::module::Param;
use burn::tensor::Tensor;
use gs_burn::adam::AdamRate;
use gs_burn::exact_matmul;
use gs_burn::ops::products::transposed_product;
use gs_burn::ops::sum::largest;
use gs_models::taylormode::Body;
use gs_models::taylormode::window::amplitude;
use gs_train::fit::parameters::from_host;

/// Rate of the shift of the whole body, as a factor of the learning rate.
const SHIFT: f64 = 0.5;

/// Decay of the first moment. The gradient of one photo is a rotation that suits one camera. The usual 0.9 averages ten
/// photos, and so fast a rotation is noisy; 0.99 averages a hundred, more than the cameras of most rigs.
const BETA1: f64 = 0.99;

/// Largest displacement of a position of the body by one step, as a factor of the learning rate; a longer step is
/// scaled down as a whole. Adam's first steps have full length in every number whatever the gradient: together with the
/// Gaussians' own steps they must not exceed a hundredth of the scene, the bound of the stability experiment `thrown`.
const FARTHEST: f64 = 3.0;

/// The gradient of a body's blocks, from `gradients` `[M, 3 (K + J)]` of the blocks of paths through `basis` `[M, 4]`.
pub fn gradient(basis: &Tensor<2>, gradients: Tensor<2>) -> Tensor<2> {
    transposed_product(basis.clone(), gradients)
}

/// The rate of a body's blocks if single paths have the rate `paths`.
pub fn rate(paths: &AdamRate) -> AdamRate {
    AdamRate { beta1: BETA1, ..*paths }
}

/// What [`step`] follows.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// The rate of single paths, scene units.
    pub lr: f64,
    /// `cues.turn`.
    pub turn: f64,
    /// Blocks of a path before those of the contacts.
    pub order: usize,
}

/// The change `[M, 3 (K + J)]` of the paths of a body that Adam has moved on from the blocks `before`; the body's own
/// blocks are set to what its paths followed.
pub fn step(body: &mut Body, basis: Tensor<2>, before: Tensor<2>, pace: Pace) -> Tensor<2> {
    let device = before.device();
    let Pace { lr, turn, order } = pace;
    let (columns, learned) = (before.dims()[1], usize::from(body.frame.order));
    // Adam's steps do not depend on the scale of gradients: factors of the basis become factors of the step. Blocks
    // that are not learned yet would shorten the step of the others.
    let is_open = |column: &usize| column / 3 < learned || column / 3 >= order;
    let row = |factor: f64| (0..columns).map(move |column| if is_open(&column) { factor as f32 } else { 0.0 });
    let factors = from_host([SHIFT, turn, turn, turn].into_iter().flat_map(row).collect(), columns, &device);
    let step = (body.blocks.val() - before.clone()) * factors;
    let change = exact_matmul(basis, step.clone());
    let count = change.dims()[0];
    let lengths: Tensor<2> =
        change.clone().reshape([count, columns / 3, 3]).powi_scalar(2).sum_dim(2).sqrt().squeeze_dim(2);
    // A ramp of slope 1 over half a window goes as far as the first polynomial.
    let of_block = |k: usize| if k < order { amplitude(k + 1) as f32 } else { 1.0 };
    let amplitudes: Vec<f32> = (0..columns / 3).map(of_block).collect();
    let amplitudes = Tensor::<1>::from_floats(amplitudes.as_slice(), &device).unsqueeze_dim(1);
    let farthest = largest(exact_matmul(lengths, amplitudes)).clamp_min(f32::MIN_POSITIVE);
    let shortened: Tensor<2> = (farthest.recip() * (FARTHEST * lr)).clamp_max(1.0).reshape([1, 1]);
    body.blocks = Param::from_tensor(before + step * shortened.clone());
    change * shortened
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use gs_burn::ops::adam::{AdamConfig, adam_step};
    use gs_models::taylormode::bodies::NO_BODY;
    use gs_models::taylormode::{BodyFrame, MotionFrame, TaylorMotion, TimeWindow};
    use gs_train::fit::parameters::to_host;

    const LR: f64 = 0.1;
    const TURN: f64 = 6.0;

    /// Rows of bodies about these centres, with paths of `order`; `body_of` says whose each row is.
    fn motion(centres: &[[f64; 3]], body_of: Vec<u8>, order: usize, device: &Device) -> TaylorMotion {
        let window = TimeWindow { t0: 0.0, half: 1.0 };
        let mut frame = MotionFrame::new((0..body_of.len() as u32).collect(), order, 0, window);
        let body = |centre: &[f64; 3]| BodyFrame { order: order as u8, ..BodyFrame::new(*centre, EXTENT) };
        (frame.bodies, frame.body_of) = (centres.iter().map(body).collect(), body_of);
        frame.init(0, device)
    }

    /// Root mean square distance of the corners of [`corners`] from their centre.
    const EXTENT: f64 = 0.866_025_403_784_438_6;

    /// The change of all paths by a first step of all bodies.
    fn step_together(motion: &mut TaylorMotion, positions: &Tensor<2>, gradients: &Tensor<2>) -> Option<Tensor<2>> {
        let (bases, order) = (motion.bases(positions), motion.order());
        let one = |(body, basis): (&mut Body, Tensor<2>)| {
            let (before, gradient) = (body.blocks.val(), gradient(&basis, gradients.clone()));
            let AdamRate { lr, beta1, beta2, eps, .. } = rate(&AdamRate::new(LR));
            let config = AdamConfig { lr, beta1, beta2, eps, step: 1, first_columns: None };
            let zeros = gradient.zeros_like();
            let (blocks, ..) = adam_step(before.clone(), gradient, zeros.clone(), zeros, &config);
            body.blocks = Param::from_tensor(blocks);
            let change = step(body, basis.clone(), before.clone(), Pace { lr: LR, turn: TURN, order });
            // What rows without blocks of their own follow is what the others were changed by.
            let followed = to_host(body.carried(basis));
            assert!(followed.iter().zip(to_host(change.clone())).all(|(a, b)| (a - b).abs() < 1e-6));
            change
        };
        motion.bodies.iter_mut().zip(bases).map(one).reduce(|a, b| a + b)
    }

    /// The change by a first step of one body of `order` about (1, 2, 3).
    fn alone(order: usize, positions: &Tensor<2>, gradients: Vec<f32>, device: &Device) -> Vec<f32> {
        let mut one = motion(&[[1.0, 2.0, 3.0]], vec![0; positions.dims()[0]], order, device);
        let gradients = from_host(gradients, 3 * order, device);
        to_host(step_together(&mut one, positions, &gradients).expect("one body"))
    }

    /// Eight corners of a cube about (1, 2, 3).
    fn corners(device: &Device) -> (Vec<[f64; 3]>, Tensor<2>) {
        let corner = |i: usize| [0, 1, 2].map(|axis| f64::from((i >> axis & 1) as u8) - 0.5);
        let offsets: Vec<[f64; 3]> = (0..8).map(corner).collect();
        let positions = offsets.iter().flat_map(|o| [o[0] + 1.0, o[1] + 2.0, o[2] + 3.0]).map(|x| x as f32).collect();
        (offsets, from_host(positions, 3, device))
    }

    /// A gradient towards a rotation about z gives a rotation about z of all positions, as one linear map; no position
    /// moves much farther than the rate allows.
    #[test]
    fn a_turn_is_asked_and_a_turn_is_given() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, positions) = corners(&device);
        // The negative gradient is w x offset with w along z.
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0]).map(|x| x as f32).collect();
        let change = alone(1, &positions, gradients, &device);
        let turn = TURN * LR / BodyFrame::new([0.0; 3], EXTENT).scale;
        for (moved, offset) in change.chunks_exact(3).zip(&offsets) {
            let moved: Vec<f64> = moved.iter().map(|x| f64::from(*x)).collect();
            assert!(
                (moved[0] + turn * offset[1]).abs() < 1e-6 && (moved[1] - turn * offset[0]).abs() < 1e-6,
                "{moved:?}"
            );
            assert!(moved[2].abs() < 1e-6 && moved.iter().all(|x| x.abs() <= FARTHEST * LR), "{moved:?}");
        }
    }

    /// All blocks have a gradient towards a rotation: the step stays within the limit, and is still a rotation.
    #[test]
    fn no_step_goes_far() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, positions) = corners(&device);
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0].repeat(4)).map(|x| x as f32).collect();
        let change = alone(4, &positions, gradients, &device);
        let length = |block: &[f32]| block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        for blocks in change.chunks_exact(12) {
            let moved: f64 =
                blocks.chunks_exact(3).map(length).zip(1..).map(|(long, order)| long / f64::from(order)).sum();
            assert!((moved / (FARTHEST * LR) - 1.0).abs() < 1e-5, "{moved}");
        }
    }

    /// Blocks that the curriculum has not opened neither change nor shorten the step of the others.
    #[test]
    fn blocks_wait_until_they_are_open() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, positions) = corners(&device);
        let turn = |times: usize| -> Vec<f32> {
            offsets.iter().flat_map(|o| [o[1] as f32, -o[0] as f32, 0.0].repeat(times)).collect()
        };
        let expected = alone(1, &positions, turn(1), &device);
        let mut waiting = motion(&[[1.0, 2.0, 3.0]], vec![0; 8], 4, &device);
        waiting.bodies[0].frame.order = 1;
        let change = step_together(&mut waiting, &positions, &from_host(turn(4), 12, &device));
        for (moved, expected) in to_host(change.expect("one body")).chunks(12).zip(expected.chunks(3)) {
            assert!(moved[..3].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{moved:?}, not {expected:?}");
            assert!(moved[3..].iter().all(|x| *x == 0.0), "{moved:?}");
        }
    }

    /// Two adjacent cubes: the gradient rotates one by more than a step may and shifts the other; each moves by its own
    /// gradient alone.
    #[test]
    fn bodies_move_apart() {
        const ORDER: usize = 4;
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, near) = corners(&device);
        let far = near.clone() + Tensor::<1>::from_floats([5.0, 0.0, 0.0], &device).unsqueeze();
        let turn = |o: &[f64; 3]| [o[1] as f32, -o[0] as f32, 0.0].repeat(ORDER);
        let turn: Vec<f32> = offsets.iter().flat_map(turn).collect();
        let shift = [0.0, 0.0, -1.0].repeat(8 * ORDER);
        let expected =
            [alone(ORDER, &near, turn.clone(), &device), alone(ORDER, &near, shift.clone(), &device)].concat();
        let positions = Tensor::cat(vec![near, far], 0);
        let gradients = from_host([turn, shift].concat(), 3 * ORDER, &device);
        let mut both = motion(&[[1.0, 2.0, 3.0], [6.0, 2.0, 3.0]], [[0; 8], [1; 8]].concat(), ORDER, &device);
        let together = to_host(step_together(&mut both, &positions, &gradients).expect("bodies"));
        assert!(together.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{together:?}, alone {expected:?}");
        let mut none = motion(&[], vec![NO_BODY; 16], ORDER, &device);
        assert!(step_together(&mut none, &positions, &gradients).is_none());
    }

    /// A Gaussian ten extents away neither turns with the body nor keeps it from turning.
    #[test]
    fn a_stray_follows_the_shift_alone() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, positions) = corners(&device);
        let stray: Tensor<2> = Tensor::<1>::from_floats([11.0, 2.0, 3.0], &device).unsqueeze();
        let turn: Vec<f32> = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0]).map(|x| x as f32).collect();
        let expected = alone(1, &positions, turn.clone(), &device);
        let both = alone(1, &Tensor::cat(vec![positions, stray], 0), [turn, vec![0.0, 5.0, 0.0]].concat(), &device);
        let shift = (SHIFT * LR) as f32;
        let near = |a: &f32, b: &f32| (a - b).abs() < 1e-6;
        for (moved, expected) in both.chunks_exact(3).zip(expected.chunks_exact(3)) {
            let shifted = [expected[0], expected[1] - shift, expected[2]];
            assert!(moved.iter().zip(&shifted).all(|(a, b)| near(a, b)), "{moved:?}, expected {shifted:?}");
        }
        assert!(near(&both[24], &0.0) && near(&both[25], &-shift) && near(&both[26], &0.0), "{:?}", &both[24..]);
    }

    #[test]
    fn a_shift_is_asked_and_a_shift_is_given() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (_, positions) = corners(&device);
        let gradients = (0..8).flat_map(|_| [0.0, 0.0, -1.0, 0.0, 2.0, 0.0]).collect();
        for moved in alone(2, &positions, gradients, &device).chunks_exact(6) {
            let step = (SHIFT * LR) as f32;
            let expected = [0.0, 0.0, step, 0.0, -step, 0.0];
            assert!(moved.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{moved:?}");
        }
    }
}
