//! `gs_burn::ops::products`: sums over many rows.

use gs_burn::ops::products::{affine, scaled, transposed_product};
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{bits, values};

/// Rows around one group of a unit, one group of groups (256 x 1,024), and none.
const ROWS: [usize; 5] = [0, 1, 256, 257, 270_000];

/// Whole numbers of at most 3, so that every sum below 2^24 is exact.
fn whole(count: usize, seed: u64) -> Vec<f64> {
    Random::new(seed).values(count, -3.4, 3.4).iter().map(|x| x.round()).collect()
}

#[test]
fn gradients_of_a_layer_are_sums_over_rows() {
    for place in everywhere() {
        for rows in ROWS {
            let (input, weight, bias) = (whole(rows * 3, 1), whole(6, 2), whole(2, 3));
            let pull = whole(rows * 2, 4);
            let x = place.leaf(&input, [rows, 3]);
            let (w, b) = (place.leaf(&weight, [3, 2]), place.leaf(&bias, [2]));
            let output = affine(x.clone(), w.clone(), b.clone());
            let expected: Vec<f64> = (0..rows * 2)
                .map(|k| bias[k % 2] + (0..3).map(|i| input[k / 2 * 3 + i] * weight[i * 2 + k % 2]).sum::<f64>())
                .collect();
            assert_eq!(values(&output), expected, "{rows} rows on {}", place.name);
            if rows == 0 {
                continue;
            }
            let gradients = (output * place.tensor(&pull, [rows, 2])).sum().backward();
            let of_weight = |i: usize, j: usize| (0..rows).map(|r| input[r * 3 + i] * pull[r * 2 + j]).sum::<f64>();
            let expected: Vec<f64> = (0..6).map(|k| of_weight(k / 2, k % 2)).collect();
            assert_eq!(values(&w.grad(&gradients).expect("tracked")), expected, "{rows} rows on {}", place.name);
            let of_input = |k: usize| (0..2).map(|j| pull[k / 3 * 2 + j] * weight[k % 3 * 2 + j]).sum::<f64>();
            let expected: Vec<f64> = (0..rows * 3).map(of_input).collect();
            assert_eq!(values(&x.grad(&gradients).expect("tracked")), expected, "{rows} rows on {}", place.name);
            let expected: Vec<f64> = (0..2).map(|j| pull.iter().skip(j).step_by(2).sum()).collect();
            assert_eq!(values(&b.grad(&gradients).expect("tracked")), expected, "{rows} rows on {}", place.name);
            let transposed = transposed_product(place.tensor(&input, [rows, 3]), place.tensor(&pull, [rows, 2]));
            assert_eq!(values(&transposed), (0..6).map(|k| of_weight(k / 2, k % 2)).collect::<Vec<_>>());
        }
    }
}

#[test]
fn gradients_of_factors_are_sums_over_rows() {
    for place in everywhere() {
        for rows in [1, 300, 140_000] {
            let (factors, table, pull) = (whole(3, 5), whole(rows * 2, 6), whole(rows * 6, 7));
            let (f, t) = (place.leaf(&factors, [3]), place.leaf(&table, [rows, 2]));
            let output = scaled(f.clone(), t.clone());
            let expected: Vec<f64> = factors.iter().flat_map(|f| table.iter().map(move |x| f * x)).collect();
            assert_eq!(values(&output), expected, "{rows} rows on {}", place.name);
            let gradients = (output * place.tensor(&pull, [3, rows, 2])).sum().backward();
            let line = |s: usize| pull[s * rows * 2..(s + 1) * rows * 2].iter().zip(&table).map(|(v, x)| v * x).sum();
            let expected: Vec<f64> = (0..3).map(line).collect();
            assert_eq!(values(&f.grad(&gradients).expect("tracked")), expected, "{rows} rows on {}", place.name);
            let expected: Vec<f64> =
                (0..rows * 2).map(|k| (0..3).map(|s| factors[s] * pull[s * rows * 2 + k]).sum()).collect();
            assert_eq!(values(&t.grad(&gradients).expect("tracked")), expected, "{rows} rows on {}", place.name);
        }
    }
}

#[test]
fn products_are_equal_to_the_bit() {
    let (a, b) = (Random::new(8).values(70_000 * 3, -1.0, 1.0), Random::new(9).values(70_000 * 2, -1.0, 1.0));
    for place in everywhere().filter(|place| !place.is_double()) {
        let once = |_| bits(&transposed_product(place.tensor(&a, [70_000, 3]), place.tensor(&b, [70_000, 2])));
        assert!((0..3).map(once).all(|result| result == once(0)), "{}", place.name);
    }
}
