//! Figures and tables of a measurement, which evaluation files, reports and charts show without knowing the method.

use serde::{Deserialize, Serialize};

/// The direction of an improvement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Higher is better.
    Higher,
    /// Lower is better.
    Lower,
}

/// The pages that show a figure, beside eval.json, which has all.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Prominence {
    /// In eval.json alone.
    #[default]
    File,
    /// As a column of comparisons too.
    Column,
    /// As a card of the report, in the line of a measurement, and as a column.
    Headline,
}

/// One measured number, beside image quality.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// Name in files, in snake case.
    pub key: String,
    /// Name for people.
    pub name: String,
    /// The value, in `unit`.
    pub value: f64,
    /// The unit; empty for counts and for shares from 0 to 1.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Digits after the decimal point when shown.
    #[serde(default)]
    pub digits: usize,
    /// The direction of an improvement; `None` for a figure without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub better: Option<Better>,
    /// The pages that show it.
    #[serde(default)]
    pub prominence: Prominence,
    /// A remark shown with it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
}

impl Figure {
    /// A figure that is in eval.json alone.
    pub fn new(key: &str, name: &str, value: f64, unit: &str) -> Self {
        Self {
            key: key.into(),
            name: name.into(),
            value,
            unit: unit.into(),
            digits: 0,
            better: None,
            prominence: Prominence::File,
            note: String::new(),
        }
    }

    /// The figure with `digits` after the decimal point.
    pub fn digits(self, digits: usize) -> Self {
        Self { digits, ..self }
    }

    /// The figure with a direction of improvement.
    pub fn better(self, better: Better) -> Self {
        Self { better: Some(better), ..self }
    }

    /// The figure as a card, in the line of a measurement and as a column.
    pub fn headline(self) -> Self {
        Self { prominence: Prominence::Headline, ..self }
    }

    /// The figure as a column of comparisons.
    pub fn column(self) -> Self {
        Self { prominence: Prominence::Column, ..self }
    }

    /// The figure with a remark.
    pub fn note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// Value and unit.
    pub fn shown(&self) -> String {
        let space = if self.unit.is_empty() || self.unit == "°" { "" } else { " " };
        format!("{:.*}{space}{}", self.digits, self.value, self.unit)
    }
}

/// A small table of the report.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FigureTable {
    /// Its title.
    pub title: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Cells, one per column.
    pub rows: Vec<Vec<String>>,
}

impl FigureTable {
    /// The table for a terminal: title and columns, then a line for each row.
    pub fn lines(&self) -> Vec<String> {
        let head = format!("{}: {}", self.title, self.columns.join(" | "));
        [head].into_iter().chain(self.rows.iter().map(|row| format!("  {}", row.join(" | ")))).collect()
    }
}

/// All figures and tables of a method.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// The numbers.
    pub numbers: Vec<Figure>,
    /// The tables.
    pub tables: Vec<FigureTable>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_shown_with_its_unit() {
        assert_eq!(Figure::new("a", "A", 2.345, "dB").digits(2).shown(), "2.35 dB");
        assert_eq!(Figure::new("a", "A", 2.345, "°").digits(1).shown(), "2.3°");
        assert_eq!(Figure::new("a", "A", 7.0, "").shown(), "7");
    }
}
