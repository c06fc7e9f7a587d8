//! A small multilayer perceptron on rows, for the networks of the papers.
//!
//! It is a list of matrices and nothing else: whoever trains it walks [`Mlp::tensors`], and puts updated ones back with
//! [`Mlp::from_tensors`] or [`Mlp::map`].

use burn::tensor::activation::relu;
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::profile;

/// `x -> W_L relu(... relu(W_1 x + b_1) ...) + b_L` on each row.
///
/// On CUDA its products may be computed in TF32, ten bits after the point: a network does not need more.
///
/// ReLU, because these networks run on every moving pixel: a smooth activation costs an exponential per unit there.
#[derive(Debug, Clone)]
pub struct Mlp {
    /// One matrix a layer, `[in, out]`.
    pub weights: Vec<Tensor<2>>,
    /// One row a layer, `[1, out]`.
    pub biases: Vec<Tensor<2>>,
}

impl Mlp {
    /// A network with layers of `sizes` (input first, output last), its weights drawn from `seed` alone: uniform with
    /// variance 2 / in (He et al. 2015), biases zero.
    ///
    /// With `zero_last` the last layer starts at zero, so the network's first answer is zero whatever it is asked; its
    /// gradient is not.
    ///
    /// # Panics
    /// With fewer than two sizes, or a size of 0.
    pub fn new(sizes: &[usize], seed: u64, zero_last: bool, device: &Device) -> Self {
        assert!(sizes.len() >= 2, "a network has an input and an output, sizes are {sizes:?}");
        assert!(sizes.iter().all(|size| *size > 0), "no layer may be empty, sizes are {sizes:?}");
        let mut random = SplitMix64(seed);
        let layers = sizes.len() - 1;
        let weights = (0..layers).map(|layer| {
            let (rows, columns) = (sizes[layer], sizes[layer + 1]);
            let zero = zero_last && layer == layers - 1;
            // A uniform number in -a..a has variance a^2 / 3.
            let bound = if zero { 0.0 } else { (6.0 / rows as f64).sqrt() };
            let values: Vec<f32> = (0..rows * columns).map(|_| (bound * (2.0 * random.unit() - 1.0)) as f32).collect();
            Tensor::from_data(TensorData::new(values, [rows, columns]), (device, DType::F32))
        });
        let weights = weights.collect();
        let biases = sizes[1..].iter().map(|size| Tensor::zeros([1, *size], (device, DType::F32))).collect();
        Self { weights, biases }
    }

    /// `[R, in]` to `[R, out]`, each row by itself; differentiable by input and weights.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        let _stage = profile::stage("networks");
        let first = input.matmul(self.weights[0].clone()) + self.biases[0].clone();
        self.after_first(first)
    }

    /// The same as `forward` on rows that all end in the same columns: `input` is `[R, a]`, `shared` `[1, c]`, and the
    /// network takes `a + c`. What is shared enters once, as part of the first bias, instead of once a row.
    pub fn forward_shared(&self, input: Tensor<2>, shared: Tensor<2>) -> Tensor<2> {
        let _stage = profile::stage("networks");
        let own = input.dims()[1];
        let total = self.inputs();
        let weights = self.weights[0].clone();
        let shared = shared.matmul(weights.clone().narrow(0, own, total - own)) + self.biases[0].clone();
        self.after_first(input.matmul(weights.narrow(0, 0, own)) + shared)
    }

    fn after_first(&self, first: Tensor<2>) -> Tensor<2> {
        let rest = self.weights.iter().zip(&self.biases).skip(1);
        rest.fold(first, |x, (weights, bias)| relu(x).matmul(weights.clone()) + bias.clone())
    }

    /// Numbers a row takes.
    pub fn inputs(&self) -> usize {
        self.weights[0].dims()[0]
    }

    /// Numbers a row gives.
    pub fn outputs(&self) -> usize {
        self.biases[self.biases.len() - 1].dims()[1]
    }

    /// How many numbers are learned.
    pub fn parameters(&self) -> usize {
        self.tensors().iter().map(|tensor| tensor.dims().iter().product::<usize>()).sum()
    }

    /// Every learned tensor: weights and bias of the first layer, of the second, and so on.
    pub fn tensors(&self) -> Vec<Tensor<2>> {
        self.weights.iter().zip(&self.biases).flat_map(|(w, b)| [w.clone(), b.clone()]).collect()
    }

    /// The network of the tensors of [`tensors`](Self::tensors), in that order.
    ///
    /// # Panics
    /// When their number is odd or their shapes do not follow one another.
    pub fn from_tensors(tensors: Vec<Tensor<2>>) -> Self {
        assert!(tensors.len() >= 2 && tensors.len().is_multiple_of(2), "{} tensors make no layers", tensors.len());
        let (mut weights, mut biases): (Vec<Tensor<2>>, Vec<Tensor<2>>) = Default::default();
        for (i, tensor) in tensors.into_iter().enumerate() {
            if i % 2 == 0 { weights.push(tensor) } else { biases.push(tensor) }
        }
        for (layer, (w, b)) in weights.iter().zip(&biases).enumerate() {
            assert_eq!([1, w.dims()[1]], b.dims(), "bias of layer {layer}");
            let before = if layer == 0 { w.dims()[0] } else { weights[layer - 1].dims()[1] };
            assert_eq!(before, w.dims()[0], "inputs of layer {layer}");
        }
        Self { weights, biases }
    }

    /// The network with `f` of each tensor, in the order of [`tensors`](Self::tensors).
    pub fn map(&self, f: impl FnMut(Tensor<2>) -> Tensor<2>) -> Self {
        Self::from_tensors(self.tensors().into_iter().map(f).collect())
    }
}

/// Steele, Lea and Flood 2014: no state outside, the same numbers on every machine.
struct SplitMix64(u64);

impl SplitMix64 {
    /// In 0..1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
