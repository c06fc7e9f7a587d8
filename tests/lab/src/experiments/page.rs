//! The report as one HTML file that needs no other file and no network.

use std::fmt::Write as _;

use gsburn::report::html::{self, escaped};

use crate::experiments::Outcome;

/// The whole page: a table of all bounds, then each experiment with its figures.
pub(super) fn html(pipeline: &str, outcomes: &[Outcome], quick: bool) -> String {
    let criteria = || outcomes.iter().flat_map(|outcome| &outcome.criteria);
    let missed = criteria().filter(|criterion| !criterion.passed).count();
    let mut page = format!(
        "<header>\n<h1>Where {pipeline} fails</h1>\n<p>{} experiments, {} bounds, {missed} of them \
         missed.{}</p>\n</header>\n",
        outcomes.len(),
        criteria().count(),
        if quick { " A quick look: fewer variants and steps than a measurement takes." } else { "" }
    );
    page.push_str("<section>\n<h2>Bounds</h2>\n<table>\n<tr><th>experiment</th><th>what</th><th>bound</th>");
    page.push_str("<th>measured</th><th>verdict</th></tr>\n");
    for outcome in outcomes {
        for criterion in &outcome.criteria {
            let verdict = criterion.verdict();
            let verdict = if criterion.passed { verdict.into() } else { format!("<strong>{verdict}</strong>") };
            // Writing to a string does not fail.
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{verdict}</td></tr>",
                escaped(&outcome.name),
                escaped(&criterion.what),
                escaped(&criterion.bound),
                escaped(&criterion.shown())
            );
        }
    }
    page.push_str("</table>\n</section>\n");
    for outcome in outcomes {
        section(&mut page, outcome);
    }
    html::page("Stability", "", &page)
}

fn section(page: &mut String, outcome: &Outcome) {
    let _ = writeln!(page, "<section>\n<h2>{}</h2>\n<p>{}</p>", escaped(&outcome.name), escaped(&outcome.question));
    page.push_str("<ul>\n");
    for criterion in &outcome.criteria {
        let _ = writeln!(
            page,
            "<li><strong>{}</strong>: {}, {}; measured {}.</li>",
            criterion.verdict(),
            escaped(&criterion.what),
            escaped(&criterion.bound),
            escaped(&criterion.shown())
        );
    }
    for note in &outcome.notes {
        let _ = writeln!(page, "<li>{}</li>", escaped(note));
    }
    page.push_str("</ul>\n<div class=\"plots\">\n");
    for figure in &outcome.figures {
        let _ = writeln!(page, "<figure>{}</figure>", figure.svg);
    }
    page.push_str("</div>\n</section>\n");
}
