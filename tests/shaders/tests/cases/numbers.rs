//! Kernels on lists of numbers.

use gs_kernels::config::{Activation, AdamConfig, FirstColumns, NoiseConfig, StatisticsConfig};
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;
use gs_kernels::cube::{adam, noise, opacity, products, rows_of, scan, sort, statistics, sum};

use super::{Case, On, whole};

pub const CASES: &[Case] = &[
    ("scan", scan),
    ("sort", sort),
    ("sums", sums),
    ("adam", adam),
    ("noise", noise),
    ("statistics", statistics),
    ("opacity", opacity),
    ("products", products),
    ("rows_of", rows_of),
];

/// Numbers of several cubes, the last not full: a cube takes 2048 of them in scans, sorts and sums.
const MANY: usize = 4500;

fn scan(on: &On) -> Result<Vec<Buffer>, CubeError> {
    // One cube, and three that add up what lies before them.
    [700, MANY]
        .into_iter()
        .map(|len| scan::exclusive_scan(on.client, &on.up_u32(&whole(1, len, 900)), len + 1))
        .collect()
}

/// More cubes than one adds up by itself, so that their sums are scanned and added back: the least length that launches
/// the kernel for it.
pub fn long_scan(on: &On) -> Result<(), CubeError> {
    let len = 2048 * 2048 + 1;
    let sums = scan::exclusive_scan(on.client, &on.up_u32(&vec![1; len]), len + 1)?.download::<u32>(on.client)?;
    assert!(sums.into_iter().eq(0..=len as u32), "sums of ones");
    Ok(())
}

fn sort(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let mut sorted = Vec::new();
    for (len, below, bits) in [(MANY, u32::MAX, 32), (300, 6, 3)] {
        let values: Vec<u32> = (0..len as u32).collect();
        let keys = on.up_u32(&whole(2, len, below));
        let (keys, values) = sort::sort_pairs(on.client, keys, on.up_u32(&values), bits)?;
        sorted.extend([keys, values]);
    }
    sorted.push(sort::first_of_keys(on.client, &sorted[2], 7)?);
    Ok(sorted)
}

fn sums(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (values, v) = (on.list(3, MANY, -2.0, 2.0), on.up(&[0.7]));
    let flag = rows_of::zeros(on.client, "flag", 1)?;
    sum::mark_not_finite(on.client, &values, &flag);
    let mut made = vec![sum::sum(on.client, &values)?, sum::largest(on.client, &values)?, flag];
    for activation in [Activation::Exp, Activation::Sigmoid] {
        made.push(sum::activated(on.client, &values, activation, 0.5)?);
        made.push(sum::activated_backward(on.client, &values, &v, activation, 0.5)?);
    }
    let wrong = on.up(&[1.0, f32::NAN, 2.0]);
    let flag = rows_of::zeros(on.client, "flag", 1)?;
    sum::mark_not_finite(on.client, &wrong, &flag);
    made.push(flag);
    Ok(made)
}

fn adam(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let len = 3 * 200;
    let first_columns = Some(FirstColumns { row: 3, count: 1, lr: 0.1 });
    let config = AdamConfig { lr: 0.01, beta1: 0.9, beta2: 0.999, eps: 1e-15, step: 3, first_columns };
    let mut made = [4, 5, 6].map(|seed| on.list(seed, len, -1.0, 1.0)).to_vec();
    made.push(on.list(7, len, 0.0, 1.0));
    adam::step(on.client, &made[0], &made[1], &made[2], &made[3], &config);
    Ok(made)
}

fn noise(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let count = 300;
    let [means, log_scales] = [8, 9].map(|seed| on.list(seed, 3 * count, -3.0, 0.0));
    let (quats, logits) = (on.list(10, 4 * count, -1.0, 1.0), on.list(11, count, -7.0, 2.0));
    noise::perturb(on.client, &means, &quats, &log_scales, &logits, &NoiseConfig::new(0.1, 5, 7));
    Ok(vec![means])
}

fn statistics(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let count = 300;
    let mut made = Vec::new();
    for (columns, absolute) in [(8, false), (1, true)] {
        let [gradient, views] = [12, 13].map(|seed| on.list(seed, count, 0.0, 3.0));
        let (screen, rows) = (on.list(14, 4 * count, -1e-3, 1e-3), on.list(15, columns * count, -5.0, 5.0));
        let config = StatisticsConfig { width: 640, height: 480, absolute, columns };
        statistics::gather(on.client, &gradient, &views, &screen, &rows, &config);
        made.extend([gradient, views]);
    }
    Ok(made)
}

fn opacity(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let [logits, v] = [16, 17].map(|seed| on.list(seed, 300, -6.0, 6.0));
    Ok(vec![opacity::forward(on.client, &logits)?, opacity::backward(on.client, &logits, &v)?])
}

fn products(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (rows, inner, outer) = (700, 3, 5);
    let (a, b) = (on.list(18, rows * inner, -1.0, 1.0), on.list(19, rows * outer, -1.0, 1.0));
    let factors = on.list(20, 700, -1.0, 1.0);
    Ok(vec![
        products::transposed(on.client, &a, &b, inner, outer)?,
        products::column_sums(on.client, &b, outer)?,
        products::dots(on.client, &b, &factors, outer)?,
    ])
}

fn rows_of(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (columns, numbers) = (3, (0..150).map(|row| 2 * row + 1).collect::<Vec<u32>>());
    let (table, rows) = (on.list(21, 301 * columns, -1.0, 1.0), on.up_u32(&numbers));
    let taken = rows_of::take(on.client, &table, columns, &rows)?;
    let sums = rows_of::zeros(on.client, "sums of rows", 301 * columns)?;
    rows_of::add(on.client, &sums, columns, &rows, &taken);
    Ok(vec![taken, sums])
}
