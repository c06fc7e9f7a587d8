//! Sparse convolution of a table whose only neighbour is behind the first 32.

use gs_kernels::cpu::sparse_conv::{Channels, Neighbours};
use gs_kernels::cube::sparse_conv::{Table, device_table, forward};

use super::support::{client, down, up, up_u32};

#[test]
fn one_row_is_convolved() {
    let neighbours = Neighbours { inputs: 1, outputs: 1, offsets: 33, table: [vec![-1; 32], vec![0]].concat() };
    let values: Vec<u32> = device_table(&neighbours).into_iter().map(|value| value as u32).collect();
    let table = Table { values: &up_u32(&values), inputs: 1, outputs: 1, offsets: 33, flip: false };
    let weights: Vec<f32> = (0..33).map(|k| k as f32).collect();
    let channels = Channels { input: 1, output: 1 };
    let found = forward(client(), &up(&[2.0]), &up(&weights), &table, channels).expect("forward");
    assert_eq!(down(&found), [64.0]);
}
