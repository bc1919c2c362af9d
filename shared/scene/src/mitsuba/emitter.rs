//! Emitters that are not surfaces.

use super::transform::{self, Step};
use super::write::{Section, Toml};
use super::xml::{Content, Id, Kind};
use super::{Converter, cie};
use crate::assets::image::{self, Encoding};
use glam::DVec3;

impl Converter<'_> {
    /// A light; `None` if the emitter is not supported.
    pub fn emitter(&mut self, id: Id) -> Option<Section> {
        let object = &self.objects.list[id];
        let place = object.place;
        let mut light = Section::item("lights", place);
        if let Some(name) = &object.id {
            light.set("name", Toml::string(name), place);
        }
        let kind = match object.plugin.as_str() {
            "point" => "point",
            "spot" => "spot",
            "projector" => "projector",
            "directional" => "directional",
            "constant" | "envmap" | "sunsky" | "sky" | "sun" => "environment",
            "area" => {
                let message = "an emitter \"area\" that no shape has does not shine";
                self.log.note(place, message);
                return None;
            }
            _ => {
                self.unsupported_plugin(id);
                return None;
            }
        };
        light.set("type", Toml::string(kind), place);
        match object.plugin.as_str() {
            "point" => {
                let position = match self.position(id, "position") {
                    Some(position) => position,
                    None => transform::compose(self.transform(id, "to_world")).translation.into(),
                };
                light.set("position", Toml::numbers(&position), place);
                self.emission(id, "intensity", &mut light);
            }
            "spot" => self.spot(id, &mut light),
            "projector" => self.projector(id, &mut light),
            "directional" => {
                let direction = match self.position(id, "direction") {
                    Some(direction) => direction,
                    None => {
                        let map = transform::compose(self.transform(id, "to_world"));
                        (map.matrix3 * DVec3::Z).into()
                    }
                };
                light.set("direction", Toml::numbers(&direction), place);
                self.emission(id, "irradiance", &mut light);
            }
            "constant" => self.emission(id, "radiance", &mut light),
            "sunsky" | "sky" | "sun" => self.sunsky(id, &mut light),
            _ => self.envmap(id, &mut light),
        }
        if kind == "environment" {
            self.hide(&mut light);
        }
        self.sampling(id);
        self.finish(id);
        Some(light)
    }

    /// Ignore what only affects Mitsuba's sampling. The medium is found by the surroundings.
    pub fn sampling(&mut self, id: Id) {
        self.ignore(id, &["sampling_weight"]);
        self.nested(id, Kind::Medium);
    }

    /// An emitted colour, white of 1 by default.
    pub fn emission(&mut self, id: Id, name: &'static str, light: &mut Section) {
        let place = self.member(id, name).map_or(self.objects.list[id].place, |m| m.place);
        let color = match self.member(id, name) {
            Some(_) => self.color(id, name, cie::Kind::Emission),
            None => Some([1.0; 3]),
        };
        if let Some(color) = color {
            light.set(name, Toml::color(color), place);
        }
    }

    /// A vector given instead of `to_world`.
    fn position(&mut self, id: Id, name: &str) -> Option<[f64; 3]> {
        let member = self.member(id, name)?;
        if self.member(id, "to_world").is_some() {
            let message = format!("expected {name} or to_world, not both");
            self.wrong(id, member, &message);
        }
        self.vector(id, name)
    }

    fn spot(&mut self, id: Id, light: &mut Section) {
        let steps = self.transform(id, "to_world");
        let place = self
            .member(id, "to_world")
            .map_or(self.objects.list[id].place, |m| m.place);
        let (position, target) = match steps {
            [Step::LookAt { origin, target, .. }] => (*origin, *target),
            steps => {
                let map = transform::compose(steps);
                let target = map.translation + map.matrix3 * DVec3::Z;
                (map.translation.into(), target.into())
            }
        };
        light.set("position", Toml::numbers(&position), place);
        light.set("target", Toml::numbers(&target), place);
        self.emission(id, "intensity", light);
        for name in ["cutoff_angle", "beam_width"] {
            if let Some(member) = self.member(id, name)
                && let Some(angle) = self.float(id, name)
            {
                light.set(name, Toml::Float(angle), member.place);
            }
        }
        if let Some(member) = self.member(id, "texture")
            && let Content::Object(texture) = member.content
            && self.picture(texture, light)
        {
            // Mitsuba's image is upside down there.
            let up = -self.up(steps);
            light.set("up", Toml::numbers(&up.to_array()), place);
        }
    }

    /// Light on a plane at distance 1 from a pinhole.
    fn projector(&mut self, id: Id, light: &mut Section) {
        let steps = self.transform(id, "to_world");
        let place = self
            .member(id, "to_world")
            .map_or(self.objects.list[id].place, |m| m.place);
        let map = transform::compose(steps);
        light.set("position", Toml::numbers(&map.translation.to_array()), place);
        let target = map.translation + map.matrix3 * DVec3::Z;
        light.set("target", Toml::numbers(&target.to_array()), place);
        let up = self.up(steps);
        light.set("up", Toml::numbers(&up.to_array()), place);
        if map.matrix3.determinant() < 0.0 {
            let message = "emitter \"projector\": to_world mirrors; the picture is not mirrored";
            self.log.note(place, message);
        }
        let mut color = [1.0; 3];
        let mut aspect = 1.0;
        if let Some(member) = self.member(id, "irradiance") {
            let picture = match member.content {
                Content::Object(texture) if self.objects.list[texture].plugin == "bitmap" => Some(texture),
                _ => None,
            };
            match picture {
                Some(texture) => {
                    self.picture(texture, light);
                    aspect = self.aspect(texture).unwrap_or(aspect);
                }
                None => color = self.color(id, "irradiance", cie::Kind::Emission).unwrap_or(color),
            }
        }
        // Mitsuba 3.9's result at the image's centre: pi times the number.
        let scale = std::f64::consts::PI * self.float(id, "scale").unwrap_or(1.0);
        light.set("intensity", Toml::color(color.map(|c| c * scale)), place);
        if let Some((fov, place)) = self.width_angle(id, aspect) {
            light.set("fov", Toml::Float(fov), place);
        }
    }

    /// Aspect ratio of a bitmap. A faulty file is reported where it is read.
    fn aspect(&mut self, texture: Id) -> Option<f64> {
        let (_, path) = self.asset(texture, "filename")?;
        let bytes = self.read(&path).ok()?;
        let image = image::read(&bytes, Encoding::Raw).ok()?;
        Some(f64::from(image.width) / f64::from(image.height))
    }

    /// The direction of the y axis.
    fn up(&self, steps: &[Step]) -> DVec3 {
        transform::compose(steps).matrix3.y_axis.normalize_or(DVec3::Y)
    }

    /// The image of a lamp; false if it is not supported.
    fn picture(&mut self, texture: Id, light: &mut Section) -> bool {
        let place = self.objects.list[texture].place;
        if self.objects.list[texture].plugin != "bitmap" {
            self.unsupported_plugin(texture);
            return false;
        }
        let fields = self.texture(texture, true).unwrap_or_default();
        for (name, value) in fields {
            match name {
                "image" | "raw" | "filter" => light.set(name, value, place),
                // Nothing lies beyond the image's edge.
                "wrap" => {}
                _ => {
                    let message = "texture \"bitmap\": to_uv is not supported in a lamp";
                    self.log.unsupported(place, message);
                }
            }
        }
        true
    }

    fn envmap(&mut self, id: Id, light: &mut Section) {
        let place = self
            .member(id, "filename")
            .map_or(self.objects.list[id].place, |m| m.place);
        if let Some((image, _)) = self.asset(id, "filename") {
            light.set("image", image, place);
        }
        if let Some(member) = self.member(id, "scale")
            && let Some(scale) = self.float(id, "scale")
        {
            light.set("scale", Toml::Float(scale), member.place);
        }
        let steps = self.transform(id, "to_world");
        let place = self.member(id, "to_world").map_or(place, |m| m.place);
        match steps {
            [] => {}
            [
                Step::Rotate {
                    axis: [0.0, y, 0.0],
                    degrees,
                },
            ] => {
                light.set("rotate_y", Toml::Float(degrees * y.signum()), place);
            }
            steps => light.set("transform", transform::write(steps), place),
        }
    }
}
