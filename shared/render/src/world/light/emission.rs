//! Where photon paths start.

use super::{EmissionSample, EmissionUniforms, Light, LightKind, SceneBounds};
use crate::math::{Frame, PI, Rgb, Vec2, Vec3};
use crate::sampler::Sampler;
use crate::warp;
use crate::world::geometry::Object;

impl Light {
    /// Starts a photon path. The mean of the sample's power is [`Light::power`].
    pub fn sample_emission(&self, objects: &[Object], bounds: &SceneBounds, u: EmissionUniforms) -> EmissionSample {
        let start = self.sample_start(objects, bounds, u);
        match (self.spread(), start.normal) {
            (Some(spread), Some(normal)) => EmissionSample {
                power: start.power * (spread.share(normal.dot(start.dir)) * spread.projected()),
                ..start
            },
            _ => start,
        }
    }

    /// The same, but the power of a surface with a spread is that of an equally bright surface without one.
    pub(crate) fn sample_start(&self, objects: &[Object], bounds: &SceneBounds, u: EmissionUniforms) -> EmissionSample {
        match &self.kind {
            LightKind::Point { position, intensity } => EmissionSample {
                origin: *position,
                dir: warp::uniform_sphere(u.direction),
                normal: None,
                power: *intensity * (4.0 * PI),
                pdf_dir: warp::uniform_sphere_pdf(),
                pdf_pos: f32::INFINITY,
                primitive: 0,
            },
            LightKind::Spot(spot) => {
                let (dir, angle, pdf_dir) = spot.sample(u.direction);
                EmissionSample {
                    origin: spot.start(u.position, u.primitive),
                    dir,
                    normal: None,
                    power: spot.intensity * (spot.falloff(angle) / pdf_dir),
                    pdf_dir,
                    pdf_pos: 1.0 / spot.area(),
                    primitive: 0,
                }
            }
            LightKind::Projector(projector) => {
                let (dir, pdf_dir) = projector.sample(u.direction);
                EmissionSample {
                    origin: projector.position,
                    dir,
                    normal: None,
                    power: projector.intensity(dir) / pdf_dir,
                    pdf_dir,
                    pdf_pos: f32::INFINITY,
                    primitive: 0,
                }
            }
            LightKind::Goniometric(lamp) => {
                let (dir, pdf_dir) = lamp.sample(u.direction);
                EmissionSample {
                    origin: lamp.position,
                    dir,
                    normal: None,
                    power: match pdf_dir > 0.0 {
                        true => lamp.intensity(dir) / pdf_dir,
                        // Rounding moved it out of the light.
                        false => Rgb::ZERO,
                    },
                    pdf_dir,
                    pdf_pos: f32::INFINITY,
                    primitive: 0,
                }
            }
            LightKind::Laser(laser) => {
                let (origin, pdf_pos) = laser.start(u.position);
                EmissionSample {
                    origin,
                    dir: laser.frame.n,
                    normal: None,
                    power: laser.power(),
                    pdf_dir: f32::INFINITY,
                    pdf_pos,
                    primitive: 0,
                }
            }
            LightKind::Directional(sun) => EmissionSample {
                pdf_dir: match sun.is_parallel() {
                    true => f32::INFINITY,
                    false => sun.pdf(),
                },
                ..from_afar(bounds, sun.sample(u.direction), sun.fluence(), u.position)
            },
            LightKind::Area {
                object,
                radiance,
                pattern,
                two_sided,
                spread,
                ..
            } => {
                let shape = &objects[*object as usize].shape;
                let (at, radiance) = match pattern {
                    None => (shape.sample_area(u.position, u.primitive), *radiance),
                    Some(pattern) => {
                        let at = pattern.sample(shape, u.position, u.primitive);
                        (at, pattern.radiance_of(shape, &at))
                    }
                };
                let (normal, u_direction) = match two_sided {
                    false => (at.normal, u.direction),
                    true => either_side(at.normal, u.direction),
                };
                let local = warp::cosine_hemisphere(u_direction);
                let (local, pdf_dir) = match spread {
                    None => (local, warp::cosine_hemisphere_pdf(local.z) / self.sides()),
                    Some(spread) => {
                        let local = spread.narrowed(local);
                        (local, local.z / (self.sides() * PI * spread.projected()))
                    }
                };
                EmissionSample {
                    origin: at.point,
                    dir: Frame::from_normal(normal).to_world(local),
                    normal: Some(normal),
                    power: radiance * (self.sides() * PI / at.pdf_area),
                    pdf_dir,
                    pdf_pos: at.pdf_area,
                    primitive: at.primitive,
                }
            }
            LightKind::Environment(environment) => {
                let towards = environment.sample(u.direction);
                let irradiance = environment.radiance(towards.dir) / towards.pdf;
                EmissionSample {
                    pdf_dir: towards.pdf,
                    ..from_afar(bounds, -towards.dir, irradiance, u.position)
                }
            }
            LightKind::Volume(light) => light.start(u.position, u.primitive, u.direction),
        }
    }
}

/// The normal or its opposite, with equal probability, and the rest of the uniform numbers.
fn either_side(normal: Vec3, u: Vec2) -> (Vec3, Vec2) {
    let twice = 2.0 * u.x;
    match twice < 1.0 {
        true => (normal, Vec2::new(twice, u.y)),
        false => (-normal, Vec2::new(twice - 1.0, u.y)),
    }
}

impl EmissionUniforms {
    /// The next numbers of a stream.
    #[inline]
    pub fn draw(sampler: &mut Sampler) -> Self {
        Self {
            position: sampler.next_2d(),
            direction: sampler.next_2d(),
            primitive: sampler.next_1d(),
        }
    }
}

/// Parallel light through the disc that covers the bounds, from just outside of them.
pub(crate) fn from_afar(bounds: &SceneBounds, dir: Vec3, irradiance: Rgb, u: Vec2) -> EmissionSample {
    let disc = warp::concentric_disk(u);
    let offset = Frame::from_normal(dir).to_world(Vec3::new(disc.x, disc.y, -1.0));
    let area = bounds.disc_area();
    EmissionSample {
        origin: bounds.center + offset * bounds.radius,
        dir,
        normal: None,
        power: irradiance * area,
        pdf_dir: f32::INFINITY,
        pdf_pos: 1.0 / area,
        primitive: 0,
    }
}
