//! The fused Adam step.

use gs_kernels::config::AdamConfig;
use gs_kernels::cpu;
use gs_kernels::cube::adam;

use super::support::{Random, assert_values, client, down, up, wide};

#[test]
fn three_steps() {
    let mut random = Random(50);
    let params = random.list(1000, -1.0, 1.0);
    let (mut p, mut m, mut v) = (wide(&params), vec![0.0; 1000], vec![0.0; 1000]);
    let (b_p, b_m, b_v) = (up(&params), up(&[0.0; 1000]), up(&[0.0; 1000]));
    for step in 1..=3 {
        let config = AdamConfig { lr: 0.01, beta1: 0.9, beta2: 0.999, eps: 1e-15, step, first_columns: None };
        let grads = random.list(1000, -2.0, 2.0);
        cpu::adam::step(&mut p, &wide(&grads), &mut m, &mut v, &config);
        adam::step(client(), &b_p, &up(&grads), &b_m, &b_v, &config);
    }
    assert_values("params", &down(&b_p), &p, 1e-6);
    assert_values("m", &down(&b_m), &m, 1e-6);
    assert_values("v", &down(&b_v), &v, 1e-6);
    assert!(p.iter().zip(&params).all(|(after, &before)| *after != f64::from(before)));
}
