//! Rotations in four bytes (version 3) or three (version 2). Quaternions are x y z w here, as in the file.

/// Largest value of the three smaller components: `1 / sqrt 2`.
const MOST: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Steps of a component's size.
const STEPS: f64 = 511.0;

/// The index of the largest component in the two highest bits, then sign and size of the other three in order, ten bits
/// each.
pub fn pack(q: [f64; 4]) -> u32 {
    let largest = (0..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    let is_negative = q[largest] < 0.0;
    let mut packed = largest as u32;
    for (i, x) in q.iter().enumerate() {
        if i != largest {
            let size = (STEPS * (x.abs() / MOST) + 0.5).floor().min(STEPS) as u32;
            packed = packed << 10 | u32::from((*x < 0.0) != is_negative) << 9 | size;
        }
    }
    packed
}

/// The quaternion of four bytes.
pub fn unpack(packed: u32) -> [f64; 4] {
    let largest = (packed >> 30) as usize;
    let (mut q, mut rest, mut sum) = ([0.0; 4], packed, 0.0);
    for i in (0..4).rev().filter(|i| *i != largest) {
        let size = f64::from(rest & 511) / STEPS * MOST;
        q[i] = if rest >> 9 & 1 == 1 { -size } else { size };
        sum += size * size;
        rest >>= 10;
    }
    q[largest] = (1.0 - sum).max(0.0).sqrt();
    q
}

/// The quaternion of three bytes, whose w is not negative.
pub fn unpack_v2(bytes: [u8; 3]) -> [f64; 4] {
    let [x, y, z] = bytes.map(|byte| f64::from(byte) / 127.5 - 1.0);
    [x, y, z, (1.0 - x * x - y * y - z * z).max(0.0).sqrt()]
}
