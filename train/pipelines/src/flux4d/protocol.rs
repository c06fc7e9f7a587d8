//! The points whose flow is scored, and the figures of a protocol.

use anyhow::Result;
use glam::DVec3;
use gs_driving::{DrivingLog, MapGround, Sweep};
use gs_models::flux4d::flow_metrics::FlowClass;

use super::flow::{FlowOfSweep, FlowScores};
use gs_train::fit::figure::{Figure, FigureTable};

/// Half of the edges of the boxes around the ego vehicle in which Argoverse 2 scores points, metres: av2-api, and
/// Bucketed Scene Flow Eval.
const BOX: f64 = 50.0;
const NEAR_BOX: f64 = 35.0;

/// The points whose flow is scored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// All with a label.
    All,
    /// Argoverse 2 scores what is not on the ground by the map: in buckets within 35 m along each axis of the vehicle,
    /// otherwise within 50 m.
    Av2,
}

/// The scores of a protocol.
#[derive(Debug)]
pub struct Scores {
    /// Under the protocol of Argoverse 2.
    ground: Option<MapGround>,
    flow: FlowScores,
    near: FlowScores,
}

impl Scores {
    /// No sweep of a log is scored yet.
    ///
    /// # Errors
    /// When the log has no map for its protocol.
    pub fn new(protocol: Protocol, log: &DrivingLog) -> Result<Self> {
        let ground = match protocol {
            Protocol::All => None,
            Protocol::Av2 => Some(log.map_ground()?),
        };
        Ok(Self { ground, flow: FlowScores::default(), near: FlowScores::default() })
    }

    /// Adds a sweep with the flow of its points, metres in 0.1 s; nothing without labels.
    ///
    /// # Errors
    /// When a flow is not finite.
    pub fn add(&mut self, log: &DrivingLog, frame: usize, sweep: &Sweep, flow: &[[f32; 3]]) -> Result<()> {
        let Some(labels) = &sweep.labels else { return Ok(()) };
        let known = (0..sweep.len()).filter(|index| labels.flow[*index].is_some());
        let scored =
            |kept: &[usize]| FlowOfSweep::of(sweep, labels, kept, kept.iter().map(|index| flow[*index]).collect());
        let Some(ground) = &self.ground else { return self.flow.add(&scored(&known.collect::<Vec<_>>())) };
        if frame + 1 == log.frames().len() {
            // The benchmark has pairs of sweeps: the last one has no flow, not even of what rests.
            return Ok(());
        }
        let from_world = log.frames()[frame].ego.inverse();
        let distance = |index: &usize| {
            let place = from_world.transform_point3(DVec3::from_array(sweep.points[*index].map(f64::from)));
            place.x.abs().max(place.y.abs())
        };
        let within = |index: &usize| !ground.has(sweep.points[*index]) && distance(index) <= BOX;
        let kept: Vec<usize> = known.filter(within).collect();
        let near: Vec<usize> = kept.iter().copied().filter(|index| distance(index) <= NEAR_BOX).collect();
        self.near.add(&scored(&near))?;
        let mut scored = scored(&kept);
        // Signs and cones have boxes and are foreground there, though of no class that is bucketed.
        for (class, object) in scored.classes.iter_mut().zip(&scored.objects) {
            if object.is_some() && *class == FlowClass::Background {
                *class = FlowClass::OtherVehicle;
            }
        }
        self.flow.add(&scored)
    }

    /// The figures; none without a labelled point.
    pub fn figures(&self) -> Vec<Figure> {
        self.flow.figures()
    }

    /// The bucketed errors by class.
    pub fn table(&self) -> Option<FigureTable> {
        if self.ground.is_some() { self.near.table() } else { self.flow.table() }
    }
}
