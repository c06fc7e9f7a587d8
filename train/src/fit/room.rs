//! Room for the (tile, Gaussian) pairs and the tiles of the next step's renderings, from the numbers of the steps
//! before.
//!
//! A GPU that knows the room need not wait for the number in the middle of a step. Room changes no bit of a result, so
//! it is not part of a checkpoint: the first step of a run counts.

use gs_burn::ops::intersect::{DeviceCount, Room};

/// Room over the largest rendering of the last steps. Photos of one scene seldom differ by more, and a step that needs
/// more is done again, at the cost of one step.
const FACTOR: f64 = 1.25;

/// Factor by which the largest rendering is forgotten in a step: half of it after 69 steps, when most photos of a set
/// had their turn.
const FADING: f64 = 0.99;

/// Rooms are multiples of this share of the power of two below them, so that buffers of equal size follow one another.
const STEPS_OF_AN_OCTAVE: usize = 8;

/// Smallest room for pairs: a scene's first steps may show little.
const LEAST_PAIRS: usize = 4096;

/// Smallest room for tiles. There is always room for the tiles of the image.
const LEAST_TILES: usize = STEPS_OF_AN_OCTAVE;

/// The largest rendering of the last steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ListRoom {
    pairs: Option<f64>,
    tiles: Option<f64>,
}

impl ListRoom {
    /// The room for a rendering of the next step; `None` before the first.
    pub fn room(&self) -> Option<Room> {
        let of = |largest: f64, least: usize| {
            let wanted = ((largest * FACTOR) as usize).max(least);
            wanted.next_multiple_of((1 << wanted.ilog2()) / STEPS_OF_AN_OCTAVE)
        };
        Some(Room { pairs: of(self.pairs?, LEAST_PAIRS), tiles: of(self.tiles?, LEAST_TILES) })
    }

    /// Takes note of a step's renderings: the pairs of each, and the tiles of each exposure.
    pub fn observe(&mut self, pairs: &[usize], tiles: &[usize]) {
        for (largest, counts) in [(&mut self.pairs, pairs), (&mut self.tiles, tiles)] {
            let most = counts.iter().max().map_or(0.0, |count| *count as f64);
            *largest = Some(largest.map_or(most, |largest| most.max(FADING * largest)));
        }
    }
}

/// The numbers of `counts`, whose words follow one another in `words`, and whether all had room.
pub fn fitting(counts: &[DeviceCount], words: &[f32]) -> (Vec<usize>, bool) {
    let mut words = words.chunks(2);
    let numbers: Vec<usize> = counts
        .iter()
        .map(|count| match count {
            DeviceCount::Known(number) => *number,
            DeviceCount::OnDevice { .. } => DeviceCount::of_words(words.next().unwrap_or_default()),
        })
        .collect();
    let fit = !counts.iter().zip(&numbers).any(|(count, number)| count.overflows(*number));
    (numbers, fit)
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor};

    use super::*;

    #[test]
    fn room_covers_the_largest_and_forgets_it() {
        let mut room = ListRoom::default();
        assert_eq!(room.room(), None);
        room.observe(&[90_000, 100_000], &[1000]);
        let first = room.room().unwrap();
        assert!((125_000..=125_000 + 65_536 / STEPS_OF_AN_OCTAVE).contains(&first.pairs), "{first:?}");
        assert!((1250..=1250 + 1024 / STEPS_OF_AN_OCTAVE).contains(&first.tiles), "{first:?}");
        room.observe(&[50_000], &[500]);
        assert_eq!(room.room().unwrap(), first, "a smaller rendering changes nothing at once");
        (0..200).for_each(|_| room.observe(&[50_000], &[]));
        let faded = room.room().unwrap();
        assert!(faded.pairs < 80_000 && faded.tiles < 200, "{faded:?}");
        room.observe(&[400_000], &[]);
        assert!(room.room().unwrap().pairs >= 500_000);
    }

    #[test]
    fn room_is_never_nothing() {
        let mut room = ListRoom::default();
        room.observe(&[], &[]);
        assert_eq!(room.room(), Some(Room { pairs: LEAST_PAIRS, tiles: LEAST_TILES }));
    }

    #[test]
    fn words_are_numbers_in_order() {
        let words = Tensor::from_floats([3.0, 7.0], &Device::flex());
        let counts = [
            DeviceCount::Known(5),
            DeviceCount::OnDevice { words: words.clone(), room: 200_000 },
            DeviceCount::OnDevice { words, room: 70_000 },
        ];
        let number = (3 << 16) + 7;
        assert_eq!(fitting(&counts[..2], &[3.0, 7.0]), (vec![5, number], true));
        assert_eq!(fitting(&counts, &[3.0, 7.0, 1.0, 0.0]), (vec![5, number, 65_536], true));
        assert_eq!(fitting(&counts, &[3.0, 7.0, 3.0, 7.0]), (vec![5, number, number], false));
    }
}
