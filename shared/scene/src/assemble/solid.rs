//! What a shape bounds, and whether it can.

use super::shape::{Form, flips};
use super::{Parts, Problem};
use crate::parse::{Fault, ShapeRecord};
use crate::values::Spanned;
use beamfarm_render::world::bsdf::{BsdfFlags, Subsurface};
use beamfarm_render::world::geometry::Boundary;

/// Why a form never has an inside.
fn never_closed(form: &Form) -> Option<&'static str> {
    match form {
        Form::Disc => Some("a disc has no inside"),
        Form::Cylinder => Some("a cylinder has no ends"),
        Form::Sphere | Form::Mesh(_) | Form::Strands(_) => None,
    }
}

impl Parts<'_> {
    /// Subsurface needs a closed shape: the material itself, or, on an open shape, its version without subsurface.
    pub(super) fn closed_or_diffuse(&mut self, record: &ShapeRecord, form: &Form, material: u32) -> u32 {
        let surface = &self.materials.list[material as usize];
        let is_meant = record.open.as_ref().is_some_and(|open| *open.get_ref());
        if surface.subsurface().is_none() || is_meant {
            return material;
        }
        let opening = match form {
            Form::Mesh(decoded) => decoded.solid().as_ref().err().map(ToString::to_string),
            Form::Strands(_) => Some("curves and points bound no medium".to_string()),
            Form::Sphere | Form::Disc | Form::Cylinder => never_closed(form).map(str::to_string),
        };
        let Some(opening) = opening else { return material };
        let message = format!(
            "subsurface scattering needs a closed surface; here it is diffuse in its place, without what comes \
             through: {opening}"
        );
        let place = record.material.as_ref().map_or(record.kind.span(), Spanned::span);
        self.notes.push(Fault::new(place, message).into());
        self.materials.without_subsurface(material)
    }

    /// The media inside and outside, if light passes through the material.
    pub(super) fn boundary(&mut self, record: &ShapeRecord, material: u32) -> Result<Option<Boundary>, Problem> {
        let surface = &self.materials.list[material as usize];
        let transmits = surface.has(BsdfFlags::BOUNDS_MEDIA);
        let is_diffuse = !surface.has(BsdfFlags::BENDS | BsdfFlags::PASSABLE);
        let beneath = surface.subsurface().map(Subsurface::medium);
        if !transmits {
            let names = record.interior.as_ref().or(record.exterior.as_ref());
            let place = names.map(Spanned::span).or(record.priority.as_ref().map(Spanned::span));
            return match place {
                None => Ok(None),
                Some(place) => Err(Fault::new(
                    place,
                    "this surface bounds no medium; expected a material of type \"dielectric\", \
                     \"rough_dielectric\" or \"null\" without `opacity` on this shape, \"principled\" with \
                     `spec_trans`, or a blend of one with what lets no light through",
                )
                .into()),
            };
        }
        if let Some(place) = &record.boundary
            && !place.get_ref()
        {
            return match record.interior.is_some() || record.exterior.is_some() {
                false => Ok(None),
                true => {
                    let message = "what is no boundary takes neither `interior` nor `exterior`";
                    Err(Fault::new(place.span(), message).into())
                }
            };
        }
        if let Some(medium) = beneath {
            if let Some(interior) = &record.interior {
                let message = "this surface has the medium of its `subsurface` inside; expected no other";
                return Err(Fault::new(interior.span(), message).into());
            }
            let label = self.materials.labels.get(&material).map_or("", String::as_str);
            let Some(interior) = self.media.beneath(material, label, medium) else {
                return Err(Fault::new(record.kind.span(), "more than 65535 media").into());
            };
            return Ok(Some(Boundary {
                interior: Some(interior),
                exterior: self.media.resolve_or(record.exterior.as_ref(), self.world_medium)?,
            }));
        }
        // A translucent diffuse surface may be a leaf: it has an inside only where the scene names one.
        if is_diffuse && record.interior.is_none() && record.exterior.is_none() {
            return Ok(None);
        }
        Ok(Some(Boundary {
            interior: self.media.resolve_or(record.interior.as_ref(), None)?,
            exterior: self.media.resolve_or(record.exterior.as_ref(), self.world_medium)?,
        }))
    }

    /// Glass and shapes that bound a medium must be closed. Returns the form, mended when only one solid can be meant.
    pub(super) fn solid(
        &mut self,
        record: &ShapeRecord,
        form: Form,
        material: u32,
        boundary: Option<Boundary>,
    ) -> Result<Form, Problem> {
        let surface = &self.materials.list[material as usize];
        let bends = surface.has(BsdfFlags::BENDS) && surface.has(BsdfFlags::BOUNDS_MEDIA);
        let media = boundary.filter(|boundary| boundary.interior != boundary.exterior);
        if !bends && media.is_none() {
            return Ok(form);
        }
        self.tell_of_crossing(record, &form);
        let opening = match &form {
            // A sphere is closed, and so are points; curves never have a material that bounds a medium.
            Form::Sphere | Form::Strands(_) => return Ok(form),
            Form::Disc | Form::Cylinder => never_closed(&form).unwrap_or_default().to_string(),
            Form::Mesh(decoded) => match decoded.solid() {
                // The user reversed it by hand.
                Ok(solid) if flips(record) && solid.doubled + solid.cut == 0 && solid.is_turned_as_one(decoded) => {
                    return Ok(form);
                }
                Ok(solid) if !flips(record) => {
                    let Some(mended) = &solid.mended else { return Ok(form) };
                    let place = record.file.as_ref().map_or(record.kind.span(), Spanned::span);
                    self.notes
                        .push(Fault::new(place, format!("the mesh is mended: {solid}")).into());
                    return Ok(Form::Mesh(mended.clone()));
                }
                Ok(solid) => format!("{solid}, which `flip_normals` would undo"),
                Err(opening) => opening.to_string(),
            },
        };
        let place = [&record.interior, &record.exterior, &record.material]
            .into_iter()
            .flatten()
            .next();
        let place = place.map_or(record.kind.span(), Spanned::span);
        let is_meant = record.open.as_ref().is_some_and(|open| *open.get_ref());
        let message = match media {
            None if is_meant => return Ok(form),
            None => format!(
                "glass that is open is darker or brighter than it should be: {opening}; a pane without thickness is \
                 a material of type \"thin_dielectric\", and `open = true` says that it is meant so, as the surface \
                 of water in a basin"
            ),
            Some(Boundary { interior, exterior }) => {
                let (inside, outside) = (self.media.name(interior), self.media.name(exterior));
                let media = format!("the media \"{inside}\" (inside) and \"{outside}\" (outside)");
                if !is_meant {
                    let message = format!("an open surface cannot be the boundary between {media}: {opening}");
                    return Err(Fault::new(place, message).into());
                }
                format!(
                    "an open surface is the boundary between {media}: its last crossing says which of them light is in"
                )
            }
        };
        self.notes.push(Fault::new(place, message).into());
        Ok(form)
    }

    /// Note parts of a mesh that cross: where they overlap, two boundaries enclose one place.
    fn tell_of_crossing(&mut self, record: &ShapeRecord, form: &Form) {
        let Form::Mesh(decoded) = form else { return };
        let Ok(solid) = decoded.solid() else { return };
        let Some(at) = solid.crossing else { return };
        let place = record.file.as_ref().map_or(record.kind.span(), Spanned::span);
        let name = record
            .name
            .as_ref()
            .map_or(String::new(), |name| format!(" of \"{name}\""));
        let at = at.as_vec3().to_array();
        let message = format!(
            "the mesh{name} has parts that cross each other, at {at:?} of its own space: light meets surfaces of each \
             inside of the other, and is darker or brighter than it should be; unite them, as Blender's boolean \
             modifier does, or leave a gap"
        );
        self.notes.push(Fault::new(place, message).into());
    }
}
