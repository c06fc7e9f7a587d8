//! Statistics of classic density control (3DGS, section 5.2), in place.

use rayon::prelude::*;

use crate::config::StatisticsConfig;
use crate::cpu::Real;
use crate::rows::SCREEN;

/// Rows per task; a task is about 20 microseconds.
const BLOCK: usize = 8192;

/// Adds one view: to `gradient` `[N]` the length of the screen gradient `screen` `[N, 4]` in half image sizes, to
/// `views` `[N]` 1 where the radius, the last column of `rows` `[N, C]`, is positive.
///
/// # Panics
/// When the slices disagree in length.
pub fn gather<F: Real>(gradient: &mut [F], views: &mut [F], screen: &[F], rows: &[F], config: &StatisticsConfig) {
    let count = gradient.len();
    let fits = views.len() == count && screen.len() == SCREEN * count && rows.len() == config.columns * count;
    assert!(fits, "views, screen and rows must be [N], [N, {SCREEN}] and [N, {}] for N = {count}", config.columns);
    let [half_width, half_height] = config.halves().map(F::of);
    let first = config.first_column();
    let blocks = gradient.par_chunks_mut(BLOCK).zip(views.par_chunks_mut(BLOCK));
    let blocks = blocks.zip(screen.par_chunks(BLOCK * SCREEN)).zip(rows.par_chunks(BLOCK * config.columns));
    blocks.for_each(|(((gradient, views), screen), rows)| {
        let rows = screen.chunks_exact(SCREEN).zip(rows.chunks_exact(config.columns));
        for ((gradient, views), (screen, row)) in gradient.iter_mut().zip(views).zip(rows) {
            let (x, y) = (screen[first] * half_width, screen[first + 1] * half_height);
            *gradient += (x * x + y * y).sqrt();
            if row[config.columns - 1] > F::of(0.0) {
                *views += F::of(1.0);
            }
        }
    });
}
