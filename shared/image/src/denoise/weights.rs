//! Non-local means: each pixel becomes the mean of similar pixels around it.

use super::plane::{Colours, Plane, each};
use rayon::prelude::*;
use std::ops::Range;

/// How far to look for similar pixels, to all sides.
const REACH: isize = 6;
/// Rows filtered together.
const BAND: usize = 16;
/// Radius of the larger patches.
const PATCH: usize = 3;

/// How to compare pixels.
#[derive(Clone, Copy, Debug)]
pub struct Strength {
    /// The patches around them.
    pub patch: Patch,
    /// Number of standard errors by which these may differ.
    pub errors: f32,
}

/// Squares whose colours are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patch {
    /// 3 x 3 pixels: keeps fine detail.
    Small,
    /// 7 x 7 pixels: mistakes less noise for detail.
    Large,
}

/// The means of the even, of the odd, and of all passes. The noise of the first two, the halves, is independent.
pub type Pictures = [Colours; 3];

/// Their variances, relative to that of a half.
const VARIANCES: [f32; 3] = [1.0, 1.0, 0.5];

/// The filtered pictures, once for each strength. Each is filtered by its own weights, so that one half can judge the
/// other. The averaged pixels are those of the second, [despiked], pictures.
///
/// `variance`: of each half. `features`: what tells, besides colour, which pixels belong together; each with the
/// inverse square of how much it may differ.
pub fn filtered<const K: usize>(
    [pictures, despiked]: [&Pictures; 2],
    variance: &Colours,
    features: &[(Plane, Plane)],
    strengths: [Strength; K],
) -> [Pictures; K] {
    let (width, height) = (pictures[0][0].width, pictures[0][0].height);
    let bands: Vec<Range<usize>> = (0..height).step_by(BAND).map(|y| y..height.min(y + BAND)).collect();
    let whole = || std::array::from_fn(|_| std::array::from_fn(|_| Plane::new(width, height)));
    let mut out: [Pictures; K] = std::array::from_fn(|_| whole());
    let done: Vec<Vec<Sums>> = bands
        .par_iter()
        .map(|rows| {
            let band = Band {
                pictures,
                despiked,
                variance,
                features,
                rows: rows.clone(),
                width,
                height,
            };
            band.filter(&strengths)
        })
        .collect();
    for (rows, sums) in bands.into_iter().zip(done) {
        for (candidate, sums) in out.iter_mut().zip(sums) {
            for (picture, (colours, weights)) in candidate.iter_mut().zip(sums.pictures) {
                for (plane, sum) in picture.iter_mut().zip(colours) {
                    let values = &mut plane.values[rows.start * width..rows.end * width];
                    for ((value, sum), weight) in values.iter_mut().zip(sum).zip(&weights) {
                        *value = sum / weight;
                    }
                }
            }
        }
    }
    out
}

/// Radius of the surroundings that a pixel must not outshine, and the rank among the brightest of these that is the
/// limit.
const SPIKE_RADIUS: usize = 3;
const SPIKE_RANK: usize = 4;

/// Dims pixels that outshine all but four of the 7 x 7 around them to the fifth: fireflies. The other half decides
/// whether they are fireflies or small bright details.
pub fn despiked(picture: &Colours) -> Colours {
    let [r, g, b] = picture;
    let sum = Plane::of([r, g, b], |[r, g, b]| r + g + b);
    let factor = Plane::from_rows(sum.width, sum.height, |y, row| {
        let rows = y.saturating_sub(SPIKE_RADIUS)..sum.height.min(y + SPIKE_RADIUS + 1);
        for (x, factor) in row.iter_mut().enumerate() {
            let columns = x.saturating_sub(SPIKE_RADIUS)..sum.width.min(x + SPIKE_RADIUS + 1);
            // In descending order.
            let mut brightest = [f32::MIN; SPIKE_RANK + 1];
            for y in rows.clone() {
                for value in &sum.row(y)[columns.clone()] {
                    if *value > brightest[SPIKE_RANK] {
                        let place = brightest.iter().position(|other| value > other).unwrap_or(SPIKE_RANK);
                        brightest[place..].rotate_right(1);
                        brightest[place] = *value;
                    }
                }
            }
            let most = brightest[SPIKE_RANK];
            let value = sum.row(y)[x];
            *factor = if value > most && most >= 0.0 { most / value } else { 1.0 };
        }
    });
    each(|c| Plane::of([&picture[c], &factor], |[value, factor]| value * factor))
}

/// Weighted sums of a band's colours, and sums of the weights, for each picture.
struct Sums {
    pictures: [([Vec<f32>; 3], Vec<f32>); 3],
}

struct Band<'a> {
    pictures: &'a Pictures,
    despiked: &'a Pictures,
    variance: &'a Colours,
    features: &'a [(Plane, Plane)],
    rows: Range<usize>,
    width: usize,
    height: usize,
}

impl Band<'_> {
    fn filter(&self, strengths: &[Strength]) -> Vec<Sums> {
        let pixels = self.rows.len() * self.width;
        let zeros = || vec![0.0f32; pixels];
        let sums = |_| Sums {
            pictures: std::array::from_fn(|_| (std::array::from_fn(|_| zeros()), zeros())),
        };
        let mut sums: Vec<Sums> = (0..strengths.len()).map(sums).collect();
        let mut scratch = Scratch::new(self.width, self.rows.len());
        for dy in -REACH..=REACH {
            for dx in -REACH..=REACH {
                self.add(dx, dy, strengths, &mut scratch, &mut sums);
            }
        }
        sums
    }

    /// Add the pixels at this offset to the right and down.
    fn add(&self, dx: isize, dy: isize, strengths: &[Strength], scratch: &mut Scratch, sums: &mut [Sums]) {
        let columns = overlap(self.width, dx);
        if columns.is_empty() {
            return;
        }
        let there = |y: usize| y.checked_add_signed(dy).filter(|y| *y < self.height);
        scratch.compare(self, (dx, dy), &columns);
        let other = columns.start.wrapping_add_signed(dx)..columns.end.wrapping_add_signed(dx);
        for (i, y) in self.rows.clone().enumerate() {
            let Some(other_y) = there(y) else {
                continue;
            };
            scratch.features.fill(0.0);
            for (feature, inverse) in self.features {
                let (here, there) = (&feature.row(y)[columns.clone()], &feature.row(other_y)[other.clone()]);
                let inverses = (&inverse.row(y)[columns.clone()], &inverse.row(other_y)[other.clone()]);
                let features = &mut scratch.features[..columns.len()];
                for (x, most) in features.iter_mut().enumerate() {
                    let difference = here[x] - there[x];
                    let square = difference * difference * least(inverses.0[x], inverses.1[x]);
                    *most = if square > *most { square } else { *most };
                }
            }
            let place = i * self.width + columns.start..i * self.width + columns.end;
            for of in 0..self.pictures.len() {
                scratch.blur(of, i, y, dy, self, &columns);
                let colours: [&[f32]; 3] = std::array::from_fn(|c| &self.despiked[of][c].row(other_y)[other.clone()]);
                for (strength, sums) in strengths.iter().zip(&mut *sums) {
                    let weights = &mut scratch.weights[..columns.len()];
                    let features = &scratch.features[..columns.len()];
                    let distances = &scratch.distances[strength.patch as usize][..columns.len()];
                    let scale = 1.0 / (strength.errors * strength.errors);
                    for ((weight, feature), distance) in weights.iter_mut().zip(features).zip(distances) {
                        let distance = distance * scale;
                        *weight = fading(if distance > *feature { distance } else { *feature });
                    }
                    let (sum, all) = &mut sums.pictures[of];
                    for (sum, colour) in sum.iter_mut().zip(colours) {
                        for ((sum, colour), weight) in sum[place.clone()].iter_mut().zip(colour).zip(&*weights) {
                            *sum += weight * colour;
                        }
                    }
                    for (sum, weight) in all[place.clone()].iter_mut().zip(&*weights) {
                        *sum += weight;
                    }
                }
            }
        }
    }
}

/// Places of a line whose neighbour at this offset is on the line as well.
fn overlap(length: usize, offset: isize) -> Range<usize> {
    let start = (-offset).max(0) as usize;
    let end = length.saturating_sub(offset.max(0) as usize);
    start..end.max(start)
}

fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Approximately exp(-x): 0 from 8 on, 1 below 0.
fn fading(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    let root = 1.0 - 0.125 * x;
    let root = if root > 0.0 { root } else { 0.0 };
    let square = root * root;
    let fourth = square * square;
    fourth * fourth
}

/// Buffers reused for every offset.
struct Scratch {
    /// By picture, for the band's rows and [`PATCH`] rows around it: how pixels differ from those at the offset.
    squares: [Vec<f32>; 3],
    features: Vec<f32>,
    weights: Vec<f32>,
    /// By patch size: means of the squares.
    distances: [Vec<f32>; 2],
    columns: [Vec<f32>; 2],
}

impl Scratch {
    fn new(width: usize, rows: usize) -> Self {
        let line = || vec![0.0; width];
        let squares = || vec![0.0; (rows + 2 * PATCH) * width];
        Self {
            squares: [squares(), squares(), squares()],
            features: line(),
            weights: line(),
            distances: [line(), line()],
            // With zeros on both sides.
            columns: [vec![0.0; width + 2 * PATCH], vec![0.0; width + 2 * PATCH]],
        }
    }

    /// Fill in the squares for an offset.
    fn compare(&mut self, band: &Band, (dx, dy): (isize, isize), columns: &Range<usize>) {
        let other = columns.start.wrapping_add_signed(dx)..columns.end.wrapping_add_signed(dx);
        for i in 0..band.rows.len() + 2 * PATCH {
            let y = (band.rows.start + i).wrapping_sub(PATCH);
            let other_y = y.wrapping_add_signed(dy);
            let is_there = y < band.height && other_y < band.height;
            for ((picture, share), squares) in band.pictures.iter().zip(VARIANCES).zip(&mut self.squares) {
                let squares = &mut squares[i * band.width..][..columns.len()];
                squares.fill(0.0);
                if !is_there {
                    continue;
                }
                for (colours, variance) in picture.iter().zip(band.variance) {
                    let (here, there) = (&colours.row(y)[columns.clone()], &colours.row(other_y)[other.clone()]);
                    let (v, w) = (&variance.row(y)[columns.clone()], &variance.row(other_y)[other.clone()]);
                    for (x, square) in squares.iter_mut().enumerate() {
                        let difference = here[x] - there[x];
                        let expected = share * (v[x] + least(v[x], w[x]));
                        *square += (difference * difference - expected) / (share * (v[x] + w[x]) + f32::MIN_POSITIVE);
                    }
                }
            }
        }
    }

    /// Fill in the distances for a row of the band, from one picture.
    fn blur(&mut self, of: usize, i: usize, y: usize, dy: isize, band: &Band, columns: &Range<usize>) {
        let count = columns.len();
        for (patch, radius) in [1, PATCH].into_iter().enumerate() {
            let sums = &mut self.columns[patch];
            sums.fill(0.0);
            let mut rows = 0;
            for k in 0..=2 * radius {
                let y = (y + k).wrapping_sub(radius);
                if y >= band.height || y.wrapping_add_signed(dy) >= band.height {
                    continue;
                }
                rows += 1;
                let squares = &self.squares[of][(i + PATCH + k - radius) * band.width..][..count];
                for (sum, square) in sums[PATCH..].iter_mut().zip(squares) {
                    *sum += square;
                }
            }
            let distances = &mut self.distances[patch][..count];
            distances.fill(0.0);
            for k in 0..=2 * radius {
                for (distance, sum) in distances.iter_mut().zip(&sums[PATCH + k - radius..]) {
                    *distance += sum;
                }
            }
            let inside = 3.0 * rows as f32;
            for (x, distance) in distances.iter_mut().enumerate() {
                let across = count.min(x + radius + 1) - x.saturating_sub(radius);
                *distance /= inside * across as f32;
            }
        }
    }
}
