//! `gsburn info`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use glam::DVec3;
use gs_burn::device::{BACKENDS, select};

use crate::cli::InfoArgs;
use crate::commands::print;
use gs_pipelines::load_scene;
use gs_train::fit::density::ops::sigmoid;
use gs_train::fit::parameters::to_host;
use gs_train::run::memory::megabytes;

/// Prints the program's features and devices, or the contents of a scene.
///
/// # Errors
/// One sentence saying what was wrong with the scene.
pub fn run(args: &InfoArgs) -> Result<ExitCode> {
    match &args.scene {
        Some(path) => about_scene(path)?,
        None => about_program(),
    }
    Ok(ExitCode::SUCCESS)
}

fn about_program() {
    print(format!("gsburn {} ({})", env!("CARGO_PKG_VERSION"), std::env::consts::ARCH));
    print(format!("threads  {}", rayon::current_num_threads()));
    for kind in BACKENDS {
        let state = match (kind.is_built(), kind.name()) {
            (false, name) => format!("not compiled in (build with --features {name})"),
            (true, name) => match select(name) {
                Ok(device) => crate::commands::describe(&device),
                Err(error) => format!("compiled in, but {error}"),
            },
        };
        print(format!("{:8} {state}", kind.name()));
    }
}

fn about_scene(path: &Path) -> Result<()> {
    let loaded = load_scene(path, &select("auto")?)?;
    let gaussians = &loaded.gaussians;
    let floats = 11 + 3 * (gaussians.sh_degree() + 1).pow(2);
    print(format!("scene        {}", path.display()));
    if let Some(run) = &loaded.run {
        print(format!("pipeline     {}", run.pipeline));
        print(format!("steps taken  {}", run.step));
        print(format!("data set     {}", run.dataset.display()));
    }
    if loaded.origin != DVec3::ZERO {
        let DVec3 { x, y, z } = loaded.origin;
        print(format!("offset       {x}, {y}, {z}, added to x, y, z"));
    }
    print(format!("Gaussians    {}", gaussians.len()));
    print(format!("SH degree    {}", gaussians.sh_degree()));
    print(format!("parameters   {}", megabytes(4 * (floats * gaussians.len()) as u64)));
    for (name, value) in loaded.run.iter().flat_map(|run| &run.described) {
        print(format!("{name:12} {value}"));
    }
    if gaussians.is_empty() {
        return Ok(());
    }
    let opacities = to_host(gaussians.opacity_logits.val()).iter().map(|x| sigmoid(f64::from(*x))).collect();
    let sizes = to_host(gaussians.log_scales.val())
        .chunks_exact(3)
        .map(|s| f64::from(s[0].max(s[1]).max(s[2])).exp())
        .collect();
    print(format!("opacity      {}", quantiles(opacities)));
    print(format!("largest size {}", quantiles(sizes)));
    let means = to_host(gaussians.means.val());
    let axis = |axis: usize| -> Vec<f64> { means.iter().skip(axis).step_by(3).map(|x| f64::from(*x)).collect() };
    for (name, values) in ["x", "y", "z"].into_iter().zip([axis(0), axis(1), axis(2)]) {
        print(format!("{name:12} {}", quantiles(values)));
    }
    Ok(())
}

/// The 5 %, 50 % and 95 % quantiles.
fn quantiles(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let [low, middle, high] = [0.05, 0.5, 0.95].map(|share| values[((values.len() - 1) as f64 * share) as usize]);
    format!("{} to {}, median {} (5 % to 95 %)", figure(low), figure(high), figure(middle))
}

/// Numbers from here on are written with an exponent: a broken scene has positions of 38 digits.
const LONG: f64 = 1e9;

/// Four digits behind the point, and no zero with a sign.
fn figure(x: f64) -> String {
    let text = if x.abs() < LONG { format!("{x:.4}") } else { format!("{x:.4e}") };
    if text == "-0.0000" { "0.0000".into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short() {
        let shown = [-0.00001, 0.0, 1.25, -999_999_999.0, 1e9, -3e38, f64::INFINITY].map(figure);
        assert_eq!(shown, ["0.0000", "0.0000", "1.2500", "-999999999.0000", "1.0000e9", "-3.0000e38", "inf"]);
    }
}
