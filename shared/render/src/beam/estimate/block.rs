//! Segments side by side, and what is gathered along them.

use super::super::PhotonBeam;
use super::super::lanes::{LANES, Lanes};
use super::kind::Kind;
use super::varying::Varying;
use super::{CameraSegment, Gather};
use crate::math::{PI, Rgb, Vec3};
use crate::medium::Medium;
use crate::medium::transmittance::StepFunctions;
use crate::phase::{Phase, PhaseLobe};

/// What all segments share.
pub(super) struct Shared<'a> {
    pub beams: &'a [PhotonBeam],
    /// The origin of all rays, if they share one.
    pub origin: Vec3,
    pub sigma_s: Rgb,
    pub sigma_t: Rgb,
    pub phase: Phase,
    lobes: [PhaseLobe; 2],
    /// Transmittance along the beams.
    pub beam_steps: &'a StepFunctions,
    pub key: u64,
}

/// Segments side by side, and what is gathered along them.
pub(super) struct Block<'a> {
    pub dir: [Lanes; 3],
    pub origin: [Lanes; 3],
    /// Zero in unused lanes, so that nothing is found there.
    pub length: Lanes,
    /// Red, green, blue.
    pub radiance: [Lanes; 3],
    /// Pairs that contributed.
    pub evaluations: [u32; LANES],
    pub segments: &'a [CameraSegment],
    /// In a heterogeneous medium.
    pub varying: Option<Varying<'a>>,
}

impl<'a> Shared<'a> {
    /// `origin`: of the rays, if they share one.
    pub fn new(gather: &Gather<'a>, origin: Vec3) -> Self {
        let medium = gather.medium;
        Self {
            beams: gather.map.beams(),
            origin,
            sigma_s: medium.sigma_s(),
            sigma_t: medium.sigma_t(),
            phase: medium.phase(),
            lobes: medium.phase().lobes(),
            beam_steps: gather.map.steps(),
            key: gather.key,
        }
    }

    /// The phase function, for the cosine between segment and beam: light that travels along the beam is turned towards
    /// the camera, against the segment.
    #[inline(always)]
    pub fn phase<K: Kind>(&self, cos: f32) -> f32 {
        let [first, second] = &self.lobes;
        match K::LOBES {
            0 => 1.0 / (4.0 * PI),
            1 => first.eval(-cos),
            _ => first.eval(-cos) + second.eval(-cos),
        }
    }
}

impl<'a> Block<'a> {
    /// At most as many segments as there are lanes.
    pub fn new(gather: &Gather<'a>, segments: &'a [CameraSegment]) -> Self {
        let (mut dir, mut origin) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let mut length = [0.0; LANES];
        dir[0] = [1.0; LANES];
        for (l, segment) in segments.iter().enumerate().take(LANES) {
            for c in 0..3 {
                dir[c][l] = segment.ray.dir[c];
                origin[c][l] = segment.ray.origin[c];
            }
            length[l] = segment.length;
        }
        Self {
            dir,
            origin,
            length,
            radiance: [[0.0; LANES]; 3],
            evaluations: [0; LANES],
            segments,
            varying: match gather.medium {
                Medium::Homogeneous(_) => None,
                Medium::Heterogeneous(medium) => {
                    let (steps, beams) = (gather.steps, gather.map.steps());
                    Some(Varying::new(medium, segments, steps, beams))
                }
            },
        }
    }
}
