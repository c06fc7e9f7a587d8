use super::backward::ChunkBackward;
use super::batch::Scene;
use super::forward::ChunkForward;
use crate::config::ProjectionConfig;
use crate::cpu::Real;
use crate::cpu::lanes::Portable;
use crate::cpu::real::LaneTask;
use crate::rows::PROJECTED;

/// Numbers in -1..1, some of them invalid.
fn strange(count: usize, seed: u32) -> Vec<f32> {
    let number = |i: u32| match i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 16 {
        0..64 => f32::NAN,
        64..128 => f32::INFINITY,
        128..192 => 1e30,
        192..256 => 0.0,
        other => f32::from(other as u16) / 32_768.0 - 1.0,
    };
    (0..count as u32).map(number).collect()
}

#[test]
fn every_vector_unit_gives_the_same_bits() {
    let count = 1000;
    let (mut means, quats, log_scales) = (strange(3 * count, 1), strange(4 * count, 2), strange(3 * count, 3));
    means.iter_mut().skip(2).step_by(3).for_each(|z| *z += 1.5);
    let viewmat: Vec<f32> = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.01 * i as f32 }).collect();
    let config = ProjectionConfig {
        width: 60,
        height: 40,
        fx: 50.0,
        fy: 55.0,
        cx: 31.0,
        cy: 19.0,
        antialiased: true,
        ..Default::default()
    };
    let (scene, _) = Scene::new(&means, &quats, &log_scales, &viewmat, &config);
    let bits = |values: &[f32]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let (mut rows, mut portable) = (vec![0.0; count * PROJECTED], vec![0.0; count * PROJECTED]);
    f32::with_lanes(ChunkForward { scene: &scene, first: 0, rows: &mut rows });
    ChunkForward { scene: &scene, first: 0, rows: &mut portable }.run::<Portable<f32>>();
    assert!(rows.chunks(PROJECTED).filter(|row| row[7] > 0.0).count() > count / 2);
    assert!(bits(&rows) == bits(&portable), "rows");

    let v: Vec<f32> = (0..count * PROJECTED).map(|i| (i % 13) as f32 - 6.0).collect();
    let mut gradients = [(); 2].map(|()| (vec![0.0; 3 * count], vec![0.0; 4 * count], vec![0.0; 3 * count]));
    let [poses_lanes, poses_portable] = {
        let [first, second] = &mut gradients;
        let task = |to: &mut (Vec<f32>, Vec<f32>, Vec<f32>), best: bool| {
            let (means, quats, log_scales) = (&mut to.0[..], &mut to.1[..], &mut to.2[..]);
            let (scene, projected, v_projected) = (&scene, &rows[..], &v[..]);
            let task = ChunkBackward { scene, first: 0, projected, v_projected, means, quats, log_scales };
            if best { f32::with_lanes(task) } else { task.run::<Portable<f32>>() }
        };
        [task(first, true), task(second, false)]
    };
    let [lanes, portable] = &gradients;
    assert!(lanes.0.iter().any(|g| *g != 0.0));
    assert!(bits(&lanes.0) == bits(&portable.0), "means");
    assert!(bits(&lanes.1) == bits(&portable.1), "quats");
    assert!(bits(&lanes.2) == bits(&portable.2), "log_scales");
    assert!(bits(&poses_lanes.into_viewmat()) == bits(&poses_portable.into_viewmat()), "viewmat");
}
