//! Cellular noise (Worley 1996) in one to four dimensions, with the values of Blender's Voronoi node: the nearest of
//! feature points, one per cell. Distances to edges and smooth distances use Inigo Quilez's methods.

use super::hash;
use crate::math::powf;

/// Which feature is returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// The nearest point.
    F1,
    /// The second nearest.
    F2,
    /// The nearest, with smoothed creases.
    SmoothF1,
    /// Distance to the border of the cell.
    DistanceToEdge,
    /// Half the distance from the nearest point to its own nearest.
    NSphereRadius,
}

/// Distance metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Straight-line distance.
    Euclidean,
    /// Sum over the axes.
    Manhattan,
    /// Largest along an axis.
    Chebychev,
    /// Root of a sum of powers.
    Minkowski,
}

/// Source of the cells' random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellHash {
    /// Blender before 5.0.
    Lookup3,
    /// Blender since then; the same in one dimension.
    Pcg,
}

/// The node's parameters, clamped to their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// The feature.
    pub feature: Feature,
    /// The metric.
    pub metric: Metric,
    /// Whether distances are normalised to [0, 1].
    pub normalize: bool,
    /// Source of the points' positions in their cells.
    pub hash: CellHash,
    /// Number of octaves minus one, [0, 15].
    pub detail: f32,
    /// [0, 1].
    pub roughness: f32,
    /// Frequency ratio of successive octaves.
    pub lacunarity: f32,
    /// [0, 1/2].
    pub smoothness: f32,
    /// Exponent of Minkowski's metric.
    pub exponent: f32,
    /// Distance of points from the corners of their cells, [0, 1].
    pub randomness: f32,
    /// Factor that coordinates were multiplied by.
    pub scale: f32,
}

/// The result.
#[derive(Clone, Copy, Debug)]
pub struct Found<const N: usize> {
    /// Distance, or radius.
    pub distance: f32,
    /// Colour of the cell.
    pub color: [f32; 3],
    /// Position of the point.
    pub position: [f32; N],
}

impl<const N: usize> Found<N> {
    const NOTHING: Self = Self {
        distance: 0.0,
        color: [0.0; 3],
        position: [0.0; N],
    };
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

fn each<const N: usize>(a: [f32; N], b: [f32; N], by: impl Fn(f32, f32) -> f32) -> [f32; N] {
    std::array::from_fn(|i| by(a[i], b[i]))
}

fn dot<const N: usize>(a: [f32; N], b: [f32; N]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn square_between<const N: usize>(a: [f32; N], b: [f32; N]) -> f32 {
    let d = each(a, b, |a, b| a - b);
    dot(d, d)
}

/// A point, its cell, and the neighbouring cells.
struct Local<'a, const N: usize> {
    cells: &'a Cells,
    /// Lower corner of the cell.
    floor: [f32; N],
    /// Position relative to it.
    at: [f32; N],
}

impl<'a, const N: usize> Local<'a, N> {
    fn new(cells: &'a Cells, p: [f32; N]) -> Self {
        let floor = p.map(f32::floor);
        Self {
            cells,
            floor,
            at: each(p, floor, |p, floor| p - floor),
        }
    }

    fn distance(&self, a: [f32; N], b: [f32; N]) -> f32 {
        let d = each(a, b, |a, b| (a - b).abs());
        match self.cells.metric {
            // In one dimension all metrics agree.
            _ if N == 1 => d[0],
            Metric::Euclidean => dot(d, d).sqrt(),
            Metric::Manhattan => d.iter().sum(),
            Metric::Chebychev => d.iter().fold(0.0, |most, &x| most.max(x)),
            Metric::Minkowski => {
                let exponent = self.cells.exponent;
                powf(d.iter().map(|&x| powf(x, exponent)).sum(), 1.0 / exponent)
            }
        }
    }

    fn cell(&self, offset: [i32; N]) -> [i32; N] {
        std::array::from_fn(|i| (self.floor[i] as i32).wrapping_add(offset[i]))
    }

    /// The feature point of the cell at `offset`.
    fn point(&self, offset: [i32; N]) -> [f32; N] {
        let random = match (self.cells.hash, N) {
            (_, 1) => [hash::of_floats([self.floor[0] + offset[0] as f32]); N],
            (CellHash::Lookup3, _) => hash::cell_of_floats(each(self.floor, offset.map(|x| x as f32), |a, b| a + b)),
            (CellHash::Pcg, 2) => widened(hash::of_cell(narrowed::<N, 2>(self.cell(offset)))),
            (CellHash::Pcg, 3) => widened(hash::of_cell(narrowed::<N, 3>(self.cell(offset)))),
            (CellHash::Pcg, _) => widened(hash::of_cell(narrowed::<N, 4>(self.cell(offset)))),
        };
        std::array::from_fn(|i| offset[i] as f32 + random[i] * self.cells.randomness)
    }

    fn color(&self, offset: [i32; N]) -> [f32; 3] {
        let cell = self.cell(offset);
        let corner = each(self.floor, offset.map(|x| x as f32), |a, b| a + b);
        match (self.cells.hash, N) {
            (CellHash::Lookup3, _) | (_, 1) => hash::color_of_floats(corner),
            (CellHash::Pcg, 2) => hash::of_cell([cell[0], cell[1], 0]),
            (CellHash::Pcg, 3) => hash::of_cell(narrowed::<N, 3>(cell)),
            (CellHash::Pcg, _) => {
                let [x, y, z, _] = hash::of_cell(narrowed::<N, 4>(cell));
                [x, y, z]
            }
        }
    }

    fn found(&self, distance: f32, offset: [i32; N], point: [f32; N]) -> Found<N> {
        Found {
            distance,
            color: self.color(offset),
            position: each(point, self.floor, |point, floor| point + floor),
        }
    }

    /// The nearest point and the second nearest.
    fn nearest(&self) -> [(f32, [i32; N], [f32; N]); 2] {
        let mut found = [(f32::MAX, [0; N], [0.0; N]); 2];
        for offset in around::<N>(1) {
            let point = self.point(offset);
            let distance = self.distance(point, self.at);
            if distance < found[0].0 {
                found = [(distance, offset, point), found[0]];
            } else if distance < found[1].0 {
                found[1] = (distance, offset, point);
            }
        }
        found
    }

    fn smooth(&self) -> Found<N> {
        let mut found = Found::NOTHING;
        let smoothness = self.cells.smoothness;
        for (i, offset) in around::<N>(2).enumerate() {
            let point = self.point(offset);
            let distance = self.distance(point, self.at);
            let h = match i {
                0 => 1.0,
                _ => {
                    let t = (0.5 + 0.5 * (found.distance - distance) / smoothness).clamp(0.0, 1.0);
                    t * t * (3.0 - 2.0 * t)
                }
            };
            let lower = smoothness * h * (1.0 - h);
            found.distance = mix(found.distance, distance, h) - lower;
            let lower = lower / (1.0 + 3.0 * smoothness);
            found.color = each(found.color, self.color(offset), |a, b| mix(a, b, h) - lower);
            found.position = each(found.position, point, |a, b| mix(a, b, h) - lower);
        }
        found.position = each(found.position, self.floor, |point, floor| point + floor);
        found
    }

    fn to_edge(&self) -> f32 {
        let towards = |offset: [i32; N]| each(self.point(offset), self.at, |point, at| point - at);
        if N == 1 {
            let middle = self.point([0; N])[0];
            let edge = |side: i32| (0.5 * (middle + self.point([side; N])[0]) - self.at[0]).abs();
            return edge(-1).min(edge(1));
        }
        let nearest = around::<N>(1).map(towards).fold(([0.0; N], f32::MAX), |best, to| {
            let square = dot(to, to);
            if square < best.1 { (to, square) } else { best }
        });
        let nearest = nearest.0;
        let edges = around::<N>(1).map(towards).filter_map(|to| {
            let across = each(to, nearest, |a, b| a - b);
            let square = dot(across, across);
            let middle = each(to, nearest, |a, b| 0.5 * (a + b));
            (square > 1e-4).then(|| dot(middle, across) / square.sqrt())
        });
        edges.fold(f32::MAX, f32::min)
    }

    fn radius(&self) -> f32 {
        let nearest = around::<N>(1).map(|offset| (offset, self.point(offset))).fold(
            ([0; N], [0.0; N], f32::MAX),
            |best, (offset, point)| {
                let square = square_between(point, self.at);
                if square < best.2 { (offset, point, square) } else { best }
            },
        );
        let (own, point, _) = nearest;
        let others = around::<N>(1).filter(|offset| *offset != [0; N]).map(|offset| {
            let offset = std::array::from_fn(|i| offset[i] + own[i]);
            square_between(point, self.point(offset))
        });
        0.5 * others.fold(f32::MAX, f32::min).sqrt()
    }
}

/// The first M of N numbers; callers have M = N.
fn narrowed<const N: usize, const M: usize>(all: [i32; N]) -> [i32; M] {
    std::array::from_fn(|i| all.get(i).copied().unwrap_or(0))
}

fn widened<const N: usize, const M: usize>(all: [f32; M]) -> [f32; N] {
    std::array::from_fn(|i| all.get(i).copied().unwrap_or(0.0))
}

/// All offsets with components up to `reach`, the first component fastest.
fn around<const N: usize>(reach: i32) -> impl Iterator<Item = [i32; N]> {
    let side = 2 * reach + 1;
    (0..side.pow(N as u32)).map(move |number| {
        let mut rest = number;
        std::array::from_fn(|_| {
            let offset = rest % side - reach;
            rest /= side;
            offset
        })
    })
}

fn octave<const N: usize>(cells: &Cells, p: [f32; N]) -> Found<N> {
    let local = Local::new(cells, p);
    match cells.feature {
        Feature::SmoothF1 if cells.smoothness != 0.0 => local.smooth(),
        Feature::F2 => {
            let [_, (distance, offset, point)] = local.nearest();
            local.found(distance, offset, point)
        }
        _ => {
            let [(distance, offset, point), _] = local.nearest();
            local.found(distance, offset, point)
        }
    }
}

/// Largest possible distance to the nearest point, by the node's definition.
fn farthest<const N: usize>(cells: &Cells) -> f32 {
    let corner = 0.5 + 0.5 * cells.randomness;
    let by_metric = Local::new(cells, [0.0; N]).distance([0.0; N], [corner; N]);
    match cells.feature {
        Feature::DistanceToEdge => corner,
        Feature::F2 => 2.0 * by_metric,
        _ => by_metric,
    }
}

/// The node's result at a point with scaled coordinates.
pub fn texture<const N: usize>(cells: &Cells, p: [f32; N]) -> Found<N> {
    match cells.feature {
        Feature::DistanceToEdge => Found {
            distance: edges(cells, p),
            ..Found::NOTHING
        },
        Feature::NSphereRadius => Found {
            distance: Local::new(cells, p).radius(),
            ..Found::NOTHING
        },
        _ => fractal(cells, p),
    }
}

fn is_single(cells: &Cells) -> bool {
    cells.detail == 0.0 || cells.roughness == 0.0
}

fn fractal<const N: usize>(cells: &Cells, p: [f32; N]) -> Found<N> {
    let (mut amplitude, mut most, mut scale) = (1.0, 0.0, 1.0);
    let mut found = Found::NOTHING;
    if is_single(cells) {
        (found, most) = (octave(cells, p), 1.0);
    } else {
        let whole = cells.detail.floor();
        for i in 0..=cells.detail.ceil() as i32 {
            let share = if i as f32 <= whole { 1.0 } else { cells.detail - whole };
            let next = octave(cells, p.map(|x| x * scale));
            most += amplitude * share;
            found.distance += next.distance * amplitude * share;
            found.color = each(found.color, next.color, |sum, c| sum + c * amplitude * share);
            found.position = each(found.position, next.position, |sum, x| {
                mix(sum, mix(sum, x / scale, amplitude), share)
            });
            scale *= cells.lacunarity;
            amplitude *= cells.roughness;
        }
    }
    if cells.normalize {
        found.distance /= most * farthest::<N>(cells);
        found.color = found.color.map(|c| c / most);
    }
    let by = if cells.scale != 0.0 { 1.0 / cells.scale } else { 0.0 };
    found.position = found.position.map(|x| x * by);
    found
}

fn edges<const N: usize>(cells: &Cells, p: [f32; N]) -> f32 {
    let limit = farthest::<N>(cells);
    let (mut amplitude, mut most, mut scale, mut distance) = (1.0, limit, 1.0, 8.0f32);
    if is_single(cells) {
        distance = Local::new(cells, p).to_edge();
    } else {
        let whole = cells.detail.floor();
        for i in 0..=cells.detail.ceil() as i32 {
            let share = if i as f32 <= whole { 1.0 } else { cells.detail - whole };
            let next = Local::new(cells, p.map(|x| x * scale)).to_edge();
            let blended = mix(distance, distance.min(next / scale), amplitude);
            most = mix(most, mix(most, limit / scale, amplitude), share);
            distance = mix(
                distance,
                if share < 1.0 { distance.min(blended) } else { blended },
                share,
            );
            scale *= cells.lacunarity;
            amplitude *= cells.roughness;
        }
    }
    if cells.normalize { distance / most } else { distance }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(feature: Feature) -> Cells {
        Cells {
            feature,
            metric: Metric::Euclidean,
            normalize: false,
            hash: CellHash::Lookup3,
            detail: 0.0,
            roughness: 0.5,
            lacunarity: 2.0,
            smoothness: 0.25,
            exponent: 0.5,
            randomness: 1.0,
            scale: 1.0,
        }
    }

    #[test]
    fn nothing_random_is_a_lattice() {
        let even = Cells {
            randomness: 0.0,
            ..cells(Feature::F1)
        };
        let found = texture(&even, [2.25, -0.75, 7.0]);
        assert_eq!(found.position, [2.0, -1.0, 7.0]);
        assert!((found.distance - (2.0f32 * 0.0625).sqrt()).abs() < 1e-6);
        let edge = texture(
            &Cells {
                randomness: 0.0,
                ..cells(Feature::DistanceToEdge)
            },
            [2.25, -0.8],
        );
        assert!((edge.distance - 0.25).abs() < 1e-6, "{}", edge.distance);
    }

    #[test]
    fn features_agree_with_one_another() {
        for i in 0..500 {
            let p = [i as f32 * 0.754_87, i as f32 * 0.569_84, 4.0 - i as f32 * 0.331];
            let [first, second, smooth, edge] =
                [Feature::F1, Feature::F2, Feature::SmoothF1, Feature::DistanceToEdge].map(|f| texture(&cells(f), p));
            assert!(first.distance <= second.distance);
            assert!(smooth.distance <= first.distance + 1e-6);
            // The border is halfway between both points: no farther than half of the detour.
            assert!(edge.distance <= 0.5 * (second.distance + first.distance) + 1e-5);
            let there = texture(&cells(Feature::F1), first.position);
            assert!(there.distance < 1e-3, "{}", there.distance);
        }
    }
}
