//! Stable radix sort of positive numbers by value: the depth order, ties by index.

use crate::cpu::Real;

const DIGIT_BITS: u32 = 11;
const BUCKETS: usize = 1 << DIGIT_BITS;

/// Order of `items` by `key(item)`, ascending, equal keys in the given order. Keys are positive and finite.
///
/// One counting pass per 11 bits over (key, item) pairs; passes in which all keys share a digit are skipped.
pub fn sort_by_key<F: Real>(items: &[u32], key: impl Fn(u32) -> F) -> Vec<u32> {
    let mut from: Vec<(u64, u32)> = items.iter().map(|&i| (key(i).order_bits(), i)).collect();
    let mut to = vec![(0, 0); from.len()];
    for shift in (0..F::ORDER_BITS).step_by(DIGIT_BITS as usize) {
        let digit = |key: u64| (key >> shift) as usize & (BUCKETS - 1);
        let mut starts = vec![0_usize; BUCKETS];
        from.iter().for_each(|&(k, _)| starts[digit(k)] += 1);
        if starts.contains(&from.len()) {
            continue;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += std::mem::replace(start, sum);
        }
        for &(k, i) in &from {
            let slot = &mut starts[digit(k)];
            to[*slot] = (k, i);
            *slot += 1;
        }
        std::mem::swap(&mut from, &mut to);
    }
    from.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_a_stable_sort() {
        for count in [0_usize, 1, 2, 1023, 1024, 1025] {
            let keys: Vec<f32> = (0..count).map(|i| 0.1 + ((i * 7919) % 97) as f32 * 1e3).collect();
            let items: Vec<u32> = (0..count as u32).collect();
            let mut want = items.clone();
            want.sort_by(|&a, &b| keys[a as usize].total_cmp(&keys[b as usize]));
            assert_eq!(sort_by_key(&items, |i| keys[i as usize]), want);
        }
    }
}
