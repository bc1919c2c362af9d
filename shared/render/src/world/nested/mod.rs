//! Solids of glass and liquids that reach into each other, or touch, and media without a surface that overlap.
//!
//! Juice is modelled into the wall of its glass, ice into water. Where several solids are, the one of the highest
//! priority is what is there (Schmidt and Budge 2002, Simple nested dielectrics in ray traced images), and a surface is
//! where that changes. No ray carries a stack of what it is in: what is on either side of a surface is asked for where
//! it is met, so that all light paths, from lights and from the camera, agree on it wherever they come from.
//!
//! Media without a surface add up where they overlap.
//!
//! `pairs` finds what meets, `mixture` makes what is between and where media add up, `at_hit` finds what a ray meets.

mod at_hit;
mod mixture;
mod pairs;

use std::collections::BTreeMap;

/// How two solids meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// Part of one is inside of the other, and part is not.
    Crossing,
    /// Their surfaces lie on each other.
    Touching,
    /// One is inside of the other.
    Within,
}

/// Two objects that meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Met {
    /// Indices of the objects, in order.
    pub pair: [u32; 2],
    /// How they meet.
    pub meeting: Meeting,
    /// What comes of it.
    pub outcome: Outcome,
}

/// What is there where two objects are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// One of them.
    GivesWay {
        /// Index of the object that stays.
        to: u32,
        /// Why it does.
        reason: Reason,
    },
    /// Both media. `is_exact`: or the phase function is not that of their sum, but a like one.
    AddUp {
        /// It is that of their sum.
        is_exact: bool,
    },
    /// The medium that was entered last: one of them has a density that varies.
    Unsummed,
    /// What was entered last: one of them is inside out, or lets light pass by chance.
    Unresolved,
}

/// Why one of two solids is what is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The scene says so.
    Priority,
    /// The other one has a medium inside, as liquids do.
    Medium,
    /// It is of a higher index of refraction.
    Index,
    /// It comes first.
    Order,
}

/// Media that add up at one place, at most.
const MOST_ADDED: usize = 4;
/// Stands for none.
const NONE: u32 = u32::MAX;

/// Media at a place, in order; the rest is `u16::MAX`.
type MediaSet = [u16; MOST_ADDED];

/// All that meet in a scene.
#[derive(Debug, Default)]
pub(crate) struct Meetings {
    /// For people.
    met: Vec<Met>,
    /// There may be more.
    is_cut: bool,
    /// By pair of objects: how one stands to the other, and the other to the one, by places on their surfaces.
    looks: BTreeMap<[u32; 2], [pairs::Look; 2]>,
    /// By object: which of the members it is, or `NONE`. Empty where there are none.
    numbers: Vec<u32>,
    members: Vec<Member>,
    /// The medium of media that add up.
    sums: BTreeMap<MediaSet, u16>,
}

/// An object that meets others.
#[derive(Debug)]
struct Member {
    object: u32,
    /// Of two, the one of the higher rank is what is there; media of the same rank add up.
    rank: u32,
    /// It is the boundary of a medium and nothing else.
    is_null: bool,
    /// How far apart surfaces are that lie on each other, at most; scene units.
    reach: f32,
    /// Those that it meets.
    partners: Vec<Partner>,
}

#[derive(Debug)]
struct Partner {
    member: u32,
    /// What the member's surface is made of where the partner is outside: a material. `NONE`: the partner is of higher
    /// rank, or there is no surface.
    material: u32,
}

impl Meetings {
    /// Whether nothing has to be looked at.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Objects that are not what they are by themselves everywhere.
    pub(crate) fn count(&self) -> usize {
        self.members.len()
    }

    /// Whether an object is one of these.
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
    /// What meets, by pairs of objects: solids of glass, or of what else bends light, that reach into each other or
    /// touch, and media that overlap. Solids that are all within others, as bubbles are, do not, unless priorities
    /// say what is there; nor do surfaces that are open, as those between water and its glass.
    pub fn meeting_solids(&self) -> &[Met] {
        &self.meetings.met
    }

    /// Whether there are so many that some were not looked at.
    pub fn meets_too_many(&self) -> bool {
        self.meetings.is_cut
    }
}
