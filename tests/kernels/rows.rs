//! `gs_burn::ops::rows`.

use burn::tensor::{DType, Int, Tensor, TensorData};
use gs_burn::ops::rows::{add_rows, take_rows};
use gs_tests::devices::{Place, everywhere};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

const ROWS: usize = 900;
const COLUMNS: usize = 6;

fn numbers(place: &Place, rows: &[usize]) -> Tensor<1, Int> {
    let rows: Vec<i32> = rows.iter().map(|row| *row as i32).collect();
    let count = rows.len();
    Tensor::from_data(TensorData::new(rows, [count]), (&place.device, DType::I32))
}

/// Whole numbers, so that every sum is exact.
#[test]
fn rows_are_taken_added_to_and_hand_their_gradient_back() {
    let chosen: Vec<usize> = (0..ROWS).filter(|row| row % 3 == 1).rev().collect();
    let mut random = Random::new(4);
    let mut whole =
        |count: usize| -> Vec<f64> { random.values(count, -50.0, 50.0).iter().map(|x| x.round()).collect() };
    let (table, more) = (whole(ROWS * COLUMNS), whole(chosen.len() * COLUMNS));
    let of_row = |values: &[f64], row: usize| values[row * COLUMNS..(row + 1) * COLUMNS].to_vec();
    for place in everywhere() {
        let rows = numbers(place, &chosen);
        let (leaf, extra) = (place.leaf(&table, [ROWS, 3, 2]), place.leaf(&more, [chosen.len(), 3, 2]));
        let taken = take_rows(leaf.clone(), &rows);
        let expected: Vec<f64> = chosen.iter().flat_map(|row| of_row(&table, *row)).collect();
        assert_eq!(values(&taken), expected, "{}", place.name);
        let added = add_rows(leaf.clone(), &rows, extra.clone());
        let mut sums = table.clone();
        for (k, row) in chosen.iter().enumerate() {
            (0..COLUMNS).for_each(|c| sums[row * COLUMNS + c] += more[k * COLUMNS + c]);
        }
        assert_eq!(values(&added), sums, "{}", place.name);
        assert_eq!(values(&leaf), table, "a shared table keeps its values");
        // taken * 2 + added: 3 in the chosen rows, 1 in the others; 1 by what was added.
        let gradients = (taken.sum() * 2.0 + added.sum()).backward();
        let of_table = values(&leaf.grad(&gradients).expect("tracked"));
        let expected = (0..ROWS * COLUMNS).map(|i| if i / COLUMNS % 3 == 1 { 3.0 } else { 1.0 });
        assert_eq!(of_table, expected.collect::<Vec<f64>>(), "{}", place.name);
        assert!(values(&extra.grad(&gradients).expect("tracked")).iter().all(|g| *g == 1.0), "{}", place.name);
    }
}

#[test]
fn no_rows_are_a_shape() {
    for place in everywhere() {
        let (none, table) = (numbers(place, &[]), place.tensor(&[1.0; 6], [2, 3]));
        assert_eq!(take_rows(table.clone(), &none).dims(), [0, 3], "{}", place.name);
        assert_eq!(values(&add_rows(table, &none, place.tensor(&[], [0, 3]))), [1.0; 6], "{}", place.name);
    }
}
