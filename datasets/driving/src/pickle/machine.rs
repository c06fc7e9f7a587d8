//! The stack machine of a pickle: a closed list of opcodes builds a [`Tree`].

use std::collections::HashMap;

use super::value::{Global, Id, PickleError, Tree, Value};

/// Most opcodes that are carried out. A table of numbers has some hundred, and one of cuboids about 20 a row; each
/// opcode makes at most one value of 40 bytes and one place in a list, so that values take less than 100 MB whatever
/// the file says.
pub(crate) const OPCODES_MAX: usize = 2_000_000;

/// Builds the values of a pickle.
///
/// # Errors
/// For an opcode or name from outside the list, a stream that ends early, and more than [`OPCODES_MAX`] opcodes.
pub(crate) fn parse(bytes: &[u8]) -> Result<Tree<'_>, PickleError> {
    let mut machine =
        Machine { bytes, at: 0, values: Vec::new(), stack: Vec::new(), marks: Vec::new(), memo: HashMap::new() };
    for _ in 0..OPCODES_MAX {
        if let Some(root) = machine.step()? {
            return Ok(Tree { values: machine.values, root });
        }
    }
    Err(machine.wrong("a pickle of at most 2 million opcodes", "more"))
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    values: Vec<Value<'a>>,
    stack: Vec<Id>,
    /// Heights of the stack at open marks.
    marks: Vec<usize>,
    memo: HashMap<usize, Id>,
}

impl<'a> Machine<'a> {
    /// Carries out one opcode; the root when it was the last.
    fn step(&mut self) -> Result<Option<Id>, PickleError> {
        let opcode = self.take(1)?[0];
        match opcode {
            b'.' => return self.pop().map(Some),
            0x80 => drop(self.take(1)?),
            0x95 => drop(self.take(8)?),
            b'(' => self.marks.push(self.stack.len()),
            b'0' => drop(self.pop()?),
            b'1' => drop(self.pop_mark()?),
            b'q' | b'r' => {
                let key = self.length(if opcode == b'q' { 1 } else { 4 })?;
                self.memoize(key)?;
            }
            0x94 => self.memoize(self.memo.len())?,
            b'h' | b'j' => {
                let key = self.length(if opcode == b'h' { 1 } else { 4 })?;
                self.recall(key)?;
            }
            b'c' | 0x93 => self.global(opcode)?,
            b'R' | 0x81 => self.call()?,
            b'b' => self.build()?,
            b't' | 0x85..=0x87 | b'a' | b'e' | b's' | b'u' => self.collect(opcode)?,
            _ => {
                let value = self.plain(opcode)?;
                self.push(value);
            }
        }
        Ok(None)
    }

    /// The value of an opcode that takes nothing from the stack.
    fn plain(&mut self, opcode: u8) -> Result<Value<'a>, PickleError> {
        Ok(match opcode {
            b'N' => Value::None,
            0x88 => Value::Bool(true),
            0x89 => Value::Bool(false),
            b'J' => Value::Int(i64::from(self.length(4)? as i32)),
            b'K' => Value::Int(self.length(1)? as i64),
            b'M' => Value::Int(self.length(2)? as i64),
            0x8a => self.long()?,
            b'G' => {
                let bytes = self.take(8)?;
                Value::Float(f64::from_be_bytes(std::array::from_fn(|i| bytes[i])))
            }
            0x8c | b'X' | 0x8d | b'C' | b'B' | 0x8e | 0x96 => {
                let count = self.length(match opcode {
                    0x8c | b'C' => 1,
                    b'X' | b'B' => 4,
                    _ => 8,
                })?;
                match opcode {
                    0x8c | b'X' | 0x8d => Value::Text(self.text(count)?),
                    _ => Value::Bytes(self.take(count)?),
                }
            }
            b')' => Value::Tuple(Vec::new()),
            b']' => Value::List(Vec::new()),
            b'}' => Value::Dict(Vec::new()),
            other => {
                self.at -= 1;
                return Err(self.wrong("an opcode of a pickled table", format!("the opcode 0x{other:02x}")));
            }
        })
    }

    /// Tuples, and additions to lists and dictionaries.
    fn collect(&mut self, opcode: u8) -> Result<(), PickleError> {
        match opcode {
            b't' | 0x85..=0x87 => {
                let items = if opcode == b't' { self.pop_mark()? } else { self.pop_many(usize::from(opcode - 0x84))? };
                self.push(Value::Tuple(items));
            }
            b'a' | b'e' => {
                let items = if opcode == b'a' { vec![self.pop()?] } else { self.pop_mark()? };
                match self.top_value()? {
                    Value::List(list) => list.extend(items),
                    other => return Err(other.kind()).map_err(|kind| self.wrong("a list to append to", kind)),
                }
            }
            _ => {
                let items = if opcode == b's' { self.pop_many(2)? } else { self.pop_mark()? };
                if items.len() % 2 != 0 {
                    return Err(self.wrong("pairs of a key and a value", "a key without a value"));
                }
                match self.top_value()? {
                    Value::Dict(entries) => entries.extend(items.chunks_exact(2).map(|pair| (pair[0], pair[1]))),
                    other => return Err(other.kind()).map_err(|kind| self.wrong("a dictionary to add to", kind)),
                }
            }
        }
        Ok(())
    }

    fn global(&mut self, opcode: u8) -> Result<(), PickleError> {
        let (module, name) = if opcode == b'c' {
            (self.line()?, self.line()?)
        } else {
            let names = self.pop_many(2)?;
            match (&self.values[names[0] as usize], &self.values[names[1] as usize]) {
                (Value::Text(module), Value::Text(name)) => (*module, *name),
                _ => return Err(self.wrong("the name of a class", "something else")),
            }
        };
        let Some(global) = Global::of(module, name) else {
            return Err(self.wrong("a class or function of a pickled table", format!("`{module}.{name}`")));
        };
        self.push(Value::Global(global));
        Ok(())
    }

    /// Stores a call.
    fn call(&mut self) -> Result<(), PickleError> {
        let pair = self.pop_many(2)?;
        let Value::Global(callable) = self.values[pair[0] as usize] else {
            return Err(self.wrong("a class to make an object of", self.values[pair[0] as usize].kind()));
        };
        self.push(Value::Object { callable, args: pair[1], state: None });
        Ok(())
    }

    /// Stores the state of an object.
    fn build(&mut self) -> Result<(), PickleError> {
        let new = self.pop()?;
        match self.top_value()? {
            Value::Object { state, .. } => *state = Some(new),
            other => return Err(other.kind()).map_err(|kind| self.wrong("an object to give a state to", kind)),
        }
        Ok(())
    }

    fn memoize(&mut self, key: usize) -> Result<(), PickleError> {
        let Some(id) = self.stack.last() else { return Err(self.wrong("a value to remember", "an empty stack")) };
        self.memo.insert(key, *id);
        Ok(())
    }

    fn recall(&mut self, key: usize) -> Result<(), PickleError> {
        let Some(id) = self.memo.get(&key) else {
            return Err(self.wrong("a remembered value", format!("number {key}, which was never remembered")));
        };
        self.stack.push(*id);
        Ok(())
    }

    fn push(&mut self, value: Value<'a>) {
        // The number of opcodes bounds the number of values far below u32::MAX.
        self.stack.push(self.values.len() as Id);
        self.values.push(value);
    }

    fn pop(&mut self) -> Result<Id, PickleError> {
        Ok(self.pop_many(1)?[0])
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, PickleError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() < floor + count {
            return Err(self.wrong(format!("{count} values on the stack"), "fewer"));
        }
        Ok(self.stack.split_off(self.stack.len() - count))
    }

    fn pop_mark(&mut self) -> Result<Vec<Id>, PickleError> {
        match self.marks.pop() {
            // Values are taken from above the last mark only, so the stack is never below it.
            Some(height) => Ok(self.stack.split_off(height)),
            None => Err(self.wrong("a mark on the stack", "none")),
        }
    }

    fn top_value(&mut self) -> Result<&mut Value<'a>, PickleError> {
        match self.stack.last() {
            Some(id) => Ok(&mut self.values[*id as usize]),
            None => Err(self.wrong("a value on the stack", "none")),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], PickleError> {
        let rest = &self.bytes[self.at..];
        if rest.len() < count {
            return Err(self.wrong(format!("{count} more bytes"), format!("{} up to the end", rest.len())));
        }
        self.at += count;
        Ok(&rest[..count])
    }

    /// An unsigned number of `bytes` bytes; numbers beyond any length become one that no file has.
    fn length(&mut self, bytes: usize) -> Result<usize, PickleError> {
        let value = self.take(bytes)?.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
        Ok(usize::try_from(value).unwrap_or(usize::MAX))
    }

    fn long(&mut self) -> Result<Value<'a>, PickleError> {
        let count = usize::from(self.take(1)?[0]);
        if count > 8 {
            return Err(self.wrong("an integer of at most 8 bytes", format!("one of {count}")));
        }
        let bytes = self.take(count)?;
        let filler = if bytes.last().is_some_and(|top| *top >= 0x80) { 0xff } else { 0 };
        Ok(Value::Int(i64::from_le_bytes(std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(filler)))))
    }

    fn text(&mut self, count: usize) -> Result<&'a str, PickleError> {
        let bytes = self.take(count)?;
        std::str::from_utf8(bytes).map_err(|_| self.wrong("text in UTF-8", "bytes that are not UTF-8"))
    }

    fn line(&mut self) -> Result<&'a str, PickleError> {
        let rest = &self.bytes[self.at..];
        let Some(count) = rest.iter().position(|byte| *byte == b'\n') else {
            return Err(self.wrong("a line with a name", "the end"));
        };
        let text = self.text(count)?;
        self.at += 1;
        Ok(text)
    }

    fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> PickleError {
        PickleError::new(format!("byte {}", self.at), expected, found)
    }
}
