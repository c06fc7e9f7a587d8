//! Prefix sums against a loop.

use gs_kernels::cube::scan::exclusive_scan;

use super::support::{Random, client, down_u32, up_u32};

fn expected(values: &[u32], out_len: usize) -> Vec<u32> {
    let mut sum = 0u32;
    (0..out_len)
        .map(|k| {
            let before = sum;
            sum = sum.saturating_add(values.get(k).copied().unwrap_or(0));
            before
        })
        .collect()
}

fn check(values: &[u32], out_len: usize) {
    let sums = exclusive_scan(client(), &up_u32(values), out_len).expect("scan");
    assert!(down_u32(&sums) == expected(values, out_len), "{} values, {out_len} sums", values.len());
}

#[test]
fn any_length() {
    let mut random = Random(1);
    for power in [0, 1, 5, 8, 11, 13, 16] {
        let power = 1usize << power;
        for len in [power - 1, power, power + 1] {
            let values: Vec<u32> = (0..len).map(|_| random.bits() as u32 % 1000).collect();
            check(&values, len + 1);
            check(&values, len);
        }
    }
}

#[test]
fn three_levels() {
    let len = 2048 * 2048 + 3;
    check(&vec![1; len], len + 1);
}

#[test]
fn overflow_saturates() {
    let mut values = vec![u32::MAX / 100; 5000];
    values[4000] = 7;
    check(&values, 5001);
}
