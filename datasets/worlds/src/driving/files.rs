//! Pickled tables of a synthetic log.

use glam::{DMat4, DQuat, DVec3};

use super::lidar::Return;
use super::records::{middle, placed};
use super::rig::Rig;
use gs_driving::layout::{Column, TRUTH_COLUMNS as COLUMNS, table, track};

/// Boxes are written for vehicles and people up to this distance from the ego vehicle, metres.
const BOX_RANGE: f64 = 120.0;

/// The sweep, its exact labels and its semantic classes.
pub(super) fn sweep(rig: &Rig<'_>, returns: &[Return]) -> [Vec<u8>; 3] {
    let world = rig.world();
    let points: Vec<DVec3> = returns.iter().map(|r| world.transform_point3(r.position)).collect();
    let flows: Vec<DVec3> = returns.iter().map(|r| world.transform_vector3(r.flow)).collect();
    let axis = |list: &[DVec3], axis: usize| list.iter().map(|p| p[axis]).collect::<Vec<f64>>();
    let [x, y, z] = [0, 1, 2].map(|i| axis(&points, i));
    let intensity: Vec<f64> = returns.iter().map(|r| r.intensity).collect();
    let times: Vec<f64> = returns.iter().map(|r| rig.clock(r.time)).collect();
    let sensor: Vec<i64> = returns.iter().map(|r| i64::from(r.sensor)).collect();
    let lidar = table(&[
        ("x", Column::F64(&x)),
        ("y", Column::F64(&y)),
        ("z", Column::F64(&z)),
        ("i", Column::F64(&intensity)),
        ("t", Column::F64(&times)),
        ("d", Column::I64(&sensor)),
    ]);
    let flow = [0, 1, 2].map(|i| axis(&flows, i));
    let instance: Vec<i64> = returns.iter().map(|r| i64::from(r.instance)).collect();
    let class: Vec<i64> = returns.iter().map(|r| i64::from(r.class)).collect();
    let semantic: Vec<i64> = returns.iter().map(|r| i64::from(r.semantic)).collect();
    let truth = table(&[
        (COLUMNS[0], Column::F64(&flow[0])),
        (COLUMNS[1], Column::F64(&flow[1])),
        (COLUMNS[2], Column::F64(&flow[2])),
        (COLUMNS[3], Column::I64(&instance)),
        (COLUMNS[4], Column::I64(&class)),
        (COLUMNS[5], Column::I64(&semantic)),
    ]);
    [lidar, truth, table(&[("class", Column::I64(&semantic))])]
}

/// The boxes of a frame, with the columns of PandaSet.
pub(super) fn cuboids(rig: &Rig<'_>, frame: usize) -> Vec<u8> {
    let time = middle(rig, frame);
    let ego: DMat4 = rig.world() * rig.ego(time);
    let near = rig.street.things.iter().filter(|thing| thing.number > 0).map(|thing| (thing, placed(rig, thing, time)));
    let ego = ego.w_axis.truncate().truncate();
    let near: Vec<_> = near.filter(|(_, place)| place.position.distance(ego) <= BOX_RANGE).collect();
    let numbers = |f: &dyn Fn(usize) -> f64| (0..near.len()).map(f).collect::<Vec<f64>>();
    let texts = |f: &dyn Fn(usize) -> Option<String>| (0..near.len()).map(f).collect::<Vec<_>>();
    let body = |i: usize| &near[i].0.body;
    // The box is centred on the body, whose middle may be ahead of its origin.
    let centre = |i: usize| {
        let middle = 0.5 * (body(i).low + body(i).high);
        near[i].1.position.extend(0.0) + DQuat::from_rotation_z(near[i].1.yaw) * middle
    };
    let uuid = texts(&|i| Some(track(near[i].0.number)));
    let label = texts(&|i| Some(body(i).label.to_string()));
    let yaw = numbers(&|i| near[i].1.yaw - std::f64::consts::FRAC_PI_2);
    let stationary: Vec<bool> = near.iter().map(|(_, place)| place.speed.abs() < 0.05).collect();
    let none: Vec<i64> = vec![-1; near.len()];
    let [x, y, z] = [0, 1, 2].map(|axis| numbers(&|i| centre(i)[axis]));
    // Width, length, height.
    let [w, l, h] = [1, 0, 2].map(|axis| numbers(&|i| body(i).size()[axis]));
    let motion = texts(&|i| Some(if stationary[i] { "Stopped" } else { "Moving" }.to_string()));
    let sibling = texts(&|_| Some("-".to_string()));
    let missing = texts(&|_| None);
    table(&[
        ("uuid", Column::Text(&uuid)),
        ("label", Column::Text(&label)),
        ("yaw", Column::F64(&yaw)),
        ("stationary", Column::Bool(&stationary)),
        ("camera_used", Column::I64(&none)),
        ("position.x", Column::F64(&x)),
        ("position.y", Column::F64(&y)),
        ("position.z", Column::F64(&z)),
        ("dimensions.x", Column::F64(&w)),
        ("dimensions.y", Column::F64(&l)),
        ("dimensions.z", Column::F64(&h)),
        ("attributes.object_motion", Column::Text(&motion)),
        ("cuboids.sibling_id", Column::Text(&sibling)),
        ("cuboids.sensor_id", Column::I64(&none)),
        ("attributes.rider_status", Column::Text(&missing)),
        ("attributes.pedestrian_behavior", Column::Text(&missing)),
        ("attributes.pedestrian_age", Column::Text(&missing)),
    ])
}
