//! The common motion of an object: an update of all its paths together, in addition to each Gaussian's own.
//!
//! A path's blocks `c_k` belong to one Gaussian and are learned from the few pixels it covers. On an object that turns,
//! texture repeats, and a Gaussian alone may converge to the wrong repetition or lag behind. Near the object's centre
//! the motion of the whole object is the first order of a Taylor series in space,
//!
//! `c_k(x) = W_k [1, (x - centre) / scale]`,   `W_k` `[3, 4]`,
//!
//! which represents every rigid motion exactly (a rotation by any angle is linear in `x`) and many others
//! approximately. Adam on `W`, whose gradient is the sum of the gradients of all the object's Gaussians, moves all
//! blocks by `dW_k [1, ...]`. Each object has its own `W`; a Gaussian belongs to the object with the nearest centre.
//! The model does not change: stored numbers and degrees of freedom of single Gaussians stay the same. Not part of the
//! paper.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use gs_burn::adam::AdamRate;
use gs_burn::exact_matmul;
use gs_burn::ops::products::transposed_product;
use gs_burn::ops::sum::largest;
use gs_models::taylormode::window::amplitude;

/// The common motion of an object, as a parameter of Adam.
#[derive(Module, Debug)]
pub struct CommonMotion {
    /// `[4, 3 K]`: sum of all updates of the object's paths.
    pub sum: Param<Tensor<2>>,
    /// Centre of the positions, scene units.
    #[module(skip)]
    pub centre: [f64; 3],
    /// Unit of the positions, scene units: twice the object's root mean square extent.
    pub scale: f64,
}

/// Unit of positions, in root mean square extents of the object: nearly all of an object lies within, so that a
/// position adds less than 1 per axis to a step. A Gaussian farther away has strayed from the object and follows
/// its shift alone: its turn would be the longest, and shorten those of all others.
const REACH: f64 = 2.0;

/// Rate of the shift of the whole object, as a factor of the learning rate.
const SHIFT: f64 = 0.5;

/// Decay of the first moment. The gradient of one photo is a rotation that suits one camera. The usual 0.9 averages ten
/// photos, and so fast a rotation is noisy; 0.99 averages a hundred, more than the cameras of most rigs.
const BETA1: f64 = 0.99;

/// Largest displacement of a position of the object by one step, as a factor of the learning rate; a longer step is
/// scaled down as a whole. Adam's first steps have full length in every number whatever the gradient: together with the
/// Gaussians' own steps they must not exceed a hundredth of the scene, the bound of the stability experiment `thrown`.
const FARTHEST: f64 = 3.0;

/// The basis `[M, 4]` of each object's common motion at `positions` `[M, 3]`, zero at Gaussians of other objects;
/// `turn` is `cues.turn`.
pub fn bases(objects: &[CommonMotion], positions: &Tensor<2>, turn: f64) -> Vec<Tensor<2>> {
    if let [object] = objects {
        return vec![object.basis(positions, turn)];
    }
    let centres: Vec<[f64; 3]> = objects.iter().map(|object| object.centre).collect();
    let members = members(&centres, positions);
    objects.iter().zip(members).map(|(object, member)| object.basis(positions, turn) * member).collect()
}

/// For each centre, 1 at the positions to which it is the nearest, else 0, `[M, 1]`.
fn members(centres: &[[f64; 3]], positions: &Tensor<2>) -> Vec<Tensor<2>> {
    if centres.is_empty() {
        return Vec::new();
    }
    let device = positions.device();
    let distances = centres.iter().map(|centre| {
        let centre: Tensor<2> = Tensor::<1>::from_floats(centre.map(|x| x as f32), &device).unsqueeze();
        (positions.clone() - centre).powi_scalar(2).sum_dim(1)
    });
    let nearest = Tensor::cat(distances.collect(), 1).argmin(1);
    (0..centres.len()).map(|index| nearest.clone().equal_elem(index as i64).float()).collect()
}

impl CommonMotion {
    /// A zero motion of an object with centre `centre` and root mean square extent `size` (scene units), whose paths
    /// have `order` blocks.
    pub fn new(centre: [f64; 3], size: f64, order: usize, device: &Device) -> Self {
        Self { sum: Param::from_tensor(Tensor::zeros([4, 3 * order], device)), centre, scale: REACH * size }
    }

    /// Centre and scale as bits.
    pub fn frame_bits(&self) -> [u64; 4] {
        let [x, y, z] = self.centre;
        [x, y, z, self.scale].map(f64::to_bits)
    }

    /// A zero motion with the centre and scale given as bits.
    pub fn of_bits(bits: [u64; 4], order: usize, device: &Device) -> Self {
        let [x, y, z, scale] = bits.map(f64::from_bits);
        Self { scale, ..Self::new([x, y, z], 1.0, order, device) }
    }

    /// `[1, (x - centre) / scale]`, each weighted with its share of a step, `[M, 4]`.
    fn basis(&self, positions: &Tensor<2>, turn: f64) -> Tensor<2> {
        let (device, count) = (positions.device(), positions.dims()[0]);
        let centre: Tensor<2> = Tensor::<1>::from_floats(self.centre.map(|x| x as f32), &device).unsqueeze();
        let offset = (positions.clone() - centre) * (turn / self.scale);
        let belongs = offset.clone().abs().max_dim(1).lower_equal_elem(turn).float();
        let offset = offset * belongs;
        Tensor::cat(vec![Tensor::full([count, 1], SHIFT, &device), offset], 1)
    }

    /// The gradient of the sum, from `gradients` `[M, 3 K]` of the paths' blocks through `basis`.
    pub fn gradient(basis: &Tensor<2>, gradients: Tensor<2>) -> Tensor<2> {
        transposed_product(basis.clone(), gradients)
    }

    /// The rate of the sum if single paths have the rate `paths`. A factor of the basis is a factor of the step,
    /// because Adam's steps do not depend on the scale of gradients.
    pub fn rate(paths: &AdamRate) -> AdamRate {
        AdamRate { beta1: BETA1, ..*paths }
    }

    /// The change `[M, 3 K]` of the paths' blocks, if the sum was `before` this update; `learned` `[1, 3 K]` is 0 at
    /// blocks that no path has (`None`: there are none), and `lr` is the rate of single paths.
    pub fn change(&self, basis: Tensor<2>, before: Tensor<2>, learned: Option<&Tensor<2>>, lr: f64) -> Tensor<2> {
        let step = self.sum.val() - before;
        let step = match learned {
            Some(learned) => step * learned.clone(),
            None => step,
        };
        let change = exact_matmul(basis, step);
        let [count, columns] = change.dims();
        let lengths: Tensor<2> =
            change.clone().reshape([count, columns / 3, 3]).powi_scalar(2).sum_dim(2).sqrt().squeeze_dim(2);
        let amplitudes: Vec<f32> = (1..=columns / 3).map(|order| amplitude(order) as f32).collect();
        let amplitudes = Tensor::<1>::from_floats(amplitudes.as_slice(), &change.device()).unsqueeze_dim(1);
        let farthest = largest(exact_matmul(lengths, amplitudes)).clamp_min(f32::MIN_POSITIVE);
        let shortened = (farthest.recip() * (FARTHEST * lr)).clamp_max(1.0);
        change * shortened.reshape([1, 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_burn::ops::adam::{AdamConfig, adam_step};
    use gs_train::fit::parameters::{from_host, to_host};

    const LR: f64 = 0.1;
    const TURN: f64 = 6.0;

    /// The change of all paths by a first step of some objects.
    fn step_together(objects: &mut [CommonMotion], positions: &Tensor<2>, gradients: &Tensor<2>) -> Option<Tensor<2>> {
        let bases = bases(objects, positions, TURN);
        let one = |(object, basis): (&mut CommonMotion, Tensor<2>)| {
            let (before, gradient) = (object.sum.val(), CommonMotion::gradient(&basis, gradients.clone()));
            let AdamRate { lr, beta1, beta2, eps, .. } = CommonMotion::rate(&AdamRate::new(LR));
            let config = AdamConfig { lr, beta1, beta2, eps, step: 1, first_columns: None };
            let zeros = gradient.zeros_like();
            let (sum, ..) = adam_step(before.clone(), gradient, zeros.clone(), zeros, &config);
            object.sum = Param::from_tensor(sum);
            object.change(basis, before, None, LR)
        };
        objects.iter_mut().zip(bases).map(one).reduce(|a, b| a + b)
    }

    /// The change by a first step of one object.
    fn step(object: CommonMotion, positions: &Tensor<2>, gradients: Tensor<2>) -> Vec<f32> {
        to_host(step_together(&mut [object], positions, &gradients).expect("one object"))
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
        let size = 0.75_f64.sqrt();
        let object = CommonMotion::new([1.0, 2.0, 3.0], size, 1, &device);
        // The negative gradient is w x offset with w along z.
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0]).map(|x| x as f32).collect();
        let change = step(object, &positions, from_host(gradients, 3, &device));
        for (moved, offset) in change.chunks_exact(3).zip(&offsets) {
            let moved: Vec<f64> = moved.iter().map(|x| f64::from(*x)).collect();
            let turn = TURN * LR / (REACH * size);
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
        let object = CommonMotion::new([1.0, 2.0, 3.0], 0.75_f64.sqrt(), 4, &device);
        let gradients = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0].repeat(4)).map(|x| x as f32).collect();
        let change = step(object, &positions, from_host(gradients, 12, &device));
        let length = |block: &[f32]| block.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        for blocks in change.chunks_exact(12) {
            let moved: f64 =
                blocks.chunks_exact(3).map(length).zip(1..).map(|(long, order)| long / f64::from(order)).sum();
            assert!((moved / (FARTHEST * LR) - 1.0).abs() < 1e-5, "{moved}");
        }
    }

    /// Two adjacent cubes: the gradient rotates one by more than a step may and shifts the other; each moves by its own
    /// gradient alone.
    #[test]
    fn objects_move_apart() {
        const ORDER: usize = 4;
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, near) = corners(&device);
        let far = near.clone() + Tensor::<1>::from_floats([5.0, 0.0, 0.0], &device).unsqueeze();
        let turn = |o: &[f64; 3]| [o[1] as f32, -o[0] as f32, 0.0].repeat(ORDER);
        let turn: Vec<f32> = offsets.iter().flat_map(turn).collect();
        let shift = [0.0, 0.0, -1.0].repeat(8 * ORDER);
        let object = |x: f64| CommonMotion::new([x, 2.0, 3.0], 0.75_f64.sqrt(), ORDER, &device);
        let alone = |x: f64, positions: &Tensor<2>, gradients: &[f32]| {
            step(object(x), positions, from_host(gradients.to_vec(), 3 * ORDER, &device))
        };
        let expected = [alone(1.0, &near, &turn), alone(6.0, &far, &shift)].concat();
        let positions = Tensor::cat(vec![near, far], 0);
        let gradients = from_host([turn, shift].concat(), 3 * ORDER, &device);
        let together = step_together(&mut [object(1.0), object(6.0)], &positions, &gradients);
        let together = to_host(together.expect("there are objects"));
        assert!(together.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{together:?}, alone {expected:?}");
        assert!(step_together(&mut [], &positions, &gradients).is_none());
    }

    /// A Gaussian ten extents away neither turns with the object nor keeps it from turning.
    #[test]
    fn a_stray_follows_the_shift_alone() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (offsets, positions) = corners(&device);
        let stray: Tensor<2> = Tensor::<1>::from_floats([11.0, 2.0, 3.0], &device).unsqueeze();
        let object = || CommonMotion::new([1.0, 2.0, 3.0], 0.75_f64.sqrt(), 1, &device);
        let turn: Vec<f32> = offsets.iter().flat_map(|o| [o[1], -o[0], 0.0]).map(|x| x as f32).collect();
        let alone = step(object(), &positions, from_host(turn.clone(), 3, &device));
        let gradients = from_host([turn, vec![0.0, 5.0, 0.0]].concat(), 3, &device);
        let both = step(object(), &Tensor::cat(vec![positions, stray], 0), gradients);
        let shift = (SHIFT * LR) as f32;
        let near = |a: &f32, b: &f32| (a - b).abs() < 1e-6;
        for (moved, expected) in both.chunks_exact(3).zip(alone.chunks_exact(3)) {
            let shifted = [expected[0], expected[1] - shift, expected[2]];
            assert!(moved.iter().zip(&shifted).all(|(a, b)| near(a, b)), "{moved:?}, expected {shifted:?}");
        }
        assert!(near(&both[24], &0.0) && near(&both[25], &-shift) && near(&both[26], &0.0), "{:?}", &both[24..]);
    }

    #[test]
    fn a_shift_is_asked_and_a_shift_is_given() {
        let device = gs_burn::device::select("auto").expect("a device");
        let (_, positions) = corners(&device);
        let object = CommonMotion::new([1.0, 2.0, 3.0], 1.0, 2, &device);
        let gradients = (0..8).flat_map(|_| [0.0, 0.0, -1.0, 0.0, 2.0, 0.0]).collect();
        let change = step(object, &positions, from_host(gradients, 6, &device));
        for moved in change.chunks_exact(6) {
            let step = (SHIFT * LR) as f32;
            let expected = [0.0, 0.0, step, 0.0, -step, 0.0];
            assert!(moved.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{moved:?}");
        }
    }
}
