//! Media, as `kernels/medium.wgsl` and `kernels/phase.wgsl` have them.

use super::reason::{Of, Reason, Why};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::medium;
use beamfarm_render::world::phase::{self, Phase};
use bytemuck::{Pod, Zeroable};

/// What evaluates a phase function.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PhaseLobe {
    /// `(1 - g^2) / (4 pi)`.
    pub scale: f32,
    /// `(1 - |g|)^2`.
    pub peak: f32,
    /// `2 |g|`.
    pub slope: f32,
    /// 1 for a forward peak and for `g = 0`, -1 for a backward one.
    pub sign: f32,
}

impl PhaseLobe {
    /// Of a mean cosine.
    #[must_use]
    pub fn new(g: f32) -> Self {
        let phase::PhaseLobe {
            scale,
            peak,
            slope,
            sign,
        } = phase::PhaseLobe::new(g, 1.0);
        Self {
            scale,
            peak,
            slope,
            sign,
        }
    }
}

/// A medium, RGB, per scene unit; where its density varies, at density 1.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Medium {
    /// Extinction.
    pub sigma_t: [f32; 3],
    /// Mean cosine of its phase function.
    pub g: f32,
    /// Scattering.
    pub sigma_s: [f32; 3],
    /// Its phase function.
    pub phase: PhaseLobe,
    padding: u32,
}

impl Medium {
    /// None where its phase function has two lobes.
    #[must_use]
    pub fn new(medium: &medium::Medium) -> Option<Self> {
        let g = match medium.phase() {
            Phase::Isotropic => 0.0,
            Phase::HenyeyGreenstein { g } => g,
            Phase::Blend { .. } => return None,
        };
        Some(Self {
            sigma_t: medium.sigma_t().to_array(),
            g,
            sigma_s: medium.sigma_s().to_array(),
            phase: PhaseLobe::new(g),
            padding: 0,
        })
    }
}

/// A scene's media by their numbers; what is nowhere is not there at all. Reasons are added to the list.
pub(super) fn flatten(description: &SceneDescription, reasons: &mut Vec<Reason>) -> Vec<Medium> {
    let used = used(description);
    let flat = |(number, medium): (u16, &medium::Medium)| {
        if !used.contains(&number) {
            return Medium::zeroed();
        }
        let names = &description.media_names;
        let name = names.get(usize::from(number)).cloned().unwrap_or_default();
        let mut no = |field: &'static str, what: &'static str| {
            reasons.push(Reason {
                of: Of::Medium(name.clone()),
                field,
                why: Why::Missing(what),
            });
        };
        match medium.phase() {
            Phase::Isotropic | Phase::HenyeyGreenstein { .. } => {}
            Phase::Blend { .. } => no("phase", "phase functions of two lobes"),
        }
        Medium::new(medium).unwrap_or(Medium::zeroed())
    };
    (0..).zip(&description.media).map(flat).collect()
}

/// The media that are somewhere.
pub(super) fn used(description: &SceneDescription) -> Vec<u16> {
    let boundaries = description.objects.iter().filter_map(|object| object.boundary);
    let mut used: Vec<u16> = boundaries.flat_map(|b| [b.interior, b.exterior]).flatten().collect();
    used.extend(description.world_medium);
    used.extend(description.camera_medium.flatten());
    used
}
