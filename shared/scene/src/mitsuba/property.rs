//! Queries of objects' properties. A property that is never queried is not supported.

use super::Converter;
use super::attributes;
use super::cie;
use super::transform::Step;
use super::value::{self, Value};
use super::write::Toml;
use super::xml::{Content, Id, Kind, Member};
use crate::paths;
use crate::reach::Written;
use beamfarm_image::bundle;
use std::path::PathBuf;

/// A file that a scene names.
pub struct Named {
    pub path: PathBuf,
    pub written: Written,
}

impl<'a> Converter<'a> {
    /// The member of that name, marked as used.
    pub fn member(&self, object: Id, name: &str) -> Option<&'a Member> {
        let members = &self.objects.list[object].members;
        let member = members.iter().rev().find(|m| m.name.as_deref() == Some(name))?;
        // The last value of a name counts, as in Mitsuba.
        for member in members.iter().filter(|m| m.name.as_deref() == Some(name)) {
            member.used.set(true);
        }
        Some(member)
    }

    /// Mark properties that have no meaning here as used.
    pub fn ignore(&self, object: Id, names: &[&str]) {
        for name in names {
            self.member(object, name);
        }
    }

    /// Note all unused members of an object that hardly affects the image, and mark them as used.
    pub fn pass_over(&mut self, object: Id) {
        let objects = self.objects;
        for member in objects.list[object].members.iter().filter(|m| !m.used.get()) {
            member.used.set(true);
            let name = member.name.as_deref().unwrap_or_default();
            let message = format!("{}: the parameter \"{name}\" is passed over", self.title(object));
            self.log.note(member.place, message);
        }
    }

    /// Nested objects of a kind, named or not, marked as used.
    pub fn nested(&self, object: Id, kind: Kind) -> Vec<(&'a Member, Id)> {
        let of_kind = |member: &'a Member| match member.content {
            Content::Object(id) if self.objects.list[id].kind == kind => {
                member.used.set(true);
                Some((member, id))
            }
            _ => None,
        };
        let members = &self.objects.list[object].members;
        members.iter().filter_map(of_kind).collect()
    }

    /// Report the members of an object that were never queried.
    pub fn finish(&mut self, object: Id) {
        if !self.finished.insert(object) {
            return;
        }
        let objects = self.objects;
        let owner = &objects.list[object];
        for member in owner.members.iter().filter(|m| !m.used.get()) {
            let what = match (&member.content, &member.name) {
                (Content::Value(_), name) => {
                    format!("the parameter \"{}\"", name.as_deref().unwrap_or_default())
                }
                (Content::Object(id), name) => {
                    let inner = &objects.list[*id];
                    let name = name.as_ref().map(|name| format!(" as \"{name}\""));
                    format!(
                        "a nested {} \"{}\"{}",
                        inner.kind.tag(),
                        inner.plugin,
                        name.unwrap_or_default()
                    )
                }
            };
            // Versions before 2 warned of unqueried properties and still rendered.
            if owner.old && matches!(member.content, Content::Value(_)) {
                let message = format!("{}: {what} is passed over", self.title(object));
                self.log.note(member.place, message);
                continue;
            }
            let message = format!("{}: {what} is not supported", self.title(object));
            self.log.unsupported(member.place, message);
        }
    }

    /// An object's name in messages: kind and plugin.
    pub fn title(&self, object: Id) -> String {
        let object = &self.objects.list[object];
        format!("{} \"{}\"", object.kind.tag(), object.plugin)
    }

    /// Report that an object's plugin is not supported.
    pub fn unsupported_plugin(&mut self, object: Id) {
        let message = format!("{} is not supported", self.title(object));
        self.log.unsupported(self.objects.list[object].place, message);
        self.finished.insert(object);
    }

    /// Report a faulty parameter.
    pub fn wrong(&mut self, object: Id, member: &Member, message: &str) {
        let name = member.name.as_deref().unwrap_or_default();
        let message = format!("{}: {name}: {message}", self.title(object));
        self.log.invalid(Some(member.place), message);
    }

    /// Report that a parameter's value is not supported.
    pub fn unsupported(&mut self, object: Id, member: &Member, message: &str) {
        let name = member.name.as_deref().unwrap_or_default();
        let message = format!("{}: {name}: {message}", self.title(object));
        self.log.unsupported(member.place, message);
    }

    fn mismatch(&mut self, object: Id, member: &Member, expected: &str) {
        let found = match &member.content {
            Content::Value(value) => value.describe().to_string(),
            Content::Object(id) => {
                let inner = &self.objects.list[*id];
                let title = format!("{} \"{}\"", inner.kind.tag(), inner.plugin);
                // Mitsuba would accept some of them.
                let message = format!("{title} is not supported here; expected {expected}");
                return self.unsupported(object, member, &message);
            }
        };
        self.wrong(object, member, &format!("expected {expected}, found {found}"));
    }

    /// A number.
    pub fn float(&mut self, object: Id, name: &str) -> Option<f64> {
        let member = self.member(object, name)?;
        match member.content {
            Content::Value(Value::Float(x)) => Some(x),
            Content::Value(Value::Integer(n)) => Some(n as f64),
            _ => {
                self.mismatch(object, member, "a <float>");
                None
            }
        }
    }

    /// A whole number.
    pub fn integer(&mut self, object: Id, name: &str) -> Option<i64> {
        let member = self.member(object, name)?;
        match member.content {
            Content::Value(Value::Integer(n)) => Some(n),
            _ => {
                self.mismatch(object, member, "an <integer>");
                None
            }
        }
    }

    /// True or false.
    pub fn boolean(&mut self, object: Id, name: &str) -> Option<bool> {
        let member = self.member(object, name)?;
        match member.content {
            Content::Value(Value::Boolean(b)) => Some(b),
            _ => {
                self.mismatch(object, member, "a <boolean>");
                None
            }
        }
    }

    /// A string.
    pub fn string(&mut self, object: Id, name: &str) -> Option<&'a str> {
        let member = self.member(object, name)?;
        match &member.content {
            Content::Value(Value::String(text)) => Some(text),
            _ => {
                self.mismatch(object, member, "a <string>");
                None
            }
        }
    }

    /// One of several words; any other is an error that lists them.
    pub fn word(&mut self, object: Id, name: &str, words: &[&'static str]) -> Option<&'static str> {
        let text = self.string(object, name)?;
        let member = self.member(object, name)?;
        match words.iter().find(|word| word.eq_ignore_ascii_case(text)) {
            Some(word) => Some(word),
            None => {
                let message = format!("expected one of {}, found \"{text}\"", words.join(", "));
                self.wrong(object, member, &message);
                None
            }
        }
    }

    /// A point or a vector.
    pub fn vector(&mut self, object: Id, name: &str) -> Option<[f64; 3]> {
        let member = self.member(object, name)?;
        match member.content {
            Content::Value(Value::Vector(v)) => Some(v),
            _ => {
                self.mismatch(object, member, "a <point> or <vector>");
                None
            }
        }
    }

    /// The steps of a transform; none for the identity.
    pub fn transform(&mut self, object: Id, name: &str) -> &'a [Step] {
        let Some(member) = self.member(object, name) else {
            return &[];
        };
        match &member.content {
            Content::Value(Value::Transform(steps)) => steps,
            _ => {
                self.mismatch(object, member, "a <transform>");
                &[]
            }
        }
    }

    /// A constant colour.
    pub fn color(&mut self, object: Id, name: &str, kind: cie::Kind) -> Option<[f64; 3]> {
        let member = self.member(object, name)?;
        let color = self.color_as_it_is(object, member, kind)?;
        self.in_range(object, member, color, kind)
    }

    /// A constant colour that is not checked against the range of its kind.
    pub fn color_as_it_is(&mut self, object: Id, member: &'a Member, kind: cie::Kind) -> Option<[f64; 3]> {
        match &member.content {
            Content::Value(value) => {
                let color = color(value, kind);
                if color.is_none() {
                    self.mismatch(object, member, "a colour");
                }
                color
            }
            Content::Object(id) => match self.spectrum(*id, kind) {
                Some(color) => color,
                None => {
                    self.mismatch(object, member, "a colour that is the same everywhere");
                    None
                }
            },
        }
    }

    /// Refuse colours out of the range of their kind. In versions before 2, factors above 1 are darkened to at most 1.
    pub fn in_range(&mut self, object: Id, member: &Member, color: [f64; 3], kind: cie::Kind) -> Option<[f64; 3]> {
        let most = color.into_iter().fold(0.0, f64::max);
        let negative = color.iter().any(|c| *c < 0.0);
        let factor = kind == cie::Kind::Factor;
        let expected = match factor {
            _ if !negative && (!factor || most <= 1.0) => return Some(color),
            true if !negative && self.objects.list[object].old => {
                let darker = color.map(|c| c / most);
                let name = member.name.as_deref().unwrap_or_default();
                let message = format!("{}: {name}: {color:?} becomes {darker:?}", self.title(object));
                self.log.note(member.place, message);
                return Some(darker);
            }
            true => "from 0 to 1",
            false => "that are not negative",
        };
        let message = format!("expected numbers {expected}, found {color:?}");
        self.wrong(object, member, &message);
        None
    }

    /// The colour of an object such as `<spectrum type="d65">`. The outer `None`: it is not a colour; the inner one: it
    /// is faulty.
    pub fn spectrum(&mut self, id: Id, kind: cie::Kind) -> Option<Option<[f64; 3]>> {
        let color = match self.objects.list[id].plugin.as_str() {
            "uniform" => {
                let value = self.float(id, "value").unwrap_or(1.0);
                Some([value; 3])
            }
            "srgb" => self.color(id, "color", cie::Kind::Factor),
            "rawconstant" => self.raw_constant(id),
            "regular" | "irregular" => self.tabulated(id).map(|samples| cie::to_rgb(&samples, kind)),
            "blackbody" => {
                let kelvin = self.float(id, "temperature");
                let scale = self.float(id, "scale").unwrap_or(1.0);
                self.ignore(id, &["wavelength_min", "wavelength_max"]);
                kelvin.map(|kelvin| cie::to_rgb(&value::planck(kelvin, scale), kind))
            }
            "volume" => self.volume_color(id, kind),
            // White light in RGB mode, as Mitsuba's white is D65.
            "d65" if kind == cie::Kind::Emission => {
                let scale = self.float(id, "scale").unwrap_or(1.0);
                let color = match self.member(id, "color") {
                    Some(_) => self.color(id, "color", kind),
                    None => Some([1.0; 3]),
                };
                color.map(|color| color.map(|c| c * scale))
            }
            _ => return None,
        };
        self.finish(id);
        Some(color)
    }

    /// Three numbers or one, without conversion.
    fn raw_constant(&mut self, id: Id) -> Option<[f64; 3]> {
        match self.member(id, "value").map(|member| &member.content) {
            Some(Content::Value(Value::Vector(v))) => Some(*v),
            _ => self.float(id, "value").map(|x| [x; 3]),
        }
    }

    /// The numbers in a string.
    pub fn number_list(&mut self, id: Id, name: &str) -> Option<Vec<f64>> {
        let member = self.member(id, name)?;
        match attributes::numbers(self.string(id, name)?) {
            Ok(numbers) => Some(numbers),
            Err(message) => {
                self.wrong(id, member, &message);
                None
            }
        }
    }

    /// The samples of a `regular` or `irregular` spectrum.
    fn tabulated(&mut self, id: Id) -> Option<Vec<(f64, f64)>> {
        let values = self.number_list(id, "values")?;
        let wavelengths = match self.objects.list[id].plugin.as_str() {
            "irregular" => self.number_list(id, "wavelengths")?,
            _ => {
                let ends = ["wavelength_min", "wavelength_max"].map(|name| self.float(id, name));
                let (first, last) = (ends[0]?, ends[1]?);
                let steps = values.len().saturating_sub(1).max(1) as f64;
                (0..values.len())
                    .map(|i| first + (last - first) * i as f64 / steps)
                    .collect()
            }
        };
        let rising = wavelengths.windows(2).all(|pair| pair[0] < pair[1]);
        if values.len() < 2 || wavelengths.len() != values.len() || !rising {
            let message = format!(
                "{}: expected as many wavelengths, rising, as values, at least two",
                self.title(id)
            );
            return self.log.fatal(Some(self.objects.list[id].place), message);
        }
        Some(wavelengths.into_iter().zip(values).collect())
    }

    /// The bytes of a file, or why they cannot be read.
    pub fn read(&self, file: &Named) -> Result<Vec<u8>, String> {
        self.reach.read(&file.path, bundle::MAX_BYTES, file.written)
    }

    /// The file that a parameter names, as a path relative to the native scene file's folder.
    pub fn asset(&mut self, object: Id, name: &str) -> Option<(Toml, Named)> {
        let Some(member) = self.member(object, name) else {
            let message = format!("{}: the parameter \"{name}\" is missing", self.title(object));
            self.log.invalid(Some(self.objects.list[object].place), message);
            return None;
        };
        let written = self.string(object, name)?;
        let path = self.objects.resolve(member.place, written);
        match paths::relative(&path, self.folder).to_str() {
            Some(text) => {
                let written = member.place.author();
                if written == Written::ByUser {
                    self.reach.named_by_user(&path);
                }
                Some((Toml::string(text), Named { path, written }))
            }
            None => {
                self.wrong(object, member, "the file's path is not UTF-8");
                None
            }
        }
    }
}

/// The colour of a value, if it is one.
pub fn color(value: &Value, kind: cie::Kind) -> Option<[f64; 3]> {
    Some(match value {
        Value::Float(x) => [*x; 3],
        Value::Integer(n) => [*n as f64; 3],
        Value::Rgb(color) => *color,
        Value::Uniform(x) if kind == cie::Kind::Emission => cie::EQUAL_ENERGY.map(|c| c * x),
        Value::Uniform(x) => [*x; 3],
        Value::Spectrum(samples) => cie::to_rgb(samples, kind),
        _ => return None,
    })
}
