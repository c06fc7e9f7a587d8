//! The state that the units of a cube share.

use super::code::Code;
use super::memory::{Memory, Toucher};
use super::value::Space;

/// A part of an allocation that a kernel binds.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Number of the allocation.
    pub memory: usize,
    /// First word.
    pub at: usize,
    /// Words.
    pub len: usize,
}

/// The cube, its memory and the launch.
pub(super) struct Around<'a> {
    pub code: &'a Code,
    pub bindings: &'a [Binding],
    pub memories: &'a mut [Memory],
    pub shared: &'a mut [Memory],
    pub launch: u32,
    pub cube: u32,
    /// Barriers that the cube has passed, of shared memory and of buffers.
    pub phases: [u32; 2],
    /// Whether shared memory that nobody has written may be read, and whether it was.
    pub forgiving: bool,
    pub forgave: bool,
}

impl Around<'_> {
    pub fn toucher(&self, unit: u32, space: Space, atomic: bool) -> Toucher {
        let phase = self.phases[usize::from(matches!(space, Space::Buffer(_)))];
        Toucher { launch: self.launch, cube: self.cube, unit, phase, atomic }
    }

    /// Words behind the beginning of a space.
    pub fn len(&self, space: Space, own: usize) -> usize {
        match space {
            Space::Own => own,
            Space::Shared(k) => self.shared[k as usize].words().len(),
            Space::Buffer(k) => self.bindings.get(k as usize).map_or(0, |binding| binding.len),
        }
    }

    pub fn memory(&mut self, space: Space, at: usize) -> (&mut Memory, usize) {
        match space {
            Space::Shared(k) => (&mut self.shared[k as usize], at),
            Space::Buffer(k) => {
                let binding = self.bindings[k as usize];
                (&mut self.memories[binding.memory], binding.at + at)
            }
            Space::Own => unreachable!("a unit's own variables are its own"),
        }
    }
}
