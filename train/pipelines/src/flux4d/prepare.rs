//! A snippet on the host: sweeps and images are decoded, points are coloured, thinned and lifted.
//!
//! Positions are relative to the ego vehicle at the middle input frame, and the x axis is the horizontal direction of
//! its first camera, so that a network sees every street from the same place in the same direction. z stays up.

use std::collections::BTreeSet;

use anyhow::{Result, anyhow, bail};
use glam::{DMat4, DVec2, DVec3};
use gs_datasets::RgbImage8;
use gs_driving::{Camera, DrivingLog, Snippet, Sweep, depth_image, project, sample};
use gs_models::flux4d::merge::{MergeConfig, TimedPoints, merge_to_budget};
use gs_models::flux4d::{BoxLength, FarConfig, LiftConfig, LiftInput, LiftedRows, Rotations, lift_rows};
use rayon::prelude::*;

use super::config::{LiftSection, MergeChoice, RotationChoice, VelocityChoice};
use super::start::{Motions, RowMotion, motions_of};

/// An image whose brightest channel is at most this, of 255, shows nothing: a covered lens or a lost frame.
const BLANK: u8 = 8;

/// Shortest window of a snippet, seconds: two frames of one time have no motion between them.
const WINDOW_MIN: f64 = 1e-2;

/// An image with its camera.
#[derive(Debug, Clone)]
pub struct HostView {
    /// Camera and frame.
    pub name: String,
    /// Place in the log's list of frames.
    pub frame: usize,
    /// Place in the log's list of cameras.
    pub camera: usize,
    /// Camera to the snippet's axes, OpenCV axes.
    pub c2w: DMat4,
    /// Seconds.
    pub seconds: f64,
    /// 0 to 1 in the window; beyond 1 in the future.
    pub time: f64,
    /// The image, without rows that show the vehicle itself.
    pub image: RgbImage8,
    /// Depth of the frame's LiDAR, `[height, width]`, metres, 0 where there is none.
    pub depth: Vec<f32>,
}

/// A snippet on the host.
#[derive(Debug, Clone)]
pub struct HostSnippet {
    /// Log and first frame.
    pub name: String,
    /// From its axes to the log's world: a turn about z and a shift, metres.
    pub to_world: DMat4,
    /// First and last time of the inputs, seconds.
    pub window: [f64; 2],
    /// Time between two frames, seconds.
    pub interval: f64,
    /// The first Gaussians; far rows last.
    pub rows: LiftedRows,
    /// Of each row that is not far, the place of its input frame in the snippet.
    pub row_frames: Vec<u16>,
    /// The motion that the sweeps themselves show of each row that is not far; empty where velocities start at zero.
    pub start: Vec<RowMotion>,
    /// Images of the inputs.
    pub inputs: Vec<HostView>,
    /// Images between them.
    pub targets: Vec<HostView>,
    /// Images after them.
    pub future: Vec<HostView>,
    /// Images that show nothing and were left out.
    pub blank: usize,
}

impl HostSnippet {
    /// Memory of its buffers, bytes.
    pub fn bytes(&self) -> usize {
        let views = self.inputs.iter().chain(&self.targets).chain(&self.future);
        4 * (self.rows.raw.len() + self.rows.times.len())
            + size_of::<RowMotion>() * self.start.len()
            + size_of::<u16>() * self.row_frames.len()
            + views.map(|view| view.image.data.len() + 4 * view.depth.len()).sum::<usize>()
    }

    /// Positions of the rows that are not far.
    pub fn near_points(&self) -> Vec<[f32; 3]> {
        let mut points = self.all_points();
        points.truncate(self.rows.times.len() - self.rows.far);
        points
    }

    /// Positions of all rows; far ones last.
    pub fn all_points(&self) -> Vec<[f32; 3]> {
        let rows = self.rows.raw.chunks_exact(gs_models::flux4d::channels::CHANNELS);
        rows.map(|row| [row[0], row[1], row[2]]).collect()
    }

    /// A time in seconds, 0 to 1 in the window.
    pub fn in_window(&self, seconds: f64) -> f64 {
        (seconds - self.window[0]) / (self.window[1] - self.window[0])
    }
}

/// Reads and lifts a snippet.
///
/// # Errors
/// One sentence: a broken file, inputs without an image, too few points.
pub fn prepare(
    log: &DrivingLog,
    snippet: &Snippet,
    name: &str,
    config: &LiftSection,
    seed: u64,
) -> Result<HostSnippet> {
    let to_world = to_world(log, snippet.inputs[snippet.inputs.len() / 2]);
    let from_world = inverse(to_world);
    let mut reader = Reader { log, from_world, blank: 0 };
    let sweeps: Vec<Sweep> =
        snippet.inputs.par_iter().map(|frame| sweep(log, *frame, &from_world)).collect::<Result<_>>()?;
    let mut inputs = Vec::new();
    for (frame, sweep) in snippet.inputs.iter().zip(&sweeps) {
        inputs.extend(reader.views(*frame, sweep)?);
    }
    if inputs.is_empty() {
        bail!("{}: snippet {name}: expected an input image that shows something, found none", log.path().display());
    }
    let window = window(log, snippet, &sweeps, &inputs)?;
    let mut others = |frames: &[usize]| -> Result<Vec<HostView>> {
        let mut views = Vec::new();
        for frame in frames {
            views.extend(reader.views(*frame, &sweep(log, *frame, &from_world)?)?);
        }
        Ok(views)
    };
    let (targets, future) = (others(&snippet.targets)?, others(&snippet.future)?);
    let blank = reader.blank;
    let Points { points, row_frames, start } = points(log, snippet, (&sweeps, &from_world), &inputs, window, config)?;
    let posed = Posed::all(log, &inputs);
    let far_color = |point: [f32; 3]| color_at(posed.iter(), point);
    let input =
        LiftInput { points: &points.points, times: &points.times, colors: &points.colors, far_color: Some(&far_color) };
    let rows = lift_rows(&input, &lift_config(config, seed))
        .map_err(|error| anyhow!("{}: snippet {name}: {error}", log.path().display()))?;
    let interval = interval(log, snippet);
    let mut host = HostSnippet {
        name: name.into(),
        to_world,
        window,
        interval,
        rows,
        row_frames,
        start,
        inputs,
        targets,
        future,
        blank,
    };
    let [begin, end] = window;
    let all = host.inputs.iter_mut().chain(&mut host.targets).chain(&mut host.future);
    all.for_each(|view| view.time = (view.seconds - begin) / (end - begin));
    Ok(host)
}

/// From the axes of a snippet with this middle input to the world of the log.
fn to_world(log: &DrivingLog, middle: usize) -> DMat4 {
    let centre = log.frames()[middle].ego.w_axis.truncate();
    let ahead = (0..log.cameras().len()).find_map(|camera| log.camera_pose(middle, camera)).map(|c2w| c2w.z_axis);
    let yaw = ahead.map_or(0.0, |ahead| ahead.y.atan2(ahead.x));
    DMat4::from_translation(centre) * DMat4::from_rotation_z(yaw)
}

/// A sweep in the axes of a snippet, its labels too; no points where the frame has none.
///
/// # Errors
/// When its file is missing or broken.
pub fn sweep(log: &DrivingLog, frame: usize, from_world: &DMat4) -> Result<Sweep> {
    if !log.frames()[frame].has_sweep {
        return Ok(Sweep::default());
    }
    let mut sweep = log.sweep(frame)?;
    let wide = |vector: &[f32; 3]| DVec3::from_array(vector.map(f64::from));
    let moved = |point: &[f32; 3]| from_world.transform_point3(wide(point)).as_vec3().to_array();
    sweep.points = sweep.points.par_iter().map(moved).collect();
    for flow in sweep.labels.iter_mut().flat_map(|labels| &mut labels.flow).flatten() {
        *flow = from_world.transform_vector3(wide(flow)).as_vec3().to_array();
    }
    Ok(sweep)
}

fn lift_config(config: &LiftSection, seed: u64) -> LiftConfig {
    let rotations = match config.rotations {
        RotationChoice::Random => Rotations::Random,
        RotationChoice::Identity => Rotations::Identity,
    };
    let far = FarConfig {
        sky_points: config.sky_points,
        sphere_points: config.random_points,
        box_length: BoxLength::LongestEdge,
        ..FarConfig::default()
    };
    LiftConfig { seed, rotations, far, ..LiftConfig::default() }
}

struct Reader<'a> {
    log: &'a DrivingLog,
    from_world: DMat4,
    blank: usize,
}

impl Reader<'_> {
    /// The images of a frame that show something.
    fn views(&mut self, frame: usize, sweep: &Sweep) -> Result<Vec<HostView>> {
        let cameras: Vec<usize> =
            (0..self.log.cameras().len()).filter(|camera| self.log.view_index(frame, *camera).is_some()).collect();
        let views: Vec<HostView> =
            cameras.into_par_iter().map(|camera| self.view(frame, camera, sweep)).collect::<Result<_>>()?;
        let (seen, blank): (Vec<HostView>, Vec<HostView>) =
            views.into_iter().partition(|view| view.image.data.iter().any(|value| *value > BLANK));
        self.blank += blank.len();
        Ok(seen)
    }

    fn view(&self, frame: usize, camera: usize, sweep: &Sweep) -> Result<HostView> {
        let (log, described) = (self.log, &self.log.cameras()[camera]);
        let mut image = log.image(frame, camera)?;
        image.height = image.height.saturating_sub(described.ego_rows).max(1);
        image.data.truncate(3 * image.width * image.height);
        let shot = log.shot(frame, camera).ok_or_else(|| anyhow!("{}: no pose", described.name))?;
        let c2w = self.from_world * shot.c2w;
        let mut depth = depth_image(described, &c2w, &sweep.points);
        depth.truncate(image.width * image.height);
        Ok(HostView {
            name: format!("{}-{}-{}", log.name(), described.name, log.frames()[frame].name),
            frame,
            camera,
            c2w,
            seconds: shot.time,
            time: 0.0,
            image,
            depth,
        })
    }
}

/// Seconds from one frame to the next.
fn interval(log: &DrivingLog, snippet: &Snippet) -> f64 {
    let (first, last) = (snippet.frames[0], snippet.frames[snippet.frames.len() - 1]);
    (log.frames()[last].time - log.frames()[first].time) / (last - first).max(1) as f64
}

/// First and last time of points and images of the inputs.
fn window(log: &DrivingLog, snippet: &Snippet, sweeps: &[Sweep], inputs: &[HostView]) -> Result<[f64; 2]> {
    let frames = snippet.inputs.iter().map(|frame| log.frames()[*frame].time);
    let times = frames.chain(inputs.iter().map(|view| view.seconds));
    let times = times.chain(sweeps.iter().flat_map(|sweep| sweep.times.iter().copied()));
    let (low, high) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
    let length = high - low;
    if length.is_nan() || length < WINDOW_MIN {
        let path = log.path().display();
        bail!("{path}: expected input frames over at least {WINDOW_MIN} s, found {length} s");
    }
    Ok([low, high])
}

/// The points of a snippet.
struct Points {
    points: TimedPoints,
    /// The place of each point's input frame.
    row_frames: Vec<u16>,
    /// Of each point; empty where velocities start at zero.
    start: Vec<RowMotion>,
}

/// The points of all input sweeps with their colours, thinned to the budget, and the input frame of each.
fn points(
    log: &DrivingLog,
    snippet: &Snippet,
    (sweeps, from_world): (&[Sweep], &DMat4),
    inputs: &[HostView],
    window: [f64; 2],
    config: &LiftSection,
) -> Result<Points> {
    let posed = Posed::all(log, inputs);
    let counts = |point: [f32; 3]| !config.in_view || posed.iter().any(|posed| posed.place(point).is_some());
    let motion = match config.velocity {
        VelocityChoice::Zero => None,
        VelocityChoice::Aligned => Some(Motions::of(log, snippet, (sweeps, from_world), window)),
    };
    // Moving and resting points of a frame stay apart when they are merged.
    let mut parts: Vec<(u16, Option<Vec<RowMotion>>, TimedPoints)> = Vec::new();
    for (place, sweep) in sweeps.iter().enumerate() {
        let own: Vec<&Posed> = posed.iter().filter(|posed| posed.view.frame == snippet.inputs[place]).collect();
        let of = |kept: Vec<usize>| coloured(sweep, &kept, &own, window);
        let kept: Vec<usize> = (0..sweep.len()).into_par_iter().filter(|index| counts(sweep.points[*index])).collect();
        let (moving, resting): (Vec<usize>, Vec<usize>) =
            kept.into_iter().partition(|index| motion.as_ref().is_some_and(|motion| motion.moves(place, *index)));
        parts.push((place as u16, None, of(resting)));
        let of_point =
            |index: &usize| motion.as_ref().map(|motion| motion.of_point(place, *index, sweep.points[*index]));
        let motions = moving.iter().filter_map(of_point);
        parts.push((place as u16, Some(motions.collect()), of(moving)));
    }
    let before: Vec<TimedPoints> = parts.iter().map(|(_, _, points)| points.clone()).collect();
    let budget = if config.points == 0 { usize::MAX } else { config.points * cameras(inputs) };
    let viewpoints: Vec<[f32; 3]> = match config.merge {
        MergeChoice::Growing => inputs.iter().map(|view| view.c2w.w_axis.truncate().as_vec3().to_array()).collect(),
        MergeChoice::Equal => Vec::new(),
    };
    let thinned = merge_to_budget(before, &MergeConfig { budget, times: 1, viewpoints: &viewpoints })?.parts;
    let mut all = Points { points: TimedPoints::default(), row_frames: Vec::new(), start: Vec::new() };
    for ((place, motions, before), after) in parts.into_iter().zip(thinned) {
        all.row_frames.resize(all.row_frames.len() + after.points.len(), place);
        if motion.is_some() {
            match motions {
                None => all.start.resize(all.start.len() + after.points.len(), RowMotion::default()),
                Some(motions) => all.start.extend(motions_of(&before.points, &motions, &after.points)),
            }
        }
        all.points.points.extend(after.points);
        all.points.times.extend(after.times);
        all.points.colors.extend(after.colors);
    }
    Ok(all)
}

/// Cameras of some views.
fn cameras(views: &[HostView]) -> usize {
    views.iter().map(|view| view.camera).collect::<BTreeSet<_>>().len()
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

/// A view with its camera and its pose inverted once, for many points.
pub struct Posed<'a> {
    view: &'a HostView,
    camera: &'a Camera,
    w2c: DMat4,
}

impl<'a> Posed<'a> {
    /// A view of a log.
    pub fn new(log: &'a DrivingLog, view: &'a HostView) -> Self {
        Self { view, camera: &log.cameras()[view.camera], w2c: inverse(view.c2w) }
    }

    /// Views of a log.
    pub fn all(log: &'a DrivingLog, views: &'a [HostView]) -> Vec<Self> {
        views.iter().map(|view| Self::new(log, view)).collect()
    }

    /// Where a point (in the axes of the snippet) is in the image, pixels, and its depth, metres; `None` outside of it.
    pub fn place(&self, point: [f32; 3]) -> Option<(DVec2, f64)> {
        project(self.camera, &self.w2c, point)
    }
}

/// The inverse of a rigid motion, exact where a general one would round.
pub fn inverse(c2w: DMat4) -> DMat4 {
    let rotation = glam::DMat3::from_mat4(c2w).transpose();
    let translation = -(rotation * c2w.w_axis.truncate());
    DMat4::from_cols(
        rotation.x_axis.extend(0.0),
        rotation.y_axis.extend(0.0),
        rotation.z_axis.extend(0.0),
        translation.extend(1.0),
    )
}

/// The colour of a point in the view in which it is nearest to the middle.
fn color_at<'a>(views: impl Iterator<Item = &'a Posed<'a>>, point: [f32; 3]) -> Option<[f32; 3]> {
    let seen = views.filter_map(|posed| {
        let (pixel, _) = posed.place(point)?;
        Some(((pixel.x / posed.view.image.width as f64 - 0.5).abs(), pixel, posed.view))
    });
    let (_, pixel, view) = seen.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(sample(&view.image, pixel))
}
