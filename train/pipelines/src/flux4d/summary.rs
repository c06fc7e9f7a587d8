//! The figures of a reconstruction: `reconstruction.json`, and the lines for the terminal.

use std::path::Path;

use gs_base::counted;
use serde::Serialize;

use super::degrees::Degrees;
use super::polish::Polished;
use gs_train::fit::figure::{Figure, FigureTable};

/// Seconds of each stage.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Seconds {
    /// Reading sweeps and images, colouring, thinning, lifting.
    pub read_and_lift: f64,
    /// Sending the snippet and building its kernel maps.
    pub maps: f64,
    /// All passes of the networks, with the renderings that are fed back.
    pub passes: f64,
    /// The polish.
    pub polish: f64,
    /// Finding actors and choosing the degree of their velocities.
    pub actors: f64,
    /// Rendering the images that are written.
    pub render: f64,
}

/// The figures that are written beside the images.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// The mark of the program's files.
    pub program: &'static str,
    /// The log's name.
    pub log: String,
    /// Snippets that are done.
    pub snippets: usize,
    /// Snippets that were asked for; more than are done after Ctrl-C.
    pub snippets_asked: usize,
    /// Gaussians of the largest snippet.
    pub gaussians: usize,
    /// Moving Gaussians of the snippet with most.
    pub moving_gaussians: usize,
    /// Objects; one in several snippets counts once.
    pub actors: usize,
    /// Images that were written.
    pub images: usize,
    /// Mean PSNR of the frames between the inputs, dB; none with edits or a moved sensor.
    pub psnr_targets: Option<f64>,
    /// Seconds of each stage.
    pub seconds: Seconds,
    /// The polish: sums of steps and seconds, means of losses and PSNR over the snippets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polish: Option<Polished>,
    /// The degrees of the actors' velocities.
    pub degrees: Degrees,
    /// Scene flow and actors against labels.
    pub flow: Vec<Figure>,
    /// Errors of the flow by class and speed.
    pub tables: Vec<FigureTable>,
}

impl Summary {
    /// The figures for a terminal; `out` is the folder.
    pub fn lines(&self, out: &Path) -> Vec<String> {
        let Seconds { read_and_lift, maps, passes, actors, render, .. } = self.seconds;
        let mut lines = vec![
            format!(
                "{}: {}, {} of at most {} Gaussians ({} of them move), {}",
                self.log,
                counted(self.snippets, "snippet"),
                counted(self.images, "image"),
                self.gaussians,
                self.moving_gaussians,
                counted(self.actors, "actor")
            ),
            format!(
                "seconds: read and lift {read_and_lift:.2}, maps {maps:.2}, passes {passes:.2}, actors {actors:.2}, \
                 render {render:.2}"
            ),
        ];
        lines.extend(self.degrees.line());
        lines.extend(self.polish.as_ref().map(of_polish));
        lines.extend(self.psnr_targets.map(|psnr| format!("frames between the inputs: PSNR {psnr:.2} dB")));
        let figures: Vec<String> =
            self.flow.iter().map(|figure| format!("{} {}", figure.name, figure.shown())).collect();
        if !figures.is_empty() {
            lines.push(format!("scene flow: {}", figures.join("; ")));
        }
        lines.extend(self.tables.iter().flat_map(FigureTable::lines));
        if self.snippets < self.snippets_asked {
            lines.push(format!("interrupted: {} of {} snippets are done", self.snippets, self.snippets_asked));
        }
        lines.push(format!("written to {}", out.display()));
        lines
    }
}

fn of_polish(polish: &Polished) -> String {
    let Polished { steps, steps_asked, skipped, seconds, loss: [before, after], psnr } = polish;
    let taken = if steps < steps_asked { format!("{steps} of {steps_asked} steps") } else { counted(*steps, "step") };
    let seen = psnr.map_or(String::new(), |[before, after]| {
        format!(", frames between the inputs from {before:.2} to {after:.2} dB")
    });
    let skipped = if *skipped > 0 { format!(" ({skipped} skipped)") } else { String::new() };
    format!("polish: {taken}{skipped} in {seconds:.2} s, loss of the inputs from {before:.4} to {after:.4}{seen}")
}

/// The polish of several snippets: sums of steps and seconds, means of losses and PSNR.
pub fn of_all(polished: &[Polished]) -> Option<Polished> {
    let mean = |values: Vec<[f64; 2]>| {
        let count = values.len() as f64;
        let sum = values.iter().fold([0.0; 2], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
        (count > 0.0).then(|| sum.map(|x| x / count))
    };
    Some(Polished {
        steps: polished.iter().map(|one| one.steps).sum(),
        steps_asked: polished.iter().map(|one| one.steps_asked).sum(),
        skipped: polished.iter().map(|one| one.skipped).sum(),
        seconds: polished.iter().map(|one| one.seconds).sum(),
        loss: mean(polished.iter().map(|one| one.loss).collect())?,
        psnr: mean(polished.iter().filter_map(|one| one.psnr).collect()),
    })
}
