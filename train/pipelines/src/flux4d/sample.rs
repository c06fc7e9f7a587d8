//! A snippet on the compute device: first Gaussians, voxels, and the images it is compared with.

use anyhow::{Result, anyhow};
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::Camera;
use gs_driving::DrivingLog;
use gs_models::flux4d::refinement::Term;
use gs_models::flux4d::unet::VoxelPyramid;
use gs_models::flux4d::{Lifted, LossConfig, Objective, PolynomialMotion, ShownMotion, SnippetFrame, TargetView};

use super::config::{FarChoice, FluxConfig};
use super::confirm::settled;
use super::host_view::HostView;
use super::prepare::HostSnippet;
use super::start::RowMotion;
use gs_train::fit::parameters::from_host;
use gs_train::fit::photos::image_tensor;

/// Levels of the voxel pyramid: those of SparseResUNet42.
const LEVELS: usize = 5;

/// A snippet on the device, without images.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The first Gaussians.
    pub lifted: Lifted,
    /// Voxels of the rows that the convolutions correct, built once for all passes: those that are not far, or all.
    pub pyramid: VoxelPyramid,
    /// The part of the snippet that no network changes.
    pub frame: SnippetFrame,
}

/// The motion that the sweeps of a snippet show.
fn shown(host: &HostSnippet, motion: PolynomialMotion, device: &Device) -> ShownMotion {
    let rows = host.rows.times.len();
    let mut velocity: Vec<f32> =
        host.start.iter().zip(&host.rows.times).flat_map(|(row, time)| row.coefficients(motion, *time)).collect();
    let column = |of_row: fn(&RowMotion) -> f32, far: f32| {
        let mut column: Vec<f32> = host.start.iter().map(of_row).collect();
        column.resize(rows, far);
        from_host(column, 1, device)
    };
    // Far rows rest, and no network predicts their motion.
    let is_known = column(|row| if row.is_known { 1.0 } else { 0.0 }, 1.0);
    let weights = column(RowMotion::weight, 0.0);
    velocity.resize(rows * motion.columns(), 0.0);
    ShownMotion { velocity: from_host(velocity, motion.columns(), device), is_known, weights }
}

impl Sample {
    /// Sends a snippet to `device` (without autodiff) and builds its voxels and kernel maps.
    ///
    /// # Errors
    /// A sentence when a point is too far for the voxels.
    pub fn new(host: &HostSnippet, config: &FluxConfig, device: &Device) -> Result<Self> {
        let lifted = host.rows.to_device(device);
        let _stage = gs_burn::profile::stage("kernel maps");
        let points = match config.own.unet.far {
            FarChoice::Apart => host.near_points(),
            FarChoice::Voxels => host.all_points(),
        };
        let pyramid = VoxelPyramid::of(&points, config.own.unet.voxel as f32, LEVELS, device)
            .map_err(|error| anyhow!("snippet {}: {error}", host.name))?;
        let motion = PolynomialMotion::new(config.own.unet.degree)?;
        let shown = (!host.start.is_empty()).then(|| shown(host, motion, device));
        let frame = SnippetFrame {
            times: lifted.times.clone(),
            far: lifted.far,
            limits: lifted.limits,
            motion,
            shown,
            frame: host.interval / (host.window[1] - host.window[0]),
        };
        Ok(Self { lifted, pyramid, frame })
    }

    /// No velocities, `[N, 3 (l + 1)]`.
    pub fn at_rest(&self) -> Tensor<2> {
        let rows = self.lifted.raw.dims()[0];
        Tensor::zeros([rows, self.frame.motion.columns()], &self.lifted.raw.device())
    }
}

/// The camera of a view.
pub fn camera(log: &DrivingLog, view: &HostView, device: &Device) -> Camera {
    let intrinsics = log.cameras()[view.camera].intrinsics;
    Camera::from_c2w(view.c2w, intrinsics, view.image.width, view.image.height, device)
}

/// The image of a view, `[H, W, 3]`, 0 to 1.
pub fn photo(view: &HostView, device: &Device) -> Tensor<3> {
    image_tensor(&view.image.data, [view.image.height, view.image.width, 3], device)
}

/// A view on the device.
pub fn target(log: &DrivingLog, view: &HostView, device: &Device) -> TargetView {
    let shape = [view.image.height, view.image.width, 1];
    let has_depth = view.depth.iter().any(|depth| *depth > 0.0);
    TargetView {
        camera: camera(log, view, device),
        time: view.time,
        photo: photo(view, device),
        depth: has_depth.then(|| Tensor::from_data(TensorData::new(view.depth.clone(), shape), device)),
    }
}

/// The losses of a step: the input views are fed back, the targets are held out.
pub struct Supervision<'a> {
    /// The part of the snippet that no network changes.
    pub frame: &'a SnippetFrame,
    /// Input views, at least one.
    pub inputs: Vec<TargetView>,
    /// Views between them; none at inference.
    pub targets: Vec<TargetView>,
    /// At inference the snippet against whose sweeps a network's velocities are held.
    pub host: Option<&'a HostSnippet>,
    /// Weights.
    pub loss: LossConfig,
}

impl Objective for Supervision<'_> {
    fn fed_back(&self) -> usize {
        self.inputs.len()
    }

    fn held_out(&self) -> usize {
        self.targets.len()
    }

    fn settled(&self, predicted: Tensor<2>) -> Tensor<2> {
        match self.host {
            Some(host) => settled(host, self.frame, predicted),
            None => predicted,
        }
    }

    fn term(&self, term: Term, raw: Tensor<2>, velocity: Tensor<2>) -> Tensor<1> {
        match term {
            Term::FedBack(view) => self.frame.term(raw, velocity, (&self.inputs, view), &self.loss),
            Term::HeldOut(view) => {
                // The terms of velocities are in the loss of the inputs already.
                let loss = LossConfig { velocity: 0.0, shown: 0.0, ..self.loss };
                self.frame.term(raw, velocity, (&self.targets, view), &loss)
            }
        }
    }
}
