//! Shared code of forward and backward: a run of Gaussians, and the number of coefficients as a constant.

use crate::config::ShConfig;
use crate::cpu::math::Vec3;

/// Gaussians from `first` on.
pub(super) struct Chunk<'a, F> {
    pub(super) means: &'a [F],
    pub(super) sh: &'a [F],
    pub(super) projected: &'a [F],
    pub(super) config: &'a ShConfig,
    pub(super) centre: Vec3<F>,
    pub(super) first: usize,
}

/// Evaluates `$body` with `$used` standing for the number of coefficients in use, a constant: loops of known length are
/// unrolled.
macro_rules! with_used {
    ($config:expr, $used:ident => $body:expr) => {
        match $config.degree {
            0 => {
                const $used: usize = 1;
                $body
            }
            1 => {
                const $used: usize = 4;
                $body
            }
            2 => {
                const $used: usize = 9;
                $body
            }
            _ => {
                const $used: usize = 16;
                $body
            }
        }
    };
}

pub(super) fn check<F>(means: &[F], sh: &[F], projected: &[F], config: &ShConfig) -> usize {
    let count = means.len() / 3;
    assert_eq!(sh.len(), count * config.coefficients * 3, "sh must be [N, S, 3] for {count} means");
    assert_eq!(projected.len(), count * crate::rows::PROJECTED, "projected must be [N, 8] for {count} means");
    assert!(used(config) <= config.coefficients, "active degree above the stored one");
    count
}

fn used(config: &ShConfig) -> usize {
    ((config.degree.min(3) + 1) * (config.degree.min(3) + 1)) as usize
}

pub(super) use with_used;
