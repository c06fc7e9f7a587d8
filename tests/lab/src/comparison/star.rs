//! Runs that each depart from one of them in one setting: `gsburn sweep --one-at-a-time`.

use std::collections::BTreeMap;

use gsburn::report::comparison::{ComparedRun, settings};

use super::scatter::COLORS;

/// The colours and labels of runs around a middle.
#[derive(Debug, PartialEq)]
pub(super) struct Star {
    /// Index into the colours by run: the setting that departs; the last colour for the middle.
    pub colors: Vec<usize>,
    /// Label by run.
    pub labels: Vec<String>,
    /// The meaning of each colour.
    pub legend: Vec<(String, usize)>,
}

impl Star {
    /// `None` unless several settings differ, one run has the usual value of each, and every other run departs from it
    /// in one.
    pub fn of(runs: &[ComparedRun]) -> Option<Self> {
        let settings = settings(runs);
        let usual: Vec<Option<&str>> = settings.iter().map(|(_, key)| usual(runs, key)).collect();
        let value = |run: &ComparedRun, key: &str| run.setting(key).map(|setting| setting.value.clone());
        let departs = |run: &ComparedRun| -> Vec<usize> {
            let differs = |index: &usize| value(run, settings[*index].1).as_deref() != usual[*index];
            (0..settings.len()).filter(differs).collect()
        };
        let departures: Vec<Vec<usize>> = runs.iter().map(departs).collect();
        let rays: Vec<usize> = (0..settings.len()).filter(|index| departures.iter().any(|d| d == &[*index])).collect();
        let middles = departures.iter().filter(|departure| departure.is_empty()).count();
        if rays.len() < 2 || rays.len() >= COLORS.len() || middles != 1 || departures.iter().any(|d| d.len() > 1) {
            return None;
        }
        let color = |departure: &[usize]| match departure {
            [index] => rays.iter().position(|ray| ray == index).unwrap_or(COLORS.len() - 1),
            _ => COLORS.len() - 1,
        };
        let label = |(run, departure): (&ComparedRun, &Vec<usize>)| match departure[..] {
            [index] => run.setting(settings[index].1).map_or(run.name.clone(), |setting| setting.label.clone()),
            _ => run.name.clone(),
        };
        let named = |index: usize| {
            let (name, key) = settings[index];
            if name.is_empty() { key.rsplit('.').next().unwrap_or(key).to_string() } else { name.to_string() }
        };
        let legend = rays.iter().enumerate().map(|(color, index)| (named(*index), color));
        Some(Self {
            colors: departures.iter().map(|departure| color(departure)).collect(),
            labels: runs.iter().zip(&departures).map(label).collect(),
            legend: legend.chain([("unchanged".to_string(), COLORS.len() - 1)]).collect(),
        })
    }
}

/// The value of a setting that most runs have; `None` if most have none.
fn usual<'a>(runs: &'a [ComparedRun], key: &str) -> Option<&'a str> {
    let mut counts: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for run in runs {
        *counts.entry(run.setting(key).map(|setting| setting.value.as_str())).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(_, count)| *count).and_then(|(value, _)| value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::testing;

    fn run(name: &str, step: &str, asked: &str) -> ComparedRun {
        let mut run = testing::run(name, 20.0, None);
        run.eval.settings = vec![
            testing::setting("step", "dynamics.step_frames", step, &format!("step {step}")),
            testing::setting("", "dynamics.ask", asked, asked),
        ];
        run
    }

    #[test]
    fn each_ray_has_a_colour_and_each_run_the_label_of_its_change() {
        let mut runs = vec![run("base", "2", "start"), run("a", "1", "start"), run("b", "4", "start")];
        runs.push(run("c", "2", "stage"));
        let star = Star::of(&runs).expect("a star");
        assert_eq!(star.labels, ["base", "step 1", "step 4", "stage"]);
        assert_eq!(star.colors, [COLORS.len() - 1, 0, 0, 1]);
        let names: Vec<&str> = star.legend.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["step", "ask", "unchanged"]);
    }

    #[test]
    fn every_combination_is_no_star() {
        let all = [run("a", "1", "start"), run("b", "2", "start"), run("c", "1", "stage"), run("d", "2", "stage")];
        assert_eq!(Star::of(&all), None);
        assert_eq!(Star::of(&[run("a", "1", "start"), run("b", "2", "start")]), None, "one setting differs");
    }
}
