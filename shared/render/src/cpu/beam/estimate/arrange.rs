//! Orders segments that were turned and spread, so that neighbours are near each other and go the same way.

use super::super::lanes::LANES;
use super::super::order::order;
use super::CameraSegment;

/// Parts that a bundle is divided into. A tile's segments are divided into quarters as well.
const PARTS: usize = 4;

/// Size of the parts of a bundle of `segments`, in whole blocks.
pub(super) fn part_of(segments: usize) -> usize {
    segments.div_ceil(PARTS).next_multiple_of(LANES)
}

/// The order of the segments, as indices.
pub(super) fn arrange(segments: &[CameraSegment]) -> Vec<u32> {
    let lengths: f32 = segments.iter().map(|s| s.length).sum();
    let length = lengths / segments.len().max(1) as f32;
    let place = |segment: &CameraSegment| {
        let [ox, oy, oz] = segment.ray.origin.to_array();
        let [dx, dy, dz] = (length * segment.ray.dir).to_array();
        [ox, oy, oz, dx, dy, dz]
    };
    let finer = |segments| (segments > LANES).then(|| part_of(segments));
    order(segments.iter().map(place), finer)
}
