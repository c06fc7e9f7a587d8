//! Edits applied to a scene: the moving rows are changed on the host, the resting ones stay as they are.

use burn::module::Param;
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::Gaussians;

use super::edits::{Edit, EditScript};
use super::found::Actor;
use crate::flux4d::activate::SH_C0;
use crate::flux4d::error::{FluxError, check_range};
use crate::flux4d::scene::{FluxScene, reordered, take};

/// Largest offset of an edit, metres: one kilometre is beyond any snippet.
const OFFSET_MAX: f64 = 1e3;

/// Result of [`apply_edits`].
#[derive(Debug, Clone)]
pub struct Edited {
    /// The changed scene, outside autodiff. Its [`FluxScene::rows`] name the rows of the scene before.
    pub scene: FluxScene,
    /// Rows of each actor among the changed scene's moving Gaussians; none for a removed one.
    pub actors: Vec<Vec<u32>>,
}

/// Applies `script` to `scene`, whose `actors` were found in it.
///
/// # Errors
/// When an edit names an actor that is not there or no longer there, or has a number out of range; the scene is then
/// left alone.
pub fn apply_edits(scene: &FluxScene, actors: &[Actor], script: &EditScript) -> Result<Edited, FluxError> {
    let mut draft = Draft::read(scene, actors);
    script.edits.iter().try_for_each(|edit| draft.apply(edit))?;
    Ok(draft.finish(scene))
}

/// A moving Gaussian on the host.
#[derive(Clone)]
struct Row {
    /// The moving row of the scene that it is a copy of.
    from: u32,
    /// Its actor; a row of none stays as it is.
    actor: Option<usize>,
    mean: [f64; 3],
    quat: [f64; 4],
    /// Blocks of three.
    velocity: Vec<f64>,
    /// Coefficients, three a term.
    sh: Vec<f64>,
}

/// The moving rows, and the centre that each actor turns about.
struct Draft {
    rows: Vec<Row>,
    centres: Vec<[f64; 3]>,
}

impl Draft {
    fn read(scene: &FluxScene, actors: &[Actor]) -> Self {
        let (first, count) = (scene.resting(), scene.moving());
        let host = |data: TensorData| data.iter::<f64>().collect::<Vec<f64>>();
        let table = |tensor: Tensor<2>| {
            let columns = tensor.dims()[1];
            let moving: Vec<u32> = (first as u32..(first + count) as u32).collect();
            let values = host(take(tensor.inner(), &moving).to_data());
            values.chunks(columns.max(1)).map(<[f64]>::to_vec).collect::<Vec<_>>()
        };
        let sh = scene.gaussians.sh.val();
        let [rows, terms, _] = sh.dims();
        let (means, quats) = (table(scene.gaussians.means.val()), table(scene.gaussians.quats.val()));
        let (velocity, sh) = (host(scene.velocity.val().inner().to_data()), table(sh.reshape([rows, 3 * terms])));
        let velocity = velocity.chunks(scene.motion.columns());
        let columns = means.iter().zip(&quats).zip(velocity).zip(sh).zip(0..);
        let mut rows: Vec<Row> = columns
            .map(|((((m, q), velocity), sh), from)| {
                let (mean, quat) = ([m[0], m[1], m[2]], [q[0], q[1], q[2], q[3]]);
                Row { from, actor: None, mean, quat, velocity: velocity.to_vec(), sh }
            })
            .collect();
        for (number, found) in actors.iter().enumerate() {
            let own = found.rows.iter().filter(|row| (**row as usize) < count);
            own.for_each(|row| rows[*row as usize].actor = Some(number));
        }
        Self { rows, centres: actors.iter().map(|actor| actor.bounds.centre).collect() }
    }

    fn apply(&mut self, edit: &Edit) -> Result<(), FluxError> {
        match *edit {
            Edit::Remove { actor } => {
                self.check_actor(actor)?;
                self.rows.retain(|row| row.actor != Some(actor));
            }
            Edit::Move { actor, offset, turn } => {
                self.check_place(actor, offset, turn)?;
                self.place(actor, actor, offset, turn);
            }
            Edit::Insert { actor, offset, turn } => {
                self.check_place(actor, offset, turn)?;
                let copy = self.centres.len();
                self.centres.push(self.centres[actor]);
                let copied = self.rows.iter().filter(|row| row.actor == Some(actor)).cloned();
                let copied: Vec<Row> = copied.map(|row| Row { actor: Some(copy), ..row }).collect();
                self.rows.extend(copied);
                self.place(actor, copy, offset, turn);
            }
            Edit::Recolor { actor, color, share } => {
                self.check_actor(actor)?;
                check_range("an edit's share of colour", share, [0.0, 1.0], "0 to 1")?;
                color.iter().try_for_each(|c| check_range("an edit's colour", *c, [0.0, 1.0], "0 to 1"))?;
                self.recolor(actor, color, share);
            }
        }
        Ok(())
    }

    fn check_actor(&self, actor: usize) -> Result<(), FluxError> {
        match self.centres.len() {
            0 => Err(FluxError::NoActors { actor }),
            count if actor >= count => Err(FluxError::NoActor { actor, last: count - 1 }),
            _ if self.rows.iter().all(|row| row.actor != Some(actor)) => Err(FluxError::Removed { actor }),
            _ => Ok(()),
        }
    }

    fn check_place(&self, actor: usize, offset: [f64; 3], turn: f64) -> Result<(), FluxError> {
        self.check_actor(actor)?;
        check_range("an edit's turn", turn, [-360.0, 360.0], "-360 to 360 degrees")?;
        let within = |x: &f64| check_range("an edit's offset", *x, [-OFFSET_MAX, OFFSET_MAX], "-1000 to 1000 metres");
        offset.iter().try_for_each(within)
    }

    /// The rows of an actor.
    fn of(&mut self, actor: usize) -> impl Iterator<Item = &mut Row> {
        self.rows.iter_mut().filter(move |row| row.actor == Some(actor))
    }

    /// Turns the rows of `moved` about the centre of `pivot`, then shifts them.
    fn place(&mut self, pivot: usize, moved: usize, offset: [f64; 3], turn: f64) {
        let (sin, cos) = turn.to_radians().sin_cos();
        let turned = |[x, y, z]: [f64; 3]| [cos * x - sin * y, sin * x + cos * y, z];
        let (half_sin, half_cos) = (0.5 * turn.to_radians()).sin_cos();
        let centre = self.centres[pivot];
        for row in self.of(moved) {
            let relative = turned([0, 1, 2].map(|axis| row.mean[axis] - centre[axis]));
            row.mean = [0, 1, 2].map(|axis| centre[axis] + relative[axis] + offset[axis]);
            for block in row.velocity.chunks_exact_mut(3) {
                block.copy_from_slice(&turned([block[0], block[1], block[2]]));
            }
            // (c, 0, 0, s) times the quaternion (Hamilton).
            let [w, x, y, z] = row.quat;
            let (c, s) = (half_cos, half_sin);
            row.quat = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w];
        }
        self.centres[moved] = [0, 1, 2].map(|axis| centre[axis] + offset[axis]);
    }

    fn recolor(&mut self, actor: usize, color: [f64; 3], share: f64) {
        for row in self.of(actor) {
            for (term, values) in row.sh.chunks_exact_mut(3).enumerate() {
                for channel in 0..3 {
                    let target = if term == 0 { (color[channel] - 0.5) / SH_C0 } else { 0.0 };
                    values[channel] += share * (target - values[channel]);
                }
            }
        }
    }

    fn finish(self, scene: &FluxScene) -> Edited {
        let resting = scene.resting() as u32;
        let rows: Vec<u32> = (0..resting).chain(self.rows.iter().map(|row| resting + row.from)).collect();
        let count = self.rows.len();
        let old = reordered(&scene.gaussians, &rows);
        let options = (old.device(), old.means.dtype());
        let joined = |kept: Tensor<2>, values: Vec<f64>| {
            let columns = kept.dims()[1];
            let resting: Vec<u32> = (0..resting).collect();
            let still = take(kept, &resting);
            match (resting.len(), count) {
                (_, 0) => still,
                (0, _) => table(values, [count, columns], &options),
                _ => Tensor::cat(vec![still, table(values, [count, columns], &options)], 0),
            }
        };
        let sh = old.sh.val();
        let [total, terms, _] = sh.dims();
        let column = |of: fn(&Row) -> &[f64]| self.rows.iter().flat_map(of).copied().collect::<Vec<f64>>();
        let colors = joined(sh.reshape([total, 3 * terms]), column(|row| &row.sh)).reshape([total, terms, 3]);
        let gaussians = Gaussians::from_tensors(
            joined(old.means.val(), column(|row| &row.mean)),
            joined(old.quats.val(), column(|row| &row.quat)),
            old.log_scales.val(),
            old.opacity_logits.val(),
            colors,
        );
        let velocity = match count {
            0 => take(scene.velocity.val().inner(), &[]),
            _ => table(column(|row| &row.velocity), [count, scene.motion.columns()], &options),
        };
        let times = self.rows.iter().map(|row| scene.times[row.from as usize]).collect();
        let of_actor =
            |actor: usize| (0..count as u32).filter(|row| self.rows[*row as usize].actor == Some(actor)).collect();
        let actors = (0..self.centres.len()).map(of_actor).collect();
        let (motion, window) = (scene.motion, scene.window);
        Edited {
            scene: FluxScene { gaussians, velocity: Param::from_tensor(velocity), times, rows, motion, window },
            actors,
        }
    }
}

fn table(values: Vec<f64>, shape: [usize; 2], (device, dtype): &(Device, DType)) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, shape), (device, *dtype))
}
