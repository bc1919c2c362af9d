//! Polygons with more than three corners. They are fans about their first corner, unless a triangle of the fan would
//! lie outside the polygon.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The most faces of a run, which one thread processes.
const LONGEST_RUN: usize = 1 << 12;

/// The most corners of a polygon that is re-cut.
const MOST_CORNERS: usize = 1 << 13;

/// The share of a polygon's area that may be flipped: less is rounding, where corners lie on an edge.
const ROUNDING: f64 = 1e-6;

/// Consecutive faces with the same number of triangles, at least two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Its first triangle.
    first: usize,
    /// Triangles per face.
    each: usize,
    faces: usize,
}

/// Where polygons are in a list of triangles.
#[derive(Default)]
pub struct Runs(pub Vec<Run>);

impl Runs {
    /// Record a face of `triangles` triangles that begins at `first`.
    #[inline]
    pub fn add(&mut self, first: usize, triangles: usize) {
        if triangles < 2 {
            return;
        }
        match self.0.last_mut() {
            Some(run)
                if run.each == triangles
                    && run.first + run.each * run.faces == first
                    && run.faces < LONGEST_RUN.div_ceil(triangles) =>
            {
                run.faces += 1;
            }
            _ => self.0.push(Run {
                first,
                each: triangles,
                faces: 1,
            }),
        }
    }

    /// Append the runs of a part of the file, before which there are `before` triangles.
    pub fn extend(&mut self, runs: &[Run], before: usize) {
        let moved = runs.iter().map(|run| Run {
            first: run.first + before,
            ..*run
        });
        self.0.extend(moved);
    }
}

/// A polygon that is not a fan about its first corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Its first triangle.
    pub first: usize,
    /// The vertices around it, two more than its triangles.
    pub ring: Vec<u32>,
}

impl Cut {
    /// Restore the original fan.
    pub fn undo(&self, triangles: &mut [[u32; 3]]) {
        let own = triangles.iter_mut().skip(self.first);
        for (triangle, pair) in own.zip(self.ring[1..].windows(2)) {
            *triangle = [self.ring[0], pair[0], pair[1]];
        }
    }
}

/// Re-cut polygons whose fan has a triangle outside. Each keeps its edges, its number of triangles and its winding;
/// self-crossing ones stay fans if no cut is better.
pub fn cut(positions: &[DVec3], triangles: &mut [[u32; 3]], runs: &Runs) -> Vec<Cut> {
    let of_run = |run: &Run| {
        let faces = triangles[run.first..].chunks_exact(run.each).take(run.faces);
        let numbered = faces.enumerate();
        let cuts = numbered.filter_map(|(i, fan)| Some((run.first + i * run.each, inside(positions, fan)?)));
        cuts.collect::<Vec<_>>()
    };
    let found: Vec<_> = runs.0.par_iter().flat_map_iter(of_run).collect();
    let mut cuts = Vec::with_capacity(found.len());
    for (first, better) in found {
        let own = &mut triangles[first..first + better.len()];
        let ring = ring(own);
        for (triangle, corners) in own.iter_mut().zip(better) {
            *triangle = corners.map(|corner| ring[corner]);
        }
        cuts.push(Cut { first, ring });
    }
    cuts
}

/// The vertices around a fan.
fn ring(fan: &[[u32; 3]]) -> Vec<u32> {
    let start = fan.first().map_or(&[][..], |t| &t[..2]);
    start.iter().copied().chain(fan.iter().map(|t| t[2])).collect()
}

/// Twice the area of a triangle, along its normal.
fn doubled([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// The polygon's normal, if a triangle of its fan lies outside.
fn outside(positions: &[DVec3], fan: &[[u32; 3]]) -> Option<DVec3> {
    let at = |v: u32| positions.get(v as usize).copied().unwrap_or(DVec3::NAN);
    let normals = || fan.iter().map(|t| doubled(t.map(at)));
    let normal: DVec3 = normals().sum();
    let along = normal.length_squared();
    // Polygons without a normal, or with NaN, cannot be judged.
    let turned: f64 = normals().map(|n| n.dot(normal).min(0.0)).sum();
    (along.is_finite() && along > 0.0 && turned < -ROUNDING * along).then_some(normal)
}

/// Refuse polygons that would take too long to cut: the time grows with the square of their corners.
pub fn check(positions: &[DVec3], triangles: &[[u32; 3]], runs: &Runs) -> Result<(), String> {
    for run in runs.0.iter().filter(|run| run.each + 2 > MOST_CORNERS) {
        let mut faces = triangles[run.first..].chunks_exact(run.each).take(run.faces);
        if faces.any(|fan| outside(positions, fan).is_some()) {
            let corners = run.each + 2;
            return Err(format!(
                "a face of {corners} corners is not convex; expected at most {MOST_CORNERS}, or triangles"
            ));
        }
    }
    Ok(())
}

/// The polygon's triangles by corner number, if its fan's do not all lie inside.
fn inside(positions: &[DVec3], fan: &[[u32; 3]]) -> Option<Vec<[usize; 3]>> {
    let at = |v: u32| positions.get(v as usize).copied().unwrap_or(DVec3::NAN);
    let normal = outside(positions, fan)?;
    let corners: Vec<DVec3> = ring(fan).into_iter().map(at).collect();
    let area = |triangles: &[[usize; 3]]| -> f64 {
        let along = |t: &[usize; 3]| doubled(t.map(|i| corners[i])).dot(normal).abs();
        triangles.iter().map(along).sum()
    };
    let better = match corners.len() {
        4 => vec![[0, 1, 3], [1, 2, 3]],
        _ => ears(&flat(&corners, normal)?)?,
    };
    // The triangles of a polygon that does not cross itself have the least possible area.
    let plain: Vec<[usize; 3]> = (2..corners.len()).map(|i| [0, i - 1, i]).collect();
    (area(&better) < area(&plain)).then_some(better)
}

/// Corners projected along the normal, relative to the first, scaled to distances of at most 1.
fn flat(corners: &[DVec3], normal: DVec3) -> Option<Vec<DVec2>> {
    let (x, y) = normal.try_normalize()?.any_orthonormal_pair();
    let from_first = |p: &DVec3| DVec2::new((*p - corners[0]).dot(x), (*p - corners[0]).dot(y));
    let flat: Vec<DVec2> = corners.iter().map(from_first).collect();
    let size = flat.iter().fold(0.0, |size: f64, p| size.max(p.abs().max_element()));
    (size.is_finite() && size > 0.0).then(|| flat.iter().map(|p| *p / size).collect())
}

/// Ear clipping; each edge of the polygon belongs to exactly one triangle.
fn ears(corners: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let numbers: Vec<f64> = corners.iter().flat_map(|p| p.to_array()).collect();
    let found = earcutr::earcut(&numbers, &[], 2).ok()?;
    let mut triangles: Vec<[usize; 3]> = found.as_chunks().0.to_vec();
    // Triangles that wind like the polygon have their corners in ascending order.
    triangles.iter_mut().for_each(|t| t.sort_unstable());
    // Ear clipping drops corners in the middle of an edge, which would open the mesh there without slivers.
    let slivers = slivers(corners.len(), &triangles);
    triangles.extend(slivers);
    let is_whole = triangles.len() + 2 == corners.len() && open_edges(corners.len(), &triangles).is_empty();
    is_whole.then_some(triangles)
}

/// Directed edges of triangles, by start and end, that no other triangle and no edge of the polygon of `count` corners
/// matches, with their number.
fn open_edges(count: usize, triangles: &[[usize; 3]]) -> BTreeMap<(usize, usize), i32> {
    let inner = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let outer = (0..count).map(|from| ((from + 1) % count, from));
    let mut sums: BTreeMap<(usize, usize), i32> = BTreeMap::new();
    for (from, to) in inner.chain(outer) {
        let way = if from < to { 1 } else { -1 };
        *sums.entry((from.min(to), from.max(to))).or_default() += way;
    }
    let open = sums.into_iter().filter(|(_, sum)| *sum != 0);
    let directed = open.map(|((low, high), sum)| match sum {
        1.. => ((low, high), sum),
        _ => ((high, low), -sum),
    });
    directed.collect()
}

/// Triangles that close the open edges.
fn slivers(count: usize, triangles: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut open = open_edges(count, triangles);
    let mut slivers = Vec::new();
    // At each corner as many open edges end as start, so they form loops.
    while let Some((&(start, _), _)) = open.first_key_value() {
        let mut way = vec![start];
        let mut at = start;
        while let Some((&(from, to), _)) = open.range((at, 0)..(at + 1, 0)).next() {
            match open.get_mut(&(from, to)) {
                Some(left) if *left > 1 => *left -= 1,
                _ => drop(open.remove(&(from, to))),
            }
            at = to;
            if at == start {
                break;
            }
            way.push(at);
        }
        slivers.extend((2..way.len()).map(|i| [start, way[i], way[i - 1]]));
    }
    slivers
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_render::sampler::{Purpose, Sampler};
    use glam::DMat3;
    use std::f64::consts::TAU;

    /// A zigzag with that many corners.
    fn comb(corners: usize) -> Vec<DVec3> {
        let below = (0..corners - 2).map(|i| DVec3::new(i as f64, (i % 2 * 5) as f64, 0.0));
        let top = [corners as f64, -1.0].map(|x| DVec3::new(x, 9.0, 0.0));
        below.chain(top).collect()
    }

    /// Polygons that would take too long are an error; convex ones with as many corners are not.
    #[test]
    fn large_polygons_are_cut_or_refused() {
        let circle = |corners: usize| -> Vec<DVec3> {
            let at = |i: usize| TAU * i as f64 / corners as f64;
            (0..corners)
                .map(|i| DVec3::new(libm::cos(at(i)), libm::sin(at(i)), 0.0))
                .collect()
        };
        let checked = |positions: &[DVec3]| {
            let triangles: Vec<[u32; 3]> = (2..positions.len() as u32).map(|i| [0, i - 1, i]).collect();
            let mut runs = Runs::default();
            runs.add(0, triangles.len());
            let fine = check(positions, &triangles, &runs);
            (
                fine.is_ok() && !cut(positions, &mut triangles.clone(), &runs).is_empty(),
                fine,
            )
        };
        assert_eq!(checked(&comb(MOST_CORNERS)), (true, Ok(())));
        assert_eq!(checked(&circle(1_000_000)), (false, Ok(())));
        for corners in [MOST_CORNERS + 1, 1_000_000] {
            let error = checked(&comb(corners)).1.unwrap_err();
            assert!(
                error.starts_with(&format!("a face of {corners} corners is not convex")),
                "{error}"
            );
        }
    }

    /// The polygons of a mesh, as fans and re-cut.
    fn both(positions: &[DVec3], faces: &[Vec<u32>]) -> (Vec<[u32; 3]>, Vec<[u32; 3]>, Vec<Cut>) {
        let (mut fans, mut runs) = (Vec::new(), Runs::default());
        for face in faces {
            runs.add(fans.len(), face.len().saturating_sub(2));
            fans.extend((2..face.len()).map(|i| [face[0], face[i - 1], face[i]]));
        }
        let mut triangles = fans.clone();
        let cuts = cut(positions, &mut triangles, &runs);
        (fans, triangles, cuts)
    }

    fn one(positions: &[DVec3]) -> Vec<[u32; 3]> {
        both(positions, &[(0..positions.len() as u32).collect()]).1
    }

    /// The sum of the triangles' areas, and of the areas of those that wind like the normal.
    fn areas(positions: &[DVec3], triangles: &[[u32; 3]], normal: DVec3) -> [f64; 2] {
        let doubled = triangles.iter().map(|t| doubled(t.map(|v| positions[v as usize])));
        doubled.fold([0.0; 2], |[all, right], n| {
            [all + 0.5 * n.length(), right + 0.5 * n.dot(normal).max(0.0)]
        })
    }

    fn shoelace(corners: &[DVec2]) -> f64 {
        let next = |i: usize| corners[(i + 1) % corners.len()];
        let sum: f64 = corners.iter().enumerate().map(|(i, p)| p.perp_dot(next(i))).sum();
        0.5 * sum
    }

    /// A polygon that does not cross itself: around a point, a comb or stairs, some with corners in the middle of
    /// edges.
    fn simple(unit: &mut impl FnMut() -> f64) -> Vec<DVec2> {
        let count = 4 + (unit() * 20.0) as usize;
        let mut corners: Vec<DVec2> = Vec::new();
        match (unit() * 3.0) as u32 {
            0 => {
                for i in 0..count {
                    let angle = TAU * (i as f64 + 0.9 * unit()) / count as f64;
                    corners.push(DVec2::from_angle(angle) * (0.05 + unit()));
                }
            }
            1 => {
                // A comb with teeth of all lengths.
                corners.extend([DVec2::ZERO, DVec2::new(2.0 * count as f64, 0.0)]);
                for i in (0..count).rev() {
                    let (x, height) = (2.0 * i as f64, 1.0 + (4.0 * unit()).round());
                    let tooth = [(2.0, 1.0), (1.5, height), (0.5, height), (0.0, 1.0)];
                    corners.extend(tooth.map(|(dx, y)| DVec2::new(x + dx, y)));
                }
            }
            _ => {
                // Stairs going up, and back down below.
                let up = (0..count).flat_map(|i| [(i, i), (i, i + 1)]);
                let down = (0..count).rev().flat_map(|i| [(i + 2, i + 1), (i + 2, i)]);
                corners.extend(up.chain(down).map(|(x, y)| DVec2::new(x as f64, y as f64)));
                corners.dedup();
            }
        }
        if unit() < 0.5 {
            let ends: Vec<DVec2> = corners[1..].iter().chain(&corners[..1]).copied().collect();
            let halves = corners.iter().zip(ends).flat_map(|(a, b)| [*a, 0.5 * (*a + b)]);
            corners = halves.collect();
        }
        if unit() < 0.5 {
            corners.reverse();
        }
        let start = (unit() * corners.len() as f64) as usize % corners.len();
        corners.rotate_left(start);
        corners
    }

    /// In any plane, at any size, with either winding and from any corner: the triangles have the area of the shoelace
    /// formula, the polygon's normal, and its edges.
    #[test]
    fn triangles_fill_polygons() {
        let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
        let mut unit = || f64::from(sampler.next_u32()) / 4294967296.0;
        let mut concave = 0;
        for case in 0..5000 {
            let flat = simple(&mut unit);
            let size = libm::exp(20.0 * unit() - 10.0);
            let axis = DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5).normalize_or(DVec3::Z);
            let turn = DMat3::from_axis_angle(axis, TAU * unit());
            let place = size * DVec3::new(unit(), unit(), unit());
            let positions: Vec<DVec3> = flat.iter().map(|p| turn * p.extend(0.0) * size + place).collect();
            let area = shoelace(&flat) * size * size;
            let ring: Vec<u32> = (0..flat.len() as u32).collect();
            let (fans, triangles, cuts) = both(&positions, &[ring]);
            concave += cuts.len();
            let [all, right] = areas(&positions, &triangles, turn * DVec3::Z * area.signum());
            assert!(
                (all / area.abs() - 1.0).abs() < 1e-6,
                "{case}: {all} for {area}, {flat:?}"
            );
            assert!((right / area.abs() - 1.0).abs() < 1e-6, "{case}");
            let numbers: Vec<[usize; 3]> = triangles.iter().map(|t| t.map(|v| v as usize)).collect();
            assert_eq!(triangles.len() + 2, flat.len());
            assert!(open_edges(flat.len(), &numbers).is_empty(), "{case}");
            let mut undone = triangles;
            cuts.iter().for_each(|cut| cut.undo(&mut undone));
            assert_eq!(undone, fans);
        }
        assert!(concave > 3000, "{concave}");
    }

    /// The reflex corner can be any of the four.
    #[test]
    fn concave_quads_have_the_inner_diagonal() {
        let dart = [(0.0, 0.0), (2.0, -1.0), (0.5, 0.0), (2.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 3.0));
        for (start, expected) in [
            (0, [[0, 1, 2], [0, 2, 3]]),
            (1, [[0, 1, 3], [1, 2, 3]]),
            (2, [[0, 1, 2], [0, 2, 3]]),
            (3, [[0, 1, 3], [1, 2, 3]]),
        ] {
            let mut corners = dart;
            corners.rotate_left(start);
            assert_eq!(one(&corners), expected, "{start}");
            corners.reverse();
            let area: f64 = areas(&corners, &one(&corners), -DVec3::Z)[1];
            assert!((area - 0.5).abs() < 1e-15, "{area}");
        }
    }

    /// Convex ones, also if rounding moves corners on edges inwards, or if they are folded out of their plane.
    #[test]
    fn other_polygons_stay_fans() {
        let mut sampler = Sampler::new(3, 1, Purpose::Test, 0);
        let mut unit = || f64::from(sampler.next_u32()) / 4294967296.0;
        for _ in 0..2000 {
            let count = 4 + (unit() * 12.0) as usize;
            let tilt = 0.3 * unit();
            let mut positions = Vec::new();
            for i in 0..count {
                let angle = TAU * i as f64 / count as f64;
                let place = DVec2::from_angle(angle);
                positions.push(place.extend(tilt * libm::cos(2.0 * angle)));
                let next = DVec2::from_angle(TAU * (i + 1) as f64 / count as f64);
                if tilt < 0.1 {
                    let between = (0.5 * (place + next)).as_vec2().as_dvec2();
                    positions.push(between.extend(tilt * libm::cos(2.0 * angle)));
                }
            }
            let ring: Vec<u32> = (0..positions.len() as u32).collect();
            let (fans, triangles, cuts) = both(&positions, &[ring]);
            assert!(cuts.is_empty() && fans == triangles);
        }
    }

    /// Non-planar corners: a saddle of eight with a notch, measured by its projection along the normal.
    #[test]
    fn polygons_may_be_bent() {
        let outline = [
            (-1.0, -1.0),
            (1.0, -1.0),
            (1.0, 1.0),
            (0.2, 1.0),
            (0.2, -0.5),
            (-0.2, -0.5),
            (-0.2, 1.0),
            (-1.0, 1.0),
        ];
        let positions = outline.map(|(x, y)| DVec3::new(x, y, 0.2 * x * y));
        let triangles = one(&positions);
        let [_, right] = areas(&positions, &triangles, DVec3::Z);
        assert!((right - 3.4).abs() < 1e-12, "{right}");
        let fronts = triangles.iter().map(|t| doubled(t.map(|v| positions[v as usize])).z);
        assert!(fronts.into_iter().all(|z| z >= 0.0));
    }

    /// Any corners: crossing, coincident, collinear, huge, tiny, missing, NaN.
    #[test]
    fn anything_is_cut_the_same_way_each_time() {
        let mut sampler = Sampler::new(3, 2, Purpose::Test, 0);
        let mut below = |n: u32| sampler.next_u32() % n;
        for _ in 0..20_000 {
            let scale = [1.0, 1e-300, 1e-160, 1e150, 1e300, 1e-20][below(6) as usize];
            let special = [f64::NAN, f64::INFINITY, 0.0, -0.0, 1e308, 5e-324];
            let positions: Vec<DVec3> = (0..4 + below(12))
                .map(|_| {
                    let mut number = || match below(40) {
                        0 => special[below(6) as usize],
                        k => f64::from(k % 5) * scale,
                    };
                    DVec3::new(number(), number(), number())
                })
                .collect();
            let face: Vec<u32> = positions.iter().map(|_| below(positions.len() as u32 + 1)).collect();
            let rings = [(0..positions.len() as u32).collect(), face];
            let (fans, triangles, _) = both(&positions, &rings);
            assert_eq!(fans.len(), triangles.len());
            assert_eq!(both(&positions, &rings).1, triangles);
        }
    }

    #[test]
    fn runs_are_of_one_kind() {
        let mut runs = Runs::default();
        let mut first = 0;
        for triangles in [1, 2, 2, 1, 2, 5, 5, 0, 5] {
            runs.add(first, triangles);
            first += triangles;
        }
        let found: Vec<_> = runs.0.iter().map(|run| (run.first, run.each, run.faces)).collect();
        assert_eq!(found, [(1, 2, 2), (6, 2, 1), (8, 5, 3)]);
    }
}
