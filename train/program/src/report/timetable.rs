//! The chart of a training's schedule.

use super::charts::{Chart, Series};
use gs_train::fit::timetable::Timetable;

/// The curves of a schedule, and a vertical line at each event.
pub fn chart(timetable: &Timetable) -> Chart {
    let values = timetable.curves.iter().flat_map(|curve| &curve.points).map(|(_, value)| *value);
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], value| [a.min(value), b.max(value)]);
    let marks = timetable.marks.iter().filter(|mark| !mark.steps.is_empty());
    let events = marks.map(|mark| Series::events(&mark.name, &mark.steps, [low, high]));
    let curves = timetable.curves.iter().map(|curve| match curve.joined {
        true => Series::line(&curve.name, curve.points.clone()),
        false => Series::draws(&curve.name, curve.points.clone()),
    });
    // Events are drawn first: draws on top of them stay visible.
    let series = events.chain(curves).collect();
    Chart { title: "Schedule".into(), x: "step".into(), y: timetable.y.clone(), series }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_train::fit::timetable::{Curve, Mark};

    #[test]
    fn curves_draws_and_events_are_in_the_chart() {
        let curve = |name: &str, joined| Curve { name: name.into(), points: vec![(1.0, 0.0), (9.0, 0.5)], joined };
        let mark = |name: &str, steps: &[usize]| Mark { name: name.into(), steps: steps.to_vec() };
        let timetable = Timetable {
            y: "time".into(),
            curves: vec![curve("window", true), curve("drawn", false)],
            marks: vec![mark("examined", &[3, 5]), mark("never", &[])],
        };
        let chart = chart(&timetable);
        let names: Vec<&str> = chart.series.iter().map(Series::name).collect();
        assert_eq!(names, ["examined", "window", "drawn"]);
        assert_eq!(chart.series[0].points(), [(3.0, 0.0), (3.0, 0.5), (5.0, 0.0), (5.0, 0.5)]);
        let svg = chart.svg();
        assert!(svg.contains("examined") && svg.contains("drawn") && !svg.contains("never"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 2 + 1, "two draws and the one of the legend");
    }
}
