//! The radix sort against a stable sort.

use gs_kernels::cube::sort::sort_pairs;

use super::support::{Random, client, down_u32, up_u32};

fn check(keys: &[u32], bits: u32) {
    let values: Vec<u32> = (0..keys.len() as u32).collect();
    let mut expected = values.clone();
    let mask = if bits == 32 { u32::MAX } else { (1 << bits) - 1 };
    // Whole digits are sorted, so bits above the last asked for may count too; the tests leave them empty.
    assert!(keys.iter().all(|key| key & !mask == 0));
    expected.sort_by_key(|&i| keys[i as usize]);
    let (sorted_keys, order) = sort_pairs(client(), up_u32(keys), up_u32(&values), bits).expect("sort");
    assert!(down_u32(&order) == expected, "order of {} keys of {bits} bits", keys.len());
    let expected_keys: Vec<u32> = expected.iter().map(|&i| keys[i as usize]).collect();
    assert!(down_u32(&sorted_keys) == expected_keys, "{} keys of {bits} bits", keys.len());
}

#[test]
fn any_length() {
    let mut random = Random(2);
    for power in [1, 5, 8, 12, 14] {
        let power = 1usize << power;
        for len in [power - 1, power, power + 1] {
            let keys: Vec<u32> = (0..len).map(|_| random.bits() as u32).collect();
            check(&keys, 32);
        }
    }
}

#[test]
fn equal_keys_keep_their_order() {
    check(&[7; 10_000], 32);
    let mut random = Random(3);
    let keys: Vec<u32> = (0..10_000).map(|_| random.bits() as u32 % 3).collect();
    check(&keys, 2);
}

#[test]
fn any_number_of_bits() {
    let mut random = Random(4);
    for bits in [1, 7, 8, 9, 12, 16, 17, 24, 31] {
        let keys: Vec<u32> = (0..5000).map(|_| random.bits() as u32 & ((1 << bits) - 1)).collect();
        check(&keys, bits);
    }
}

#[test]
fn none_and_one() {
    check(&[], 32);
    check(&[9], 32);
}
