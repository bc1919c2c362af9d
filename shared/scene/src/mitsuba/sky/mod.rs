//! The emitters `sunsky`, `sky` and `sun`, baked to a sky image.
//!
//! Source: Hosek and Wilkie, "An analytic model for full spectral sky-dome radiance" (2012) in RGB, as in Mitsuba 3,
//! and a table of the sun's irradiance in Mitsuba 3.9.1.

mod hosek_wilkie;
mod map;
mod sun;

use super::transform;
use super::write::{Section, Toml};
use super::xml::Id;
use super::{Converter, cie};
use glam::DVec3;

/// The sun's angular radius, degrees.
const HALF_APERTURE: f64 = 0.2679;

/// A sky, a sun, or both.
struct Sky {
    /// Turbidity, 1 to 10.
    turbidity: f64,
    /// Albedo of the ground.
    albedo: [f64; 3],
    /// The zenith.
    up: DVec3,
    /// Direction of the sun's centre.
    sun: DVec3,
    /// The sun's angular radius, radians.
    half_aperture: f64,
    /// Factors on the radiance of the sky and of the sun.
    sky_scale: f64,
    sun_scale: f64,
}

impl Converter<'_> {
    pub(super) fn sunsky(&mut self, id: Id, light: &mut Section) {
        let place = self.objects.list[id].place;
        let Some(sky) = self.sky(id) else {
            return light.set("radiance", Toml::Float(0.0), place);
        };
        match map::picture(&sky) {
            Ok(bytes) => {
                let name = format!("{}-sky.exr", self.stem);
                let message = format!("{}: its picture is {name}, which is made", self.title(id));
                self.log.note(place, message);
                light.set("image", Toml::string(&name), place);
                self.made.insert(name, bytes);
            }
            Err(reason) => {
                let message = format!("{}: {reason}", self.title(id));
                self.log.invalid(Some(place), message);
            }
        }
    }

    /// The emitter's sky; `None` after an error, and if it is left out.
    fn sky(&mut self, id: Id) -> Option<Sky> {
        let object = &self.objects.list[id];
        let (place, old) = (object.place, object.old);
        let turbidity = self.within(id, "turbidity", 3.0, [1.0, 10.0])?;
        let albedo = match self.member(id, "albedo") {
            Some(_) => self.color(id, "albedo", cie::Kind::Factor)?,
            None => [if old { 0.2 } else { 0.3 }; 3],
        };
        let scale = self.within(id, "scale", 1.0, [0.0, f64::MAX])?;
        let mut sky_scale = self.within(id, "sky_scale", scale, [0.0, f64::MAX])?;
        let mut sun_scale = self.within(id, "sun_scale", scale, [0.0, f64::MAX])?;
        match object.plugin.as_str() {
            "sky" => sun_scale = 0.0,
            "sun" => sky_scale = 0.0,
            _ => {}
        }
        let half_aperture = match old {
            true => HALF_APERTURE * self.within(id, "sun_radius_scale", 1.0, [0.0, 300.0])?,
            false => 0.5 * self.within(id, "sun_aperture", 2.0 * HALF_APERTURE, [1e-3, 179.0])?,
        };
        for (name, usual) in [("stretch", 1.0), ("extend", 0.0)] {
            let is_usual = match name {
                "stretch" => self.float(id, name).is_none_or(|x| x == usual),
                _ => self.boolean(id, name) != Some(true),
            };
            if let (false, Some(member)) = (is_usual, self.member(id, name)) {
                self.unsupported(id, member, "skies below the horizon are not supported");
            }
        }
        // The resolution of Mitsuba's image.
        self.ignore(id, &["resolution"]);
        if old && sun_scale > 0.0 {
            let message = format!(
                "{}: the sun is as bright as in Mitsuba 3, whose model is another one than in format 0.x",
                self.title(id)
            );
            self.log.note(place, message);
        }
        let to_world = transform::compose(self.transform(id, "to_world")).matrix3;
        // Versions before 2 used y up.
        let up = if old { DVec3::Y } else { DVec3::Z };
        let sun = match self.member(id, "sun_direction") {
            Some(_) => DVec3::from(self.vector(id, "sun_direction")?),
            None => {
                let [east, north, above] = sun::position(&self.moment(id)?);
                to_world
                    * match old {
                        true => DVec3::new(east, above, -north),
                        false => DVec3::new(-north, -east, above),
                    }
            }
        };
        let sky = Sky {
            turbidity,
            albedo,
            up: (to_world * up).normalize_or_zero(),
            sun: sun.normalize_or_zero(),
            // A sun without width would fall between pixels.
            half_aperture: if half_aperture > 0.0 {
                half_aperture
            } else {
                HALF_APERTURE
            }
            .to_radians(),
            sky_scale,
            sun_scale,
        };
        if sky.up == DVec3::ZERO || sky.sun == DVec3::ZERO {
            let message = format!("{}: expected directions other than [0, 0, 0]", self.title(id));
            return self.log.fatal(Some(place), message);
        }
        if sky.up.dot(sky.sun) < 0.0 {
            let message = format!(
                "{}: the sun is below the horizon, for which there is no model",
                self.title(id)
            );
            self.log.unsupported(place, message);
            return None;
        }
        Some(sky)
    }

    /// Time and place, by default a summer afternoon in Tokyo, as in Mitsuba.
    fn moment(&mut self, id: Id) -> Option<sun::Moment> {
        let mut number = |name: &str, default: f64| self.within(id, name, default, [-1e4, 1e4]);
        Some(sun::Moment {
            latitude: number("latitude", 35.6894)?,
            longitude: number("longitude", 139.6917)?,
            year: number("year", 2010.0)? as i64,
            month: number("month", 7.0)? as i64,
            day: number("day", 10.0)? as i64,
            hour: number("hour", 15.0)? - number("timezone", 9.0)?
                + (number("minute", 0.0)? + number("second", 0.0)? / 60.0) / 60.0,
        })
    }

    /// A number within bounds; `None` after an error.
    fn within(&mut self, id: Id, name: &str, default: f64, [low, high]: [f64; 2]) -> Option<f64> {
        let Some(member) = self.member(id, name) else {
            return Some(default);
        };
        let number = self.float(id, name)?;
        if (low..=high).contains(&number) {
            return Some(number);
        }
        let message = match high < 1e5 {
            true => format!("expected a number from {low} to {high}, found {number}"),
            false => format!("expected a number that is not negative, found {number}"),
        };
        self.wrong(id, member, &message);
        None
    }
}
