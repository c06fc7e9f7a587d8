//! [`Sweep`]: the LiDAR points of one frame, with labels where a data set has them; [`Cuboid`]: a labelled box.

use glam::DVec3;

/// The classes of the bucketed evaluation of scene flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ObjectClass {
    /// In no box: ground, buildings, plants, signs.
    #[default]
    Background,
    /// Cars, pickups and vans.
    Car,
    /// Lorries, buses, trams, trailers and anything else with an engine.
    OtherVehicle,
    /// People on foot.
    Pedestrian,
    /// People on two wheels, and wheelchairs and scooters.
    WheeledVru,
}

impl ObjectClass {
    /// All classes.
    pub const ALL: [Self; 5] = [Self::Background, Self::Car, Self::OtherVehicle, Self::Pedestrian, Self::WheeledVru];

    /// As the evaluation prints it: "background", "car", "other vehicle", "pedestrian", "wheeled VRU".
    pub fn name(self) -> &'static str {
        match self {
            Self::Background => "background",
            Self::Car => "car",
            Self::OtherVehicle => "other vehicle",
            Self::Pedestrian => "pedestrian",
            Self::WheeledVru => "wheeled VRU",
        }
    }

    /// The class of a box by its label in PandaSet, Argoverse 2 or Waymo, which has one label for all vehicles. Boxes
    /// around things that stand (cones, signs, bollards) are background.
    pub fn of_label(label: &str) -> Self {
        const CAR: [&str; 6] =
            ["Car", "Pickup Truck", "Uncommon vehicle", "REGULAR_VEHICLE", "RIDEABLE", "TYPE_VEHICLE"];
        const WHEELED: [&str; 13] = [
            "Bicycle",
            "Motorcycle",
            "Motorized Scooter",
            "Personal Mobility Device",
            "BICYCLE",
            "BICYCLIST",
            "MOTORCYCLE",
            "MOTORCYCLIST",
            "WHEELED_DEVICE",
            "WHEELED_RIDER",
            "WHEELCHAIR",
            "STROLLER",
            "TYPE_CYCLIST",
        ];
        const OTHER: [&str; 19] = [
            "Medium-sized Truck",
            "Semi-truck",
            "Other Vehicle - Construction Vehicle",
            "Other Vehicle - Emergency",
            "Other Vehicle - Pedicab",
            "Other Vehicle - Uncommon",
            "Emergency Vehicle",
            "Bus",
            "Train",
            "Tram / Subway",
            "Towed Object",
            "LARGE_VEHICLE",
            "BUS",
            "SCHOOL_BUS",
            "ARTICULATED_BUS",
            "BOX_TRUCK",
            "TRUCK",
            "TRUCK_CAB",
            "VEHICULAR_TRAILER",
        ];
        if CAR.contains(&label) {
            Self::Car
        } else if WHEELED.contains(&label) {
            Self::WheeledVru
        } else if OTHER.contains(&label) || label == "RAILED_VEHICLE" {
            Self::OtherVehicle
        } else if label.starts_with("Pedestrian")
            || matches!(label, "PEDESTRIAN" | "OFFICIAL_SIGNALER" | "TYPE_PEDESTRIAN")
        {
            Self::Pedestrian
        } else {
            Self::Background
        }
    }
}

/// A labelled box at a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Cuboid {
    /// The object's name, the same in all frames.
    pub track: String,
    /// The label as the data set writes it.
    pub label: String,
    /// Centre, metres, centred world.
    pub centre: DVec3,
    /// Length (along the heading), width and height, metres.
    pub size: DVec3,
    /// Angle of the heading from the x axis of the world, radians, counter-clockwise from above.
    pub yaw: f64,
    /// The one LiDAR whose points the box holds; `None`: all.
    pub sensor: Option<u8>,
    /// The next frame's box of the same object has this name; it differs from `track` where two LiDARs have a box each.
    pub(crate) id: String,
}

impl Cuboid {
    /// A position in the box's own axes: along the heading, to its left, up; metres from the centre.
    pub fn local(&self, point: DVec3) -> DVec3 {
        let (sin, cos) = self.yaw.sin_cos();
        let d = point - self.centre;
        DVec3::new(cos * d.x + sin * d.y, cos * d.y - sin * d.x, d.z)
    }

    /// The world position of a position in the box's own axes.
    pub fn world(&self, local: DVec3) -> DVec3 {
        let (sin, cos) = self.yaw.sin_cos();
        self.centre + DVec3::new(cos * local.x - sin * local.y, sin * local.x + cos * local.y, local.z)
    }

    /// Whether a position lies in the box, enlarged by `margin` metres on the four sides.
    pub fn contains(&self, point: DVec3, margin: f64) -> bool {
        let half = 0.5 * self.size + DVec3::new(margin, margin, 0.0);
        self.local(point).abs().cmple(half).all()
    }
}

/// True values of the points of a sweep. All lists have one entry a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Labels {
    /// The class of the object that the point is on.
    pub class: Vec<ObjectClass>,
    /// 0: on no object; otherwise 1 + the place in [`tracks`](Labels::tracks).
    pub instance: Vec<u32>,
    /// Names of the objects of this sweep, the same for an object in all sweeps.
    pub tracks: Vec<String>,
    /// How far the surface moves in the next 0.1 s in the world, metres: the ego vehicle's own motion is no part of it.
    /// `None` where it is not known, as for an object without a box in the next frame, or in a zone that nobody has
    /// labelled.
    pub flow: Vec<Option<[f32; 3]>>,
    /// The data set's own semantic class number; empty where there are none.
    pub semantic: Vec<u8>,
}

/// The LiDAR points of one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sweep {
    /// Metres, centred world, the ego vehicle's motion already compensated.
    pub points: Vec<[f32; 3]>,
    /// Seconds on the clock of [`Frame::time`](crate::Frame::time), one a point.
    pub times: Vec<f64>,
    /// As the sensor gives it, 0 to 255; of Waymo, not bounded.
    pub intensity: Vec<f32>,
    /// The LiDAR. PandaSet: 0 turns, 1 looks ahead. Argoverse 2: 0 is the upper, 1 the lower one. Waymo: 0 is on the
    /// roof, 1 to 4 are ahead, to the left, to the right and behind.
    pub sensor: Vec<u8>,
    /// `None` where the data set has none for this frame.
    pub labels: Option<Labels>,
    /// Points that were left out: not finite, or farther than [`RANGE_MAX`] from the ego vehicle.
    pub left_out: usize,
}

/// Farthest a point may lie from the ego vehicle, metres. No LiDAR sees a kilometre; f32 keeps 0.1 mm there.
pub const RANGE_MAX: f64 = 1000.0;

impl Sweep {
    /// Points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Memory of the buffers, bytes.
    pub fn bytes(&self) -> usize {
        let labels = self.labels.as_ref().map_or(0, |labels| {
            labels.class.capacity()
                + 4 * labels.instance.capacity()
                + 16 * labels.flow.capacity()
                + labels.semantic.capacity()
                + labels.tracks.iter().map(|name| name.capacity() + size_of::<String>()).sum::<usize>()
        });
        12 * self.points.capacity()
            + 8 * self.times.capacity()
            + 4 * self.intensity.capacity()
            + self.sensor.capacity()
            + labels
    }
}
