//! Curves and points.

use super::{Parts, Problem, required};
use crate::assets::strands::RawStrands;
use crate::parse::{BasisName, Fault, ShapeRecord, ShapeType};
use crate::values::{Finite, Number};
use beamfarm_render::world::bsdf::{BsdfFlags, Material, MaterialKind};
use beamfarm_render::world::geometry::strands::Basis;
use beamfarm_render::world::geometry::{Object, Strands};
use glam::Vec4;
use std::sync::Arc;

impl Parts<'_> {
    /// A shape's curves or points, if it can have this material.
    pub(super) fn strands(&mut self, record: &ShapeRecord, material: u32) -> Result<Arc<Strands>, Problem> {
        let is_curves = *record.kind.get_ref() == ShapeType::Curves;
        let basis = match record.basis.as_ref().map(|basis| *basis.get_ref()) {
            _ if !is_curves => Basis::Balls,
            Some(BasisName::Linear) => Basis::Linear,
            Some(BasisName::CatmullRom) => Basis::CatmullRom,
            Some(BasisName::BSpline) | None => Basis::BSpline,
        };
        if is_curves && bounds_media(&self.materials.list[material as usize]) {
            let place = record.material.as_ref().map_or(record.kind.span(), |name| name.span());
            let message = "curves have no inside that light could go through; expected \"hair\", or another material that \
                           is no glass and bounds no medium";
            return Err(Fault::new(place, message).into());
        }
        match (&record.file, &record.points) {
            (Some(_), Some(points)) => Err(Fault::new(points.span(), "expected `file` or `points`, not both").into()),
            (None, Some(points)) => {
                let rows = points.get_ref().iter();
                let point =
                    |[x, y, z, radius]: &[Number<Finite>; 4]| Vec4::new(x.f32(), y.f32(), z.f32(), radius.f32());
                let raw = RawStrands {
                    points: rows.map(point).collect(),
                    lengths: vec![points.get_ref().len() as u32],
                };
                let strands = raw.to_strands(basis);
                Ok(Arc::new(
                    strands.map_err(|flaw| Fault::new(points.span(), flaw.message))?,
                ))
            }
            (_, None) => {
                let file = required(&record.file, &record.kind, "file")?;
                let radius = record.radius.as_ref().map(|radius| radius.get_ref().f32());
                self.assets.strands(file, basis, radius)
            }
        }
    }
}

/// A note on light that is lost on thin things: photons are not looked up there, and no path hits a light without a
/// size.
pub(super) fn note(parts: &Parts<'_>) -> Option<String> {
    let material = |object: &Object| &parts.materials.list[object.material as usize];
    let is_lost_on = |object: &&Object| material(object).has(BsdfFlags::THIN) && !material(object).is_specular();
    let thin = parts.objects.iter().find(is_lost_on)?;
    let is_specular = |object: &Object| {
        let material = material(object);
        material.has(BsdfFlags::DELTA) && !material.is_null()
    };
    let mirror = parts.objects.iter().find(|object| is_specular(object))?;
    parts.lights.iter().find(|light| light.kind.is_unmet())?;
    Some(format!(
        "light of lamps that have no size is not seen on {:?} where it comes by way of {:?} or other glass and mirrors; \
         give them a size, as a sphere that emits has, for that",
        thin.name, mirror.name
    ))
}

/// Whether the material, or part of a blend, refracts into an inside or is a pure boundary.
fn bounds_media(material: &Material) -> bool {
    match &material.kind {
        MaterialKind::Blend { parts, .. } => parts.iter().any(bounds_media),
        kind => kind.flags().intersects(BsdfFlags::BENDS | BsdfFlags::PASSABLE),
    }
}
