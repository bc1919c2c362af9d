//! From a bundle of segments and all beams to segments and the beams that each meets.
//!
//! Segments that are near each other are divided and divided again, and so is the list of beams: a list that a bundle
//! is compared with holds what its parent's bounds let through. Blocks of segments that are left meet one beam after
//! another. Where segments are far apart for the width of beams, each looks for its own.

use super::super::lanes::LANES;
use super::super::store::{PieceList, PieceRange, PieceTree};
use super::arrange::part_of;
use super::block::{Block, Shared};
use super::kernels::Kernels;
use super::line::BeamLine;
use super::ray_bundle::RayBundle;
use super::search::{Probe, Waiting, find_in_list, find_in_tree};
use super::vectors::{Found, Work};
use super::{CameraSegment, Gather, Way};
use crate::math::prefetch;

/// A list of beams this short is compared with every block of the bundle; so is a longer one with those of so few
/// segments.
const SHORT: usize = 16 * LANES;
const FEW_SEGMENTS: usize = 4 * LANES;

/// Segments that are farther apart than this many radii of beams meet few of the same: they are looked at one by one.
const APART: f32 = 2.0;

/// How many beams ahead they are fetched from memory.
const FETCH: usize = 8;

/// Adds up the beams' radiance along segments in one medium.
pub(super) struct Sum<'a, 'o> {
    pub gather: &'a Gather<'a>,
    /// At least one.
    pub segments: &'a [CameraSegment],
    pub kernels: Kernels,
    pub vectors: Found,
    /// Called for each block of segments, in order.
    pub out: &'o mut dyn FnMut(&Block),
}

/// A bundle of segments, and the list that it has yet to be compared with.
struct Task<'a> {
    segments: &'a [CameraSegment],
    /// How many lists have been made on the way here.
    level: usize,
}

/// What is kept from bundle to bundle.
struct Packets<'a, 'o> {
    sum: Sum<'a, 'o>,
    shared: Shared<'a>,
    /// All pieces in the medium.
    all: &'a PieceTree,
    /// The bundle that is next is the last.
    tasks: Vec<Task<'a>>,
    /// By depth: the beams that got through.
    levels: Vec<PieceList>,
    /// Of the last list, what the estimate needs to know.
    lines: Vec<BeamLine>,
    /// Of a bundle or a segment, which of a list or of the lines.
    near: Vec<u32>,
    stack: Vec<Waiting>,
}

impl Work for Sum<'_, '_> {
    #[inline(always)]
    fn run(self) {
        let first = &self.segments[0];
        let Some(all) = self.gather.map.tree(first.medium) else {
            for block in self.segments.chunks(LANES) {
                (self.out)(&Block::new(self.gather, block));
            }
            return;
        };
        let segments = self.segments;
        let mut packets = Packets {
            shared: Shared::new(self.gather, first.ray.origin),
            sum: self,
            all,
            tasks: vec![Task { segments, level: 0 }],
            levels: Vec::new(),
            lines: Vec::new(),
            near: Vec::new(),
            stack: Vec::new(),
        };
        while let Some(task) = packets.tasks.pop() {
            packets.take(task);
        }
    }
}

impl<'a> Packets<'a, '_> {
    /// Adds the beams of a bundle, or divides it.
    #[inline(always)]
    fn take(&mut self, Task { segments, level }: Task<'a>) {
        let bundle = RayBundle::new(segments);
        let turned = segments[0].way == Way::Turned;
        let mean_radius = list(&self.levels, level, self.all).mean_radius();
        let apart = bundle.is_wide() || bundle.spread() > APART * mean_radius;
        let is_block = segments.len() <= LANES;
        if !is_block && (bundle.is_wide() || (turned && apart)) {
            self.divide(segments, level);
            return;
        }
        if is_block && apart {
            self.one_by_one(segments, level);
            return;
        }
        self.find(&bundle, level);
        if is_block {
            self.add_near(segments, level);
            return;
        }
        if self.levels.len() == level {
            self.levels.push(PieceList::default());
        }
        let (before, after) = self.levels.split_at_mut(level);
        after[0].select(list(before, level, self.all), &self.near);
        if after[0].len() > SHORT && segments.len() > FEW_SEGMENTS {
            self.divide(segments, level + 1);
        } else {
            self.block_by_block(segments, level);
        }
    }

    #[inline(always)]
    fn divide(&mut self, segments: &'a [CameraSegment], level: usize) {
        let parts = segments.chunks(part_of(segments.len())).rev();
        self.tasks.extend(parts.map(|segments| Task { segments, level }));
    }

    /// Notes which pieces of a list may be met.
    #[inline(always)]
    fn find(&mut self, probe: &impl Probe, level: usize) {
        let list = list(&self.levels, level, self.all);
        match level {
            0 => find_in_tree(probe, self.all, &mut self.stack, &mut self.near),
            _ => find_in_list(probe, list, &mut self.near),
        }
        let group = self.sum.gather.group;
        if group.is_some() {
            let beam = |at: u32| &self.shared.beams[list.ranges()[at as usize].beam as usize];
            self.near.retain(|&at| beam(at).group == group);
        }
    }

    /// Adds beams to a block's segments, each of which looks for its own.
    #[inline(always)]
    fn one_by_one(&mut self, segments: &'a [CameraSegment], level: usize) {
        for segment in segments.chunks(1) {
            self.find(&segment[0], level);
            let mut block = Block::new(self.sum.gather, segment);
            let list = list(&self.levels, level, self.all);
            let add = self.sum.kernels.pieces;
            add(self.sum.vectors, &mut block, &self.shared, list, &self.near);
            (self.sum.out)(&block);
        }
    }

    /// Adds the pieces that were found in a list to one block.
    #[inline(always)]
    fn add_near(&mut self, segments: &'a [CameraSegment], level: usize) {
        let ranges = list(&self.levels, level, self.all).ranges();
        let (near, lines) = (&self.near, &mut self.lines);
        let piece = |i: usize| near.get(i).map(|&at| ranges[at as usize]);
        set_lines(lines, &self.shared, piece);
        self.near.clear();
        self.near.extend(0..self.lines.len() as u32);
        self.add_block(segments);
    }

    /// Adds the pieces of the list that was made last to blocks, each of which is compared with it.
    #[inline(always)]
    fn block_by_block(&mut self, segments: &'a [CameraSegment], level: usize) {
        let ranges = self.levels[level].ranges();
        set_lines(&mut self.lines, &self.shared, |i| ranges.get(i).copied());
        for segments in segments.chunks(LANES) {
            let bundle = RayBundle::new(segments);
            find_in_list(&bundle, &self.levels[level], &mut self.near);
            self.add_block(segments);
        }
    }

    /// Adds the lines that are near to a block.
    #[inline(always)]
    fn add_block(&mut self, segments: &'a [CameraSegment]) {
        let mut block = Block::new(self.sum.gather, segments);
        let (lines, add) = (&self.lines, self.sum.kernels.lines);
        add(self.sum.vectors, &mut block, &self.shared, lines, &self.near);
        (self.sum.out)(&block);
    }
}

/// The list that so many were made before: the first is of all pieces.
#[inline(always)]
fn list<'a>(levels: &'a [PieceList], level: usize, all: &'a PieceTree) -> &'a PieceList {
    match level.checked_sub(1) {
        Some(made) => &levels[made],
        None => &all.pieces,
    }
}

/// What the estimate needs to know of pieces; `piece` gives one by its number while there are more.
#[inline(always)]
fn set_lines(lines: &mut Vec<BeamLine>, shared: &Shared, piece: impl Fn(usize) -> Option<PieceRange>) {
    lines.clear();
    while let Some(range) = piece(lines.len()) {
        if let Some(next) = piece(lines.len() + FETCH) {
            prefetch(&shared.beams[next.beam as usize]);
        }
        lines.push(BeamLine::new(shared, range));
    }
}
