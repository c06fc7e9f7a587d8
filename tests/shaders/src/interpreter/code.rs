//! A shader as steps with jumps, so that a unit can stop at a barrier anywhere.

use naga::{Barrier, Span};

use super::value::{Kind, Value};

/// Number of an expression.
pub(super) type At = usize;

/// How an expression is computed.
#[derive(Clone, Debug)]
pub(super) enum Op {
    /// Known before the first step, or the result of a statement.
    Ready,
    Index {
        base: At,
        index: Index,
        stride: u32,
        count: Option<u32>,
    },
    Element {
        base: At,
        index: Index,
    },
    Splat {
        len: u8,
        value: At,
    },
    Swizzle {
        vector: At,
        pattern: Vec<usize>,
    },
    Compose(Vec<At>),
    Load {
        pointer: At,
        of: Loaded,
    },
    Unary(naga::UnaryOperator, At),
    Binary(naga::BinaryOperator, At, At),
    Select(At, At, At),
    /// Whether all, or whether any.
    Whether {
        all: bool,
        of: At,
    },
    Math(naga::MathFunction, Vec<At>),
    Cast {
        value: At,
        to: Kind,
        convert: bool,
    },
    Len(At),
    Unknown(&'static str),
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Index {
    Of(At),
    Known(u32),
}

/// The place to which a pointer leads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loaded {
    pub kind: Kind,
    pub len: u8,
    pub atomic: bool,
}

#[derive(Clone, Debug)]
pub(super) enum Step {
    Compute(std::ops::Range<At>),
    Store { pointer: At, value: At, atomic: bool },
    StoreEach { pointer: At, values: Vec<At>, stride: u32 },
    Clear { pointer: At, words: u32 },
    Read { pointer: At, of: Loaded, result: At },
    Atomic { pointer: At, fun: AtomicOp, value: At, result: Option<At> },
    Barrier(Barrier),
    Jump(usize),
    JumpIf { condition: At, expected: bool, to: usize },
    Choose { selector: At, cases: Vec<(u32, usize)>, default: usize },
    End,
    Unknown(&'static str),
}

#[derive(Clone, Copy, Debug)]
pub(super) enum AtomicOp {
    Do(naga::BinaryOperator),
    Min,
    Max,
    Exchange,
}

/// The steps of the entry function.
pub(super) struct Code {
    pub ops: Vec<Op>,
    pub steps: Vec<Step>,
    pub spans: Vec<Span>,
    /// Expressions before the first step.
    pub ready: Vec<Value>,
    /// The arguments' expressions.
    pub arguments: Vec<(At, naga::BuiltIn)>,
    /// Words of the unit's own variables before the first step.
    pub own: Vec<u32>,
}
