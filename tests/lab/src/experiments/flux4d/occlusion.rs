//! A car that a bus hides for half of a snippet.

use anyhow::Result;
use gs_pipelines::flux4d::flow::{FlowOfSweep, norm, of_inputs};
use gs_pipelines::flux4d::saved::SavedNetwork;
use gs_worlds::driving::{Encounter, StreetOptions};

use super::trial::{Seen, network, seen, streets};
use crate::experiments::{Findings, Lab};

/// Streets that are averaged.
const STREETS: u64 = 5;
const STREETS_QUICK: u64 = 1;

/// The most that the bus may add to the EPE3D of the car, metres in 0.1 s: a tenth of the car's motion of 0.9 m.
const BOUND: f64 = 0.09;

/// The flow of the car in a snippet.
#[derive(Debug, Clone, Copy, Default)]
struct Car {
    /// Sum of the errors over its points, metres in 0.1 s.
    error: f64,
    points: usize,
    /// Input sweeps that show ten of its points or more.
    sweeps: usize,
}

impl Car {
    fn epe(&self) -> Option<f64> {
        (self.points > 0).then(|| self.error / self.points as f64)
    }
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let saved = network(lab)?;
    let mut epe = Vec::new();
    for (encounter, name) in [(Encounter::Car, "alone"), (Encounter::HiddenCar, "behind the bus")] {
        let mut all = Car::default();
        for (index, base) in streets(lab.either(STREETS, STREETS_QUICK)).enumerate() {
            let options = StreetOptions { movers: 0, encounter, ..base };
            let car = car(lab, &saved, &options)?;
            let epe = shown(car.epe());
            found.note(format!("Street {index}, {name}: {} points in {} sweeps, EPE {epe}.", car.points, car.sweeps));
            all.error += car.error;
            all.points += car.points;
        }
        epe.push(all.epe());
    }
    let added = epe[1].zip(epe[0]).map(|(hidden, alone)| hidden - alone);
    found.note(format!("All streets: EPE {} alone, {} behind the bus.", shown(epe[0]), shown(epe[1])));
    found.at_most("EPE3D of the car that the bus adds", added, BOUND, "m");
    Ok(())
}

fn shown(epe: Option<f64>) -> String {
    epe.map_or("none".to_string(), |epe| format!("{epe:.3} m"))
}

/// The flow of the car of a street, which is the last of its objects.
fn car(lab: &Lab, saved: &SavedNetwork, options: &StreetOptions) -> Result<Car> {
    let Seen { log, host, inferred, .. } = seen(lab, &lab.street(options)?, saved)?;
    let sweeps = of_inputs(&log, &host, &inferred)?;
    let last = sweeps.iter().flat_map(|sweep| &sweep.tracks).max().cloned();
    Ok(sweeps.iter().fold(Car::default(), |car, sweep| added(car, sweep, last.as_deref())))
}

fn added(mut car: Car, sweep: &FlowOfSweep, name: Option<&str>) -> Car {
    let is_car = |object: Option<u32>| object.is_some_and(|place| Some(sweep.tracks[place as usize].as_str()) == name);
    let before = car.points;
    for ((predicted, truth), object) in sweep.predicted.iter().zip(&sweep.truth).zip(&sweep.objects) {
        if is_car(*object) {
            car.error += norm([0, 1, 2].map(|axis| predicted[axis] - truth[axis]));
            car.points += 1;
        }
    }
    car.sweeps += usize::from(car.points - before >= 10);
    car
}
