//! A vertex of a path: how it scatters, and which rules it obeys.

use crate::math::{Frame, Rgb, Vec3};
use crate::world::bsdf::{Bsdf, BumpShadowing, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::phase::Phase;
use crate::world::rules::ObjectSets;

/// Rules of a vertex that the camera sees.
#[derive(Clone, Copy)]
pub(super) struct VertexRules {
    pub(super) sets: ObjectSets,
    /// The path follows this lobe: light comes to it as what is seen in it does.
    pub(super) is_followed: bool,
}

impl VertexRules {
    pub(super) fn is_gloss(&self) -> bool {
        self.is_followed || self.sets.is_glossy
    }

    /// Whether lights are only sampled, because shadow rays do not see what the continuing path does.
    pub(super) fn decides_direct_light(&self) -> bool {
        !self.is_followed && self.sets.decides_direct_light()
    }
}

/// A point that asks for light, and how it scatters.
pub(super) enum Vertex<'a> {
    Surface {
        hit: &'a SurfaceHit,
        /// Normal of the only side that is lit.
        facing: Option<Vec3>,
        bsdf: &'a Bsdf<'a>,
        bump_shadowing: Option<BumpShadowing>,
        frame: Frame,
        local_wo: Vec3,
    },
    Medium {
        point: Vec3,
        /// Direction of travel of the camera path.
        dir: Vec3,
        phase: Phase,
    },
}

/// Scattering towards a direction.
pub(super) struct Scattering {
    /// BSDF times cosine, or phase function, 1/sr.
    pub(super) value: Rgb,
    /// Density of drawing the direction, per solid angle.
    pub(super) pdf: f32,
}

impl Vertex<'_> {
    pub(super) fn point(&self) -> Vec3 {
        match self {
            Self::Surface { hit, .. } => hit.point,
            Self::Medium { point, .. } => *point,
        }
    }

    /// Normal of the only side that is lit, if there is one.
    pub(super) fn facing(&self) -> Option<Vec3> {
        match self {
            Self::Surface { facing, .. } => *facing,
            Self::Medium { .. } => None,
        }
    }

    /// Scattering of light that comes from `wi`, render space.
    pub(super) fn towards(&self, wi: Vec3) -> Scattering {
        match self {
            Self::Medium { dir, phase, .. } => {
                let pdf = phase.eval_directions(*dir, wi);
                Scattering {
                    value: Rgb::splat(pdf),
                    pdf,
                }
            }
            Self::Surface {
                hit,
                bsdf,
                bump_shadowing,
                frame,
                local_wo,
                ..
            } => {
                let local = frame.to_local(wi);
                if local.z * hit.ng.dot(wi) <= 0.0 {
                    return Scattering {
                        value: Rgb::ZERO,
                        pdf: 0.0,
                    };
                }
                let value = bsdf.eval_bumped(bump_shadowing.as_ref(), *local_wo, local, TransportMode::Radiance);
                Scattering {
                    value: value * local.z.abs(),
                    pdf: bsdf.pdf(*local_wo, local),
                }
            }
        }
    }
}
