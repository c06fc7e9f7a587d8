//! Space carving: a position belongs to the object if (nearly) every camera that sees it has it inside its mask.
//!
//! A block of voxels is judged at once by the mask pixels under it (a summed-area table answers in constant time): no
//! pixel set means outside, all set means inside, and only blocks in between are divided, down to single voxels. The
//! work follows the surface and not the volume.

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use crate::options::HullOptions;
use crate::pinhole::Pinhole;

/// Edge of the initial blocks, voxels; a power of two.
const BLOCK: usize = 8;

/// A camera with its mask of the object.
pub(crate) struct Silhouette {
    pub camera: Pinhole,
    /// `[height + 1, width + 1]`: set pixels above and left.
    sums: Vec<u32>,
    /// Whether positions out of view count as outside the mask.
    bounds: bool,
}

/// How a mask covers the image of a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cover {
    /// Out of view.
    OutOfView,
    Outside,
    Partly,
    Inside,
}

impl Silhouette {
    /// `mask` has the camera's size.
    pub fn new(camera: Pinhole, mask: &[bool]) -> Self {
        let stride = camera.width + 1;
        let mut sums = vec![0_u32; stride * (camera.height + 1)];
        for y in 0..camera.height {
            let mut row = 0;
            for x in 0..camera.width {
                row += u32::from(mask[y * camera.width + x]);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self { camera, sums, bounds: false }
    }

    /// Lets positions out of view count as outside, if the mask keeps off the image's edge: then the image holds all
    /// of the object.
    pub fn bound(&mut self) {
        let (width, height) = (self.camera.width, self.camera.height);
        let inner = self.count((1, width.max(2) - 1), (1, height.max(2) - 1));
        self.bounds = inner > 0 && inner == self.count((0, width), (0, height));
    }

    /// Undoes [`bound`](Self::bound).
    pub fn unbound(&mut self) {
        self.bounds = false;
    }

    /// Number of set pixels in columns `x` and rows `y`.
    fn count(&self, x: (usize, usize), y: (usize, usize)) -> u32 {
        let at = |x: usize, y: usize| self.sums[y * (self.camera.width + 1) + x];
        at(x.1, y.1) + at(x.0, y.0) - at(x.0, y.1) - at(x.1, y.0)
    }

    /// Whether the mask is set at the position's projection; `None` out of view, unless the silhouette is
    /// [bound](Self::bound).
    pub fn contains(&self, position: DVec3) -> Option<bool> {
        let pixel = self.camera.project(position).and_then(|(pixel, _)| self.camera.pixel(pixel));
        match pixel {
            Some((x, y)) => Some(self.count((x, x + 1), (y, y + 1)) > 0),
            None => self.bounds.then_some(false),
        }
    }

    /// Largest distance of a mask pixel from a position, measured at its depth, scene units; `None` for an empty
    /// mask.
    pub fn reach(&self, position: DVec3) -> Option<f64> {
        let (pixel, depth) = self.camera.project(position)?;
        let (width, height) = (self.camera.width, self.camera.height);
        let mut farthest: Option<f64> = None;
        for y in (0..height).filter(|y| self.count((0, width), (*y, *y + 1)) > 0) {
            for x in (0..width).filter(|x| self.count((*x, *x + 1), (y, y + 1)) > 0) {
                let distance = pixel.distance(glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
                farthest = Some(farthest.map_or(distance, |most| most.max(distance)));
            }
        }
        farthest.map(|pixels| (pixels + 1.0) * depth / self.camera.focal())
    }

    /// Cover of a ball.
    fn cover(&self, centre: DVec3, radius: f64) -> Cover {
        let camera = &self.camera;
        let near = centre.distance(camera.centre) <= 2.0 * radius;
        let out_of_view = if self.bounds { Cover::Outside } else { Cover::OutOfView };
        let Some((pixel, depth)) = camera.project(centre).filter(|(_, depth)| *depth > radius) else {
            return if near { Cover::Partly } else { out_of_view };
        };
        // The image of a ball off the axis is stretched by one over the cosine.
        let k = &camera.intrinsics;
        let (a, b) = ((pixel.x - k.cx) / k.fx, (pixel.y - k.cy) / k.fy);
        let reach = camera.focal() * radius / (depth - radius) * (1.0 + a * a + b * b).sqrt();
        let span = |at: f64, size: usize| {
            let (low, high) = ((at - reach).floor(), (at + reach).ceil());
            let clipped = (low.clamp(0.0, size as f64) as usize, high.clamp(0.0, size as f64) as usize);
            (clipped, low >= 0.0 && high <= size as f64)
        };
        let ((x, x_whole), (y, y_whole)) = (span(pixel.x, camera.width), span(pixel.y, camera.height));
        let area = (x.1 - x.0) * (y.1 - y.0);
        if area == 0 {
            return out_of_view;
        }
        let set = self.count(x, y) as usize;
        match (set, x_whole && y_whole) {
            (0, whole) if whole || self.bounds => Cover::Outside,
            (set, true) if set == area => Cover::Inside,
            // Beyond the image's edge nothing is known.
            _ => Cover::Partly,
        }
    }
}

/// Number of cameras that must agree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Consensus {
    /// Cameras that may disagree, by how many see the position.
    options: HullOptions,
    /// Cameras that must see a position, so that a region seen by a corner of the rig alone is not kept unchecked.
    pub seen_min: usize,
}

impl Consensus {
    /// For a number of cameras: half of them, and two at least, must see a position.
    pub fn of(cameras: usize, options: &HullOptions) -> Self {
        Self { options: *options, seen_min: cameras.div_ceil(2).max(2) }
    }

    fn allowed(&self, seen: usize) -> usize {
        let HullOptions { misses, forgiving_from, cameras_per_miss, .. } = self.options;
        let usual = if seen < forgiving_from { 0 } else { 1 + seen / cameras_per_miss.max(1) };
        misses.unwrap_or(usual).min(seen.saturating_sub(2))
    }

    fn keeps(&self, silhouettes: &[Silhouette], position: DVec3) -> bool {
        let (hits, seen) = support(silhouettes, position);
        seen >= self.seen_min && seen - hits <= self.allowed(seen)
    }

    /// Whether a part of a ball may be kept. Only cameras that see its middle count: at the image's edge a cut ball
    /// is unknown, and everything at the edge of all images would be kept otherwise.
    fn may_keep(&self, silhouettes: &[Silhouette], centre: DVec3, radius: f64) -> bool {
        let covers = silhouettes.iter().filter(|one| one.contains(centre).is_some());
        let (hits, seen) = covers.fold((0, 0), |(hits, seen), one| {
            (hits + usize::from(one.cover(centre, radius) != Cover::Outside), seen + 1)
        });
        seen >= self.seen_min && seen - hits <= self.allowed(seen)
    }
}

/// Number of cameras with the position in their masks, and number of cameras that see it.
pub(crate) fn support(silhouettes: &[Silhouette], position: DVec3) -> (usize, usize) {
    let answers = silhouettes.iter().filter_map(|silhouette| silhouette.contains(position));
    answers.fold((0, 0), |(hits, seen), hit| (hits + usize::from(hit), seen + 1))
}

/// A grid of voxels, filled where the object is.
#[derive(Debug, Clone)]
pub(crate) struct Voxels {
    /// Corner of the first voxel.
    pub low: DVec3,
    /// Edge of a voxel, scene units.
    pub edge: f64,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// `[z, y, x]`.
    pub filled: Vec<bool>,
}

impl Voxels {
    /// An empty grid over a box with `resolution` voxels along its longest side.
    pub fn over(low: DVec3, high: DVec3, resolution: usize) -> Self {
        let size = high - low;
        let edge = size.max_element() / resolution as f64;
        let dims = size.to_array().map(|side| ((side / edge - 1e-6).ceil().max(1.0) as usize).min(resolution));
        Self { low, edge, dims, filled: vec![false; dims[0] * dims[1] * dims[2]] }
    }

    /// Centre of a voxel.
    pub fn position(&self, cell: UVec3) -> DVec3 {
        self.low + self.edge * (cell.as_dvec3() + 0.5)
    }

    pub fn index(&self, cell: UVec3) -> usize {
        (cell.z as usize * self.dims[1] + cell.y as usize) * self.dims[0] + cell.x as usize
    }

    pub fn cell(&self, index: usize) -> UVec3 {
        let [nx, ny, _] = self.dims;
        UVec3::new((index % nx) as u32, (index / nx % ny) as u32, (index / nx / ny) as u32)
    }

    /// The filled voxels.
    pub fn cells(&self) -> impl Iterator<Item = UVec3> {
        (0..self.filled.len()).filter(|index| self.filled[*index]).map(|index| self.cell(index))
    }

    /// Neighbours of a voxel over faces, over edges and corners too if `corners`.
    pub fn around(&self, cell: UVec3, corners: bool) -> impl Iterator<Item = UVec3> {
        let dims = self.dims.map(|n| n as i32);
        let c = cell.as_ivec3();
        (0..27_i32).filter_map(move |i| {
            let step = glam::IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
            let faces = step.abs().element_sum();
            let next = c + step;
            let inside = next.cmpge(glam::IVec3::ZERO).all() && next.cmplt(glam::IVec3::from_array(dims)).all();
            (inside && faces > 0 && (corners || faces == 1)).then(|| next.as_uvec3())
        })
    }

    /// Filled voxels with a face towards an empty one or the end of the grid.
    pub fn surface(&self) -> Vec<UVec3> {
        let is_inner =
            |cell: &UVec3| self.around(*cell, false).filter(|next| self.filled[self.index(*next)]).count() == 6;
        self.cells().filter(|cell| !is_inner(cell)).collect()
    }

    /// Fills every voxel that `consensus` keeps; with `generous` also voxels that may contain a part of the object.
    pub fn carve(&mut self, silhouettes: &[Silhouette], consensus: Consensus, generous: bool) {
        let blocks: Vec<UVec3> = {
            let [nx, ny, nz] = self.dims.map(|n| n.div_ceil(BLOCK) as u32);
            let all = (0..nx * ny * nz).map(|i| UVec3::new(i % nx, i / nx % ny, i / nx / ny));
            all.map(|block| block * BLOCK as u32).collect()
        };
        let task = Task { grid: self, silhouettes, consensus, generous };
        let found: Vec<Vec<usize>> = blocks
            .into_par_iter()
            .map(|corner| {
                let mut kept = Vec::new();
                task.divide(corner, BLOCK as u32, &mut kept);
                kept
            })
            .collect();
        for index in found.into_iter().flatten() {
            self.filled[index] = true;
        }
    }
}

/// Inputs of the recursion over blocks.
struct Task<'a> {
    grid: &'a Voxels,
    silhouettes: &'a [Silhouette],
    consensus: Consensus,
    generous: bool,
}

impl Task<'_> {
    fn divide(&self, corner: UVec3, size: u32, kept: &mut Vec<usize>) {
        let grid = self.grid;
        if corner.to_array().iter().zip(&grid.dims).any(|(at, n)| *at as usize >= *n) {
            return;
        }
        let half = 0.5 * f64::from(size) * grid.edge;
        let centre = grid.low + grid.edge * corner.as_dvec3() + half;
        let (mut outside, mut partly, mut seen) = (0, 0, 0);
        for silhouette in self.silhouettes {
            let cover = silhouette.cover(centre, half * 3.0_f64.sqrt());
            outside += usize::from(cover == Cover::Outside);
            partly += usize::from(cover == Cover::Partly);
            seen += usize::from(cover != Cover::OutOfView);
        }
        if seen < self.consensus.seen_min || outside > self.consensus.allowed(seen) {
            return;
        }
        if size == 1 {
            let keeps = if self.generous {
                self.consensus.may_keep(self.silhouettes, centre, half * 3.0_f64.sqrt())
            } else {
                self.consensus.keeps(self.silhouettes, centre)
            };
            if keeps {
                kept.push(grid.index(corner));
            }
        } else if partly == 0 {
            for z in corner.z..(corner.z + size).min(grid.dims[2] as u32) {
                for y in corner.y..(corner.y + size).min(grid.dims[1] as u32) {
                    for x in corner.x..(corner.x + size).min(grid.dims[0] as u32) {
                        kept.push(grid.index(UVec3::new(x, y, z)));
                    }
                }
            }
        } else {
            let half = size / 2;
            for i in 0..8 {
                self.divide(corner + half * UVec3::new(i & 1, i >> 1 & 1, i >> 2), half, kept);
            }
        }
    }
}
