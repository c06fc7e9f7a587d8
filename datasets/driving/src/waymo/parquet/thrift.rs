//! A walk over Thrift's compact protocol, which the footers and page headers of Parquet are written in. It comes before
//! any other parser looks at them: every size is held against the bytes that follow, and nesting is bounded.

/// Deepest nesting of structures and lists. The footer of a plain file has seven levels.
const DEPTH_MAX: usize = 16;

/// A thing found on a walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Event {
    /// A structure in a list begins.
    Element,
    /// An integer; 1 and 0 for truth values that are fields.
    Integer(i64),
}

/// Walks over the structure at the begin of some bytes, and gives its integers and the begin of structures in lists,
/// with the numbers of the fields that lead there, outermost first. The length of the structure, bytes; `None` where
/// it is broken.
pub(crate) fn structure(bytes: &[u8], seen: impl FnMut(&[i16], Event)) -> Option<usize> {
    let mut walk = Walk { bytes, at: 0, path: Vec::new(), seen };
    walk.fields(0)?;
    Some(walk.at)
}

/// Bytes and a position.
struct Walk<'a, S> {
    bytes: &'a [u8],
    at: usize,
    path: Vec<i16>,
    seen: S,
}

impl<S: FnMut(&[i16], Event)> Walk<'_, S> {
    fn see(&mut self, event: Event) {
        (self.seen)(&self.path, event);
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        let end = usize::try_from(count).ok().and_then(|count| self.at.checked_add(count))?;
        self.at = Some(end).filter(|end| *end <= self.bytes.len())?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn fields(&mut self, depth: usize) -> Option<()> {
        if depth > DEPTH_MAX {
            return None;
        }
        let mut number = 0_i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            number = match head >> 4 {
                0 => i16::try_from(self.zigzag()?).ok()?,
                delta => number.checked_add(i16::from(delta))?,
            };
            self.path.push(number);
            match head & 15 {
                // A truth value is in the head itself.
                kind @ (1 | 2) => self.see(Event::Integer(i64::from(kind == 1))),
                kind => self.value(kind, depth)?,
            }
            self.path.pop();
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            1..=3 => self.skip(1),
            4..=6 => {
                let value = self.zigzag()?;
                self.see(Event::Integer(value));
                Some(())
            }
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                self.elements(count, &[head & 15], depth)
            }
            11 => match self.varint()? {
                0 => Some(()),
                count => {
                    let kinds = self.byte()?;
                    self.elements(count, &[kinds >> 4, kinds & 15], depth)
                }
            },
            12 => self.fields(depth + 1),
            13 => self.skip(16),
            _ => None,
        }
    }

    fn elements(&mut self, count: u64, kinds: &[u8], depth: usize) -> Option<()> {
        // Every element has a byte at least.
        if count > (self.bytes.len() - self.at) as u64 || depth >= DEPTH_MAX {
            return None;
        }
        for _ in 0..count {
            for kind in kinds {
                if *kind == 12 {
                    self.see(Event::Element);
                }
                self.value(*kind, depth + 1)?;
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_structure_by_hand() {
        // Field 1: i32 -3. Field 5: a structure with field 1: i32 7. Field 6: a list of two structures, the first with
        // field 5: i32 2.
        let bytes = [0x15, 5, 0x4c, 0x15, 14, 0, 0x19, 0x2c, 0x55, 4, 0, 0, 0, 99];
        let mut found = Vec::new();
        let length = structure(&bytes, |path, event| found.push((path.to_vec(), event)));
        assert_eq!(length, Some(bytes.len() - 1));
        let expected = [
            (vec![1], Event::Integer(-3)),
            (vec![5, 1], Event::Integer(7)),
            (vec![6], Event::Element),
            (vec![6, 5], Event::Integer(2)),
            (vec![6], Event::Element),
        ];
        assert_eq!(found, expected);
        for cut in 0..bytes.len() - 1 {
            assert_eq!(structure(&bytes[..cut], |_, _| {}), None, "{cut}");
        }
    }

    #[test]
    fn depth_and_sizes_are_bounded() {
        assert_eq!(structure(&[0x1c; 1000], |_, _| {}), None);
        // A list of 2^31 - 1 bytes.
        assert_eq!(structure(&[0x19, 0xf3, 0xff, 0xff, 0xff, 0xff, 7, 0], |_, _| {}), None);
    }
}
