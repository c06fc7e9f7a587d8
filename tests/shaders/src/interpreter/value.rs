//! Values of a unit.

/// Kind of a scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    U32,
    I32,
    F32,
}

impl Kind {
    pub fn of(kind: naga::ScalarKind) -> Option<Self> {
        match kind {
            naga::ScalarKind::Bool => Some(Self::Bool),
            naga::ScalarKind::Uint => Some(Self::U32),
            naga::ScalarKind::Sint => Some(Self::I32),
            naga::ScalarKind::Float => Some(Self::F32),
            _ => None,
        }
    }
}

/// A scalar, or a vector of up to four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Words {
    pub kind: Kind,
    pub len: u8,
    pub words: [u32; 4],
}

impl Words {
    pub fn scalar(kind: Kind, word: u32) -> Self {
        Self { kind, len: 1, words: [word, 0, 0, 0] }
    }

    pub fn of(kind: Kind, words: &[u32]) -> Self {
        let mut own = [0; 4];
        own[..words.len()].copy_from_slice(words);
        Self { kind, len: words.len() as u8, words: own }
    }

    pub fn slice(&self) -> &[u32] {
        &self.words[..self.len as usize]
    }

    /// Element by element.
    pub fn map(self, kind: Kind, f: impl Fn(u32) -> u32) -> Self {
        let mut words = [0; 4];
        words.iter_mut().zip(self.slice()).for_each(|(word, own)| *word = f(*own));
        Self { kind, len: self.len, words }
    }

    /// Element by element with another value of as many.
    pub fn zip(self, other: Self, kind: Kind, f: impl Fn(u32, u32) -> u32) -> Self {
        if self.len == 1 && other.len == 1 {
            return Self::scalar(kind, f(self.words[0], other.words[0]));
        }
        // A vector meets a scalar in products alone.
        let len = self.len.max(other.len);
        let at = |value: &Self, k: usize| value.words[if value.len == 1 { 0 } else { k }];
        let words = std::array::from_fn(|k| if k < len as usize { f(at(&self, k), at(&other, k)) } else { 0 });
        Self { kind, len, words }
    }

    pub fn is_true(&self) -> bool {
        self.words[0] != 0
    }
}

/// Where a pointer leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    /// The unit's own variables.
    Own,
    /// A shared variable, by its number.
    Shared(u32),
    /// A buffer, by its number.
    Buffer(u32),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pointer {
    pub space: Space,
    /// Offset in words.
    pub at: u32,
    /// Whether an index on the way here was beyond its array; only an access through the pointer is wrong.
    pub outside: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    Nothing,
    Words(Words),
    Pointer(Pointer),
}
