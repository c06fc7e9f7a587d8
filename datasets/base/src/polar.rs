//! The polar decomposition of a linear map.

use glam::DMat3;

/// The orthogonal factor of the polar decomposition, by Newton's iteration; `None` where the map is flat.
pub fn orthogonal(mut map: DMat3) -> Option<DMat3> {
    // Each round halves the distance of a size from 1: 60 reach any map that double precision can invert.
    for _ in 0..60 {
        let next = (map + map.inverse().transpose()) * 0.5;
        let change = (next - map).to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        map = next;
        if change < 1e-14 {
            break;
        }
    }
    let apart = map.transpose() * map - DMat3::IDENTITY;
    apart.to_cols_array().iter().all(|x| x.abs() < 1e-9).then_some(map)
}
