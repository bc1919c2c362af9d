//! Random numbers addressed by (seed, pass, purpose, chunk): any thread can draw them again.

use crate::math::Vec2;
use beamfarm_image::merge::{REPLICATION, replication};
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
    /// Photons that measure what share of photons hits targets; the chunk is the photon's index.
    Probes = 6,
    /// Which camera segments gather for others; the chunk is the tile's index.
    Sharing = 7,
    /// Parts of the lens; the chunk is the tile's index.
    Lens = 8,
    /// Where samples lie in their pixels, of a pass (chunk 0) or of the path tracer's turn (chunk 1).
    Film = 9,
    /// The moment of a pass, or of the path tracer's turn; the chunk is 0.
    Shutter = 10,
    /// The wavelengths of a pass; the chunk is 0.
    Wavelengths = 11,
    /// Numbers that tests draw.
    Test = 100,
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Sampler {
    rng: Pcg32,
    points: Points,
}

/// A point of a sequence that fills the unit cube evenly, as several independent squares. Each is the first two
/// dimensions of Sobol's sequence, shuffled and scrambled by Owen's method (Burley 2020, Practical Hash-based Owen
/// Scrambling).
#[derive(Clone, Copy, Debug, Default)]
struct Points {
    key: u64,
    /// The point's number, its bits reversed.
    index: u32,
    /// The next square's number.
    square: u32,
    /// How many squares there are.
    squares: u32,
}

/// Squares that one vertex of a path draws from, at most, in general.
pub const VERTEX: u32 = 16;

/// Squares of an even sampler; numbers beyond these are random. More squares gain nothing.
const SQUARES: u32 = 96;
/// Squares of [`Sampler::of_paths`].
const SQUARES_OF_PATHS: u32 = 8;

impl Points {
    #[inline]
    fn hash(&mut self) -> u64 {
        let hash = mix64(self.key ^ u64::from(self.square));
        self.square += 1;
        hash
    }

    #[inline]
    fn next_1d(&mut self) -> u32 {
        let hash = self.hash();
        let shuffled = owen_reversed(self.index, hash as u32).reverse_bits();
        owen_reversed(shuffled, (hash >> 32) as u32).reverse_bits()
    }

    #[inline]
    fn next_2d(&mut self) -> [u32; 2] {
        let hash = self.hash();
        let shuffled = owen_reversed(self.index, hash as u32).reverse_bits();
        let seeds = [(hash >> 32) as u32, mix64(hash) as u32];
        let [x, y] = sobol_reversed(shuffled);
        [
            owen_reversed(x, seeds[0]).reverse_bits(),
            owen_reversed(y, seeds[1]).reverse_bits(),
        ]
    }
}

/// The first two dimensions of Sobol's sequence, bits reversed: the radical inverse, and its product with Pascal's
/// triangle modulo two.
#[inline]
fn sobol_reversed(index: u32) -> [u32; 2] {
    let mut y = index;
    y ^= y >> 1 & 0x5555_5555;
    y ^= y >> 2 & 0x3333_3333;
    y ^= y >> 4 & 0x0f0f_0f0f;
    y ^= y >> 8 & 0x00ff_00ff;
    y ^= y >> 16;
    [index, y]
}

/// Owen's scrambling of a number whose bits are reversed: each bit is flipped or not by a hash of those below it
/// (Burley 2020, after Laine and Karras 2011).
#[inline]
fn owen_reversed(mut x: u32, seed: u32) -> u32 {
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^ x.wrapping_mul(0x8d22_f6e6)
}

/// Uniform in [0, 1): 24 bits, never 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
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
    /// The stream of an address. The generator's state and stream are both hashed from the whole address, because PCG
    /// streams that differ only in their number are correlated.
    #[inline]
    pub fn new(seed: u64, pass_index: u64, purpose: Purpose, chunk: u64) -> Self {
        let state = mix64(key(seed, pass_index, purpose) ^ chunk);
        let stream = mix64(state ^ 0x6a09_e667_f3bc_c909);
        Self {
            rng: Pcg32::new(state, stream),
            points: Points::default(),
        }
    }

    /// The stream of an address whose first numbers are even over the passes of a [`replication`]: those with the same
    /// seed, purpose and chunk fill the unit cube better than chance would. Replications are independent of each other.
    #[inline]
    pub fn even(seed: u64, pass_index: u64, purpose: Purpose, chunk: u64) -> Self {
        let first = replication(pass_index).start();
        let index = pass_index - first;
        // A key that no single pass has, and no other replication.
        let key = mix64(key(seed, first / REPLICATION, purpose) ^ chunk);
        Self {
            points: Points {
                key: !key,
                index: (index as u32).reverse_bits(),
                square: 0,
                squares: SQUARES,
            },
            ..Self::new(seed, pass_index, purpose, chunk)
        }
    }

    /// The stream of one of a pass's `paths`. Its first numbers are even over these paths, and over the passes of a
    /// [`replication`]. Replications are independent of each other.
    #[inline]
    pub fn of_paths(seed: u64, pass_index: u64, purpose: Purpose, (path, paths): (u32, u32)) -> Self {
        let first = replication(pass_index).start();
        let before = (pass_index - first) as u32;
        let index = before.wrapping_mul(paths).wrapping_add(path);
        Self {
            points: Points {
                key: !mix64(key(seed, first / REPLICATION, purpose)),
                index: index.reverse_bits(),
                square: 0,
                squares: SQUARES_OF_PATHS,
            },
            ..Self::new(seed, pass_index, purpose, path.into())
        }
    }

    /// Skip to the next square whose number is a multiple of `apart`, so that all passes of a replication draw the same
    /// numbers for the same thing.
    #[inline]
    pub fn align(&mut self, apart: u32) {
        self.points.square = self.points.square.next_multiple_of(apart);
    }

    /// 32 random bits.
    #[inline]
    pub fn next_u32(&mut self) -> u32 {
        self.rng.next_u32()
    }

    /// Uniform in [0, 1): 24 bits, never 1.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        match self.points.square < self.points.squares {
            true => unit(self.points.next_1d()),
            false => unit(self.next_u32()),
        }
    }

    /// [`Self::next_1d`], or a cheap arbitrary number where it is not `wanted`. Later draws are the same either way.
    #[inline]
    pub fn next_1d_if(&mut self, wanted: bool) -> f32 {
        match wanted {
            true => self.next_1d(),
            false => {
                self.skip(1);
                0.0
            }
        }
    }

    /// [`Self::next_2d`], or cheap arbitrary numbers where they are not `wanted`.
    #[inline]
    pub fn next_2d_if(&mut self, wanted: bool) -> Vec2 {
        match wanted {
            true => self.next_2d(),
            false => {
                self.skip(2);
                Vec2::ZERO
            }
        }
    }

    /// Go on as if a number of this many dimensions had been drawn.
    #[inline]
    fn skip(&mut self, dimensions: u32) {
        match self.points.square < self.points.squares {
            true => self.points.square += 1,
            false => (0..dimensions).for_each(|_| _ = self.next_u32()),
        }
    }

    /// Uniform in [0, 1)^2.
    #[inline]
    pub fn next_2d(&mut self) -> Vec2 {
        let [x, y] = match self.points.square < self.points.squares {
            true => self.points.next_2d(),
            false => [self.next_u32(), self.next_u32()],
        };
        Vec2::new(unit(x), unit(y))
    }
}

#[inline]
fn key(seed: u64, pass_index: u64, purpose: Purpose) -> u64 {
    mix64(mix64(mix64(seed) ^ pass_index) ^ ((purpose as u64) << 56))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHUNKS: u64 = 4000;

    fn even(pass_index: u64, chunk: u64) -> Sampler {
        Sampler::even(3, pass_index, Purpose::Test, chunk)
    }

    /// Divide each square into as many boxes as a replication has passes, in any proportion: every box holds one pass.
    /// The same holds for the first sixteen passes.
    #[test]
    fn a_replication_fills_all_boxes() {
        for (chunk, square, first, log2) in [(0, 0, 32, 4), (1, 1, 1024, 7), (77, 5, 1536, 7), (5, 2, 1024, 4)] {
            let count = 1 << log2;
            let passes = || first..first + count as u64;
            assert!(passes().all(|pass| replication(pass).start() == first));
            for level in 0..=log2 {
                let (columns, rows) = (1 << level, count >> level);
                let mut seen = vec![0; count];
                for pass in passes() {
                    let mut sampler = even(pass, chunk);
                    for _ in 0..square {
                        sampler.next_1d();
                    }
                    let u = sampler.next_2d();
                    let cell = (u.x * columns as f32) as usize * rows + (u.y * rows as f32) as usize;
                    seen[cell] += 1;
                }
                assert_eq!(seen, vec![1; count], "{columns} x {rows}");
                let mut sampler = passes().map(|pass| even(pass, chunk).next_1d());
                let mut seen = vec![0; count];
                sampler.by_ref().for_each(|u| seen[(u * count as f32) as usize] += 1);
                assert_eq!(seen, vec![1; count]);
            }
        }
    }

    /// As above, for the paths of one pass and for those of all passes of a replication. Other replications have other
    /// points.
    #[test]
    fn the_paths_of_passes_fill_all_boxes() {
        let draw = |pass, path, square| {
            let mut sampler = Sampler::of_paths(3, pass, Purpose::Test, (path, 64));
            (0..square).for_each(|_| _ = sampler.next_1d());
            sampler.next_2d()
        };
        for (passes, square) in [
            (0..1, 0),
            (5..6, 1),
            (0..16, 0),
            (16..32, 4),
            (7..8, SQUARES_OF_PATHS - 1),
        ] {
            let count = 64 * passes.clone().count();
            for columns in [1, 8, count] {
                let rows = count / columns;
                let mut seen = vec![0; count];
                for (pass, path) in passes.clone().flat_map(|pass| (0..64).map(move |path| (pass, path))) {
                    let u = draw(pass, path, square);
                    seen[(u.x * columns as f32) as usize * rows + (u.y * rows as f32) as usize] += 1;
                }
                assert_eq!(seen, vec![1; count], "{passes:?}: {columns} x {rows}");
            }
        }
        assert_ne!(draw(0, 0, 0), draw(16, 0, 0));
    }

    /// Over chunks, each pass of a replication draws evenly from the square, and two of its squares are independent:
    /// chi-square of 8 x 8 cells (63 degrees of freedom) below its mean plus five standard deviations.
    #[test]
    fn every_pass_is_uniform_by_itself() {
        type Draw = fn(&mut Sampler) -> [f32; 2];
        let draws: [Draw; 4] = [
            |s| s.next_2d().to_array(),
            |s| [s.next_1d(), s.next_1d()],
            |s| [s.next_2d().x, s.next_2d().y],
            // Bits below the stratified ones.
            |s| (s.next_2d() * 1000.0).fract().to_array(),
        ];
        for pass in 0..18 {
            for (number, draw) in draws.iter().enumerate() {
                let mut cells = [0.0; 64];
                for chunk in 0..CHUNKS {
                    let [x, y] = draw(&mut even(pass, chunk));
                    cells[(x * 8.0) as usize * 8 + (y * 8.0) as usize] += 1.0;
                }
                let expected = CHUNKS as f64 / 64.0;
                let chi: f64 = cells.iter().map(|n| (n - expected) * (n - expected) / expected).sum();
                let most = 63.0 + 5.0 * libm::sqrt(2.0 * 63.0);
                assert!(chi < most, "pass {pass}, draw {number}: {chi}");
            }
        }
    }

    /// Two replications are independent, and so are two chunks: the correlation of their first numbers is within five
    /// standard errors of zero.
    #[test]
    fn replications_and_chunks_are_independent() {
        let centred = |pass, chunk| f64::from(even(pass, chunk).next_1d()) - 0.5;
        for (passes, chunks) in [(16, 0), (1 << 14, 0), (0, 1), (0, 512)] {
            let products = (0..CHUNKS).map(|chunk| centred(5, chunk) * centred(5 + passes, chunk + chunks));
            let correlation = 12.0 * products.sum::<f64>() / CHUNKS as f64;
            assert!(
                correlation.abs() < 5.0 / libm::sqrt(CHUNKS as f64),
                "{passes}, {chunks}: {correlation}"
            );
        }
    }

    #[test]
    fn numbers_that_are_not_wanted_are_passed() {
        for start in [even(3, 7), Sampler::new(3, 0, Purpose::Test, 7)] {
            let (mut one, mut other) = (start.clone(), start);
            for i in 0..200 {
                match i % 3 {
                    0 => _ = (one.next_1d(), other.next_1d_if(false)),
                    1 => _ = (one.next_2d(), other.next_2d_if(false)),
                    _ => assert_eq!(
                        (one.next_1d(), one.next_2d()),
                        (other.next_1d_if(true), other.next_2d_if(true))
                    ),
                }
            }
        }
    }

    #[test]
    fn aligned_samplers_draw_the_same_whatever_was_drawn_before() {
        let mut one = even(3, 7);
        let mut other = even(3, 7);
        one.next_1d();
        other.next_2d();
        other.next_2d();
        for sampler in [&mut one, &mut other] {
            sampler.align(8);
        }
        assert_eq!(one.next_2d(), other.next_2d());
    }
}
