//! Textures: an image, a chequerboard, or a constant colour.

use super::transform::{self, Step};
use super::value::Value;
use super::write::Toml;
use super::xml::{Content, Id, Kind, Member};
use super::{Converter, cie, property};

/// The steps that flip v, where images and native UVs run in opposite directions.
const TURN: [Step; 2] = [Step::Scale([1.0, -1.0, 1.0]), Step::Translate([0.0, 1.0, 0.0])];

impl Converter<'_> {
    /// A colour or a texture of a material. `turned`: the shape's v runs opposite to Mitsuba's.
    pub fn textured(&mut self, object: Id, name: &str, kind: cie::Kind, turned: bool) -> Option<Toml> {
        let member = self.member(object, name)?;
        self.textured_member(object, member, kind, turned)
    }

    /// [`Self::textured`] for a given member.
    pub fn textured_member(&mut self, object: Id, member: &Member, kind: cie::Kind, turned: bool) -> Option<Toml> {
        match &member.content {
            Content::Value(value) => match property::color(value, kind) {
                Some(color) => self.in_range(object, member, color, kind).map(Toml::color),
                None => {
                    let found = value.describe();
                    self.wrong(
                        object,
                        member,
                        &format!("expected a colour or a texture, found {found}"),
                    );
                    None
                }
            },
            Content::Object(id) => match self.spectrum(*id, kind) {
                Some(color) => self.in_range(object, member, color?, kind).map(Toml::color),
                None => self.texture_of(*id, turned, kind).map(Toml::Table),
            },
        }
    }

    /// A texture of factors, as table fields.
    pub fn texture(&mut self, id: Id, turned: bool) -> Option<Vec<(&'static str, Toml)>> {
        self.texture_of(id, turned, cie::Kind::Factor)
    }

    /// A texture of one kind of colour, as table fields.
    fn texture_of(&mut self, id: Id, turned: bool, kind: cie::Kind) -> Option<Vec<(&'static str, Toml)>> {
        match self.objects.list[id].plugin.as_str() {
            "bitmap" => {
                let image = self.asset(id, "filename");
                let mut fields = vec![("image", image?.0)];
                let linear = self.gamma(id);
                if self.boolean(id, "raw").unwrap_or(linear) {
                    fields.push(("raw", Toml::Boolean(true)));
                }
                // Larger filters only reduce noise.
                let filters = ["bilinear", "nearest", "trilinear", "ewa"];
                if self.word(id, "filter_type", &filters) == Some("nearest") {
                    fields.push(("filter", Toml::string("nearest")));
                }
                if let Some(wrap) = self.wrap(id) {
                    fields.push(("wrap", Toml::string(wrap)));
                }
                // These only affect how the image is stored.
                self.ignore(id, &["accel", "format", "max_anisotropy", "cache"]);
                // Image v points down in Mitsuba and up here.
                self.uv_map(id, turned, true, &mut fields);
                self.finish(id);
                Some(fields)
            }
            "checkerboard" => {
                let mut color = |name: &str, default: f64| match self.color(id, name, kind) {
                    Some(color) => Toml::color(color),
                    None => Toml::Float(default),
                };
                let colors = vec![color("color0", 0.4), color("color1", 0.2)];
                let mut fields = vec![("checkerboard", Toml::Array(colors))];
                self.uv_map(id, turned, false, &mut fields);
                self.finish(id);
                Some(fields)
            }
            "scale" => self.scaled(id, turned),
            // The attribute comes from the shape's file copy, see `with_attribute`.
            "mesh_attribute" => {
                self.ignore(id, &["name", "scale"]);
                self.finish(id);
                Some(vec![("attribute", Toml::string("color"))])
            }
            _ => {
                self.unsupported_plugin(id);
                None
            }
        }
    }

    /// A scaled texture of format 0.x. Only chequerboards are scaled here; scaled images are left to fields that can
    /// take the factor, see [`Self::scale_of`].
    fn scaled(&mut self, id: Id, turned: bool) -> Option<Vec<(&'static str, Toml)>> {
        let (factor, inner) = self.scale_of(id)?;
        let mut fields = self.texture(inner, turned)?;
        match &mut fields[..] {
            [("checkerboard", Toml::Array(colors)), ..] => {
                for color in colors {
                    times(color, factor);
                }
            }
            _ if factor == 1.0 => {}
            _ => {
                let message = "texture \"scale\": an image times a number is not supported here";
                self.log.unsupported(self.objects.list[id].place, message);
            }
        }
        Some(fields)
    }

    /// The factor and texture of a `scale`.
    pub fn scale_of(&mut self, id: Id) -> Option<(f64, Id)> {
        let factor = match self.member(id, "scale").map(|member| &member.content) {
            Some(Content::Value(Value::Float(_) | Value::Integer(_))) => self.float(id, "scale"),
            // A colour factor counts by its mean.
            _ => self
                .color(id, "scale", cie::Kind::Unbounded)
                .map(|c| c.iter().sum::<f64>() / 3.0),
        };
        let nested = self.nested(id, Kind::Texture);
        self.finish(id);
        match nested[..] {
            [(_, inner)] => Some((factor.unwrap_or(1.0), inner)),
            _ => {
                let message = "texture \"scale\": expected one nested texture";
                self.log.fatal(Some(self.objects.list[id].place), message)
            }
        }
    }

    /// Whether, in versions before 2, the image's numbers are linear.
    fn gamma(&mut self, id: Id) -> bool {
        let Some(member) = self.member(id, "gamma") else {
            return false;
        };
        let gamma = self.float(id, "gamma").unwrap_or(-1.0);
        if gamma != 1.0 && gamma != -1.0 {
            let message = format!("texture \"bitmap\": a gamma of {gamma} is taken as sRGB's");
            self.log.note(member.place, message);
        }
        gamma == 1.0
    }

    /// The wrap mode, unless it is `repeat`.
    fn wrap(&mut self, id: Id) -> Option<&'static str> {
        let modes = ["repeat", "mirror", "clamp", "zero", "one", "black", "white"];
        let mut wrap = None;
        for name in ["wrap_mode", "wrap_mode_u", "wrap_mode_v"] {
            let given = self.word(id, name, &modes);
            if let (Some(mode @ ("zero" | "one" | "black" | "white")), Some(member)) = (given, self.member(id, name)) {
                let message = format!("texture \"bitmap\": {name}: \"{mode}\" is taken as \"clamp\"");
                self.log.note(member.place, message);
                wrap = Some("clamp");
            } else if let (Some(one), Some(other), Some(member)) = (given, wrap, self.member(id, name))
                && one != other
            {
                let message = format!("texture \"bitmap\": {name}: \"{one}\" is taken as \"{other}\", as the other is");
                self.log.note(member.place, message);
            } else {
                wrap = given.or(wrap);
            }
        }
        wrap.filter(|wrap| *wrap != "repeat")
    }

    /// The UV map: a flip for the shape, then `to_uv`, then a flip for the image.
    fn uv_map(&mut self, id: Id, turned: bool, image: bool, fields: &mut Vec<(&'static str, Toml)>) {
        let steps = self.transform(id, "to_uv");
        if steps.is_empty() {
            // Two flips cancel.
            if turned != image {
                fields.push(("uv", transform::write(&TURN)));
            }
            return;
        }
        let planar = |step: &Step| match step {
            Step::Translate(_) | Step::Scale(_) => true,
            Step::Rotate { axis, .. } => axis[0] == 0.0 && axis[1] == 0.0,
            Step::LookAt { .. } | Step::Matrix(_) => false,
        };
        let mut uv = match turned {
            true => written(&TURN),
            false => Vec::new(),
        };
        if steps.iter().all(planar) {
            uv.extend(written(steps));
        } else {
            let m = transform::flat(steps);
            let row = |i: usize| Toml::numbers(&m.row(i).to_array());
            let rows = Toml::Array(vec![row(0), row(1), row(2)]);
            uv.push(Toml::table([("matrix", rows)]));
        }
        if image {
            uv.extend(written(&TURN));
        }
        fields.push(("uv", Toml::Array(uv)));
    }
}

/// A colour times a number, clamped to the range of reflectances.
fn times(color: &mut Toml, factor: f64) {
    match color {
        Toml::Float(x) => *x = (*x * factor).clamp(0.0, 1.0),
        Toml::Array(channels) => channels.iter_mut().for_each(|channel| times(channel, factor)),
        _ => {}
    }
}

fn written(steps: &[Step]) -> Vec<Toml> {
    match transform::write(steps) {
        Toml::Array(steps) => steps,
        other => vec![other],
    }
}
