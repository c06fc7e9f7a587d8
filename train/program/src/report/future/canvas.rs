//! A picture on which lines are drawn.

use super::strip::Picture;

/// Draws a line from `a` to `b`, pixels from the upper left corner, with soft edges; `share` of its colour covers what
/// is below.
pub fn line(picture: &mut Picture, a: [f64; 2], b: [f64; 2], width: f64, color: [u8; 3], share: f64) {
    if !a.iter().chain(&b).all(|x| x.is_finite()) {
        return;
    }
    let reach = 0.5 * width + 1.0;
    let bounds = |axis: usize, size: usize| {
        let low = (a[axis].min(b[axis]) - reach).floor().clamp(0.0, size as f64) as usize;
        let high = (a[axis].max(b[axis]) + reach).ceil().clamp(0.0, size as f64) as usize;
        low..high
    };
    for y in bounds(1, picture.height) {
        for x in bounds(0, picture.width) {
            let distance = distance([x as f64 + 0.5, y as f64 + 0.5], a, b);
            let cover = share * (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
            if cover <= 0.0 {
                continue;
            }
            let start = 3 * (y * picture.width + x);
            for (below, own) in picture.pixels[start..start + 3].iter_mut().zip(color) {
                *below = (f64::from(*below) * (1.0 - cover) + f64::from(own) * cover + 0.5) as u8;
            }
        }
    }
}

/// The distance of a point from a line segment.
fn distance(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (along, from) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let place = if squared > 0.0 { ((from[0] * along[0] + from[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (from[0] - place * along[0]).hypot(from[1] - place * along[1])
}

/// Mixes every pixel with white.
pub fn fade(picture: &mut Picture, share: f64) {
    for value in &mut picture.pixels {
        *value = (f64::from(*value) * (1.0 - share) + 255.0 * share + 0.5) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_covers_its_pixels_and_no_others() {
        let mut picture = Picture { width: 9, height: 7, pixels: vec![0; 9 * 7 * 3] };
        line(&mut picture, [1.0, 3.5], [7.0, 3.5], 1.0, [250, 100, 50], 1.0);
        let at = |x: usize, y: usize| picture.pixels[3 * (9 * y + x)];
        assert_eq!((at(4, 3), at(4, 5), at(4, 1)), (250, 0, 0));
        let before = picture.clone();
        line(&mut picture, [f64::NAN, 0.0], [5.0, 5.0], 1.0, [255; 3], 1.0);
        line(&mut picture, [-1e300, -5.0], [-20.0, 1e300], 1.0, [255; 3], 1.0);
        assert_eq!(picture, before, "nothing outside and nothing that is no number is drawn");
        fade(&mut picture, 1.0);
        assert!(picture.pixels.iter().all(|value| *value == 255));
    }
}
