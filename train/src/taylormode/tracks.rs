//! The bodies that move apart from each other, each with the path of its centre.

use gs_datasets::Scene;
use gs_datasets::motion::{Centre, MovingMasks, Trajectory, object_centres};

use crate::experiment::Config;

/// A body, or all that moves where bodies cannot be told apart.
#[derive(Debug, Clone)]
pub struct Track {
    /// Its centre, by time.
    pub centres: Vec<Centre>,
    /// The centre's path.
    pub path: Trajectory,
}

/// Share of the times at which a body must have been seen, and pixels (rms) that its centre may then be from its path; in between the
/// line through both. Pieces that a body's hull falls into by ragged masks come and go, and jump; bodies that touch each other are one
/// piece for a while, and keep to their paths before and after.
const BODY: [(f64, f64); 2] = [(0.5, 0.5), (0.9, 2.0)];

/// Whether a centre seen at a share of the times, and as many pixels from its path, is a body's.
fn is_body(share: f64, pixels: f64) -> bool {
    let [(least, near), (all, far)] = BODY;
    let between = ((share - least) / (all - least)).min(1.0);
    between >= 0.0 && pixels <= near + (far - near) * between
}

/// The bodies that move apart from each other, that with most centres first; all that moves as one where there are no two
/// bodies to believe in.
pub fn tracks(
    scene: &Scene,
    masks: &MovingMasks,
    centres: &[Centre],
    pixels_per_unit: f64,
    config: &Config,
) -> Vec<Track> {
    let track = |centres: Vec<Centre>| {
        let path = Trajectory::fit(&centres, config.motion.order_max, config.motion.kinks)?;
        Some(Track { centres, path })
    };
    let mut bodies: Vec<Track> = object_centres(scene, &masks.masks).into_iter().filter_map(track).collect();
    let times = bodies.iter().map(|body| body.centres.len()).max().unwrap_or(0).max(centres.len()) as f64;
    bodies.retain(|body| {
        let (seen, pixels) = (body.centres.len() as f64 / times, body.path.residual * pixels_per_unit);
        let kept = 1.0 - body.path.outliers as f64 / body.centres.len() as f64;
        tracing::debug!(seen, kept, pixels, order = body.path.order(), kinks = body.path.kinks.len(), "a body");
        is_body(seen * kept, pixels)
    });
    if bodies.len() > 1 {
        return bodies;
    }
    let whole = track(centres.to_vec()).filter(|whole| whole.path.residual * pixels_per_unit <= FOLLOWED);
    whole.into_iter().collect()
}

/// Pixels (rms) that the centre of all that moves may be from its path; bodies are mostly within one and a half. The middle of people who
/// throw a ball is nobody's, and follows nothing (21 pixels): on such a path everything begins at the wrong place in all frames but
/// one, and fades.
const FOLLOWED: f64 = 4.0;

/// Pixels that one scene unit spans at the centre of what moves, mean over the training views; 0 without centres.
pub fn pixels_per_unit(scene: &Scene, centres: &[Centre]) -> f64 {
    let Some(middle) = centres.get(centres.len() / 2) else { return 0.0 };
    let scales = scene.train.iter().filter_map(|view| {
        let depth = (middle.position - view.c2w.w_axis.truncate()).dot(view.c2w.z_axis.truncate());
        (depth > 0.0).then(|| view.intrinsics.fx / depth)
    });
    let scales: Vec<f64> = scales.collect();
    scales.iter().sum::<f64>() / scales.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::is_body;

    /// What is seen always may be rough, what is seen half the time must be exact, what is seen less is none.
    #[test]
    fn the_less_a_body_is_seen_the_closer_it_keeps_to_its_path() {
        assert!(is_body(1.0, 2.0) && is_body(0.9, 2.0) && is_body(0.5, 0.5));
        assert!(is_body(0.7, 1.2) && !is_body(0.7, 1.3));
        assert!(!is_body(1.0, 2.1) && !is_body(0.5, 0.6) && !is_body(0.49, 0.0));
    }
}
