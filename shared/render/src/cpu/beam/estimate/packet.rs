//! From a bundle of segments and all beams to the beams that each segment meets.
//!
//! Segments that are near each other are divided again and again, and so is the list of beams: a bundle is compared
//! with a list that holds what its parent's bounds let through. The remaining blocks of segments meet one beam after
//! another. Where segments are far apart compared with the width of beams, each looks for its own.

use super::super::lanes::LANES;
use super::super::store::PieceList;
use super::arrange::part_of;
use super::line::{BeamLine, Block, Shared};
use super::ray_bundle::RayBundle;
use super::search::{Waiting, find_in_list, find_in_tree};
use super::{CameraSegment, Gather, Way};
use crate::math::prefetch;
use crate::world::spectrum::WaveNumber;

/// A list of beams this short is compared with every block of the bundle. A bundle of few segments does so with a
/// longer list as well.
const SHORT: usize = 16 * LANES;
const FEW_SEGMENTS: usize = 4 * LANES;

/// Segments that are more than this many beam radii apart have few beams in common, and are handled one by one.
const APART: f32 = 2.0;

/// How many beams ahead data are fetched from memory.
const FETCH_NUMBER: usize = 8;
const FETCH_STEPS: usize = 3;

/// A bundle of segments and the number of its list.
struct Task<'a> {
    segments: &'a [CameraSegment],
    /// How many lists were made on the way here.
    level: usize,
}

/// Adds up the beams' radiance along segments in one medium. `out` is called for each block of segments, in order.
//
// One long function: split into parts that shared a record, it took 4 to 9 % more instructions, because that record
// then lived in memory.
#[inline(always)]
pub(super) fn sum<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
    gather: &Gather,
    segments: &[CameraSegment],
    out: &mut dyn FnMut(&Block),
) {
    let map = gather.map;
    let beams = map.beams();
    let shared = Shared::new(gather, segments);
    let Some(all) = map.tree(segments[0].medium) else {
        for block in segments.chunks(LANES) {
            out(&Block::new(gather, block));
        }
        return;
    };
    // `levels`: the beams that got through, by depth. `lines`: the last list, prepared for the estimate. `near`: which
    // of a list a bundle or a segment may meet.
    let mut levels: Vec<PieceList> = Vec::new();
    let mut lines: Vec<BeamLine> = Vec::new();
    let mut stack: Vec<Waiting> = Vec::new();
    let mut near: Vec<u32> = Vec::new();
    let mut tasks = vec![Task { segments, level: 0 }];
    while let Some(Task { segments, level }) = tasks.pop() {
        let bundle = RayBundle::new(segments);
        let mut divide = |level| {
            let parts = segments.chunks(part_of(segments.len())).rev();
            tasks.extend(parts.map(|segments| Task { segments, level }));
        };
        if levels.len() == level {
            levels.push(PieceList::default());
        }
        let (before, after) = levels.split_at_mut(level);
        let list = before.last().unwrap_or(&all.pieces);
        let found = &mut after[0];
        let turned = segments[0].way == Way::Turned;
        let apart = bundle.is_wide() || bundle.spread() > APART * list.mean_radius();
        if segments.len() > LANES && (bundle.is_wide() || (turned && apart)) {
            divide(level);
            continue;
        }
        let of_group = |near: &mut Vec<u32>, list: &PieceList| {
            let group = gather.group;
            if group.is_some() {
                near.retain(|&at| beams[list.ranges()[at as usize].beam as usize].group == group);
            }
            if let Some(wave) = gather.wave {
                let is_seen = |of: Option<WaveNumber>| of.is_none_or(|of| of == wave);
                near.retain(|&at| is_seen(beams[list.ranges()[at as usize].beam as usize].wave));
            }
        };
        if segments.len() <= LANES && apart {
            for segment in segments.chunks(1) {
                match level {
                    0 => find_in_tree(&segment[0], all, &mut stack, &mut near),
                    _ => find_in_list(&segment[0], list, &mut near),
                }
                of_group(&mut near, list);
                let mut block = Block::new(gather, segment);
                block.add_beams::<GREY, LOBES, VARYING>(&shared, beams, list, &near);
                out(&block);
            }
            continue;
        }
        match level {
            0 => find_in_tree(&bundle, all, &mut stack, &mut near),
            _ => find_in_list(&bundle, list, &mut near),
        }
        of_group(&mut near, list);
        if segments.len() <= LANES {
            let mut block = Block::new(gather, segments);
            for (i, &at) in near.iter().enumerate() {
                if let Some(&next) = near.get(i + FETCH_NUMBER) {
                    prefetch(&beams[list.ranges()[next as usize].beam as usize]);
                }
                let line = shared.line(beams, list.ranges()[at as usize]);
                block.add::<GREY, LOBES, VARYING, PINHOLE>(&shared, beams, &line);
            }
            out(&block);
            continue;
        }
        found.select(list, &near);
        if found.len() > SHORT && segments.len() > FEW_SEGMENTS {
            divide(level + 1);
            continue;
        }
        lines.clear();
        for (i, &piece) in found.ranges().iter().enumerate() {
            if let Some(next) = found.ranges().get(i + FETCH_NUMBER) {
                prefetch(&beams[next.beam as usize]);
            }
            lines.push(shared.line(beams, piece));
        }
        for segments in segments.chunks(LANES) {
            let mut block = Block::new(gather, segments);
            let bundle = RayBundle::new(segments);
            find_in_list(&bundle, found, &mut near);
            for (i, &at) in near.iter().enumerate() {
                if VARYING {
                    if let Some(&next) = near.get(i + FETCH_NUMBER) {
                        let steps = lines[next as usize].steps;
                        shared.beam_steps.prefetch_number(steps);
                    }
                    if let Some(&next) = near.get(i + FETCH_STEPS) {
                        shared.beam_steps.prefetch(lines[next as usize].steps);
                    }
                }
                let line = &lines[at as usize];
                block.add::<GREY, LOBES, VARYING, PINHOLE>(&shared, beams, line);
            }
            out(&block);
        }
    }
}
