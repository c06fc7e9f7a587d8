//! Colours of one pixel of a static camera over time: recurring ones and passing ones.
//!
//! A static surface has the same colour in every frame, up to noise. A passing object has colours that change with
//! its texture, shading and edges. So the background is a tight *cluster* of the samples. It is usually not their
//! median: an object that moves less than twice its own width covers the middle of its path for more than half of the
//! time.

/// A sample belongs to a cluster within this squared distance of its centre, over the variance of the noise: 99.7 %
/// of a chi-squared distribution with three degrees of freedom.
pub(crate) const MEMBER: f32 = 14.0;

/// The same between two samples. Both have noise (twice the variance), and the limit is less strict because many
/// members count and not one pair.
const PAIR: f32 = 20.0;

/// Share of samples that makes a cluster the background without looking for another.
const MAJORITY: f32 = 0.7;

/// Smallest share of the samples in a recurring colour. A texture that turns in place repeats fewer by chance.
const STAYS: f32 = 0.25;

/// Most samples that are tried as a cluster's centre; bounds the work for long videos.
const CANDIDATES: usize = 16;

/// A recurring colour, its count and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cluster {
    /// Mean colour, levels of 255.
    pub mean: [f32; 3],
    /// Number of samples.
    pub count: usize,
    /// Indices of the first and last sample, in time order.
    pub first: usize,
    pub last: usize,
}

/// Kind of a pixel by its colours over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pixel {
    /// The views' own masks leave too few samples.
    Masked,
    /// One colour returns: the background.
    Stable(Cluster),
    /// Two colours return, the likelier background first: the colour seen before and after the other one, because an
    /// object uncovers again what it passes over; else the more frequent one.
    Ambiguous(Cluster, Cluster),
    /// No colour returns: something moves here all the time.
    Unstable,
}

/// Classifies a pixel by its `samples` in time order. `deviation` is the noise, levels of 255; `scratch` is reused
/// memory.
pub(crate) fn classify(samples: &[[u8; 3]], deviation: f32, samples_min: usize, scratch: &mut Vec<bool>) -> Pixel {
    if samples.len() < samples_min.max(1) {
        return Pixel::Masked;
    }
    let variance = deviation * deviation;
    let quick = around(samples, mean_of(samples.iter()), MEMBER * variance, |_| true);
    if let Some(all) = quick.filter(|all| all.count == samples.len()) {
        return Pixel::Stable(all);
    }
    let enough = ((STAYS * samples.len() as f32).ceil() as usize).max(2);
    scratch.clear();
    scratch.resize(samples.len(), true);
    let Some(first) = densest(samples, variance, scratch).filter(|cluster| cluster.count >= enough) else {
        return Pixel::Unstable;
    };
    if first.count as f32 >= MAJORITY * samples.len() as f32 {
        return Pixel::Stable(first);
    }
    for (free, sample) in scratch.iter_mut().zip(samples) {
        *free = distance2(sample, &first.mean) > MEMBER * variance;
    }
    match densest(samples, variance, scratch).filter(|cluster| cluster.count >= enough) {
        None => Pixel::Stable(first),
        Some(second) if second.first < first.first && second.last > first.last => Pixel::Ambiguous(second, first),
        Some(second) => Pixel::Ambiguous(first, second),
    }
}

/// The cluster with most members among the free samples.
fn densest(samples: &[[u8; 3]], variance: f32, free: &[bool]) -> Option<Cluster> {
    let step = free.iter().filter(|free| **free).count().div_ceil(CANDIDATES).max(1);
    let mut best: Option<(usize, f32, usize)> = None;
    for i in (0..samples.len()).filter(|i| free[*i]).step_by(step) {
        let centre = samples[i].map(f32::from);
        let (mut count, mut spread) = (0, 0.0);
        for (sample, _) in samples.iter().zip(free).filter(|(_, free)| **free) {
            let distance = distance2(sample, &centre);
            if distance <= PAIR * variance {
                count += 1;
                spread += distance;
            }
        }
        if best.is_none_or(|(most, least, _)| count > most || (count == most && spread < least)) {
            best = Some((count, spread, i));
        }
    }
    let (_, _, i) = best?;
    let near = around(samples, samples[i].map(f32::from), PAIR * variance, |j| free[j])?;
    around(samples, near.mean, MEMBER * variance, |j| free[j])
}

/// The samples within a distance of a colour as a cluster.
fn around(samples: &[[u8; 3]], centre: [f32; 3], radius2: f32, is_free: impl Fn(usize) -> bool) -> Option<Cluster> {
    let belongs = |i: &usize| is_free(*i) && distance2(&samples[*i], &centre) <= radius2;
    let (mut count, mut first, mut last) = (0, None, 0);
    for i in (0..samples.len()).filter(belongs) {
        count += 1;
        first = first.or(Some(i));
        last = i;
    }
    let mean = mean_of((0..samples.len()).filter(belongs).map(|i| &samples[i]));
    first.map(|first| Cluster { mean, count, first, last })
}

fn mean_of<'a>(samples: impl Iterator<Item = &'a [u8; 3]>) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0_f32; 3], 0.0_f32);
    for sample in samples {
        for (sum, value) in sum.iter_mut().zip(sample) {
            *sum += f32::from(*value);
        }
        count += 1.0;
    }
    sum.map(|sum| sum / count.max(1.0))
}

/// Squared distance of a sample from a colour, levels of 255.
pub(crate) fn distance2(sample: &[u8; 3], color: &[f32; 3]) -> f32 {
    let [r, g, b] = [0, 1, 2].map(|c| f32::from(sample[c]) - color[c]);
    r * r + g * g + b * b
}
