//! The headline figures of a report, as cards: only those that were measured.

use super::html::escaped;
use super::meanings::{list, meaning};
use gs_train::fit::figure::{FigureTable, Prominence};
use gs_train::run::folder::EvalFile;
use gs_train::run::memory::megabytes;
use gs_train::run::metrics::shown_psnr;

/// A figure with its remark.
struct Card {
    label: String,
    value: String,
    note: String,
}

impl Card {
    fn new(label: &str, value: String, note: impl Into<String>) -> Self {
        Self { label: capitalised(label), value, note: note.into() }
    }

    fn html(&self) -> String {
        let Self { label, value, note } = self;
        let title = meaning(label).map_or(String::new(), |meaning| format!(" title=\"{}\"", escaped(meaning)));
        let note = if note.is_empty() { String::new() } else { format!("<small>{}</small>", escaped(note)) };
        format!("<div class=\"card\"{title}><span>{}</span><b>{}</b>{note}</div>\n", escaped(label), escaped(value))
    }
}

/// The cards, what was not measured and why, and what the figures mean.
pub fn html(eval: &EvalFile) -> String {
    let cards: Vec<Card> = quality(eval).into_iter().chain(cost(eval)).chain(figures(eval)).collect();
    let shown: String = cards.iter().map(Card::html).collect();
    let quality = &eval.last.measured.quality;
    let reasons = [&quality.ms_ssim_reason, &quality.lpips_reason].into_iter().flatten();
    let missing: String = reasons.map(|reason| format!("{}. ", escaped(&capitalised(reason)))).collect();
    let missing = if missing.is_empty() { missing } else { format!("<small>{}</small>\n", missing.trim_end()) };
    let tables = eval.last.measured.tables.iter().flat_map(texts);
    let meanings = list(cards.iter().map(|card| card.label.as_str()).chain(tables));
    format!("<section>\n<div class=\"cards\">\n{shown}</div>\n{missing}{meanings}</section>\n")
}

fn quality(eval: &EvalFile) -> Vec<Card> {
    let quality = &eval.last.measured.quality;
    let four = |name: &str, value: f64| Card::new(name, format!("{value:.4}"), "");
    let psnr = shown_psnr(quality.mean.psnr);
    let mut cards =
        vec![Card::new("PSNR", psnr, quality.nothing_to_tell().unwrap_or_default()), four("SSIM", quality.mean.ssim)];
    cards.extend(quality.mean.ms_ssim.map(|value| four("MS-SSIM", value)));
    cards.extend(quality.mean.lpips.map(|value| four("LPIPS", value)));
    cards.extend(quality.regions.iter().map(|(name, scores)| {
        Card::new(&format!("{name} parts"), shown_psnr(scores.psnr), format!("SSIM {:.4} there", scores.ssim))
    }));
    cards
}

fn cost(eval: &EvalFile) -> Vec<Card> {
    let (size, cost) = (&eval.last.measured.size, &eval.last.cost);
    let cap = eval.settings.iter().find(|setting| setting.key == "density.cap");
    let cap = cap.map_or(String::new(), |setting| format!("at most {}", setting.value));
    let cpu = cost.cpu_seconds.map(|cpu| format!("{:.3} CPU seconds a step", cpu / eval.last.step.max(1) as f64));
    let mut cards = vec![
        Card::new("Gaussians", thousands(size.gaussians), cap),
        Card::new("Size", megabytes(size.bytes as u64), "numbers as f32"),
        Card::new("Training time", duration(cost.seconds), cpu.unwrap_or_default()),
    ];
    let predicted = format!("{} predicted", megabytes(eval.predicted_memory_bytes));
    cards.extend(cost.peak_memory_bytes.map(|peak| Card::new("Peak memory", megabytes(peak), predicted)));
    cards
}

/// The method's own.
fn figures(eval: &EvalFile) -> impl Iterator<Item = Card> {
    let headlines = eval.last.measured.figures.iter().filter(|figure| figure.prominence == Prominence::Headline);
    headlines.map(|figure| Card::new(&figure.name, figure.shown(), figure.note.as_str()))
}

/// Everything that is written in a table.
fn texts(table: &FigureTable) -> impl Iterator<Item = &str> + Clone {
    let cells = table.columns.iter().chain(table.rows.iter().flatten());
    std::iter::once(&table.title).chain(cells).map(String::as_str)
}

/// The text with a capital first letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// An integer in groups of three digits.
pub fn thousands(n: usize) -> String {
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

    /// A run over one-coloured photos without the larger measures.
    fn eval() -> EvalFile {
        serde_json::from_str(
            "{\"name\": \"a\", \"dataset\": \"b\", \"device\": \"c\", \"pipeline\": \"static\", \"steps\": 4, \"skipped_steps\": 0, \
             \"predicted_memory_bytes\": 1000, \"total_seconds\": 1, \"evaluations\": [], \"step\": 4, \"split\": \"test\", \"psnr\": 100, \
             \"ssim\": 1, \"ms_ssim\": null, \"lpips\": null, \"compared\": \"photo\", \"lpips_network\": null, \"lpips_reason\": \"no LPIPS: \
             switched off\", \"ms_ssim_reason\": null, \"views\": [], \"gaussians\": 1, \"bytes\": 56, \"seconds\": 1, \"cpu_seconds\": null, \
             \"peak_memory_bytes\": null}",
        )
        .expect("the figures of a run")
    }

    #[test]
    fn only_what_was_measured_has_a_card() {
        let html = html(&eval());
        assert!(!html.contains('–') && !html.contains("<span>LPIPS") && !html.contains("<span>Peak memory"), "{html}");
        assert!(
            html.contains("<small>No LPIPS: switched off.</small>") && html.contains("title=\"peak signal"),
            "{html}"
        );
    }

    #[test]
    fn equal_images_are_no_success() {
        let html = html(&eval());
        assert!(
            html.contains("100 dB or more") && html.contains("nothing to tell") && !html.contains("100.00"),
            "{html}"
        );
        let line = eval().last.line();
        assert!(
            line.contains("100 dB or more (the photos hold nothing to tell") && line.contains(" 1 Gaussian,"),
            "{line}"
        );
    }
}
