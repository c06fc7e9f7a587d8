//! Seeded numbers that are the same on every device and machine.

/// Steele, Lea and Flood 2014: a counter and a mixing function, no other state.
#[derive(Debug, Clone)]
pub(crate) struct SplitMix64(u64);

impl SplitMix64 {
    /// The stream of `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Stream `index` of `seed`, for work that is split over threads.
    pub(crate) fn stream(seed: u64, index: u64) -> Self {
        // The seed is mixed first: seeds that differ by one would otherwise share all but one of their streams.
        let mixed = Self(seed).bits();
        Self(Self(mixed ^ index).bits())
    }

    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
