//! Random numbers addressed by (seed, pass, purpose, chunk): anyone can draw them again, on any thread.

use crate::math::Vec2;
use rand_core::Rng;
use rand_pcg::Pcg32;

/// What a stream of random numbers is for. Two purposes never share a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Photon paths; the chunk is the path's index.
    Photons = 1,
    /// Camera paths; the chunk is the pixel's index.
    Camera = 2,
    /// Points on chords of nearly parallel beam and ray pairs.
    Chords = 3,
    /// Paths of the reference integrator; the chunk is the pixel's index.
    Reference = 4,
    /// Camera paths that look for photon targets; the chunk is the path's index.
    Pilot = 5,
    /// Photons that measure how many hit targets; the chunk is the photon's index.
    Probes = 6,
    /// Which camera segments gather for others; the chunk is the tile's index.
    Sharing = 7,
    /// Numbers that tests draw.
    Test = 100,
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Sampler {
    rng: Pcg32,
}

/// One round of SplitMix64's finaliser (Steele et al. 2014): a bijection that spreads every input bit.
#[inline]
pub fn mix64(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Sampler {
    /// The stream of an address. State and stream of the generator are both hashed from the whole address, because
    /// streams of a pcg that differ only in their number are correlated.
    #[inline]
    pub fn new(seed: u64, pass_index: u64, purpose: Purpose, chunk: u64) -> Self {
        let key = mix64(mix64(mix64(seed) ^ pass_index) ^ ((purpose as u64) << 56));
        let state = mix64(key ^ chunk);
        let stream = mix64(state ^ 0x6a09_e667_f3bc_c909);
        Self {
            rng: Pcg32::new(state, stream),
        }
    }
    /// 32 random bits.
    #[inline]
    pub fn next_u32(&mut self) -> u32 {
        self.rng.next_u32()
    }
    /// Uniform in [0, 1): 24 bits, never 1.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
    }
    /// Uniform in [0, 1)^2.
    #[inline]
    pub fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }
}
