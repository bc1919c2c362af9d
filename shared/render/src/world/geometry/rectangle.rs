//! Rectangles seen from a point, sampled uniformly over their solid angle.
//!
//! After Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles". The corner angles
//! of the spherical rectangle are stored as unit complex numbers, so that the solid angle, from their product, takes a
//! single arc tangent.

use crate::math::{PI, Vec2, Vec3, atan2, sin_cos};

/// Sides of the two triangles count as equal and perpendicular within this share of their lengths.
const TOLERANCE: f32 = 1e-5;
/// Below this solid angle points are drawn by area: that is nearly as uniform, and the corner angles of small
/// rectangles keep few digits, 3e-5 of the solid angle here.
const LEAST: f32 = 0.03;

/// Two triangles that are a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    /// A corner.
    pub corner: Vec3,
    /// Unit vectors from there along the sides.
    pub along: [Vec3; 2],
    /// Lengths of the sides.
    pub sides: Vec2,
    /// The rectangle's vertex at each triangle corner: 0 is `corner`, 1 and 2 are its neighbours along the two sides, 3
    /// is opposite.
    corners: [[u8; 3]; 2],
    normal: Vec3,
}

impl Rectangle {
    /// The rectangle that two triangles form, given a unit normal.
    pub fn of([first, second]: [[Vec3; 3]; 2], normal: Vec3) -> Option<Self> {
        // The one corner of the first triangle that the second lacks, and the other way round.
        let alone = |own: &[Vec3; 3], other: &[Vec3; 3]| {
            let mut alone = (0..3).filter(|i| !other.contains(&own[*i]));
            alone.next().filter(|_| alone.next().is_none())
        };
        let (own, opposite) = (alone(&first, &second)?, alone(&second, &first)?);
        let (corner, next, last) = (first[own], first[(own + 1) % 3], first[(own + 2) % 3]);
        let (far, far_next) = (second[opposite], second[(opposite + 1) % 3]);
        let sides = [next - corner, last - corner];
        let lengths = Vec2::new(sides[0].length(), sides[1].length());
        let tolerance = TOLERANCE * lengths.max_element();
        let along = sides.map(Vec3::normalize_or_zero);
        let is_one = far_next == last
            && (corner + sides[0] + sides[1] - far).abs().max_element() <= tolerance
            && along[0].dot(along[1]).abs() <= TOLERANCE
            && lengths.min_element() > 0.0
            && lengths.max_element() < f32::INFINITY;
        let mut corners = [[0; 3]; 2];
        for (place, number) in [0, 1, 2].into_iter().enumerate() {
            corners[0][(own + place) % 3] = number;
        }
        for (place, number) in [3, 2, 1].into_iter().enumerate() {
            corners[1][(opposite + place) % 3] = number;
        }
        is_one.then_some(Self {
            corner,
            along,
            sides: lengths,
            corners,
            normal,
        })
    }

    /// The rectangle as seen from a point; `None` if it is so small that drawing by area is better.
    #[inline]
    pub fn seen_from(&self, from: Vec3) -> Option<SphericalRectangle> {
        let offset = self.corner - from;
        let low = Vec2::new(offset.dot(self.along[0]), offset.dot(self.along[1]));
        let high = low + self.sides;
        let depth = offset.dot(self.normal).abs();
        let (low2, high2, depth2) = (low * low, high * high, depth * depth);
        let reach = |x2: f32| (x2 + depth2).sqrt();
        let (x, y) = ([reach(low2.x), reach(high2.x)], [reach(low2.y), reach(high2.y)]);
        // cos + i sin of the angle at a corner.
        let angle =
            |product: f32, x2: f32, y2: f32, scale: f32| Vec2::new(product, depth * (x2 + y2 + depth2).sqrt()) / scale;
        let near = times(
            angle(low.y * high.x, high2.x, low2.y, x[1] * y[0]),
            angle(-high.x * high.y, high2.x, high2.y, x[1] * y[1]),
        );
        let far = times(
            angle(low.x * high.y, low2.x, high2.y, x[0] * y[1]),
            angle(-low.x * low.y, low2.x, low2.y, x[0] * y[0]),
        );
        let all = times(near, far);
        let excess = atan2(all.y, all.x);
        let solid_angle = if excess < 0.0 { excess + 2.0 * PI } else { excess };
        // NaN where the point lies on an edge.
        (solid_angle > LEAST).then(|| SphericalRectangle {
            solid_angle,
            low,
            high,
            depth,
            start: Vec2::new(far.x, -far.y),
            slopes: Vec2::new(-low.y / y[0], high.y / y[1]),
        })
    }

    /// The point for a pair of uniform numbers, uniform over the visible solid angle.
    pub fn sample(&self, seen: &SphericalRectangle, u: Vec2) -> RectanglePoint {
        let at = (seen.place(u) - seen.low).clamp(Vec2::ZERO, self.sides);
        let part = at / self.sides;
        let triangle = u32::from(part.x + part.y > 1.0);
        let of_corners = match triangle {
            0 => [1.0 - part.x - part.y, part.x, part.y, 0.0],
            _ => [0.0, 1.0 - part.y, 1.0 - part.x, part.x + part.y - 1.0],
        };
        let [_, second, third] = self.corners[triangle as usize].map(|corner| of_corners[usize::from(corner)]);
        RectanglePoint {
            point: self.corner + self.along[0] * at.x + self.along[1] * at.y,
            normal: self.normal,
            triangle,
            weights: Vec2::new(second, third),
        }
    }
}

/// A point on a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct RectanglePoint {
    /// The point.
    pub point: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// The triangle of the two that it is in.
    pub triangle: u32,
    /// Weights of that triangle's second and third corner.
    pub weights: Vec2,
}

/// A rectangle on the unit sphere around a point; its axes run along the rectangle's sides.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    /// In steradians, positive.
    pub solid_angle: f32,
    /// Lower corner along the sides, relative to the point.
    low: Vec2,
    high: Vec2,
    /// Distance of the rectangle's plane.
    depth: f32,
    /// cos + i sin of the angle at which the solid angle to the left is zero.
    start: Vec2,
    /// Sines of the angles of the planes through the point and two opposite sides.
    slopes: Vec2,
}

impl SphericalRectangle {
    /// Coordinates along the sides, from the point.
    #[inline]
    fn place(&self, u: Vec2) -> Vec2 {
        let (sin, cos) = sin_cos(u.x * self.solid_angle);
        let Vec2 { x: cos, y: sin } = times(Vec2::new(cos, sin), self.start);
        let rise = cos * self.slopes.x - self.slopes.y;
        let run = self.slopes.x * sin;
        // Sine of the angle from the plane across the first side.
        let size = sin.abs() / (rise * rise + run * run).sqrt().max(f32::MIN_POSITIVE);
        let tilt = if sin * rise < 0.0 {
            -size.min(1.0)
        } else {
            size.min(1.0)
        };
        let x = self.depth * tilt / (1.0 - tilt * tilt).sqrt().max(f32::MIN_POSITIVE);
        let x = x.clamp(self.low.x, self.high.x);
        let across2 = x * x + self.depth * self.depth;
        let sine = |y: f32| y / (across2 + y * y).sqrt();
        let (first, last) = (sine(self.low.y), sine(self.high.y));
        let sine = first + u.y * (last - first);
        let y = sine * across2.sqrt() / (1.0 - sine * sine).sqrt().max(f32::MIN_POSITIVE);
        Vec2::new(x, y.clamp(self.low.y, self.high.y))
    }
}

/// Product of complex numbers.
#[inline]
fn times(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Frame;
    use crate::sampler::{Purpose, Sampler};
    use crate::world::geometry::Mesh;

    /// A rectangle of 3 x 2 somewhere, its frame, and its mesh with rotated triangle corners.
    fn rectangle(turns: [usize; 2]) -> (Rectangle, Frame, Mesh) {
        let frame = Frame::from_normal(Vec3::new(0.36, -0.48, 0.8));
        let corner = Vec3::new(1.0, -2.0, 0.5);
        let at = |x: f32, y: f32| corner + frame.s * x + frame.t * y;
        let mut triangles = [[0, 1, 2], [0, 2, 3]];
        for (triangle, turn) in triangles.iter_mut().zip(turns) {
            triangle.rotate_left(turn);
        }
        let mesh = Mesh {
            positions: vec![at(0.0, 0.0), at(3.0, 0.0), at(3.0, 2.0), at(0.0, 2.0)],
            triangles: triangles.to_vec(),
            ..Mesh::default()
        };
        (*mesh.rectangle().expect("it is one"), frame, mesh)
    }

    /// Viewpoints, in the rectangle's axes: in front, behind, to the side, close to the middle, to an edge and to a
    /// corner, nearly in its plane, and so far away that it is negligible.
    const FROM: [[f32; 3]; 8] = [
        [1.5, 1.0, 2.0],
        [0.2, 1.7, -1.0],
        [-1.0, 3.0, 0.7],
        [1.4, 1.1, 1e-3],
        [3.0, 0.9, 0.05],
        [0.01, 0.01, 0.02],
        [3.5, 1.0, 0.2],
        [9.0, 9.0, 30.0],
    ];

    /// Solid angle of the part of the plane z = 0 between two corners, from a point: the sum over its corners of atan(x
    /// y / (z r)), a method that the code itself does not use.
    fn solid_angle(low: [f64; 2], high: [f64; 2], from: [f64; 3]) -> f64 {
        let z = from[2].abs();
        let part = |x: f64, y: f64| {
            let (x, y) = (x - from[0], y - from[1]);
            libm::atan2(x * y, z * (x * x + y * y + z * z).sqrt())
        };
        part(high[0], high[1]) - part(low[0], high[1]) - part(high[0], low[1]) + part(low[0], low[1])
    }

    #[test]
    fn solid_angles_are_those_of_the_closed_form() {
        let (rectangle, frame, _) = rectangle([0, 0]);
        for from in FROM {
            let exact = solid_angle([0.0; 2], [3.0, 2.0], from.map(f64::from));
            let point = Vec3::new(1.0, -2.0, 0.5) + frame.to_world(Vec3::from(from));
            match rectangle.seen_from(point) {
                Some(seen) => assert!(
                    (f64::from(seen.solid_angle) / exact - 1.0).abs() < 1e-4,
                    "{from:?}: {exact}"
                ),
                None => assert!(exact < 1.01 * f64::from(LEAST), "{from:?}: {exact}"),
            }
        }
    }

    /// Chi-square test of counts in 8 x 8 cells against the cells' solid angles. Each statistic has at most 63 degrees
    /// of freedom and exceeds the bound of five standard deviations with a probability of 2e-5.
    #[test]
    fn points_are_even_over_the_solid_angle() {
        const N: usize = 200_000;
        let (rectangle, frame, mesh) = rectangle([1, 2]);
        for from in FROM {
            let point = Vec3::new(1.0, -2.0, 0.5) + frame.to_world(Vec3::from(from));
            let Some(seen) = rectangle.seen_from(point) else {
                continue;
            };
            let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
            let mut counts = [[0u32; 8]; 8];
            for _ in 0..N {
                let at = rectangle.sample(&seen, sampler.next_2d());
                let [a, b, c] = mesh.corners(at.triangle);
                let again = a + (b - a) * at.weights.x + (c - a) * at.weights.y;
                assert!(at.weights.min_element() >= -1e-6 && at.weights.element_sum() <= 1.0 + 1e-6);
                assert!((again - at.point).length() < 1e-5, "{from:?}: {again} for {}", at.point);
                let own = frame.to_local(at.point - Vec3::new(1.0, -2.0, 0.5));
                let cell = |share: f32| ((share * 8.0) as usize).min(7);
                counts[cell(own.x / 3.0)][cell(own.y / 2.0)] += 1;
            }
            let whole = solid_angle([0.0; 2], [3.0, 2.0], from.map(f64::from));
            let (mut statistic, mut cells) = (0.0, 0.0);
            for (i, row) in counts.iter().enumerate() {
                for (j, count) in row.iter().enumerate() {
                    let low = [i as f64 * 0.375, j as f64 * 0.25];
                    let share = solid_angle(low, [low[0] + 0.375, low[1] + 0.25], from.map(f64::from)) / whole;
                    let expected = share * N as f64;
                    // With fewer, chi-square does not apply.
                    if expected >= 5.0 {
                        statistic += (f64::from(*count) - expected) * (f64::from(*count) - expected) / expected;
                        cells += 1.0;
                    }
                }
            }
            let freedom: f64 = cells - 1.0;
            assert!(
                statistic < freedom + 5.0 * (2.0 * freedom).sqrt(),
                "{from:?}: {statistic} of {freedom}"
            );
        }
    }

    #[test]
    fn what_is_no_rectangle_is_told() {
        let (_, _, mesh) = rectangle([2, 1]);
        let of = |positions: Vec<Vec3>, triangles: &[[u32; 3]]| {
            let triangles = triangles.to_vec();
            Mesh {
                positions,
                triangles,
                ..Mesh::default()
            }
            .rectangle()
            .copied()
        };
        let whole = &mesh.triangles;
        let moved = |by: Vec3| {
            let mut positions = mesh.positions.clone();
            positions[2] += by;
            positions
        };
        assert!(of(mesh.positions.clone(), whole).is_some());
        assert!(of(moved(Vec3::X * 0.01), whole).is_none(), "a trapezium");
        assert!(of(mesh.positions.clone(), &whole[..1]).is_none(), "a triangle");
        assert!(
            of(mesh.positions.clone(), &[[0, 1, 2], [0, 3, 2]]).is_none(),
            "triangles that face each other"
        );
        assert!(
            of(mesh.positions.clone(), &[[0, 1, 2], [2, 0, 1]]).is_none(),
            "the same triangle twice"
        );
        let sheared = mesh.positions.iter().map(|p| *p + Vec3::Y * (0.1 * p.x)).collect();
        assert!(of(sheared, whole).is_none(), "a parallelogram");
        assert!(of(vec![Vec3::ZERO; 4], whole).is_none(), "a point");
        let apart = [0, 1, 2, 0, 2, 3].map(|i| mesh.positions[i]).to_vec();
        assert!(of(apart, &[[0, 1, 2], [3, 4, 5]]).is_some(), "vertices of their own");
    }
}
