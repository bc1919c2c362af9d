//! Walls near a kernel: light must not get through a wall, nor past an object's edge into its shadow.
//!
//! A kernel blurs light over everything within its radius. If a wall is that near, the look-up traces a short ray to
//! see whether the wall is in between. Nearly everywhere, none is needed. A surface photon knows whether any wall
//! crosses its kernel. A beam knows the planes of the walls near it: points in front of all of them see the beam, as
//! all points do in a room without protruding corners.
//!
//! Walls are what nothing passes: not glass, not boundaries of media, nothing with holes, nothing that rules hide from
//! some photon.

mod crossing;
mod near;

use super::PhotonBeam;
use crate::cpu::photon_map::MAX_PLANE_DISTANCE;
use crate::math::{Ray, Vec3};
use crate::wide::Around;
use crate::world::Scene;
use crate::world::geometry::{self, SurfaceHit};
pub use crossing::crossing;

/// A plane that a wall near a beam lies in or behind; the beam is in front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, towards the beam; zero if no plane bounds what walls hide.
    pub n: Vec3,
    /// Product of the normal and any point of the plane.
    pub at: f32,
    /// The range along the beam in which its kernel reaches behind the plane.
    pub range: [f32; 2],
    /// For a crowd: square of the distance from the beam's line within which there is no wall; otherwise zero.
    pub clear2: f32,
    /// All of a closed scene is in front of it: see [`Scene::is_closed`].
    pub is_outer: bool,
}

/// How far walls may rise above the plane that stands for them, in kernel radii.
const BUMP: f32 = MAX_PLANE_DISTANCE;

/// One stretch between two distances along a beam in which its kernel reaches behind none of the planes; infinite where
/// it reaches behind none anywhere.
pub(super) fn clear_range(planes: &[Plane], start: f32, end: f32) -> [f32; 2] {
    let mut clear = [f32::NEG_INFINITY, f32::INFINITY];
    let near = |plane: &&Plane| !plane.is_outer && plane.matters(start, end);
    for Plane { range: [low, high], .. } in planes.iter().filter(near) {
        // Cut at the end where less of the beam is lost.
        match high.min(end) - start < end - low.max(start) {
            true => clear[0] = clear[0].max(*high),
            false => clear[1] = clear[1].min(*low),
        }
    }
    clear
}

impl Plane {
    /// Whether the kernel reaches behind the plane somewhere in a range along the beam.
    #[inline(always)]
    pub(super) fn matters(&self, start: f32, end: f32) -> bool {
        self.range[0] < end && self.range[1] > start
    }

    /// Whether the kernel reaches behind the plane at distance `s`.
    #[inline(always)]
    pub(super) fn is_near(&self, s: f32) -> bool {
        (s > self.range[0]) & (s < self.range[1])
    }

    /// Whether walls may hide the beam from a point, judging by its distance from the beam's line.
    #[inline(always)]
    pub(super) fn reaches(&self, distance2: f32) -> bool {
        distance2 > self.clear2
    }

    /// Whether a point is behind the plane.
    #[inline(always)]
    pub(super) fn hides(&self, [x, y, z]: [f32; 3]) -> bool {
        x * self.n.x + y * self.n.y + z * self.n.z < self.at
    }

    fn height(&self, point: Vec3) -> f32 {
        self.n.dot(point) - self.at
    }
}

/// The surface that a beam starts or ends on.
#[derive(Clone, Copy)]
pub struct End {
    /// Unit normal, on either side.
    pub normal: Vec3,
    /// What is behind it sees no beam of this medium.
    pub bounds: bool,
}

impl End {
    pub(super) fn on(scene: &Scene, hit: &SurfaceHit) -> Self {
        Self {
            normal: hit.ng,
            bounds: hit.boundary.is_some() && !scene.walls.has(hit.object),
        }
    }
}

/// Appends the planes of the walls near a beam to a list, and stores the range in the beam. `ends`: what it starts and
/// ends on.
pub fn find(scene: &Scene, beam: &mut PhotonBeam, ends: [Option<End>; 2], planes: &mut Vec<Plane>) {
    let mut near = near::Near::default();
    let radius = beam.max_radius();
    let mut behind = [Around::NO_PLANE; 2];
    for ((end, s), behind) in ends.into_iter().zip([0.0, beam.length]).zip(&mut behind) {
        if let Some(end) = end {
            let out = if s == 0.0 { beam.dir } else { -beam.dir };
            let n = end.normal * end.normal.dot(out).signum();
            let at = n.dot(beam.origin + beam.dir * s);
            *behind = n.extend(at + BUMP * radius).to_array();
            if !end.bounds {
                near.add(Plane {
                    n,
                    at,
                    range: [f32::NEG_INFINITY, f32::INFINITY],
                    ..Plane::CROWD
                });
            }
        }
    }
    let [start, end] = beam.extent;
    let around = Around {
        origin: beam.origin + beam.dir * start,
        dir: beam.dir,
        length: end - start,
        radius,
        planes: behind,
    };
    (scene.geometry).near(scene.objects(), &scene.walls, &around, &mut |found| match found {
        geometry::Near::Triangle(_, corners) => near.add_triangle(beam, corners, radius),
        geometry::Near::Other(object) => near.add_round(scene, beam, object, radius),
    });
    let first = planes.len();
    planes.extend(near.found().filter_map(|plane| {
        let is_outer = scene.is_closed && plane.is_outside(scene.hull);
        Some(Plane {
            is_outer,
            ..plane.of(beam)?
        })
    }));
    beam.walls = [first as u32, planes.len() as u32];
}

impl Plane {
    /// No plane is known, and no wall yet.
    const CROWD: Self = Self {
        n: Vec3::ZERO,
        at: f32::INFINITY,
        range: [f32::INFINITY, f32::NEG_INFINITY],
        clear2: 0.0,
        is_outer: false,
    };

    fn widen(&mut self, [start, end]: [f32; 2]) {
        self.range = [self.range[0].min(start), self.range[1].max(end)];
    }

    /// Whether all of a box is in front of the plane, up to rounding.
    fn is_outside(&self, [low, high]: [Vec3; 2]) -> bool {
        let least = (self.n * low).min(self.n * high).element_sum();
        self.n != Vec3::ZERO && least >= self.at - 1e-5 * (low.abs().max(high.abs()).max_element())
    }

    /// The range along a beam in which its kernel reaches behind the plane, if any.
    fn stretch(&self, beam: &PhotonBeam) -> Option<[f32; 2]> {
        let PhotonBeam { length, extent, .. } = *beam;
        let [low, high] = self.range;
        // Beyond its ends, one sees the beam's end.
        let mut range = [
            if low <= 0.0 { f32::NEG_INFINITY } else { low },
            if high >= length { f32::INFINITY } else { high },
        ];
        if self.n != Vec3::ZERO {
            // The kernel is behind the plane where the plane is nearer than its radius, as seen across the beam.
            let cos = self.n.dot(beam.dir);
            let across = (1.0 - cos * cos).max(0.0).sqrt();
            let above = self.height(beam.origin) - across * beam.radius;
            let slope = cos - across * beam.radius_slope;
            if slope > 0.0 {
                range[1] = range[1].min(-above / slope);
            } else if slope < 0.0 {
                range[0] = range[0].max(-above / slope);
            } else if above >= 0.0 {
                return None;
            }
            if range[0] < 0.0 && range[1] > extent[0] {
                // Look-ups treat what is before the start as the start.
                range[1] = range[1].max(f32::MIN_POSITIVE);
            }
        }
        let is_near = range[0] < range[1] && range[0] < extent[1] && range[1] > extent[0];
        is_near.then_some(range)
    }

    /// Whether the beam is in front of the plane wherever the kernel reaches behind it.
    fn serves(&self, beam: &PhotonBeam) -> bool {
        let Some([low, high]) = self.stretch(beam) else {
            return true;
        };
        let part = [low.max(0.0), high.min(beam.length)];
        let is_before = |s: f32| self.height(beam.origin + beam.dir * s) >= -BUMP * beam.radius_at(s);
        self.n != Vec3::ZERO && (part[0] > part[1] || part.into_iter().all(is_before))
    }

    /// The plane as it applies to a beam; none where the kernel does not reach behind it.
    fn of(&self, beam: &PhotonBeam) -> Option<Self> {
        let range = self.stretch(beam)?;
        let plane = if self.serves(beam) {
            *self
        } else {
            Self {
                clear2: self.clear2,
                ..Self::CROWD
            }
        };
        Some(Self { range, ..plane })
    }
}

/// Whether a wall stands between a point and what the point sees of a beam at distance `s`.
#[cold]
#[inline(never)]
pub(super) fn hide(scene: &Scene, beam: &PhotonBeam, planes: &[Plane], point: Vec3, s: f32) -> bool {
    let s = s.clamp(0.0, beam.length);
    let mut from = beam.origin + beam.dir * s;
    // Starts above what the beam starts or ends on, so that bent surfaces do not hide it.
    let height = MAX_PLANE_DISTANCE * beam.radius_at(s);
    for plane in planes.iter().filter(|plane| plane.n != Vec3::ZERO) {
        from += plane.n * (height - plane.height(from)).clamp(0.0, 2.0 * height);
    }
    stand_between(scene, from, point - from)
}

/// Whether a wall stands in the way from a point.
pub(super) fn stand_between(scene: &Scene, from: Vec3, way: Vec3) -> bool {
    let length = way.length();
    let ray = Ray {
        origin: from,
        dir: way / length,
    };
    let is_passed = |object: u32| !scene.walls.has(object);
    length > 0.0 && (scene.geometry).occluded(scene.objects(), &ray, length, &is_passed)
}
