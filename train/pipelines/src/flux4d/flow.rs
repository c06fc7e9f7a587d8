//! Scene flow of a snippet against the labels of its LiDAR points.
//!
//! Evaluated are the points of the input sweeps that an input image shows and whose flow is known. A point has the
//! flow of the nearest Gaussian of its own sweep.

use anyhow::Result;
use gs_driving::{DrivingLog, FLOW_INTERVAL, Labels, ObjectClass, Sweep};
use gs_models::flux4d::flow_metrics::{Buckets, FlowClass, FlowFrame, PointErrors, ThreeWay};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::host_view::Posed;
use super::infer::Inferred;
use super::moving::MOVING;
use super::prepare::HostSnippet;
use gs_train::fit::figure::{Better, Figure, FigureTable};
use gs_train::fit::parameters::to_host;

/// Errors of the flow over all snippets.
#[derive(Debug, Clone, Default)]
pub struct FlowScores {
    points: PointErrors,
    three_way: ThreeWay,
    buckets: Buckets,
    moving: Mean,
    resting: Mean,
    resting_speed: Mean,
    /// Error of predicting no motion, over the moving points.
    still: Mean,
    /// Squared errors of velocities over all points and over the moving ones.
    squared: Mean,
    squared_moving: Mean,
}

/// A mean of values as they come.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    /// The mean; `None` without values.
    pub fn value(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

/// The labelled points of one sweep with their predicted flow, metres in 0.1 s.
#[derive(Debug, Clone, Default)]
pub struct FlowOfSweep {
    /// Positions in the axes of the snippet, metres.
    pub points: Vec<[f32; 3]>,
    /// Predicted.
    pub predicted: Vec<[f32; 3]>,
    /// True.
    pub truth: Vec<[f32; 3]>,
    /// Classes.
    pub classes: Vec<FlowClass>,
    /// The Gaussian whose flow each point has, before resting and moving ones are parted; empty without Gaussians.
    pub rows: Vec<u32>,
    /// The object of each point, a place in [`tracks`](Self::tracks); `None` on the background.
    pub objects: Vec<Option<u32>>,
    /// Names of the objects, the same for an object in all sweeps.
    pub tracks: Vec<String>,
}

impl FlowOfSweep {
    /// The points `kept` of a sweep, whose flow is known, with their predicted flow.
    pub fn of(sweep: &Sweep, labels: &Labels, kept: &[usize], predicted: Vec<[f32; 3]>) -> Self {
        Self {
            points: kept.iter().map(|index| sweep.points[*index]).collect(),
            predicted,
            truth: kept.iter().filter_map(|index| labels.flow[*index]).collect(),
            classes: kept.iter().map(|index| class(labels.class[*index])).collect(),
            rows: Vec::new(),
            objects: kept.iter().map(|index| labels.instance[*index].checked_sub(1)).collect(),
            tracks: labels.tracks.clone(),
        }
    }
}

/// The flow of the labelled points of input `place` of a snippet; `None` without labels or Gaussians.
///
/// # Errors
/// When the sweep is broken.
pub fn of_sweep(
    log: &DrivingLog,
    host: &HostSnippet,
    inferred: &Inferred,
    place: usize,
) -> Result<Option<FlowOfSweep>> {
    let frame = host.frames.inputs[place];
    let rows: Vec<usize> = (0..host.row_frames.len()).filter(|row| host.row_frames[*row] as usize == place).collect();
    let sweep = host.labelled_sweep(log, frame)?;
    let Some(labels) = sweep.labels.as_ref().filter(|_| !rows.is_empty()) else { return Ok(None) };
    let flows = flows(host, inferred, log.frames()[frame].time);
    let points = host.near_points();
    let own: Vec<[f32; 3]> = rows.iter().map(|row| points[*row]).collect();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&own);
    let views = Posed::all(log, &host.inputs);
    let seen = |index: &usize| {
        labels.flow[*index].is_some() && views.iter().any(|posed| posed.place(sweep.points[*index]).is_some())
    };
    let kept: Vec<usize> = (0..sweep.len()).into_par_iter().filter(seen).collect();
    let row = |index: &usize| {
        let nearest = tree.nearest_one::<SquaredEuclidean>(&sweep.points[*index]).item;
        rows[nearest as usize] as u32
    };
    let rows: Vec<u32> = kept.par_iter().map(row).collect();
    let predicted = rows.iter().map(|row| flows[*row as usize]).collect();
    Ok(Some(FlowOfSweep { rows, ..FlowOfSweep::of(&sweep, labels, &kept, predicted) }))
}

/// The flow of the labelled points of all inputs of a snippet.
///
/// # Errors
/// When a sweep is broken.
pub fn of_inputs(log: &DrivingLog, host: &HostSnippet, inferred: &Inferred) -> Result<Vec<FlowOfSweep>> {
    let inputs = 0..host.frames.inputs.len();
    inputs.filter_map(|place| of_sweep(log, host, inferred, place).transpose()).collect()
}

/// Flow of every row from a time (seconds) on, metres in 0.1 s.
fn flows(host: &HostSnippet, inferred: &Inferred, seconds: f64) -> Vec<[f32; 3]> {
    let step = FLOW_INTERVAL / (host.window[1] - host.window[0]);
    let at = host.in_window(seconds).clamp(0.0, 1.0);
    let flow = to_host(inferred.sample.frame.motion.flow(inferred.velocity.clone(), at, step));
    flow.as_chunks::<3>().0.to_vec()
}

fn class(class: ObjectClass) -> FlowClass {
    match class {
        ObjectClass::Background => FlowClass::Background,
        ObjectClass::Car => FlowClass::Car,
        ObjectClass::OtherVehicle => FlowClass::OtherVehicle,
        ObjectClass::Pedestrian => FlowClass::Pedestrian,
        ObjectClass::WheeledVru => FlowClass::WheeledVru,
    }
}

/// The length of a flow.
pub fn norm(vector: [f32; 3]) -> f64 {
    vector.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}

impl FlowScores {
    /// Adds one sweep.
    ///
    /// # Errors
    /// When a flow is not finite.
    pub fn add(&mut self, flow: &FlowOfSweep) -> Result<()> {
        let FlowOfSweep { predicted, truth, classes, .. } = flow;
        let frame = FlowFrame { predicted, truth, classes };
        self.points.add(&frame)?;
        self.three_way.add(&frame)?;
        self.buckets.add(&frame)?;
        for (predicted, truth) in predicted.iter().zip(truth) {
            let error = norm([0, 1, 2].map(|axis| predicted[axis] - truth[axis]));
            let squared = (error / FLOW_INTERVAL).powi(2);
            self.squared.add(squared);
            match norm(*truth) >= f64::from(MOVING) {
                true => {
                    self.squared_moving.add(squared);
                    self.moving.add(error);
                    self.still.add(norm(*truth));
                }
                false => {
                    self.resting.add(error);
                    self.resting_speed.add(norm(*predicted) / FLOW_INTERVAL);
                }
            }
        }
        Ok(())
    }

    /// The figures; none without a labelled point.
    pub fn figures(&self) -> Vec<Figure> {
        let (points, three) = (self.points.finish(), self.three_way.finish());
        let metres = |key: &str, name: &str, value: Option<f64>| {
            value.map(|value| Figure::new(key, name, value, "m").digits(3).better(Better::Lower))
        };
        let share = |key: &str, name: &str, value: Option<f64>| {
            value.map(|value| Figure::new(key, name, value, "").digits(3).better(Better::Higher))
        };
        let root = |key: &str, name: &str, squared: Mean| {
            squared.value().map(|mean| Figure::new(key, name, mean.sqrt(), "m/s").digits(3).better(Better::Lower))
        };
        let still = self.still.value().map_or(String::new(), |still| format!("{still:.3} m without any motion"));
        let angle = points.angle_moving.map(|x| Figure::new("angle_moving", "angle, above 0.1 m", x, "rad").digits(3));
        let found = [
            metres("epe3d", "EPE3D", points.epe3d).map(Figure::headline),
            metres("epe_moving", "EPE3D, moving", self.moving.value()).map(|f| f.headline().note(still)),
            metres("epe_resting", "EPE3D, at rest", self.resting.value()).map(Figure::headline),
            self.resting_speed.value().map(|speed| {
                Figure::new("speed_at_rest", "speed of what rests", speed, "m/s")
                    .digits(3)
                    .better(Better::Lower)
                    .column()
            }),
            share("acc5", "Acc5, or 5 %", points.acc5),
            share("acc10", "Acc10, or 10 %", points.acc10),
            share("acc5_absolute", "Acc5, absolute", points.acc5_absolute),
            share("acc10_absolute", "Acc10, absolute", points.acc10_absolute),
            angle,
            root("velocity_rmse", "velocity RMSE", self.squared),
            root("velocity_rmse_moving", "velocity RMSE, moving", self.squared_moving),
            metres("epe_bs", "EPE, resting background", three.points.bs),
            metres("epe_fs", "EPE, resting foreground", three.points.fs),
            metres("epe_fd", "EPE, moving foreground", three.points.fd),
            metres("epe_3way", "EPE, three-way, mean of the columns", three.points.mean),
            metres("epe_3way_frames", "EPE, three-way, by frames", three.frames.mean),
        ];
        found.into_iter().flatten().collect()
    }

    /// The bucketed errors by class.
    pub fn table(&self) -> Option<FigureTable> {
        let bucketed = self.buckets.finish();
        let known = |value: Option<f64>| value.map_or("–".to_string(), |value| format!("{value:.3}"));
        let class = |class: FlowClass| match class {
            FlowClass::Background => "background",
            FlowClass::Car => "car",
            FlowClass::OtherVehicle => "other vehicle",
            FlowClass::Pedestrian => "pedestrian",
            FlowClass::WheeledVru => "wheeled VRU",
        };
        let counted = bucketed.classes.iter().filter(|row| row.static_points + row.dynamic_points > 0);
        let mut rows: Vec<Vec<String>> = counted
            .map(|row| {
                let points = format!("{} / {}", row.static_points, row.dynamic_points);
                vec![class(row.class).into(), known(row.static_epe), known(row.dynamic), points]
            })
            .collect();
        if rows.is_empty() {
            return None;
        }
        rows.push(vec!["mean".into(), known(bucketed.mean_static), known(bucketed.mean_dynamic), String::new()]);
        let columns = ["class", "at rest, EPE in m", "moving, EPE over speed", "points at rest / moving"];
        Some(FigureTable { title: "Scene flow, bucketed".into(), columns: columns.map(String::from).to_vec(), rows })
    }
}
