//! Lights that are not surfaces.

use super::photometric::of_tables_alone;
use super::{Parts, Problem, asset_problem, check_reach, required};
use crate::assets::image::Encoding;
use crate::parse::{Fault, ImageFile, LightRecord, LightType};
use crate::transform;
use crate::values::{Spanned, Vector};
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::{Frame, Rgb};
use beamfarm_render::world::light::{
    Environment, Laser, Light, LightKind, Profile, Projector, Ramp, Spot, Sun, lit_part,
};
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::texture::{Image, TextureFilter};
use glam::{DMat3, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

impl Parts<'_> {
    pub fn add_lights(&mut self, records: &[LightRecord]) -> Result<(), Problem> {
        for (i, record) in records.iter().enumerate() {
            let before = self.lights.len();
            let name = record.name.clone();
            let name = name.unwrap_or_else(|| format!("lights[{i}]"));
            // A light that is turned off is left out.
            for kind in self.light_kinds(record)? {
                self.lights.push(Light {
                    group: LightGroup::named(record.group.as_deref().unwrap_or(&name)),
                    name: name.clone(),
                    kind,
                });
            }
            let group = record.group.as_deref();
            let visible = record.visible.as_ref();
            let added = before..self.lights.len();
            self.names.add(&name, group.as_slice(), visible, 0..0, added);
        }
        Ok(())
    }

    fn light_kinds(&mut self, record: &LightRecord) -> Result<Vec<LightKind>, Problem> {
        let kind = &record.kind;
        let from_infinity = matches!(kind.get_ref(), LightType::Directional | LightType::Environment);
        let world = self.world_medium.map(|m| &self.media.list[usize::from(m)]);
        if from_infinity && matches!(world, Some(Medium::Homogeneous(_))) {
            return Err(Fault::new(
                kind.span(),
                "light from infinitely far away would be absorbed by the world's medium, which has no end; bound the \
                 medium by a shape, such as a cube with a material of type \"null\" and the medium as its interior",
            )
            .into());
        }
        let light = match kind.get_ref() {
            LightType::Environment => return self.environment(record),
            LightType::Point => {
                let position = self.position(record)?;
                if let Some(file) = &record.ies {
                    let axis = match (&record.target, &record.direction) {
                        (None, None) => DVec3::NEG_Y,
                        _ => axis_of(record, "a lamp by `ies`")?,
                    };
                    return Ok(self.by_table(record, file, position, axis, None)?.into_iter().collect());
                }
                of_tables_alone(record)?;
                let intensity = intensity(record, 4.0 * PI)?;
                (intensity != Rgb::ZERO).then_some(LightKind::Point { position, intensity })
            }
            LightType::Spot => self.spot(record)?,
            LightType::Projector => self.projector(record)?,
            LightType::Laser => self.laser(record)?,
            LightType::Directional => {
                let direction = required(&record.direction, kind, "direction")?;
                let irradiance = required(&record.irradiance, kind, "irradiance")?.get_ref().rgb();
                let direction = unit(
                    direction.get_ref().0,
                    direction,
                    "expected a direction other than [0, 0, 0]",
                )?;
                let angle = record.angle.as_ref().map_or(0.0, |a| a.get_ref().0);
                (irradiance != Rgb::ZERO).then_some(LightKind::Directional(Sun {
                    direction: direction.as_vec3(),
                    irradiance,
                    half_angle: (0.5 * angle).to_radians() as f32,
                }))
            }
        };
        Ok(light.into_iter().collect())
    }

    fn position(&mut self, record: &LightRecord) -> Result<glam::Vec3, Fault> {
        let position = required(&record.position, &record.kind, "position")?;
        let place = position.span();
        let position = position.get_ref().0 - self.render_origin;
        check_reach(position.length(), place)?;
        self.points.push(position);
        Ok(position.as_vec3())
    }

    fn spot(&mut self, record: &LightRecord) -> Result<Option<LightKind>, Problem> {
        let position = self.position(record)?;
        let axis = towards(record, required(&record.target, &record.kind, "target")?)?;
        let cutoff = record.cutoff_angle.as_ref().map_or(20.0, |a| a.get_ref().0);
        let plateau = record.beam_width.as_ref().map_or(0.75 * cutoff, |a| a.get_ref().0);
        let [cutoff, plateau] = [cutoff, plateau].map(f64::to_radians);
        if plateau as f32 >= cutoff as f32 {
            let place = record.beam_width.as_ref().map_or(record.kind.span(), |a| a.span());
            return Err(Fault::new(place, "expected `beam_width` below `cutoff_angle` (default 20)").into());
        }
        let ramp = record.falloff.as_ref().map(|falloff| *falloff.get_ref());
        let ramp = Ramp::from(ramp.unwrap_or_default());
        if let Some(file) = &record.ies {
            let of_others = [
                record.image.as_ref().map(|image| image.span()),
                record.radius.as_ref().map(|radius| radius.span()),
                record.soft_falloff.as_ref().map(|soft| soft.span()),
            ];
            if let Some(place) = of_others.into_iter().flatten().next() {
                return Err(Fault::new(place, "a spot by `ies` takes no `image`, `radius` or `soft_falloff`").into());
            }
            return self.by_table(record, file, position, axis, Some((ramp, plateau, cutoff)));
        }
        if record.image.is_none() {
            of_tables_alone(record)?;
        } else if let Some(scale) = &record.scale {
            return Err(Fault::new(scale.span(), "it multiplies the candela of `ies`; expected `intensity`").into());
        }
        let intensity = intensity(record, spot_solid_angle(ramp, plateau, cutoff))?;
        if let Some(path) = &record.image {
            if let Some(power) = &record.power {
                let message = "the power of a spot with an `image` depends on the image; expected `intensity`";
                return Err(Fault::new(power.span(), message).into());
            }
            let of_plain = [
                record.radius.as_ref().map(|radius| radius.span()),
                record.soft_falloff.as_ref().map(|soft| soft.span()),
                record.falloff.as_ref().map(|falloff| falloff.span()),
            ];
            if let Some(place) = of_plain.into_iter().flatten().next() {
                let message = "a spot with an `image` takes no `radius`, `soft_falloff` or `falloff`";
                return Err(Fault::new(place, message).into());
            }
            let half = libm::tan(cutoff) as f32;
            if !(cutoff < 0.5 * PI && half < FLATTEST) {
                let place = record.cutoff_angle.as_ref().map_or(record.kind.span(), |a| a.span());
                return Err(Fault::new(place, "with an `image`, expected less than 89 degrees").into());
            }
            let image = self.thrown(record, path)?;
            return Ok((intensity != Rgb::ZERO).then_some(LightKind::Projector(Projector {
                position,
                axes: axes(record, axis)?,
                half: glam::Vec2::splat(half),
                lit: lit_part(&image, filter(record)),
                image,
                filter: filter(record),
                intensity,
                cone: Some([cutoff as f32, plateau as f32]),
            })));
        }
        let radius = self.radius(record, position)?;
        let soft = match &record.soft_falloff {
            Some(soft) if *soft.get_ref() && record.radius.is_none() => {
                return Err(Fault::new(soft.span(), "it is that of a ball; expected a `radius`").into());
            }
            soft => soft.as_ref().is_some_and(|soft| *soft.get_ref() && radius > 0.0),
        };
        Ok((intensity != Rgb::ZERO).then_some(LightKind::Spot(Spot {
            position,
            frame: Frame::from_normal(axis.as_vec3()),
            intensity,
            cutoff: cutoff as f32,
            beam_width: plateau as f32,
            ramp,
            radius,
            soft,
        })))
    }

    /// The radius of a spherical spot; 0 where its area would underflow.
    fn radius(&mut self, record: &LightRecord, position: glam::Vec3) -> Result<f32, Fault> {
        let Some(given) = &record.radius else {
            return Ok(0.0);
        };
        self.add_ball(position, given.get_ref().0, given)?;
        let radius = given.get_ref().0 as f32;
        Ok(if (radius * radius).is_normal() { radius } else { 0.0 })
    }

    /// Count a ball in the scene's extent.
    fn add_ball<T>(&mut self, position: glam::Vec3, radius: f64, place: &Spanned<T>) -> Result<(), Fault> {
        let center = position.as_dvec3();
        check_reach(center.length() + radius, place.span())?;
        let sides = DMat3::from_diagonal(DVec3::splat(radius));
        let ends = [sides.x_axis, sides.y_axis, sides.z_axis].map(|to| [center - to, center + to]);
        self.points.extend(ends.into_iter().flatten());
        Ok(())
    }

    fn laser(&mut self, record: &LightRecord) -> Result<Option<LightKind>, Problem> {
        let place = record.kind.span();
        let position = self.position(record)?;
        let axis = axis_of(record, "a laser")?;
        let profile = record.profile.as_ref().map(|profile| *profile.get_ref());
        let profile = Profile::from(profile.unwrap_or_default());
        let given = required(&record.radius, &record.kind, "radius")?;
        let radius = given.get_ref().0 as f32;
        let area = f64::from(radius) * f64::from(radius) * f64::from(profile.area());
        if !(area as f32).is_normal() {
            let message = "expected a radius above 0 whose square single precision holds";
            return Err(Fault::new(given.span(), message).into());
        }
        self.add_ball(position, given.get_ref().0 * f64::from(profile.end()), given)?;
        let irradiance = match (&record.irradiance, &record.power) {
            (Some(irradiance), None) => irradiance.get_ref().rgb(),
            (None, Some(power)) => {
                let irradiance = power.get_ref().over(area);
                if !irradiance.is_finite() {
                    let message = "too much power for single precision on so small a disc";
                    return Err(Fault::new(power.span(), message).into());
                }
                irradiance
            }
            _ => {
                let message = "a laser is given by `power` (W) or by `irradiance` (W/m^2): exactly one of them";
                return Err(Fault::new(place, message).into());
            }
        };
        Ok((irradiance != Rgb::ZERO).then_some(LightKind::Laser(Laser {
            position,
            frame: Frame::from_normal(axis.as_vec3()),
            radius,
            irradiance,
            profile,
        })))
    }

    fn projector(&mut self, record: &LightRecord) -> Result<Option<LightKind>, Problem> {
        let position = self.position(record)?;
        let axis = towards(record, required(&record.target, &record.kind, "target")?)?;
        let intensity = required(&record.intensity, &record.kind, "intensity")?.get_ref().rgb();
        let image = match &record.image {
            Some(path) => self.thrown(record, path)?,
            None => Arc::new(Image {
                alpha: Vec::new(),
                width: 1,
                height: 1,
                pixels: vec![Rgb::ONE],
            }),
        };
        let fov = record.fov.as_ref().map_or(45.0, |fov| fov.get_ref().0);
        let width = libm::tan(0.5 * fov.to_radians()) as f32;
        if width >= FLATTEST {
            let place = record.fov.as_ref().map_or(record.kind.span(), |fov| fov.span());
            return Err(Fault::new(place, "expected less than 178 degrees").into());
        }
        Ok((intensity != Rgb::ZERO).then_some(LightKind::Projector(Projector {
            position,
            axes: axes(record, axis)?,
            half: glam::Vec2::new(width, width * image.height as f32 / image.width as f32),
            lit: lit_part(&image, filter(record)),
            image,
            filter: filter(record),
            intensity,
            cone: None,
        })))
    }

    /// The picture that a projector throws.
    fn thrown(&mut self, record: &LightRecord, file: &ImageFile) -> Result<Arc<Image>, Problem> {
        let encoding = match record.raw.as_ref().is_some_and(|raw| *raw.get_ref()) {
            true => Encoding::Raw,
            false => Encoding::Srgb,
        };
        let image = self.assets.image(file, encoding, true)?;
        match image.width == 0 || image.height == 0 {
            true => Err(asset_problem(&file.file, "the image is empty")),
            false => Ok(image),
        }
    }

    fn environment(&mut self, record: &LightRecord) -> Result<Vec<LightKind>, Problem> {
        let render_from_env = orientation(record)?.as_mat3();
        let environments = match (&record.radiance, &record.image, &record.scale) {
            (None, None, scale) if record.texture.is_some() => {
                let image = self.around(record)?;
                let scale = scale.as_ref().map_or(Rgb::ONE, |s| s.get_ref().rgb());
                let place = record.kind.span();
                let kept = &mut *self.assets.kept;
                kept.environment(&image, scale, render_from_env, || {
                    Problem::from(Fault::new(place, "times `scale` it is too bright for single precision"))
                })?
            }
            (Some(radiance), None, None) => {
                let radiance = radiance.get_ref().rgb();
                vec![Environment::new(None, radiance, render_from_env)]
            }
            (None, Some(file), scale) => {
                let image = self.assets.image(file, Encoding::Srgb, true)?;
                let path = &file.file;
                if image.width < 2 || image.height < 3 {
                    let flaw = format!("{} x {} pixels; expected at least 2 x 3", image.width, image.height);
                    return Err(asset_problem(path, flaw));
                }
                let scale = scale.as_ref().map_or(Rgb::ONE, |s| s.get_ref().rgb());
                let kept = &mut *self.assets.kept;
                kept.environment(&image, scale, render_from_env, || {
                    asset_problem(path, "times `scale` it is too bright for single precision")
                })?
            }
            _ => {
                let message = "an environment is given by `radiance`, or by `image` or `texture` and perhaps `scale`";
                return Err(Fault::new(record.kind.span(), message).into());
            }
        };
        let lit = environments.into_iter().filter(|e| e.fluence() != Rgb::ZERO);
        Ok(lit.map(LightKind::Environment).collect())
    }
}

/// The direction from a light to its target.
fn towards(record: &LightRecord, target: &Spanned<Vector>) -> Result<DVec3, Fault> {
    let from = record.position.as_ref().map_or(DVec3::ZERO, |p| p.get_ref().0);
    unit(
        target.get_ref().0 - from,
        target,
        "expected a point other than `position`",
    )
}

/// The direction a light shines in, from a point or a direction.
fn axis_of(record: &LightRecord, what: &str) -> Result<DVec3, Fault> {
    match (&record.target, &record.direction) {
        (Some(target), None) => towards(record, target),
        (None, Some(direction)) => {
            let message = "expected a direction other than [0, 0, 0]";
            unit(direction.get_ref().0, direction, message)
        }
        _ => {
            let message = format!("{what} is turned by `target` or by `direction`: exactly one of them");
            Err(Fault::new(record.kind.span(), message))
        }
    }
}

/// An environment's orientation: a rotation, perhaps mirrored.
fn orientation(record: &LightRecord) -> Result<DMat3, Fault> {
    match (&record.rotate_y, &record.transform) {
        (degrees, None) => {
            let degrees = degrees.as_ref().map_or(0.0, |a| a.get_ref().0);
            Ok(transform::rotation(DVec3::Y, degrees))
        }
        (None, Some(steps)) => {
            // Translation means nothing at an infinite distance.
            let m = transform::compose(steps.get_ref())?.matrix3;
            let off = (m.transpose() * m - DMat3::IDENTITY).to_cols_array();
            if off.iter().any(|x| x.is_nan() || x.abs() > 1e-4) {
                return Err(Fault::new(
                    steps.span(),
                    "an environment is rotated and mirrored, not scaled or sheared",
                ));
            }
            // Orthonormal, whatever the digits of the given matrix.
            let x = m.x_axis.normalize();
            let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
            let z = x.cross(y) * m.determinant().signum();
            Ok(DMat3::from_cols(x, y, z))
        }
        (Some(_), Some(steps)) => Err(Fault::new(steps.span(), "expected `rotate_y` or `transform`, not both")),
    }
}

/// W/sr on the axis, from `intensity`, or from `power` over the cone's solid angle, weighted by the falloff.
fn intensity(record: &LightRecord, solid_angle: f64) -> Result<Rgb, Fault> {
    match (&record.intensity, &record.power) {
        (Some(intensity), None) => Ok(intensity.get_ref().rgb()),
        (None, Some(power)) => {
            let intensity = power.get_ref().over(solid_angle);
            match intensity.is_finite() {
                true => Ok(intensity),
                false => Err(Fault::new(power.span(), "too much power for single precision")),
            }
        }
        _ => {
            let message = "this light is given by `intensity` (W/sr) or by `power` (W): exactly one of them";
            Err(Fault::new(record.kind.span(), message))
        }
    }
}

/// Integral of a spot's falloff over all directions: 1 up to the angle `plateau`, then by the ramp to 0 at `cutoff`.
fn spot_solid_angle(ramp: Ramp, plateau: f64, cutoff: f64) -> f64 {
    if ramp == Ramp::Smooth {
        // The mean of the two cones' integrals: the smooth ramp is symmetric about one half.
        let [plateau, cutoff] = [plateau, cutoff].map(|angle| libm::sin(0.5 * angle));
        return 2.0 * PI * (plateau * plateau + cutoff * cutoff);
    }
    let (mean, half) = (0.5 * (cutoff + plateau), 0.5 * (cutoff - plateau));
    // 2 pi (1 - (sin cutoff - sin plateau) / (cutoff - plateau)), written without cancellation for narrow cones.
    let sinc_defect = match half < 1e-2 {
        true => half * half / 6.0 * (1.0 - half * half / 20.0 * (1.0 - half * half / 42.0)),
        false => 1.0 - libm::sin(half) / half,
    };
    let sine = libm::sin(0.5 * mean);
    2.0 * PI * (2.0 * sine * sine + libm::cos(mean) * sinc_defect)
}

fn filter(record: &LightRecord) -> TextureFilter {
    let filter = record.filter.as_ref().map(|filter| *filter.get_ref());
    filter.unwrap_or_default().into()
}

/// The tangent of the largest half angle of a projected picture.
const FLATTEST: f32 = 57.0;

/// The picture's right and up, and the direction of projection, as seen looking out from the lamp.
fn axes(record: &LightRecord, axis: DVec3) -> Result<[glam::Vec3; 3], Fault> {
    let up = record.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0);
    let place = record.up.as_ref().map_or(record.kind.span(), |up| up.span());
    let right = axis.cross(up.normalize_or_zero());
    if right.length() < 1e-9 {
        let message = "expected an `up` that does not run along the lamp's axis (default [0, 1, 0])";
        return Err(Fault::new(place, message));
    }
    let right = right.normalize();
    Ok([right, right.cross(axis), axis].map(|v| v.as_vec3()))
}

fn unit<T>(direction: DVec3, place: &Spanned<T>, expected: &str) -> Result<DVec3, Fault> {
    direction
        .try_normalize()
        .ok_or_else(|| Fault::new(place.span(), expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::photometric::spot_falloff;
    use beamfarm_render::world::light::Goniometric;

    #[test]
    fn spot_solid_angle_is_the_integral_of_the_falloff() {
        for (plateau, cutoff) in [(0.0, 0.3), (0.2, 0.3), (1.0, 2.5), (1e-4, 2e-4), (0.5, 0.5001)] {
            for ramp in [Ramp::Linear, Ramp::Smooth] {
                let steps = 200_000;
                let width = cutoff / f64::from(steps);
                let integrand = |i: i32| {
                    let angle = (f64::from(i) + 0.5) * width;
                    spot_falloff(ramp, plateau, cutoff, angle) * libm::sin(angle) * width
                };
                let expected = 2.0 * PI * (0..steps).map(integrand).sum::<f64>();
                let found = spot_solid_angle(ramp, plateau, cutoff);
                assert!(
                    (found / expected - 1.0).abs() < 1e-6,
                    "{ramp:?} {plateau} {cutoff}: {found} {expected}"
                );
            }
        }
    }

    /// A lamp of 100 - degrees candela up to 90, dark on one side.
    const LAMP: &str = "TILT=NONE\n1 1 1 3 3 1 2 0 0 0\n1 1 1\n0 45 90\n0 90 180\n100 55 10\n100 55 10\n0 0 0\n";

    fn lamp(fields: &str) -> Result<Option<Goniometric>, String> {
        let text = format!(
            "image = {{ width = 1, height = 1 }}\ncamera = {{ origin = [0, 0, 4], target = [0, 0, 0], fov = 40 }}\n\
             [[lights]]\nposition = [1, 2, 3]\nies = \"a.ies\"\n{fields}\n"
        );
        let mut bundle = beamfarm_image::bundle::Bundle {
            scene: "scene.toml".into(),
            ..Default::default()
        };
        bundle.files.insert("scene.toml".into(), text.into());
        bundle.files.insert("a.ies".into(), LAMP.into());
        let mut description = crate::load(&bundle).map_err(|error| error.to_string())?;
        Ok(description.lights.pop().map(|light| match light.kind {
            LightKind::Goniometric(lamp) => lamp,
            other => panic!("{other:?}"),
        }))
    }

    /// The intensity in W/sr integrated over all directions.
    fn integral(lamp: &Goniometric) -> f64 {
        const N: u32 = 800;
        let mut sum = 0.0;
        for i in 0..N {
            let (sin, cos) = libm::sincos(PI * (f64::from(i) + 0.5) / f64::from(N));
            for j in 0..N {
                let (s, c) = libm::sincos(2.0 * PI * (f64::from(j) + 0.5) / f64::from(N));
                let dir = DVec3::new(sin * c, sin * s, cos).as_vec3();
                sum += f64::from(lamp.intensity(dir).x) * sin * 2.0 * PI * PI / f64::from(N * N);
            }
        }
        sum
    }

    #[test]
    fn lamps_shine_as_their_files_say() {
        let down = lamp("type = \"point\"\nscale = 2").unwrap().unwrap();
        let at = |lamp: &Goniometric, x: f64, y: f64, z: f64| lamp.intensity(DVec3::new(x, y, z).as_vec3()).x * 683.0;
        // Horizontal 0 is at +z; 180, which is dark, at -z; there is no light upwards.
        for (dir, expected) in [
            ([0.0, -1.0, 1.0], 110.0),
            ([1.0, -1.0, 0.0], 110.0),
            ([0.0, -1.0, -1.0], 0.0),
            ([0.0, 1.0, 0.1], 0.0),
        ] {
            let found = at(&down, dir[0], dir[1], dir[2]);
            assert!((found - expected).abs() < 1e-2, "{dir:?} {found}");
        }
        let power = lamp("type = \"point\"\npower = [3, 2, 1]\ndirection = [0, 0, 1]")
            .unwrap()
            .unwrap();
        assert!((integral(&power) / 3.0 - 1.0).abs() < 1e-3);
        // When it points along z, horizontal 0 is at +y.
        assert!(at(&power, 0.0, 1.0, 1.0) > 0.0 && at(&power, 0.0, -1.0, 1.0) == 0.0);
        // A spot's cone multiplies the table.
        for falloff in [Ramp::Linear, Ramp::Smooth] {
            let word = if falloff == Ramp::Linear { "linear" } else { "smooth" };
            let spot = format!(
                "type = \"spot\"\nscale = 1\ntarget = [1, 2, 9]\ncutoff_angle = 60\nbeam_width = 20\nfalloff = \"{word}\""
            );
            let spot = lamp(&spot).unwrap().unwrap();
            for degrees in [3.0f64, 20.0, 31.0, 44.0, 45.0, 59.0, 61.0, 89.0] {
                let angle = degrees.to_radians();
                let (sin, cos) = libm::sincos(angle);
                let cone = if degrees < 60.0 {
                    spot_falloff(falloff, PI / 9.0, PI / 3.0, angle)
                } else {
                    0.0
                };
                let found = f64::from(at(&spot, 0.0, sin, cos));
                assert!(
                    (found - (100.0 - degrees) * cone).abs() < 0.02,
                    "{word} {degrees} {found}"
                );
            }
        }
    }

    #[test]
    fn what_lamps_cannot_be_is_told() {
        for (fields, words) in [
            ("type = \"point\"\nintensity = 1", "expected `scale` or `power`"),
            ("type = \"point\"\npower = 1\nscale = 1", "not both"),
            ("type = \"point\"\nup = [0, 2, 0]", "expected an `up`"),
            ("type = \"point\"\ntarget = [1, 2, 3]", "other than `position`"),
            (
                "type = \"spot\"\ntarget = [0, 0, 0]\nradius = 1",
                "no `image`, `radius` or `soft_falloff`",
            ),
            ("type = \"directional\"", "does not take this field"),
        ] {
            let error = lamp(fields).unwrap_err();
            assert!(error.contains(words), "{fields}: {error}");
        }
    }
}
