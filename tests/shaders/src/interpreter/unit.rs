//! One unit of a cube between two barriers.

use naga::Barrier;

use super::around::Around;
use super::code::{AtomicOp, Index, Loaded, Op, Step};
use super::fault::Wrong;
use super::math;
use super::value::{Kind, Pointer, Space, Value, Words};

/// Most steps of a unit in a launch: the longest loops of the kernels take some thousands.
const MOST_STEPS: u64 = 20_000_000;

/// Why a unit stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stop {
    End,
    Barrier { step: usize, flags: Barrier },
}

/// The state of a unit.
pub(super) struct Unit {
    pub number: u32,
    pub next: usize,
    pub values: Vec<Value>,
    pub own: Vec<u32>,
    pub steps: u64,
}

/// A fault, and the expression at which it is; `None` for the step itself.
pub(super) type Failed = (Wrong, Option<usize>);

impl Unit {
    fn words(&self, at: usize) -> Result<Words, Wrong> {
        match self.values[at] {
            Value::Words(words) => Ok(words),
            _ => Err(Wrong::Unknown("a value")),
        }
    }

    fn pointer(&self, at: usize) -> Result<Pointer, Wrong> {
        match self.values[at] {
            Value::Pointer(pointer) => Ok(pointer),
            _ => Err(Wrong::Unknown("a pointer")),
        }
    }

    fn index(&self, index: Index) -> Result<u32, Wrong> {
        match index {
            Index::Known(index) => Ok(index),
            Index::Of(at) => Ok(self.words(at)?.words[0]),
        }
    }

    fn check(&self, around: &Around, pointer: Pointer, words: u32) -> Result<(), Wrong> {
        let end = pointer.at as usize + words as usize;
        let outside = pointer.outside || end > around.len(pointer.space, self.own.len());
        if outside { Err(Wrong::Bounds) } else { Ok(()) }
    }

    fn load(&self, around: &mut Around, pointer: Pointer, of: Loaded) -> Result<Words, Wrong> {
        self.check(around, pointer, u32::from(of.len))?;
        let mut words = [0; 4];
        let by = around.toucher(self.number, pointer.space, of.atomic);
        for (k, word) in words[..of.len as usize].iter_mut().enumerate() {
            let at = pointer.at as usize + k;
            *word = match pointer.space {
                Space::Own => self.own[at],
                space => {
                    let (memory, at) = around.memory(space, at);
                    let (word, written) = memory.load(at, &by)?;
                    if !written && matches!(space, Space::Shared(_)) && around.forgiving {
                        around.forgave = true;
                    } else if !written {
                        return Err(Wrong::Unwritten);
                    }
                    word
                }
            };
        }
        Ok(Words { kind: of.kind, len: of.len, words })
    }

    fn store(&mut self, around: &mut Around, pointer: Pointer, words: &[u32], atomic: bool) -> Result<(), Wrong> {
        self.check(around, pointer, words.len() as u32)?;
        let by = around.toucher(self.number, pointer.space, atomic);
        for (k, word) in words.iter().enumerate() {
            let at = pointer.at as usize + k;
            match pointer.space {
                Space::Own => self.own[at] = *word,
                space => {
                    let (memory, at) = around.memory(space, at);
                    memory.store(at, *word, &by)?;
                }
            }
        }
        Ok(())
    }

    fn compute(&self, around: &mut Around, op: &Op) -> Result<Value, Wrong> {
        Ok(Value::Words(match *op {
            Op::Ready => unreachable!("nothing is to be computed"),
            Op::Index { base, index, stride, count } => {
                let (base, index) = (self.pointer(base)?, self.index(index)?);
                let space = around.len(base.space, self.own.len()) as u32;
                let count = count.unwrap_or_else(|| space.saturating_sub(base.at) / stride);
                let outside = base.outside || index >= count;
                let at = if outside { base.at } else { base.at + index * stride };
                return Ok(Value::Pointer(Pointer { at, outside, ..base }));
            }
            Op::Element { base, index } => {
                let (vector, index) = (self.words(base)?, self.index(index)?);
                let word = vector.slice().get(index as usize).ok_or(Wrong::Bounds)?;
                Words::scalar(vector.kind, *word)
            }
            Op::Splat { len, value } => {
                let value = self.words(value)?;
                Words { len, words: [value.words[0]; 4], ..value }
            }
            Op::Swizzle { vector, ref pattern } => {
                let vector = self.words(vector)?;
                let words: Vec<u32> = pattern.iter().map(|k| vector.words[*k]).collect();
                Words::of(vector.kind, &words)
            }
            Op::Compose(ref parts) => {
                let (mut words, mut kind) = (Vec::new(), Kind::U32);
                for part in parts {
                    let part = self.words(*part)?;
                    kind = part.kind;
                    words.extend_from_slice(part.slice());
                }
                Words::of(kind, &words)
            }
            Op::Load { pointer, of } => self.load(around, self.pointer(pointer)?, of)?,
            Op::Unary(op, a) => math::unary(op, self.words(a)?)?,
            Op::Binary(op, a, b) => math::binary(op, self.words(a)?, self.words(b)?)?,
            Op::Select(condition, accept, reject) => {
                math::select(self.words(condition)?, self.words(accept)?, self.words(reject)?)
            }
            Op::Whether { all, of } => {
                let value = self.words(of)?;
                let mut truths = value.slice().iter().map(|word| *word != 0);
                let whether = if all { truths.all(|truth| truth) } else { truths.any(|truth| truth) };
                Words::scalar(Kind::Bool, u32::from(whether))
            }
            Op::Math(fun, ref arguments) => {
                let mut words = [Words::scalar(Kind::U32, 0); 4];
                for (word, argument) in words.iter_mut().zip(arguments) {
                    *word = self.words(*argument)?;
                }
                math::math(fun, &words[..arguments.len()])?
            }
            Op::Cast { value, to, convert } => math::cast(self.words(value)?, to, convert),
            Op::Len(pointer) => {
                let pointer = self.pointer(pointer)?;
                // Arrays of four-byte values alone are asked for their length.
                Words::scalar(Kind::U32, around.len(pointer.space, 0) as u32 - pointer.at)
            }
            Op::Unknown(what) => return Err(Wrong::Unknown(what)),
        }))
    }

    fn atomic(&self, around: &mut Around, pointer: Pointer, fun: AtomicOp, value: Words) -> Result<(u32, u32), Wrong> {
        let of = Loaded { kind: value.kind, len: 1, atomic: true };
        let before = self.load(around, pointer, of)?;
        let after = match fun {
            AtomicOp::Do(op) => math::binary(op, before, value)?,
            AtomicOp::Min => math::math(naga::MathFunction::Min, &[before, value])?,
            AtomicOp::Max => math::math(naga::MathFunction::Max, &[before, value])?,
            AtomicOp::Exchange => value,
        };
        Ok((before.words[0], after.words[0]))
    }

    /// Runs to the next barrier or the end.
    pub fn run(&mut self, around: &mut Around) -> Result<Stop, Failed> {
        let code = around.code;
        loop {
            let step = self.next;
            self.next += 1;
            self.steps += 1;
            if self.steps > MOST_STEPS {
                return Err((Wrong::Endless, None));
            }
            match &code.steps[step] {
                Step::Compute(range) => {
                    for at in range.clone() {
                        if !matches!(code.ops[at], Op::Ready) {
                            self.values[at] = self.compute(around, &code.ops[at]).map_err(|wrong| (wrong, Some(at)))?;
                        }
                    }
                }
                Step::Jump(to) => self.next = *to,
                Step::JumpIf { condition, expected, to } => {
                    let condition = self.words(*condition).map_err(|wrong| (wrong, None))?;
                    if condition.is_true() == *expected {
                        self.next = *to;
                    }
                }
                Step::Choose { selector, cases, default } => {
                    let value = self.words(*selector).map_err(|wrong| (wrong, None))?.words[0];
                    self.next = cases.iter().find(|(case, _)| *case == value).map_or(*default, |(_, to)| *to);
                }
                Step::Barrier(flags) => return Ok(Stop::Barrier { step, flags: *flags }),
                Step::End => return Ok(Stop::End),
                other => self.effect(around, other).map_err(|wrong| (wrong, None))?,
            }
        }
    }

    /// A step that writes.
    fn effect(&mut self, around: &mut Around, step: &Step) -> Result<(), Wrong> {
        match *step {
            Step::Store { pointer, value, atomic } => {
                let value = self.words(value)?;
                self.store(around, self.pointer(pointer)?, value.slice(), atomic)
            }
            Step::StoreEach { pointer, ref values, stride } => {
                let first = self.pointer(pointer)?;
                for (k, value) in values.iter().enumerate() {
                    let value = self.words(*value)?;
                    let at = first.at + k as u32 * stride;
                    self.store(around, Pointer { at, ..first }, value.slice(), false)?;
                }
                Ok(())
            }
            Step::Clear { pointer, words } => {
                self.store(around, self.pointer(pointer)?, &vec![0; words as usize], false)
            }
            Step::Read { pointer, of, result } => {
                // A barrier lies on both sides, so an atomic value is read as any other.
                let read = self.load(around, self.pointer(pointer)?, Loaded { atomic: false, ..of })?;
                self.values[result] = Value::Words(read);
                Ok(())
            }
            Step::Atomic { pointer, fun, value, result } => {
                let (pointer, value) = (self.pointer(pointer)?, self.words(value)?);
                let (before, after) = self.atomic(around, pointer, fun, value)?;
                self.store(around, pointer, &[after], true)?;
                if let Some(result) = result {
                    self.values[result] = Value::Words(Words::scalar(value.kind, before));
                }
                Ok(())
            }
            Step::Unknown(what) => Err(Wrong::Unknown(what)),
            _ => unreachable!("`run` takes the other steps"),
        }
    }
}
