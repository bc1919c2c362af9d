//! Emitting media and their lights.

use super::density;
use super::texture::graph::black_body_colors;
use super::{Assets, Parts, Problem};
use crate::parse::{Fault, FieldRecord, GlowRecord, MediumRecord, TemperatureRecord, VolumeEmissionRecord};
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::geometry::{Object, Shape, bounds};
use beamfarm_render::world::light::{
    BlackBodies, Dark, EmissionField, Filled, Heat, Light, LightKind, VolumeEmission, VolumeLight,
};
use beamfarm_render::world::medium::Medium;
use glam::DVec3;
use std::ops::Range;
use std::sync::Arc;

/// What a medium emits, if anything, and where that is written.
pub fn emitted(
    record: &MediumRecord,
    medium: &Medium,
    render_origin: DVec3,
    assets: &mut Assets<'_>,
) -> Result<Option<(VolumeEmission, Range<usize>)>, Problem> {
    let Some(given) = &record.emission else {
        return Ok(None);
    };
    let table = match given.get_ref() {
        VolumeEmissionRecord::Color(color) => {
            return Ok(Some((VolumeEmission::even(color.rgb()), given.span())));
        }
        VolumeEmissionRecord::Table(table) => table,
    };
    let mut field = |field: &FieldRecord, place: Range<usize>| -> Result<EmissionField, Problem> {
        let to_render = density::to_render(record, render_origin)?;
        let bricks = match field {
            FieldRecord::Grid(grid) => {
                let bricks = density::bricks((grid, place.clone()), assets)?;
                density::corners(record, &bricks, &to_render, place)?;
                bricks
            }
            FieldRecord::Density => match medium {
                Medium::Heterogeneous(medium) => medium.shared_bricks().clone(),
                Medium::Homogeneous(_) => {
                    let message = "a \"homogeneous\" medium has no density that varies; expected { file = \"volume\" } \
                                   or a recipe";
                    return Err(Fault::new(place, message).into());
                }
            },
        };
        Ok(EmissionField::new(bricks, to_render))
    };
    let GlowRecord {
        color,
        scale,
        field: by,
        temperature,
        kelvin,
    } = &**table;
    let scale = scale.as_ref().map_or(1.0, |scale| scale.0);
    let color = color.as_ref().map_or([1.0; 3], |color| color.0);
    let kelvin = kelvin.as_ref().map_or(1.0, |kelvin| kelvin.get_ref().0);
    let by = by.as_ref().map(|by| field(by.get_ref(), by.span())).transpose()?;
    let heat = match temperature {
        None => None,
        Some(temperature) => {
            let (number, by) = match temperature.get_ref() {
                TemperatureRecord::Number(number) => (number.0, None),
                TemperatureRecord::Field(by) => (1.0, Some(field(by, temperature.span())?)),
            };
            Some(Heat {
                field: by,
                kelvin: (number * kelvin) as f32,
                bodies: black_bodies(),
            })
        }
    };
    let emission = VolumeEmission {
        color: Rgb::from_array(color.map(|c| (c * scale) as f32)),
        field: by,
        heat,
    };
    if !emission.max().is_finite() {
        let message = "where it emits most that is too large for single precision";
        return Err(Fault::new(given.span(), message).into());
    }
    Ok(Some((emission, given.span())))
}

fn black_bodies() -> Arc<BlackBodies> {
    let (range, colors) = black_body_colors();
    Arc::new(BlackBodies::new(range, colors))
}

impl Parts<'_> {
    /// Add a light for each emitting medium.
    pub(super) fn add_volume_lights(&mut self) -> Result<(), Problem> {
        for (number, emitted) in std::mem::take(&mut self.media.emitted).into_iter().enumerate() {
            let Some((emission, place)) = emitted else { continue };
            let medium = number as u16;
            if emission.field().is_none() {
                self.check_bounds(medium, &place)?;
            }
            let holds = |object: &&Object| object.boundary.is_some_and(|it| it.interior == Some(medium));
            let filled: Vec<Filled> = self.objects.iter().filter(holds).map(filled).collect();
            let name = self.media.name(Some(medium)).to_owned();
            match VolumeLight::new(medium, emission, &filled) {
                Ok(light) => {
                    let lights = self.lights.len()..self.lights.len() + 1;
                    let objects = self.objects.len();
                    self.names.add(&name, &[], None, objects..objects, lights);
                    self.lights.push(Light {
                        group: LightGroup::named(&name),
                        name,
                        kind: LightKind::Volume(Arc::new(light)),
                    });
                }
                Err(Dark::Nothing) => {}
                Err(Dark::NoObject) => {
                    let message = "no shape has this medium inside: it emits nothing";
                    self.notes.push(Fault::new(place, message).into());
                }
            }
        }
        Ok(())
    }

    /// Uniform emission must be bounded.
    fn check_bounds(&self, medium: u16, place: &Range<usize>) -> Result<(), Fault> {
        if self.world_medium == Some(medium) {
            let message = "the world's medium has no end, and would be bright without end; expected an emission with a \
                           grid (`field`, or as `temperature`), or a shape that has the medium inside";
            return Err(Fault::new(place.clone(), message));
        }
        let mut objects = self.objects.iter();
        let is_open = |object: &&Object| {
            object.boundary.is_some_and(|it| it.interior == Some(medium)) && object.shape.is_inside_out()
        };
        match objects.find(is_open) {
            None => Ok(()),
            Some(object) => {
                let message = format!(
                    "{:?}, which has the medium inside, is inside out: it is all around, and would be bright without end",
                    object.name
                );
                Err(Fault::new(place.clone(), message))
            }
        }
    }
}

/// The box of an object, and its volume.
fn filled(object: &Object) -> Filled {
    let (low, high) = bounds(&object.shape);
    let of_box = (high - low).as_dvec3().element_product();
    let scaled = |map: glam::Affine3A| f64::from(map.matrix3.determinant().abs());
    let volume = match &object.shape {
        Shape::Sphere { placement, .. } => scaled(placement.render_from_object) * 4.0 / 3.0 * std::f64::consts::PI,
        Shape::Mesh { mesh, placement } if mesh.is_closed() => {
            mesh.signed_volume().abs() * scaled(placement.render_from_object)
        }
        Shape::Mesh { .. } | Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => of_box,
    };
    Filled {
        low,
        high,
        volume: volume.min(of_box),
    }
}
