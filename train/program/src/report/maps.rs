//! Depth and other numbers in colour, and animated GIFs.

use std::path::Path;

use anyhow::{Context, Result};
use gs_base::write_atomic;

use gs_train::run::outputs::MARK;

/// Share of the seen pixels at each end of the depth range that the colours do not spread over: a few wrong pixels must
/// not flatten the rest.
const DEPTH_TAILS: f64 = 0.02;

/// Alpha below which a pixel shows nothing: it is drawn black or grey.
pub const ALPHA_SEEN: f32 = 0.5;

/// Delay between the frames of a GIF, hundredths of a second: about 12 frames a second.
const GIF_DELAY: u16 = 8;

/// Depth `[H * W]` in colour, `[H * W * 3]`: near yellow, far violet (viridis over inverse depth), black where alpha is
/// low.
pub fn depth_colors(depth: &[f32], alpha: &[f32]) -> Vec<u8> {
    let seen = |(depth, alpha): &(&f32, &f32)| **alpha >= ALPHA_SEEN && **depth > 0.0 && depth.is_finite();
    let mut inverse: Vec<f32> = depth.iter().zip(alpha).filter(seen).map(|(depth, _)| 1.0 / depth).collect();
    inverse.sort_by(f32::total_cmp);
    let at = |share: f64| inverse.get((share * inverse.len() as f64) as usize).or(inverse.last()).copied();
    let (low, high) = (at(DEPTH_TAILS).unwrap_or(0.0), at(1.0 - DEPTH_TAILS).unwrap_or(1.0));
    let span = (high - low).max(f32::MIN_POSITIVE);
    depth
        .iter()
        .zip(alpha)
        .flat_map(|pixel| {
            if !seen(&pixel) {
                return [0; 3];
            }
            viridis((1.0 / pixel.0 - low) / span)
        })
        .collect()
}

/// Anchors of the viridis colour map, evenly spaced.
const VIRIDIS: [[f32; 3]; 6] = [
    [68.0, 1.0, 84.0],
    [65.0, 68.0, 135.0],
    [42.0, 120.0, 142.0],
    [34.0, 168.0, 132.0],
    [122.0, 209.0, 81.0],
    [253.0, 231.0, 37.0],
];

/// The colour of a share from 0 (violet) to 1 (yellow).
fn viridis(share: f32) -> [u8; 3] {
    let position = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f32;
    let below = (position as usize).min(VIRIDIS.len() - 2);
    let part = position - below as f32;
    [0, 1, 2].map(|c| (VIRIDIS[below][c] * (1.0 - part) + VIRIDIS[below + 1][c] * part + 0.5) as u8)
}

/// Values `[H * W]` in colour, violet at 0 and yellow at `full`; mid grey where alpha is low.
pub fn scalar_colors(values: &[f32], alpha: &[f32], full: f32) -> Vec<u8> {
    let color = |(value, alpha): (&f32, &f32)| match *alpha >= ALPHA_SEEN && value.is_finite() {
        true => viridis(value / full),
        false => [127; 3],
    };
    values.iter().zip(alpha).flat_map(color).collect()
}

/// Writes frames `[H * W * 3]` as a GIF that loops.
///
/// # Errors
/// When the image is larger than a GIF can be, or cannot be written.
pub fn write_gif(path: &Path, width: usize, height: usize, frames: &[Vec<u8>]) -> Result<()> {
    let side = |pixels: usize| {
        u16::try_from(pixels).with_context(|| format!("{}: a GIF has at most 65535 pixels a side", path.display()))
    };
    let (width, height) = (side(width)?, side(height)?);
    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, width, height, &[])?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    encoder.write_raw_extension(gif::Extension::Comment.into(), &[MARK.as_bytes()])?;
    for pixels in frames {
        let mut frame = gif::Frame::from_rgb(width, height, pixels);
        frame.delay = GIF_DELAY;
        encoder.write_frame(&frame)?;
    }
    drop(encoder);
    Ok(write_atomic(path, &bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_order_depth() {
        let depth: Vec<f32> = (1..=100).map(|i| i as f32).collect();
        let colors = depth_colors(&depth, &[1.0; 100]);
        let brightness = |i: usize| colors[3 * i..][..3].iter().map(|c| u32::from(*c)).sum::<u32>();
        assert!(brightness(1) > brightness(50) && brightness(50) > brightness(99));
        assert_eq!(depth_colors(&[1.0, f32::NAN, -1.0], &[0.0, 1.0, 1.0]), [0; 9]);
    }
}
