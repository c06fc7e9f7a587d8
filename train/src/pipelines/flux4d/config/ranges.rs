//! The ranges of the configuration's values.

use super::{ActorsSection, FluxConfig, LearningConfig, LiftSection, LogsConfig, SupervisionConfig, UnetConfig};
use crate::config::{ConfigError, check, not_negative, positive};

impl FluxConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("steps", self.steps, self.steps >= 1, "at least 1")?;
        self.eval.validate()?;
        self.checkpoint.validate()?;
        self.own.logs.validate()?;
        self.own.lift.validate()?;
        self.own.unet.validate()?;
        let passes = self.own.refinement.passes;
        check("refinement.passes", passes, (1..=20).contains(&passes), "1 to 20")?;
        self.own.supervision.validate()?;
        self.own.learning.validate()?;
        self.own.actors.validate()
    }
}

impl ActorsSection {
    fn validate(&self) -> Result<(), ConfigError> {
        check("actors.speed", self.speed, not_negative(self.speed), "0 or more")?;
        check("actors.radius", self.radius, (0.01..=100.0).contains(&self.radius), "0.01 to 100")?;
        check("actors.fewest", self.fewest, self.fewest >= 1, "at least 1")
    }
}

impl LogsConfig {
    fn validate(&self) -> Result<(), ConfigError> {
        check("logs.frames", self.frames, (3..=300).contains(&self.frames), "3 to 300")?;
        let width = self.max_width;
        check("logs.max_width", width, width == 0 || width >= 16, "0 or at least 16")
    }
}

impl LiftSection {
    fn validate(&self) -> Result<(), ConfigError> {
        // The maps of the convolutions number rows by 32 bits.
        const MOST: usize = 100_000_000;
        check("lift.points", self.points, self.points <= MOST, "at most 100000000")?;
        check("lift.sky_points", self.sky_points, self.sky_points <= MOST, "at most 100000000")?;
        check("lift.random_points", self.random_points, self.random_points <= MOST, "at most 100000000")?;
        let scale = self.scale_max;
        check("lift.scale_max", scale, (0.01..=1e6).contains(&scale), "0.01 to 1000000")
    }
}

impl UnetConfig {
    fn validate(&self) -> Result<(), ConfigError> {
        check("unet.voxel", self.voxel, (0.01..=100.0).contains(&self.voxel), "0.01 to 100")?;
        check("unet.width", self.width, (0.01..=4.0).contains(&self.width), "0.01 to 4")?;
        check("unet.degree", self.degree, self.degree <= 3, "0 to 3")
    }
}

impl SupervisionConfig {
    fn validate(&self) -> Result<(), ConfigError> {
        check("supervision.input_views", self.input_views, self.input_views >= 1, "at least 1")?;
        check("supervision.dssim", self.dssim, (0.0..=1.0).contains(&self.dssim), "0 to 1")?;
        check("supervision.depth", self.depth, not_negative(self.depth), "0 or more")?;
        check("supervision.velocity", self.velocity, not_negative(self.velocity), "0 or more")?;
        check("supervision.reweight_clip", self.reweight_clip, not_negative(self.reweight_clip), "0 or more")
    }
}

impl LearningConfig {
    fn validate(&self) -> Result<(), ConfigError> {
        check("learning.rate", self.rate, positive(self.rate), "above 0")?;
        check("learning.last_rate", self.last_rate, positive(self.last_rate), "above 0")?;
        check("learning.recolour", self.recolour, (0.0..=2.0).contains(&self.recolour), "0 to 2")?;
        check("learning.accumulate", self.accumulate, self.accumulate >= 1, "at least 1")
    }
}
