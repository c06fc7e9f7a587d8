//! What an import did: [`ImportReport`], which prints as a short text.

use std::fmt;

use gs_base::counted;

use super::similarity::CameraResidual;

/// Relative difference between the scale by cameras and that by depth from which the report warns: predicted cameras are 1 to 3 % off.
const SCALES_DIFFER: f64 = 0.1;

/// Residuals of one camera from which the report warns: a share of the cameras' spread, and degrees.
const CENTRE_OFF: f64 = 0.15;
const ANGLE_OFF: f64 = 10.0;

/// Disagreement of the fitted views from which the report warns; the better of single-image networks reach 5 %.
const STILL_OFF: f64 = 0.05;

/// One view of the import.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedView {
    /// As [`View::name`](crate::View::name).
    pub name: String,
    /// Its predicted camera against the known one.
    pub camera: CameraResidual,
    /// Scene units of depth for each predicted unit, over [`ImportReport::scale`].
    pub scale: f64,
    /// Shift of depth, scene units.
    pub shift: f64,
    /// Share of the photo's pixels whose depth is known.
    pub known: f64,
}

/// What was found and written.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportReport {
    /// Scene units for each unit of the prediction, by the cameras.
    pub scale: f64,
    /// Angle of the rotation from the prediction's world, degrees.
    pub turn: f64,
    /// Where the prediction's origin lies, scene units.
    pub shift: [f64; 3],
    /// The scale that the depths ask for, over `scale`.
    pub factor: f64,
    /// All views, in the order of the prediction.
    pub views: Vec<ImportedView>,
    /// Median relative disagreement between views with the cameras' scale alone, and after the fit; `None` where no two views see the
    /// same surface.
    pub disagreement: Option<(f64, f64)>,
    /// Pixels that were compared for it.
    pub compared: usize,
    /// Known points that anchored the depth.
    pub anchors: usize,
    /// Points written, and pixels with a depth.
    pub points: (usize, usize),
    /// The files to use, in words.
    pub written: String,
    /// Repairs and omissions, in sentences.
    pub warnings: Vec<String>,
}

impl ImportReport {
    /// Sentences about what may be wrong: those of reading, then those about the fit.
    pub fn concerns(&self) -> Vec<String> {
        let mut concerns = self.warnings.clone();
        let off = |view: &&ImportedView| view.camera.centre > CENTRE_OFF || view.camera.angle > ANGLE_OFF;
        for view in self.views.iter().filter(off) {
            concerns.push(format!(
                "{}: the predicted camera is {:.0} % of the cameras' spread and {:.1} degrees from the known one",
                view.name,
                100.0 * view.camera.centre,
                view.camera.angle
            ));
        }
        if self.factor.ln().abs() > SCALES_DIFFER {
            concerns.push(format!(
                "the scale by cameras and the scale by depth differ by a factor of {:.2}; the depth's was used (with the cameras' own, \
                 surfaces would lie there once for each view)",
                self.factor
            ));
        }
        if self.points.1 == 0 {
            concerns.push(
                "no pixel has a depth: the reconstruction holds none, or all of it is outside of the photos"
                    .to_string(),
            );
        }
        match self.disagreement {
            None => {
                concerns.push("no two views see the same surface, so that only the cameras gave the scale".to_string())
            }
            Some((_, after)) if after > STILL_OFF => concerns.push(format!(
                "the views still disagree by {:.1} % of depth; give depth little weight, or check the order of views",
                100.0 * after
            )),
            Some(_) => {}
        }
        concerns
    }
}

impl fmt::Display for ImportReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.shift;
        writeln!(
            f,
            "similarity: scale {:.5}, turn {:.2} degrees, shift ({x:.4}, {y:.4}, {z:.4}); depth asks for {:.4} of the scale",
            self.scale, self.turn, self.factor
        )?;
        writeln!(f, "{:<32} {:>8} {:>8} {:>8} {:>9} {:>7}", "view", "centre", "angle", "scale", "shift", "known")?;
        for view in &self.views {
            writeln!(
                f,
                "{:<32} {:>6.2} % {:>8.3} {:>8.4} {:>9.4} {:>5.1} %",
                view.name,
                100.0 * view.camera.centre,
                view.camera.angle,
                view.scale,
                view.shift,
                100.0 * view.known
            )?;
        }
        if let Some((before, after)) = self.disagreement {
            writeln!(
                f,
                "median disagreement between views: {:.2} % of depth before the fit, {:.2} % after it ({}, {})",
                100.0 * before,
                100.0 * after,
                counted(self.compared, "pixel"),
                counted(self.anchors, "known point")
            )?;
        }
        for concern in self.concerns() {
            writeln!(f, "warning: {concern}")?;
        }
        writeln!(f, "{} of {} kept", counted(self.points.0, "point"), counted(self.points.1, "pixel"))?;
        f.write_str(&self.written)
    }
}
