//! The report as one HTML file that needs no other file and no network.

use std::fmt::Write as _;

use anyhow::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::evaluate::Evaluation;
use crate::experiment::Config;
use crate::memory::megabytes;
use crate::profile::Profile;
use crate::report::pictures::{ERROR_FULL_SCALE, SideBySide};
use crate::run_folder::EvalFile;
use crate::taylormode::measure::MotionCost;

/// The look of all pages.
pub(crate) const STYLE: &str = include_str!("style.css");

/// Around what a chart of several runs puts into the page.
const COMPARISON: [&str; 2] = ["<!-- comparison -->\n", "<!-- /comparison -->\n"];

/// How the last section of the page begins.
const CONFIGURATION: &str = "<section>\n<h2>Configuration</h2>\n";

/// The report with `section` in the place for comparisons, in place of an earlier one; `None` when the page has none.
pub(crate) fn with_comparison(report: &str, section: &str) -> Option<String> {
    let (before, after) = match report.split_once(COMPARISON[0]) {
        Some((before, rest)) => (before, rest.split_once(COMPARISON[1])?.1),
        // Reports before there were comparisons.
        None => report.split_at(report.find(CONFIGURATION)?),
    };
    Some([before, COMPARISON[0], section, COMPARISON[1], after].concat())
}

/// The whole page: verdict, curves, profile, comparison, pictures, views, configuration.
pub(super) fn html(
    eval: &EvalFile,
    plots: &[String],
    pictures: &[SideBySide],
    profile: Option<&Profile>,
    config: &Config,
) -> Result<String> {
    let name = escaped(&eval.name);
    let mut page = String::new();
    write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name} · gsburn</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n"
    )?;
    write!(page, "<header>\n<h1>{name}</h1>\n<p>{}</p>\n</header>\n", summary(eval))?;
    verdict(&mut page, eval)?;
    if let Some(motion) = &eval.last.motion {
        stored_table(&mut page, eval.last.gaussians, &motion.cost)?;
    }
    progress_table(&mut page, eval)?;
    page.push_str("<section>\n<h2>Curves</h2>\n<div class=\"plots\">\n");
    for plot in plots {
        writeln!(page, "<figure>{plot}</figure>")?;
    }
    page.push_str("</div>\n</section>\n");
    page.extend(profile.map(Profile::html));
    page.extend(COMPARISON);
    show_pictures(&mut page, pictures)?;
    views_table(&mut page, &eval.last)?;
    write!(
        page,
        "{CONFIGURATION}<details><summary>Every value of this run, those that the data set settled included</summary>\n\
         <pre>{}</pre></details>\n</section>\n</main>\n</body>\n</html>\n",
        escaped(&config.to_toml())
    )?;
    Ok(page)
}

fn summary(eval: &EvalFile) -> String {
    let views = eval.last.views.len();
    let split = if eval.last.split == "test" { "held-out" } else { "training (none are held out)" };
    let skipped = match eval.skipped_steps {
        0 => String::new(),
        n => format!(" <strong>{n} steps were skipped because their gradients were not finite.</strong>"),
    };
    format!(
        "{} steps on <code>{}</code>, device {}; measured on {views} {split} view{}.{skipped}",
        eval.last.step,
        escaped(&eval.dataset),
        escaped(&eval.device),
        if views == 1 { "" } else { "s" }
    )
}

/// The figures that decide, as cards.
fn verdict(page: &mut String, eval: &EvalFile) -> Result<()> {
    let last = &eval.last;
    let missing =
        |reason: &Option<String>| format!("<small>{}</small>", escaped(reason.as_deref().unwrap_or("not measured")));
    let score = |value: Option<f64>, reason: &Option<String>| match value {
        Some(value) => (format!("{value:.4}"), String::new()),
        None => ("–".into(), missing(reason)),
    };
    let (ms_ssim, ms_ssim_note) = score(last.mean.ms_ssim, &last.ms_ssim_reason);
    let (lpips, lpips_note) = score(last.mean.lpips, &last.lpips_reason);
    let cpu = last
        .cpu_seconds
        .map_or(String::new(), |cpu| format!("<small>{:.3} CPU seconds a step</small>", cpu / last.step.max(1) as f64));
    let peak = last.peak_memory_bytes.map_or("–".into(), megabytes);
    let bytes = last.motion.as_ref().map_or(last.bytes, |motion| motion.cost.bytes);
    let predicted = format!("<small>{} predicted</small>", megabytes(eval.predicted_memory_bytes));
    let cards = [
        ("PSNR", format!("{:.2} dB", last.mean.psnr), String::new()),
        ("SSIM", format!("{:.4}", last.mean.ssim), String::new()),
        ("MS-SSIM", ms_ssim, ms_ssim_note),
        ("LPIPS", lpips, lpips_note),
        ("Gaussians", thousands(last.gaussians), format!("<small>at most {}</small>", thousands(eval.cap))),
        ("Size", megabytes(bytes as u64), "<small>parameters as f32</small>".into()),
        ("Training time", duration(last.seconds), cpu),
        ("Peak memory", peak, predicted),
    ];
    page.push_str("<section class=\"cards\">\n");
    for (label, value, note) in cards.into_iter().chain(motion_cards(last)) {
        writeln!(page, "<div class=\"card\"><span>{label}</span><b>{value}</b>{note}</div>")?;
    }
    page.push_str("</section>\n");
    Ok(())
}

/// The figures of a moving scene.
fn motion_cards(last: &Evaluation) -> Vec<(&'static str, String, String)> {
    let mut cards = Vec::new();
    if let Some(moving) = &last.moving {
        cards.push((
            "Moving parts",
            format!("{:.2} dB", moving.psnr),
            format!("<small>SSIM {:.4}, inside the mask of what moves</small>", moving.ssim),
        ));
    }
    let Some(motion) = &last.motion else { return cards };
    if let Some(blurry) = motion.blurry_psnr {
        cards.push(("Blurry photo", format!("{blurry:.2} dB"), "<small>as the scene forms it</small>".into()));
    }
    if let (Some(angle), Some(speed)) = (motion.velocity_angle, motion.velocity_magnitude) {
        let speed = format!("<small>speed off by {:.1} %, medians over moving surfaces</small>", 100.0 * speed);
        cards.push(("Velocity", format!("{angle:.1}° off"), speed));
    }
    let error = motion.exposure_error.map_or(String::new(), |e| format!("<small>off by {:.1} %</small>", 100.0 * e));
    cards.push(("Exposure", format!("{:.4}", motion.exposure), error));
    let cost = &motion.cost;
    cards.push((
        "Moving Gaussians",
        thousands(cost.moving),
        format!("<small>{:.0} % are static; mean order {:.2}</small>", 100.0 * cost.static_share, cost.mean_order),
    ));
    cards
}

/// What a moving scene stores, beside the same Gaussians at one order.
fn stored_table(page: &mut String, gaussians: usize, cost: &MotionCost) -> Result<()> {
    let all = gaussians.max(1) as f64;
    let moving: usize = cost.orders.iter().enumerate().map(|(order, count)| order * count).sum();
    let counts = |of: &[usize]| of.iter().map(|count| thousands(*count)).collect::<Vec<_>>().join(" · ");
    let mut fixed_orders = vec![0; cost.fixed_order + 1];
    fixed_orders[cost.fixed_order] = gaussians;
    let mut fixed_degrees = vec![0; cost.sh_degrees.len().max(1)];
    *fixed_degrees.last_mut().expect("one at least") = gaussians;
    let rows = [
        ("Gaussians", thousands(gaussians), thousands(gaussians)),
        ("numbers", thousands(cost.parameters), thousands(cost.fixed_parameters)),
        ("of them motion", thousands(cost.motion_parameters), thousands(cost.fixed_motion_parameters)),
        ("bytes", megabytes(cost.bytes as u64), megabytes(cost.fixed_bytes as u64)),
        ("share static", format!("{:.1} %", 100.0 * cost.static_share), "0 %".into()),
        ("mean order of motion, over all", format!("{:.2}", moving as f64 / all), format!("{}", cost.fixed_order)),
        ("Gaussians of order 0 · 1 · 2 · ...", counts(&cost.orders), counts(&fixed_orders)),
        ("those that move, of rotation order 0 · 1 · ...", counts(&cost.rotation_orders), String::new()),
        (
            "kinks in each path; remainder",
            format!("{}; {}", cost.kinks, if cost.remainder { "yes" } else { "no" }),
            String::new(),
        ),
        ("Gaussians of SH degree 0 · 1 · ...", counts(&cost.sh_degrees), counts(&fixed_degrees)),
    ];
    page.push_str(
        "<section>\n<h2>What the scene stores</h2>\n<table>\n<tr><th></th><th>this scene</th>\
         <th>one order and degree for all</th></tr>\n",
    );
    for (what, here, fixed) in rows {
        writeln!(page, "<tr><td>{what}</td><td>{here}</td><td>{fixed}</td></tr>")?;
    }
    page.push_str("</table>\n</section>\n");
    Ok(())
}

/// One row per measurement.
fn progress_table(page: &mut String, eval: &EvalFile) -> Result<()> {
    page.push_str(
        "<section>\n<h2>Along the way</h2>\n<table>\n<tr><th>step</th><th>PSNR, dB</th><th>SSIM</th><th>MS-SSIM</th>\
         <th>LPIPS</th><th>Gaussians</th><th>seconds</th><th>peak memory</th></tr>\n",
    );
    let cell = |value: Option<f64>| value.map_or("–".into(), |v| format!("{v:.4}"));
    for row in &eval.evaluations {
        writeln!(
            page,
            "<tr><td>{}</td><td>{:.2}</td><td>{:.4}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td></tr>",
            row.step,
            row.mean.psnr,
            row.mean.ssim,
            cell(row.mean.ms_ssim),
            cell(row.mean.lpips),
            thousands(row.gaussians),
            row.seconds,
            row.peak_memory_bytes.map_or("–".into(), megabytes)
        )?;
    }
    page.push_str("</table>\n</section>\n");
    Ok(())
}

fn show_pictures(page: &mut String, pictures: &[SideBySide]) -> Result<()> {
    if pictures.is_empty() {
        return Ok(());
    }
    write!(
        page,
        "<section>\n<h2>{}</h2>\n<p>The error is the mean over channels, from black (0) to pale yellow \
         ({ERROR_FULL_SCALE} of the full range and above); slate where the photo is masked.</p>\n",
        if pictures.iter().any(|picture| picture.panels > 3) {
            "Blurry photo, sharp truth, rendering, error"
        } else {
            "Photo, rendering, error"
        }
    )?;
    for picture in pictures {
        let mut png = Vec::new();
        let (width, height) = (picture.width as u32, picture.height as u32);
        PngEncoder::new(&mut png).write_image(&picture.pixels, width, height, ExtendedColorType::Rgb8)?;
        let name = escaped(&picture.name);
        write!(
            page,
            "<figure><img alt=\"{name}: photo, rendering, error\" width=\"{width}\" height=\"{height}\" \
             src=\"data:image/png;base64,{}\">\n<figcaption>{name}, {:.2} dB</figcaption></figure>\n",
            STANDARD.encode(&png),
            picture.psnr
        )?;
    }
    page.push_str("</section>\n");
    Ok(())
}

/// Every view, worst first: that is where to look.
fn views_table(page: &mut String, last: &Evaluation) -> Result<()> {
    let mut views: Vec<_> = last.views.iter().collect();
    views.sort_by(|a, b| a.scores.psnr.total_cmp(&b.scores.psnr));
    page.push_str(
        "<section>\n<h2>Views, worst first</h2>\n<table>\n<tr><th>view</th><th>PSNR, dB</th><th>SSIM</th></tr>\n",
    );
    for view in views {
        let (name, scores) = (escaped(&view.name), &view.scores);
        writeln!(page, "<tr><td>{name}</td><td>{:.2}</td><td>{:.4}</td></tr>", scores.psnr, scores.ssim)?;
    }
    page.push_str("</table>\n</section>\n");
    Ok(())
}

/// A whole number in groups of three digits.
fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7200.0 => format!("{:.0} min {:02.0} s", (s / 60.0).floor(), s % 60.0),
        s => format!("{:.0} h {:02.0} min", (s / 3600.0).floor(), (s / 60.0) % 60.0),
    }
}

/// Text that cannot be taken for HTML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(thousands(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(thousands(12), "12");
        assert_eq!(duration(61.26), "61.3 s");
        assert_eq!(duration(200.0), "3 min 20 s");
    }

    #[test]
    fn a_comparison_replaces_an_earlier_one() {
        let page = ["<main>", COMPARISON[0], COMPARISON[1], "</main>"].concat();
        let once = with_comparison(&page, "one").expect("a place");
        let twice = with_comparison(&once, "two").expect("a place");
        assert!(once.contains("one") && twice.contains("two") && !twice.contains("one"));
        assert_eq!(with_comparison("<main></main>", "one"), None);
        let older = format!("<main>{CONFIGURATION}");
        assert!(with_comparison(&older, "one").is_some_and(|page| page.ends_with(CONFIGURATION)));
    }

    #[test]
    fn names_cannot_break_the_page() {
        assert_eq!(escaped("a<b>&\"c"), "a&lt;b&gt;&amp;&quot;c");
    }
}
