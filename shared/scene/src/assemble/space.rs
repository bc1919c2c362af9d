//! What graphs know about the place of an object's points.

use super::shape::{Form, Surface};
use super::{Parts, Problem};
use crate::parse::{Fault, ShapeRecord};
use crate::transform;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::texture::graph::{Space, hash};
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// Height slopes are sampled this share of the object's diagonal to either side.
const STEP: f64 = 1.0 / 2048.0;

impl Parts<'_> {
    /// A shape's space, if a graph reads it. `map`: from its unit form to render space; `instance`: from the record's
    /// space to the world.
    pub(super) fn space(
        &self,
        surface: &Surface<'_>,
        map: &DAffine3,
        instance: &DAffine3,
    ) -> Result<Option<Arc<Space>>, Problem> {
        let emission = surface.emission.map(|emission| emission.get_ref());
        let glows = emission.is_some_and(|emission| emission.radiance.as_ref().is_some_and(|r| r.is_graph()));
        let is_read = self.materials.list[surface.material as usize].has(BsdfFlags::READS_PLACE);
        if !is_read && !glows {
            return Ok(None);
        }
        Ok(Some(Arc::new(self.space_for(
            surface.record,
            &surface.form,
            map,
            instance,
        )?)))
    }

    /// The space of a shape of this form, whether or not a graph reads it.
    pub(super) fn space_for(
        &self,
        shape: &ShapeRecord,
        form: &Form,
        map: &DAffine3,
        instance: &DAffine3,
    ) -> Result<Space, Problem> {
        let record = shape.space.as_ref().map(|space| space.get_ref());
        let own_from_file = match record.and_then(|space| space.matrix.as_ref()) {
            Some(rows) => of_rows(rows).ok_or_else(|| {
                let place = shape.space.as_ref().map_or(0..0, |space| space.span());
                Fault::new(
                    place,
                    "`matrix` of a space: expected four rows of four numbers, the last [0, 0, 0, 1]",
                )
            })?,
            None => transform_of(shape)?.inverse(),
        };
        let own_from_world = own_from_file * instance.inverse();
        let world_from_unit = DAffine3::from_translation(self.render_origin) * *map;
        let [low, high] = match record.and_then(|space| space.bounds) {
            Some([low, high]) => [low.0, high.0],
            None => bounds(form, &(own_from_world * world_from_unit)),
        };
        let diagonal = own_from_world.inverse().transform_vector3(high - low).length();
        // Instances of one shape get different random numbers.
        let number = self.objects.len() as f32;
        let random = match record.and_then(|space| space.random) {
            Some(random) if *instance == DAffine3::IDENTITY => random.f32(),
            Some(random) => hash::of_floats([random.f32(), number]),
            None => hash::of_floats([number]),
        };
        Ok(Space {
            world_from_render: self.render_origin.as_vec3(),
            own_from_world: transform::single(&own_from_world),
            bounds: [low.as_vec3(), high.as_vec3()],
            random,
            location: match record.and_then(|space| space.location) {
                Some(location) => instance.transform_point3(location.0).as_vec3(),
                None => own_from_world.inverse().translation.as_vec3(),
            },
            index: record.and_then(|space| space.index).map_or(0.0, |index| index.f32()),
            step: ((diagonal * STEP) as f32).max(f32::MIN_POSITIVE),
        })
    }
}

/// From the object space that a shape's graph reads to the world, unless the record says otherwise.
fn transform_of(record: &ShapeRecord) -> Result<DAffine3, Fault> {
    match &record.transform {
        Some(steps) => transform::compose(steps.get_ref()),
        None => Ok(DAffine3::IDENTITY),
    }
}

/// The bounding box of a form under a map.
fn bounds(form: &Form, map: &DAffine3) -> [DVec3; 2] {
    let around = |points: &mut dyn Iterator<Item = DVec3>| {
        points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
            let p = map.transform_point3(p);
            [low.min(p), high.max(p)]
        })
    };
    let corners = |low: f64, high: f64| {
        let side = move |i: u32, axis: u32| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
        (0..8u32).map(move |i| DVec3::new(side(i, 0), side(i, 1), if i >> 2 & 1 == 0 { low } else { high }))
    };
    match form {
        Form::Sphere => {
            // The extent along each axis is the length of the matrix row.
            let m = map.matrix3.transpose();
            let reach = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
            [map.translation - reach, map.translation + reach]
        }
        Form::Disc => around(&mut corners(0.0, 0.0)),
        Form::Cylinder => around(&mut corners(0.0, 1.0)),
        Form::Strands(strands) => {
            let [low, high] = strands.corners().map(|corner| corner.as_dvec3());
            let corner = |i: u32| {
                let side = |axis: u32, low: f64, high: f64| if i >> axis & 1 == 0 { low } else { high };
                DVec3::new(side(0, low.x, high.x), side(1, low.y, high.y), side(2, low.z, high.z))
            };
            around(&mut (0..8).map(corner))
        }
        Form::Mesh(decoded) => around(&mut decoded.raw.positions.iter().copied()),
    }
}

fn of_rows(rows: &[Vec<crate::values::Number<crate::values::Finite>>]) -> Option<DAffine3> {
    let row = |i: usize| rows.get(i).filter(|row| row.len() == 4);
    let [x, y, z, w] = [row(0)?, row(1)?, row(2)?, row(3)?];
    let last: Vec<f64> = w.iter().map(|x| x.0).collect();
    let column = |i: usize| DVec3::new(x[i].0, y[i].0, z[i].0);
    let map = DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    };
    (rows.len() == 4 && last == [0.0, 0.0, 0.0, 1.0] && transform::is_invertible(&map)).then_some(map)
}
