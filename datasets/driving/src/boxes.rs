//! Labels of points from labelled boxes: which box a point is in, and how that box moves to the next frame.

use glam::DVec3;
use gs_datasets::DatasetError;
use rayon::prelude::*;

use crate::sweep::{Cuboid, Labels, ObjectClass, Sweep};

/// Boxes are enlarged by this on each side, metres, so that points of mirrors and of the noise of ranging are inside;
/// the labels of Argoverse 2 use 0.2 m in length and width, which is 0.1 m a side.
const MARGIN: f64 = 0.1;

/// The interval of flow, seconds.
pub const FLOW_INTERVAL: f64 = 0.1;

/// Longest time between two frames whose boxes are compared for flow, seconds: one frame may be missing.
const PAIR_MAX: f64 = 0.25;

/// Labels of points from the boxes of their frame and of the next one, which `later` reads and which is `interval`
/// seconds later. A point outside of all boxes is background that does not move; a point in several boxes belongs to
/// the smallest.
pub(crate) fn labels(
    sweep: &Sweep,
    boxes: &[Cuboid],
    interval: Option<f64>,
    later: impl FnOnce() -> Result<Option<Vec<Cuboid>>, DatasetError>,
) -> Result<Labels, DatasetError> {
    let interval = interval.filter(|interval| *interval <= PAIR_MAX);
    let next = if interval.is_some() { later()? } else { None };
    Ok(of_boxes(&sweep.points, &sweep.sensor, boxes, next.as_deref().zip(interval)))
}

fn of_boxes(points: &[[f32; 3]], sensor: &[u8], boxes: &[Cuboid], next: Option<(&[Cuboid], f64)>) -> Labels {
    let mut order: Vec<&Cuboid> = boxes.iter().collect();
    order.sort_by(|a, b| a.size.element_product().total_cmp(&b.size.element_product()));
    let mut tracks: Vec<String> = order.iter().map(|cuboid| cuboid.track.clone()).collect();
    tracks.sort_unstable();
    tracks.dedup();
    let instances: Vec<u32> =
        order.iter().map(|cuboid| 1 + tracks.binary_search(&cuboid.track).unwrap_or_default() as u32).collect();
    let classes: Vec<ObjectClass> = order.iter().map(|cuboid| ObjectClass::of_label(&cuboid.label)).collect();
    let same = |cuboid: &Cuboid| next?.0.iter().find(|other| other.id == cuboid.id);
    let later: Vec<Option<&Cuboid>> = order.iter().map(|cuboid| same(cuboid)).collect();
    let scale = next.map_or(1.0, |(_, interval)| FLOW_INTERVAL / interval);
    let inside: Vec<Option<usize>> = points
        .par_iter()
        .zip(sensor)
        .map(|(point, sensor)| {
            let point = DVec3::from_array(point.map(f64::from));
            order.iter().position(|cuboid| {
                cuboid.sensor.is_none_or(|only| only == *sensor)
                    && point.distance_squared(cuboid.centre) <= (0.5 * cuboid.size.length() + 2.0 * MARGIN).powi(2)
                    && cuboid.contains(point, MARGIN)
            })
        })
        .collect();
    let flow = |(point, found): (&[f32; 3], &Option<usize>)| match found {
        None => Some([0.0; 3]),
        Some(index) => later[*index].map(|after| {
            let point = DVec3::from_array(point.map(f64::from));
            (scale * (after.world(order[*index].local(point)) - point)).as_vec3().to_array()
        }),
    };
    Labels {
        class: inside.iter().map(|found| found.map_or(ObjectClass::Background, |index| classes[index])).collect(),
        instance: inside.iter().map(|found| found.map_or(0, |index| instances[index])).collect(),
        flow: points.iter().zip(&inside).map(flow).collect(),
        tracks,
        semantic: Vec::new(),
    }
}
