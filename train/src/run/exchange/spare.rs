//! Gaussians that a file is better without.

use std::path::Path;

use gs_base::{agree, counted};
use gs_splats::spz;

use super::{Format, Packed};

/// The rows of `count` that are not in `rows`, which rise.
pub(super) fn others(count: usize, rows: &[u32]) -> Vec<u32> {
    let mut rows = rows.iter().peekable();
    (0..count as u32).filter(|row| rows.next_if_eq(&row).is_none()).collect()
}

impl Packed {
    /// The rows that a file of this format is to hold: all, but for SPZ where a few Gaussians are so far from the
    /// others that they would coarsen the positions of all. What is left out is said, with the option that keeps it.
    pub fn spared(&self, path: &Path, format: Format) -> Option<Vec<u32>> {
        let far = (format == Format::Spz).then(|| spz::far(&self.splats)).flatten()?;
        let (count, all) = (far.rows.len(), self.splats.len());
        let it = agree(count, "it", "them");
        let cost = match spz::fractional_bits(&self.splats).map(step_of) {
            Some(step) => format!("--keep-far keeps {it} and rounds all positions to {step} units"),
            None => format!("no SPZ file holds {it}, .ply and .glb do"),
        };
        let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        tracing::warn!(
            "{}: {} of {all} {} left out (row {}{more}): {} units or more from the middle of the scene, where 95 % lie \
             within {} units; {cost}",
            path.display(),
            counted(count, "Gaussian"),
            agree(count, "was", "were"),
            far.rows[0],
            rounded(far.distance),
            rounded(far.reach),
        );
        Some(others(all, &far.rows))
    }

    /// Notes on a file that was written: its offset, and how SPZ rounds.
    pub fn notes(&self, format: Format) -> Vec<String> {
        let mut notes: Vec<String> = super::offset_note(self.splats.offset).into_iter().collect();
        if let Some(bits) = spz::fractional_bits(&self.splats).filter(|_| format == Format::Spz) {
            let farthest = self.splats.means.iter().flatten().fold(0.0_f32, |most, x| most.max(x.abs()));
            let why = format!(", since one is {} units from the origin", rounded(f64::from(farthest)));
            let why = if bits < spz::FRACTIONAL_BITS { why } else { String::new() };
            notes.push(format!("positions in steps of {} units{why}", step_of(bits)));
            let count = spz::oversized(&self.splats);
            if count > 0 {
                notes.push(format!("{} cut to the largest size of SPZ, 379 units", counted(count, "Gaussian")));
            }
        }
        notes
    }
}

/// A step as the fraction that it is.
fn step_of(bits: u32) -> String {
    if bits == 0 { "1".into() } else { format!("1/{}", 1_u32 << bits) }
}

/// Three digits, without an exponent up to a million.
fn rounded(x: f64) -> String {
    if (0.001..1e6).contains(&x) {
        let digits = (2.0 - x.log10().floor()).max(0.0) as usize;
        format!("{x:.digits$}")
    } else {
        format!("{x:.2e}")
    }
}
