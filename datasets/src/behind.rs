//! The colour behind transparent pixels, and the levels of a photo that become black and white.

use crate::light::{to_encoded, to_linear};

/// The background of transparent pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Behind {
    /// Encoded, 0 to 1 per channel.
    pub color: [f32; 3],
    /// Whether alpha is a share of light, as where things moved while the shutter was open: at a blurred edge it says
    /// for how long the background was seen. Otherwise encoded values are mixed, as those who publish still scenes do.
    pub is_light: bool,
    /// The levels that become black and white, as shares of the full range; `None`: 0 and 1.
    pub levels: Option<[f64; 2]>,
}

impl Behind {
    /// Black, mixed with encoded values, over the full range.
    pub const BLACK: Self = Self { color: [0.0; 3], is_light: false, levels: None };

    /// A photo's value, 0 to 1, between the levels.
    pub fn stretch(self, value: f32) -> f32 {
        let Some([black, white]) = self.levels else { return value };
        ((f64::from(value) - black) / (white - black)).clamp(0.0, 1.0) as f32
    }

    pub fn mix(self, value: f32, channel: usize, alpha: f32) -> f32 {
        let behind = self.color[channel];
        if self.is_light && alpha > 0.0 && alpha < 1.0 {
            to_encoded(to_linear(value) * alpha + to_linear(behind) * (1.0 - alpha))
        } else {
            value * alpha + behind * (1.0 - alpha)
        }
    }
}
