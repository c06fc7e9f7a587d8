//! Words of memory that know who touched them.

use super::fault::Wrong;

/// Stands for several units, or several cubes.
const SEVERAL: u32 = u32::MAX;

/// The last touches of one kind of a word, as one.
#[derive(Clone, Copy, Default)]
struct Touch {
    any: bool,
    /// Whether all of them were atomic.
    atomic: bool,
    cube: u32,
    unit: u32,
    phase: u32,
}

/// Who touches a word, and how.
#[derive(Clone, Copy)]
pub(super) struct Toucher {
    /// Number of the launch; what an earlier launch touched is in order.
    pub launch: u32,
    pub cube: u32,
    pub unit: u32,
    /// Barriers of this kind of memory that the cube has passed.
    pub phase: u32,
    pub atomic: bool,
}

impl Touch {
    /// Whether no barrier lies between these touches and the next one, and not all are of one unit.
    fn meets(&self, by: &Toucher) -> bool {
        self.any && (self.cube != by.cube || self.phase == by.phase && self.unit != by.unit)
    }

    fn add(&mut self, by: &Toucher) {
        let Toucher { cube, unit, phase, atomic, .. } = *by;
        let same = self.any && self.cube == cube && self.phase == phase;
        if !self.any || self.cube == cube && self.phase != phase {
            *self = Self { any: true, atomic, cube, unit, phase };
        } else if !same {
            self.cube = SEVERAL;
        } else if self.unit != unit {
            self.unit = SEVERAL;
        }
        self.atomic &= atomic;
    }
}

#[derive(Clone, Copy, Default)]
struct Seen {
    launch: u32,
    written: bool,
    read: Touch,
    write: Touch,
}

/// One allocation of a device, or one shared variable of a cube.
#[derive(Clone, Default)]
pub struct Memory {
    words: Vec<u32>,
    seen: Vec<Seen>,
}

impl Memory {
    /// Words that nobody has written; their values come from `garbage`.
    pub fn unwritten(len: usize, mut garbage: impl FnMut() -> u32) -> Self {
        Self { words: (0..len).map(|_| garbage()).collect(), seen: vec![Seen::default(); len] }
    }

    /// Words that the host has written.
    pub fn of(words: Vec<u32>) -> Self {
        let seen = vec![Seen { written: true, ..Seen::default() }; words.len()];
        Self { words, seen }
    }

    /// The words, as the host reads them.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Whether each of these words was written.
    pub fn all_written(&self, range: std::ops::Range<usize>) -> bool {
        self.seen[range].iter().all(|seen| seen.written)
    }

    /// Writes from the host.
    pub fn put(&mut self, at: usize, words: &[u32]) {
        self.words[at..at + words.len()].copy_from_slice(words);
        self.seen[at..at + words.len()].iter_mut().for_each(|seen| seen.written = true);
    }

    /// All words are as if never written: the cube is another one.
    pub(super) fn forget(&mut self, mut garbage: impl FnMut() -> u32) {
        self.words.iter_mut().for_each(|word| *word = garbage());
        self.seen.fill(Seen::default());
    }

    fn seen(&mut self, at: usize, by: &Toucher) -> &mut Seen {
        let seen = &mut self.seen[at];
        if seen.launch != by.launch {
            *seen = Seen { launch: by.launch, written: seen.written, ..Seen::default() };
        }
        seen
    }

    /// The word and whether it was written.
    pub(super) fn load(&mut self, at: usize, by: &Toucher) -> Result<(u32, bool), Wrong> {
        let seen = self.seen(at, by);
        let written = seen.written;
        if seen.write.meets(by) && !(by.atomic && seen.write.atomic) {
            return Err(Wrong::Race);
        }
        seen.read.add(by);
        Ok((self.words[at], written))
    }

    pub(super) fn store(&mut self, at: usize, word: u32, by: &Toucher) -> Result<(), Wrong> {
        let seen = self.seen(at, by);
        let races = |touch: &Touch| touch.meets(by) && !(by.atomic && touch.atomic);
        if races(&seen.write) || races(&seen.read) {
            return Err(Wrong::Race);
        }
        seen.written = true;
        seen.write.add(by);
        self.words[at] = word;
        Ok(())
    }
}
