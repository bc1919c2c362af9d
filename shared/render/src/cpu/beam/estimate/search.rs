//! Finds the pieces of beams that a bundle of segments, or a single one, may meet. Every comparison is with `LANES`
//! pieces at once.

use super::super::lanes::LANES;
use super::super::store::{Bounds, Cluster, PieceList, PieceTree};
use crate::math::prefetch;

/// What looks for beams: a bundle of segments, or one.
pub(super) trait Probe {
    /// Whether it may meet some piece of a cluster. Never false for one that is met.
    fn may_meet_cluster(&self, cluster: &Cluster, lane: usize) -> bool;
    /// Whether it may meet a piece. Never false for one that is met.
    fn may_meet(&self, piece: Bounds) -> bool;
}

/// A chunk that is yet to be looked at: of the pieces at level 0, above that of the level below in a [`PieceTree`].
pub(super) struct Waiting {
    level: usize,
    chunk: u32,
}

/// Positions of the tree's pieces that may be met, in order.
#[inline(always)]
pub(super) fn find_in_tree(probe: &impl Probe, tree: &PieceTree, stack: &mut Vec<Waiting>, near: &mut Vec<u32>) {
    near.clear();
    stack.clear();
    if tree.pieces.len() > 0 {
        let level = tree.levels.len();
        stack.push(Waiting { level, chunk: 0 });
    }
    while let Some(Waiting { level, chunk }) = stack.pop() {
        let Some(level) = level.checked_sub(1) else {
            find_in_chunk(probe, &tree.pieces, chunk as usize, near);
            continue;
        };
        let cluster = &tree.levels[level][chunk as usize];
        let mut flags = [0u8; LANES];
        for (l, flag) in flags.iter_mut().enumerate() {
            *flag = probe.may_meet_cluster(cluster, l) as u8;
        }
        // In reverse, so that the first is next.
        let first = stack.len();
        for_each_flagged(&flags, |l| {
            let chunk = chunk * LANES as u32 + l;
            stack.push(Waiting { level, chunk });
            // The pieces of all beams do not fit into the caches.
            if level == 0
                && let Some(rows) = tree.pieces.chunks().get(chunk as usize)
            {
                rows.iter().for_each(prefetch);
            }
        });
        stack[first..].reverse();
    }
}

/// Positions of the pieces in a list that may be met.
#[inline(always)]
pub(super) fn find_in_list(probe: &impl Probe, list: &PieceList, near: &mut Vec<u32>) {
    near.clear();
    for chunk in 0..list.chunks().len() {
        find_in_chunk(probe, list, chunk, near);
    }
}

#[inline(always)]
fn find_in_chunk(probe: &impl Probe, list: &PieceList, chunk: usize, near: &mut Vec<u32>) {
    let rows = &list.chunks()[chunk];
    let mut flags = [0u8; LANES];
    for (l, flag) in flags.iter_mut().enumerate() {
        *flag = probe.may_meet(Bounds::of_lane(rows, l)) as u8;
    }
    for_each_flagged(&flags, |l| near.push((chunk * LANES) as u32 + l));
}

#[inline(always)]
fn for_each_flagged(flags: &[u8; LANES], mut with: impl FnMut(u32)) {
    let (words, _) = flags.as_chunks::<8>();
    for (w, word) in words.iter().enumerate() {
        let mut word = u64::from_le_bytes(*word);
        while word != 0 {
            with(w as u32 * 8 + word.trailing_zeros() / 8);
            word &= word - 1;
        }
    }
}
