//! Asking objects for their properties. What nobody asks for is not supported.

use super::Converter;
use super::cie;
use super::transform::Step;
use super::value::Value;
use super::write::Toml;
use super::xml::{Content, Id, Kind, Member};
use crate::paths;
use std::path::PathBuf;

impl<'a> Converter<'a> {
    /// The member of a name; from now on it counts as used.
    pub fn member(&self, object: Id, name: &str) -> Option<&'a Member> {
        let members = &self.objects.list[object].members;
        let member = members.iter().rev().find(|m| m.name.as_deref() == Some(name))?;
        // An object's last value of a name counts, as in Mitsuba.
        for member in members.iter().filter(|m| m.name.as_deref() == Some(name)) {
            member.used.set(true);
        }
        Some(member)
    }

    /// Ask for properties that have no meaning here.
    pub fn ignore(&self, object: Id, names: &[&str]) {
        for name in names {
            self.member(object, name);
        }
    }

    /// Nested objects of a kind, named or not; from now on they count as used.
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

    /// Say which members of an object nobody asked for.
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
            let message = format!("{}: {what} is not supported", self.title(object));
            self.log.unsupported(member.place, message);
        }
    }

    /// An object as messages name it: kind and plugin.
    pub fn title(&self, object: Id) -> String {
        let object = &self.objects.list[object];
        format!("{} \"{}\"", object.kind.tag(), object.plugin)
    }

    /// Say that an object's plugin is not supported.
    pub fn unsupported_plugin(&mut self, object: Id) {
        let message = format!("{} is not supported", self.title(object));
        self.log.unsupported(self.objects.list[object].place, message);
        self.finished.insert(object);
    }

    /// Say what is wrong with a parameter.
    pub fn wrong(&mut self, object: Id, member: &Member, message: &str) {
        let name = member.name.as_deref().unwrap_or_default();
        let message = format!("{}: {name}: {message}", self.title(object));
        self.log.invalid(Some(member.place), message);
    }

    /// Say that a parameter's value is not supported.
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
                // Mitsuba would take some of them.
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

    /// One of several words; another is an error that names them.
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

    /// The steps of a transform; none are the identity.
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

    /// A colour that must be the same everywhere.
    pub fn color(&mut self, object: Id, name: &str, kind: cie::Kind) -> Option<[f64; 3]> {
        let member = self.member(object, name)?;
        let color = match &member.content {
            Content::Value(value) => match color(value, kind) {
                Some(color) => color,
                None => {
                    self.mismatch(object, member, "a colour");
                    return None;
                }
            },
            Content::Object(id) => match self.spectrum(*id, kind) {
                Some(color) => color?,
                None => {
                    self.mismatch(object, member, "a colour that is the same everywhere");
                    return None;
                }
            },
        };
        self.in_range(object, member, color, kind)
    }

    /// Refuse what a colour of this kind cannot be.
    pub fn in_range(&mut self, object: Id, member: &Member, color: [f64; 3], kind: cie::Kind) -> Option<[f64; 3]> {
        let expected = match kind {
            cie::Kind::Factor if color.iter().any(|c| !(0.0..=1.0).contains(c)) => "from 0 to 1",
            _ if color.iter().any(|c| *c < 0.0) => "that are not negative",
            _ => return Some(color),
        };
        let message = format!("expected numbers {expected}, found {color:?}");
        self.wrong(object, member, &message);
        None
    }

    /// The colour of an object such as `<spectrum type="d65">`; the outer `None` when it is none, the inner one when it
    /// is broken.
    pub fn spectrum(&mut self, id: Id, kind: cie::Kind) -> Option<Option<[f64; 3]>> {
        let color = match self.objects.list[id].plugin.as_str() {
            "uniform" => {
                let value = self.float(id, "value").unwrap_or(1.0);
                Some([value; 3])
            }
            "srgb" => self.color(id, "color", cie::Kind::Factor),
            // In RGB mode white light: Mitsuba's white is D65.
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

    /// The path of the file that a parameter names, relative to the native scene file's folder.
    pub fn asset(&mut self, object: Id, name: &str) -> Option<(Toml, PathBuf)> {
        let Some(member) = self.member(object, name) else {
            let message = format!("{}: the parameter \"{name}\" is missing", self.title(object));
            self.log.invalid(Some(self.objects.list[object].place), message);
            return None;
        };
        let written = self.string(object, name)?;
        let path = self.objects.resolve(member.place, written);
        match paths::relative(&path, self.folder).to_str() {
            Some(text) => Some((Toml::string(text), path.clone())),
            None => {
                self.wrong(object, member, "the file's path is not UTF-8");
                None
            }
        }
    }
}

/// The colour of a value, where it is one.
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
