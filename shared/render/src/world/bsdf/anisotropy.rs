//! Microfacets that are rougher along a tangent of the surface than across it, as brushed metal is, or the other way
//! around.

use super::BsdfFlags;
use super::microfacet::MIN_ALPHA;
use crate::math::{Frame, PI, Vec3, sin_cos};
use crate::world::geometry::{Object, SurfaceHit};
use crate::world::scalar::Scalar;
use crate::world::texture::TexturePoint;

/// How microfacets differ by direction: of rough conductors, rough dielectrics and principled surfaces.
#[derive(Clone, Debug)]
pub struct Anisotropy {
    /// How much.
    pub stretch: Stretch,
    /// Turns of the tangent around the shading normal, from 0 to 1, counter-clockwise seen from outside.
    pub rotation: Scalar,
    /// What it is along where it is not turned.
    pub tangent: Tangent,
}

/// Roughness along the tangent and across it.
#[derive(Clone, Debug)]
pub enum Stretch {
    /// That of the material's kind is along the tangent, this one across, at least 1e-3 (less counts as that).
    Across(Scalar),
    /// From 0 to 1: that of the kind over an aspect along the tangent, and times it across, the aspect being
    /// `sqrt(1 - 0.9 x)` (Burley 2012, section 5.4).
    Burley(Scalar),
    /// From 0 to 1: that of the kind is across, the one along the tangent is so far from it to 1, squared
    /// (KHR_materials_anisotropy).
    Strength(Scalar),
}

/// What a tangent is along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// The surface's u.
    U,
    /// Circles around this axis of the object, x, y or z, through the middle of the box around it, drawn out as that
    /// is.
    Around(usize),
}

impl Anisotropy {
    fn scalar(&self) -> &Scalar {
        match &self.stretch {
            Stretch::Across(scalar) | Stretch::Burley(scalar) | Stretch::Strength(scalar) => scalar,
        }
    }

    /// The geometric mean of both roughnesses, and the root of that across over that along. `alpha`: of the kind.
    pub(super) fn stretched(&self, alpha: f32, at: &TexturePoint) -> [f32; 2] {
        let alpha = alpha.max(MIN_ALPHA);
        match &self.stretch {
            Stretch::Burley(anisotropic) => {
                let aspect = (1.0 - 0.9 * anisotropic.eval(at)).sqrt();
                [alpha, aspect.max(MIN_ALPHA / alpha)]
            }
            Stretch::Across(across) => of_both(alpha, across.eval(at).max(MIN_ALPHA)),
            Stretch::Strength(strength) => of_both(towards_one(alpha, strength.eval(at)), alpha),
        }
    }

    /// Between which numbers the mean is, by those of the kind's roughness.
    pub(super) fn range(&self, alphas: [f32; 2]) -> [f32; 2] {
        let [alphas, others] = [alphas, self.scalar().range()].map(|range| range.map(|x| x.max(MIN_ALPHA)));
        match &self.stretch {
            Stretch::Burley(_) => alphas,
            Stretch::Across(_) => [0, 1].map(|i| (alphas[i] * others[i]).sqrt()),
            Stretch::Strength(_) => [0, 1].map(|i| (towards_one(alphas[i], others[i]) * alphas[i]).sqrt()),
        }
    }

    pub(super) fn flags(&self) -> BsdfFlags {
        use BsdfFlags as F;
        let around = matches!(self.tangent, Tangent::Around(_));
        F::ALONG_U | F::READS_PLACE.when(around) | F::reading([self.scalar().texture(), self.rotation.texture()])
    }

    /// The frame around a hit's shading normal, along the tangent. Any frame where the surface has no tangent.
    pub(crate) fn frame(&self, object: &Object, hit: &SurfaceHit) -> Frame {
        let given = match self.tangent {
            Tangent::U => object.shape.given_tangents(hit),
            Tangent::Around(_) => None,
        };
        let along = match self.tangent {
            _ if given.is_some() => given.map(|[along, _]| along),
            Tangent::U => object.shape.smooth_tangent(hit),
            Tangent::Around(axis) => object.space.as_ref().map(|space| space.around(axis, &hit.at.place)),
        };
        let frame = along.map_or(Frame::from_normal(hit.ns), |along| Frame::along(along, hit.ns));
        let rotation = self.rotation.eval(&hit.at);
        if rotation == 0.0 {
            return frame;
        }
        // From one given tangent to the other.
        let side = given.map_or(1.0, |[_, across]| frame.t.dot(across).signum());
        let (sin, cos) = sin_cos(2.0 * PI * rotation * side);
        let s: Vec3 = frame.s * cos + frame.t * sin;
        Frame {
            s,
            t: frame.n.cross(s),
            n: frame.n,
        }
    }
}

/// Those of the roughness along a tangent and across it.
fn of_both(along: f32, across: f32) -> [f32; 2] {
    match along == across {
        true => [along, 1.0],
        false => [(along * across).sqrt(), (across / along).sqrt()],
    }
}

fn towards_one(alpha: f32, strength: f32) -> f32 {
    alpha + (1.0 - alpha) * strength * strength
}
