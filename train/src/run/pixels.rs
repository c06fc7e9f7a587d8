//! Images and vectors as pictures of 8 bits.

use burn::tensor::Tensor;

use crate::fit::parameters::to_host;

/// Share of pixels whose speed may exceed the brightest colour.
const SPEED_TAIL: f64 = 0.005;

/// An image `[H, W, C]` from 0 to 1 as 8 bits, rounded to nearest.
pub fn image_bytes(image: Tensor<3>) -> Vec<u8> {
    to_bytes(&to_host(image))
}

/// Values from 0 to 1 as 8 bits, rounded to nearest.
pub fn to_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect()
}

/// Velocities `[H * W * 3]` in colour: mid grey is at rest; red, green and blue are the world's axes, brighter along
/// them and darker against them.
pub fn velocity_colors(velocity: &[f32]) -> Vec<u8> {
    vector_colors(velocity, full_speed(velocity))
}

/// [`velocity_colors`] of any vectors, of which the brightest colours have the length `full`.
pub fn vector_colors(vectors: &[f32], full: f32) -> Vec<u8> {
    let rows = vectors.as_chunks::<3>().0;
    rows.iter().flat_map(|v| v.map(|x| (127.5 + 127.5 * (x / full).clamp(-1.0, 1.0)) as u8)).collect()
}

/// The length of the brightest colour in a map of vectors `[H * W * 3]`: few are longer.
pub fn full_speed(vectors: &[f32]) -> f32 {
    let lengths = vectors.as_chunks::<3>().0.iter().map(|v| v.iter().map(|x| x * x).sum::<f32>().sqrt());
    full_scale(lengths.collect())
}

/// The value of the brightest colour in a map: few are larger.
pub fn full_scale(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    let index = ((1.0 - SPEED_TAIL) * values.len() as f64) as usize;
    values.get(index).or(values.last()).copied().unwrap_or(1.0).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_round_to_nearest() {
        assert_eq!(to_bytes(&[-1.0, 0.0, 0.5, 1.0, 2.0, 1.0 / 255.0]), [0, 0, 128, 255, 255, 1]);
    }

    #[test]
    fn colours_show_directions() {
        assert_eq!(velocity_colors(&[0.0; 3]), [127; 3]);
        assert_eq!(velocity_colors(&[1.0, 0.0, 0.0]), [255, 127, 127]);
        assert_eq!(velocity_colors(&[0.0, 0.0, -1.0]), [127, 127, 0]);
    }
}
