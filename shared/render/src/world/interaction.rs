//! Surface interactions.

use super::Scene;
use crate::math::{Frame, Vec3};
use crate::world::bsdf::{Bsdf, BsdfFlags, BumpShadowing, Material, NormalPerturbation, Perturbed};
use crate::world::geometry::SurfaceHit;
use crate::world::spectrum::Wave;

/// A surface at a hit, with its shading normal perturbed and its textures looked up.
pub struct SurfaceInteraction<'a> {
    /// Its material.
    pub material: &'a Material,
    /// The material's BSDF at the hit.
    pub bsdf: Bsdf<'a>,
    /// Present if a bump or normal map has perturbed the hit's shading normal.
    pub bump_shadowing: Option<BumpShadowing>,
    /// The frame around the shading normal.
    pub frame: Frame,
    /// Where the path comes from, in render space.
    pub wo: Vec3,
    /// The same in the frame.
    pub local_wo: Vec3,
}

impl Scene {
    /// The surface at a hit of a ray with this direction. `material`: what the ray meets there ([`Material::met`]). For
    /// light of a wavelength, if it has one. Perturbs the hit's shading normal.
    #[inline]
    pub fn interaction<'a>(
        &self,
        material: &'a Material,
        hit: &mut SurfaceHit,
        dir: Vec3,
        wave: Option<Wave>,
    ) -> SurfaceInteraction<'a> {
        let wo = -dir;
        let bump_shadowing = self.perturb_normal(material, hit, wo);
        let frame = self.frame(material, hit);
        let bump_shadowing = bump_shadowing.map(|shadowing| shadowing.seen_in(&frame));
        let mut bsdf = material.bsdf_for(&hit.at, wave);
        if material.has(BsdfFlags::FACES_TWO_WAYS) {
            bsdf = bsdf.facing(self.two_normals(material, hit, wo).map(|n| frame.to_local(n)));
        }
        SurfaceInteraction {
            material,
            bsdf,
            bump_shadowing,
            frame,
            wo,
            local_wo: frame.to_local(wo),
        }
    }

    /// Perturbs the hit's shading normal by the material's bump or normal map, if any, seen from `wo`.
    #[inline]
    fn perturb_normal(&self, material: &Material, hit: &mut SurfaceHit, wo: Vec3) -> Option<BumpShadowing> {
        if material.has(BsdfFlags::FACES_TWO_WAYS) {
            return Some(BumpShadowing::of_lobes(hit.ns));
        }
        let map = material.normal_perturbation.as_ref()?;
        let (ns, shadowing) = map.normal(hit, &self.perturbed(hit, map, material.reflects_upwards()), wo);
        hit.ns = ns;
        Some(shadowing)
    }

    #[inline]
    fn perturbed(&self, hit: &SurfaceHit, map: &NormalPerturbation, mirrors: bool) -> Perturbed<'_> {
        let object = &self.objects()[hit.object as usize];
        let given = match map {
            NormalPerturbation::NormalMap(_) => object.shape.given_tangents(hit),
            NormalPerturbation::BumpMap { .. } | NormalPerturbation::Layers(_) => None,
        };
        Perturbed {
            tangents: given.unwrap_or_else(|| object.shape.tangents(hit)),
            space: object.space.as_deref(),
            mirrors,
            along_v: object.shape.mesh().is_some(),
        }
    }

    /// Normals of the layer below a coat, and of the coat.
    #[inline(never)]
    fn two_normals(&self, material: &Material, hit: &SurfaceHit, wo: Vec3) -> [Vec3; 2] {
        material.faces().map(|(map, mirrors)| match map {
            None => hit.ns,
            Some(map) => map.normal(hit, &self.perturbed(hit, map, mirrors), wo).0,
        })
    }

    /// The local frame of a hit: around the shading normal, and along a tangent if the material needs one.
    #[inline]
    pub(crate) fn frame(&self, material: &Material, hit: &SurfaceHit) -> Frame {
        match material.has(BsdfFlags::ALONG_U) {
            true => self.frame_along(material, hit),
            false => Frame::from_normal(hit.ns),
        }
    }

    #[inline(never)]
    fn frame_along(&self, material: &Material, hit: &SurfaceHit) -> Frame {
        let object = &self.objects()[hit.object as usize];
        match &material.anisotropy {
            None => Frame::along(object.shape.tangents(hit)[0], hit.ns),
            Some(anisotropy) => anisotropy.frame(object, hit),
        }
    }
}
