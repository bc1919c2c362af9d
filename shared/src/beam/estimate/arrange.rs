//! An order of segments in which neighbours are near each other and go the same way, for those that were turned and spread.

use super::super::order::arrange;
use super::{CameraSegment, LANES};

/// Parts that a bundle is divided into: a tile's quarters are tiles as well.
const PARTS: usize = 4;

/// Size of the parts that so many segments are divided into: whole blocks.
pub(super) fn part_of(segments: usize) -> usize {
    segments.div_ceil(PARTS).next_multiple_of(LANES)
}

/// The segments' order.
pub(super) fn order(segments: &[CameraSegment]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..segments.len() as u32).collect();
    let lengths: f32 = segments.iter().map(|s| s.length).sum();
    let length = lengths / segments.len().max(1) as f32;
    let place = |&i: &u32| {
        let segment = &segments[i as usize];
        let [ox, oy, oz] = segment.ray.origin.to_array();
        let [dx, dy, dz] = (length * segment.ray.dir).to_array();
        [ox, oy, oz, dx, dy, dz]
    };
    let finer = |segments| (segments > LANES).then(|| part_of(segments));
    arrange(&mut order, segments.len(), finer, &place, &|&i| {
        u64::from(i)
    });
    order
}
