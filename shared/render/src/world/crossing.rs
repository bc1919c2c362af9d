//! Which surface a ray meets, and which medium is where, even where boundaries of media coincide with other surfaces or
//! cut through lights.
//!
//! A box of fog fills its room to the walls; two boxes touch. Rounding then decides which of two coincident surfaces a
//! ray meets first, and the other is missed, since rays start a little off the surface that they leave. So the code
//! looks for coincident surfaces: visible surfaces come before pure boundaries, and of boundaries all are crossed, in
//! the order in which their media follow. Both rules give the same result from either side, as light paths from lights
//! and from the camera require.

use super::Scene;
use crate::math::{Ray, Vec2, Vec3};
use crate::world::geometry::{Object, SurfaceHit, SurfacePoint};
use crate::world::light::LightKind;
use crate::world::medium::MediumId;
use crate::world::rules::HiddenSet;

/// The medium around a light or the camera.
#[derive(Clone, Copy, Debug)]
pub enum StartMedium {
    /// The same on all sides.
    One(MediumId),
    /// It depends on the place.
    ByPlace,
}

/// Places on a surface at which the medium is looked up.
const PLACES: usize = 256;
/// Share of places in a medium other than the surface's `exterior` above which the surface counts as misplaced: an
/// object that another boundary cuts, or that is seen through itself, is no sign of that.
const LEAST_WRONG: f32 = 0.2;
/// Most boundaries at one place; nobody models more.
const MOST: usize = 4;
/// Most surfaces passed, in search of one that bounds a medium, that bound none.
const MOST_PASSED: usize = 1000;

impl Scene {
    /// The first surface that a ray meets. `hides`: objects that it passes.
    #[inline]
    pub fn first_hit(&self, ray: &Ray, hides: impl Fn(u32) -> bool) -> Option<SurfaceHit> {
        let hit = self.meets(ray, f32::INFINITY, &hides)?;
        if !self.has_boundaries || !self.is_null(hit.object) {
            return Some(hit);
        }
        let (across, length) = probe(&hit, ray.dir);
        let is_passed = |object: u32| hides(object) || self.is_null(object);
        match self.meets(&across, length, &is_passed) {
            Some(other) => Some(SurfaceHit { t: hit.t, ..other }),
            None => Some(hit),
        }
    }

    /// The medium beyond a surface for a ray in direction `dir` that crosses it from `current`.
    #[inline]
    pub fn medium_beyond(&self, hit: &SurfaceHit, dir: Vec3, current: MediumId) -> MediumId {
        let beyond = hit
            .boundary
            .map_or(current, |boundary| boundary.medium_towards(hit.ng, dir));
        if !self.has_boundaries {
            return beyond;
        }
        let mut all = self.crossings(hit, dir);
        // A visible surface is crossed from any medium; pure boundaries come in their turn.
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

    /// The boundary that a ray in direction `dir` meets, if it is one, and the pure boundaries that coincide with it.
    fn crossings(&self, hit: &SurfaceHit, dir: Vec3) -> Crossings {
        let (across, length) = probe(hit, dir);
        let mut all = Crossings::default();
        let mut seen = [hit.object; MOST];
        let mut next = Some((hit.object, hit.boundary, hit.ng));
        for count in 1..=MOST {
            let Some((object, boundary, ng)) = next else { break };
            all.push(boundary.map(|boundary| Crossing {
                near: boundary.medium_towards(ng, -dir),
                far: boundary.medium_towards(ng, dir),
            }));
            if let Some(seen) = seen.get_mut(count - 1) {
                *seen = object;
            }
            let is_passed = |object: u32| seen[..count].contains(&object) || !self.is_null(object);
            let other = self.meets(&across, length, &is_passed);
            next = other.map(|other| (other.object, other.boundary, other.ng));
        }
        all
    }

    /// The medium at a point. The first boundary seen from there tells on which side the point lies.
    pub fn medium_at(&self, point: Vec3) -> MediumId {
        self.medium_without(point, |_| false)
    }

    /// [`Self::medium_at`] with some objects absent.
    pub(crate) fn medium_without(&self, point: Vec3, hides: impl Fn(u32) -> bool) -> MediumId {
        if !self.bounds_any {
            return self.description().world_medium;
        }
        // A direction that is parallel to nothing people model.
        let dir = Vec3::new(0.267_3, 0.872_9, 0.408_2).normalize();
        let bounds_nothing = |object: u32| {
            let is_boundary = self.objects()[object as usize].boundary.is_some() || self.meetings.has(object);
            !is_boundary || hides(object)
        };
        let mut ray = Ray { origin: point, dir };
        for _ in 0..MOST_PASSED {
            match self.meets(&ray, f32::INFINITY, &bounds_nothing) {
                Some(hit) if hit.boundary.is_none() => ray = hit.spawn_ray(dir),
                Some(hit) => return self.medium_before(&hit, dir),
                None => break,
            }
        }
        self.description().world_medium
    }

    /// What remains of `medium_at` when some objects are hidden.
    pub(crate) fn medium_seen(&self, point: Vec3, hidden: Option<HiddenSet>) -> MediumId {
        match (&self.description().rules, hidden) {
            (Some(rules), Some(set)) => self.medium_without(point, |object| rules.hides(set, object)),
            _ => self.medium_at(point),
        }
    }

    /// Names of objects that lie in a medium other than their `exterior` states. Light that leaves them travels as if
    /// in that medium without having crossed a boundary, so the picture depends on the direction of view.
    pub fn misplaced(&self) -> Vec<String> {
        let objects = self.objects().iter().zip(0..);
        let misplaced = objects.filter_map(|(object, index)| {
            let exterior = object.boundary?.exterior;
            let wrong = places_on(object).filter(|on| {
                let clearance = self.clearance(on.point);
                let point = on.point + on.normal * clearance;
                let back = Ray {
                    origin: point,
                    dir: -on.normal,
                };
                // A coincident surface is crossed together with it.
                let is_passed = |other: u32| other == index || self.objects()[other as usize].boundary.is_none();
                !(self.geometry).occluded(self.objects(), &back, 2.0 * clearance, &is_passed)
                    && !self.is_in_partner(index, point)
                    && self.medium_at(point) != exterior
            });
            (wrong.count() as f32 > LEAST_WRONG * PLACES as f32).then(|| object.name.clone())
        });
        misplaced.collect()
    }

    /// The medium that a camera ray starts in.
    #[inline]
    pub(crate) fn medium_of_camera(&self, origin: Vec3) -> MediumId {
        match self.camera_medium {
            StartMedium::One(medium) => medium,
            StartMedium::ByPlace => self.medium_seen(origin, self.hidden_from_camera()),
        }
    }

    fn hidden_from_camera(&self) -> Option<HiddenSet> {
        let rules = self.description().rules.as_ref();
        rules.map(|rules| rules.camera)
    }

    /// The media that camera rays start in.
    pub(super) fn find_camera_medium(&self) -> StartMedium {
        let camera = &self.description().camera;
        if let Some(named) = self.description().camera_medium {
            return StartMedium::One(named);
        }
        let numbers = 0..self.objects().len() as u32;
        let meets_film = |object: u32| camera.film_meets(self.boxes[object as usize]);
        match numbers
            .into_iter()
            .any(|object| !self.bounds_nothing(object) && meets_film(object))
        {
            true => StartMedium::ByPlace,
            false => StartMedium::One(self.medium_seen(camera.position, self.hidden_from_camera())),
        }
    }

    /// The medium that photons of a light start in, at a point off its surface.
    #[inline]
    pub(crate) fn medium_of_light(&self, light: usize, point: Vec3) -> MediumId {
        match self.light_media[light] {
            StartMedium::One(medium) => medium,
            StartMedium::ByPlace => self.medium_seen(point, self.hidden_from_light(light)),
        }
    }

    fn hidden_from_light(&self, light: usize) -> Option<HiddenSet> {
        let rules = self.description().rules.as_ref();
        rules.map(|rules| rules.of_light[light])
    }

    /// The media that photons of a light start in.
    pub(crate) fn find_light_medium(&self, light: usize) -> StartMedium {
        let hidden = self.hidden_from_light(light);
        if let Some(ball) = self.lights()[light].soft_ball(self.objects()) {
            // Photons start anywhere.
            let mut numbers = 0..self.objects().len() as u32;
            return match numbers.all(|object| self.bounds_nothing(object)) {
                true => StartMedium::One(self.medium_seen(ball.center, hidden)),
                false => StartMedium::ByPlace,
            };
        }
        let medium = match &self.lights()[light].kind {
            LightKind::Point { position, .. } => self.medium_seen(*position, hidden),
            LightKind::Spot(spot) if spot.radius > 0.0 => {
                return self.one_medium(lattice().map(|(u, depth)| spot.start(u, depth)), hidden);
            }
            LightKind::Spot(spot) => self.medium_seen(spot.position, hidden),
            LightKind::Projector(projector) => self.medium_seen(projector.position, hidden),
            LightKind::Goniometric(lamp) => self.medium_seen(lamp.position, hidden),
            LightKind::Laser(laser) => {
                return self.one_medium(lattice().map(|(u, _)| laser.start(u).0), hidden);
            }
            LightKind::Area { object, two_sided, .. } => {
                let object = &self.objects()[*object as usize];
                match object.boundary {
                    Some(boundary) if !two_sided => return StartMedium::One(boundary.exterior),
                    Some(_) => return StartMedium::ByPlace,
                    None => {}
                }
                let sides: &[f32] = if *two_sided { &[1.0, -1.0] } else { &[1.0] };
                let points = places_on(object).flat_map(|on| {
                    let off = on.normal * self.clearance(on.point);
                    sides.iter().map(move |side| on.point + off * *side)
                });
                return self.one_medium(points, hidden);
            }
            LightKind::Directional(_) | LightKind::Environment(_) => self.description().world_medium,
            LightKind::Volume(_) => return StartMedium::ByPlace,
        };
        StartMedium::One(medium)
    }

    /// The medium of these points, if it is the same for all.
    fn one_medium(&self, points: impl Iterator<Item = Vec3>, hidden: Option<HiddenSet>) -> StartMedium {
        let mut media = points.map(|point| self.medium_seen(point, hidden));
        let first = media.next().flatten();
        match media.all(|other| other == first) {
            true => StartMedium::One(first),
            false => StartMedium::ByPlace,
        }
    }
}

/// Evenly distributed places on a surface.
pub(super) fn places_on(object: &Object) -> impl Iterator<Item = SurfacePoint> {
    lattice().map(|(u, primitive)| object.shape.sample_area(u, primitive))
}

/// Evenly distributed points on a light.
fn lattice() -> impl Iterator<Item = (Vec2, f32)> {
    (0..PLACES).map(|i| {
        // The Kronecker sequence.
        let u = Vec2::new(i as f32 * 0.754_877_7, i as f32 * 0.569_840_3).fract();
        (u, (i as f32 + 0.5) / PLACES as f32)
    })
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

    /// The medium that a ray from this medium reaches after crossing every boundary that follows.
    fn followed_from(mut self, medium: MediumId) -> MediumId {
        let mut medium = medium;
        let is_next = |c: &Option<Crossing>, medium| c.is_some_and(|c| c.near == medium);
        while let Some(next) = self.0.iter_mut().find(|c| is_next(c, medium)) {
            medium = next.take().and_then(|c| c.far);
        }
        medium
    }
}

/// A short ray in roughly direction `dir` through all surfaces that coincide with a hit, and its length.
fn probe(hit: &SurfaceHit, dir: Vec3) -> (Ray, f32) {
    let n = hit.ng * hit.ng.dot(dir).signum();
    let ray = Ray {
        origin: hit.point - n * hit.clearance,
        dir: n,
    };
    (ray, 2.0 * hit.clearance)
}
