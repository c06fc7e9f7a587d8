//! The path of a camera while its shutter is open, with a correction of its pose.
//!
//! `C(u) = exp(xi(u)) C_0`, world to camera, for `u` from -1, where the shutter opens, to 1, where it closes. The twist
//! `xi(u) = sum_k P_k(u) a_k` lies in se(3) and `P_k` is the Legendre polynomial of degree `k`: `a_0` corrects the mean
//! pose, `a_1` is half of the way from the first pose to the last (the linear path of BAD-Gaussians, Eq. 4), `a_2` and
//! `a_3` bend it.

use burn::tensor::{Tensor, TensorData};
use glam::DMat4;
use gs_burn::Camera;

/// Numbers of a twist: a rotation vector (radians, camera axes), then a translation.
pub const TWIST: usize = 6;

/// Highest degree of a path.
pub const DEGREES: usize = 3;

/// Terms of the exponential's series. A turn of half a radian leaves less than `0.5^9 / 9!`, 5e-9.
const TERMS: usize = 8;

/// Degrees of [`legendre`].
const FUNCTIONS: usize = DEGREES + 1;

/// The Legendre polynomials of degrees 0 to 3 at `u`.
fn legendre(u: f64) -> [f64; FUNCTIONS] {
    [1.0, u, 0.5 * (3.0 * u * u - 1.0), 0.5 * (5.0 * u * u * u - 3.0 * u)]
}

/// A path as numbers, for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// Twists by degree, pixels.
    twists: Vec<[f64; TWIST]>,
}

/// Straight parts of a path whose lengths are added up.
const PARTS: usize = 16;

impl Path {
    /// The path of a row, `[6 K]`, pixels.
    pub fn of(row: &[f32]) -> Self {
        Self { twists: row.as_chunks::<TWIST>().0.iter().map(|twist| twist.map(f64::from)).collect() }
    }

    /// The displacement of the image at the subject's distance, pixels right and down, at `u` from -1 to 1, to the
    /// first order; the place `[x, y]` is seen in the direction `[x, y, 1]`, camera axes.
    pub fn at(&self, u: f64, [x, y]: [f64; 2]) -> [f64; 2] {
        let sum = |i: usize| self.twists.iter().zip(legendre(u)).map(|(twist, value)| value * twist[i]).sum::<f64>();
        let ([pitch, yaw, roll], [right, down, ahead]) = ([0, 1, 2].map(sum), [3, 4, 5].map(sum));
        let farther = ahead + pitch * y - yaw * x;
        // A turn about y moves the image along x as a shift along x does.
        [yaw - roll * y + right - farther * x, roll * x - pitch + down - farther * y]
    }

    /// Length of the way of the image's middle, pixels.
    pub fn length(&self) -> f64 {
        self.length_at([0.0; 2])
    }

    /// The longest way of the middle and the four corners of an image, pixels; a turn about the axis and a way along it
    /// leave the middle where it is. One corner is seen in the direction `[x, y, 1]`.
    pub fn longest(&self, [x, y]: [f64; 2]) -> f64 {
        let places = [[0.0; 2], [x, y], [-x, y], [x, -y], [-x, -y]];
        places.into_iter().map(|place| self.length_at(place)).fold(0.0, f64::max)
    }

    fn length_at(&self, place: [f64; 2]) -> f64 {
        let at = |i: usize| self.at(2.0 * i as f64 / PARTS as f64 - 1.0, place);
        let places: Vec<[f64; 2]> = (0..=PARTS).map(at).collect();
        places.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
    }
}

/// The middles of `count` equal parts of an exposure, -1 to 1.
pub fn instants(count: usize) -> Vec<f64> {
    (0..count).map(|i| (2 * i + 1) as f64 / count as f64 - 1.0).collect()
}

/// One of some equal parts of a frame whose rows are exposed one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The first row that is exposed in it.
    pub first: usize,
    /// Its share of the exposure of each row from there.
    pub shares: Vec<f64>,
    /// Their derivatives by `e`.
    pub slopes: Vec<f64>,
}

/// `count` equal parts of a frame of `height` rows, of which each is exposed for a share `e` of it: the row at `y` from
/// -1 to 1 from `(1 - e) y - e` to `(1 - e) y + e`. `None` for a part in which no row is.
pub fn parts(count: usize, height: usize, e: f64) -> Vec<Option<Part>> {
    let part = |k: usize| {
        let [begin, end] = [k, k + 1].map(|k| (2 * k) as f64 / count as f64 - 1.0);
        let of_row = |row: usize| {
            let y = (2 * row + 1) as f64 / height as f64 - 1.0;
            let [opens, closes] = [(1.0 - e) * y - e, (1.0 - e) * y + e];
            let overlap = (end.min(closes) - begin.max(opens)).max(0.0);
            let of_closing = if closes <= end { 1.0 - y } else { 0.0 };
            let of_opening = if opens >= begin { 1.0 + y } else { 0.0 };
            (overlap / (2.0 * e), ((of_closing + of_opening) * e - overlap) / (2.0 * e * e))
        };
        let rows: Vec<(f64, f64)> = (0..height).map(of_row).collect();
        let first = rows.iter().position(|(share, _)| *share > 0.0)?;
        let (shares, slopes) = rows[first..].iter().copied().take_while(|(share, _)| *share > 0.0).unzip();
        Some(Part { first, shares, slopes })
    };
    (0..count).map(part).collect()
}

/// The twists of a path, `[1, 6 K]` with `K` coefficients from degree 0 on, at some instants: `[n, 6]`.
pub fn twists(path: Tensor<2>, at: &[f64]) -> Tensor<2> {
    let functions = path.dims()[1] / TWIST;
    let values: Vec<f64> = at.iter().flat_map(|u| legendre(*u)[..functions].to_vec()).collect();
    let values = like(&path, values, [at.len(), functions]);
    let coefficients = path.reshape([1, functions, TWIST]);
    (values.unsqueeze_dim::<3>(2) * coefficients).sum_dim(1).squeeze_dim(1)
}

/// The rigid motions of twists `[n, 6]` whose translations are in units of `distance`: `exp(xi)`, `[n, 4, 4]`.
fn exponential(twists: Tensor<2>, distance: f64) -> Tensor<3> {
    let [count, _] = twists.dims();
    let generators = like(&twists, generators(distance).concat(), [1, TWIST, 16]);
    let one: Vec<f64> = DMat4::IDENTITY.to_cols_array().into();
    let one = like(&twists, one, [1, 4, 4]);
    let matrices = (twists.unsqueeze_dim::<3>(2) * generators).sum_dim(1).reshape([count, 4, 4]);
    let terms = (1..=TERMS).rev();
    terms.fold(one.clone().expand([count, 4, 4]), |sum, k| one.clone() + product(matrices.clone(), sum) / k as f64)
}

/// `camera` moved by each of some twists `[n, 6]` whose translations are in units of `distance`, scene units.
pub fn moved(camera: &Camera, twists: Tensor<2>, distance: f64) -> Vec<Camera> {
    let [count, _] = twists.dims();
    let viewmats =
        product(exponential(twists.clone(), distance), camera.viewmat.clone().cast(twists.dtype()).unsqueeze_dim(0));
    let viewmat = |i: usize| viewmats.clone().narrow(0, i, 1).squeeze_dim(0);
    (0..count).map(|i| Camera { viewmat: viewmat(i), ..camera.clone() }).collect()
}

/// Products of matrices, `[n, 4, 4]` by `[n, 4, 4]` or `[1, 4, 4]`, with full precision on every device.
fn product(a: Tensor<3>, b: Tensor<3>) -> Tensor<3> {
    (a.unsqueeze_dim::<4>(3) * b.unsqueeze_dim::<4>(1)).sum_dim(2).squeeze_dim(2)
}

/// The matrices of the six directions of a twist, rows of 16.
fn generators(distance: f64) -> [[f64; 16]; TWIST] {
    let mut matrices = [[0.0; 16]; TWIST];
    for axis in 0..3 {
        let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
        (matrices[axis][4 * last + next], matrices[axis][4 * next + last]) = (1.0, -1.0);
        matrices[3 + axis][4 * axis + 3] = distance;
    }
    matrices
}

/// A tensor of some values, on the device and of the type of another.
fn like<const D: usize>(other: &Tensor<2>, values: Vec<f64>, shape: [usize; D]) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), (&other.device(), other.dtype()))
}
