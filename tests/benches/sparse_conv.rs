//! Useful GFLOP/s of sparse convolution beside those of a large square matrix product; `cargo bench -p gs-tests
//! --bench sparse_conv`.
//!
//! The voxels are those of a street that a LiDAR saw. A pair of rows counts `2 C_in C_out` operations; gathering and
//! adding count nothing, so the rate is that of the work asked for. Figures are processor time of all threads
//! (`GS_BENCH_CLOCK=wall`: time that passes), the best of some runs, and the square product is measured between the
//! convolutions, so that their ratio holds on a machine that is not idle.
#![recursion_limit = "256"]

use std::hint::black_box;

use gs_kernels::cpu::sparse_conv::{
    Channels, Neighbours, PairLists, backward_weights, forward, strided, submanifold, transposed_weights, voxels,
};

#[path = "../../gs-kernels/tests/scenes/clock.rs"]
mod clock;

/// Widths of the layers, input and output.
const WIDTHS: [[usize; 2]; 5] = [[16, 32], [32, 32], [64, 64], [96, 96], [256, 256]];
/// Edge of the voxels, metres.
const VOXEL: f32 = 0.2;
/// Edge of the square matrices.
const SQUARE: usize = 1024;
/// Least time of a measurement, seconds, and least number of runs.
const LEAST: (f64, usize) = (1.0, 3);

fn main() {
    let points = street();
    let start = std::time::Instant::now();
    let found = voxels(&points, VOXEL).expect("points in range");
    let sorted = start.elapsed().as_secs_f64();
    let neighbours = submanifold(&found.coordinates, 3).expect("voxels");
    let searched = start.elapsed().as_secs_f64();
    let lists = PairLists::of(&neighbours);
    let listed = start.elapsed().as_secs_f64();
    let rows = found.coordinates.len();
    println!(
        "{} points, {rows} voxels of {VOXEL} m, {:.1} neighbours of 27; voxels {sorted:.3} s, table {:.3} s, pairs {:.3} s",
        points.len(),
        lists.len() as f64 / rows as f64,
        searched - sorted,
        listed - searched
    );
    println!(
        "| widths | rows | forward | by the input | by the weights | square product | forward share | by input share | by weights share |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for widths in WIDTHS {
        // Wide layers are at coarse levels of a UNet.
        let level = if widths[0] > 96 { 2 } else { 0 };
        layer(widths, &coarser(&found.coordinates, level));
    }
}

/// The table of neighbours `level` times coarser.
fn coarser(coordinates: &[[i32; 4]], level: usize) -> Neighbours {
    match level {
        0 => submanifold(coordinates, 3).expect("voxels"),
        _ => coarser(&strided(coordinates, 2, 2).expect("voxels").0, level - 1),
    }
}

fn layer([wide_in, wide_out]: [usize; 2], neighbours: &Neighbours) {
    let lists = PairLists::of(neighbours);
    let channels = Channels { input: wide_in, output: wide_out };
    let turned = Channels { input: wide_out, output: wide_in };
    let [input, v_output] = [wide_in, wide_out].map(|wide| numbers(lists.inputs * wide));
    let weights = numbers(27 * wide_in * wide_out);
    let work = 2.0 * (lists.len() * wide_in * wide_out) as f64;
    let square = square_rate();
    let rates = [
        work / best(|| drop(black_box(forward(&input, &weights, &lists, false, channels)))),
        work / best(|| {
            let transposed = transposed_weights(&weights, channels);
            drop(black_box(forward(&v_output, &transposed, &lists, true, turned)));
        }),
        work / best(|| drop(black_box(backward_weights(&input, &v_output, &lists, false, channels)))),
    ];
    let square = square.max(square_rate());
    let giga = rates.map(|rate| rate * 1e-9);
    let share = rates.map(|rate| rate / square);
    println!(
        "| {wide_in} -> {wide_out} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} |",
        lists.outputs,
        giga[0],
        giga[1],
        giga[2],
        square * 1e-9,
        share[0],
        share[1],
        share[2]
    );
}

/// Operations a second of a square product on one thread.
fn square_rate() -> f64 {
    let n = SQUARE;
    let (a, b, mut c) = (numbers(n * n), numbers(n * n), vec![0.0_f32; n * n]);
    let step = n as isize;
    let product = || {
        // SAFETY: all three are `n` by `n`, row by row.
        unsafe {
            gemm::gemm(
                n,
                n,
                n,
                c.as_mut_ptr(),
                1,
                step,
                false,
                a.as_ptr(),
                1,
                step,
                b.as_ptr(),
                1,
                step,
                0.0,
                1.0,
                false,
                false,
                false,
                gemm::Parallelism::None,
            );
        }
    };
    2.0 * (n * n * n) as f64 / best(product)
}

/// Seconds of the fastest run.
fn best(mut run: impl FnMut()) -> f64 {
    let wall = std::env::var("GS_BENCH_CLOCK").is_ok_and(|clock| clock == "wall");
    let start = std::time::Instant::now();
    let now = || if wall { start.elapsed().as_secs_f64() } else { clock::cpu_seconds() };
    let (mut least, mut runs) = (f64::INFINITY, 0);
    while runs < LEAST.1 || start.elapsed().as_secs_f64() < LEAST.0 {
        let before = now();
        run();
        least = least.min(now() - before);
        runs += 1;
    }
    least
}

/// Uniform in -1..1, the same on every machine.
fn numbers(count: usize) -> Vec<f32> {
    let mut random = Random(1);
    (0..count).map(|_| 2.0 * random.unit() - 1.0).collect()
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 24) as f32
    }
}

/// What 64 beams see of a street from six positions, 10 m apart: ground with a slope, facades with bays, parked cars,
/// and trees.
fn street() -> Vec<[f32; 3]> {
    let mut random = Random(7);
    let mut points = Vec::new();
    for frame in 0..6 {
        let origin = [10.0 * frame as f32, 0.0, 1.8];
        for beam in 0..64 {
            let tilt = (2.0 - 27.0 * beam as f32 / 63.0).to_radians();
            for turn in 0..1800 {
                let (sin, cos) = (turn as f32 * 0.2_f32.to_radians()).sin_cos();
                let direction = [cos * tilt.cos(), sin * tilt.cos(), tilt.sin()];
                points.extend(hit(origin, direction, &mut random));
            }
        }
    }
    points
}

/// Where a ray ends, with two centimetres of noise.
fn hit(origin: [f32; 3], direction: [f32; 3], random: &mut Random) -> Option<[f32; 3]> {
    let mut range = 0.5_f32;
    // A walk in steps that grow: surfaces are thicker than a step.
    while range < 80.0 {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| origin[axis] + range * direction[axis]);
        let bay = if (x * 0.25).sin() > 0.6 { 1.5 } else { 0.0 };
        let facade = y.abs() > 14.0 + bay && z < 12.0;
        let car = (y.abs() - 6.0).abs() < 0.9 && x.rem_euclid(7.0) < 4.3 && z < 1.5;
        let tree = (y.abs() - 9.0).powi(2) + (x.rem_euclid(12.0) - 6.0).powi(2);
        let leaves = tree + (z - 5.0).powi(2) < 4.0 && random.unit() < 0.1;
        if z < 0.02 * x.sin() + 0.01 * y || facade || car || (tree < 0.04 && z < 4.0) || leaves {
            return Some([x, y, z].map(|c| c + 0.04 * (random.unit() - 0.5)));
        }
        range += 0.05 + 0.001 * range;
    }
    None
}
