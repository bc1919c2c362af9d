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
use crate::cpu::photon_map::{Crossing, MAX_PLANE_DISTANCE, SurfacePhoton};
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
    /// Of a crowd: square of the distance from the beam's line within which no wall is; else zero.
    clear2: f32,
    /// All of a closed scene is before it: see [`Scene::is_closed`].
    is_outer: bool,
}

/// Most planes of a beam. Where more walls are near, in a crowd, look-ups ask that are as far from the beam as these.
const MOST_PLANES: usize = 6;
/// Most stretches of a beam with crowds.
const MOST_CROWDS: usize = 3;
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

    /// Whether walls may hide the beam from a point, as far as its distance from the beam's line tells.
    #[inline(always)]
    pub(super) fn reaches(&self, distance2: f32) -> bool {
        distance2 > self.clear2
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
    let found = near.planes[..near.count].iter().chain(&near.crowds[..near.crowd_count]);
    planes.extend(found.filter_map(|plane| {
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
    planes: [Plane; MOST_PLANES],
    count: usize,
    /// The plane that covered something last.
    last: usize,
    /// What none of the planes has behind it, by stretches of the beam.
    crowds: [Plane; MOST_CROWDS],
    crowd_count: usize,
}

impl Default for Near {
    fn default() -> Self {
        Self {
            planes: [Plane::CROWD; MOST_PLANES],
            count: 0,
            last: 0,
            crowds: [Plane::CROWD; MOST_CROWDS],
            crowd_count: 0,
        }
    }
}

impl Near {
    /// Whether a wall is behind one of some planes, which then reaches as far along the beam as the wall.
    fn covers(
        &mut self,
        numbers: impl Iterator<Item = usize>,
        beam: &PhotonBeam,
        range: [f32; 2],
        is_behind: impl Fn(Vec3, f32) -> bool,
    ) -> bool {
        for number in numbers {
            let plane = &mut self.planes[number];
            if !is_behind(plane.n, plane.at) {
                continue;
            }
            let mut wider = *plane;
            wider.widen(range);
            if wider.range == plane.range || wider.serves(beam) {
                *plane = wider;
                self.last = number;
                return true;
            }
        }
        false
    }

    fn add_triangle(&mut self, beam: &PhotonBeam, corners: [Vec3; 3], radius: f32) {
        let [s, t, u] = corners.map(|p| beam.along(p));
        let range = [s.min(t).min(u), s.max(t).max(u)];
        let is_in_crowd =
            |crowd: &Plane| crowd.clear2 == 0.0 && crowd.range[0] <= range[0] && crowd.range[1] >= range[1];
        if self.crowds[..self.crowd_count].iter().any(is_in_crowd) {
            return;
        }
        let is_behind = |n: Vec3, at: f32| corners.iter().all(|p| n.dot(*p) - at <= BUMP * radius);
        // Neighbours are mostly behind the same plane.
        let last = self.last;
        if self.covers(last..self.count.min(last + 1), beam, range, is_behind) {
            return;
        }
        let [a, b, c] = corners;
        let n = (b - a).cross(c - a).normalize_or_zero();
        // The side that the beam is on where it is near.
        let [low, high] = range.map(|s| s.clamp(0.0, beam.length));
        let middle = beam.origin + beam.dir * (0.5 * (low + high));
        let n = n * n.dot(middle - a).signum();
        let own = Plane {
            n,
            at: n.dot(a),
            range,
            ..Plane::CROWD
        };
        let others = (0..self.count).filter(|number| *number != last);
        if n == Vec3::ZERO || own.stretch(beam).is_none() || self.covers(others, beam, range, is_behind) {
            return;
        }
        if self.count < MOST_PLANES && own.serves(beam) {
            return self.add(own);
        }
        // All of a triangle is behind the plane through its point nearest to the beam's line, across the way there.
        let nearest = nearest_to_line(corners.map(|p| p - beam.origin), beam.dir);
        let distance = nearest.length();
        if distance >= radius {
            return;
        }
        let n = -nearest.normalize_or_zero();
        let beside = Plane {
            n,
            at: n.dot(beam.origin) - distance,
            range,
            clear2: distance * distance,
            ..Plane::CROWD
        };
        match self.count < MOST_PLANES && n != Vec3::ZERO {
            true => self.add(beside),
            false => self.crowd(beside),
        }
    }

    fn add_round(&mut self, scene: &Scene, beam: &PhotonBeam, object: u32, radius: f32) {
        let shape = &scene.objects()[object as usize].shape;
        let reach = |n: Vec3| shape.reach(n).unwrap_or(f32::INFINITY);
        let from = beam.origin.dot(beam.dir);
        let range = [-reach(-beam.dir) - from, reach(beam.dir) - from];
        if self.covers(0..self.count, beam, range, |n, at| reach(n) - at <= BUMP * radius) {
            return;
        }
        let (low, high) = scene.boxes[object as usize];
        let middle = 0.5 * (low + high);
        let nearest = beam.origin + beam.dir * beam.along(middle).clamp(0.0, beam.length);
        let n = (nearest - middle).normalize_or_zero();
        let own = Plane {
            n,
            at: reach(n),
            range,
            ..Plane::CROWD
        };
        match self.count < MOST_PLANES && own.serves(beam) {
            true => self.add(own),
            false => self.crowd(own),
        }
    }

    fn add(&mut self, plane: Plane) {
        self.planes[self.count] = Plane { clear2: 0.0, ..plane };
        self.last = self.count;
        self.count += 1;
    }

    /// Adds a wall to the crowd of its stretch of the beam: a new one, where there is room and none is there.
    fn crowd(&mut self, wall: Plane) {
        let crowds = &mut self.crowds[..self.crowd_count];
        let gap = |crowd: &Plane| (crowd.range[0] - wall.range[1]).max(wall.range[0] - crowd.range[1]);
        let nearest = crowds.iter_mut().min_by(|a, b| gap(a).total_cmp(&gap(b)));
        match nearest {
            Some(crowd) if self.crowd_count == MOST_CROWDS || gap(crowd) <= 0.0 => {
                crowd.widen(wall.range);
                crowd.clear2 = crowd.clear2.min(wall.clear2);
            }
            _ => {
                self.crowds[self.crowd_count] = Plane {
                    range: wall.range,
                    clear2: wall.clear2,
                    ..Plane::CROWD
                };
                self.crowd_count += 1;
            }
        }
    }
}

/// The point of a triangle that is nearest to a line through the origin, as seen along the line: a vector across it;
/// zero where the line meets the triangle. `dir`: unit vector.
fn nearest_to_line(corners: [Vec3; 3], dir: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(|p| p - dir * p.dot(dir));
    let turns = [(a, b), (b, c), (c, a)].map(|(p, q)| dir.dot(p.cross(q)));
    if turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0) {
        return Vec3::ZERO;
    }
    let to_edge = |(p, q): (Vec3, Vec3)| {
        let way = q - p;
        let t = (-p.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        // Not a number where both are one.
        if t.is_nan() { p } else { p + way * t }
    };
    let nearest = [(a, b), (b, c), (c, a)].map(to_edge).into_iter();
    nearest
        .min_by(|p, q| p.length_squared().total_cmp(&q.length_squared()))
        .unwrap_or(Vec3::ZERO)
}

impl Plane {
    /// None is known, of no wall yet.
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

    /// Whether all of a box is before it, but for rounding.
    fn is_outside(&self, [low, high]: [Vec3; 2]) -> bool {
        let least = (self.n * low).min(self.n * high).element_sum();
        self.n != Vec3::ZERO && least >= self.at - 1e-5 * (low.abs().max(high.abs()).max_element())
    }

    /// Where along a beam the kernel reaches behind it, if anywhere.
    fn stretch(&self, beam: &PhotonBeam) -> Option<[f32; 2]> {
        let PhotonBeam { length, extent, .. } = *beam;
        let [low, high] = self.range;
        // Beyond its ends, what is seen of the beam is its end.
        let mut range = [
            if low <= 0.0 { f32::NEG_INFINITY } else { low },
            if high >= length { f32::INFINITY } else { high },
        ];
        if self.n != Vec3::ZERO {
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
        }
        let is_near = range[0] < range[1] && range[0] < extent[1] && range[1] > extent[0];
        is_near.then_some(range)
    }

    /// Whether the beam is before it wherever the kernel reaches behind it.
    fn serves(&self, beam: &PhotonBeam) -> bool {
        let Some([low, high]) = self.stretch(beam) else {
            return true;
        };
        let part = [low.max(0.0), high.min(beam.length)];
        let is_before = |s: f32| self.height(beam.origin + beam.dir * s) >= -BUMP * beam.radius_at(s);
        self.n != Vec3::ZERO && (part[0] > part[1] || part.into_iter().all(is_before))
    }

    /// What it is for a beam: nothing where the kernel does not reach behind it.
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

/// The walls that cross the kernel of a photon on a surface, looked for in a disc at some height above it. `n`: unit
/// normal of both, upwards.
pub(super) fn crossing(scene: &Scene, point: Vec3, n: Vec3, radius: f32, height: f32) -> Crossing {
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

/// What all of some lines have an offset from the origin whose product with it is at least one; not a number where they
/// are on all sides.
fn beyond(lines: &[[Vec3; 2]]) -> Vec3 {
    let nearest = |[p, q]: &[Vec3; 2]| {
        let way = *q - *p;
        let t = (-p.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        // Not a number where both are one.
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

/// Where a triangle crosses a disc around the origin.
fn line_in_disc(corners: [Vec3; 3], n: Vec3, radius: f32) -> Option<[Vec3; 2]> {
    let heights = corners.map(|p| p.dot(n));
    if heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0) {
        return None;
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
    // In the plane, or no triangle at all: anywhere.
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
        let way = point - self.point;
        self.walls.may_hide(way) && {
            let n = self.ng * self.ng.dot(self.wi).signum();
            stand_between(scene, self.point + n * self.walls.height, way - n * way.dot(n))
        }
    }
}
