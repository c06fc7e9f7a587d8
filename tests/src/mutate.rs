//! Damage to the bytes of a file, for tests of readers: bits turned over, cuts, insertions, and numbers in place of
//! numbers.
//!
//! This file has no dependency, so that a crate below this one includes it by its path:
//!
//! ```ignore
//! #[path = "../../../tests/src/mutate.rs"]
//! mod mutate;
//! ```
//!
//! A [`Step`] is three plain numbers, which proptest makes and makes smaller:
//! `prop::collection::vec((any::<u8>(), any::<u32>(), any::<u64>()), 1..6)`.

/// The change (modulo the number of kinds), where (modulo the length), and with which value.
pub type Step = (u8, u32, u64);

/// Numbers at which arithmetic on sizes breaks: around the ends of each type, and far too many of anything.
const NUMBERS: [u64; 14] = [
    0,
    1,
    u64::MAX,
    u64::MAX / 2,
    u64::MAX / 48,
    1 << 63,
    1 << 40,
    1 << 33,
    u32::MAX as u64,
    1 << 31,
    (1 << 31) - 1,
    1 << 16,
    0xffff,
    0x7f,
];

/// Floats at which geometry breaks.
const FLOATS: [f64; 10] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, f64::MAX, f64::MIN_POSITIVE, 1e30, -1e15, 1e-12];

/// Words that take the place of a number in a text.
const WORDS: [&str; 24] = [
    "0",
    "-1",
    "-0.0",
    "1e308",
    "1e999",
    "-1e300",
    "1e-320",
    "NaN",
    "-Infinity",
    "inf",
    "4294967295",
    "2147483648",
    "1000000000",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775808",
    "99999999999999999999999999999999",
    "0x10",
    "null",
    "true",
    "\"x\"",
    "[]",
    "{}",
    "",
];

/// Text that has a meaning to a parser, a terminal or a file system.
const FRAGMENTS: [&str; 14] =
    ["\u{1b}[31m", "\n", "\r\n\r\n", "\0", "../../", "/", "\"", "[[[[[[[[", "}", ",", " ", "#", "\u{202e}", "\u{feff}"];

/// The bytes after all steps, in their order.
pub fn damaged(bytes: &[u8], steps: &[Step]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for step in steps {
        apply(&mut bytes, *step);
    }
    bytes
}

/// Number of kinds in [`apply`].
const KINDS: u8 = 12;

fn apply(bytes: &mut Vec<u8>, (kind, place, value): Step) {
    let length = bytes.len();
    let at = if length == 0 { 0 } else { place as usize % length };
    let pick = |count: usize| (value % count as u64) as usize;
    match kind % KINDS {
        0 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << (value % 8)),
        1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = value as u8),
        2 => bytes.truncate(at),
        3 => insert(bytes, at, &vec![value as u8; 1 + (value >> 8) as usize % 16]),
        4 => drop(bytes.drain(at..(at + 1 + value as usize % 64).min(length).max(at))),
        5 => {
            let copied = bytes[at..(at + 1 + value as usize % 256).min(length).max(at)].to_vec();
            insert(bytes, at, &copied);
        }
        6 => overwrite(bytes, at, &(NUMBERS[pick(NUMBERS.len())] as u32).to_le_bytes()),
        7 => overwrite(bytes, at, &(NUMBERS[pick(NUMBERS.len())] as u32).to_be_bytes()),
        8 => overwrite(bytes, at, &NUMBERS[pick(NUMBERS.len())].to_le_bytes()),
        9 => {
            let float = FLOATS[pick(FLOATS.len())];
            let short = value & (1 << 32) == 0;
            if short {
                overwrite(bytes, at, &(float as f32).to_le_bytes());
            } else {
                overwrite(bytes, at, &float.to_le_bytes());
            }
        }
        10 => replace_number(bytes, at, WORDS[pick(WORDS.len())]),
        _ => insert(bytes, at, FRAGMENTS[pick(FRAGMENTS.len())].as_bytes()),
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, inserted: &[u8]) {
    bytes.splice(at..at, inserted.iter().copied());
}

fn overwrite(bytes: &mut [u8], at: usize, with: &[u8]) {
    bytes.iter_mut().skip(at).zip(with).for_each(|(byte, new)| *byte = *new);
}

/// Puts a word in place of the first number in digits at or behind `at`; nothing happens where there is none.
fn replace_number(bytes: &mut Vec<u8>, at: usize, word: &str) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(digit) = bytes.iter().skip(at).position(u8::is_ascii_digit) else { return };
    let digit = at + digit;
    let start = bytes[..digit].iter().rposition(|byte| !is_part(byte)).map_or(0, |before| before + 1);
    let end = bytes[digit..].iter().position(|byte| !is_part(byte)).map_or(bytes.len(), |length| digit + length);
    bytes.splice(start..end, word.bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_replaced_as_a_whole() {
        let replaced = |at: u32| String::from_utf8(damaged(b"x: -1.5e3, y: 7", &[(10, at, 1)])).expect("text");
        assert_eq!(replaced(0), "x: -1, y: 7");
        assert_eq!(replaced(5), "x: -1, y: 7");
        assert_eq!(replaced(10), "x: -1.5e3, y: -1");
        assert_eq!(damaged(b"none", &[(10, 0, 1)]), b"none");
    }

    #[test]
    fn nothing_can_be_damaged_too() {
        for kind in 0..KINDS {
            for value in [0, 1, u64::MAX] {
                damaged(b"", &[(kind, u32::MAX, value), (kind, 0, value)]);
                damaged(b"abc", &[(kind, 2, value); 5]);
            }
        }
    }
}
