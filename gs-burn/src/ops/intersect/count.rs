//! A number that sizes a rendering's lists, which a device may still hold.

use burn::tensor::Tensor;

/// Number of (tile, Gaussian) pairs of a rendering, or of the tiles drawn for an exposure.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // there is one per rendering
pub enum DeviceCount {
    /// The lists were made for this number.
    Known(usize),
    /// The lists were made with `room` without reading the number.
    OnDevice {
        /// `[2]`: the number's higher and lower 16 bits, both exact in `f32`.
        words: Tensor<1>,
        /// Largest number that fits.
        room: usize,
    },
}

impl DeviceCount {
    /// The number; waits for the device if it holds it.
    pub fn get(&self) -> usize {
        match self {
            Self::Known(count) => *count,
            Self::OnDevice { words, .. } => Self::of_words(&words.to_data().iter::<f32>().collect::<Vec<_>>()),
        }
    }

    /// The number's words, `[2]`, for a caller that reads other numbers too; `None` if it is known.
    pub fn words(&self) -> Option<Tensor<1>> {
        match self {
            Self::Known(_) => None,
            Self::OnDevice { words, .. } => Some(words.clone()),
        }
    }

    /// The number of which `words` are the higher and lower 16 bits.
    pub fn of_words(words: &[f32]) -> usize {
        words.iter().fold(0, |number, word| (number << 16) + *word as usize)
    }

    /// Whether a rendering with the number `count` drew nothing, because the lists had no room for it.
    pub fn overflows(&self, count: usize) -> bool {
        matches!(self, Self::OnDevice { room, .. } if count > *room)
    }
}
