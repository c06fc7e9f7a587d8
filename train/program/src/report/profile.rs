//! The profile of a step as a list of bars.

use super::html::{self, escaped};
use gs_train::run::profile::Profile;

/// The stages of a profile as a list of bars.
pub fn bars(profile: &Profile) -> String {
    let largest = profile.stages.first().map_or(1.0, |stage| stage.share).max(f64::MIN_POSITIVE);
    let of = if profile.cpu_seconds.is_some() { "CPU ms" } else { "wall ms" };
    let rows = profile.rows().into_iter().map(|row| {
        let seconds = row.cpu_seconds.unwrap_or(row.wall_seconds);
        let width = 100.0 * (row.share / largest).clamp(0.0, 1.0);
        let [ms, share] = [format!("{:.2}", 1e3 * seconds), format!("{:.1} %", 100.0 * row.share)];
        html::row("td", [escaped(&row.name), ms, share, format!("<i style=\"width:{width:.1}%\"></i>")])
    });
    format!(
        "<section>\n<h2>One training step by stage</h2>\n<p>{}.</p>\n<table class=\"bars\">\n\
         {}{}</table>\n</section>\n",
        escaped(&profile.summary()),
        html::row("th", ["stage", of, "share", ""].map(String::from)),
        rows.collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_train::run::profile::ProfiledStage;

    #[test]
    fn the_largest_stage_has_the_longest_bar() {
        let stage = |name: &str, share| ProfiledStage {
            name: name.into(),
            calls: 1.0,
            wall_seconds: share,
            cpu_seconds: Some(share),
            share,
        };
        let stages = vec![stage("rasterize", 0.6), stage("Adam", 0.3)];
        let profile =
            Profile { device: "flex".into(), threads: 2, steps: 4, wall_seconds: 1.0, cpu_seconds: Some(0.9), stages };
        assert!(bars(&profile).contains("width:100.0%") && bars(&profile).contains("width:50.0%"));
    }
}
