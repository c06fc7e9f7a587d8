//! The profile of a step as a list of bars.

use std::fmt::Write as _;

use super::html::escaped;
use gs_train::run::profile::Profile;

/// The stages of a profile as a list of bars.
pub fn bars(profile: &Profile) -> String {
    let largest = profile.stages.first().map_or(1.0, |stage| stage.share).max(f64::MIN_POSITIVE);
    let of = if profile.cpu_seconds.is_some() { "CPU ms" } else { "wall ms" };
    let mut html = format!(
        "<section>\n<h2>One training step by stage</h2>\n<p>{}.</p>\n<table class=\"bars\">\n\
         <tr><th>stage</th><th>{of}</th><th>share</th><th></th></tr>\n",
        escaped(&profile.summary())
    );
    for row in profile.rows() {
        let seconds = row.cpu_seconds.unwrap_or(row.wall_seconds);
        writeln!(
            html,
            "<tr><td>{}</td><td>{:.2}</td><td>{:.1} %</td><td><i style=\"width:{:.1}%\"></i></td></tr>",
            escaped(&row.name),
            1e3 * seconds,
            100.0 * row.share,
            100.0 * (row.share / largest).clamp(0.0, 1.0)
        )
        .expect("writing to a string does not fail");
    }
    html + "</table>\n</section>\n"
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
