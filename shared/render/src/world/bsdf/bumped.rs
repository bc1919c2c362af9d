//! Bump shadowing, for diffuse lobes and fibres only. A microfacet reflection comes from the slopes themselves;
//! shadowing it would darken it where nothing blocks the light and give mirrors black rings. Cycles makes the same
//! distinction.

use super::{Bsdf, BsdfSample, BumpShadowing, TransportMode};
use crate::math::{Rgb, Vec3};

/// Which lobes of a surface are shadowed.
enum Shadowed {
    None,
    All,
    /// Those beneath a gloss.
    Base,
}

impl Shadowed {
    fn base_if(is_there: bool) -> Self {
        match is_there {
            true => Self::Base,
            false => Self::None,
        }
    }
}

impl Bsdf<'_> {
    fn shadowed(&self) -> Shadowed {
        match self {
            // The value of plastic excludes its smooth coat.
            Self::Diffuse { .. } | Self::OrenNayar(_) | Self::Translucent(_) | Self::Sheen(_) | Self::Plastic(_) => {
                Shadowed::All
            }
            Self::RoughPlastic(b) => Shadowed::base_if(b.has_base()),
            Self::Principled(b) => Shadowed::base_if(b.has_base()),
            Self::Layered(b) => Shadowed::base_if(b.has_base()),
            Self::Black
            | Self::Velvet(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::Conductor { .. }
            | Self::Mirror { .. }
            | Self::RoughConductor(_)
            | Self::RoughDielectric(_)
            | Self::Hair(_)
            | Self::Null => Shadowed::None,
        }
    }

    /// The same with a factor on the value of what lies beneath a gloss. Sample directions from the unmodified surface.
    fn with_base_lit(self, factor: f32) -> Self {
        match self {
            Self::RoughPlastic(b) => Self::RoughPlastic(b.with_base_lit(factor)),
            Self::Principled(b) => Self::Principled(b.with_base_lit(factor)),
            Self::Layered(b) => Self::Layered(b.with_base_lit(factor)),
            other => other,
        }
    }

    /// [`Self::eval`] of a surface whose bumps may shadow it.
    #[inline]
    pub fn eval_bumped(&self, bumps: Option<&BumpShadowing>, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        match bumps {
            None => self.eval(wo, wi, mode),
            Some(bumps) => self.eval_shadowed(bumps, wo, wi, mode),
        }
    }

    #[inline(never)]
    fn eval_shadowed(&self, bumps: &BumpShadowing, wo: Vec3, wi: Vec3, mode: TransportMode) -> Rgb {
        let factor = || bumps.factor(mode.towards_light(wo, wi));
        match self.shadowed() {
            Shadowed::None => self.eval(wo, wi, mode),
            Shadowed::All => self.eval(wo, wi, mode) * factor(),
            Shadowed::Base => self.with_base_lit(factor()).eval(wo, wi, mode),
        }
    }

    /// The weight of a sample drawn from `wo`, for a surface whose bumps may shadow it.
    #[inline]
    pub fn weight_bumped(
        &self,
        bumps: Option<&BumpShadowing>,
        wo: Vec3,
        sample: &BsdfSample,
        mode: TransportMode,
    ) -> Rgb {
        match bumps {
            None => sample.weight,
            Some(bumps) => self.weight_shadowed(bumps, wo, sample, mode),
        }
    }

    #[inline(never)]
    fn weight_shadowed(&self, bumps: &BumpShadowing, wo: Vec3, sample: &BsdfSample, mode: TransportMode) -> Rgb {
        if sample.delta {
            return sample.weight;
        }
        let wi = sample.wi;
        let factor = || bumps.factor(mode.towards_light(wo, wi));
        match self.shadowed() {
            Shadowed::None => sample.weight,
            Shadowed::All => sample.weight * factor(),
            Shadowed::Base => match factor() {
                1.0 => sample.weight,
                factor => self.with_base_lit(factor).eval(wo, wi, mode) * (wi.z.abs() / sample.pdf),
            },
        }
    }
}
