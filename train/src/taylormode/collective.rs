//! What moves, moves mostly as one: an update of all paths of a body together, beside each Gaussian's own.
//!
//! A path's blocks `c_k` are numbers of one Gaussian, learned from the few pixels it covers. On a body that turns, those pixels
//! repeat, and each Gaussian alone may settle on the wrong repetition or lag behind. Near the body's centre the motion of a
//! whole body is the first order of a Taylor series in space,
//!
//! `c_k(x) = W_k [1, (x - centre) / scale]`,   `W_k` `[3, 4]`,
//!
//! which holds every rigid motion exactly (a rotation by any angle is linear in `x`) and many others nearly. Adam on `W`, whose
//! gradient is the sum of those of all the body's Gaussians, moves all blocks by `dW_k [1, ...]`. Each body has its own `W`; a Gaussian
//! is part of the body whose centre is nearest to it. The model is not changed by it: what is stored, and what single Gaussians
//! may do, stays the same. Not part of the paper.

use burn::tensor::{Device, Tensor};
use gs_burn::exact_matmul;
use gs_burn::ops::adam::AdamConfig;

use crate::taylormode::learned::Learned;

/// The common motion of a body, as Adam sees it.
#[derive(Debug, Clone)]
pub struct Collective {
    /// `[4, 3 K]`: what all paths were moved by so far.
    pub sum: Learned,
    /// Where places are measured from, scene units.
    pub centre: [f64; 3],
    /// What they are divided by, scene units: twice the body's root mean square size.
    pub scale: f64,
}

/// Root mean square distances from the centre over which places count: nearly all of a body lies within, so that a place adds
/// less than 1 an axis to a step.
const REACH: f64 = 2.0;

/// Times the rate, what a step shifts the whole body by.
const SHIFT: f64 = 0.5;

/// Times the rate, what each of the nine other numbers of a step moves a place by that lies `scale` from the centre. Faster than single
/// Gaussians: at their own pace they settle on the nearest match of the texture before the body has turned, and stay behind. (Lychee,
/// 1500 steps, moving parts and how much too slow: 23.7 dB, 10 % at 3; 24.1 dB, 8 % at 6. Cube and sphere gain little, and lose
/// again at 12.)
const TURN: f64 = 6.0;

/// Decay of the first moment. One photo asks for a turn that suits one camera. At the usual 0.9 ten photos make a step, and so fast
/// a turn trembles; a hundred are more than the cameras of most rigs.
const BETA1: f64 = 0.99;

/// Times the rate, the farthest that a step may move a place of the body at the ends of the window; longer ones are shortened as a whole.
/// First steps have full length in every number whatever the gradient: together with the Gaussians' own they must not reach a
/// hundredth of the scene, as the stability experiment `thrown` asks.
const FARTHEST: f64 = 3.0;

/// The change `[M, 3 K]` of the blocks of Gaussians at `places` `[M, 3]` (at `t0`), whose own gradients are `gradients` `[M, 3 K]`:
/// each by the step of the body that it is part of. `None` without bodies.
pub fn step_together(
    bodies: &mut [Collective],
    places: Tensor<2>,
    gradients: Tensor<2>,
    adam: &AdamConfig,
) -> Option<Tensor<2>> {
    match bodies {
        [] => return None,
        [body] => return Some(body.step(places, gradients, None, adam)),
        _ => {}
    }
    let centres: Vec<[f64; 3]> = bodies.iter().map(|body| body.centre).collect();
    let steps = bodies
        .iter_mut()
        .zip(members(&centres, &places))
        .map(|(body, member)| body.step(places.clone(), gradients.clone(), Some(member), adam));
    steps.reduce(|a, b| a + b)
}

/// For each centre 1 where it is the nearest to a place, 0 elsewhere, `[M, 1]`.
fn members(centres: &[[f64; 3]], places: &Tensor<2>) -> Vec<Tensor<2>> {
    let device = places.device();
    let distances = centres.iter().map(|centre| {
        let centre: Tensor<2> = Tensor::<1>::from_floats(centre.map(|x| x as f32), &device).unsqueeze();
        (places.clone() - centre).powi_scalar(2).sum_dim(1)
    });
    let nearest = Tensor::cat(distances.collect(), 1).argmin(1);
    (0..centres.len()).map(|index| nearest.clone().equal_elem(index as i64).float()).collect()
}

impl Collective {
    /// Nothing yet, for a body about `centre` of root mean square size `size` (scene units), whose paths have `order` blocks.
    pub fn new(centre: [f64; 3], size: f64, order: usize, device: &Device) -> Self {
        Self { sum: Learned::new(Tensor::zeros([4, 3 * order], device)), centre, scale: REACH * size }
    }

    /// The change `[M, 3 K]` of the blocks at `places` `[M, 3]` by a step of the whole body, down the sum of `gradients` `[M, 3 K]`;
    /// only of the body's members (1, others 0, `[M, 1]`; `None`: all).
    fn step(
        &mut self,
        places: Tensor<2>,
        gradients: Tensor<2>,
        members: Option<Tensor<2>>,
        adam: &AdamConfig,
    ) -> Tensor<2> {
        let device = places.device();
        let count = places.dims()[0];
        let centre: Tensor<2> = Tensor::<1>::from_floats(self.centre.map(|x| x as f32), &device).unsqueeze();
        let offset = (places - centre) * (TURN / self.scale);
        let basis = Tensor::cat(vec![Tensor::full([count, 1], SHIFT, &device), offset], 1);
        let basis = match members {
            Some(members) => basis * members,
            None => basis,
        };
        let before = self.sum.value.clone();
        // A factor of the basis is one of the step: Adam does not see how large gradients are.
        let adam = AdamConfig { beta1: BETA1, ..*adam };
        self.sum.step(exact_matmul(basis.clone().transpose(), gradients), &adam);
        let change = exact_matmul(basis, self.sum.value.clone() - before);
        let blocks = change.dims()[1] / 3;
        let lengths = change.clone().reshape([count, blocks, 3]).powi_scalar(2).sum_dim(2).sqrt();
        let farthest = lengths.sum_dim(1).max().clamp_min(f32::MIN_POSITIVE);
        let shortened = (farthest.recip() * (FARTHEST * adam.lr)).clamp_max(1.0);
        change * shortened.reshape([1, 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{from_host, to_host};

    const ADAM: AdamConfig = AdamConfig { lr: 0.1, beta1: 0.9, beta2: 0.999, eps: 1e-15, step: 1 };

    /// Eight corners of a cube about (1, 2, 3).
    fn corners(device: &Device) -> (Vec<[f64; 3]>, Tensor<2>) {
        let corner = |i: usize| [0, 1, 2].map(|axis| f64::from((i >> axis & 1) as u8) - 0.5);
        let offsets: Vec<[f64; 3]> = (0..8).map(corner).collect();
        let places = offsets.iter().flat_map(|o| [o[0] + 1.0, o[1] + 2.0, o[2] + 3.0]).map(|x| x as f32).collect();
        (offsets, from_host(places, 3, device))
    }

    /// A gradient that asks for a turn about z gives a turn about z of all places, as one linear map; nothing moves much
    /// farther than the rate allows.
    #[test]
    fn a_turn_is_asked_and_a_turn_is_given() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, places) = corners(&device);
        let size = 0.75_f64.sqrt();
        let mut collective = Collective::new([1.0, 2.0, 3.0], size, 1, &device);
        // Down the gradient lies w x offset with w along z.
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0]).map(|x| x as f32).collect();
        let change = to_host(collective.step(places, from_host(gradients, 3, &device), None, &ADAM));
        for (moved, offset) in change.chunks_exact(3).zip(&offsets) {
            let moved: Vec<f64> = moved.iter().map(|x| f64::from(*x)).collect();
            let turn = TURN * ADAM.lr / (REACH * size);
            assert!(
                (moved[0] + turn * offset[1]).abs() < 1e-6 && (moved[1] - turn * offset[0]).abs() < 1e-6,
                "{moved:?}"
            );
            assert!(moved[2].abs() < 1e-6 && moved.iter().all(|x| x.abs() <= FARTHEST * ADAM.lr), "{moved:?}");
        }
    }

    /// All blocks asked for a turn at once: together no farther than the limit, and still a turn.
    #[test]
    fn no_step_goes_far() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, places) = corners(&device);
        let mut collective = Collective::new([1.0, 2.0, 3.0], 0.75_f64.sqrt(), 4, &device);
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0].repeat(4)).map(|x| x as f32).collect();
        let change = to_host(collective.step(places, from_host(gradients, 12, &device), None, &ADAM));
        let length = |block: &[f32]| block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        for blocks in change.chunks_exact(12) {
            let moved: f64 = blocks.chunks_exact(3).map(length).sum();
            assert!((moved / (FARTHEST * ADAM.lr) - 1.0).abs() < 1e-5, "{moved}");
        }
    }

    /// Two cubes side by side: one is asked to turn by more than a step may, the other to shift, and each does what it was asked alone.
    #[test]
    fn bodies_move_apart() {
        const ORDER: usize = 4;
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, near) = corners(&device);
        let far = near.clone() + Tensor::<1>::from_floats([5.0, 0.0, 0.0], &device).unsqueeze();
        let turn = |o: &[f64; 3]| [o[1] as f32, -o[0] as f32, 0.0].repeat(ORDER);
        let turn: Vec<f32> = offsets.iter().flat_map(turn).collect();
        let shift = [0.0, 0.0, -1.0].repeat(8 * ORDER);
        let body = |x: f64| Collective::new([x, 2.0, 3.0], 0.75_f64.sqrt(), ORDER, &device);
        let alone = |x: f64, places: &Tensor<2>, gradients: &[f32]| {
            to_host(body(x).step(places.clone(), from_host(gradients.to_vec(), 3 * ORDER, &device), None, &ADAM))
        };
        let expected = [alone(1.0, &near, &turn), alone(6.0, &far, &shift)].concat();
        let places = Tensor::cat(vec![near, far], 0);
        let gradients = from_host([turn, shift].concat(), 3 * ORDER, &device);
        let together = step_together(&mut [body(1.0), body(6.0)], places.clone(), gradients.clone(), &ADAM);
        let together = to_host(together.expect("there are bodies"));
        assert!(together.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{together:?}, alone {expected:?}");
        assert!(step_together(&mut [], places, gradients, &ADAM).is_none());
    }

    #[test]
    fn a_shift_is_asked_and_a_shift_is_given() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (_, places) = corners(&device);
        let mut collective = Collective::new([1.0, 2.0, 3.0], 1.0, 2, &device);
        let gradients = (0..8).flat_map(|_| [0.0, 0.0, -1.0, 0.0, 2.0, 0.0]).collect();
        let change = to_host(collective.step(places, from_host(gradients, 6, &device), None, &ADAM));
        for moved in change.chunks_exact(6) {
            let step = (SHIFT * ADAM.lr) as f32;
            let expected = [0.0, 0.0, step, 0.0, -step, 0.0];
            assert!(moved.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{moved:?}");
        }
    }
}
