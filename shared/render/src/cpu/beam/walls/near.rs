//! The walls near a beam, as planes that they are behind.

use super::{BUMP, Plane};
use crate::cpu::beam::PhotonBeam;
use crate::math::Vec3;
use crate::world::Scene;

/// Most planes of a beam. Where more walls crowd around it, look-ups trace a ray if they are as far from the beam as
/// these.
const MOST_PLANES: usize = 10;
/// Most stretches of a beam that have crowds.
const MOST_CROWDS: usize = 3;

/// The planes of a beam as they are found. Their ranges are those of the walls.
pub(super) struct Near {
    planes: [Plane; MOST_PLANES],
    count: usize,
    /// The plane that last covered a wall.
    last: usize,
    /// By stretches of the beam: walls that none of the planes covers.
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
    /// All planes and crowds.
    pub fn found(&self) -> impl Iterator<Item = &Plane> {
        self.planes[..self.count].iter().chain(&self.crowds[..self.crowd_count])
    }

    /// Whether a wall is behind one of some planes. That plane's range is then widened to the wall's.
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

    pub fn add_triangle(&mut self, beam: &PhotonBeam, corners: [Vec3; 3], radius: f32) {
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
        // All of a triangle is behind the plane through its point nearest to the beam's line, perpendicular to the way
        // there.
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

    pub fn add_round(&mut self, scene: &Scene, beam: &PhotonBeam, object: u32, radius: f32) {
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

    pub fn add(&mut self, plane: Plane) {
        self.planes[self.count] = Plane { clear2: 0.0, ..plane };
        self.last = self.count;
        self.count += 1;
    }

    /// Adds a wall to the crowd of its stretch of the beam, or to a new one if there is room and none is there.
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

/// The point of a triangle nearest to a line through the origin, seen along the line: a vector across it, zero where
/// the line meets the triangle. `dir`: unit vector.
fn nearest_to_line(corners: [Vec3; 3], dir: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(|p| p - dir * p.dot(dir));
    let turns = [(a, b), (b, c), (c, a)].map(|(p, q)| dir.dot(p.cross(q)));
    if turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0) {
        return Vec3::ZERO;
    }
    let to_edge = |(p, q): (Vec3, Vec3)| {
        let way = q - p;
        let t = (-p.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        // Not a number where both points coincide.
        if t.is_nan() { p } else { p + way * t }
    };
    let nearest = [(a, b), (b, c), (c, a)].map(to_edge).into_iter();
    nearest
        .min_by(|p, q| p.length_squared().total_cmp(&q.length_squared()))
        .unwrap_or(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;

    fn points<const N: usize>(sampler: &mut Sampler) -> [Vec3; N] {
        std::array::from_fn(|_| warp::uniform_sphere(sampler.next_2d()) * 2.0 * sampler.next_1d())
    }

    /// The whole triangle is at least as far along the way to its nearest point, and one of its points is as near as
    /// that.
    #[test]
    fn nearest_points_are_the_nearest() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let mut met = 0;
        for _ in 0..2000 {
            let corners = points::<3>(&mut sampler);
            let dir = warp::uniform_sphere(sampler.next_2d());
            let nearest = nearest_to_line(corners, dir);
            met += u32::from(nearest == Vec3::ZERO);
            let mut least = f32::INFINITY;
            for step in 0..60 * 60 {
                let (u, v) = ((step / 60) as f32 / 59.0, (step % 60) as f32 / 59.0);
                let point = corners[0] + ((corners[1] - corners[0]) * (1.0 - v) + (corners[2] - corners[0]) * v) * u;
                let across = point - dir * point.dot(dir);
                least = least.min(across.length());
                assert!(across.dot(nearest) >= nearest.length_squared() - 1e-5);
            }
            // Half of the spacing between the points looked at.
            assert!(
                least >= nearest.length() - 1e-5 && least < nearest.length() + 0.1,
                "{least}, {nearest}"
            );
        }
        assert!((100..1900).contains(&met), "{met}");
    }
}
