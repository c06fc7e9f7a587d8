//! The motion as an extension: time functions as JSON, vectors as accessors.

use serde_json::{Value, json};

use super::arrays::{Accessors, Arrays};
use super::{MOTION, MOTION_VERSIONS};
use crate::json::{at, index, list, number};
use crate::splats::unit_xyzw;
use crate::{Beyond, Carried, Carrier, Keys, Law, Motion, Series, SeriesLaw, Shape, TimeFunction};

/// Most time functions of a series: a polynomial of order 8, 40 kinks and a remainder are far below.
const FUNCTIONS_MAX: usize = 256;

/// The motion of Gaussians whose means in the file are `means`.
pub(super) fn to_json(motion: &Motion, means: &[[f32; 3]], arrays: &mut Arrays) -> Value {
    let mut value = json!({"version": MOTION_VERSIONS[0], "span": motion.span, "middle": motion.middle});
    match &motion.law {
        Law::Series(law) => {
            value["window"] = json!({"t0": law.t0, "half": law.half});
            // A body is where its rows are while all functions are zero.
            match law.carried.as_ref().filter(|_| motion.middle == law.t0) {
                Some(carried) => write_carried(&mut value, motion, (law, carried), means, arrays),
                None => {
                    value["rows"] = arrays.indices(&motion.rows).into();
                    for (name, part) in PARTS.into_iter().zip([&law.position, &law.rotation]) {
                        // glTF knows no accessor without values.
                        if !part.vectors.is_empty() {
                            let vectors = arrays.floats(part.vectors.iter().copied());
                            value[name] = json!({"functions": functions(part), "vectors": vectors});
                        }
                    }
                }
            }
        }
        Law::Keys(keys) => {
            value["rows"] = arrays.indices(&motion.rows).into();
            value["keys"] = json!({
                "times": keys.times,
                "positions": arrays.floats(keys.means.iter().copied()),
                "rotations": arrays.floats(keys.quats.iter().map(|q| unit_xyzw(*q))),
            });
            if !keys.log_scales.is_empty() {
                value["keys"]["scales"] = arrays.floats(keys.log_scales.iter().map(|s| s.map(f32::exp))).into();
            }
        }
    }
    value
}

/// The two series of a law.
const PARTS: [&str; 2] = ["position", "rotation"];

fn functions(series: &Series) -> Vec<Value> {
    series.functions.iter().map(function).collect()
}

/// Bodies, and of each row the vectors that it has beside its body's: rows in descending order of how many these are,
/// so that those of a function are the first rows'.
fn write_carried(
    value: &mut Value,
    motion: &Motion,
    (law, carried): (&SeriesLaw, &Carried),
    means: &[[f32; 3]],
    arrays: &mut Arrays,
) {
    let mut order: Vec<usize> = (0..motion.rows.len()).collect();
    order.sort_by_key(|row| std::cmp::Reverse(carried.own[*row]));
    let rows: Vec<u32> = order.iter().map(|row| motion.rows[*row]).collect();
    let body_of: Vec<u8> = order.iter().map(|row| carried.body_of[*row]).collect();
    value["version"] = MOTION_VERSIONS[1].into();
    value["rows"] = arrays.indices(&rows).into();
    value["bodies"] = json!({
        "of": arrays.small(&body_of),
        "centres": carried.bodies.iter().map(|body| body.centre).collect::<Vec<_>>(),
        "scales": carried.bodies.iter().map(|body| body.scale).collect::<Vec<_>>(),
    });
    let bodies: Vec<_> = order.iter().map(|row| carried.of(*row, means[motion.rows[*row] as usize])).collect();
    for (part, series) in [&law.position, &law.rotation].into_iter().enumerate() {
        let width = series.functions.len();
        if width == 0 {
            continue;
        }
        let own = |row: usize, j: usize| usize::from(carried.own[row][part]) > j;
        let count = |j: usize| order.iter().rposition(|row| own(*row, j)).map_or(0, |last| last + 1);
        let counts: Vec<usize> = (0..width).map(count).collect();
        let vector = |place: usize, j: usize| {
            let (row, body) = (order[place], &bodies[place]);
            let carried = body.as_ref().map_or([0.0; 3], |body| if part == 0 { body.0[j] } else { body.1[j] });
            let whole = series.vectors[row * width + j];
            if own(row, j) { [0, 1, 2].map(|axis| whole[axis] - carried[axis]) } else { [0.0; 3] }
        };
        let vectors: Vec<[f32; 3]> = (0..width)
            .flat_map(|j| (0..counts[j]).map(move |place| (place, j)))
            .map(|(place, j)| vector(place, j))
            .collect();
        let mut told = json!({"functions": functions(series), "counts": counts});
        if !vectors.is_empty() {
            told["vectors"] = arrays.floats(vectors).into();
        }
        value[PARTS[part]] = told;
        let of_bodies: Vec<[f32; 3]> = match part {
            0 => carried.bodies.iter().flat_map(|body| body.position.as_flattened().iter().copied()).collect(),
            _ => carried.bodies.iter().flat_map(|body| body.rotation.iter().copied()).collect(),
        };
        if !of_bodies.is_empty() {
            value["bodies"][PARTS[part]] = arrays.floats(of_bodies).into();
        }
    }
}

fn function(function: &TimeFunction) -> Value {
    let mut value = match function.shape {
        Shape::Power(k) => json!({"power": k}),
        Shape::Ramp { near, far } => json!({"ramp": [near, far]}),
        Shape::Wave { power, n, sine } => {
            json!({"power": power, "wave": n, "of": if sine { "sine" } else { "cosine" }})
        }
    };
    if let Some(Beyond { line, edges, fade }) = function.beyond {
        value["beyond"] = json!({"line": line, "edges": edges, "fade": fade});
    }
    value
}

/// Reads what [`to_json`] wrote, or anybody else, of Gaussians with these means.
pub(super) fn of_json(value: &Value, means: &[[f32; 3]], accessors: &Accessors) -> Result<Motion, String> {
    let version = index(value, "/version")? as u64;
    if !MOTION_VERSIONS.contains(&version) {
        let known = MOTION_VERSIONS.map(|version| version.to_string()).join(" or ");
        return Err(format!("expected version {known} of {MOTION}, found {version}"));
    }
    let rows = accessors.indices(index(value, "/rows")?)?;
    let middle = number(value, "/middle")?;
    let law = match (value.get("keys"), value.get("bodies")) {
        (Some(keys), _) => Law::Keys(self::keys(keys, accessors)?),
        (None, bodies) => {
            let mut law = SeriesLaw {
                t0: number(value, "/window/t0")?,
                half: number(value, "/window/half")?,
                position: series(value.get(PARTS[0]), rows.len(), accessors)?,
                rotation: series(value.get(PARTS[1]), rows.len(), accessors)?,
                carried: None,
            };
            if let Some(bodies) = bodies {
                if middle != law.t0 {
                    return Err(format!(
                        "expected bodies where all functions are zero, at {}, found them at {middle}",
                        law.t0
                    ));
                }
                let means = rows.iter().map(|row| means.get(*row as usize).copied().unwrap_or_default()).collect();
                add_bodies(bodies, value, &mut law, means, accessors)?;
            }
            Law::Series(law)
        }
    };
    let span = [number(value, "/span/0")?, number(value, "/span/1")?];
    Ok(Motion { span, middle, rows, law })
}

/// Reads bodies, and adds their vectors to those of their rows, whose means are `means`.
fn add_bodies(
    bodies: &Value,
    motion: &Value,
    law: &mut SeriesLaw,
    means: Vec<[f32; 3]>,
    accessors: &Accessors,
) -> Result<(), String> {
    let of = accessors.indices(index(bodies, "/of")?)?;
    let count = list(bodies, "/scales")?.len();
    let widths = [law.position.functions.len(), law.rotation.functions.len()];
    let vectors = |part: usize, each: usize| match bodies.get(PARTS[part]) {
        Some(_) => accessors.floats::<3>(index(bodies, &format!("/{}", PARTS[part]))?),
        None if each * count == 0 => Ok(Vec::new()),
        None => Err(format!("expected the {} of {count} bodies, found none", PARTS[part])),
    };
    let (position, rotation) = (vectors(0, widths[0])?, vectors(1, widths[1])?);
    if position.len() != 4 * widths[0] * count || rotation.len() != widths[1] * count || of.len() != means.len() {
        return Err("expected whole arrays of bodies, found others".into());
    }
    let body = |i: usize| -> Result<Carrier, String> {
        let centre = |axis| number(bodies, &format!("/centres/{i}/{axis}"));
        Ok(Carrier {
            centre: [centre(0)?, centre(1)?, centre(2)?],
            scale: number(bodies, &format!("/scales/{i}"))?,
            position: position[4 * widths[0] * i..][..4 * widths[0]].as_chunks::<4>().0.to_vec(),
            rotation: rotation[widths[1] * i..][..widths[1]].to_vec(),
        })
    };
    let own = |part: usize| -> Result<Vec<u16>, String> {
        let counts = counts_of(motion.get(PARTS[part]), widths[part], of.len())?;
        Ok((0..of.len()).map(|row| counts.iter().filter(|count| **count > row).count() as u16).collect())
    };
    let carried = Carried {
        body_of: of.iter().map(|body| u8::try_from(*body).unwrap_or(Carried::NO_BODY)).collect(),
        own: own(0)?.into_iter().zip(own(1)?).map(|(position, rotation)| [position, rotation]).collect(),
        bodies: (0..count).map(body).collect::<Result<_, _>>()?,
    };
    if !carried.is_right(of.len(), widths) {
        return Err("expected bodies of finite numbers that rows have, found others".into());
    }
    for (row, mean) in means.into_iter().enumerate() {
        let Some((position, rotation)) = carried.of(row, mean) else { continue };
        let add = |own: &mut [[f32; 3]], body: &[[f32; 3]]| {
            own.iter_mut().flatten().zip(body.iter().flatten()).for_each(|(own, body)| *own += body);
        };
        add(&mut law.position.vectors[row * widths[0]..][..widths[0]], &position);
        add(&mut law.rotation.vectors[row * widths[1]..][..widths[1]], rotation);
    }
    law.carried = Some(carried);
    Ok(())
}

/// How many of the `rows` rows have a vector for each of `width` functions.
fn counts_of(series: Option<&Value>, width: usize, rows: usize) -> Result<Vec<usize>, String> {
    if width == 0 {
        return Ok(Vec::new());
    }
    let found = list(series.unwrap_or(&Value::Null), "/counts")?;
    let counts: Vec<usize> = found.iter().filter_map(Value::as_u64).map(|count| count as usize).collect();
    match counts.len() == width && found.len() == width && counts.iter().all(|count| *count <= rows) {
        true => Ok(counts),
        false => Err(format!("expected {width} counts of at most {rows} rows, found {found:?}")),
    }
}

fn keys(value: &Value, accessors: &Accessors) -> Result<Keys, String> {
    let time = |t: &Value| t.as_f64().ok_or_else(|| "expected times of key frames that are numbers".to_owned());
    let quats = accessors.floats::<4>(index(value, "/rotations")?)?;
    let scales = match value.get("scales") {
        Some(_) => accessors.floats::<3>(index(value, "/scales")?)?,
        None => Vec::new(),
    };
    Ok(Keys {
        times: list(value, "/times")?.iter().map(time).collect::<Result<_, _>>()?,
        means: accessors.floats::<3>(index(value, "/positions")?)?,
        quats: quats.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
        log_scales: scales.into_iter().map(|s| s.map(f32::ln)).collect(),
    })
}

/// A series of `rows` rows; vectors that only the first rows have are zero in the others.
fn series(value: Option<&Value>, rows: usize, accessors: &Accessors) -> Result<Series, String> {
    let Some(value) = value else { return Ok(Series::default()) };
    let functions = list(value, "/functions")?;
    if functions.len() > FUNCTIONS_MAX {
        return Err(format!("expected at most {FUNCTIONS_MAX} time functions, found {}", functions.len()));
    }
    let functions: Vec<TimeFunction> = functions.iter().map(time_function).collect::<Result<_, _>>()?;
    let stored = match value.get("vectors") {
        Some(_) => accessors.floats::<3>(index(value, "/vectors")?)?,
        None => Vec::new(),
    };
    if value.get("counts").is_none() {
        return Ok(Series { functions, vectors: stored });
    }
    let counts = counts_of(Some(value), functions.len(), rows)?;
    if counts.iter().sum::<usize>() != stored.len() {
        return Err(format!("expected {} vectors by the counts, found {}", counts.iter().sum::<usize>(), stored.len()));
    }
    let mut vectors = vec![[0.0; 3]; rows * functions.len()];
    let places = counts.iter().enumerate().flat_map(|(j, count)| (0..*count).map(move |row| (row, j)));
    places.zip(stored).for_each(|((row, j), vector)| vectors[row * counts.len() + j] = vector);
    Ok(Series { functions, vectors })
}

fn time_function(value: &Value) -> Result<TimeFunction, String> {
    let whole = |pointer: &str| {
        let number = u32::try_from(index(value, pointer)?).ok().filter(|number| *number <= 1000);
        number.ok_or_else(|| format!("expected a number up to 1000 at {pointer} of a time function"))
    };
    let shape = if value.get("ramp").is_some() {
        let (near, far) = (number(value, "/ramp/0")?, number(value, "/ramp/1")?);
        if near == far || near * far < 0.0 {
            return Err(format!("expected two ends of a ramp on one side of 0, found {near} and {far}"));
        }
        Shape::Ramp { near, far }
    } else if value.get("wave").is_some() {
        let sine = at(value, "/of")?.as_str() == Some("sine");
        Shape::Wave { power: whole("/power")?, n: whole("/wave")?, sine }
    } else {
        Shape::Power(whole("/power")?)
    };
    let pair = |p: &str| Ok::<_, String>([number(value, &format!("{p}/0"))?, number(value, &format!("{p}/1"))?]);
    let beyond = match value.get("beyond") {
        None => None,
        Some(_) => {
            let fade = number(value, "/beyond/fade")?;
            if fade.is_nan() || fade <= 0.0 {
                return Err(format!("expected a positive fade of a time function, found {fade}"));
            }
            let edges = [pair("/beyond/edges/0")?, pair("/beyond/edges/1")?];
            Some(Beyond { line: pair("/beyond/line")?, edges, fade })
        }
    };
    Ok(TimeFunction { shape, beyond })
}
