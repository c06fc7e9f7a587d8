//! The points of a snippet's input sweeps: coloured by its images, with the motion that the sweeps show, and thinned.

use std::collections::BTreeSet;

use anyhow::Result;
use glam::DMat4;
use gs_driving::{DrivingLog, Sweep};
use gs_models::flux4d::merge::{MergeConfig, TimedPoints, merge_to_budget};
use rayon::prelude::*;

use super::config::{LiftSection, MergeChoice, VelocityChoice};
use super::host_view::{Posed, color_at};
use super::start::{Motions, RowMotion, motions_of};

/// The points of a snippet.
#[derive(Default)]
pub struct Points {
    /// Positions in the axes of the snippet, times and colours.
    pub points: TimedPoints,
    /// The place of each point's input frame.
    pub row_frames: Vec<u16>,
    /// The motion of each point; empty where the sweeps are not asked for it.
    pub start: Vec<RowMotion>,
}

/// The points of one sweep that rest, that move or of which neither is known; they stay apart when points are merged.
struct SweepPart {
    /// The place of the sweep's input frame.
    frame: u16,
    points: TimedPoints,
    motion: PartMotion,
}

/// The motion of the points of a part.
enum PartMotion {
    /// The same for all.
    Alike(RowMotion),
    /// Of each.
    Each(Vec<RowMotion>),
}

/// The input sweeps of a snippet in its axes.
pub struct Scan<'a> {
    /// The log.
    pub log: &'a DrivingLog,
    /// The frames of the sweeps.
    pub frames: &'a [usize],
    /// The sweeps.
    pub sweeps: &'a [Sweep],
    /// The map from the log's world to the axes of the snippet.
    pub from_world: &'a DMat4,
    /// First and last time of the inputs, seconds.
    pub window: [f64; 2],
}

impl Scan<'_> {
    /// The points of all sweeps with their colours in the inputs, thinned to the budget, and the input frame of each.
    ///
    /// # Errors
    /// When a position is too far or not finite.
    pub fn points(&self, inputs: &[Posed], config: &LiftSection) -> Result<Points> {
        let motions = match config.velocity {
            VelocityChoice::Zero => None,
            VelocityChoice::Aligned => {
                Some(Motions::of(self.log, self.frames, self.sweeps, self.from_world, self.window))
            }
        };
        let places = 0..self.sweeps.len();
        let mut parts: Vec<SweepPart> =
            places.flat_map(|place| self.parts(place, inputs, motions.as_ref(), config.in_view)).collect();
        // Positions of moving points alone are looked up once more after the merge.
        let take = |part: &mut SweepPart| match part.motion {
            PartMotion::Each(_) => part.points.clone(),
            PartMotion::Alike(_) => std::mem::take(&mut part.points),
        };
        let points = parts.iter_mut().map(take).collect();
        let thinned = merge_to_budget(points, &merge_config(inputs, config, &viewpoints(inputs, config)))?.parts;
        let mut all = Points::default();
        for (part, after) in parts.into_iter().zip(thinned) {
            all.row_frames.resize(all.row_frames.len() + after.points.len(), part.frame);
            match part.motion {
                PartMotion::Each(own) => all.start.extend(motions_of(&part.points.points, &own, &after.points)),
                PartMotion::Alike(all_alike) if motions.is_some() => {
                    all.start.resize(all.start.len() + after.points.len(), all_alike);
                }
                PartMotion::Alike(_) => {}
            }
            all.points.points.extend(after.points);
            all.points.times.extend(after.times);
            all.points.colors.extend(after.colors);
        }
        Ok(all)
    }

    /// The points of a sweep by what is known of their motion, of those that an input shows if only these are wanted.
    fn parts(&self, place: usize, inputs: &[Posed], motions: Option<&Motions>, in_view: bool) -> Vec<SweepPart> {
        let (sweep, frame) = (&self.sweeps[place], place as u16);
        let is_wanted =
            |index: &usize| !in_view || inputs.iter().any(|posed| posed.place(sweep.points[*index]).is_some());
        let kept: Vec<usize> = (0..sweep.len()).into_par_iter().filter(is_wanted).collect();
        let own: Vec<&Posed> = inputs.iter().filter(|posed| posed.view.frame == self.frames[place]).collect();
        let part =
            |kept: &[usize], motion| SweepPart { frame, points: coloured(sweep, kept, &own, self.window), motion };
        let alike = |is_known| PartMotion::Alike(RowMotion { is_known, ..RowMotion::default() });
        let Some(motions) = motions else { return vec![part(&kept, alike(false))] };
        let (known, unknown): (Vec<usize>, Vec<usize>) =
            kept.into_iter().partition(|index| motions.found.knows(place, *index));
        let (moving, resting): (Vec<usize>, Vec<usize>) =
            known.into_iter().partition(|index| motions.found.moves(place, *index));
        let of_moving = moving.iter().map(|index| motions.of_point(place, *index, sweep.points[*index])).collect();
        vec![part(&resting, alike(true)), part(&unknown, alike(false)), part(&moving, PartMotion::Each(of_moving))]
    }
}

/// Positions from which the points are seen, where the voxels of a merge grow with the distance.
fn viewpoints(inputs: &[Posed], config: &LiftSection) -> Vec<[f32; 3]> {
    match config.merge {
        MergeChoice::Growing => {
            inputs.iter().map(|posed| posed.view.c2w.w_axis.truncate().as_vec3().to_array()).collect()
        }
        MergeChoice::Equal => Vec::new(),
    }
}

fn merge_config<'a>(inputs: &[Posed], config: &LiftSection, viewpoints: &'a [[f32; 3]]) -> MergeConfig<'a> {
    let cameras = inputs.iter().map(|posed| posed.view.camera).collect::<BTreeSet<_>>().len();
    let budget = if config.points == 0 { usize::MAX } else { config.points * cameras };
    MergeConfig { budget, times: 1, viewpoints }
}

/// Some points of a sweep with their times in the window and their colours in views of the same frame.
fn coloured(sweep: &Sweep, kept: &[usize], views: &[&Posed], [begin, end]: [f64; 2]) -> TimedPoints {
    let time = |index: &usize| (((sweep.times[*index] - begin) / (end - begin)) as f32).clamp(0.0, 1.0);
    TimedPoints {
        points: kept.iter().map(|index| sweep.points[*index]).collect(),
        times: kept.iter().map(time).collect(),
        colors: kept.par_iter().map(|index| color_at(views.iter().copied(), sweep.points[*index])).collect(),
    }
}
