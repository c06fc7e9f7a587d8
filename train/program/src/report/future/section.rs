//! The future as a section of a run's report.

use std::fmt::Write as _;

use anyhow::{Result, bail};
use gs_base::{counted, guarded, write_atomic};

use super::Horizon;
use super::renderer::PredictedScene;
use super::strip::Picture;
use crate::report::html::{self, escaped};
use crate::report::{FUTURE, section_page, with_section};
use gs_train::run::folder::RunFolder;
use gs_train::run::outputs::MARK;

/// Largest report, bytes: its pictures are in it.
const PAGE_MAX: u64 = 1 << 30;

/// Something shown in the section.
#[derive(Debug, Clone)]
pub enum Shown {
    /// A chart as SVG.
    Chart(String),
    /// A picture with its caption.
    Picture(Picture, String),
}

impl PredictedScene<'_> {
    /// The section: strip, PSNR over time, the means, then `more`.
    ///
    /// # Errors
    /// When a picture cannot be encoded.
    pub fn section(&self, horizon: &Horizon, more: &[Shown]) -> Result<String> {
        let mut html = begin();
        if let Some(strip) = self.strip(horizon, None) {
            html += &picture(&strip, "Predicted frames above the photos of the same camera and times")?;
        }
        writeln!(html, "<div class=\"plots\">\n<figure>{}</figure>", horizon.chart().svg())?;
        html += "</div>\n";
        write!(html, "{}", table(horizon))?;
        finish(html, more)
    }
}

/// The section of a run without photos of the future.
///
/// # Errors
/// When a picture cannot be encoded.
pub fn without_photos(more: &[Shown]) -> Result<String> {
    finish(begin(), more)
}

fn begin() -> String {
    format!("<!-- {MARK} -->\n<section>\n<h2>Future</h2>\n")
}

fn finish(mut html: String, more: &[Shown]) -> Result<String> {
    html += "<div class=\"plots\">\n";
    for one in more {
        match one {
            Shown::Chart(svg) => writeln!(html, "<figure>{svg}</figure>")?,
            Shown::Picture(shown, caption) => html += &picture(shown, caption)?,
        }
    }
    Ok(html + "</div>\n</section>\n")
}

fn picture(picture: &Picture, caption: &str) -> Result<String> {
    html::picture([picture.width, picture.height], &picture.pixels, caption, &escaped(caption))
}

fn table(horizon: &Horizon) -> String {
    let future = &horizon.future;
    let row = |name: &str, psnr: f64, held: f64| {
        html::row("td", [name.into(), format!("{psnr:.2}"), format!("{held:.2}"), format!("{:+.2}", psnr - held)])
    };
    let moving = future.moving.zip(future.held_moving).map(|(psnr, held)| row("moving parts", psnr, held));
    format!(
        "<table>\n<tr><th>PSNR of {}, dB</th><th>predicted</th><th>last seen state held</th><th>gain</th></tr>\n{}{}</table>\n",
        counted(future.views, "later view"),
        row("whole images", future.psnr, future.held),
        moving.unwrap_or_default()
    )
}

/// Puts a section into the report.html of a run, instead of an earlier one, and saves it beside it, so that a new
/// report contains it too.
///
/// # Errors
/// When the run has no report, or a file cannot be written.
pub fn add_to_report(folder: &RunFolder, section: &str) -> Result<()> {
    let path = folder.report();
    if !path.is_file() {
        bail!("{}: expected the report of a finished run, found none", path.display());
    }
    let report = guarded::read_to_string(&path, PAGE_MAX)?;
    let Some(report) = with_section(&report, FUTURE, section) else {
        bail!("{}: expected a report of gsburn, found another page", path.display());
    };
    write_atomic(&folder.future(), section_page(&folder.name(), FUTURE, section).as_bytes())?;
    Ok(write_atomic(&path, report.as_bytes())?)
}
