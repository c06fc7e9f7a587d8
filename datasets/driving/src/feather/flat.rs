//! FlatBuffers tables: positions relative to positions, each checked against the end of the bytes.

/// A table. Reading beyond the end gives `None`, which callers turn into an error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flat<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// The elements of a vector of tables or structs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vector<'a> {
    bytes: &'a [u8],
    start: usize,
    pub count: usize,
}

/// `N` bytes at a position.
pub(crate) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at.checked_add(N)?)?.try_into().ok()
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    array(bytes, at).map(|b| u32::from_le_bytes(b) as usize)
}

impl<'a> Flat<'a> {
    /// The table that the bytes begin with.
    pub fn root(bytes: &'a [u8]) -> Option<Self> {
        Some(Self { bytes, at: u32_at(bytes, 0)? })
    }

    /// Where a field lies; `None` where it has its default.
    fn field(&self, slot: usize) -> Option<usize> {
        let back = i32::from_le_bytes(array(self.bytes, self.at)?);
        let vtable = usize::try_from(i64::try_from(self.at).ok()? - i64::from(back)).ok()?;
        let size = usize::from(u16::from_le_bytes(array(self.bytes, vtable)?));
        let entry = 4 + 2 * slot;
        if entry + 2 > size {
            return None;
        }
        let offset = usize::from(u16::from_le_bytes(array(self.bytes, vtable.checked_add(entry)?)?));
        (offset > 0).then(|| self.at.checked_add(offset)).flatten()
    }

    /// A number of one byte; 0 by default.
    pub fn u8(&self, slot: usize) -> u8 {
        self.field(slot).and_then(|at| self.bytes.get(at)).copied().unwrap_or(0)
    }

    /// A number of two bytes; 0 by default.
    pub fn i16(&self, slot: usize) -> i16 {
        self.field(slot).and_then(|at| array(self.bytes, at)).map_or(0, i16::from_le_bytes)
    }

    /// A number of four bytes; 0 by default.
    pub fn i32(&self, slot: usize) -> i32 {
        self.field(slot).and_then(|at| array(self.bytes, at)).map_or(0, i32::from_le_bytes)
    }

    /// A number of eight bytes; 0 by default.
    pub fn i64(&self, slot: usize) -> i64 {
        self.field(slot).and_then(|at| array(self.bytes, at)).map_or(0, i64::from_le_bytes)
    }

    /// A table inside of this one.
    pub fn table(&self, slot: usize) -> Option<Self> {
        let at = self.field(slot)?;
        Some(Self { bytes: self.bytes, at: at.checked_add(u32_at(self.bytes, at)?)? })
    }

    /// A vector.
    pub fn vector(&self, slot: usize) -> Option<Vector<'a>> {
        let at = self.field(slot)?;
        let start = at.checked_add(u32_at(self.bytes, at)?)?;
        let count = u32_at(self.bytes, start)?;
        Some(Vector { bytes: self.bytes, start: start + 4, count })
    }

    /// A string.
    pub fn text(&self, slot: usize) -> Option<&'a str> {
        let Vector { bytes, start, count } = self.vector(slot)?;
        std::str::from_utf8(bytes.get(start..start.checked_add(count)?)?).ok()
    }
}

impl<'a> Vector<'a> {
    /// The table at a place.
    pub fn table(&self, index: usize) -> Option<Flat<'a>> {
        let at = self.start.checked_add(index.checked_mul(4)?)?;
        Some(Flat { bytes: self.bytes, at: at.checked_add(u32_at(self.bytes, at)?)? })
    }

    /// An i64 of the struct at a place; structs have `size` bytes.
    pub fn i64(&self, index: usize, size: usize, offset: usize) -> Option<i64> {
        let at = self.start.checked_add(index.checked_mul(size)?)?.checked_add(offset)?;
        array(self.bytes, at).map(i64::from_le_bytes)
    }

    /// An i32, likewise.
    pub fn i32(&self, index: usize, size: usize, offset: usize) -> Option<i32> {
        let at = self.start.checked_add(index.checked_mul(size)?)?.checked_add(offset)?;
        array(self.bytes, at).map(i32::from_le_bytes)
    }
}
