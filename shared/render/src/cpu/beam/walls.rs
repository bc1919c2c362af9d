//! What stands near a kernel: light must not get through a wall, nor past the edge of a thing into what it shades.
//!
//! A kernel blurs light over all that is within its radius. Where a wall is as near as that, who looks the light up
//! asks whether it stands in between, by a short ray. Nearly everywhere none is needed. A surface photon knows whether
//! a wall crosses its kernel at all. A beam knows the planes of those near it: points before all of these see it, as
//! all do in a room without corners that jut out.
//!
//! Walls are what nothing passes: no glass, no boundaries of media, nothing with holes, nothing that rules hide from
//! some photon.

use super::PhotonBeam;
use crate::cpu::photon_map::{MAX_PLANE_DISTANCE, SurfacePhoton};
use crate::math::{Ray, Vec3};
use crate::wide::Around;
use crate::world::Scene;
use crate::world::geometry::{self, SurfaceHit};

/// A plane that a wall near a beam lies in or behind; the beam is before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, towards the beam; zero where no plane tells what is behind walls.
    n: Vec3,
    /// Product of the normal and any point of the plane.
    at: f32,
    /// Where along the beam the kernel reaches behind it.
    range: [f32; 2],
    /// All of a closed scene is before it: see [`Scene::is_closed`].
    is_outer: bool,
}

/// Most planes of a beam. Where more are near, every look-up asks.
const MOST_PLANES: usize = 6;
/// How far walls may rise above a plane that is taken for theirs, in kernel radii.
const BUMP: f32 = MAX_PLANE_DISTANCE;

/// Where between two distances along a beam its kernel reaches behind none of some planes: one stretch of it; infinite
/// where it reaches nowhere behind one.
pub(super) fn clear_range(planes: &[Plane], start: f32, end: f32) -> [f32; 2] {
    let mut clear = [f32::NEG_INFINITY, f32::INFINITY];
    let near = |plane: &&Plane| !plane.is_outer && plane.matters(start, end);
    for Plane { range: [low, high], .. } in planes.iter().filter(near) {
        // At which end less of the beam is lost.
        match high.min(end) - start < end - low.max(start) {
            true => clear[0] = clear[0].max(*high),
            false => clear[1] = clear[1].min(*low),
        }
    }
    clear
}

impl Plane {
    /// Whether the kernel reaches behind it somewhere in a range along the beam.
    #[inline(always)]
    pub(super) fn matters(&self, start: f32, end: f32) -> bool {
        self.range[0] < end && self.range[1] > start
    }

    /// Whether the kernel reaches behind it at distance `s`.
    #[inline(always)]
    pub(super) fn is_near(&self, s: f32) -> bool {
        (s > self.range[0]) & (s < self.range[1])
    }

    /// Whether a point is behind it.
    #[inline(always)]
    pub(super) fn hides(&self, [x, y, z]: [f32; 3]) -> bool {
        x * self.n.x + y * self.n.y + z * self.n.z < self.at
    }

    fn height(&self, point: Vec3) -> f32 {
        self.n.dot(point) - self.at
    }
}

/// What a beam starts or ends on.
#[derive(Clone, Copy)]
pub(super) struct End {
    /// Unit normal, on any side.
    pub normal: Vec3,
    /// Behind it, what is there sees no beam of this medium.
    pub bounds: bool,
}

impl End {
    pub fn on(scene: &Scene, hit: &SurfaceHit) -> Self {
        Self {
            normal: hit.ng,
            bounds: scene.objects()[hit.object as usize].boundary.is_some() && !scene.walls.has(hit.object),
        }
    }
}

/// Adds the planes of the walls near a beam to a list, and tells the beam where. `ends`: what it starts and ends on.
pub(super) fn find(scene: &Scene, beam: &mut PhotonBeam, ends: [Option<End>; 2], planes: &mut Vec<Plane>) {
    let mut near = Near::default();
    let radius = beam.max_radius();
    let mut behind = [Around::NO_PLANE; 2];
    for ((end, s), behind) in ends.into_iter().zip([0.0, beam.length]).zip(&mut behind) {
        if let Some(end) = end {
            let out = if s == 0.0 { beam.dir } else { -beam.dir };
            let n = end.normal * end.normal.dot(out).signum();
            let at = n.dot(beam.origin + beam.dir * s);
            *behind = n.extend(at + BUMP * radius).to_array();
            if !end.bounds {
                near.add(n, at, [f32::NEG_INFINITY, f32::INFINITY]);
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
    planes.extend(near.planes[..near.count].iter().filter_map(|plane| {
        let is_outer = scene.is_closed && plane.is_outside(scene.hull);
        Some(Plane {
            is_outer,
            ..plane.of(beam)?
        })
    }));
    beam.walls = [first as u32, planes.len() as u32];
}

/// The planes of a beam as they are found. Ranges are those of the walls.
struct Near {
    planes: [Plane; MOST_PLANES + 1],
    count: usize,
}

impl Default for Near {
    fn default() -> Self {
        Self {
            planes: [Plane::CROWD; MOST_PLANES + 1],
            count: 0,
        }
    }
}

impl Near {
    /// Whether a wall is behind one of them.
    fn covers(&mut self, range: [f32; 2], is_behind: impl Fn(Vec3, f32) -> bool) -> bool {
        if self.count > MOST_PLANES {
            self.planes[MOST_PLANES].widen(range);
            return true;
        }
        let plane = (self.planes[..self.count].iter_mut()).find(|plane| is_behind(plane.n, plane.at));
        plane.map(|plane| plane.widen(range)).is_some()
    }

    fn add_triangle(&mut self, beam: &PhotonBeam, corners: [Vec3; 3], radius: f32) {
        let [s, t, u] = corners.map(|p| beam.along(p));
        let range = [s.min(t).min(u), s.max(t).max(u)];
        if self.covers(range, |n, at| corners.iter().all(|p| n.dot(*p) - at <= BUMP * radius)) {
            return;
        }
        let [a, b, c] = corners;
        let n = (b - a).cross(c - a).normalize_or_zero();
        // The side that the beam is on where it is near.
        let [low, high] = range.map(|s| s.clamp(0.0, beam.length));
        let middle = beam.origin + beam.dir * (0.5 * (low + high));
        let n = n * n.dot(middle - a).signum();
        let plane = Plane {
            n,
            at: n.dot(a),
            range,
            is_outer: false,
        };
        if n != Vec3::ZERO && plane.of(beam).is_some() {
            self.add(plane.n, plane.at, range);
        }
    }

    fn add_round(&mut self, scene: &Scene, beam: &PhotonBeam, object: u32, radius: f32) {
        let shape = &scene.objects()[object as usize].shape;
        let reach = |n: Vec3| shape.reach(n).unwrap_or(f32::INFINITY);
        let from = beam.origin.dot(beam.dir);
        let range = [-reach(-beam.dir) - from, reach(beam.dir) - from];
        if self.covers(range, |n, at| reach(n) - at <= BUMP * radius) {
            return;
        }
        let (low, high) = scene.boxes[object as usize];
        let middle = 0.5 * (low + high);
        let nearest = beam.origin + beam.dir * beam.along(middle).clamp(0.0, beam.length);
        let n = (nearest - middle).normalize_or_zero();
        self.add(n, reach(n), range);
    }

    fn add(&mut self, n: Vec3, at: f32, range: [f32; 2]) {
        if self.count <= MOST_PLANES {
            if self.count < MOST_PLANES {
                self.planes[self.count] = Plane {
                    n,
                    at,
                    range,
                    is_outer: false,
                };
            }
            self.count += 1;
        }
        if self.count > MOST_PLANES {
            self.planes[MOST_PLANES].widen(range);
        }
    }
}

impl Plane {
    /// None is known, of no wall yet.
    const CROWD: Self = Self {
        n: Vec3::ZERO,
        at: f32::INFINITY,
        range: [f32::INFINITY, f32::NEG_INFINITY],
        is_outer: false,
    };

    fn widen(&mut self, [start, end]: [f32; 2]) {
        self.range = [self.range[0].min(start), self.range[1].max(end)];
    }

    /// Whether all of a box is before it, but for rounding.
    fn is_outside(&self, [low, high]: [Vec3; 2]) -> bool {
        let least = (self.n * low).min(self.n * high).element_sum();
        self.n != Vec3::ZERO && least >= self.at - 1e-5 * (low.abs().max(high.abs()).max_element())
    }

    /// What it is for a beam: nothing where the kernel does not reach behind it.
    fn of(&self, beam: &PhotonBeam) -> Option<Self> {
        let PhotonBeam { length, extent, .. } = *beam;
        let [low, high] = self.range;
        // Beyond its ends, what is seen of the beam is its end.
        let mut range = [
            if low <= 0.0 { f32::NEG_INFINITY } else { low },
            if high >= length { f32::INFINITY } else { high },
        ];
        let mut serves = self.n != Vec3::ZERO;
        if serves {
            // Behind the plane is the kernel where the plane is nearer than its radius, as seen across the beam.
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
                // Look-ups take what is before the start for the start.
                range[1] = range[1].max(f32::MIN_POSITIVE);
            }
            let part = [range[0].max(0.0), range[1].min(length)];
            let is_before = |s: f32| self.height(beam.origin + beam.dir * s) >= -BUMP * beam.radius_at(s);
            serves = part[0] > part[1] || part.into_iter().all(is_before);
        }
        let plane = Self {
            range,
            ..if serves { *self } else { Self::CROWD }
        };
        (range[0] < range[1] && plane.matters(extent[0], extent[1])).then_some(plane)
    }
}

/// Whether a wall stands between a point and what it sees of a beam at distance `s`.
#[cold]
#[inline(never)]
pub(super) fn hide(scene: &Scene, beam: &PhotonBeam, planes: &[Plane], point: Vec3, s: f32) -> bool {
    let s = s.clamp(0.0, beam.length);
    let mut from = beam.origin + beam.dir * s;
    // From above what it starts or ends on, so that bent surfaces do not hide it.
    let height = MAX_PLANE_DISTANCE * beam.radius_at(s);
    for plane in planes.iter().filter(|plane| plane.n != Vec3::ZERO) {
        from += plane.n * (height - plane.height(from)).clamp(0.0, 2.0 * height);
    }
    stand_between(scene, from, point - from)
}

/// Whether a wall crosses a disc.
pub(super) fn cross_disc(scene: &Scene, middle: Vec3, n: Vec3, radius: f32) -> bool {
    let at = n.dot(middle);
    let around = Around {
        origin: middle,
        dir: n,
        length: 0.0,
        radius,
        planes: [n.extend(at).to_array(), (-n).extend(-at).to_array()],
    };
    let mut crosses = false;
    (scene.geometry).near(scene.objects(), &scene.walls, &around, &mut |found| {
        crosses |= match found {
            geometry::Near::Triangle(_, corners) => {
                crosses_disc(corners.map(|p| p - middle), n, radius) && !is_outer(scene, corners, middle)
            }
            geometry::Near::Other(object) => {
                let shape = &scene.objects()[object as usize].shape;
                let reaches = |n: Vec3| shape.reach(n).is_none_or(|reach| reach >= n.dot(middle));
                reaches(n) && reaches(-n)
            }
        };
    });
    crosses
}

/// Whether everything is on the same side of a triangle as a point: it stands between no two surfaces.
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

/// Whether a triangle crosses a disc around the origin.
fn crosses_disc(corners: [Vec3; 3], n: Vec3, radius: f32) -> bool {
    let heights = corners.map(|p| p.dot(n));
    if heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0) {
        return false;
    }
    // Where its edges cross the plane; twice the same at a corner.
    let mut ends = [None; 2];
    for i in 0..3 {
        let (a, b) = (heights[i], heights[(i + 1) % 3]);
        if (a <= 0.0) != (b <= 0.0) {
            let p = corners[i] + (corners[(i + 1) % 3] - corners[i]) * (a / (a - b));
            ends[usize::from(ends[0].is_some())] = Some(p);
        }
    }
    let [Some(p), Some(q)] = ends else { return true };
    let way = q - p;
    let t = (-p.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    // Not a number where both are one.
    let nearest = if t.is_nan() { p } else { p + way * t };
    nearest.length_squared() < radius * radius
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

impl SurfacePhoton {
    /// Whether a wall stands between it and a point that its kernel covers.
    #[inline]
    pub(crate) fn is_hidden_from(&self, scene: &Scene, point: Vec3) -> bool {
        self.height > 0.0 && {
            let n = self.ng * self.ng.dot(self.wi).signum();
            let way = point - self.point;
            stand_between(scene, self.point + n * self.height, way - n * way.dot(n))
        }
    }
}
