//! Directions as each part of a surface sees them, for a coat whose normal differs from that of the layer below: each
//! part has its own frame.
//!
//! Callers multiply values by the cosine to the frame's normal. A part with another normal scatters by the cosine to
//! its own, so its value includes the ratio of both, for the direction towards the light (Veach 1997, section 5.3).

use super::{Layered, Parts};
use crate::math::{Frame, Vec3};
use crate::world::bsdf::TransportMode;
use crate::world::bsdf::perturbation::bump_alpha2;

/// Both directions, as one part sees them.
#[derive(Clone, Copy)]
pub(super) struct Way {
    /// `wo` and `wi`.
    pub directions: [Vec3; 2],
    /// Factor on the part's value.
    pub share: f32,
    /// A further factor on its diffuse scattering: shadowing by slopes like that of its normal (Conty Estevez et al.
    /// 2019).
    pub lit: f32,
}

/// The directions as seen by the layer below the coat, and by the coat.
pub(super) struct Ways {
    pub below: Way,
    pub coat: Way,
}

impl Way {
    /// Whether both are above the part.
    #[inline(always)]
    pub fn is_lit(&self) -> bool {
        self.directions[0].z > 0.0 && self.directions[1].z > 0.0
    }

    /// Cosines to the normal; none where a direction is below.
    #[inline(always)]
    pub fn cosines(&self) -> [f32; 2] {
        self.directions.map(|w| w.z.max(0.0))
    }
}

impl Layered {
    /// The same with normals of the layer below the coat and of the coat, in the frame of the hit.
    pub(in crate::world::bsdf) fn facing(self, normals: [Vec3; 2]) -> Self {
        // No coat lies over a transmitting surface.
        match self.transmits() {
            true => self,
            false => Self {
                normals,
                parts: self.parts | Parts::TWO_NORMALS,
                ..self
            },
        }
    }

    #[inline(always)]
    pub(super) fn has_two_normals(&self) -> bool {
        self.parts.contains(Parts::TWO_NORMALS)
    }

    /// The frames of both parts. Anisotropic microfacets lie along x of each.
    pub(super) fn frames(&self) -> [Frame; 2] {
        self.normals.map(|n| Frame::along(Vec3::X, n))
    }

    /// Both directions, which leave the front.
    #[inline(always)]
    pub(super) fn ways(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Ways {
        if self.has_two_normals() {
            return self.two_ways(wo, wi, mode);
        }
        let way = Way {
            directions: [wo, wi],
            share: 1.0,
            lit: 1.0,
        };
        Ways { below: way, coat: way }
    }

    #[inline(never)]
    fn two_ways(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Ways {
        let [below, coat] = self.frames().map(|frame| {
            let [wo_there, wi_there] = [wo, wi].map(|w| frame.to_local(w));
            let (light, there) = match mode {
                TransportMode::Radiance => (wi, wi_there),
                TransportMode::Flux => (wo, wo_there),
            };
            Way {
                directions: [wo_there, wi_there],
                share: share(light.z, there.z),
                lit: lit(frame.n, light.z),
            }
        });
        Ways { below, coat }
    }

    /// For light that crosses the surface: the outside direction as the layer below the coat sees it, its cosine to the
    /// coat, and the factor on the value.
    #[inline(always)]
    pub(super) fn crossing_ways(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Vec3, f32, f32) {
        let outside = if wo.z > 0.0 { wo } else { wi };
        if !self.has_two_normals() {
            return (outside, outside.z.abs().min(1.0), 1.0);
        }
        let [below, coat] = self.frames().map(|frame| frame.to_local(outside));
        let from_light = match mode {
            TransportMode::Radiance => wi.z > 0.0,
            TransportMode::Flux => wo.z > 0.0,
        };
        let share = match from_light {
            true => share(outside.z, below.z) * lit(self.normals[0], outside.z),
            false => f32::from(below.z > 0.0),
        };
        (below, coat.z.clamp(0.0, 1.0), share)
    }

    /// The direction that a path comes from, on the front, as the layer below the coat sees it, and its cosine to the
    /// coat.
    #[inline(always)]
    pub(super) fn seen_from(&self, wo: Vec3) -> (Vec3, f32) {
        if !self.has_two_normals() {
            return (wo, wo.z.abs().min(1.0));
        }
        let [below, coat] = self.frames().map(|frame| frame.to_local(wo));
        (below, coat.z.clamp(0.0, 1.0))
    }
}

/// Least cosine of light to z: the division by it is cancelled by a later multiplication.
const LEAST_COSINE: f32 = 1e-6;

/// The cosine of light to a normal over that to z.
fn share(cos: f32, there: f32) -> f32 {
    match there > 0.0 && cos > 0.0 {
        true => there / cos.max(LEAST_COSINE),
        false => 0.0,
    }
}

/// Share of diffuse light at a cosine to z that slopes like that of a normal leave.
fn lit(n: Vec3, cos: f32) -> f32 {
    if n.z >= 1.0 || cos <= 0.0 {
        return 1.0;
    }
    let cos2 = cos * cos;
    2.0 * cos / (cos + (cos2 + bump_alpha2(n) * (1.0 - cos2)).sqrt())
}
