mod others;

use super::*;
use crate::splats::testing::{numbers, random};
use crate::splats::{sigmoid, unit};
use crate::{Beyond, Carried, Carrier, Keys, Law, Motion, Series, SeriesLaw, Shape, Splats, TimeFunction};

fn moving(rotation: bool) -> Motion {
    let mut x = numbers(9);
    let mut vectors = |count: usize| (0..count).map(|_| [x(), x(), x()]).collect::<Vec<[f32; 3]>>();
    let beyond = Some(Beyond { line: [0.1, 0.5], edges: [[-1.0, 1.0], [1.0, 2.0]], fade: 0.25 });
    let shapes = [
        Shape::Power(1),
        Shape::Power(2),
        Shape::Ramp { near: -0.2, far: -0.5 },
        Shape::Wave { power: 3, n: 1, sine: true },
    ];
    let functions = shapes.map(|shape| TimeFunction { shape, beyond }).to_vec();
    let position = Series { vectors: vectors(3 * functions.len()), functions };
    let turning = vec![TimeFunction { shape: Shape::Power(1), beyond: None }];
    let rotation = if rotation { Series { vectors: vectors(3), functions: turning } } else { Series::default() };
    let law = Law::Series(SeriesLaw { t0: 0.4, half: 0.5, position, rotation, carried: None });
    Motion { span: [0.0, 1.0], middle: 0.5, rows: vec![4, 0, 7], law }
}

/// Two bodies that carry four rows of the means `means`; the last row has none. The first row has a vector of its own.
pub(super) fn carried(means: &[[f32; 3]]) -> Motion {
    let mut x = numbers(10);
    let mut vector = || [x(), x(), x()];
    let powers = |count: u32| (1..=count).map(|k| TimeFunction { shape: Shape::Power(k), beyond: None }).collect();
    let body = |centre: [f64; 3], vector: &mut dyn FnMut() -> [f32; 3]| Carrier {
        centre,
        scale: 1.5,
        position: (0..3).map(|_| [vector(), vector(), vector(), vector()]).collect(),
        rotation: vec![vector()],
    };
    let bodies = vec![body([0.1, -0.2, 0.3], &mut vector), body([2.0, 0.5, -1.0], &mut vector)];
    let own = vec![[2, 0], [0, 1], [0, 0], [0, 0], [1, 1]];
    let carried = Carried { body_of: vec![0, 1, 0, 1, Carried::NO_BODY], own, bodies };
    let rows = vec![4, 0, 7, 2, 5];
    let (mut position, mut rotation) = (Vec::new(), Vec::new());
    for (row, mean) in rows.iter().map(|row| means[*row as usize]).enumerate() {
        let body = carried.of(row, mean);
        let sum = |own: bool, body: Option<[f32; 3]>, vector: [f32; 3]| {
            let (own, body) = (if own { vector } else { [0.0; 3] }, body.unwrap_or_default());
            [0, 1, 2].map(|axis| own[axis] + body[axis])
        };
        let [of_position, of_rotation] = carried.own[row];
        for j in 0..3 {
            position.push(sum(usize::from(of_position) > j, body.as_ref().map(|body| body.0[j]), vector()));
        }
        rotation.push(sum(of_rotation > 0, body.map(|body| body.1[0]), vector()));
    }
    let law = Law::Series(SeriesLaw {
        t0: 0.5,
        half: 0.5,
        position: Series { functions: powers(3), vectors: position },
        rotation: Series { functions: powers(1), vectors: rotation },
        carried: Some(carried),
    });
    Motion { span: [0.0, 1.0], middle: 0.5, rows, law }
}

/// Sums of five products of numbers below four, rounded to f32: 2e-6.
const ROUNDED: f32 = 2e-6;

/// Bodies are stored once; rows come back with whole vectors, in another order. Turned worlds and selected rows carry
/// the same motion on.
#[test]
fn bodies_are_stored_once() {
    let splats = random(8, 1, 2);
    let motion = carried(&splats.means);
    let bytes = encode(&splats, Some(&motion), false).expect("encoded");
    let Law::Series(law) = &motion.law else { panic!("a series") };
    let alone = Law::Series(SeriesLaw { carried: None, ..law.clone() });
    let whole = encode(&splats, Some(&Motion { law: alone, ..motion.clone() }), false).expect("encoded");
    let same_places = |a: &Splats, b: &Splats| {
        let near = |a: &[f32; 3], b: &[f32; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < ROUNDED);
        assert!(a.means.iter().zip(&b.means).all(|(a, b)| near(a, b)), "{:?}\n{:?}", a.means, b.means);
        for (a, b) in a.quats.iter().zip(&b.quats) {
            let dot: f64 = unit(*a).iter().zip(unit(*b)).map(|(a, b)| a * b).sum();
            assert!((dot.abs() - 1.0).abs() < f64::from(ROUNDED));
        }
    };
    let (found, plain) = (decode(&bytes).expect("decoded"), decode(&whole).expect("decoded"));
    for t in [0.0, 0.3, 0.5, 1.2] {
        let at = |contents: &Contents| contents.motion.as_ref().expect("moves").at(&contents.splats, t);
        same_places(&at(&found), &at(&plain));
    }
    // Once more, from what was read; then turned by a rotation that is no change of signs.
    let again = encode(&found.splats, found.motion.as_ref(), false).expect("encoded");
    assert_eq!(again.len(), bytes.len());
    let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let turned = (crate::turn::turn(&splats, turn), crate::turn::turn_motion(&motion, turn));
    let read = decode(&encode(&turned.0, Some(&turned.1), false).expect("encoded")).expect("decoded");
    same_places(&turned.1.at(&turned.0, 0.9), &read.motion.expect("moves").at(&read.splats, 0.9));
    // Moved, as where the offset of a far world is added.
    let shift = glam::DVec3::new(3.0, -2.0, 5.0);
    let (mut shifted, mut along) = (splats.clone(), motion.clone());
    shifted.means.iter_mut().for_each(|mean| *mean = crate::turn::moved(*mean, shift));
    crate::turn::shift_motion(&mut along, shift);
    let read = decode(&encode(&shifted, Some(&along), false).expect("encoded")).expect("decoded");
    same_places(&along.at(&shifted, 0.9), &read.motion.expect("moves").at(&read.splats, 0.9));
    // Away from t0 nothing is carried.
    let late = Motion { middle: 0.6, ..motion.clone() };
    let read = decode(&encode(&splats, Some(&late), false).expect("encoded")).expect("decoded");
    assert!(matches!(read.motion.expect("moves").law, Law::Series(SeriesLaw { carried: None, .. })));
    // Rows 0 and 5 of the scene are the second and the last of the motion.
    let selected = motion.select(&[0, 5]);
    let Law::Series(SeriesLaw { carried: Some(left), .. }) = &selected.law else { panic!("bodies") };
    assert_eq!((left.body_of.as_slice(), left.own.as_slice()), (&[1, 255][..], &[[0, 1], [1, 1]][..]));
}

/// Positions and harmonics come back to the bit. The logarithm of an exponential is off by the rounding of the
/// exponential, 6e-8 of it, and one of the logarithm, 4e-7 at 6; a logit of 4 by 6e-8 / (p (1 - p)) = 4e-6; quaternions
/// are normalised.
#[test]
fn what_is_written_is_read() {
    for degree in 0..=3 {
        let splats = random(200, degree, degree as u64);
        let back = decode(&encode(&splats, None, degree == 1).expect("encoded")).expect("decoded");
        assert_eq!((back.linear, back.motion), (degree == 1, None));
        let back = back.splats;
        assert_eq!((&back.means, &back.sh, back.antialiased), (&splats.means, &splats.sh, Some(false)));
        for i in 0..splats.len() {
            assert!((0..3).all(|a| (back.log_scales[i][a] - splats.log_scales[i][a]).abs() < 1e-6));
            assert!((back.opacity_logits[i] - splats.opacity_logits[i]).abs() < 1e-5);
            let (p, q) = (unit(back.quats[i]), unit(splats.quats[i]));
            assert!((0..4).all(|k| (p[k] - q[k]).abs() < 1e-6));
        }
    }
}

#[test]
fn a_motion_comes_back_to_the_bit() {
    let splats = random(8, 1, 2);
    for motion in [moving(true), moving(false)] {
        let back = decode(&encode(&splats, Some(&motion), false).expect("encoded")).expect("decoded");
        assert_eq!(back.motion, Some(motion));
    }
    let mut x = numbers(3);
    let mut quat = || unit([x(), x(), x(), 1.0]).map(|x| x as f32);
    let keys = Keys {
        times: vec![0.0, 0.5, 1.0],
        means: vec![[1.0, 2.0, 3.0]; 6],
        quats: (0..6).map(|_| quat()).collect(),
        log_scales: vec![[0.0; 3]; 6],
    };
    let motion = Motion { span: [0.0, 1.0], middle: 0.5, rows: vec![1, 5], law: Law::Keys(keys.clone()) };
    let back =
        decode(&encode(&splats, Some(&motion), false).expect("encoded")).expect("decoded").motion.expect("moves");
    let Law::Keys(found) = back.law else { panic!("key frames") };
    assert_eq!((&found.times, &found.means, &found.log_scales), (&keys.times, &keys.means, &keys.log_scales));
    // Written with norm 1 in f32.
    assert!(found.quats.iter().flatten().zip(keys.quats.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6));
}

/// At the middle nothing moves, a ramp rests around 0, and turning there and back leaves the orientation, to rounding
/// of f32.
#[test]
fn the_middle_is_what_is_stored() {
    let splats = random(8, 0, 4);
    let motion = moving(true);
    let at = motion.at(&splats, motion.middle);
    assert_eq!(at.means, splats.means);
    for (a, b) in at.quats.iter().zip(&splats.quats) {
        let (a, b) = (unit(*a), unit(*b));
        assert!((0..4).all(|k| (a[k] - b[k]).abs() < 1e-6));
    }
    let later = motion.at(&splats, 0.9);
    assert_ne!(later.means[4], splats.means[4]);
    assert_eq!(later.means[1], splats.means[1], "row 1 does not move");
}

#[test]
fn key_frames_are_met_and_joined_by_lines() {
    let splats = random(3, 0, 4);
    let keys = Keys {
        times: vec![0.0, 1.0],
        means: vec![[0.0; 3], [2.0, 4.0, 6.0]],
        quats: vec![[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]],
        log_scales: Vec::new(),
    };
    let motion = Motion { span: [0.0, 1.0], middle: 0.5, rows: vec![2], law: Law::Keys(keys) };
    for (t, x) in [(-1.0, 0.0), (0.0, 0.0), (0.25, 0.5), (1.0, 2.0), (3.0, 2.0)] {
        let at = motion.at(&splats, t);
        assert_eq!(at.means[2], [x, 2.0 * x, 3.0 * x], "at {t}");
        assert_eq!(at.quats[2], [1.0, 0.0, 0.0, 0.0], "q and -q are one rotation");
    }
}

/// A file cut anywhere, or with any byte of its JSON changed, is refused or read, and nothing panics.
#[test]
fn broken_files_are_refused() {
    let splats = random(8, 1, 2);
    for motion in [moving(true), carried(&splats.means)] {
        broken_file_is_refused(&encode(&splats, Some(&motion), false).expect("encoded"));
    }
    let outside = Motion { rows: vec![8, 0, 7], ..moving(false) };
    assert!(encode(&random(8, 1, 2), Some(&outside), false).expect_err("no such row").contains("below 8"));
}

fn broken_file_is_refused(bytes: &[u8]) {
    for length in (0..bytes.len()).step_by(3) {
        assert!(decode(&bytes[..length]).is_err(), "{length} bytes");
    }
    for place in 12..bytes.len().min(6000) {
        for with in [b'9', b'"', 0xff] {
            let mut broken = bytes.to_vec();
            broken[place] = with;
            let _ = decode(&broken);
        }
    }
}

#[test]
fn opaque_gaussians_stay_finite() {
    let mut splats = random(2, 0, 1);
    splats.opacity_logits = vec![80.0, -80.0];
    let back = decode(&encode(&splats, None, false).expect("encoded")).expect("decoded").splats;
    assert!(back.opacity_logits.iter().all(|x| x.is_finite()));
    assert!(sigmoid(back.opacity_logits[0]) > 0.999_999 && sigmoid(back.opacity_logits[1]) < 1e-6);
}
