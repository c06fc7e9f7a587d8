//! Sixteen numbers at once: a block of 4 x 4 pixels, or sixteen Gaussians.
//!
//! Implementations of [`Lanes`](crate::cpu::real::Lanes), one per vector unit, chosen at run time. Each rounds the same
//! operations in the same order (fused multiply-add, the same exponential polynomial, the same summation tree), so all
//! give the same bits.

mod dispatch;
mod portable;
pub use portable::Portable;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
