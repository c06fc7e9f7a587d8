//! Many runs compared: the Pareto front of accuracy against cost, as charts, tables and page.
//!
//! `seeds` makes one curve of runs that differ in their seed alone, `others` reads the figures of other programs,
//! `panels` and `star` choose colours and labels, `soonest` says when each quality was reached, `scatter` and `labels`
//! draw, `page` writes HTML.

pub mod command;
mod labels;
mod others;
mod page;
mod panels;
mod scatter;
mod seeds;
mod soonest;
mod star;
#[cfg(test)]
mod testing;

pub use others::{Other, read_others};
pub use page::{add_to_report, page, stacked};
pub use seeds::Spread;

use scatter::Scatter;

use gsburn::report::comparison::{Gathered, Table, by_cpu};

/// Runs on one data set compared.
#[derive(Debug)]
pub struct Comparison {
    pub charts: Vec<Scatter>,
    /// Tables: every measurement, means over seeds, costs of qualities.
    pub tables: Vec<Table>,
    /// One sentence for each run that is left out.
    pub warnings: Vec<String>,
}

impl Comparison {
    /// The runs that could be read, beside other programs.
    pub fn new(found: &Gathered, others: &[Other]) -> Self {
        let runs = &found.runs;
        let curves = seeds::curves(runs);
        let mut charts = panels::panels(runs, &curves);
        others::add_others(&mut charts, others);
        let costs = soonest::soonest(&curves, others, by_cpu(runs));
        Self {
            charts,
            tables: std::iter::once(Table::new(runs)).chain(seeds::spreads(&curves)).chain(costs).collect(),
            warnings: found.warnings.clone(),
        }
    }
}
