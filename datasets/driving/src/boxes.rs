//! Labels of points from labelled boxes: which box a point is in, and how that box moves to the next frame.

use glam::DVec3;
use gs_base::median;
use gs_datasets::DatasetError;
use rayon::prelude::*;

use crate::sweep::{Cuboid, Labels, ObjectClass, Sweep};

/// Boxes are enlarged by this on each side, metres, so that points of mirrors and of the noise of ranging are inside;
/// the labels of Argoverse 2 use 0.2 m in length and width, which is 0.1 m a side.
const MARGIN: f64 = 0.1;

/// Height of the lowest part of a box that moves, metres, whose points have no known flow: boxes stand on the road and
/// hold more of it than of tyres. The protocol of Argoverse 2 leaves out what is within 0.3 m of the ground.
const ROAD: f64 = 0.15;
/// Displacement in [`FLOW_INTERVAL`] from which on a point or a box moves, metres (0.5 m/s; Argoverse 2).
pub const MOVING_FLOW: f64 = 0.05;

/// The interval of flow, seconds.
pub const FLOW_INTERVAL: f64 = 0.1;

/// Longest time between two frames whose boxes are compared for flow, seconds: one frame may be missing.
const PAIR_MAX: f64 = 0.25;
/// Least and greatest time between the points of an object in two frames, as a share of that between the frames. A
/// LiDAR that turns may slip by a turn; an object where its turns begin is seen at the end of one and the start of the
/// next, and its box is of neither time.
const SIGHTINGS: [f64; 2] = [0.5, 2.5];
/// The LiDAR whose box says how an object moves that two LiDARs see: that of the other is interpolated by the numbers
/// of the frames, though its turns slip.
const LEADING: u8 = 0;

/// Boxes and points of a frame.
pub(crate) struct Boxed {
    pub boxes: Vec<Cuboid>,
    /// Without points where the boxes are those of the frame's time.
    pub sweep: Sweep,
}

impl Boxed {
    /// Boxes of a data set that places them at the time of the frame.
    pub fn at_frame_time(boxes: Vec<Cuboid>) -> Self {
        Self { boxes, sweep: Sweep::default() }
    }
}

/// Labels of points from the boxes of their frame and of the next one, which `later` reads and which is `interval`
/// seconds later. A point outside of all boxes is background that does not move; a point in several boxes belongs to
/// the smallest; how the lowest points of a box that moves move is not known. Boxes of one LiDAR move in the time
/// between their points in the two sweeps.
pub(crate) fn labels(
    sweep: &Sweep,
    boxes: &[Cuboid],
    interval: Option<f64>,
    later: impl FnOnce() -> Result<Option<Boxed>, DatasetError>,
) -> Result<Labels, DatasetError> {
    let interval = interval.filter(|interval| *interval <= PAIR_MAX);
    let next = if interval.is_some() { later()? } else { None };
    Ok(of_boxes(sweep, boxes, next.as_ref().zip(interval)))
}

/// Whether a box holds a point of a LiDAR.
fn holds(cuboid: &Cuboid, point: &[f32; 3], sensor: u8) -> bool {
    let point = DVec3::from_array(point.map(f64::from));
    cuboid.sensor.is_none_or(|only| only == sensor)
        && point.distance_squared(cuboid.centre) <= (0.5 * cuboid.size.length() + 2.0 * MARGIN).powi(2)
        && cuboid.contains(point, MARGIN)
}

/// The median time of the points in a box of one LiDAR, seconds.
fn sighting(sweep: &Sweep, cuboid: &Cuboid) -> Option<f64> {
    cuboid.sensor?;
    let inside = |index: &usize| holds(cuboid, &sweep.points[*index], sweep.sensor[*index]);
    median((0..sweep.len()).filter(inside).map(|index| sweep.times[index]).collect())
}

fn of_boxes(sweep: &Sweep, boxes: &[Cuboid], next: Option<(&Boxed, f64)>) -> Labels {
    let mut order: Vec<&Cuboid> = boxes.iter().collect();
    order.sort_by(|a, b| a.size.element_product().total_cmp(&b.size.element_product()));
    let mut tracks: Vec<String> = order.iter().map(|cuboid| cuboid.track.clone()).collect();
    tracks.sort_unstable();
    tracks.dedup();
    let instances: Vec<u32> =
        order.iter().map(|cuboid| 1 + tracks.binary_search(&cuboid.track).unwrap_or_default() as u32).collect();
    let classes: Vec<ObjectClass> = order.iter().map(|cuboid| ObjectClass::of_label(&cuboid.label)).collect();
    // The box by which an object moves, that box in the next frame, and 0.1 s as a share of the time until then.
    let motion = |index: usize| {
        let ((next, interval), cuboid) = (next?, order[index]);
        let leads = |other: &&Cuboid| other.track == cuboid.track && other.sensor == Some(LEADING);
        let later = |before: &Cuboid| next.boxes.iter().find(|after| after.id == before.id);
        let leading = order.iter().copied().find(leads).and_then(|before| Some((before, later(before)?)));
        let (before, after) = leading.or_else(|| Some((cuboid, later(cuboid)?)))?;
        let between = sighting(sweep, before).zip(sighting(&next.sweep, after)).map(|(from, to)| to - from);
        let bounds = SIGHTINGS[0] * interval..=SIGHTINGS[1] * interval;
        Some((before, after, FLOW_INTERVAL / between.filter(|between| bounds.contains(between)).unwrap_or(interval)))
    };
    let motions: Vec<Option<(&Cuboid, &Cuboid, f64)>> = (0..order.len()).into_par_iter().map(motion).collect();
    let points = sweep.points.par_iter().zip(&sweep.sensor);
    let inside: Vec<Option<usize>> =
        points.map(|(point, sensor)| order.iter().position(|cuboid| holds(cuboid, point, *sensor))).collect();
    let flow = |(point, found): (&[f32; 3], &Option<usize>)| match found {
        None => Some([0.0; 3]),
        Some(index) => {
            let ((before, after, scale), point) = (motions[*index]?, DVec3::from_array(point.map(f64::from)));
            let flow = scale * (after.world(before.local(point)) - point);
            let cuboid = order[*index];
            let is_low = cuboid.local(point).z < ROAD - 0.5 * cuboid.size.z;
            (!is_low || flow.length() < MOVING_FLOW).then(|| flow.as_vec3().to_array())
        }
    };
    Labels {
        class: inside.iter().map(|found| found.map_or(ObjectClass::Background, |index| classes[index])).collect(),
        instance: inside.iter().map(|found| found.map_or(0, |index| instances[index])).collect(),
        flow: sweep.points.iter().zip(&inside).map(flow).collect(),
        tracks,
        semantic: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(x: f64, sensor: Option<u8>) -> Cuboid {
        Cuboid {
            track: "a car".to_string(),
            label: "Car".to_string(),
            centre: DVec3::new(x, 0.0, 1.0),
            size: DVec3::new(4.0, 2.0, 2.0),
            yaw: 0.0,
            sensor,
            id: format!("a car, {sensor:?}"),
        }
    }

    /// A sweep of two LiDARs with a point each on a car at places, at times.
    fn sweep(places: [f64; 2], times: [f64; 2]) -> Sweep {
        let points = places.map(|x| [x as f32, 0.5, 1.0]).to_vec();
        Sweep { points, times: times.to_vec(), sensor: vec![0, 1], intensity: vec![0.0; 2], ..Sweep::default() }
    }

    /// A car of 10 m/s. The second LiDAR slips by a turn before the next frame, and its boxes, interpolated over
    /// frames, do not say so: the motion is that of the first LiDAR's box, over the time between its points.
    #[test]
    fn motion_is_over_the_time_between_sightings() {
        let boxes = [cuboid(0.0, Some(0)), cuboid(-0.5, Some(1))];
        let this = sweep([0.0, -0.5], [0.02, -0.03]);
        let boxed = || Boxed {
            boxes: vec![cuboid(1.0, Some(0)), cuboid(1.4, Some(1))],
            sweep: sweep([1.0, 1.4], [0.12, 0.16]),
        };
        let labels = labels(&this, &boxes, Some(0.1), || Ok(Some(boxed()))).expect("labels");
        for flow in &labels.flow {
            let flow = flow.expect("known");
            assert!((flow[0] - 1.0).abs() < 1e-6 && flow[1] == 0.0, "{flow:?}");
        }
        // Without the first LiDAR's box in the next frame, its own says it: 1.9 m in 0.19 s.
        let own = || Ok(Some(Boxed { boxes: vec![cuboid(1.4, Some(1))], ..boxed() }));
        let labels = super::labels(&this, &boxes, Some(0.1), own).expect("labels");
        assert!((labels.flow[1].expect("known")[0] - 1.0).abs() < 1e-6 && labels.flow[0].is_none());
        // A box of no LiDAR is that of the frame's time.
        let later = || Ok(Some(Boxed { boxes: vec![cuboid(1.2, None)], sweep: sweep([1.2; 2], [0.12; 2]) }));
        let labels = super::labels(&sweep([0.0; 2], [0.0; 2]), &[cuboid(0.0, None)], Some(0.1), later);
        assert!((labels.expect("labels").flow[0].expect("known")[0] - 1.2).abs() < 1e-6);
    }

    /// The road in a box that moves has no known flow; the road in one that rests, rests with it.
    #[test]
    fn the_road_under_a_car_does_not_move_with_it() {
        let mut sweep = sweep([0.0; 2], [0.0; 2]);
        sweep.points = vec![[0.0, 0.5, 0.1], [0.0, 0.5, 0.3]];
        let flow = |x: f64| {
            let later = || Ok(Some(Boxed::at_frame_time(vec![cuboid(x, None)])));
            labels(&sweep, &[cuboid(0.0, None)], Some(0.1), later).expect("labels").flow
        };
        assert!(matches!(flow(1.0)[..], [None, Some([x, ..])] if (x - 1.0).abs() < 1e-6));
        assert!(flow(0.01).iter().all(Option::is_some));
    }
}
