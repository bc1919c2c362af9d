//! Segments that gather light for their neighbours as well.
//!
//! Kernels of scattered light are many pixels wide: adjacent segments find the same beams, each by its own search.
//! Here, one segment is drawn at random from each block of pixels whose segments all begin and all end within [`REACH`]
//! kernel radii of each other, and what it gathers counts for all of them. The block's mean is the same in expectation.
//! Within the block, light is blurred by no more than a few kernel radii, and only across the line of sight. Like the
//! kernels' own blur, this vanishes with their radii, and the average of passes converges to the same image. Blocks lie
//! elsewhere in every pass, so that they do not show.

use super::{CameraSegment, Gather, Gathered, Way};
use crate::math::Vec3;
use crate::sampler::Sampler;

/// How far apart segments of one block may begin and end, in kernel radii: blocks are no wider than what one beam
/// brightens, where pixels share their noise anyway.
const REACH: f32 = 2.0;

/// The largest blocks are two to the power of this wide, in pixels.
const LARGEST: u32 = 4;

/// Which segments gather, and for which others.
pub struct Sharing {
    chosen: Vec<CameraSegment>,
    /// By segment: its index among the chosen.
    of: Vec<u32>,
}

impl Sharing {
    /// Chooses among segments of one medium and way, for kernels of this `radius`. `place`: a segment's pixel.
    pub fn new(
        segments: &[CameraSegment],
        radius: f32,
        place: impl Fn(&CameraSegment) -> (u32, u32),
        sampler: &mut Sampler,
    ) -> Self {
        if segments.iter().any(|s| s.way == Way::Turned) {
            return Self {
                chosen: segments.to_vec(),
                of: (0..segments.len() as u32).collect(),
            };
        }
        let mut sharing = Self {
            chosen: Vec::new(),
            of: vec![0; segments.len()],
        };
        let [dx, dy] = [(); 2].map(|_| sampler.next_u32() >> (32 - LARGEST));
        let code = |(i, segment)| {
            let (x, y) = place(segment);
            (z_curve(x + dx, y + dy), i)
        };
        // Every block is a contiguous stretch of the Z curve.
        let mut order: Vec<(u32, u32)> = (0..).zip(segments).map(code).collect();
        order.sort_unstable();
        let within = REACH * radius;
        for block in order.chunk_by(|a, b| a.0 >> (2 * LARGEST) == b.0 >> (2 * LARGEST)) {
            sharing.divide(segments, block, LARGEST, within, sampler);
        }
        sharing
    }

    /// Choose one segment from a block of pixels, or from each of its quarters.
    fn divide(
        &mut self,
        segments: &[CameraSegment],
        block: &[(u32, u32)],
        side: u32,
        within: f32,
        sampler: &mut Sampler,
    ) {
        let all = || block.iter().map(|(_, i)| &segments[*i as usize]);
        let is_near =
            || extent(all().map(|s| s.ray.at(s.length))) <= within && extent(all().map(|s| s.ray.origin)) <= within;
        if block.len() == 1 || is_near() {
            let drawn = (u64::from(sampler.next_u32()) * block.len() as u64) >> 32;
            for (_, i) in block {
                self.of[*i as usize] = self.chosen.len() as u32;
            }
            self.chosen.push(segments[block[drawn as usize].1 as usize]);
        } else if let Some(side) = side.checked_sub(1) {
            for quarter in block.chunk_by(|a, b| a.0 >> (2 * side) == b.0 >> (2 * side)) {
                self.divide(segments, quarter, side, within, sampler);
            }
        } else {
            // Several segments of one pixel.
            for one in block.chunks(1) {
                self.divide(segments, one, side, within, sampler);
            }
        }
    }
}

impl Gather<'_> {
    /// As [`Gather::along`]: the chosen segments gather for all.
    pub fn along_shared(&self, sharing: &Sharing) -> Gathered {
        let gathered = self.along(&sharing.chosen);
        Gathered {
            radiance: sharing.of.iter().map(|&i| gathered.radiance[i as usize]).collect(),
            ..gathered
        }
    }
}

/// Diagonal of the box around points.
fn extent(points: impl Iterator<Item = Vec3>) -> f32 {
    let bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (min, max) = points.fold(bounds, |(min, max), p| (min.min(p), max.max(p)));
    (max - min).length()
}

/// Interleaves the bits of two numbers below 256.
fn z_curve(x: u32, y: u32) -> u32 {
    let spread = |v: u32| {
        let v = (v | v << 4) & 0x0f0f;
        let v = (v | v << 2) & 0x3333;
        (v | v << 1) & 0x5555
    };
    spread(x) | spread(y) << 1
}
