//! Random numbers by counter: a draw is a function of its key and its counter, so that every row draws alone, in any
//! order and on any device.
//!
//! The generator is Threefry-2x32 with 20 rounds (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3"):
//! additions, rotations and exclusive ors of 32 bits, which every GPU has. The CubeCL twin gives the same bits.

/// Rotations of the rounds.
pub const ROTATIONS: [u32; 8] = [13, 15, 26, 6, 17, 29, 16, 24];

/// Rounds; a word of the key is added after every fourth.
pub const ROUNDS: usize = 20;

/// Parity of the key schedule.
pub const PARITY: u32 = 0x1bd1_1bda;

/// Two words from a key and a counter.
pub fn threefry(key: [u32; 2], counter: [u32; 2]) -> [u32; 2] {
    let schedule = [key[0], key[1], PARITY ^ key[0] ^ key[1]];
    let [mut a, mut b] = [counter[0].wrapping_add(key[0]), counter[1].wrapping_add(key[1])];
    for round in 0..ROUNDS {
        a = a.wrapping_add(b);
        b = b.rotate_left(ROTATIONS[round % 8]) ^ a;
        if round % 4 == 3 {
            let injection = round / 4 + 1;
            a = a.wrapping_add(schedule[injection % 3]);
            b = b.wrapping_add(schedule[(injection + 1) % 3]).wrapping_add(injection as u32);
        }
    }
    [a, b]
}

/// Bits of a word that make a uniform number: those that `f32` holds exactly.
pub const UNIFORM_BITS: u32 = 24;

/// Two independent standard normal numbers from two words (Box and Muller 1958).
pub fn normal_pair(words: [u32; 2]) -> [f64; 2] {
    let unit = f64::from(1u32 << UNIFORM_BITS);
    // The radius is drawn from (0, 1], where the logarithm is finite; the angle from [-pi, pi), where shaders are most
    // exact.
    let [radius, angle] = words.map(|word| f64::from(word >> (32 - UNIFORM_BITS)) / unit);
    let radius = (-2.0 * (radius + 1.0 / unit).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * angle - std::f64::consts::PI).sin_cos();
    [radius * cos, radius * sin]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The known answers of the authors' library (Random123, `kat_vectors`, threefry2x32 20).
    #[test]
    fn words_are_those_of_the_authors() {
        assert_eq!(threefry([0; 2], [0; 2]), [0x6b20_0159, 0x99ba_4efe]);
        assert_eq!(threefry([u32::MAX; 2], [u32::MAX; 2]), [0x1cb9_96fc, 0xbb00_2be7]);
        let (key, counter) = ([0x1319_8a2e, 0x0370_7344], [0x243f_6a88, 0x85a3_08d3]);
        assert_eq!(threefry(key, counter), [0xc492_3a9c, 0x483d_f7a0]);
    }

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let draws: Vec<f64> = (0..20_000).flat_map(|row| normal_pair(threefry([7, 0], [row, 3]))).collect();
        let moment = |power: i32| draws.iter().map(|x| x.powi(power)).sum::<f64>() / draws.len() as f64;
        // Four standard errors of 40,000 draws: 4 / 200, 4 sqrt(2) / 200, 4 sqrt(15) / 200, 4 sqrt(96) / 200.
        assert!(moment(1).abs() < 0.02 && (moment(2) - 1.0).abs() < 0.03, "{} {}", moment(1), moment(2));
        assert!(moment(3).abs() < 0.08 && (moment(4) - 3.0).abs() < 0.2, "{} {}", moment(3), moment(4));
    }
}
