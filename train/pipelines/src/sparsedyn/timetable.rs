//! The schedule of a training: in lines for the terminal, as curves for a chart.

use gs_base::counted;
use gs_datasets::Scene;
use gs_models::sparsedyn::Phase;

use super::Step;
use super::config::{BodyUse, MotionModel};
use super::count::laws_at;
use super::cues::warmup_steps;
use super::discover::examinations;
use super::model::Frame;
use super::order::Progressive;
use gs_train::fit::sampler::ViewOrder;
use gs_train::fit::timetable::{Curve, Mark, Timetable};

/// Steps whose draws are shown: as many as a chart of some 600 pixels tells apart.
const SHOWN: usize = 160;

/// Lines about the photos that are learned from, and about the events of the training.
pub fn lines(frame: &Frame, at: &Step) -> Vec<String> {
    let (cues, config) = (at.cues, at.config);
    let (warmup, schedule) = (warmup_steps(config), cues.curriculum(config));
    let mut lines = vec![format!(
        "{} frames from {} to {}; {} Gaussians may move{}",
        cues.times.len(),
        frame.clock.outer(frame.span[0]),
        frame.clock.outer(frame.span[1]),
        frame.rows.len(),
        match cues.depths.len() {
            0 => String::new(),
            count => format!("; {count} depth priors of the first frame"),
        }
    )];
    if !frame.clock.is_plain() {
        lines.push(format!(
            "times are learned in units of {}, the first frame at 0; `extrapolate` and all results have those of the data set",
            frame.clock.unit
        ));
    }
    if warmup > 0 {
        lines.push(format!("schedule: steps 1 to {warmup}: the first frame alone, nothing moves"));
    }
    let long = (warmup + schedule.long_from()).min(config.steps + 1);
    if let Phase::Short { frames } = schedule.phase(1)
        && long > warmup + 1
    {
        lines.push(format!(
            "schedule: steps {} to {}: a window of {} that grows by {} every {}",
            warmup + 1,
            long - 1,
            counted(frames, "frame"),
            schedule.growth,
            counted(schedule.interval, "step")
        ));
    }
    if long <= config.steps {
        let replays = match (schedule.late_from, schedule.replays) {
            (0, _) | (_, 0) => String::new(),
            (_, count) => format!(", and {count} earlier ones at a weight of {} together", schedule.replay_weight),
        };
        lines.push(format!(
            "schedule: steps {long} to {}: a frame from number {} on{replays}",
            config.steps, schedule.late_from
        ));
    }
    lines.extend(events(at).map(|(found, laws)| {
        let (first, last) = (found.first().copied().unwrap_or(0), found.last().copied().unwrap_or(0));
        format!("schedule: bodies are looked for from step {first} to {last}, and get their laws at step {laws}")
    }));
    lines
}

/// The steps at which bodies are looked for and get their laws; `None` where there are none.
fn events(at: &Step) -> Option<(Vec<usize>, usize)> {
    let sections = &at.config.method;
    let has_bodies = sections.bodies.mode != BodyUse::Field && sections.dynamics.model == MotionModel::Rollout;
    has_bodies.then(|| (examinations(at), laws_at(at.config)))
}

/// The last time of the window and the times that are drawn, over steps, with the events.
pub fn curves(scene: &Scene, at: &Step) -> Timetable {
    let config = at.config;
    let mut order = Progressive::new(&scene.train, config);
    let (mut drawn, mut replayed) = (Vec::new(), Vec::new());
    for step in (1..=config.steps).step_by(config.steps.div_ceil(SHOWN).max(1)) {
        let times = order.views(step).into_iter().filter_map(|view| scene.train[view].time);
        for (index, time) in times.enumerate() {
            let list = if index == 0 { &mut drawn } else { &mut replayed };
            list.push((step as f64, time));
        }
    }
    let curve = |name: &str, points, joined| Curve { name: name.into(), points, joined };
    let mark = |name: &str, steps: Vec<usize>| Mark { name: name.into(), steps };
    let warmup = warmup_steps(config);
    let mut marks = vec![mark("motion begins", vec![warmup])];
    if let Some((found, laws)) = events(at) {
        marks.extend([mark("bodies are looked for", found), mark("laws are chosen", vec![laws])]);
    }
    let mut curves = vec![curve("end of the window", horizon(at), true), curve("time compared", drawn, false)];
    if !replayed.is_empty() {
        curves.push(curve("times replayed", replayed, false));
    }
    Timetable { y: "time, unit of the data set".into(), curves, marks }
}

/// The last time that may be compared, over steps: a staircase.
fn horizon(at: &Step) -> Vec<(f64, f64)> {
    let (config, times) = (at.config, &at.cues.times);
    let (warmup, schedule) = (warmup_steps(config), at.cues.curriculum(config));
    let times: Vec<f64> = times.iter().map(|time| at.cues.clock.outer(*time)).collect();
    let end = |step: usize| match step.checked_sub(warmup) {
        None | Some(0) => times[0],
        Some(n) => match schedule.phase(n) {
            Phase::Short { frames } => times[frames.clamp(1, times.len()) - 1],
            Phase::Long => times[times.len() - 1],
        },
    };
    let mut points: Vec<(f64, f64)> = vec![(1.0, end(1))];
    for step in 2..=config.steps {
        let (before, now) = (points[points.len() - 1].1, end(step));
        if now != before {
            points.extend([((step - 1) as f64, before), (step as f64, now)]);
        }
    }
    points.push((config.steps as f64, end(config.steps)));
    points
}
