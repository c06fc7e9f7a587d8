//! A snippet against the labels of its LiDAR points: the flow of the points, and the actors.

use anyhow::Result;
use gs_driving::DrivingLog;
use gs_models::flux4d::FluxScene;
use gs_models::flux4d::actors::Actor;

use super::actor_recall::ActorScores;
use super::flow::{FlowScores, of_inputs};
use super::infer::Inferred;
use super::prepare::HostSnippet;
use gs_train::fit::figure::{Figure, FigureTable};

/// Scores over all snippets.
#[derive(Debug, Default)]
pub struct LabelScores {
    flow: FlowScores,
    actors: ActorScores,
}

impl LabelScores {
    /// Adds a snippet with its scene and actors.
    ///
    /// # Errors
    /// When a sweep is broken or a flow is not finite.
    pub fn add(
        &mut self,
        log: &DrivingLog,
        host: &HostSnippet,
        inferred: &Inferred,
        scene: &FluxScene,
        actors: &[Actor],
    ) -> Result<()> {
        let sweeps = of_inputs(log, host, inferred)?;
        sweeps.iter().try_for_each(|sweep| self.flow.add(sweep))?;
        self.actors.add(scene, actors, &sweeps);
        Ok(())
    }

    /// The figures; none without a labelled point.
    pub fn figures(&self) -> Vec<Figure> {
        [self.flow.figures(), self.actors.figures()].concat()
    }

    /// The errors of the flow by class and speed.
    pub fn table(&self) -> Option<FigureTable> {
        self.flow.table()
    }
}
