//! The uncertainty of the prediction: an ensemble of perturbed dynamics, its map, and whether its spread is right.

use std::path::Path;

use anyhow::Result;
use gs_base::{counted, write_atomic};
use gs_datasets::{Split, movers};
use gs_models::DynamicScene;
use serde::Serialize;

use super::Work;
use crate::commands::print;
use crate::report::future::calibration::{Against, Calibration, by_images, by_true_motion};
use crate::report::future::motion::Map;
use crate::report::future::spread::{Spread, SpreadAt};
use crate::report::future::{ONE_TIME, Shown, motion};
use gs_train::fit::extrapolation::Extrapolation;
use gs_train::run::outputs::marked_svg;

/// Times at which the spread is held against the truth at most.
const CALIBRATED_TIMES: usize = 12;

/// The ensemble in extrapolate.json.
#[derive(Debug, Clone, Serialize)]
pub struct SpreadFigures {
    /// Members.
    pub members: usize,
    /// Standard deviation of a position's coordinate in the recording, scene units.
    pub noise: f64,
    /// Over the moving Gaussians, at the first time seen, the last, and every frame.
    pub times: Vec<SpreadAt>,
    /// Whether it is right; `None` where nothing is known of the truth.
    pub calibration: Option<Calibration>,
}

impl Work<'_> {
    /// Draws the spread at the last time and measures it; `None` without an ensemble.
    pub(super) fn ensemble(
        &self,
        future: &dyn Extrapolation,
        dataset: &Path,
        shown: &mut Vec<Shown>,
    ) -> Result<Option<(SpreadFigures, Map)>> {
        let count = self.args.members as usize;
        if count == 0 {
            return Ok(None);
        }
        let members = match future.members(count) {
            Ok(members) => members,
            Err(reason) => {
                print(format!("no uncertainty: {reason}"));
                return Ok(None);
            }
        };
        let times: Vec<f64> = self.span.iter().copied().chain(self.times.iter().copied()).collect();
        let spread = Spread::of(&members, &times);
        let summary = spread.summary(&self.moving);
        let (Some(seen), Some(last)) = (summary.get(1), summary.last()) else { return Ok(None) };
        print(format!(
            "spread of {count} members, median over {}: {:.2} pixels at {}, {:.2} at {}",
            counted(self.moving.len(), "moving Gaussian"),
            seen.median / self.pixel,
            seen.time,
            last.median / self.pixel,
            last.time
        ));
        let values = spread.values.last().cloned().unwrap_or_default();
        let (camera, gaussians) = (self.shots[0].pose(self.times.len() - 1), self.predicted.scene.at(last.time));
        let map = motion::map(self.predicted.renderer, &gaussians, camera, ("uncertainty", "scene units"), values);
        self.files.picture("uncertainty.png", &map.picture)?;
        let caption = format!("Spread of the ensemble at {}, yellow is {:.4} {}", last.time, map.full, map.unit);
        shown.push(Shown::Picture(map.picture.clone(), caption));
        let calibration = self.calibration(&members, dataset)?;
        if let Some(calibration) = &calibration {
            let svg = calibration.chart().svg();
            write_atomic(&self.files.at("calibration.svg"), marked_svg(&svg).as_bytes())?;
            shown.push(Shown::Chart(svg));
            let ratios = calibration.error_over_spread.zip(calibration.median_error_over_spread);
            if let Some((rms, median)) = ratios {
                print(format!(
                    "true error over spread: median {median:.2}, root mean square {rms:.2} (1 is ideal, above 1 the spread is too small)"
                ));
            }
        }
        let figures = SpreadFigures { members: count, noise: future.noise(), times: summary, calibration };
        Ok(Some((figures, map)))
    }

    /// The spread against the true motion, or else against the image error of held-out photos.
    fn calibration(&self, members: &[Box<dyn DynamicScene>], dataset: &Path) -> Result<Option<Calibration>> {
        let [first, end] = self.span;
        let room = ONE_TIME * (end - first);
        let movers = movers(dataset, self.loaded.origin)?;
        let known: Vec<[f64; 2]> = movers.iter().filter_map(|mover| mover.span()).collect();
        let until = known.iter().map(|span| span[1]).fold(f64::INFINITY, f64::min).min(self.args.to);
        if !known.is_empty() && until > end + room {
            let step = (until - end) / CALIBRATED_TIMES as f64;
            let times: Vec<f64> = (1..=CALIBRATED_TIMES).map(|k| (end + step * k as f64).min(until)).collect();
            let spread = Spread::of(members, &times);
            let pairs = by_true_motion(self.predicted.scene, &spread, &self.moving, &movers);
            return Ok(Calibration::of(Against::TrueMotion, pairs));
        }
        let views =
            [Split::TEST, Split::TEST_SEEN].iter().find_map(|s| self.predicted.future_views(s, Some(self.args.to)));
        let Some(views) = views else { return Ok(None) };
        let mut times: Vec<f64> = views.iter().filter_map(|view| view.time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let spread = Spread::of(members, &times);
        Ok(Calibration::of(Against::ImageError, by_images(&self.predicted, &spread, &views)))
    }
}
