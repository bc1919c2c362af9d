//! Radiance from beams along camera segments.
//!
//! The angle between a beam and a segment decides which of two estimates counts the pair:
//! - The 1D estimate of Jarosz et al. 2011 (A comprehensive theory of volumetric radiance estimation using photon
//!   points and beams, eq. 38, beams x beams 1D) counts most pairs.
//! - Where the two are nearly parallel, the 1 / sin theta of the 1D estimate grows without bound. There the beam is
//!   blurred over the disc across it, not over the line across both, and the segment's chord through that cone is
//!   integrated by stratified random points. The value is bounded by the chord's length.
//!
//! Both are exact integrals of the same radiance in the limit of thin beams. Each pair of directions belongs to exactly
//! one of them, so nothing is lost or counted twice.

mod arrange;
mod chord;
mod line;
mod packet;
mod ray;
mod ray_bundle;
mod search;
mod share;
mod varying;

use super::store::BeamMap;
use crate::math::{Ray, Rgb};
use crate::plan::aov::{GroupNumber, Part};
use crate::world::Scene;
use crate::world::medium::Medium;
use crate::world::medium::transmittance::StepFunctions;
use crate::world::phase::Phase;
use crate::world::spectrum::WaveNumber;
use arrange::arrange;
use line::Block;
pub use share::Sharing;

/// Below this sine of the angle between beam and segment, the chord is integrated.
const NEARLY_PARALLEL_SIN: f32 = 0.1;
const NEARLY_PARALLEL_SIN2: f32 = NEARLY_PARALLEL_SIN * NEARLY_PARALLEL_SIN;

/// How a camera path came to a segment: straight through some number of surfaces, or by a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Way {
    /// It passed this many surfaces: segments of neighbouring pixels are near each other.
    Straight(u16),
    /// Segments of neighbouring pixels may be anywhere.
    Turned,
}

/// What a camera path did at a surface.
#[derive(Clone, Copy, Debug)]
pub enum Turn {
    /// It went straight on, as at boundaries of media.
    Passed,
    /// It was reflected.
    Reflected,
    /// It was refracted.
    Refracted,
}

impl Default for Way {
    fn default() -> Self {
        Self::Straight(0)
    }
}

impl Way {
    /// The way after one more turn. A path through more surfaces than can be counted counts as turned.
    #[inline]
    pub fn then(self, turn: Turn) -> Self {
        match (self, turn) {
            (Self::Straight(passed), Turn::Passed) => passed.checked_add(1).map_or(Self::Turned, Self::Straight),
            (Self::Straight(_), Turn::Reflected | Turn::Refracted) | (Self::Turned, _) => Self::Turned,
        }
    }
}

/// A segment of a camera path inside a scattering medium.
#[derive(Clone, Copy, Debug)]
pub struct CameraSegment {
    /// The segment starts at the ray's origin.
    pub ray: Ray,
    /// Its length, finite.
    pub length: f32,
    /// Throughput from the film to the segment's start.
    pub beta: Rgb,
    /// Index into the scene's media.
    pub medium: u16,
    /// Which pixel, counted within the tile.
    pub pixel: u16,
    /// How the path came here.
    pub way: Way,
    /// The layer part that the gathered light counts for.
    pub part: Part,
    /// The wavelength of the path, if it has one. The throughput does not contain its weight.
    pub wave: Option<WaveNumber>,
    /// Index of the segment's transmittance among the [`CameraSegments`]' functions, in a heterogeneous medium.
    pub steps: u32,
}

impl CameraSegment {
    /// A segment of a path that has turned, of [`Part::Volume`].
    pub fn new(ray: Ray, length: f32, beta: Rgb, medium: u16) -> Self {
        Self {
            ray,
            length,
            beta,
            medium,
            pixel: 0,
            way: Way::Turned,
            part: Part::Volume,
            wave: None,
            steps: 0,
        }
    }
}

/// Segments of camera paths, and their transmittance.
#[derive(Clone, Debug, Default)]
pub struct CameraSegments {
    /// The segments.
    pub segments: Vec<CameraSegment>,
    /// Transmittance along those in heterogeneous media.
    pub steps: StepFunctions,
}

impl CameraSegments {
    /// Forget all segments.
    pub fn clear(&mut self) {
        self.segments.clear();
        self.steps.clear();
    }
}

/// What was gathered along segments.
#[derive(Clone, Debug, Default)]
pub struct Gathered {
    /// Radiance along each, before its throughput.
    pub radiance: Vec<Rgb>,
    /// Pairs of beam and segment that contributed.
    pub evaluations: u64,
    /// Blocks of segments that looked for beams together.
    pub blocks: u64,
}

/// Kinds of vector code. Only the number of lanes per instruction differs. No operation is fused or reordered, so the
/// bits are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vectors {
    /// What every machine of this architecture has: SSE2, NEON.
    Baseline,
    /// 8 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 16 lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Vectors {
    /// Those that this machine has, the narrowest first.
    pub fn available() -> impl DoubleEndedIterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let all = {
            let avx2 = std::arch::is_x86_feature_detected!("avx2");
            let avx512 = std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512bw")
                && std::arch::is_x86_feature_detected!("avx512vl");
            [
                Some(Self::Baseline),
                avx2.then_some(Self::Avx2),
                (avx2 && avx512).then_some(Self::Avx512),
            ]
        };
        #[cfg(not(target_arch = "x86_64"))]
        let all = [Some(Self::Baseline)];
        all.into_iter().flatten()
    }

    /// The widest that this machine has.
    pub fn widest() -> Self {
        Self::available().next_back().unwrap_or(Self::Baseline)
    }
}

/// Which beams are gathered, and how.
#[derive(Clone, Copy)]
pub struct Gather<'a> {
    /// The beams.
    pub map: &'a BeamMap,
    /// The medium of all segments.
    pub medium: &'a Medium,
    /// Transmittance along the segments, in a heterogeneous medium.
    pub steps: &'a StepFunctions,
    /// The scene whose walls stand between beams and segments, if any.
    pub scene: Option<&'a Scene>,
    /// If set, only the beams of this group of lights.
    pub group: Option<GroupNumber>,
    /// If set, only the beams of this wavelength, and those of light without one.
    pub wave: Option<WaveNumber>,
    /// Addresses the random numbers of chords.
    pub key: u64,
    /// Kind of vector code. This machine must have it.
    pub vectors: Vectors,
}

impl Gather<'_> {
    /// Sums the beams' radiance along segments in one medium, ordered so that neighbours in the image are adjacent. The
    /// bits do not depend on which segments are given together.
    pub fn along(&self, segments: &[CameraSegment]) -> Gathered {
        let mut gathered = Gathered {
            radiance: vec![Rgb::ZERO; segments.len()],
            ..Gathered::default()
        };
        let Some(first) = segments.first().filter(|s| self.map.has_beams(s.medium)) else {
            return gathered;
        };
        let pinhole = segments.iter().all(|s| s.ray.origin == first.ray.origin);
        let order = match first.way == Way::Turned {
            true => arrange(segments),
            false => (0..segments.len() as u32).collect(),
        };
        let arranged: Vec<_> = order.iter().map(|&i| segments[i as usize]).collect();
        let mut places = order.into_iter();
        self.instance(pinhole)(self, &arranged, &mut |block| {
            gathered.blocks += 1;
            let [red, green, blue] = &block.radiance;
            for (lane, place) in (0..block.segments.len()).zip(&mut places) {
                gathered.radiance[place as usize] = Rgb::new(red[lane], green[lane], blue[lane]);
                gathered.evaluations += u64::from(block.evaluations[lane]);
            }
        });
        gathered
    }

    /// The code for the medium. `pinhole`: the rays share their origin.
    fn instance(&self, pinhole: bool) -> Instance {
        let medium = self.medium;
        let sigma_t = medium.sigma_t();
        let even = !matches!(medium, Medium::Heterogeneous(medium) if medium.albedo().is_some());
        let grey = even && sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z;
        let lobes = match medium.phase() {
            Phase::Isotropic => 0,
            Phase::HenyeyGreenstein { .. } => 1,
            Phase::Blend { .. } => 2,
        };
        let varying = matches!(medium, Medium::Heterogeneous(_));
        match (grey, lobes, varying, pinhole) {
            (true, 0, false, false) => dispatch::<true, 0, false, false>,
            (true, 1, false, false) => dispatch::<true, 1, false, false>,
            (true, _, false, false) => dispatch::<true, 2, false, false>,
            (false, 0, false, false) => dispatch::<false, 0, false, false>,
            (false, 1, false, false) => dispatch::<false, 1, false, false>,
            (false, _, false, false) => dispatch::<false, 2, false, false>,
            (true, 0, false, true) => dispatch::<true, 0, false, true>,
            (true, 1, false, true) => dispatch::<true, 1, false, true>,
            (true, _, false, true) => dispatch::<true, 2, false, true>,
            (false, 0, false, true) => dispatch::<false, 0, false, true>,
            (false, 1, false, true) => dispatch::<false, 1, false, true>,
            (false, _, false, true) => dispatch::<false, 2, false, true>,
            // A shared origin saves little compared with the cost of varying density.
            (true, 0, true, _) => dispatch::<true, 0, true, false>,
            (true, 1, true, _) => dispatch::<true, 1, true, false>,
            (true, _, true, _) => dispatch::<true, 2, true, false>,
            (false, 0, true, _) => dispatch::<false, 0, true, false>,
            (false, 1, true, _) => dispatch::<false, 1, true, false>,
            (false, _, true, _) => dispatch::<false, 2, true, false>,
        }
    }
}

/// Gathers along segments, and calls back for each block of them.
type Instance = fn(&Gather, &[CameraSegment], &mut dyn FnMut(&Block));

/// Runs the same code compiled for each kind of vectors. `LOBES`: how many lobes of the phase function are not
/// isotropic.
fn dispatch<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
    gather: &Gather,
    segments: &[CameraSegment],
    out: &mut dyn FnMut(&Block),
) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
            gather: &Gather,
            segments: &[CameraSegment],
            out: &mut dyn FnMut(&Block),
        ) {
            packet::sum::<GREY, LOBES, VARYING, PINHOLE>(gather, segments, out);
        }
        #[target_feature(enable = "avx2,avx512f,avx512dq,avx512bw,avx512vl")]
        fn avx512<const GREY: bool, const LOBES: usize, const VARYING: bool, const PINHOLE: bool>(
            gather: &Gather,
            segments: &[CameraSegment],
            out: &mut dyn FnMut(&Block),
        ) {
            packet::sum::<GREY, LOBES, VARYING, PINHOLE>(gather, segments, out);
        }
        if Vectors::available().any(|available| available == gather.vectors) {
            match gather.vectors {
                Vectors::Baseline => {}
                // SAFETY: `Gather::vectors` is a kind that this machine has.
                Vectors::Avx2 => unsafe {
                    return avx2::<GREY, LOBES, VARYING, PINHOLE>(gather, segments, out);
                },
                // SAFETY: as above.
                Vectors::Avx512 => unsafe {
                    return avx512::<GREY, LOBES, VARYING, PINHOLE>(gather, segments, out);
                },
            }
        }
    }
    packet::sum::<GREY, LOBES, VARYING, PINHOLE>(gather, segments, out);
}
