//! Glass solids and liquids that overlap or touch, and media without a surface that overlap.
//!
//! Juice is modelled into the wall of its glass, ice into water. Where solids overlap, the one with the highest
//! priority counts (Schmidt and Budge 2002, Simple nested dielectrics in ray traced images), and the visible surface is
//! where that changes. Rays carry no stack of the solids they are in. Instead the two sides of a surface are determined
//! where it is met, so that light paths from lights and from the camera agree on them.
//!
//! Media without a surface add up where they overlap.
//!
//! `pairs` finds the meetings, `mixture` makes the surfaces between solids and the sums of media, `at_hit` finds what a
//! ray meets.

mod at_hit;
mod mixture;
mod pairs;

use std::collections::BTreeMap;

/// How two solids meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// Part of one is inside the other, part is not.
    Crossing,
    /// Their surfaces coincide.
    Touching,
    /// One is inside the other.
    Within,
}

/// Two objects that meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Met {
    /// Indices of the objects, in order.
    pub pair: [u32; 2],
    /// How they meet.
    pub meeting: Meeting,
    /// The result.
    pub outcome: Outcome,
}

/// Which of two meeting objects counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// One of them.
    GivesWay {
        /// Index of the object that remains.
        to: u32,
        /// The reason.
        reason: Reason,
    },
    /// Both media. If not `is_exact`, the phase function only approximates that of the sum.
    AddUp {
        /// Whether the phase function is that of the sum.
        is_exact: bool,
    },
    /// The medium entered last, because one of them has a varying density.
    Unsummed,
    /// The object entered last, because one of them is inside out or lets light pass by chance.
    Unresolved,
}

/// Why one of two solids remains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The scene says so.
    Priority,
    /// The other one contains a medium, as liquids do.
    Medium,
    /// It has the higher index of refraction.
    Index,
    /// It comes first in the scene.
    Order,
}

/// Most media that add up at one place.
const MOST_ADDED: usize = 4;
/// Stands for no member or material.
const NONE: u32 = u32::MAX;

/// Media at a place, in order, padded with `u16::MAX`.
type MediaSet = [u16; MOST_ADDED];

/// All meetings in a scene.
#[derive(Debug, Default)]
pub(crate) struct Meetings {
    /// For reports to users.
    met: Vec<Met>,
    /// Some pairs may be missing.
    is_cut: bool,
    /// By pair of objects: where places on each surface lie relative to the other object.
    looks: BTreeMap<[u32; 2], [pairs::Look; 2]>,
    /// By object: its member number, or `NONE`. Empty if there are none.
    numbers: Vec<u32>,
    members: Vec<Member>,
    /// By set of media: the medium that is their sum.
    sums: BTreeMap<MediaSet, u16>,
}

/// An object that meets others.
#[derive(Debug)]
struct Member {
    object: u32,
    /// Of two, the one with the higher rank remains; media with the same rank add up.
    rank: u32,
    /// It is a pure boundary of a medium.
    is_null: bool,
    /// Largest distance between surfaces that count as coincident; scene units.
    reach: f32,
    /// The members that it meets.
    partners: Vec<Partner>,
}

#[derive(Debug)]
struct Partner {
    member: u32,
    /// Material of the member's surface where the partner is outside. `NONE`: the partner has the higher rank, or there
    /// is no surface.
    material: u32,
}

impl Meetings {
    /// Whether there is nothing to check.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Number of objects that meetings change.
    pub(crate) fn count(&self) -> usize {
        self.members.len()
    }

    /// Whether an object is one of them.
    #[inline]
    pub(crate) fn has(&self, object: u32) -> bool {
        self.member(object).is_some()
    }

    fn member(&self, object: u32) -> Option<&Member> {
        let number = self.numbers.get(object as usize)?;
        self.members.get(*number as usize)
    }
}

impl super::Scene {
    /// All meetings, by pair of objects: refracting solids that overlap or touch, and media that overlap. Solids
    /// entirely inside others, such as bubbles, do not count unless priorities order them; nor do open surfaces, such
    /// as that between water and its glass.
    pub fn meeting_solids(&self) -> &[Met] {
        &self.meetings.met
    }

    /// Whether there are so many that some were not examined.
    pub fn meets_too_many(&self) -> bool {
        self.meetings.is_cut
    }
}
