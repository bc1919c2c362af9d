//! Emitting shapes and their lights, by radiance, power or texture.

use super::kept::Baked;
use super::shape::{Form, Surface, placement};
use super::texture;
use super::{Parts, Problem};
use crate::parse::{EmissionRecord, Fault, TextureRecord};
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::geometry::Shape;
use beamfarm_render::world::light::{Light, LightKind, Pattern, Spread};
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::texture::graph::Space;
use glam::DAffine3;
use std::f64::consts::PI;
use std::sync::Arc;

impl Parts<'_> {
    /// Area in scene units squared.
    fn area(&mut self, surface: &Surface<'_>, map: &DAffine3, shape: &Shape) -> f64 {
        let m = map.matrix3;
        match &surface.form {
            Form::Sphere => match placement(map).uniform_scale() {
                Some(_) => {
                    let radius = libm::cbrt(m.determinant().abs());
                    4.0 * PI * radius * radius
                }
                None => f64::from(shape.area()),
            },
            // Strands do not emit.
            Form::Strands(_) => f64::from(shape.area()),
            Form::Disc => PI * m.x_axis.cross(m.y_axis).length(),
            Form::Cylinder => {
                // The mean over the circle of a tangent's cross product with the axis.
                let [x, y] = [m.x_axis, m.y_axis].map(|v| v.cross(m.z_axis));
                const N: u32 = 4096;
                let stretch = |i: u32| {
                    let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(N));
                    (y * cos - x * sin).length()
                };
                2.0 * PI * (0..N).map(stretch).sum::<f64>() / f64::from(N)
            }
            Form::Mesh(decoded) => {
                let Baked { area, .. } = self.baked(decoded, surface.record, map);
                *area.get_or_init(|| decoded.raw.area(map))
            }
        }
    }

    /// The light of an emitting shape, whose object is added next.
    pub(super) fn area_light(
        &mut self,
        surface: &Surface<'_>,
        map: &DAffine3,
        shape: &Shape,
        name: &str,
        space: Option<&Arc<Space>>,
    ) -> Result<Option<u32>, Problem> {
        let Some(emission) = surface.emission else {
            return Ok(None);
        };
        let EmissionRecord {
            radiance,
            scale,
            power,
            two_sided,
            spread,
            soft_falloff,
            ..
        } = emission.get_ref();
        let spread = spread.as_ref().and_then(|spread| Spread::new(spread.get_ref().0));
        let two_sided = *two_sided;
        let soft = soft_falloff.as_ref().filter(|soft| *soft.get_ref());
        if let Some(soft) = soft {
            let is_ball = matches!(surface.form, Form::Sphere) && placement(map).uniform_scale().is_some();
            let lets_all_pass = self.materials.list[surface.material as usize].has(BsdfFlags::NULL);
            let bounds_nothing = surface.boundary.is_none_or(|it| it.interior == it.exterior);
            if !is_ball || !lets_all_pass || !bounds_nothing {
                let message = "expected a sphere that is not stretched, of a material of type `null`, with one medium \
                               on both sides: it is what a point in or near a lamp sees";
                return Err(Fault::new(soft.span(), message).into());
            }
            let is_even = matches!(radiance, None | Some(TextureRecord::Color(_)));
            if two_sided || spread.is_some() || !is_even {
                let message = "it goes with neither `two_sided`, nor `spread`, nor a texture";
                return Err(Fault::new(soft.span(), message).into());
            }
        }
        let soft = soft.is_some();
        if let (Some(scale), None | Some(TextureRecord::Color(_))) = (scale, radiance) {
            return Err(Fault::new(scale.span(), "it multiplies a texture; `radiance` is none").into());
        }
        let mut pattern = None;
        let radiance = match (radiance, power) {
            (Some(TextureRecord::Color(radiance)), None) => radiance.rgb(),
            (Some(varying), None) => {
                let texture = texture::radiance(varying, &mut self.assets)?;
                if matches!(&texture, Texture::Graph(program) if program.reads().view) {
                    let message = "what it emits depends on where it is looked at from, which light does not: it shines \
                                   to all sides as seen from straight above";
                    self.notes.push(Fault::new(emission.span(), message).into());
                }
                let scale = scale.as_ref().map_or(Rgb::ONE, |scale| scale.get_ref().rgb());
                let Some((found, mean)) = Pattern::new(texture, scale, shape, space.cloned()) else {
                    return Ok(None);
                };
                pattern = Some(Arc::new(found));
                mean
            }
            (None, Some(power)) => {
                let area = self.area(surface, map, shape);
                let sides = if two_sided { 2.0 } else { 1.0 };
                power.over(sides * PI * area)
            }
            _ => {
                let message = "emission is given by `radiance` (W/(m^2 sr)) or by `power` (W): exactly one of them";
                return Err(Fault::new(emission.span(), message).into());
            }
        };
        if !radiance.is_finite() {
            return Err(Fault::new(emission.span(), "the radiance is too large for single precision").into());
        }
        if radiance == Rgb::ZERO {
            return Ok(None);
        }
        let group = emission.get_ref().group.as_deref().unwrap_or(name);
        self.lights.push(Light {
            name: name.to_string(),
            group: LightGroup::named(group),
            kind: LightKind::Area {
                object: self.objects.len() as u32,
                radiance,
                pattern,
                two_sided,
                spread,
                soft,
            },
        });
        Ok(Some((self.lights.len() - 1) as u32))
    }
}
