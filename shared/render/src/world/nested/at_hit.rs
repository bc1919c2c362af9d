//! What a ray meets where objects overlap or touch.

use super::{Member, NONE, Partner};
use crate::math::{Ray, Vec3};
use crate::world::Scene;
use crate::world::geometry::{Boundary, SurfaceHit};
use crate::world::medium::MediumId;

/// Most hidden surfaces that a ray passes.
const MOST_PASSED: usize = 1000;
/// Most members on one side of a surface; beyond that, the highest-ranking are kept.
const MOST: usize = 8;

impl Scene {
    /// The first surface that a ray meets within a distance, ignoring the passed objects. Where a solid gives way to
    /// another, its surface is hidden. The hit says which material is there and what is on its sides.
    #[inline]
    pub(crate) fn meets(&self, ray: &Ray, t_max: f32, is_passed: &dyn Fn(u32) -> bool) -> Option<SurfaceHit> {
        let hit = (self.geometry).intersect(self.objects(), ray, t_max, is_passed)?;
        match self.meetings.is_empty() {
            true => Some(hit),
            false => self.first_there(hit, ray, t_max, is_passed),
        }
    }

    #[inline(never)]
    fn first_there(
        &self,
        mut hit: SurfaceHit,
        ray: &Ray,
        t_max: f32,
        is_passed: &dyn Fn(u32) -> bool,
    ) -> Option<SurfaceHit> {
        for _ in 0..MOST_PASSED {
            if let Some(there) = self.there(&hit, is_passed) {
                return Some(there);
            }
            let beyond = hit.spawn_ray(ray.dir);
            let gone = (beyond.origin - ray.origin).dot(ray.dir).max(0.0);
            let next = (self.geometry).intersect(self.objects(), &beyond, t_max - gone, is_passed)?;
            hit = SurfaceHit {
                t: gone + next.t,
                ..next
            };
        }
        None
    }

    /// The surface at a hit, if there is one. `is_passed`: objects absent for the ray.
    pub(in crate::world) fn there(&self, hit: &SurfaceHit, is_passed: &dyn Fn(u32) -> bool) -> Option<SurfaceHit> {
        let Some(own) = self.meetings.member(hit.object) else {
            return Some(*hit);
        };
        let reach = own.reach.max(super::pairs::APART * hit.clearance);
        // Points behind and in front of it.
        let sides = [-reach, reach].map(|way| hit.point + hit.ng * way);
        let mut on = [Heap::of(Some(own)), Heap::of(None)];
        let mut lies_on_other = false;
        for partner in &own.partners {
            let member = &self.meetings.members[partner.member as usize];
            if is_passed(member.object) {
                continue;
            }
            let holds = sides.map(|point| self.is_inside(member.object, point));
            lies_on_other |= holds[0] != holds[1];
            for (heap, _) in on.iter_mut().zip(holds).filter(|(_, holds)| *holds) {
                heap.add(member);
            }
        }
        let mut there = match own.is_null {
            true => SurfaceHit {
                boundary: hit.boundary.map(|boundary| Boundary {
                    interior: self.medium_of(&on[0]).or(boundary.interior),
                    exterior: self.medium_of(&on[1]).or(boundary.exterior),
                }),
                ..*hit
            },
            false => self.between(hit, sides, on.map(|heap| heap.highest()))?,
        };
        if lies_on_other {
            // Rays that leave it leave both surfaces.
            there.clearance = there.clearance.max(2.0 * reach);
        }
        Some(there)
    }

    /// Whether a point near an object is inside one of its partners.
    pub(in crate::world) fn is_in_partner(&self, object: u32, point: Vec3) -> bool {
        let partners = self.meetings.member(object).map(|member| &member.partners);
        let members = partners
            .into_iter()
            .flatten()
            .map(|partner| &self.meetings.members[partner.member as usize]);
        members.into_iter().any(|member| self.is_inside(member.object, point))
    }

    /// The medium where media add up.
    fn medium_of(&self, heap: &Heap<'_>) -> MediumId {
        let interior = |member: &Member| {
            let boundary = self.objects()[member.object as usize].boundary;
            boundary.and_then(|boundary| boundary.interior)
        };
        let highest = heap.all().map(|member| member.rank).max();
        let adds = heap.all().filter(|member| Some(member.rank) == highest);
        self.meetings.sum_of(adds.filter_map(interior))
    }

    /// The surface between two solids, or between one and nothing.
    fn between(&self, hit: &SurfaceHit, sides: [Vec3; 2], on: [Option<&Member>; 2]) -> Option<SurfaceHit> {
        let rank = |member: Option<&Member>| member.map(|member| member.rank);
        if rank(on[0]) == rank(on[1]) {
            return None;
        }
        let is_behind = rank(on[0]) > rank(on[1]);
        let ([from, to], [higher, other]) = match is_behind {
            true => ([sides[1], sides[0]], on),
            false => (sides, [on[1], on[0]]),
        };
        let higher = higher?;
        let mut there = *hit;
        if hit.object != higher.object {
            // The surface is that of the higher one, which coincides here.
            let way = to - from;
            let across = Ray {
                origin: from,
                dir: way.normalize(),
            };
            let is_passed = |object: u32| object != higher.object;
            if let Some(own) = (self.geometry).intersect(self.objects(), &across, way.length(), &is_passed) {
                there = SurfaceHit { t: hit.t, ..own };
            }
        }
        let Some(other) = other else { return Some(there) };
        let found = |partner: &&Partner| self.meetings.members[partner.member as usize].object == other.object;
        let material = higher.partners.iter().find(found).map(|partner| partner.material);
        if let Some(material) = material.filter(|material| *material != NONE) {
            there.material = material;
        }
        let boundary = |member: &Member| self.objects()[member.object as usize].boundary;
        // An object that keeps its medium is filled by the surroundings of the other one.
        there.boundary = match (boundary(higher), boundary(other)) {
            (None, None) => None,
            (own, around) => Some(Boundary {
                interior: own.map_or(around.and_then(|of| of.exterior), |of| of.interior),
                exterior: around.map_or(own.and_then(|of| of.exterior), |of| of.interior),
            }),
        };
        Some(there)
    }
}

/// The members on one side of a surface.
struct Heap<'a>([Option<&'a Member>; MOST]);

impl<'a> Heap<'a> {
    fn of(first: Option<&'a Member>) -> Self {
        let mut all = [None; MOST];
        all[0] = first;
        Self(all)
    }

    /// Takes a free place, or that of the lowest-ranking member.
    fn add(&mut self, member: &'a Member) {
        let rank = |place: &&mut Option<&Member>| place.map(|member| member.rank);
        if let Some(place) = self.0.iter_mut().min_by_key(rank)
            && place.is_none_or(|lowest| lowest.rank < member.rank)
        {
            *place = Some(member);
        }
    }

    fn all(&self) -> impl Iterator<Item = &'a Member> + Clone {
        self.0.into_iter().flatten()
    }

    fn highest(&self) -> Option<&'a Member> {
        self.all().max_by_key(|member| member.rank)
    }
}
