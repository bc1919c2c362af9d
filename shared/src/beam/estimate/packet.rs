//! From a bundle of segments and all beams to blocks of segments and the beams that may matter to each.
//!
//! The segments are halved and halved again, and so is the list of beams: a list that a bundle is compared with holds what
//! its parent's bounds let through. Every comparison is of one bundle with as many beams as there are lanes.

use super::super::store::BoundsColumns;
use super::bundle::Bundle;
use super::line::{BeamLine, Block, Shared};
use super::{CameraSegment, Gather, LANES};
use crate::math::prefetch;

/// A list of beams this short is compared with every block.
const SHORT: usize = 64 * LANES;

/// Parts that a bundle is divided into: a tile's quarters are tiles as well.
const PARTS: usize = 4;

/// How many beams ahead what is known along a beam is fetched from memory.
const FETCH_NUMBER: usize = 8;
const FETCH_STEPS: usize = 3;

/// A bundle of segments, and the list that it has yet to be compared with.
struct Task<'a> {
    segments: &'a [CameraSegment],
    /// How many lists have been made on the way here.
    level: usize,
}

/// Adds up the beams' radiance along segments in one medium. `out` is called for each block of segments, in order.
#[inline(always)]
pub(super) fn sum<
    const GREY: bool,
    const LOBES: usize,
    const VARYING: bool,
    const PINHOLE: bool,
>(
    gather: &Gather,
    segments: &[CameraSegment],
    out: &mut dyn FnMut(&Block),
) {
    let map = gather.map;
    let beams = map.beams();
    let shared = Shared::new(gather, segments[0].ray.origin);
    let Some(all) = map.bounds(segments[0].medium) else {
        for block in segments.chunks(LANES) {
            out(&Block::new(gather, block));
        }
        return;
    };
    // By depth: the beams that got through; of the last list, what the estimate needs to know; of a block, which of them.
    let mut levels: Vec<BoundsColumns> = Vec::new();
    let mut lines: Vec<BeamLine> = Vec::new();
    let mut near: Vec<u32> = Vec::new();
    let mut tasks = vec![Task { segments, level: 0 }];
    while let Some(Task { segments, level }) = tasks.pop() {
        let bundle = Bundle::new(segments);
        let part = segments.len().div_ceil(PARTS).next_multiple_of(LANES);
        let mut divide = |level| {
            let parts = segments.chunks(part).rev();
            tasks.extend(parts.map(|segments| Task { segments, level }));
        };
        if segments.len() > LANES && bundle.is_wide() {
            divide(level);
            continue;
        }
        if levels.len() == level {
            levels.push(BoundsColumns::default());
        }
        let (before, after) = levels.split_at_mut(level);
        let list = before.last().unwrap_or(all);
        let found = &mut after[0];
        each_near(&bundle, list, &mut near);
        if let Some(group) = gather.group {
            near.retain(|&at| beams[list.indices()[at as usize] as usize].group == group);
        }
        if segments.len() <= LANES {
            let mut block = Block::new(gather, segments);
            for (i, &at) in near.iter().enumerate() {
                if let Some(&next) = near.get(i + FETCH_NUMBER) {
                    prefetch(&beams[list.indices()[next as usize] as usize]);
                }
                let index = list.indices()[at as usize];
                let line = shared.line(&beams[index as usize], index);
                block.add::<GREY, LOBES, VARYING, PINHOLE>(&shared, beams, &line);
            }
            out(&block);
            continue;
        }
        found.select(list, &near);
        if found.len() > SHORT {
            divide(level + 1);
            continue;
        }
        lines.clear();
        for &index in found.indices() {
            lines.push(shared.line(&beams[index as usize], index));
        }
        for segments in segments.chunks(LANES) {
            let mut block = Block::new(gather, segments);
            each_near(&Bundle::new(segments), found, &mut near);
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

/// The positions in the list of the beams that may meet a segment of the bundle.
#[inline(always)]
fn each_near(bundle: &Bundle, list: &BoundsColumns, near: &mut Vec<u32>) {
    near.clear();
    for (i, beams) in list.chunks().enumerate() {
        let mut flags = [0u8; LANES];
        for (l, flag) in flags.iter_mut().enumerate() {
            *flag = bundle.may_meet(beams.get(l)) as u8;
        }
        let (words, _) = flags.as_chunks::<8>();
        for (w, word) in words.iter().enumerate() {
            let mut word = u64::from_le_bytes(*word);
            while word != 0 {
                near.push((i * LANES + w * 8) as u32 + word.trailing_zeros() / 8);
                word &= word - 1;
            }
        }
    }
}
