//! The report as one HTML file that needs no other file and no network.

use std::fmt::Write as _;

use anyhow::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::html::escaped;
use super::pictures::{ERROR_FULL_SCALE, SideBySide};
use super::profile::bars;
use crate::fit::figure::{FigureTable, Prominence};
use crate::run::evaluate::Evaluation;
use crate::run::folder::EvalFile;
use crate::run::memory::megabytes;
use crate::run::outputs::MARK;
use crate::run::profile::Profile;

/// The look of all pages.
pub const STYLE: &str = include_str!("style.css");

/// Markers around a section that a later command puts into the page.
type Place = [&'static str; 2];

/// The place of the comparison of `gsburn chart`.
pub const COMPARISON: Place = ["<!-- comparison -->\n", "<!-- /comparison -->\n"];

/// The place of the future of a run.
pub const FUTURE: Place = ["<!-- future -->\n", "<!-- /future -->\n"];

/// Beginning of the last section of the page.
const CONFIGURATION: &str = "<section>\n<h2>Configuration</h2>\n";

/// The report with `section` at a place, instead of what was there; `None` if the page has no position for it.
pub fn with_section(report: &str, place: Place, section: &str) -> Option<String> {
    let (before, after) = match report.split_once(place[0]) {
        Some((before, rest)) => (before, rest.split_once(place[1])?.1),
        // A report from before there was such a place.
        None => report.split_at(report.find(CONFIGURATION)?),
    };
    Some([before, place[0], section, place[1], after].concat())
}

/// The whole page: verdict, scene, curves, profile, comparison, pictures, views, configuration.
pub(super) fn html(
    eval: &EvalFile,
    plots: &[String],
    pictures: &[SideBySide],
    (viewer, profile): (Option<String>, Option<&Profile>),
    config: &str,
) -> Result<String> {
    let name = escaped(&eval.name);
    let mut page = String::new();
    write!(
        page,
        "<!doctype html>\n<!-- {MARK} -->\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name} · gsburn</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n"
    )?;
    write!(page, "<header>\n<h1>{name}</h1>\n<p>{}</p>\n</header>\n", summary(eval))?;
    verdict(&mut page, eval)?;
    page.extend(viewer);
    for table in &eval.last.measured.tables {
        figure_table(&mut page, table)?;
    }
    progress_table(&mut page, eval)?;
    page.push_str("<section>\n<h2>Curves</h2>\n<div class=\"plots\">\n");
    for plot in plots {
        writeln!(page, "<figure>{plot}</figure>")?;
    }
    page.push_str("</div>\n</section>\n");
    page.extend(profile.map(bars));
    page.extend(FUTURE);
    page.extend(COMPARISON);
    show_pictures(&mut page, pictures)?;
    views_table(&mut page, &eval.last)?;
    write!(
        page,
        "{CONFIGURATION}{}<details><summary>Every value of this run</summary>\n<pre>{}</pre></details>\n</section>\n</main>\n\
         </body>\n</html>\n",
        facts(eval),
        escaped(config)
    )?;
    Ok(page)
}

fn summary(eval: &EvalFile) -> String {
    let quality = &eval.last.measured.quality;
    let views = quality.views.len();
    let split = match eval.last.measured.split.as_str() {
        "test" => "held-out".into(),
        "train" => "training (none are held out)".into(),
        other => escaped(other),
    };
    let skipped = match eval.skipped_steps {
        0 => String::new(),
        n => format!(" <strong>{n} steps were skipped because their gradients were not finite.</strong>"),
    };
    let compared = match quality.compared.as_str() {
        "formed blur" => {
            " The photos are blurry and no sharp truth is known: each is compared with the blur that the scene forms over its \
                          exposure."
        }
        "sharp truth" => " The sharp truth of the blurry photos is compared with the sharp rendering.",
        _ => "",
    };
    let regions = match quality.regions_inferred {
        true => " The data set marks no moving parts in these photos: they were found where the photos change.",
        false => "",
    };
    format!(
        "{} steps of {} on <code>{}</code>, device {}; measured on {views} {split} view{}.{compared}{regions}{skipped}",
        eval.last.step,
        escaped(&eval.pipeline),
        escaped(&eval.dataset),
        escaped(&eval.device),
        if views == 1 { "" } else { "s" }
    )
}

/// The values fixed by the data set.
fn facts(eval: &EvalFile) -> String {
    if eval.facts.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<table>\n<tr><th>found in the data set</th><th>value</th><th>key that says otherwise</th></tr>\n",
    );
    for (name, value, key) in &eval.facts {
        html += &format!("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", escaped(name), escaped(value), escaped(key));
    }
    html + "</table>\n"
}

/// The headline figures, as cards.
fn verdict(page: &mut String, eval: &EvalFile) -> Result<()> {
    let last = &eval.last;
    let (quality, size, cost) = (&last.measured.quality, &last.measured.size, &last.cost);
    let small = |text: &str| if text.is_empty() { String::new() } else { format!("<small>{}</small>", escaped(text)) };
    let score = |value: Option<f64>, reason: &Option<String>| match value {
        Some(value) => (format!("{value:.4}"), String::new()),
        None => ("–".into(), small(reason.as_deref().unwrap_or("not measured"))),
    };
    let (ms_ssim, ms_ssim_note) = score(quality.mean.ms_ssim, &quality.ms_ssim_reason);
    let (lpips, lpips_note) = score(quality.mean.lpips, &quality.lpips_reason);
    let cpu = cost
        .cpu_seconds
        .map_or(String::new(), |cpu| format!("<small>{:.3} CPU seconds a step</small>", cpu / last.step.max(1) as f64));
    let peak = cost.peak_memory_bytes.map_or("–".into(), megabytes);
    let predicted = format!("<small>{} predicted</small>", megabytes(eval.predicted_memory_bytes));
    let cap = eval.settings.iter().find(|setting| setting.key == "density.cap");
    let cap = cap.map_or(String::new(), |setting| small(&format!("at most {}", setting.value)));
    let mut cards = vec![
        ("PSNR".to_string(), format!("{:.2} dB", quality.mean.psnr), String::new()),
        ("SSIM".into(), format!("{:.4}", quality.mean.ssim), String::new()),
        ("MS-SSIM".into(), ms_ssim, ms_ssim_note),
        ("LPIPS".into(), lpips, lpips_note),
        ("Gaussians".into(), thousands(size.gaussians), cap),
        ("Size".into(), megabytes(size.bytes as u64), "<small>numbers as f32</small>".into()),
        ("Training time".into(), duration(cost.seconds), cpu),
        ("Peak memory".into(), peak, predicted),
    ];
    for (name, scores) in &quality.regions {
        let note = small(&format!("SSIM {:.4}, inside the region's mask", scores.ssim));
        cards.push((format!("{name} parts"), format!("{:.2} dB", scores.psnr), note));
    }
    for figure in last.measured.figures.iter().filter(|figure| figure.prominence == Prominence::Headline) {
        cards.push((figure.name.clone(), figure.shown(), small(&figure.note)));
    }
    page.push_str("<section class=\"cards\">\n");
    for (label, value, note) in cards {
        writeln!(
            page,
            "<div class=\"card\"><span>{}</span><b>{}</b>{note}</div>",
            escaped(&capitalised(&label)),
            escaped(&value)
        )?;
    }
    page.push_str("</section>\n");
    Ok(())
}

/// The text with a capital first letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// A table of the method.
fn figure_table(page: &mut String, table: &FigureTable) -> Result<()> {
    let row = |cells: &[String], cell: &str| {
        let cells: String = cells.iter().map(|text| format!("<{cell}>{}</{cell}>", escaped(text))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    write!(page, "<section>\n<h2>{}</h2>\n<table>\n{}", escaped(&table.title), row(&table.columns, "th"))?;
    table.rows.iter().for_each(|cells| page.push_str(&row(cells, "td")));
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
            row.mean().psnr,
            row.mean().ssim,
            cell(row.mean().ms_ssim),
            cell(row.mean().lpips),
            thousands(row.measured.size.gaussians),
            row.cost.seconds,
            row.cost.peak_memory_bytes.map_or("–".into(), megabytes)
        )?;
    }
    page.push_str("</table>\n</section>\n");
    Ok(())
}

/// The names of the panels.
fn headline(pictures: &[SideBySide]) -> String {
    let more = pictures.iter().map(|picture| &picture.more).max_by_key(|more| more.len());
    let more: String = more.into_iter().flatten().map(|name| format!(", {name}")).collect();
    let has_blurry = pictures.iter().any(|picture| picture.panels > 3 + picture.more.len());
    let first = if has_blurry { "Blurry photo, sharp truth, rendering, error" } else { "Photo, rendering, error" };
    first.to_string() + &more
}

fn show_pictures(page: &mut String, pictures: &[SideBySide]) -> Result<()> {
    if pictures.is_empty() {
        return Ok(());
    }
    write!(
        page,
        "<section>\n<h2>{}</h2>\n<p>The error is the mean over channels, from black (0) to pale yellow \
         ({ERROR_FULL_SCALE} of the full range and above); slate where the photo is masked.</p>\n",
        headline(pictures)
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

/// Every view, the worst first.
fn views_table(page: &mut String, last: &Evaluation) -> Result<()> {
    let mut views: Vec<_> = last.measured.quality.views.iter().collect();
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

/// An integer in groups of three digits.
fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
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
        let once = with_section(&page, COMPARISON, "one").expect("a place");
        let twice = with_section(&once, COMPARISON, "two").expect("a place");
        assert!(once.contains("one") && twice.contains("two") && !twice.contains("one"));
        assert_eq!(with_section("<main></main>", FUTURE, "one"), None);
        let older = format!("<main>{CONFIGURATION}");
        assert!(with_section(&older, COMPARISON, "one").is_some_and(|page| page.ends_with(CONFIGURATION)));
    }
}
