//! `gsburn train --profile`: the time of each stage of a training step, as profile.json, as a table and in the report.
//!
//! The stages are those of [`gs_burn::profile`], with the gradient of an operation beside the operation. Measuring and
//! saving are outside the steps.

use std::fmt::Write as _;

use anyhow::Result;
use burn::tensor::Device;
use gs_base::guarded;
use gs_burn::profile::{Clock, REST, StageTime};
use serde::{Deserialize, Serialize};

use super::folder::RunFolder;
use super::outputs::write_json;
use super::resources::cpu_seconds;

/// Stages below this share of a step are merged into one row of the table.
const SMALL: f64 = 0.002;

/// Largest profile.json, bytes: a stage takes some 200 bytes, and a step has some thirty.
const PROFILE_MAX: u64 = 1 << 20;

/// The content of profile.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// The device.
    pub device: String,
    /// Threads of the program.
    pub threads: usize,
    /// Measured steps.
    pub steps: u64,
    /// Mean wall-clock time of a step, seconds.
    pub wall_seconds: f64,
    /// Mean processor time of a step over all threads, seconds; `None` if the system does not report it.
    pub cpu_seconds: Option<f64>,
    /// Stages in descending order of cost; they add up to the step.
    pub stages: Vec<ProfiledStage>,
}

/// One stage, without the stages inside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfiledStage {
    /// Its name.
    pub name: String,
    /// Mean number of entries per step.
    pub calls: f64,
    /// Mean wall-clock time per step, seconds.
    pub wall_seconds: f64,
    /// Mean processor time per step, seconds; `None` if the system does not report it.
    pub cpu_seconds: Option<f64>,
    /// Share of the step, 0 to 1: of its processor time, or of its wall-clock time if that is all there is.
    pub share: f64,
}

/// Measures this thread's training steps from now on. On a GPU each stage waits for the device at both ends, or it
/// would be charged for queueing alone; such steps are slower.
pub fn begin(device: &Device) {
    let device = device.clone();
    let wait = Box::new(move || {
        // A device that failed reports it when its results are read.
        let _ = device.sync();
    });
    gs_burn::profile::begin(Clock { cpu: cpu_seconds, wait });
}

impl Profile {
    /// The means over the steps in `stages`; `None` without a step.
    pub fn new(stages: &[StageTime], device: &str) -> Option<Self> {
        let steps = stages.iter().find(|stage| stage.name == REST)?.calls;
        let per_step = |seconds: f64| seconds / steps as f64;
        let wall: f64 = stages.iter().map(|stage| stage.wall).sum();
        let cpu: Option<f64> = stages.iter().map(|stage| stage.cpu).sum();
        let total = cpu.unwrap_or(wall);
        let mut profiled: Vec<ProfiledStage> = stages
            .iter()
            .map(|stage| ProfiledStage {
                name: stage.name.into(),
                calls: per_step(stage.calls as f64),
                wall_seconds: per_step(stage.wall),
                cpu_seconds: stage.cpu.map(per_step),
                share: stage.cpu.filter(|_| cpu.is_some()).unwrap_or(stage.wall) / total.max(f64::MIN_POSITIVE),
            })
            .collect();
        profiled.sort_by(|a, b| b.share.total_cmp(&a.share));
        Some(Self {
            device: device.into(),
            threads: rayon::current_num_threads(),
            steps,
            wall_seconds: per_step(wall),
            cpu_seconds: cpu.map(per_step),
            stages: profiled,
        })
    }

    /// A step in one sentence.
    pub fn summary(&self) -> String {
        let cpu = self.cpu_seconds.map_or(String::new(), |cpu| format!("{} CPU, ", milliseconds(cpu)));
        format!(
            "One training step: {cpu}{} wall; mean of {} steps, {} threads, {}",
            milliseconds(self.wall_seconds),
            self.steps,
            self.threads,
            self.device
        )
    }

    /// The larger stages, and the others merged into one.
    pub fn rows(&self) -> Vec<ProfiledStage> {
        let (mut rows, small): (Vec<_>, Vec<_>) = self.stages.iter().cloned().partition(|stage| stage.share >= SMALL);
        if !small.is_empty() {
            rows.push(ProfiledStage {
                name: format!("{} smaller stages", small.len()),
                calls: small.iter().map(|stage| stage.calls).sum(),
                wall_seconds: small.iter().map(|stage| stage.wall_seconds).sum(),
                cpu_seconds: small.iter().map(|stage| stage.cpu_seconds).sum(),
                share: small.iter().map(|stage| stage.share).sum(),
            });
        }
        rows
    }

    /// The stages for a terminal.
    pub fn table(&self) -> String {
        let rows = self.rows();
        let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max("stage".len());
        let mut text = format!("{}\n{:width$}  CPU ms  wall ms  calls   share\n", self.summary(), "stage");
        for row in rows {
            let cpu = row.cpu_seconds.map_or("-".into(), |cpu| format!("{:.2}", 1e3 * cpu));
            let (wall, share) = (1e3 * row.wall_seconds, 100.0 * row.share);
            writeln!(text, "{:width$}  {cpu:>6}  {wall:>7.2}  {:>5.1}  {share:>5.1} %", row.name, row.calls)
                .expect("writing to a string does not fail");
        }
        text.trim_end().to_string()
    }

    /// The profile of a run folder; `None` if there is none that this version reads.
    pub fn read(folder: &RunFolder) -> Option<Self> {
        serde_json::from_slice(&guarded::read(&folder.profile(), PROFILE_MAX).ok()?).ok()
    }
}

/// Writes profile.json of the steps recorded so far, if this thread records; a resumed run writes its own steps alone.
///
/// # Errors
/// When it cannot be written.
pub fn write_if_recording(folder: &RunFolder, device: &str) -> Result<()> {
    let Some(profile) = Profile::new(&gs_burn::profile::so_far(), device) else { return Ok(()) };
    write_json(&folder.profile(), &profile)
}

fn milliseconds(seconds: f64) -> String {
    format!("{:.1} ms", 1e3 * seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(name: &'static str, calls: u64, cpu: f64) -> StageTime {
        StageTime { name, calls, wall: 2.0 * cpu, cpu: Some(cpu) }
    }

    #[test]
    fn a_profile_is_means_over_steps() {
        let stages = [stage(REST, 4, 0.1), stage("rasterize", 8, 0.3), stage("tiny", 4, 0.0004)];
        let profile = Profile::new(&stages, "flex").expect("steps");
        assert_eq!((profile.steps, profile.stages[0].name.as_str()), (4, "rasterize"));
        assert!((profile.stages[0].cpu_seconds.expect("told") - 0.075).abs() < 1e-12);
        assert!((profile.stages.iter().map(|stage| stage.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(profile.table().contains("rasterize") && profile.table().contains("1 smaller stages"));
        assert!(Profile::new(&stages[1..], "flex").is_none(), "no step");
    }
}
