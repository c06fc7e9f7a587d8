//! The data block of a page: arrays of numbers, rounded to a step, as gzip in base64.
//!
//! Before compression a block is its arrays one after the other, little-endian; names, types, steps and lengths are in
//! the page's JSON (`"arrays"`), in the same order.
//!
//! - `f32`: IEEE numbers, multiples of the step.
//! - `i16`: multiples of the step, `round(value / step)` within +-32767, as `2 n` for `n >= 0` and `-2 n - 1` below 0,
//!   so that small numbers of either sign have a zero upper byte.
//!
//! Either is stored by byte planes: the lowest bytes of all numbers, then the next, and so on. Rounded numbers have the
//! same upper or lower bytes over and over, and gzip makes little of those planes: a position takes 5 to 8 bytes
//! instead of 12.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;

/// An array of a block, as the page's JSON names it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Array {
    name: &'static str,
    kind: &'static str,
    step: f64,
    length: usize,
}

/// A block that is being put together.
#[derive(Debug, Default)]
pub struct Block {
    /// Its arrays so far.
    pub arrays: Vec<Array>,
    bytes: Vec<u8>,
}

impl Block {
    /// Appends numbers as `f32`, rounded to multiples of `step`, a power of two.
    pub fn floats(&mut self, name: &'static str, values: &[f32], step: f64) {
        let rounded = |value: &f32| ((f64::from(*value) / step).round() * step) as f32;
        let words: Vec<[u8; 4]> = values.iter().map(|value| rounded(value).to_le_bytes()).collect();
        self.planes(&words);
        self.arrays.push(Array { name, kind: "f32", step, length: values.len() });
    }

    /// Appends numbers as `i16` in units of `step`; a larger number becomes the largest there is.
    pub fn shorts(&mut self, name: &'static str, values: impl Iterator<Item = f32>, step: f64) {
        let words: Vec<[u8; 2]> = values.map(|value| short(f64::from(value) / step).to_le_bytes()).collect();
        self.planes(&words);
        self.arrays.push(Array { name, kind: "i16", step, length: words.len() });
    }

    fn planes<const BYTES: usize>(&mut self, words: &[[u8; BYTES]]) {
        (0..BYTES).for_each(|plane| self.bytes.extend(words.iter().map(|word| word[plane])));
    }

    /// The block as text.
    pub fn text(&self) -> String {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
        gzip.write_all(&self.bytes).expect("a vector takes everything");
        STANDARD.encode(gzip.finish().expect("a vector takes everything"))
    }
}

/// A rounded number with its sign in the lowest bit.
fn short(value: f64) -> u16 {
    let n = value.round().clamp(-32_767.0, 32_767.0) as i32;
    (if n < 0 { -2 * n - 1 } else { 2 * n }) as u16
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::GzDecoder;

    use super::*;

    /// Reads an array as the page's script does.
    fn read(bytes: &[u8], array: &Array) -> (Vec<f64>, usize) {
        let width = if array.kind == "f32" { 4 } else { 2 };
        let byte = |i: usize, plane: usize| bytes[plane * array.length + i];
        let number = |i: usize| match array.kind {
            "f32" => f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|plane| byte(i, plane)))),
            _ => {
                let n = i32::from(u16::from_le_bytes([byte(i, 0), byte(i, 1)]));
                f64::from((n >> 1) ^ -(n & 1)) * array.step
            }
        };
        ((0..array.length).map(number).collect(), width * array.length)
    }

    #[test]
    fn numbers_come_back_to_half_a_step() {
        let floats: Vec<f32> = (-50..50).map(|i| 0.037 * i as f32 * i as f32 * (i % 3) as f32).collect();
        let shorts: Vec<f32> = vec![0.0, 0.1, -0.1, 3.0, -4.999, 120.0, 1e6, -1e6, f32::NAN];
        let mut block = Block::default();
        block.floats("a", &floats, 1.0 / 256.0);
        block.shorts("b", shorts.iter().copied(), 1.0 / 64.0);
        let gzip = STANDARD.decode(block.text()).expect("base64");
        let mut bytes = Vec::new();
        GzDecoder::new(&*gzip).read_to_end(&mut bytes).expect("gzip");
        let (first, length) = read(&bytes, &block.arrays[0]);
        assert!(floats.iter().zip(&first).all(|(a, b)| (f64::from(*a) - b).abs() <= 0.5 / 256.0));
        let (second, rest) = read(&bytes[length..], &block.arrays[1]);
        assert_eq!(length + rest, bytes.len());
        assert!(shorts[..6].iter().zip(&second).all(|(a, b)| (f64::from(*a) - b).abs() <= 0.5 / 64.0));
        let most = 32_767.0 / 64.0;
        assert_eq!(second[6..], [most, -most, 0.0]);
    }
}
