//! The walls that cross the kernel of a photon on a surface.

use super::{Plane, stand_between};
use crate::cpu::photon_map::{Crossing, SurfacePhoton};
use crate::math::Vec3;
use crate::wide::Around;
use crate::world::Scene;
use crate::world::geometry;

/// The walls that cross the kernel of a photon on a surface, looked for in a disc at `height` above it. `n`: upward
/// unit normal of the surface and the disc.
pub fn crossing(scene: &Scene, point: Vec3, n: Vec3, radius: f32, height: f32) -> Crossing {
    let middle = point + n * height;
    let at = n.dot(middle);
    let around = Around {
        origin: middle,
        dir: n,
        length: 0.0,
        radius,
        planes: [n.extend(at).to_array(), (-n).extend(-at).to_array()],
    };
    let mut lines: Vec<[Vec3; 2]> = Vec::new();
    let mut round = false;
    (scene.geometry).near(scene.objects(), &scene.walls, &around, &mut |found| match found {
        geometry::Near::Triangle(_, corners) => {
            if let Some(line) = line_in_disc(corners.map(|p| p - middle), n, radius)
                && !is_outer(scene, corners, middle)
            {
                lines.push(line);
            }
        }
        geometry::Near::Other(object) => {
            let shape = &scene.objects()[object as usize].shape;
            let reaches = |n: Vec3| shape.reach(n).is_none_or(|reach| reach >= n.dot(middle));
            round |= reaches(n) && reaches(-n);
        }
    });
    match (round, lines.is_empty()) {
        (true, _) => Crossing {
            height,
            beyond: Vec3::NAN,
        },
        (false, true) => Crossing::NONE,
        (false, false) => Crossing {
            height,
            beyond: beyond(&lines),
        },
    }
}

/// A vector whose product with any point of the lines is at least one; not a number if the lines lie on all sides.
fn beyond(lines: &[[Vec3; 2]]) -> Vec3 {
    let nearest = |[p, q]: &[Vec3; 2]| {
        let way = *q - *p;
        let t = (-p.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        // Not a number where both points coincide.
        if t.is_nan() { *p } else { *p + way * t }
    };
    let nearest = lines.iter().map(nearest);
    let nearest = nearest.min_by(|p, q| p.length_squared().total_cmp(&q.length_squared()));
    let n = nearest.unwrap_or(Vec3::NAN).normalize_or_zero();
    let distance = lines.iter().flatten().map(|p| p.dot(n)).fold(f32::INFINITY, f32::min);
    match distance > 0.0 && lines.iter().flatten().all(|p| p.is_finite()) {
        // A little less, for rounding.
        true => n / (0.999 * distance),
        false => Vec3::NAN,
    }
}

/// Whether the whole scene lies on the same side of a triangle as a point. Such a triangle stands between no two
/// surfaces.
fn is_outer(scene: &Scene, [a, b, c]: [Vec3; 3], point: Vec3) -> bool {
    let n = (b - a).cross(c - a).normalize_or_zero();
    let n = n * n.dot(point - a).signum();
    let plane = Plane {
        n,
        at: n.dot(a),
        ..Plane::CROWD
    };
    plane.is_outside(scene.hull)
}

/// Where a triangle crosses a disc around the origin.
fn line_in_disc(corners: [Vec3; 3], n: Vec3, radius: f32) -> Option<[Vec3; 2]> {
    let heights = corners.map(|p| p.dot(n));
    if heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0) {
        return None;
    }
    // Where its edges cross the plane; the same point twice at a corner.
    let mut ends = [None; 2];
    for i in 0..3 {
        let (a, b) = (heights[i], heights[(i + 1) % 3]);
        if (a <= 0.0) != (b <= 0.0) {
            let p = corners[i] + (corners[(i + 1) % 3] - corners[i]) * (a / (a - b));
            ends[usize::from(ends[0].is_some())] = Some(p);
        }
    }
    // In the plane, or a degenerate triangle: the line could be anywhere.
    let [Some(p), Some(q)] = ends else {
        return Some([Vec3::NAN; 2]);
    };
    let way = q - p;
    let (middle, length2) = (-p.dot(way), way.length_squared());
    if length2 == 0.0 {
        return (p.length_squared() < radius * radius).then_some([p, q]);
    }
    let middle = middle / length2;
    let off2 = (p + way * middle).length_squared();
    let half = ((radius * radius - off2) / length2).max(0.0).sqrt();
    let part = [(middle - half).max(0.0), (middle + half).min(1.0)];
    (off2 < radius * radius && part[0] <= part[1]).then(|| part.map(|t| p + way * t))
}

impl SurfacePhoton {
    /// Whether a wall stands between the photon and a point that its kernel covers.
    #[inline]
    pub(crate) fn is_hidden_from(&self, scene: &Scene, point: Vec3) -> bool {
        let way = point - self.point;
        self.walls.may_hide(way) && {
            let n = self.ng * self.ng.dot(self.wi).signum();
            stand_between(scene, self.point + n * self.walls.height, way - n * way.dot(n))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;

    fn points<const N: usize>(sampler: &mut Sampler) -> [Vec3; N] {
        std::array::from_fn(|_| warp::uniform_sphere(sampler.next_2d()) * 2.0 * sampler.next_1d())
    }

    /// Lines hide no offset for which the crossing does not ask.
    #[test]
    fn what_is_before_all_lines_is_seen() {
        let mut sampler = Sampler::new(2, 0, Purpose::Test, 0);
        let (mut seen, mut behind) = (0, 0);
        for _ in 0..300 {
            let lines: Vec<[Vec3; 2]> = (0..1 + 3 * u32::from(sampler.next_1d() < 0.5))
                .map(|_| points::<2>(&mut sampler).map(|p| p.with_z(0.0)))
                .collect();
            let crossing = Crossing {
                height: 1.0,
                beyond: beyond(&lines),
            };
            for _ in 0..300 {
                let [offset] = points::<1>(&mut sampler).map(|p| p.with_z(0.0));
                // Whether each pair of points is on both sides of the line through the other.
                let apart = |a: Vec3, b: Vec3, [p, q]: [Vec3; 2]| (b - a).cross(p - a).z * (b - a).cross(q - a).z < 0.0;
                let is_hidden = (lines.iter())
                    .any(|&line| apart(Vec3::ZERO, offset, line) && apart(line[0], line[1], [Vec3::ZERO, offset]));
                assert!(crossing.may_hide(offset) || !is_hidden, "{lines:?} {offset}");
                seen += u32::from(!crossing.may_hide(offset));
                behind += u32::from(is_hidden);
            }
        }
        assert!(seen > 20_000 && behind > 5_000, "{seen}, {behind}");
        assert!(beyond(&[[Vec3::X, Vec3::Y], [Vec3::NAN; 2]]).is_nan());
    }
}
