//! Which part of a blend light meets, and whether it meets anything where a surface is not opaque.
//!
//! A path takes one part at each vertex, with its weight as the probability. Every density of the path has this factor,
//! however the path is found, so that no other code has to know of it.

use super::{Material, MaterialKind};
use crate::math::luminance;
use crate::world::texture::{Texture, TexturePoint};

impl Material {
    /// What light meets: the material itself; one part of a blend, by chance; or nothing, at boundaries of media and by
    /// chance where the surface is not opaque, so that light goes straight on. `draw` yields uniform numbers and is
    /// called only where there is a choice.
    #[inline]
    pub fn met(&self, at: &TexturePoint, mut draw: impl FnMut() -> f32) -> Option<&Self> {
        if let MaterialKind::Blend { .. } = self.kind {
            return self.met_part(at, &mut draw);
        }
        (!self.is_passed(at, draw)).then_some(self)
    }

    #[inline(never)]
    fn met_part(&self, at: &TexturePoint, draw: &mut dyn FnMut() -> f32) -> Option<&Self> {
        let mut material = self;
        while !material.is_passed(at, &mut *draw) {
            let MaterialKind::Blend { parts, weight } = &material.kind else {
                return Some(material);
            };
            material = &parts[usize::from(draw() < share_of_rays(weight, at))];
        }
        None
    }

    #[inline]
    fn is_passed(&self, at: &TexturePoint, draw: impl FnOnce() -> f32) -> bool {
        match &self.opacity {
            None => self.is_null(),
            Some(opacity) => draw() >= share_of_rays(opacity, at),
        }
    }

    /// The share of light that goes straight through, averaged over [`Self::met`].
    #[inline]
    pub fn transparency(&self, at: &TexturePoint) -> f32 {
        let passed = match &self.opacity {
            None => f32::from(self.is_null()),
            Some(opacity) => 1.0 - share_of_rays(opacity, at),
        };
        let MaterialKind::Blend { parts, weight } = &self.kind else {
            return passed;
        };
        let [first, second] = &**parts;
        let weight = share_of_rays(weight, at);
        let through = (1.0 - weight) * first.transparency(at) + weight * second.transparency(at);
        passed + (1.0 - passed) * through
    }

    /// Whether nothing is reflected at this point.
    pub fn is_black_at(&self, at: &TexturePoint) -> bool {
        if let MaterialKind::Blend { parts, .. } = &self.kind {
            return parts.iter().all(|part| part.is_black_at(at));
        }
        self.bsdf(at).is_black()
    }
}

/// Share of rays that an opacity or a weight stands for, in [0, 1]: its luminance. Exact for greys, so that opaque
/// surfaces let nothing through.
#[inline]
pub fn share_of_rays(texture: &Texture, at: &TexturePoint) -> f32 {
    let c = texture.eval(at);
    (c.x + luminance(c - c.x)).clamp(0.0, 1.0)
}
