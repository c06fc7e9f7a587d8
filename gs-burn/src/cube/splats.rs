//! From Gaussians to an image on a GPU: projection, colours, opacities, the lists of tiles, blending.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::{intersect, opacity, projection, rasterize, sh};
use gs_kernels::rows::{PROJECTED, SCREEN};

use super::{Launch, dispatches, unwrap};
use crate::ops::instants::Instants;
use crate::ops::intersect::Intersection;
use crate::ops::opacity::Opacities;
use crate::ops::operation::{ComputeOnCube, OnCube, Output, State, Tensors};
use crate::ops::projection::Projection;
use crate::ops::rasterize::Rasterization;
use crate::ops::sh::ShColors;

impl OnCube<4, 0> for Projection {
    fn forward(&self, inputs: [CubeTensor; 4], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let (launch, count) = (Launch::of(&inputs[0]), inputs[0].meta.shape()[0]);
        let [means, quats, log_scales, viewmat] = &inputs.map(|t| launch.floats(t));
        let rows = projection::forward(&launch.client, means, quats, log_scales, viewmat, &self.0);
        let rows = launch.float_tensor(unwrap(rows), [count, PROJECTED]);
        Output { saved: Tensors::of_floats([rows.clone()]), tensor: rows }
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 4, 0>,
        v: CubeTensor,
        wanted: [bool; 4],
    ) -> [Option<CubeTensor>; 4] {
        let (inputs, ([projected], [])) = (state.inputs(), state.saved.into_arrays());
        let (launch, count) = (Launch::of(&v), v.meta.shape()[0]);
        let [means, quats, log_scales, viewmat] = &inputs.map(|t| launch.floats(t));
        let [projected, v] = &[projected, v].map(|t| launch.floats(t));
        let gradients = unwrap(projection::backward(
            &launch.client,
            means,
            quats,
            log_scales,
            viewmat,
            &self.0,
            projected,
            v,
            wanted[3],
        ));
        [
            Some(launch.float_tensor(gradients.means, [count, 3])),
            Some(launch.float_tensor(gradients.quats, [count, 4])),
            Some(launch.float_tensor(gradients.log_scales, [count, 3])),
            gradients.viewmat.map(|pose| launch.float_tensor(pose, [4, 4])),
        ]
    }
}

impl OnCube<4, 0> for ShColors {
    fn forward(&self, inputs: [CubeTensor; 4], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let (launch, count) = (Launch::of(&inputs[0]), inputs[0].meta.shape()[0]);
        let [means, sh, viewmat, projected] = &inputs.map(|t| launch.floats(t));
        let colors = sh::forward(&launch.client, means, sh, viewmat, projected, &self.0);
        Output::of(launch.float_tensor(unwrap(colors), [count, 3]))
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 4, 0>,
        v: CubeTensor,
        wanted: [bool; 4],
    ) -> [Option<CubeTensor>; 4] {
        let (launch, count) = (Launch::of(&v), v.meta.shape()[0]);
        let [means, sh, viewmat, projected] = &state.inputs().map(|t| launch.floats(t));
        let v = launch.floats(v);
        let gradients = sh::backward(&launch.client, means, sh, viewmat, projected, &self.0, &v, wanted[2]);
        let gradients = unwrap(gradients);
        [
            Some(launch.float_tensor(gradients.means, [count, 3])),
            Some(launch.float_tensor(gradients.sh, [count, self.0.coefficients, 3])),
            gradients.viewmat.map(|pose| launch.float_tensor(pose, [4, 4])),
            None,
        ]
    }
}

impl OnCube<1, 0> for Opacities {
    fn forward(&self, [logits]: [CubeTensor; 1], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let (launch, count) = (Launch::of(&logits), logits.meta.shape()[0]);
        let opacities = opacity::forward(&launch.client, &launch.floats(logits));
        Output::of(launch.float_tensor(unwrap(opacities), [count]))
    }

    fn backward(&self, mut state: State<CubeBackend, 1, 0>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let (launch, count) = (Launch::of(&v), v.meta.shape()[0]);
        let [logits] = state.inputs().map(|t| launch.floats(t));
        let v_logits = opacity::backward(&launch.client, &logits, &launch.floats(v));
        [Some(launch.float_tensor(unwrap(v_logits), [count]))]
    }
}

impl ComputeOnCube<3, 0> for Intersection {
    fn compute(&self, inputs: [CubeTensor; 3], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        let (launch, channels) = (Launch::of(&inputs[0]), inputs[2].meta.shape()[1]);
        let [projected, opacities, features] = &inputs.map(|t| launch.floats(t));
        let found =
            intersect::intersect(&launch.client, projected, opacities, features, self.size, channels, self.room);
        let intersect::Found { lists, words } = unwrap(found);
        let words = words.unwrap_or_else(|| launch.none("no number of pairs"));
        let number_len = words.len();
        let ints = [lists.tile_offsets, lists.gaussian_ids, lists.gaussian_offsets, lists.positions];
        Tensors {
            floats: vec![launch.float_tensor(words, [number_len])],
            ints: ints.map(|list| launch.int_tensor(list)).into(),
        }
    }
}

impl ComputeOnCube<3, 1> for Instants {
    fn compute(&self, inputs: [CubeTensor; 3], [moving]: [CubeTensor; 1]) -> Tensors<CubeBackend> {
        let (launch, channels) = (Launch::of(&inputs[0]), inputs[2].meta.shape()[1]);
        let [projected, opacities, features] = &inputs.map(|t| launch.floats(t));
        let moving = &launch.ints(moving);
        let rows = intersect::InstantRows { projected, opacities, features, scene: self.scene, moving };
        let found = unwrap(intersect::intersect_instants(&launch.client, rows, self.size, channels, self.room));
        let words = match found.words {
            Some(words) => words,
            None => ["no number of pairs", "no number of tiles"].map(|what| launch.none(what)),
        };
        let words = words.map(|words| {
            let len = words.len();
            launch.float_tensor(words, [len])
        });
        let ints = [
            found.tile_offsets,
            found.gaussian_ids,
            found.gaussian_offsets,
            found.positions,
            found.places,
            found.shares,
        ];
        Tensors { floats: words.into(), ints: ints.map(|list| launch.int_tensor(list)).into() }
    }
}

impl OnCube<5, 5> for Rasterization {
    fn forward(&self, inputs: [CubeTensor; 5], lists: [CubeTensor; 5], tracked: bool) -> Output<CubeBackend> {
        let (launch, shape) = (Launch::of(&inputs[0]), self.output_shape(lists[4].meta.shape()[0]));
        let rendered =
            with_buffers(&launch, inputs, lists, |inputs| rasterize::forward(&launch.client, &self.0, inputs, tracked));
        let rasterize::Rendered { output, saved } = unwrap(rendered);
        let saved = saved.map_or(Tensors::none(), |saved| {
            let len = saved.attributes.len();
            let rows = launch.float_tensor(saved.attributes, [len]);
            Tensors { floats: vec![rows], ints: vec![launch.int_tensor(saved.pixels)] }
        });
        Output { tensor: launch.float_tensor(output, shape), saved }
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 5, 5>,
        v: CubeTensor,
        wanted: [bool; 5],
    ) -> [Option<CubeTensor>; 5] {
        let (inputs, config) = (state.inputs(), &self.0);
        let (launch, count) = (Launch::of(&v), inputs[0].meta.shape()[0]);
        let ([rows], [words]) = state.saved.into_arrays();
        let saved = rasterize::Saved { attributes: launch.floats(rows), pixels: launch.ints(words) };
        let v_output = launch.floats(v);
        let bytes = dispatches::pair_bytes(&launch.device, &launch.client);
        let gradients = with_buffers(&launch, inputs, state.lists, |inputs| {
            rasterize::backward_within(&launch.client, config, inputs, &saved, &v_output, wanted[3], bytes)
        });
        let gradients = unwrap(gradients);
        [
            Some(launch.float_tensor(gradients.projected, [count, PROJECTED])),
            Some(launch.float_tensor(gradients.opacities, [count])),
            Some(launch.float_tensor(gradients.features, [count, config.channels])),
            gradients.background.map(|sums| launch.float_tensor(sums, [config.channels])),
            Some(launch.float_tensor(gradients.screen, [count, SCREEN])),
        ]
    }
}

/// `task` with the inputs of a rasterization as buffers; the numbers of the screen tensor are never read.
fn with_buffers<T>(
    launch: &Launch,
    [projected, opacities, features, background, _screen]: [CubeTensor; 5],
    lists: [CubeTensor; 5],
    task: impl FnOnce(&rasterize::Inputs) -> T,
) -> T {
    let [projected, opacities, features, background] =
        &[projected, opacities, features, background].map(|tensor| launch.floats(tensor));
    task(&rasterize::Inputs { projected, opacities, features, background, lists: &launch.lists(lists) })
}
