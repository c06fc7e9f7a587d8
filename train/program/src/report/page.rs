//! The report as one HTML file that needs no other file and no network.

use std::fmt::Write as _;

use anyhow::Result;
use gs_base::{agree, counted};

use super::cards::{self, thousands};
use super::comparison::Table;
use super::html::{self, escaped};
use super::pictures::{ERROR_FULL_SCALE, SideBySide};
use super::profile::bars;
use gs_train::fit::figure::FigureTable;
use gs_train::run::folder::EvalFile;
use gs_train::run::measured::{Evaluation, ViewScores};
use gs_train::run::memory::megabytes;
use gs_train::run::metrics::{psnr_cell, shown_psnr};
use gs_train::run::profile::Profile;

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

/// A section as a page of its own, from which `section_of` takes it for the next report.
pub fn section_page(name: &str, place: Place, section: &str) -> String {
    let heading = format!("<h1>{}</h1>\n", html::name(name));
    html::page(name, "", &[&heading, place[0], section, place[1]].concat())
}

/// The section of a page; the whole text of one from before sections were pages.
pub(super) fn section_of(page: &str, place: Place) -> &str {
    let inside = page.split_once(place[0]).and_then(|(_, rest)| rest.split_once(place[1]));
    inside.map_or(page, |(section, _)| section)
}

/// The whole page: verdict, scene, curves, profile, comparison, pictures, views, configuration.
pub(super) fn whole(
    eval: &EvalFile,
    plots: &[String],
    pictures: &[SideBySide],
    (viewer, profile): (Option<String>, Option<&Profile>),
    config: &str,
) -> Result<String> {
    let mut page = format!("<header>\n<h1>{}</h1>\n<p>{}</p>\n</header>\n", html::name(&eval.name), summary(eval));
    page += &cards::html(eval);
    page.extend(viewer);
    page.extend(eval.last.measured.tables.iter().map(figure_table));
    page += &section("Along the way", &progress(&eval.evaluations).html());
    if !plots.is_empty() {
        let plots: String = plots.iter().map(|plot| format!("<figure>{plot}</figure>\n")).collect();
        page += &section("Curves", &format!("<div class=\"plots\">\n{plots}</div>\n"));
    }
    page.extend(profile.map(bars));
    page.extend(FUTURE);
    page.extend(COMPARISON);
    show_pictures(&mut page, pictures)?;
    page += &section("Views, worst first", &views(&eval.last).html());
    write!(
        page,
        "{CONFIGURATION}{}<details><summary>Every value of this run</summary>\n<pre>{}</pre></details>\n</section>\n",
        facts(eval),
        escaped(config)
    )?;
    Ok(html::page(&eval.name, "", &page))
}

fn section(title: &str, content: &str) -> String {
    format!("<section>\n<h2>{}</h2>\n{content}</section>\n", escaped(title))
}

fn summary(eval: &EvalFile) -> String {
    let quality = &eval.last.measured.quality;
    let views = quality.views.len();
    let split = match eval.last.measured.split.as_str() {
        "test" => "held-out".into(),
        "train" => "training (none are held out)".into(),
        other => html::name(other),
    };
    let skipped = match eval.skipped_steps {
        0 => String::new(),
        n => format!(
            " <strong>{} {} skipped because {} gradients were not finite.</strong>",
            counted(n, "step"),
            agree(n, "was", "were"),
            agree(n, "its", "their")
        ),
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
        "{} of {} on <code>{}</code>, device {}; measured on {}.{compared}{regions}{skipped}",
        counted(eval.last.step, "step"),
        escaped(&eval.pipeline),
        html::name(&eval.dataset),
        escaped(&eval.device),
        counted(views, &format!("{split} view")),
    )
}

/// The values fixed by the data set.
fn facts(eval: &EvalFile) -> String {
    if eval.facts.is_empty() {
        return String::new();
    }
    let head = html::row("th", ["found in the data set", "value", "key that says otherwise"].map(String::from));
    let row = |(name, value, key): &(String, String, String)| [escaped(name), html::name(value), escaped(key)];
    let rows: String = eval.facts.iter().map(|fact| html::row("td", row(fact))).collect();
    format!("<table>\n{head}{rows}</table>\n")
}

/// A table of the method.
fn figure_table(table: &FigureTable) -> String {
    let row = |cell: &str, cells: &[String]| html::row(cell, cells.iter().map(|text| escaped(text)));
    let rows: String = table.rows.iter().map(|cells| row("td", cells)).collect();
    let head = row("th", &table.columns);
    section(&table.title, &format!("<div class=\"wide\"><table>\n{head}{rows}</table></div>\n"))
}

/// One row per measurement.
fn progress(evaluations: &[Evaluation]) -> Table {
    let columns = ["step", "PSNR, dB", "SSIM", "MS-SSIM", "LPIPS", "Gaussians", "seconds", "peak memory"];
    let optional = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.4}"));
    let row = |row: &Evaluation| {
        vec![
            row.step.to_string(),
            psnr_cell(row.mean().psnr),
            format!("{:.4}", row.mean().ssim),
            optional(row.mean().ms_ssim),
            optional(row.mean().lpips),
            thousands(row.measured.size.gaussians),
            format!("{:.1}", row.cost.seconds),
            row.cost.peak_memory_bytes.map_or(String::new(), megabytes),
        ]
    };
    Table::of(columns.map(String::from).to_vec(), evaluations.iter().map(row).collect())
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
        let what = format!("{}: photo, rendering, error", picture.name);
        let caption = format!("{}, {}", html::name(&picture.name), shown_psnr(picture.psnr));
        *page += &html::picture([picture.width, picture.height], &picture.pixels, &what, &caption)?;
    }
    page.push_str("</section>\n");
    Ok(())
}

/// Every view, the worst first.
fn views(last: &Evaluation) -> Table {
    let mut views: Vec<_> = last.measured.quality.views.iter().collect();
    views.sort_by(|a, b| a.scores.psnr.total_cmp(&b.scores.psnr));
    let row =
        |view: &&ViewScores| vec![view.name.clone(), psnr_cell(view.scores.psnr), format!("{:.4}", view.scores.ssim)];
    Table::of(["view", "PSNR, dB", "SSIM"].map(String::from).to_vec(), views.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_section_is_a_page_and_comes_back() {
        let page = section_page("run", FUTURE, "<p>later</p>\n");
        assert!(page.starts_with("<!doctype html>") && page.contains("<style>") && page.ends_with("</html>\n"));
        assert_eq!(section_of(&page, FUTURE), "<p>later</p>\n");
        assert_eq!(section_of("<p>before</p>", FUTURE), "<p>before</p>");
    }

    #[test]
    fn columns_without_a_value_are_left_out() {
        let shown = progress(&[Evaluation::default()]).html();
        assert!(!shown.contains("LPIPS") && !shown.contains('–') && shown.contains("PSNR"), "{shown}");
    }
}
