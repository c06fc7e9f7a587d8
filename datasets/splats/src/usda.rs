//! OpenUSD as text: one prim `ParticleField3DGaussianSplat` (OpenUSD 26.03 and later), with time samples where the
//! scene moves.

use std::fmt::Write;
use std::path::Path;

use gs_base::{FileError, write_atomic};

use crate::splats::{sigmoid, unit};
use crate::turn::flip;
use crate::{MARK, Splats};

/// Frames a second that a player shows. Times are frame numbers, since most players of USD play whole numbers.
pub const FRAMES_PER_SECOND: u32 = 24;

/// Writes a scene. `samples` are positions and orientations (and sizes, where they change) at frames 0, 1, ...; without
/// any the scene stands still.
///
/// # Errors
/// When the file cannot be written, a value is not finite, or a sample has another number of Gaussians.
pub fn write(path: &Path, splats: &Splats, samples: &[Splats]) -> Result<(), FileError> {
    let text = encode(splats, samples);
    write_atomic(path, text.map_err(|message| FileError::wrong(path, message))?.as_bytes())
}

/// The text of [`write()`].
///
/// # Errors
/// A sentence without the file's name.
pub fn encode(splats: &Splats, samples: &[Splats]) -> Result<String, String> {
    splats.check()?;
    for sample in samples {
        sample.check()?;
        if sample.len() != splats.len() {
            return Err(format!("expected {} Gaussians at every time, found {}", splats.len(), sample.len()));
        }
    }
    let splats = flip(splats);
    let samples: Vec<Splats> = samples.iter().map(flip).collect();
    let mut out = String::new();
    let last = samples.len().saturating_sub(1);
    let _ = writeln!(out, "#usda 1.0\n(\n    doc = \"{MARK}\"\n    defaultPrim = \"Scene\"\n    upAxis = \"Y\"");
    let _ = writeln!(out, "    metersPerUnit = 1");
    if splats.offset != [0.0; 3] {
        let [x, y, z] = splats.offset;
        let _ = writeln!(out, "    customLayerData = {{\n        dictionary gsburn = {{");
        let _ = writeln!(out, "            double3 offset = ({x}, {y}, {z})\n        }}\n    }}");
    }
    if !samples.is_empty() {
        let _ = writeln!(out, "    startTimeCode = 0\n    endTimeCode = {last}");
        let _ =
            writeln!(out, "    timeCodesPerSecond = {FRAMES_PER_SECOND}\n    framesPerSecond = {FRAMES_PER_SECOND}");
    }
    out.push_str(")\n\ndef Xform \"Scene\"\n{\n    def ParticleField3DGaussianSplat \"Splats\"\n    {\n");
    let every = || std::iter::once(&splats).chain(&samples);
    attribute(&mut out, "float3[] extent", &bounds(every()), &[]);
    // Each with its values, and whether they differ from those of another time.
    type Array = (&'static str, fn(&Splats) -> String, fn(&Splats, &Splats) -> bool);
    let arrays: [Array; 4] = [
        ("point3f[] positions", |splats| vectors(&splats.means), |_, _| true),
        (
            "quatf[] orientations",
            |splats| list(splats.quats.iter().map(|q| unit(*q).map(|x| x as f32))),
            |a, b| a.quats != b.quats,
        ),
        (
            "float3[] scales",
            |splats| list(splats.log_scales.iter().map(|s| s.map(f32::exp))),
            |a, b| a.log_scales != b.log_scales,
        ),
        ("float[] opacities", opacities, |a, b| a.opacity_logits != b.opacity_logits),
    ];
    for (name, values, differ) in arrays {
        let changes = samples.iter().any(|sample| differ(sample, &splats));
        let rest: Vec<String> = samples.iter().filter(|_| changes).map(values).collect();
        attribute(&mut out, name, &values(&splats), &rest);
    }
    attribute(&mut out, "uniform int radiance:sphericalHarmonicsDegree", &splats.degree.to_string(), &[]);
    attribute(&mut out, "float3[] radiance:sphericalHarmonicsCoefficients", &vectors(&splats.sh), &[]);
    attribute(&mut out, "uniform token projectionModeHint", "\"perspective\"", &[]);
    attribute(&mut out, "uniform token sortingModeHint", "\"zDepth\"", &[]);
    out.push_str("    }\n}\n");
    Ok(out)
}

/// One attribute: its value, or its values at frames.
fn attribute(out: &mut String, name: &str, value: &str, samples: &[String]) {
    let _ = writeln!(out, "        {name} = {value}");
    if !samples.is_empty() {
        let _ = writeln!(out, "        {name}.timeSamples = {{");
        for (frame, sample) in samples.iter().enumerate() {
            let _ = writeln!(out, "            {frame}: {sample},");
        }
        let _ = writeln!(out, "        }}");
    }
}

fn opacities(splats: &Splats) -> String {
    let values: Vec<String> = splats.opacity_logits.iter().map(|x| (sigmoid(*x) as f32).to_string()).collect();
    format!("[{}]", values.join(", "))
}

fn vectors(values: &[[f32; 3]]) -> String {
    list(values.iter().copied())
}

fn list<const D: usize>(values: impl Iterator<Item = [f32; D]>) -> String {
    let mut out = String::from("[");
    for (index, value) in values.enumerate() {
        out.push_str(if index > 0 { ", (" } else { "(" });
        for (axis, x) in value.iter().enumerate() {
            let _ = write!(out, "{}{x}", if axis > 0 { ", " } else { "" });
        }
        out.push(')');
    }
    out + "]"
}

/// The box of all positions, three standard deviations wider.
fn bounds<'a>(scenes: impl Iterator<Item = &'a Splats>) -> String {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for scene in scenes {
        for (mean, scale) in scene.means.iter().zip(&scene.log_scales) {
            let reach = 3.0 * scale.iter().fold(f32::NEG_INFINITY, |most, s| most.max(*s)).exp();
            low = [0, 1, 2].map(|a| low[a].min(mean[a] - reach));
            high = [0, 1, 2].map(|a| high[a].max(mean[a] + reach));
        }
    }
    if low[0] > high[0] { vectors(&[[0.0; 3]; 2]) } else { vectors(&[low, high]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::testing::random;

    /// The text has every Gaussian once, y up, with the orientation w x y z, and frames where something moves.
    #[test]
    fn the_text_says_what_the_scene_is() {
        let splats = Splats {
            means: vec![[1.0, 2.0, -3.5]],
            offset: [0.0; 3],
            quats: vec![[2.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[0.0; 3]],
            opacity_logits: vec![0.0],
            degree: 0,
            sh: vec![[0.25, 0.5, 1.0]],
            antialiased: None,
        };
        let still = encode(&splats, &[]).expect("written");
        for line in [
            "point3f[] positions = [(1, -2, 3.5)]",
            "quatf[] orientations = [(1, 0, -0, -0)]",
            "float3[] scales = [(1, 1, 1)]",
            "float[] opacities = [0.5]",
            "float3[] radiance:sphericalHarmonicsCoefficients = [(0.25, 0.5, 1)]",
            "uniform int radiance:sphericalHarmonicsDegree = 0",
            "float3[] extent = [(-2, -5, 0.5), (4, 1, 6.5)]",
        ] {
            assert!(still.contains(line), "{line} in {still}");
        }
        assert!(!still.contains("timeSamples") && !still.contains("customLayerData"));
        let far = encode(&Splats { offset: [450_000.125, -5e6, 0.1], ..splats.clone() }, &[]).expect("written");
        assert!(far.contains("double3 offset = (450000.125, 5000000, -0.1)"), "{far}");
        let mut later = splats.clone();
        later.means[0][0] = 2.0;
        let moving = encode(&splats, &[splats.clone(), later]).expect("written");
        assert!(moving.contains("endTimeCode = 1") && moving.contains("1: [(2, -2, 3.5)],"), "{moving}");
        assert_eq!(moving.matches("timeSamples").count(), 1, "orientations, sizes and opacities stay");
        assert!(encode(&splats, &[random(2, 0, 1)]).is_err());
    }
}
