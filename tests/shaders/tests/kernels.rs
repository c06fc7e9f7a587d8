//! The kernels step by step: no fault, equal bits in every order of units, and the values of a GPU.

use std::sync::OnceLock;

use cubecl::client::Client;
use gs_kernels::cube::buffer::Buffer;
use gs_shaders::device::{Device, Record};

use crate::cases::{Case, On, all, long_scan};

/// Orders of units and cubes.
const SEEDS: [u64; 2] = [2, 3];

/// Kernels that read shared memory that nobody has written. It must not show: the values differ by the seed, and the
/// bits of the results are the same.
const READS_UNWRITTEN: &[&str] =
    &["gs_kernels::cube::sh::forward::sh_forward_kernel", "gs_kernels::cube::sh::backward::sh_backward_kernel"];

/// Largest difference of values on a GPU, relative to values above 1: exponentials, roots and divisions may be off by
/// some units in the last place, and gradients add up thousands of them.
const TOLERANCE: f32 = 1e-3;

/// The words that each case wrote.
type Results = Vec<(&'static str, Vec<Vec<u32>>)>;

/// All cases in one order.
pub struct Run {
    results: Results,
    /// The shaders and their faults.
    pub record: Record,
}

/// All cases in each order.
pub fn runs() -> &'static [Run] {
    static RUNS: OnceLock<Vec<Run>> = OnceLock::new();
    RUNS.get_or_init(|| {
        std::thread::scope(|scope| {
            let threads = SEEDS.map(|seed| scope.spawn(move || run(seed)));
            threads.map(|thread| thread.join().expect("all cases run")).into()
        })
    })
}

fn run(seed: u64) -> Run {
    let device = Device::open(seed, READS_UNWRITTEN);
    let results = results(&device.client);
    // Four million values are too many for every order.
    if seed == SEEDS[0] {
        long_scan(&On { client: &device.client }).expect("a long scan");
    }
    Run { results, record: device.record() }
}

fn results(client: &Client) -> Results {
    let on = On { client };
    let run = |(name, case): &Case| {
        let made = case(&on).unwrap_or_else(|error| panic!("{name}: {error}"));
        let read = |buffer: &Buffer| buffer.download::<u32>(client).expect("the device works");
        (*name, made.iter().map(read).collect())
    };
    all().map(run).collect()
}

#[test]
fn no_kernel_has_a_fault() {
    for Run { record, .. } in runs() {
        assert!(record.faults.is_empty(), "{}", record.faults.join("\n"));
        let mended: Vec<_> = READS_UNWRITTEN.iter().filter(|name| !record.forgiven.contains(**name)).collect();
        assert!(mended.is_empty(), "these read no such memory any more, so they leave the list: {mended:?}");
    }
}

#[test]
fn no_order_of_units_changes_a_bit() {
    let [first, others @ ..] = runs() else { unreachable!("there is an order") };
    for other in others {
        for ((name, words), (_, expected)) in other.results.iter().zip(&first.results) {
            assert!(words == expected, "{name}: another order of units gives other bits");
        }
    }
}

/// Whether two words are one number, or nearly so. Whole numbers are far below any normal float, so they are equal.
fn agree(a: u32, b: u32) -> bool {
    let [x, y] = [a, b].map(f32::from_bits);
    a == b || x.is_normal() && y.is_normal() && (x - y).abs() <= TOLERANCE * y.abs().max(1.0) || x == y
}

#[test]
fn values_are_those_of_a_gpu() {
    let expected = results(&cubecl::Device::default().client());
    for ((name, made), (_, expected)) in runs()[0].results.iter().zip(&expected) {
        for (k, (words, expected)) in made.iter().zip(expected).enumerate() {
            assert_eq!(words.len(), expected.len(), "{name}: result {k}");
            let wrong = (0..words.len()).find(|i| !agree(words[*i], expected[*i]));
            let shown = wrong.map(|i| [words[i], expected[i]].map(|word| (word, f32::from_bits(word))));
            assert!(wrong.is_none(), "{name}: result {k} at {wrong:?}: {shown:?}");
        }
    }
}
