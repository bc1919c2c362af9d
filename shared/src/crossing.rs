//! Which surface a ray meets, and which medium is beyond it, where boundaries of media lie on other surfaces.
//!
//! A box of fog fills its room to the walls, two boxes stand side by side. Which of two surfaces at one place a ray meets first is then
//! decided by rounding, and the other is not met at all, since rays start a little off the surface that they leave. So what else is
//! there is looked for: surfaces that are something to see come before boundaries that are nothing else, and of boundaries all
//! are crossed, one after the other as their media follow. Both are the same from either side, as they must be for light paths
//! that are found from lights and from the camera.

use crate::geometry::SurfaceHit;
use crate::math::{Ray, Vec3};
use crate::medium::MediumId;
use crate::plan::Scene;

/// Boundaries at one place; nobody models more.
const MOST: usize = 4;

impl Scene {
    /// The first surface that a ray meets. `hides`: objects that it passes.
    #[inline]
    pub(crate) fn first_hit(&self, ray: &Ray, hides: impl Fn(u32) -> bool) -> Option<SurfaceHit> {
        let objects = self.objects();
        let hit = self
            .geometry
            .intersect(objects, ray, f32::INFINITY, &hides)?;
        if !self.has_boundaries || !self.is_null(hit.object) {
            return Some(hit);
        }
        let (across, length) = probe(&hit, ray.dir);
        let is_passed = |object: u32| hides(object) || self.is_null(object);
        let other = (self.geometry).intersect(objects, &across, length, is_passed);
        match other {
            Some(other) => Some(SurfaceHit { t: hit.t, ..other }),
            None => Some(hit),
        }
    }

    /// The medium beyond a surface for a ray that crosses it in direction `dir`, coming through `current`.
    #[inline]
    pub(crate) fn medium_beyond(&self, hit: &SurfaceHit, dir: Vec3, current: MediumId) -> MediumId {
        let boundary = self.objects()[hit.object as usize].boundary;
        let beyond = boundary.map_or(current, |boundary| boundary.medium_towards(hit.ng, dir));
        if !self.has_boundaries {
            return beyond;
        }
        let mut all = self.crossings(hit, dir);
        // What a ray meets it crosses whatever it comes through; boundaries alone come in their turn.
        let medium = match self.is_null(hit.object) && all.iter().any(|c| c.near == current) {
            true => current,
            false => {
                all.drop(0);
                beyond
            }
        };
        all.followed_from(medium)
    }

    /// The medium on this side of a boundary that a ray meets in direction `dir`.
    pub(crate) fn medium_before(&self, hit: &SurfaceHit, dir: Vec3) -> MediumId {
        let all = self.crossings(hit, dir);
        let is_first = |c: &&Crossing| all.iter().all(|other| other.far != c.near);
        let first = all.iter().find(is_first).or(all.iter().next());
        first.and_then(|c| c.near)
    }

    /// The boundary that a ray in direction `dir` meets, if it is one, and those without a surface that lie there as well.
    fn crossings(&self, hit: &SurfaceHit, dir: Vec3) -> Crossings {
        let (across, length) = probe(hit, dir);
        let mut all = Crossings::default();
        let mut seen = [hit.object; MOST];
        let mut next = Some((hit.object, hit.ng));
        for count in 1..=MOST {
            let Some((object, ng)) = next else { break };
            let boundary = self.objects()[object as usize].boundary;
            all.push(boundary.map(|boundary| Crossing {
                near: boundary.medium_towards(ng, -dir),
                far: boundary.medium_towards(ng, dir),
            }));
            if let Some(seen) = seen.get_mut(count - 1) {
                *seen = object;
            }
            let is_passed = |object: u32| seen[..count].contains(&object) || !self.is_null(object);
            let other = (self.geometry).intersect(self.objects(), &across, length, is_passed);
            next = other.map(|other| (other.object, other.ng));
        }
        all
    }
}

/// The media on both sides of a boundary, for a ray.
#[derive(Clone, Copy)]
struct Crossing {
    near: MediumId,
    far: MediumId,
}

/// Boundaries at one place.
#[derive(Default)]
struct Crossings([Option<Crossing>; MOST], usize);

impl Crossings {
    fn push(&mut self, crossing: Option<Crossing>) {
        if let Some(place) = self.0.get_mut(self.1) {
            *place = crossing;
            self.1 += 1;
        }
    }

    fn drop(&mut self, index: usize) {
        self.0[index] = None;
    }

    fn iter(&self) -> impl Iterator<Item = &Crossing> {
        self.0.iter().flatten()
    }

    /// Where a ray is that was in this medium, when it has crossed all that follow from it.
    fn followed_from(mut self, medium: MediumId) -> MediumId {
        let mut medium = medium;
        let is_next = |c: &Option<Crossing>, medium| c.is_some_and(|c| c.near == medium);
        while let Some(next) = self.0.iter_mut().find(|c| is_next(c, medium)) {
            medium = next.take().and_then(|c| c.far);
        }
        medium
    }
}

/// A ray through all surfaces that lie where a hit is, in direction `dir` or nearly so; and its length.
fn probe(hit: &SurfaceHit, dir: Vec3) -> (Ray, f32) {
    let n = hit.ng * hit.ng.dot(dir).signum();
    let ray = Ray {
        origin: hit.point - n * hit.clearance,
        dir: n,
    };
    (ray, 2.0 * hit.clearance)
}
