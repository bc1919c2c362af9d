//! Solids of glass and liquids that reach into each other, or touch: between them there is a surface of neither, or of
//! both, and light bends by the wrong index.

use super::Scene;
use super::crossing::places_on;
use crate::math::{Ray, Vec3};
use crate::world::bsdf::BsdfFlags;

/// How two solids meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// Part of one is inside of the other, and part is not.
    Crossing,
    /// Their surfaces lie on each other.
    Touching,
}

/// Solids and pairs of them that are looked at, at most: nobody models more glass by hand.
const MOST_SOLIDS: usize = 2000;
const MOST_PAIRS: usize = 2000;
/// How near surfaces are that touch, against the smaller of the two.
const NEAR: f32 = 1e-4;
/// Of the places that are looked at, so many are on both sides of what is crossed, and lie on what is touched.
const LEAST_CROSSING: usize = 2;
const LEAST_TOUCHING: usize = 16;

impl Scene {
    /// Pairs of solids of glass, or of what else bends light, that reach into each other or touch. Solids that are all
    /// within others, as bubbles are, do not; nor do surfaces that are open, as those between water and its glass.
    pub fn meeting_solids(&self) -> Vec<([u32; 2], Meeting)> {
        let bends = |object: u32| {
            let material = self.material_of(object);
            let bends = material.has(BsdfFlags::REFRACTS) && material.has(BsdfFlags::BOUNDS_MEDIA);
            bends && self.objects()[object as usize].boundary.is_some()
        };
        let solids: Vec<u32> = (0..self.objects().len() as u32)
            .filter(|object| bends(*object))
            .take(MOST_SOLIDS)
            .collect();
        let overlap = |a: u32, b: u32| {
            let ((low, high), (other_low, other_high)) = (self.boxes[a as usize], self.boxes[b as usize]);
            low.cmple(other_high).all() && other_low.cmple(high).all()
        };
        let pairs = solids.iter().enumerate().flat_map(|(i, a)| {
            let others = solids[i + 1..].iter().filter(|b| overlap(*a, **b));
            others.map(|b| [*a, *b])
        });
        let meeting = |[a, b]: [u32; 2]| self.meeting(a, b).or_else(|| self.meeting(b, a));
        let met = pairs.take(MOST_PAIRS).filter_map(|pair| Some((pair, meeting(pair)?)));
        // That takes longest.
        let are_closed = |pair: &[u32; 2]| {
            pair.iter()
                .all(|object| self.objects()[*object as usize].shape.is_closed())
        };
        met.filter(|(pair, _)| are_closed(pair)).collect()
    }

    /// How a solid meets another, by places on its surface.
    fn meeting(&self, one: u32, other: u32) -> Option<Meeting> {
        let near = NEAR * self.extents[one as usize].min(self.extents[other as usize]);
        let (mut inside, mut outside, mut on) = (0, 0, 0);
        for place in places_on(&self.objects()[one as usize]) {
            let sides = [1.0, -1.0].map(|side| self.is_inside(other, place.point + place.normal * (side * near)));
            match sides {
                [true, true] => inside += 1,
                [false, false] => outside += 1,
                _ => on += 1,
            }
        }
        match () {
            () if inside >= LEAST_CROSSING && outside >= LEAST_CROSSING => Some(Meeting::Crossing),
            () if on >= LEAST_TOUCHING => Some(Meeting::Touching),
            () => None,
        }
    }

    /// Whether a point is inside of a closed object: by the side from which its surface is met first.
    fn is_inside(&self, object: u32, point: Vec3) -> bool {
        // A direction that is parallel to nothing people model.
        let ray = Ray {
            origin: point,
            dir: Vec3::new(0.408_2, 0.267_3, 0.872_9).normalize(),
        };
        let is_other = |other: u32| other != object;
        let hit = (self.geometry).intersect(self.objects(), &ray, f32::INFINITY, &is_other);
        hit.is_some_and(|hit| hit.ng.dot(ray.dir) > 0.0)
    }
}
