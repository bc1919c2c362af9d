//! Microfacets whose roughness along a tangent of the surface differs from that across it, as on brushed metal.

use super::BsdfFlags;
use super::microfacet::MIN_ALPHA;
use crate::math::{Frame, PI, Vec3, sin_cos};
use crate::world::geometry::{Object, SurfaceHit};
use crate::world::scalar::Scalar;
use crate::world::texture::TexturePoint;

/// How microfacets depend on direction, for rough conductors, rough dielectrics and principled surfaces.
#[derive(Clone, Debug)]
pub struct Anisotropy {
    /// How strongly.
    pub stretch: Stretch,
    /// Turns of the tangent around the shading normal, from 0 to 1, counter-clockwise seen from outside.
    pub rotation: Scalar,
    /// Direction of the unrotated tangent.
    pub tangent: Tangent,
}

/// Roughness along the tangent and across it.
#[derive(Clone, Debug)]
pub enum Stretch {
    /// The material's own roughness counts along the tangent, this one across; at least 1e-3 (smaller values are raised
    /// to that).
    Across(Scalar),
    /// From 0 to 1. The material's roughness is divided by an aspect along the tangent and multiplied by it across; the
    /// aspect is `sqrt(1 - 0.9 x)` (Burley 2012, section 5.4).
    Burley(Scalar),
    /// From 0 to 1. The material's roughness counts across; along the tangent it moves towards 1 by the square of this
    /// (KHR_materials_anisotropy).
    Strength(Scalar),
}

/// Direction of a tangent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// The surface's u.
    U,
    /// Circles around the object's x, y or z axis through the centre of its bounding box, stretched as the box is.
    Around(usize),
}

impl Anisotropy {
    fn scalar(&self) -> &Scalar {
        match &self.stretch {
            Stretch::Across(scalar) | Stretch::Burley(scalar) | Stretch::Strength(scalar) => scalar,
        }
    }

    /// The geometric mean of both roughnesses, and the square root of (across / along). `alpha`: the material's
    /// roughness.
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

    /// Range of the mean, given the range of the material's roughness.
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

    /// The frame around a hit's shading normal, x along the tangent. Any frame where the surface has no tangent.
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

/// Mean and aspect of the roughnesses along a tangent and across it.
fn of_both(along: f32, across: f32) -> [f32; 2] {
    match along == across {
        true => [along, 1.0],
        false => [(along * across).sqrt(), (across / along).sqrt()],
    }
}

fn towards_one(alpha: f32, strength: f32) -> f32 {
    alpha + (1.0 - alpha) * strength * strength
}
