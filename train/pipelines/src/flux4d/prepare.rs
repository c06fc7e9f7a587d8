//! A snippet on the host: sweeps and images are decoded, points are coloured, thinned and lifted.
//!
//! Positions are relative to the ego vehicle at the middle input frame, and the x axis is the horizontal direction of
//! its first camera, so that a network sees every street from the same place in the same direction. z stays up.

use anyhow::{Result, anyhow, bail};
use glam::{DMat4, DVec3};
use gs_driving::{DrivingLog, Snippet, Sweep, depth_image};
use gs_models::flux4d::{BoxLength, FarConfig, LiftConfig, LiftInput, LiftedRows, Rotations, lift_rows};
use rayon::prelude::*;

use super::config::{LiftSection, RotationChoice};
use super::host_view::{HostView, Posed, color_at, inverse};
use super::points::{Points, Scan};
use super::start::RowMotion;

/// An image whose brightest channel is at most this, of 255, shows nothing: a covered lens or a lost frame.
const BLANK: u8 = 8;

/// Shortest window of a snippet, seconds: two frames of one time have no motion between them.
const WINDOW_MIN: f64 = 1e-2;

/// A snippet on the host.
#[derive(Debug, Clone)]
pub struct HostSnippet {
    /// Log and first frame.
    pub name: String,
    /// Its frames in the log.
    pub frames: Snippet,
    /// The map from its axes to the log's world: a turn about z and a shift, metres.
    pub to_world: DMat4,
    /// First and last time of the inputs, seconds.
    pub window: [f64; 2],
    /// The time of each input frame in the window.
    pub times: Vec<f64>,
    /// Time between two frames, seconds.
    pub interval: f64,
    /// The first Gaussians; far rows last.
    pub rows: LiftedRows,
    /// The place of the input frame of each row that is not far, in the snippet.
    pub row_frames: Vec<u16>,
    /// The motion that the sweeps themselves show of each row that is not far; empty where they are not asked.
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

    /// The middle of the window, seconds.
    pub fn middle(&self) -> f64 {
        0.5 * (self.window[0] + self.window[1])
    }

    /// A sweep of the log with its labels, in the axes of the snippet; no points where the frame has none.
    ///
    /// # Errors
    /// When its file is missing or broken.
    pub fn labelled_sweep(&self, log: &DrivingLog, frame: usize) -> Result<Sweep> {
        match log.frames()[frame].has_sweep {
            true => Ok(turned(log.labelled_sweep(frame)?, &inverse(self.to_world))),
            false => Ok(Sweep::default()),
        }
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
    let mut reader = Reader { log, from_world: inverse(to_world), blank: 0 };
    let from_world = &reader.from_world;
    let sweeps: Vec<Sweep> =
        snippet.inputs.par_iter().map(|frame| sweep(log, *frame, from_world)).collect::<Result<_>>()?;
    let mut inputs = reader.frames(&snippet.inputs, &sweeps)?;
    if inputs.is_empty() {
        bail!("{}: snippet {name}: expected an input image that shows something, found none", log.path().display());
    }
    let window = window(log, snippet, &sweeps, &inputs)?;
    let (mut targets, mut future) = (reader.frames(&snippet.targets, &[])?, reader.frames(&snippet.future, &[])?);
    let scan = Scan { log, frames: &snippet.inputs, sweeps: &sweeps, from_world: &reader.from_world, window };
    let posed = Posed::all(log, &inputs);
    let Points { points, row_frames, start } = scan.points(&posed, config)?;
    let far_color = |point: [f32; 3]| color_at(posed.iter(), point);
    let input =
        LiftInput { points: &points.points, times: &points.times, colors: &points.colors, far_color: Some(&far_color) };
    let rows = lift_rows(&input, &lift_config(config, seed))
        .map_err(|error| anyhow!("{}: snippet {name}: {error}", log.path().display()))?;
    let [begin, end] = window;
    let views = inputs.iter_mut().chain(&mut targets).chain(&mut future);
    views.for_each(|view| view.time = (view.seconds - begin) / (end - begin));
    let (name, frames, interval) = (name.to_string(), snippet.clone(), interval(log, snippet));
    let blank = reader.blank;
    let times = snippet.inputs.iter().map(|frame| (log.frames()[*frame].time - begin) / (end - begin)).collect();
    Ok(HostSnippet {
        name,
        frames,
        to_world,
        window,
        times,
        interval,
        rows,
        row_frames,
        start,
        inputs,
        targets,
        future,
        blank,
    })
}

/// The map from the axes of a snippet with this middle input to the world of the log.
fn to_world(log: &DrivingLog, middle: usize) -> DMat4 {
    let centre = log.frames()[middle].ego.w_axis.truncate();
    let ahead = (0..log.cameras().len()).find_map(|camera| log.camera_pose(middle, camera)).map(|c2w| c2w.z_axis);
    let yaw = ahead.map_or(0.0, |ahead| ahead.y.atan2(ahead.x));
    DMat4::from_translation(centre) * DMat4::from_rotation_z(yaw)
}

/// A sweep in the axes of a snippet; no points where the frame has none.
///
/// # Errors
/// When its file is missing or broken.
fn sweep(log: &DrivingLog, frame: usize, from_world: &DMat4) -> Result<Sweep> {
    match log.frames()[frame].has_sweep {
        true => Ok(turned(log.sweep(frame)?, from_world)),
        false => Ok(Sweep::default()),
    }
}

/// A sweep with its labels in other axes.
fn turned(mut sweep: Sweep, from_world: &DMat4) -> Sweep {
    let wide = |vector: &[f32; 3]| DVec3::from_array(vector.map(f64::from));
    let moved = |point: &[f32; 3]| from_world.transform_point3(wide(point)).as_vec3().to_array();
    sweep.points = sweep.points.par_iter().map(moved).collect();
    for flow in sweep.labels.iter_mut().flat_map(|labels| &mut labels.flow).flatten() {
        *flow = from_world.transform_vector3(wide(flow)).as_vec3().to_array();
    }
    sweep
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
    /// Images so far that show nothing.
    blank: usize,
}

impl Reader<'_> {
    /// The images of some frames; a sweep that is not among the `sweeps` is read.
    fn frames(&mut self, frames: &[usize], sweeps: &[Sweep]) -> Result<Vec<HostView>> {
        let mut views = Vec::new();
        for (place, frame) in frames.iter().enumerate() {
            views.extend(match sweeps.get(place) {
                Some(sweep) => self.views(*frame, sweep)?,
                None => self.views(*frame, &sweep(self.log, *frame, &self.from_world)?)?,
            });
        }
        Ok(views)
    }

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
