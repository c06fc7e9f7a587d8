//! Figures of other programs, beside which runs are charted: published ones, or measured with their own tools.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use gs_base::printable;

use super::scatter::{COLORS, Dot, Scatter};

/// First line of the file.
pub const HEADER: &str = "program,seconds,psnr";

/// A program's measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Other {
    pub name: String,
    /// Seconds of training and held-out PSNR, dB, in the order of the file.
    pub points: Vec<(f64, f64)>,
}

/// Reads a CSV file of `program,seconds,psnr`; rows of one program are its measurements in order.
///
/// # Errors
/// When the file cannot be read, or a line is not as the first one says; the sentence names it.
pub fn read_others(path: &Path) -> Result<Vec<Other>> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut others: Vec<Other> = Vec::new();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        if number == 0 {
            if line.trim() != HEADER {
                bail!("{}: expected the first line {HEADER}, found {}", path.display(), printable(line));
            }
            continue;
        }
        let Some((name, point)) = parsed(line) else {
            let (at, line) = (number + 1, printable(line));
            bail!("{} line {at}: expected a name, positive seconds and a PSNR in dB, found {line}", path.display());
        };
        match others.iter_mut().find(|other| other.name == name) {
            Some(other) => other.points.push(point),
            None => others.push(Other { name: name.into(), points: vec![point] }),
        }
    }
    match others.is_empty() {
        true => bail!("{}: expected figures of other programs, found none", path.display()),
        false => Ok(others),
    }
}

fn parsed(line: &str) -> Option<(&str, (f64, f64))> {
    // A name may have commas; the last two cells are numbers.
    let mut cells = line.rsplitn(3, ',').map(str::trim);
    let [psnr, seconds] = [cells.next()?.parse::<f64>().ok()?, cells.next()?.parse::<f64>().ok()?];
    let name = cells.next().filter(|name| !name.is_empty())?;
    (seconds.is_finite() && seconds > 0.0 && psnr.is_finite()).then_some((name, (seconds, psnr)))
}

/// Adds the measurements of other programs to the chart of whole images against time.
pub fn add_others(charts: &mut [Scatter], others: &[Other]) {
    let color = COLORS.len() - 1;
    for chart in charts.iter_mut().filter(|chart| chart.is_of_whole_images()) {
        for Other { name, points } in others {
            for (k, (x, y)) in points.iter().copied().enumerate() {
                let last = k + 1 == points.len();
                let tip = format!("{name}: {y:.2} dB at {x:.1}");
                let label = last.then(|| name.clone());
                chart.dots.push(Dot { x, y, range: None, color, label, last, front: false, tip });
            }
            chart.trails.push((color, points.clone()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::panels::panels;
    use crate::comparison::seeds::curves;
    use crate::comparison::soonest::soonest;
    use crate::comparison::testing::run;

    fn read(text: &str) -> Result<Vec<Other>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("others.csv");
        fs::write(&path, text).expect("written");
        read_others(&path)
    }

    #[test]
    fn rows_of_a_program_are_its_curve() {
        let others =
            read("program,seconds,psnr\nOpenSplat, 330, 26.28\nBrush, on a CPU,750,25.7\n\nOpenSplat,1100,27.25\n");
        let others = others.expect("a valid file");
        let expected = [("OpenSplat", vec![(330.0, 26.28), (1100.0, 27.25)]), ("Brush, on a CPU", vec![(750.0, 25.7)])];
        assert_eq!(others, expected.map(|(name, points)| Other { name: name.into(), points }));
        let ours = [run("ours", 30.0, None)];
        let mut charts = panels(&ours, &curves(&ours));
        let before = charts[0].dots.len();
        add_others(&mut charts, &others);
        let chart = &charts[0];
        assert_eq!(chart.dots.len(), before + 3);
        assert!(chart.dots.iter().any(|dot| dot.label.as_deref() == Some("OpenSplat") && dot.last));
        let tables = soonest(&curves(&ours), &others, true);
        let table = tables.first().expect("one of them has a curve");
        assert_eq!(table.rows.last().map(|row| row[0].as_str()), Some("Brush, on a CPU"));
    }

    #[test]
    fn what_is_not_a_figure_gets_a_sentence() {
        for (text, found) in [
            ("name,time\n", "expected the first line"),
            ("program,seconds,psnr\nA,0,20\n", "line 2"),
            ("program,seconds,psnr\nA,10,nan\n", "line 2"),
            ("program,seconds,psnr\n,10,20\n", "line 2"),
            ("program,seconds,psnr\n", "found none"),
        ] {
            let error = format!("{:#}", read(text).expect_err(text));
            assert!(error.contains(found), "{error}");
        }
    }
}
