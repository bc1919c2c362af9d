//! Media, as in `kernels/medium.wgsl` and `kernels/phase.wgsl`.

use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::medium;
use beamfarm_render::world::phase;
use bytemuck::{Pod, Zeroable};

/// The constants that evaluate a phase function's lobe.
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
    /// For a mean cosine, times a share.
    #[must_use]
    pub fn new(g: f32, share: f32) -> Self {
        let phase::PhaseLobe {
            scale,
            peak,
            slope,
            sign,
        } = phase::PhaseLobe::new(g, share);
        Self {
            scale,
            peak,
            slope,
            sign,
        }
    }
}

/// A phase function: the values of both lobes add up.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Phase {
    /// The first lobe.
    pub first: PhaseLobe,
    /// The second lobe; zero if there is one only.
    pub second: PhaseLobe,
    /// Mean cosine of the first lobe.
    pub first_g: f32,
    /// Mean cosine of the second.
    pub second_g: f32,
    /// Share of the second.
    pub weight: f32,
}

impl From<phase::Phase> for Phase {
    fn from(phase: phase::Phase) -> Self {
        let (weight, [first_g, second_g]) = match phase {
            phase::Phase::Isotropic => (0.0, [0.0; 2]),
            phase::Phase::HenyeyGreenstein { g } => (0.0, [g, 0.0]),
            phase::Phase::Blend { weight, g } => (weight, g),
        };
        Self {
            first: PhaseLobe::new(first_g, 1.0 - weight),
            second: PhaseLobe::new(second_g, weight),
            first_g,
            second_g,
            weight,
        }
    }
}

/// A medium, RGB, per scene unit; at density 1 if its density varies.
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
    pub phase: Phase,
    padding: [u32; 2],
}

impl From<&medium::Medium> for Medium {
    fn from(medium: &medium::Medium) -> Self {
        Self {
            sigma_t: medium.sigma_t().to_array(),
            g: medium.phase().mean_cosine(),
            sigma_s: medium.sigma_s().to_array(),
            phase: medium.phase().into(),
            padding: [0; 2],
        }
    }
}

/// A scene's media by number; unused ones are vacuum.
pub(super) fn flatten(description: &SceneDescription) -> Vec<Medium> {
    let used = used(description);
    let flat = |(number, medium): (u16, &medium::Medium)| match used.contains(&number) {
        true => Medium::from(medium),
        false => Medium::zeroed(),
    };
    (0..).zip(&description.media).map(flat).collect()
}

/// Media that are used somewhere.
pub(super) fn used(description: &SceneDescription) -> Vec<u16> {
    let boundaries = description.objects.iter().filter_map(|object| object.boundary);
    let mut used: Vec<u16> = boundaries.flat_map(|b| [b.interior, b.exterior]).flatten().collect();
    used.extend(description.world_medium);
    used.extend(description.camera_medium.flatten());
    used
}
