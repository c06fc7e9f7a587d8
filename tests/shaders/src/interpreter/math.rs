//! Operations on scalars and vectors, as WGSL defines them.

use naga::{BinaryOperator as B, MathFunction as M, UnaryOperator as U};

use super::fault::Wrong;
use super::value::{Kind, Words};

fn f(word: u32) -> f32 {
    f32::from_bits(word)
}

fn float(of: impl Fn(f32, f32) -> f32) -> impl Fn(u32, u32) -> u32 {
    move |a, b| of(f(a), f(b)).to_bits()
}

fn signed(of: impl Fn(i32, i32) -> i32) -> impl Fn(u32, u32) -> u32 {
    move |a, b| of(a as i32, b as i32) as u32
}

pub(super) fn unary(op: U, a: Words) -> Result<Words, Wrong> {
    Ok(match (op, a.kind) {
        (U::Negate, Kind::F32) => a.map(a.kind, |x| (-f(x)).to_bits()),
        (U::Negate, _) => a.map(a.kind, u32::wrapping_neg),
        (U::LogicalNot, _) => a.map(a.kind, |x| u32::from(x == 0)),
        (U::BitwiseNot, _) => a.map(a.kind, |x| !x),
    })
}

pub(super) fn binary(op: B, a: Words, b: Words) -> Result<Words, Wrong> {
    let compared = |of: fn(Option<std::cmp::Ordering>) -> bool| {
        let order = move |x: u32, y: u32| match a.kind {
            Kind::F32 => f(x).partial_cmp(&f(y)),
            Kind::I32 => Some((x as i32).cmp(&(y as i32))),
            Kind::U32 | Kind::Bool => Some(x.cmp(&y)),
        };
        a.zip(b, Kind::Bool, move |x, y| u32::from(of(order(x, y))))
    };
    Ok(match (op, a.kind) {
        (B::Equal, _) => compared(|order| order.is_some_and(|o| o.is_eq())),
        (B::NotEqual, _) => compared(|order| !order.is_some_and(|o| o.is_eq())),
        (B::Less, _) => compared(|order| order.is_some_and(|o| o.is_lt())),
        (B::LessEqual, _) => compared(|order| order.is_some_and(|o| o.is_le())),
        (B::Greater, _) => compared(|order| order.is_some_and(|o| o.is_gt())),
        (B::GreaterEqual, _) => compared(|order| order.is_some_and(|o| o.is_ge())),
        (B::And | B::LogicalAnd, kind) => a.zip(b, kind, |x, y| x & y),
        (B::InclusiveOr | B::LogicalOr, kind) => a.zip(b, kind, |x, y| x | y),
        (B::ExclusiveOr, kind) => a.zip(b, kind, |x, y| x ^ y),
        (B::ShiftLeft, kind) => a.zip(b, kind, |x, y| x << (y % 32)),
        (B::ShiftRight, Kind::I32) => a.zip(b, Kind::I32, |x, y| ((x as i32) >> (y % 32)) as u32),
        (B::ShiftRight, kind) => a.zip(b, kind, |x, y| x >> (y % 32)),
        (_, Kind::F32) => a.zip(
            b,
            Kind::F32,
            float(match op {
                B::Add => |x, y| x + y,
                B::Subtract => |x, y| x - y,
                B::Multiply => |x, y| x * y,
                B::Divide => |x, y| x / y,
                _ => |x, y| x % y,
            }),
        ),
        (B::Divide, Kind::I32) => a.zip(b, a.kind, signed(|x, y| if y == 0 { x } else { x.wrapping_div(y) })),
        (B::Modulo, Kind::I32) => a.zip(b, a.kind, signed(|x, y| if y == 0 { 0 } else { x.wrapping_rem(y) })),
        (B::Add, kind) => a.zip(b, kind, u32::wrapping_add),
        (B::Subtract, kind) => a.zip(b, kind, u32::wrapping_sub),
        (B::Multiply, kind) => a.zip(b, kind, u32::wrapping_mul),
        (B::Divide, kind) => a.zip(b, kind, |x, y| x.checked_div(y).unwrap_or(x)),
        (B::Modulo, kind) => a.zip(b, kind, |x, y| x.checked_rem(y).unwrap_or(0)),
    })
}

pub(super) fn select(condition: Words, accept: Words, reject: Words) -> Words {
    let pick = |k: usize| condition.words[if condition.len == 1 { 0 } else { k }] != 0;
    let words = std::array::from_fn(|k| if pick(k) { accept.words[k] } else { reject.words[k] });
    Words { words, ..accept }
}

/// `value` as another kind; without `convert` its bits.
pub(super) fn cast(value: Words, to: Kind, convert: bool) -> Words {
    if !convert {
        return Words { kind: to, ..value };
    }
    value.map(to, |x| match (value.kind, to) {
        (Kind::F32, Kind::U32) => f(x) as u32,
        (Kind::F32, Kind::I32) => f(x) as i32 as u32,
        (Kind::F32, Kind::Bool) => u32::from(f(x) != 0.0),
        (Kind::I32, Kind::F32) => (x as i32 as f32).to_bits(),
        (Kind::U32 | Kind::Bool, Kind::F32) => (x as f32).to_bits(),
        (_, Kind::Bool) => u32::from(x != 0),
        _ => x,
    })
}

pub(super) fn math(fun: M, args: &[Words]) -> Result<Words, Wrong> {
    let a = args[0];
    let kind = a.kind;
    let of_float = |of: fn(f32) -> f32| Ok(a.map(kind, |x| of(f(x)).to_bits()));
    match (fun, kind) {
        (M::Abs, Kind::I32) => Ok(a.map(kind, |x| (x as i32).wrapping_abs() as u32)),
        (M::Abs, Kind::U32) => Ok(a),
        (M::Abs, _) => of_float(f32::abs),
        (M::Min | M::Max, _) => Ok(extreme(fun, a, args[1])),
        (M::Clamp, _) => Ok(extreme(M::Min, extreme(M::Max, a, args[1]), args[2])),
        (M::Saturate, _) => of_float(|x| x.clamp(0.0, 1.0)),
        (M::Cos, _) => of_float(f32::cos),
        (M::Sin, _) => of_float(f32::sin),
        (M::Tan, _) => of_float(f32::tan),
        (M::Tanh, _) => of_float(f32::tanh),
        (M::Acos, _) => of_float(f32::acos),
        (M::Asin, _) => of_float(f32::asin),
        (M::Atan, _) => of_float(f32::atan),
        (M::Atan2, _) => Ok(a.zip(args[1], kind, float(f32::atan2))),
        (M::Ceil, _) => of_float(f32::ceil),
        (M::Floor, _) => of_float(f32::floor),
        (M::Round, _) => of_float(f32::round_ties_even),
        (M::Fract, _) => of_float(|x| x - x.floor()),
        (M::Trunc, _) => of_float(f32::trunc),
        (M::Exp, _) => of_float(f32::exp),
        (M::Exp2, _) => of_float(f32::exp2),
        (M::Log, _) => of_float(f32::ln),
        (M::Log2, _) => of_float(f32::log2),
        (M::Pow, _) => Ok(a.zip(args[1], kind, float(f32::powf))),
        (M::Sqrt, _) => of_float(f32::sqrt),
        (M::InverseSqrt, _) => of_float(|x| 1.0 / x.sqrt()),
        (M::Sign, Kind::F32) => of_float(|x| if x == 0.0 { 0.0 } else { x.signum() }),
        (M::Fma, _) => {
            let product: [f64; 4] = std::array::from_fn(|k| f64::from(f(a.words[k])) * f64::from(f(args[1].words[k])));
            let words = std::array::from_fn(|k| ((product[k] + f64::from(f(args[2].words[k]))) as f32).to_bits());
            Ok(Words { words, ..a })
        }
        (M::Dot, Kind::F32) => {
            let sum = a.slice().iter().zip(args[1].slice()).fold(0.0, |sum, (x, y)| sum + f(*x) * f(*y));
            Ok(Words::scalar(kind, sum.to_bits()))
        }
        (M::CountOneBits, _) => Ok(a.map(kind, u32::count_ones)),
        (M::CountLeadingZeros, _) => Ok(a.map(kind, u32::leading_zeros)),
        (M::CountTrailingZeros, _) => Ok(a.map(kind, u32::trailing_zeros)),
        (M::ReverseBits, _) => Ok(a.map(kind, u32::reverse_bits)),
        (M::FirstTrailingBit, _) => Ok(a.map(kind, |x| if x == 0 { u32::MAX } else { x.trailing_zeros() })),
        (M::FirstLeadingBit, Kind::U32) => Ok(a.map(kind, |x| x.checked_ilog2().unwrap_or(u32::MAX))),
        _ => Err(Wrong::Unknown("a function")),
    }
}

fn extreme(fun: M, a: Words, b: Words) -> Words {
    let low = fun == M::Min;
    match a.kind {
        Kind::F32 => a.zip(b, a.kind, float(if low { f32::min } else { f32::max })),
        Kind::I32 => a.zip(b, a.kind, signed(if low { Ord::min } else { Ord::max })),
        Kind::U32 | Kind::Bool => a.zip(b, a.kind, if low { Ord::min } else { Ord::max }),
    }
}
