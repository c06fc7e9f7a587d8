//! Square patches of a grey photo, compared by zero-mean normalised cross-correlation.
//!
//! Near a distance of one pixel all pixels of a patch lie at one fraction between those of the photo, and its rows are
//! added up side by side: some ten times as quick as reading each pixel alone.

use glam::DVec2;

/// Half the patch, pixels: 7 x 7.
const RADIUS: i32 = 3;

/// Pixels along a side.
const SIDE: usize = (2 * RADIUS + 1) as usize;

/// Pixels of a patch.
const PATCH: usize = SIDE * SIDE;

/// A row of a [`Patch`]: its pixels, and one that is zero.
const ROW: usize = SIDE + 1;

/// Largest departure from a distance of one pixel at which a [`Patch`] takes one pixel: its corners are then off by a
/// third of a pixel.
const UNIT: f64 = 0.1;

/// Smallest standard deviation of a patch, 0 to 1. Below it the correlation is of noise.
pub(crate) const TEXTURE: f64 = 0.02;

/// The pixels of a reduced grey photo, 0 to 1.
pub(crate) struct Pixels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub values: Vec<f32>,
}

impl Pixels {
    /// The patch around a position, its pixels `spacing` apart, bilinear; `None` where it leaves the photo.
    fn patch(&self, position: DVec2, spacing: f64) -> Option<[f32; PATCH]> {
        let columns = between(position.x, spacing, self.width)?;
        let rows = between(position.y, spacing, self.height)?;
        let mut values = [0.0; PATCH];
        for (out, (row, v)) in values.chunks_exact_mut(SIDE).zip(rows) {
            let above = &self.values[row * self.width..][..self.width];
            let below = &self.values[(row + 1) * self.width..][..self.width];
            for (value, (column, u)) in out.iter_mut().zip(columns) {
                let across = |pixels: &[f32]| pixels[column] * (1.0 - u) + pixels[column + 1] * u;
                *value = across(above) * (1.0 - v) + across(below) * v;
            }
        }
        Some(values)
    }

    /// The patch around a position, its pixels one apart; `None` where it leaves the photo.
    fn unit_patch(&self, position: DVec2) -> Option<[[f32; ROW]; SIDE]> {
        let (x, y) = (position.x - 0.5 - f64::from(RADIUS), position.y - 0.5 - f64::from(RADIUS));
        // One pixel more than the patch has, between which the last ones lie.
        let inside = x >= 0.0 && y >= 0.0 && x < (self.width.checked_sub(SIDE)?) as f64;
        if !(inside && y < (self.height.checked_sub(SIDE)?) as f64) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (u, v) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let across = |row: usize| -> [f32; ROW] {
            let pixels = &self.values[row * self.width + column..][..ROW];
            let mut out = [0.0; ROW];
            for i in 0..SIDE {
                out[i] = pixels[i] + u * (pixels[i + 1] - pixels[i]);
            }
            out
        };
        let mut above = across(row);
        let mut rows = [[0.0; ROW]; SIDE];
        for (i, out) in rows.iter_mut().enumerate() {
            let below = across(row + i + 1);
            for (out, (a, b)) in out.iter_mut().zip(above.iter().zip(&below)) {
                *out = a + v * (b - a);
            }
            above = below;
        }
        Some(rows)
    }
}

/// Along one axis of a photo of `size` pixels: the pixel before each position of a patch around `middle`, and how far
/// beyond its centre the position is; `None` where the patch leaves the photo.
fn between(middle: f64, spacing: f64, size: usize) -> Option<[(usize, f32); SIDE]> {
    let mut places = [(0, 0.0); SIDE];
    for (place, offset) in places.iter_mut().zip(-RADIUS..=RADIUS) {
        let at = middle + spacing * f64::from(offset) - 0.5;
        if !(at >= 0.0 && at < size as f64 - 1.0) {
            return None;
        }
        *place = (at as usize, (at - (at as usize) as f64) as f32);
    }
    Some(places)
}

/// A patch minus its mean, of length 1 (or 0, if it is even), and its former standard deviation.
pub(crate) struct Patch {
    rows: [[f32; ROW]; SIDE],
    deviation: f64,
}

impl Patch {
    /// The patch around a position in pixels, its pixels `spacing` apart; `None` where it leaves the photo.
    pub fn around(photo: &Pixels, position: DVec2, spacing: f64) -> Option<Self> {
        let mut rows = if (spacing - 1.0).abs() <= UNIT {
            photo.unit_patch(position)?
        } else {
            let values = photo.patch(position, spacing)?;
            let mut rows = [[0.0; ROW]; SIDE];
            rows.iter_mut()
                .zip(values.chunks_exact(SIDE))
                .for_each(|(row, values)| row[..SIDE].copy_from_slice(values));
            rows
        };
        let mean = total(|i| rows[i]) / PATCH as f32;
        // The last of a row stays zero.
        rows.iter_mut().for_each(|row| row[..SIDE].iter_mut().for_each(|value| *value -= mean));
        let length = total(|i| rows[i].map(|value| value * value)).sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        rows.iter_mut().for_each(|row| row.iter_mut().for_each(|value| *value *= scale));
        Some(Self { rows, deviation: f64::from(length) / (PATCH as f64).sqrt() })
    }

    /// Standard deviation of its values.
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// Correlation with another, -1 to 1; 0 if either is even.
    pub fn correlation(&self, other: &Self) -> f64 {
        let product = |i: usize| std::array::from_fn(|k| self.rows[i][k] * other.rows[i][k]);
        f64::from(total(product))
    }
}

/// The sum of rows, side by side first.
fn total(row: impl Fn(usize) -> [f32; ROW]) -> f32 {
    let mut sums = [0.0; ROW];
    for i in 0..SIDE {
        let row = row(i);
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photo() -> Pixels {
        let values = (0..20 * 15).map(|i| ((i * 7919) % 251) as f32 / 251.0).collect();
        Pixels { width: 20, height: 15, values }
    }

    /// A patch pixel by pixel: its values minus their mean, of length 1, and their standard deviation.
    fn plain(photo: &Pixels, position: DVec2, spacing: f64) -> Option<(Vec<f32>, f64)> {
        let values = photo.patch(position, spacing)?;
        let mean = values.iter().sum::<f32>() / PATCH as f32;
        let length = values.iter().map(|value| (value - mean).powi(2)).sum::<f32>().sqrt();
        let unit = values.iter().map(|value| (value - mean) / length).collect();
        Some((unit, f64::from(length) / (PATCH as f64).sqrt()))
    }

    /// Positions inside, and where the patch leaves the photo; distances of one pixel and of two thirds.
    #[test]
    fn rows_agree_with_single_pixels() {
        let photo = photo();
        for (x, y) in [(5.5, 6.5), (8.3, 7.9), (3.5, 3.5), (16.4, 11.4), (10.0, 4.2)] {
            for spacing in [1.0, 2.0 / 3.0] {
                let of = |x: f64, y: f64| {
                    let at = DVec2::new(x, y);
                    (plain(&photo, at, spacing), Patch::around(&photo, at, spacing))
                };
                let ((Some(a), Some(b)), (Some(c), Some(d))) = (of(x, y), of(9.1, 8.2)) else {
                    panic!("inside: {x} {y}")
                };
                let correlation = f64::from(a.0.iter().zip(&c.0).map(|(a, c)| a * c).sum::<f32>());
                // Sums of 49 values of about 1 in another order.
                assert!((a.1 - b.deviation()).abs() < 1e-5, "{x} {y}");
                assert!((correlation - b.correlation(&d)).abs() < 1e-5, "{x} {y}");
                assert!((b.correlation(&b) - 1.0).abs() < 1e-5);
            }
        }
        for (x, y) in [(3.4, 6.0), (6.0, 3.4), (16.6, 6.0), (6.0, 11.6), (f64::NAN, 6.0), (-50.0, 1e9)] {
            let at = DVec2::new(x, y);
            assert!(plain(&photo, at, 1.0).is_none() && Patch::around(&photo, at, 1.0).is_none(), "{x} {y}");
        }
        let small = Pixels { width: 3, height: 3, values: vec![0.5; 9] };
        assert!(Patch::around(&small, DVec2::splat(1.5), 1.0).is_none());
    }
}
