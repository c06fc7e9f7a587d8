//! Scene-flow metrics by hand.

use gs_models::flux4d::FluxError;
use gs_models::flux4d::flow_metrics::{Buckets, FlowClass, FlowFrame, PointErrors, ThreeWay};
use gs_tests::tolerance::assert_near;

use FlowClass::{Background, Car, Pedestrian};

/// Flows are `f32`: 6e-8 of values below 10.
const BOUND: f64 = 1e-6;

fn known(values: &[Option<f64>]) -> Vec<f64> {
    values.iter().map(|value| value.expect("a value")).collect()
}

#[test]
fn errors_accuracies_and_angles() {
    // Errors .04, .08, .3 (of 10 m: 3 %), .5 (of nothing).
    let truth = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
    let predicted = [[0.0, 0.04, 0.0], [0.28, 0.0, 0.0], [10.0, 0.3, 0.0], [0.0, 0.0, 0.5]];
    let mut errors = PointErrors::default();
    errors.add(&FlowFrame { predicted: &predicted, truth: &truth, classes: &[Car; 4] }).expect("flows");
    let report = errors.finish();
    assert_near("EPE", &known(&[report.epe3d]), &[0.23], BOUND);
    let accuracies = known(&[report.acc5, report.acc10, report.acc5_absolute, report.acc10_absolute]);
    assert_near("accuracies", &accuracies, &[0.5, 0.75, 0.25, 0.5], BOUND);
    let right = std::f64::consts::FRAC_PI_2;
    let small = 0.03_f64.atan();
    assert_near("plain", &known(&[report.angle_plain]), &[(2.0 * right + small) / 4.0], BOUND);
    assert_near("moving", &known(&[report.angle_moving]), &[small / 2.0], BOUND);
    assert_eq!((report.points, report.moving_points), (4, 2));
    let fourth = |a: [f64; 4], b: [f64; 4]| {
        let dot = |a: [f64; 4], b: [f64; 4]| (0..4).map(|i| a[i] * b[i]).sum::<f64>();
        (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()).acos()
    };
    let space_time = (0.4_f64.atan()
        + 5.0_f64.atan()
        + fourth([0.28, 0.0, 0.0, 0.1], [0.2, 0.0, 0.0, 0.1])
        + fourth([10.0, 0.3, 0.0, 0.1], [10.0, 0.0, 0.0, 0.1]))
        / 4.0;
    assert_near("space-time", &known(&[report.angle_space_time]), &[space_time], BOUND);
    assert_eq!(PointErrors::default().finish().epe3d, None);
}

#[test]
fn three_way_of_points_and_of_frames() {
    let mut three = ThreeWay::default();
    let mut add = |rows: &[(f32, f32, FlowClass)]| {
        let truth: Vec<[f32; 3]> = rows.iter().map(|row| [row.0, 0.0, 0.0]).collect();
        let predicted: Vec<[f32; 3]> = rows.iter().map(|row| [row.0, row.1, 0.0]).collect();
        let classes: Vec<FlowClass> = rows.iter().map(|row| row.2).collect();
        three.add(&FlowFrame { predicted: &predicted, truth: &truth, classes: &classes }).expect("flows");
    };
    add(&[
        (0.0, 0.1, Background),
        (0.0, 0.3, Background),
        (0.04, 0.5, Car),
        (1.0, 0.9, Pedestrian),
        (1.0, 9.0, Background),
    ]);
    add(&[(0.0, 0.5, Background), (0.06, 0.3, Car)]);
    let report = three.finish();
    assert_eq!((report.counts, report.left_out), ([3, 1, 2], 1));
    let columns = known(&[report.points.bs, report.points.fs, report.points.fd, report.points.mean]);
    assert_near("points", &columns, &[0.3, 0.5, 0.6, 1.4 / 3.0], BOUND);
    let columns = known(&[report.frames.bs, report.frames.fs, report.frames.fd, report.frames.mean]);
    assert_near("frames", &columns, &[0.35, 0.5, 0.6, 0.5 * ((0.2 + 0.5 + 0.9) / 3.0 + 0.4)], BOUND);
    assert_eq!(ThreeWay::default().finish().points.mean, None);
}

#[test]
fn buckets_are_normalised_by_speed() {
    let mut buckets = Buckets::default();
    // Static: 0 and 0.03. The bucket of .08-.12 holds .1 twice; the last one 5.
    let speeds = [0.0, 0.03, 0.1, 0.1, 5.0];
    let truth: Vec<[f32; 3]> = speeds.iter().map(|speed| [*speed, 0.0, 0.0]).collect();
    let predicted = vec![[0.0; 3]; 5];
    let classes = [Background, Car, Car, Car, Car];
    buckets.add(&FlowFrame { predicted: &predicted, truth: &truth, classes: &classes }).expect("flows");
    let half = [[2.0, 0.0, 0.0]];
    buckets.add(&FlowFrame { predicted: &[[1.0, 0.0, 0.0]], truth: &half, classes: &[Pedestrian] }).expect("flows");
    let report = buckets.finish();
    let line = |class: FlowClass| report.classes.iter().find(|line| line.class == class).expect("a class");
    assert_eq!((line(Background).static_epe, line(Background).dynamic), (Some(0.0), None));
    assert_near("car", &known(&[line(Car).static_epe, line(Car).dynamic]), &[0.03, 1.0], BOUND);
    assert_eq!((line(Car).static_points, line(Car).dynamic_points), (1, 3));
    assert_near("pedestrian", &known(&[line(Pedestrian).dynamic]), &[0.5], BOUND);
    assert_near("means", &known(&[report.mean_static, report.mean_dynamic]), &[0.015, 0.75], BOUND);
}

#[test]
fn unusable_flows_are_told() {
    let frame = FlowFrame { predicted: &[[0.0, f32::NAN, 0.0]], truth: &[[0.0; 3]], classes: &[Car] };
    let told = PointErrors::default().add(&frame).unwrap_err().to_string();
    assert_eq!(told, "a predicted flow is NaN; a finite number of metres per frame is expected");
    let short = FlowFrame { predicted: &[], ..frame };
    let expected = FluxError::Lengths { what: "predicted flows", expected: 1, found: 0 };
    assert_eq!(Buckets::default().add(&short), Err(expected.clone()));
    assert_eq!(ThreeWay::default().add(&short), Err(expected));
}
