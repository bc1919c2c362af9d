//! Where photon paths start that are aimed at discs. Emission is a mixture of the light's plain emission and of rays
//! through the discs, weighted by the density of both.

use super::{Aim, Discs, Drawn, Viewpoint};
use crate::math::{PI, Ray, Rgb, Vec3};
use crate::world::geometry::Object;
use crate::world::light::emission::from_afar;
use crate::world::light::{EmissionSample, EmissionUniforms, Environment, Light, LightKind, SceneBounds};

/// Share of aimed photons whose directions are drawn as those of plain ones, where these are uneven. The other
/// directions are those in which camera paths found the light.
const OWN_DIRECTIONS: f32 = 0.5;

/// A density of rays.
#[derive(Clone, Copy)]
struct Density {
    /// Per solid angle, for a light at a position. For a distant light, per solid angle and per area across the ray.
    pdf: f32,
    /// Per area across the ray alone.
    of_point: f32,
}

impl Light {
    /// Start a photon path, plain or aimed. The mean of the sample's power is [`Light::power`]. `None`: the sample fell
    /// where the light does not shine. `choice`: another uniform number.
    pub fn sample_mixture(
        &self,
        objects: &[Object],
        bounds: &SceneBounds,
        aim: &Aim,
        u: EmissionUniforms,
        choice: f32,
    ) -> Option<EmissionSample> {
        let plain = aim.plain;
        let (mut start, drawn) = if choice < plain {
            (self.sample_start(objects, bounds, u), None)
        } else {
            let left = ((choice - plain) / (1.0 - plain)).min(1.0 - f32::EPSILON);
            let (start, drawn) = self.sample_aimed(objects, bounds, &aim.discs, u, left)?;
            (start, Some(drawn))
        };
        let [pdf, of_point] = self.mixture_density(bounds, aim, &start, drawn);
        start.power = self.emitted_along(&start) / pdf;
        match self.kind {
            LightKind::Directional(sun) if sun.is_parallel() => start.pdf_pos = pdf,
            LightKind::Laser(_) => start.pdf_pos = pdf,
            LightKind::Directional(_) | LightKind::Environment(_) => {
                start.pdf_pos = of_point;
                start.pdf_dir = pdf / of_point;
            }
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Volume(_)
            | LightKind::Area { .. } => {
                start.pdf_dir = pdf;
            }
        }
        let is_lit = pdf > 0.0 && start.power.max_element() > 0.0 && start.power.is_finite();
        is_lit.then_some(start)
    }

    /// Density of [`Self::sample_mixture`] at a start, whose own densities are ignored. For a light at a position: per
    /// solid angle, given the point. For parallel light: per area across the ray. For suns with an angle and for
    /// environments: both.
    pub fn mixture_pdf(&self, bounds: &SceneBounds, aim: &Aim, start: &EmissionSample) -> f32 {
        let [pdf, _] = self.mixture_density(bounds, aim, start, None);
        pdf
    }

    /// As [`Self::mixture_pdf`], with the density of points across the ray alone for a distant light. `drawn`: what the
    /// start was drawn through, if it was aimed.
    fn mixture_density(
        &self,
        bounds: &SceneBounds,
        aim: &Aim,
        start: &EmissionSample,
        drawn: Option<Drawn<'_>>,
    ) -> [f32; 2] {
        let ray = Ray {
            origin: start.origin,
            dir: start.dir,
        };
        let own = self.plain_density(bounds, start);
        let aimed = self.aimed_density(bounds, &aim.discs, &ray, drawn);
        let mix = |own: f32, aimed: f32| aim.plain * own + (1.0 - aim.plain) * aimed;
        [mix(own.pdf, aimed.pdf), mix(own.of_point, aimed.of_point)]
    }

    /// An aimed start, and what it was drawn through. Power and densities belong to no distribution.
    pub(crate) fn sample_aimed<'a>(
        &self,
        objects: &[Object],
        bounds: &SceneBounds,
        discs: &'a Discs,
        u: EmissionUniforms,
        mut choice: f32,
    ) -> Option<(EmissionSample, Drawn<'a>)> {
        let through = |point: Vec3, dir: Vec3| {
            let start = from_afar(bounds, dir, Rgb::ZERO, glam::Vec2::splat(0.5));
            let off = point - bounds.center;
            let across = off - dir * off.dot(dir);
            (across.length_squared() <= bounds.radius * bounds.radius).then_some(EmissionSample {
                origin: bounds.center + across - dir * bounds.radius,
                ..start
            })
        };
        let position = match &self.kind {
            LightKind::Laser(_) | LightKind::Directional(_) | LightKind::Environment(_) => u.position,
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Volume(_)
            | LightKind::Area { .. } => u.direction,
        };
        let (point, mut drawn) = discs.point(&mut choice, position);
        let start = match &self.kind {
            LightKind::Directional(sun) => through(point, sun.sample(u.direction))?,
            LightKind::Laser(laser) => EmissionSample {
                origin: laser.start_towards(point)?,
                ..self.sample_emission(objects, bounds, u)
            },
            LightKind::Environment(environment) => {
                let dir = if choice < own_directions(environment) {
                    -environment.sample(u.direction).dir
                } else {
                    drawn.draw_direction(u.direction)
                };
                through(point, dir)?
            }
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Volume(_)
            | LightKind::Area { .. } => {
                let start = self.sample_start(objects, bounds, u);
                let dir = (point - start.origin).normalize_or_zero();
                let normal = start
                    .normal
                    .map(|normal| match self.is_two_sided() && normal.dot(dir) < 0.0 {
                        true => -normal,
                        false => normal,
                    });
                EmissionSample { dir, normal, ..start }
            }
        };
        let is_front = drawn.disc.normal.dot(start.dir) < 0.0;
        is_front.then_some((start, drawn))
    }

    /// Density of aimed rays over that of plain ones at the place where a camera path found the light: infinite if
    /// there are no plain rays.
    pub(crate) fn aimed_over_plain(&self, bounds: &SceneBounds, discs: &Discs, place: &Viewpoint) -> f32 {
        let ray = self.ray_to(bounds, place);
        let start = EmissionSample {
            origin: ray.origin,
            dir: ray.dir,
            normal: Some(place.normal),
            power: Rgb::ZERO,
            pdf_dir: 0.0,
            pdf_pos: 0.0,
            primitive: 0,
        };
        self.aimed_density(bounds, discs, &ray, None).pdf / self.plain_density(bounds, &start).pdf
    }

    /// The ray by which the light reaches the place where a camera path found it.
    pub(super) fn ray_to(&self, bounds: &SceneBounds, place: &Viewpoint) -> Ray {
        let dir = -place.towards;
        let distance = match self.kind {
            LightKind::Directional(_) | LightKind::Environment(_) => 2.0 * bounds.radius,
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Volume(_)
            | LightKind::Area { .. } => place.distance,
        };
        Ray {
            origin: place.point - dir * distance,
            dir,
        }
    }

    /// A photon's power times the densities that it was drawn with: W/sr, W/m^2 or W/(m^2 sr); for area lights, over
    /// the density of the point.
    fn emitted_along(&self, start: &EmissionSample) -> Rgb {
        match &self.kind {
            LightKind::Point { intensity, .. } => *intensity,
            LightKind::Spot(spot) => spot.intensity(start.dir),
            LightKind::Projector(projector) => projector.intensity(start.dir),
            LightKind::Goniometric(lamp) => lamp.intensity(start.dir),
            LightKind::Laser(laser) => laser.irradiance_at(start.origin + start.dir * laser.radius),
            LightKind::Directional(sun) => sun.fluence() * sun.pdf(),
            LightKind::Area {
                radiance,
                pattern,
                spread,
                ..
            } => {
                let cos = self.cos_at(start);
                let emitted = match pattern {
                    None => *radiance * (cos / start.pdf_pos),
                    // From how it was drawn: the radiance there times pi over the density, for each side.
                    Some(_) => start.power * (cos / (self.sides() * PI)),
                };
                match spread {
                    None => emitted,
                    Some(spread) => emitted * spread.share(cos),
                }
            }
            LightKind::Environment(environment) => environment.radiance(-start.dir),
            // From how it was drawn: four pi times the emission there over the density.
            LightKind::Volume(_) => start.power * (0.25 / PI),
        }
    }

    /// Cosine of the angle to an area light's normal, zero on a side that does not emit.
    fn cos_at(&self, start: &EmissionSample) -> f32 {
        let cos = start.normal.map_or(0.0, |normal| normal.dot(start.dir));
        if self.is_two_sided() { cos.abs() } else { cos.max(0.0) }
    }

    /// Density of [`Light::sample_emission`]; for an area light, of directions, given the point.
    fn plain_density(&self, bounds: &SceneBounds, start: &EmissionSample) -> Density {
        let of_point = match &self.kind {
            LightKind::Laser(laser) => laser.density_at(start.origin + start.dir * laser.radius),
            _ => 1.0 / bounds.disc_area(),
        };
        let pdf = match &self.kind {
            LightKind::Point { .. } | LightKind::Volume(_) => 0.25 / PI,
            LightKind::Spot(spot) => spot.pdf(start.dir),
            LightKind::Projector(projector) => projector.pdf(start.dir),
            LightKind::Goniometric(lamp) => lamp.pdf(start.dir),
            LightKind::Laser(_) => of_point,
            LightKind::Directional(sun) => sun.pdf() * of_point,
            LightKind::Area { .. } => {
                let cos = self.cos_at(start);
                cos / self.projected_solid_angle(cos)
            }
            LightKind::Environment(environment) => environment.pdf(-start.dir) * of_point,
        };
        Density { pdf, of_point }
    }

    /// Density of [`Self::sample_aimed`], in the same units. `drawn`: what it was drawn through, if it was.
    fn aimed_density(&self, bounds: &SceneBounds, discs: &Discs, ray: &Ray, drawn: Option<Drawn<'_>>) -> Density {
        // A distant light's discs are met by whole lines: discs may reach out of the bounds.
        let line = Ray {
            origin: ray.at(-2.0 * bounds.radius),
            dir: ray.dir,
        };
        match &self.kind {
            LightKind::Laser(_) => {
                let [of_point, _] = discs.pdf_across(&line, drawn);
                Density {
                    pdf: of_point,
                    of_point,
                }
            }
            LightKind::Directional(sun) => {
                let [of_point, _] = discs.pdf_across(&line, drawn);
                Density {
                    pdf: sun.pdf() * of_point,
                    of_point,
                }
            }
            LightKind::Environment(environment) => {
                let own = own_directions(environment);
                let [of_point, of_line] = discs.pdf_across(&line, drawn);
                let by_itself = match own > 0.0 && of_point > 0.0 {
                    true => own * environment.pdf(-ray.dir) * of_point,
                    false => 0.0,
                };
                Density {
                    pdf: by_itself + (1.0 - own) * of_line,
                    of_point,
                }
            }
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Volume(_)
            | LightKind::Area { .. } => Density {
                pdf: discs.pdf_from(ray, drawn),
                of_point: 0.0,
            },
        }
    }
}

/// Share of an environment's aimed photons whose directions are drawn as those of plain ones.
pub fn own_directions(environment: &Environment) -> f32 {
    match environment.is_uneven() {
        true => OWN_DIRECTIONS,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;
    use crate::sampler::{Purpose, Sampler};
    use glam::Mat3;
    use std::sync::Arc;

    /// Distant rays meet small discs only roughly. A ray drawn through the rim of a disc, or the rim of its cone, must
    /// still have the density of what it was drawn by. With the densities of its position alone, its photon would carry
    /// too much power.
    #[test]
    fn no_ray_is_taken_for_one_that_was_not_aimed() {
        let bounds = SceneBounds {
            center: Vec3::new(3.0, -20.0, 7.0),
            radius: 100.0,
        };
        let towards = Vec3::new(0.3, 0.8, 0.4).normalize();
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let places: Vec<Viewpoint> = (0..200)
            .map(|i| {
                let off = sampler.next_2d().extend(0.5) - 0.5;
                Viewpoint {
                    point: off * 0.02,
                    normal: Vec3::Z,
                    towards: (towards + off * 0.1).normalize(),
                    distance: 1.0,
                    weight: 1.0,
                    odd: i % 2 == 1,
                }
            })
            .collect();
        let aim = Aim {
            plain: 0.1,
            discs: Discs::new(&places, &bounds),
            gain: 9.0,
            work: 0.0,
            trials: 1,
        };
        let pixels = vec![Rgb::ONE, Rgb::splat(2.0), Rgb::ONE, Rgb::ONE, Rgb::ONE, Rgb::ONE];
        let (width, height) = (2, 3);
        let image = crate::world::texture::Image {
            width,
            height,
            pixels,
            alpha: Vec::new(),
        };
        let sky = Environment::new(Some(Arc::new(image)), Rgb::ONE, Mat3::IDENTITY);
        let light = Light {
            name: "sky".into(),
            group: beamfarm_image::layer::LightGroup::named("sky"),
            kind: LightKind::Environment(sky),
        };
        let (mut lost, mut least) = (0, f32::INFINITY);
        for _ in 0..20_000 {
            let u = EmissionUniforms::draw(&mut sampler);
            let aimed = light.sample_aimed(&[], &bounds, &aim.discs, u, sampler.next_1d());
            let Some((start, drawn)) = aimed else {
                continue;
            };
            let plain = light.plain_density(&bounds, &start).pdf;
            let over_plain = |drawn| {
                let [pdf, _] = light.mixture_density(&bounds, &aim, &start, drawn);
                pdf / plain
            };
            least = least.min(over_plain(Some(drawn)));
            lost += usize::from(over_plain(None) < 0.5 * over_plain(Some(drawn)));
        }
        // Some do miss what they were drawn through. Plain rays make up a tenth of the density, and no less.
        assert!(lost > 10 && least > 100.0, "{lost}, {least}");
    }

    /// However photons of narrow lamps are aimed, on average they carry the power, and each carries what the mixture's
    /// density says.
    #[test]
    fn aimed_photons_of_narrow_lamps_carry_the_power() {
        use crate::math::Frame;
        use crate::world::geometry::{Placement, Shape};
        use crate::world::light::{AngularTable, Goniometric, Laser, Profile, Spread};
        let bounds = SceneBounds {
            center: Vec3::new(0.0, 0.0, 1.0),
            radius: 5.0,
        };
        let object = Object {
            light: Some(0),
            ..Object::new(Shape::Disc {
                placement: Placement::IDENTITY,
                flip: false,
            })
        };
        let frame = Frame::from_normal(Vec3::Z);
        let laser = |profile| {
            LightKind::Laser(Laser {
                position: Vec3::ZERO,
                frame,
                radius: 0.4,
                irradiance: Rgb::new(3.0, 2.0, 1.0),
                profile,
            })
        };
        let whole = [0.0, 2.0 * std::f64::consts::PI];
        let table = AngularTable::new(&[0.0, 0.3, 1.2], &whole, &[2.0, 2.0, 1.0, 1.0, 0.0, 0.0]).expect("a table");
        let kinds = [
            laser(Profile::Flat),
            laser(Profile::Gaussian),
            LightKind::Goniometric(Goniometric {
                position: Vec3::ZERO,
                axes: [frame.s, frame.t, frame.n],
                scale: Rgb::new(3.0, 2.0, 1.0),
                table: Arc::new(table),
            }),
            LightKind::Area {
                object: 0,
                radiance: Rgb::new(3.0, 2.0, 1.0),
                pattern: None,
                two_sided: false,
                spread: Spread::new(100.0),
                soft: false,
            },
        ];
        let objects = [object];
        for kind in kinds {
            let light = Light {
                name: "lamp".into(),
                group: beamfarm_image::layer::LightGroup::named("lamp"),
                kind,
            };
            let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
            let places: Vec<Viewpoint> = (0..200)
                .map(|i| Viewpoint {
                    point: (sampler.next_2d() - Vec2::new(0.5, 0.2)).extend(1.5),
                    normal: Vec3::Z,
                    towards: Vec3::NEG_Z,
                    distance: 1.5,
                    weight: 1.0,
                    odd: i % 2 == 1,
                })
                .collect();
            let aim = Aim {
                plain: 0.3,
                discs: Discs::new(&places, &bounds),
                gain: 9.0,
                work: 0.0,
                trials: 1,
            };
            const N: usize = 40_000;
            let (mut sum, mut squares, mut aimed) = (0.0, 0.0, 0);
            let power = light.power(&objects, &bounds);
            for _ in 0..N {
                let u = EmissionUniforms::draw(&mut sampler);
                let choice = sampler.next_1d();
                let start = light.sample_mixture(&objects, &bounds, &aim, u, choice);
                aimed += usize::from(choice >= aim.plain && start.is_some());
                let x = start.map_or(0.0, |start| f64::from(start.power.x / power.x));
                (sum, squares) = (sum + x, squares + x * x);
            }
            let n = N as f64;
            let error = ((squares / n - (sum / n) * (sum / n)) / n).sqrt();
            assert!(
                (sum / n - 1.0).abs() < 4.0 * error + 1e-4 && error < 0.02 && aimed > N / 20,
                "{light:?}: {} +- {error}, {aimed}",
                sum / n
            );
        }
    }
}
