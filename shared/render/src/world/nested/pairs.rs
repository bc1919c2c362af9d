//! Which objects meet, and which of two remains.

use super::{Meeting, Meetings, Member, Met, NONE, Outcome, Partner, Reason};
use crate::math::{Ray, Vec3};
use crate::parallel;
use crate::world::Scene;
use crate::world::bsdf::{BsdfFlags, LINE_D};
use crate::world::crossing::places_on;
use crate::world::geometry::clearance;
use crate::world::medium::Medium;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Most solids and pairs examined: nobody models more glass by hand.
const MOST_SOLIDS: usize = 2000;
const MOST_PAIRS: usize = 2000;
/// Largest distance between touching surfaces, relative to the smaller object.
const NEAR: f32 = 1e-4;
/// Least number of test places on both sides of a crossed object, and on a touched one.
const LEAST_CROSSING: u32 = 2;
const LEAST_TOUCHING: u32 = 16;
/// Largest distance between coincident surfaces, in clearances: each has its own rounding.
pub(super) const APART: f32 = 4.0;
/// But no more than this share of the smaller object.
const MOST_APART: f32 = 1e-3;

/// Where places on one object's surface lie relative to another object.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    inside: u32,
    outside: u32,
    /// On its surface, with both insides on the same side.
    along: u32,
    /// On its surface, with the insides on opposite sides.
    against: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Refracts light.
    Solid,
    /// A medium without a surface.
    Cloud,
}

impl Scene {
    /// All meetings. `known`: a scene whose looks can be reused for pairs of unchanged shapes. The materials between
    /// objects are made later.
    pub(in crate::world) fn find_meetings(&self, known: Option<&Self>) -> Meetings {
        let of_kind = |kind: Kind| {
            let objects = 0..self.objects().len() as u32;
            objects.filter(move |object| self.kind(*object) == Some(kind))
        };
        let (mut pairs, mut is_cut) = (Vec::new(), false);
        for kind in [Kind::Solid, Kind::Cloud] {
            let objects: Vec<u32> = of_kind(kind).take(MOST_SOLIDS + 1).collect();
            is_cut |= objects.len() > MOST_SOLIDS;
            pairs.extend(self.pairs_of(&objects[..objects.len().min(MOST_SOLIDS)], kind));
        }
        is_cut |= pairs.len() > MOST_PAIRS;
        pairs.truncate(MOST_PAIRS);
        let look = |pair: &[u32; 2]| {
            let known = known.filter(|known| pair.iter().all(|object| self.has_shape_of(known, *object)));
            let known = known.and_then(|known| known.meetings.looks.get(pair)).copied();
            let [a, b] = *pair;
            known.unwrap_or_else(|| [self.look(a, b), self.look(b, a)])
        };
        let looks = parallel::collected(pairs.par_iter().map(look));
        let met = pairs.iter().zip(&looks);
        let met = met.filter_map(|(pair, looks)| self.met(*pair, looks)).collect();
        let mut meetings = Meetings {
            met,
            is_cut,
            looks: pairs.into_iter().zip(looks).collect(),
            ..Meetings::default()
        };
        self.enlist(&mut meetings);
        meetings
    }

    /// What an object could meet others as, if anything.
    fn kind(&self, object: u32) -> Option<Kind> {
        let of = &self.objects()[object as usize];
        let material = self.material_of(object);
        if of.light.is_some() || !material.has(BsdfFlags::BOUNDS_MEDIA) {
            return None;
        }
        match material.is_null() {
            true => {
                let is_filled = of
                    .boundary
                    .filter(|of| of.interior.is_some() && of.interior != of.exterior);
                is_filled.map(|_| Kind::Cloud)
            }
            false => material.has(BsdfFlags::REFRACTS).then_some(Kind::Solid),
        }
    }

    /// Pairs of these objects whose boxes overlap; for clouds, only with the same surroundings.
    fn pairs_of(&self, objects: &[u32], kind: Kind) -> Vec<[u32; 2]> {
        let meets = |a: u32, b: u32| {
            let ((low, high), (other_low, other_high)) = (self.boxes[a as usize], self.boxes[b as usize]);
            let exterior = |object: u32| self.objects()[object as usize].boundary.map(|of| of.exterior);
            low.cmple(other_high).all()
                && other_low.cmple(high).all()
                && (kind == Kind::Solid || exterior(a) == exterior(b))
        };
        let pairs = objects.iter().enumerate().flat_map(|(i, a)| {
            let others = objects[i + 1..].iter().filter(move |b| meets(*a, **b));
            others.map(move |b| [*a, *b])
        });
        pairs.take(MOST_PAIRS + 1).collect()
    }

    /// Whether an object of another scene has the same shape.
    fn has_shape_of(&self, other: &Self, object: u32) -> bool {
        let own = &self.objects()[object as usize].shape;
        let other = other.objects().get(object as usize);
        other.is_some_and(|other| own.is_same(&other.shape))
    }

    fn look(&self, one: u32, other: u32) -> Look {
        let near = NEAR * self.extents[one as usize].min(self.extents[other as usize]);
        let mut look = Look::default();
        for place in places_on(&self.objects()[one as usize]) {
            let is_inside = |side: f32| self.is_inside(other, place.point + place.normal * (side * near));
            *match [1.0, -1.0].map(is_inside) {
                [true, true] => &mut look.inside,
                [false, false] => &mut look.outside,
                [false, true] => &mut look.along,
                [true, false] => &mut look.against,
            } += 1;
        }
        look
    }

    /// Whether a point is inside a closed object: determined by the side from which a ray first meets its surface.
    pub(super) fn is_inside(&self, object: u32, point: Vec3) -> bool {
        let (low, high) = self.boxes[object as usize];
        if !(point.cmpge(low).all() && point.cmple(high).all()) {
            return false;
        }
        // A direction that is parallel to nothing people model.
        let ray = Ray {
            origin: point,
            dir: Vec3::new(0.408_2, 0.267_3, 0.872_9).normalize(),
        };
        let is_other = |other: u32| other != object;
        let hit = (self.geometry).intersect(self.objects(), &ray, f32::INFINITY, &is_other);
        hit.is_some_and(|hit| hit.ng.dot(ray.dir) > 0.0)
    }

    /// How a pair meets, if it does, and the outcome.
    fn met(&self, pair: [u32; 2], looks: &[Look; 2]) -> Option<Met> {
        let [a, b] = pair.map(|object| &self.objects()[object as usize]);
        let is_cloud = self.kind(pair[0])? == Kind::Cloud;
        let has_priority = a.priority.is_some() || b.priority.is_some();
        let on = |look: &Look| {
            if is_cloud {
                look.along
            } else {
                look.along + look.against
            }
        };
        let meeting = match () {
            () if looks
                .iter()
                .any(|look| look.inside >= LEAST_CROSSING && look.outside >= LEAST_CROSSING) =>
            {
                Meeting::Crossing
            }
            () if looks.iter().any(|look| on(look) >= LEAST_TOUCHING) => Meeting::Touching,
            () if (is_cloud || has_priority) && looks.iter().any(|look| look.inside >= LEAST_CROSSING) => {
                Meeting::Within
            }
            () => return None,
        };
        // The slowest test.
        if ![a, b].iter().all(|object| object.shape.is_closed()) {
            return None;
        }
        let is_whole = |object: u32| {
            let is_passed = !is_cloud && self.material_of(object).has(BsdfFlags::PASSABLE);
            !is_passed && !self.objects()[object as usize].shape.is_inside_out()
        };
        if !pair.into_iter().all(is_whole) {
            let outcome = Outcome::Unresolved;
            return (!is_cloud).then_some(Met { pair, meeting, outcome });
        }
        let [first, second] = pair;
        let outcome = match (self.compare(first, second), is_cloud) {
            ((Ordering::Greater, reason), _) => Outcome::GivesWay { to: first, reason },
            ((Ordering::Less, reason), _) => Outcome::GivesWay { to: second, reason },
            ((Ordering::Equal, _), true) => {
                let media = [a, b].map(|object| object.boundary.and_then(|boundary| boundary.interior));
                let is_even = |id: &u16| matches!(self.media()[usize::from(*id)], Medium::Homogeneous(_));
                match media.iter().flatten().all(is_even) {
                    true => Outcome::AddUp { is_exact: true },
                    false if meeting == Meeting::Crossing => Outcome::Unsummed,
                    false => return None,
                }
            }
            ((Ordering::Equal, reason), false) => Outcome::GivesWay { to: first, reason },
        };
        // A bubble remains although its surroundings rank higher.
        let inner = if looks[0].inside >= LEAST_CROSSING {
            first
        } else {
            second
        };
        let vanishes = matches!(outcome, Outcome::GivesWay { to, .. } if to != inner);
        let is_meant = a.priority.is_some() && b.priority.is_some();
        if meeting == Meeting::Within && !is_cloud && vanishes && !is_meant {
            return None;
        }
        Some(Met { pair, meeting, outcome })
    }

    /// Which of two remains, and why. Equal for media that add up.
    fn compare(&self, one: u32, other: u32) -> (Ordering, Reason) {
        let [a, b] = [one, other].map(|object| &self.objects()[object as usize]);
        let by_priority = a.priority.unwrap_or(0).cmp(&b.priority.unwrap_or(0));
        if by_priority != Ordering::Equal || self.is_null(one) {
            return (by_priority, Reason::Priority);
        }
        let is_filled = |object: u32| {
            let boundary = self.objects()[object as usize].boundary;
            boundary.is_some_and(|boundary| boundary.interior.is_some())
        };
        if is_filled(one) != is_filled(other) {
            return (is_filled(other).cmp(&is_filled(one)), Reason::Medium);
        }
        let index = |object: u32| {
            self.material_of(object)
                .index_inside()
                .map_or(1.0, |index| index.at(LINE_D))
        };
        match index(one).total_cmp(&index(other)) {
            Ordering::Equal => (other.cmp(&one), Reason::Order),
            by_index => (by_index, Reason::Index),
        }
    }

    /// Makes members of objects whose meeting has an effect.
    fn enlist(&self, meetings: &mut Meetings) {
        let counts = |met: &&Met| matches!(met.outcome, Outcome::GivesWay { .. } | Outcome::AddUp { .. });
        let mut partners: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for Met { pair: [a, b], .. } in meetings.met.iter().filter(counts) {
            partners.entry(*a).or_default().push(*b);
            partners.entry(*b).or_default().push(*a);
        }
        if partners.is_empty() {
            return;
        }
        let mut ranked: Vec<u32> = partners.keys().copied().collect();
        ranked.sort_by(|a, b| (self.is_null(*a).cmp(&self.is_null(*b))).then_with(|| self.compare(*a, *b).0));
        let mut rank = 0;
        let mut ranks = BTreeMap::new();
        for (i, object) in ranked.iter().enumerate() {
            let is_equal = |before: &u32| {
                self.is_null(*before) == self.is_null(*object) && self.compare(*before, *object).0 == Ordering::Equal
            };
            if i > 0 && !is_equal(&ranked[i - 1]) {
                rank += 1;
            }
            ranks.insert(*object, rank);
        }
        meetings.numbers = vec![NONE; self.objects().len()];
        for (number, object) in (0..).zip(partners.keys()) {
            meetings.numbers[*object as usize] = number;
        }
        let own_reach = |object: u32| {
            let (low, high) = self.boxes[object as usize];
            APART * clearance(low.abs().max(high.abs()).max_element())
        };
        let member = |(object, partners): (&u32, &Vec<u32>)| Member {
            object: *object,
            rank: ranks[object],
            is_null: self.is_null(*object),
            reach: {
                let all = || partners.iter().chain([object]);
                let size = all().fold(f32::INFINITY, |size, object| self.extents[*object as usize].min(size));
                let reach = all().fold(0.0, |reach: f32, object| own_reach(*object).max(reach));
                reach.min(MOST_APART * size)
            },
            partners: (partners.iter())
                .map(|partner| Partner {
                    member: meetings.numbers[*partner as usize],
                    material: NONE,
                })
                .collect(),
        };
        meetings.members = partners.iter().map(member).collect();
    }
}
