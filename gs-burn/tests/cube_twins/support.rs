//! A device, reproducible numbers, scenes and comparisons.
//!
//! Bounds are those of `tests/src/tolerance.rs`: 1e-5 for values and 1e-3 for gradients, thirty times as much for
//! needles and stacks. They are argued there for the accuracies that CUDA and WGSL state of `exp`, `log`, `sqrt` and
//! division. Adam's 1e-6 is eight ULP of a parameter of 1: three products, a root (4.5 ULP by WGSL, of a step of 0.01)
//! and a division (2.5 ULP, likewise).

use std::sync::OnceLock;

use burn::tensor::{Device, Tensor, TensorData};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::client::Client;
use gs_base::Intrinsics;
use gs_burn::{Camera, Gaussians};
use gs_kernels::config::ProjectionConfig;
use gs_kernels::cpu::projection;
use gs_kernels::cube::buffer::Buffer;

/// The default device's client.
pub fn client() -> &'static Client {
    static CLIENT: OnceLock<Client> = OnceLock::new();
    CLIENT.get_or_init(|| cubecl::Device::default().client())
}

/// Uploads.
pub fn up(values: &[f32]) -> Buffer {
    Buffer::upload(client(), "test values", values).expect("upload")
}

/// Uploads.
pub fn up_u32(values: &[u32]) -> Buffer {
    Buffer::upload(client(), "test values", values).expect("upload")
}

/// Reads back.
pub fn down(buffer: &Buffer) -> Vec<f32> {
    buffer.download(client()).expect("download")
}

/// Reads back.
pub fn down_u32(buffer: &Buffer) -> Vec<u32> {
    buffer.download(client()).expect("download")
}

/// SplitMix64: the same numbers on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `low..high`.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn list(&mut self, len: usize, low: f32, high: f32) -> Vec<f32> {
        (0..len).map(|_| self.within(low, high)).collect()
    }
}

/// A pose that turns and shifts, as a row-major `viewmat`.
pub fn pose(random: &mut Random) -> [f32; 16] {
    let (a, b) = (f64::from(random.within(-0.3, 0.3)), f64::from(random.within(-0.3, 0.3)));
    let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
    let rows = [[cb, 0.0, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]];
    let mut viewmat = [0.0; 16];
    for i in 0..3 {
        for j in 0..3 {
            viewmat[4 * i + j] = rows[i][j] as f32;
        }
        viewmat[4 * i + 3] = random.within(-0.2, 0.2);
    }
    viewmat[15] = 1.0;
    viewmat
}

/// Gaussians before a camera; most are seen.
pub struct Scene {
    pub count: usize,
    pub means: Vec<f32>,
    pub quats: Vec<f32>,
    pub log_scales: Vec<f32>,
    pub opacities: Vec<f32>,
    pub viewmat: [f32; 16],
    pub camera: ProjectionConfig,
}

impl Scene {
    pub fn random(seed: u64, count: usize, width: u32, height: u32) -> Self {
        let mut random = Random(seed);
        let viewmat = pose(&mut random);
        let mut means = Vec::new();
        for _ in 0..count {
            let z = random.within(1.0, 6.0);
            means.extend([random.within(-0.7, 0.7) * z, random.within(-0.6, 0.6) * z, z]);
        }
        let focal = f64::from(width);
        Self {
            count,
            means,
            quats: random.list(count * 4, -1.0, 1.0),
            log_scales: random.list(count * 3, -4.5, -1.0),
            opacities: random.list(count, 0.02, 0.999),
            viewmat,
            camera: ProjectionConfig {
                width,
                height,
                fx: focal,
                fy: 1.1 * focal,
                cx: 0.52 * f64::from(width),
                cy: 0.47 * f64::from(height),
                ..Default::default()
            },
        }
    }

    /// The scene's Gaussians on `device`, with opacity logits and colours of degree 3 from `random`.
    pub fn gaussians(&self, random: &mut Random, device: &Device) -> Gaussians {
        let count = self.count;
        Gaussians::from_tensors(
            Tensor::from_data(data(&self.means, &[count, 3]), device),
            Tensor::from_data(data(&self.quats, &[count, 4]), device),
            Tensor::from_data(data(&self.log_scales, &[count, 3]), device),
            Tensor::from_data(data(&random.list(count, -2.0, 4.0), &[count]), device),
            Tensor::from_data(data(&random.list(count * 48, -0.4, 0.4), &[count, 16, 3]), device),
        )
    }

    /// The scene's camera on `device`; its pose wants a gradient.
    pub fn posed_camera(&self, device: &Device) -> Camera {
        let ProjectionConfig { fx, fy, cx, cy, width, height, .. } = self.camera;
        Camera {
            viewmat: Tensor::from_data(data(&self.viewmat, &[4, 4]), device).require_grad(),
            intrinsics: Intrinsics { fx, fy, cx, cy },
            width: width as usize,
            height: height as usize,
        }
    }

    /// Rows of the CPU twin in `f32`, a common input for what follows the projection.
    pub fn projected(&self) -> Vec<f32> {
        projection::forward(&self.means, &self.quats, &self.log_scales, &self.viewmat, &self.camera)
    }
}

/// For a tensor of `shape`.
pub fn data(values: &[f32], shape: &[usize]) -> TensorData {
    TensorData::new(values.to_vec(), shape.to_vec())
}

/// As doubles.
pub fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

/// Checks a gradient: every element within `tolerance` of its own size, where elements far below the largest may be off
/// by as much as one a hundredth of the largest. Prints the largest error in these units, and that there is something.
pub fn assert_gradient(name: &str, got: &[f32], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{name}: length");
    assert!(got.iter().all(|v| v.is_finite()), "{name}: not finite");
    let largest = want.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "{name}: the expected gradient is zero, so nothing is tested");
    let mut worst = (0.0, 0);
    for (k, (&g, &w)) in got.iter().zip(want).enumerate() {
        let error = (f64::from(g) - w).abs() / (w.abs() + 0.01 * largest);
        if error > worst.0 {
            worst = (error, k);
        }
    }
    println!("{name}: relative error {:.1e}, largest gradient {largest:.1e}", worst.0);
    let (error, k) = worst;
    assert!(error <= tolerance, "{name}[{k}]: {} instead of {}, relative error {error:.1e}", got[k], want[k]);
}

/// Checks values to an absolute tolerance that grows with values above 1.
pub fn assert_values(name: &str, got: &[f32], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{name}: length");
    let mut worst = (0.0, 0);
    for (k, (&g, &w)) in got.iter().zip(want).enumerate() {
        assert!(g.is_finite(), "{name}[{k}]: {g}");
        let error = (f64::from(g) - w).abs() / w.abs().max(1.0);
        if error > worst.0 {
            worst = (error, k);
        }
    }
    println!("{name}: error {:.1e}", worst.0);
    let (error, k) = worst;
    assert!(error <= tolerance, "{name}[{k}]: {} instead of {}, error {error:.1e}", got[k], want[k]);
}
