//! Connected regions of a mask: finding, dropping small ones, filling holes, growing, joining.

/// A connected set of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Region {
    pub area: usize,
    /// Its first pixel in reading order.
    pub first: usize,
    /// Whether it touches the image's edge.
    pub at_border: bool,
}

/// Regions of a mask and for each pixel the number of its region, [`NOWHERE`] outside.
pub(crate) struct Regions {
    pub labels: Vec<u32>,
    pub list: Vec<Region>,
}

/// Label of pixels in no region.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// The regions of the pixels that satisfy `is_in`, joined over edges, and over corners too if `corners`.
pub(crate) fn regions(size: (usize, usize), corners: bool, is_in: impl Fn(usize) -> bool) -> Regions {
    let (width, height) = size;
    let mut list = Vec::new();
    let around = |pixel: usize, visit: &mut dyn FnMut(usize)| {
        neighbours(pixel % width, pixel / width, size, corners, visit);
    };
    let labels = label(width * height, is_in, around, |label, pixel| {
        if label == list.len() {
            list.push(Region { area: 0, first: pixel, at_border: false });
        }
        let (x, y) = (pixel % width, pixel / width);
        list[label].area += 1;
        list[label].at_border |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    });
    Regions { labels, list }
}

/// Labels the connected parts of `count` cells that satisfy `is_in`, in the order of their first cells. `around` visits
/// the neighbours of a cell, and `found` is told each cell with its part, the first cell of a part first.
pub(crate) fn label(
    count: usize,
    is_in: impl Fn(usize) -> bool,
    around: impl Fn(usize, &mut dyn FnMut(usize)),
    mut found: impl FnMut(usize, usize),
) -> Vec<u32> {
    let (mut labels, mut parts, mut stack) = (vec![NOWHERE; count], 0, Vec::new());
    for start in 0..count {
        if labels[start] != NOWHERE || !is_in(start) {
            continue;
        }
        labels[start] = parts;
        stack.push(start);
        while let Some(cell) = stack.pop() {
            found(parts as usize, cell);
            around(cell, &mut |next| {
                if labels[next] == NOWHERE && is_in(next) {
                    labels[next] = parts;
                    stack.push(next);
                }
            });
        }
        parts += 1;
    }
    labels
}

fn neighbours(x: usize, y: usize, (width, height): (usize, usize), corners: bool, mut visit: impl FnMut(usize)) {
    for v in y.saturating_sub(1)..(y + 2).min(height) {
        for u in x.saturating_sub(1)..(x + 2).min(width) {
            if (u != x || v != y) && (corners || u == x || v == y) {
                visit(v * width + u);
            }
        }
    }
}

/// Clears regions of fewer than `area_min` pixels.
pub(crate) fn drop_specks(mask: &mut [bool], size: (usize, usize), area_min: usize) {
    let found = regions(size, true, |pixel| mask[pixel]);
    for (value, label) in mask.iter_mut().zip(&found.labels) {
        *value &= *label != NOWHERE && found.list[*label as usize].area >= area_min;
    }
}

/// Adds to `mask` the regions of `candidate` pixels that have at least `share` of their outline (edges between pixels)
/// in common with it.
pub(crate) fn join(mask: &mut [bool], size: (usize, usize), share: f64, candidate: impl Fn(usize) -> bool) {
    let found = regions(size, false, |pixel| !mask[pixel] && candidate(pixel));
    let mut outlines = vec![(0_usize, 0_usize); found.list.len()];
    for (pixel, label) in found.labels.iter().enumerate().filter(|(_, label)| **label != NOWHERE) {
        let (common, all) = &mut outlines[*label as usize];
        neighbours(pixel % size.0, pixel / size.0, size, false, |next| {
            *common += usize::from(mask[next]);
            *all += usize::from(found.labels[next] != *label);
        });
    }
    for (value, label) in mask.iter_mut().zip(&found.labels) {
        *value |= outlines.get(*label as usize).is_some_and(|(common, all)| *common as f64 >= share * *all as f64);
    }
}

/// Sets gaps and notches up to two pixels wide: grows by a pixel on all sides and wears by one.
pub(crate) fn close_gaps(mask: &mut [bool], size: (usize, usize)) {
    let grown: Vec<bool> = (0..mask.len())
        .map(|pixel| {
            let mut set = mask[pixel];
            neighbours(pixel % size.0, pixel / size.0, size, true, |next| set |= mask[next]);
            set
        })
        .collect();
    for (pixel, value) in mask.iter_mut().enumerate() {
        let mut set = grown[pixel];
        neighbours(pixel % size.0, pixel / size.0, size, true, |next| set &= grown[next]);
        *value = set;
    }
}

/// Sets what a region encloses, where the hole is at most `share` of the region that encloses it.
pub(crate) fn fill_holes(mask: &mut [bool], size: (usize, usize), share: f64) {
    let filled = regions(size, true, |pixel| mask[pixel]);
    let empty = regions(size, false, |pixel| !mask[pixel]);
    let closes: Vec<bool> = empty
        .list
        .iter()
        .map(|hole| {
            // The pixel left of a hole's first one is not in the hole, and an inner hole has one.
            let around = hole.first.checked_sub(1).map_or(NOWHERE, |left| filled.labels[left]);
            !hole.at_border && around != NOWHERE && hole.area as f64 <= share * filled.list[around as usize].area as f64
        })
        .collect();
    for (value, label) in mask.iter_mut().zip(&empty.labels) {
        *value |= *label != NOWHERE && closes[*label as usize];
    }
}

/// Adds to `mask` every pixel of `doubtful` that is connected to it.
pub(crate) fn grow(mask: &mut [bool], size: (usize, usize), doubtful: impl Fn(usize) -> bool) {
    let mut stack: Vec<usize> = (0..mask.len()).filter(|pixel| mask[*pixel]).collect();
    while let Some(pixel) = stack.pop() {
        neighbours(pixel % size.0, pixel / size.0, size, false, |next| {
            if !mask[next] && doubtful(next) {
                mask[next] = true;
                stack.push(next);
            }
        });
    }
}
