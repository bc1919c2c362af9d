//! BSDFs.

mod mix;
mod nearest;
mod parameters;
mod plain;

use super::write::{Section, Toml};
use super::xml::{Content, Id, Kind};
use super::{Converter, FileLine, cie, unique};
use plain::Plain;
use std::collections::{BTreeMap, BTreeSet};

/// The converted materials.
pub struct Materials {
    pub sections: Vec<Section>,
    names: BTreeSet<String>,
    /// Materials by BSDF and by whether their textures are upside down.
    done: BTreeMap<(Id, bool), Option<Material>>,
    /// Whether a BSDF contains a texture.
    textured: BTreeMap<Id, bool>,
    /// The name of the boundary material, once one is needed.
    boundary: Option<String>,
}

impl Materials {
    /// The name of a material that is only a boundary between media.
    pub fn boundary(&mut self, place: FileLine) -> String {
        if let Some(name) = &self.boundary {
            return name.clone();
        }
        let name = unique(&mut self.names, "boundary");
        let mut section = Section::named("materials", &name, place);
        section.set("type", Toml::string("null"), place);
        self.sections.push(section);
        self.boundary = Some(name.clone());
        name
    }

    pub fn new(ids: impl Iterator<Item = String>) -> Self {
        Self {
            sections: Vec::new(),
            names: ids.collect(),
            done: BTreeMap::new(),
            textured: BTreeMap::new(),
            boundary: None,
        }
    }
}

/// A converted BSDF.
#[derive(Clone, Debug)]
pub struct Material {
    pub name: String,
    pub through: Through,
}

/// Whether light passes through a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Through {
    /// It does not.
    No,
    /// It does, and another medium may lie behind it.
    Boundary,
    /// It does, but the medium stays the same on both sides.
    Sheet,
}

/// What the enclosing BSDFs contribute.
#[derive(Default)]
struct Around {
    two_sided: Option<FileLine>,
    fields: Vec<(&'static str, Toml, FileLine)>,
}

impl Converter<'_> {
    /// The material of a BSDF, converted once. `hint`: a name if it has no id. `turned`: the shape's v runs opposite to
    /// Mitsuba's.
    pub fn material(&mut self, id: Id, hint: Option<&str>, turned: bool) -> Option<Material> {
        // Most materials do not use UVs.
        let turned = turned && self.has_texture(id);
        if let Some(done) = self.materials.done.get(&(id, turned)) {
            return done.clone();
        }
        let object = &self.objects.list[id];
        let name = match (&object.id, hint) {
            (Some(own), _) if !turned => own.clone(),
            (Some(own), _) => unique(&mut self.materials.names, &format!("{own}-turned")),
            (None, Some(hint)) => unique(&mut self.materials.names, hint),
            (None, None) => unique(&mut self.materials.names, &object.plugin),
        };
        let mut section = Section::named("materials", &name, object.place);
        let material = self
            .bsdf(id, Around::default(), turned, &mut section)
            .map(|through| Material { name, through });
        if material.is_some() {
            self.materials.sections.push(section);
        }
        self.materials.done.insert((id, turned), material.clone());
        material
    }

    fn has_texture(&mut self, id: Id) -> bool {
        if let Some(known) = self.materials.textured.get(&id) {
            return *known;
        }
        let objects = self.objects;
        let textured = objects.list[id].members.iter().any(|member| {
            matches!(member.content, Content::Object(inner)
                if objects.list[inner].kind == Kind::Texture || self.has_texture(inner))
        });
        self.materials.textured.insert(id, textured);
        textured
    }

    /// Write a BSDF into a material. `None` if it is not supported.
    fn bsdf(&mut self, id: Id, mut around: Around, turned: bool, section: &mut Section) -> Option<Through> {
        let object = &self.objects.list[id];
        let place = object.place;
        match object.plugin.as_str() {
            "twosided" => {
                let nested = self.nested(id, Kind::Bsdf);
                self.finish(id);
                if let [(_, first), (member, second)] = nested[..]
                    && first != second
                {
                    let message = "bsdf \"twosided\": two different BSDFs for the two sides are not supported; the first is \
                        taken for both";
                    self.log.unsupported(member.place, message);
                }
                around.two_sided = Some(place);
                self.inside(id, nested.first().map(|(_, inner)| *inner), around, turned, section)
            }
            "blendbsdf" => self.blend(id, around, turned, section),
            "mixturebsdf" => self.mixture(id, around, turned, section),
            "principledthin" => self.thin(id, around, turned, section),
            "mask" => {
                let opacity = match self.member(id, "opacity") {
                    Some(_) => self.textured(id, "opacity", cie::Kind::Factor, turned),
                    None => Some(Toml::Float(0.5)),
                };
                if let Some(Toml::Array(channels)) = &opacity
                    && let [Toml::Float(r), Toml::Float(g), Toml::Float(b)] = channels[..]
                {
                    let message = "bsdf \"mask\": an opacity that differs by colour counts by its luminance";
                    self.log.note(place, message);
                    let luminance = 0.212671 * r + 0.715160 * g + 0.072169 * b;
                    around
                        .fields
                        .push(("opacity", Toml::Float(luminance.clamp(0.0, 1.0)), place));
                } else if let Some(mut opacity) = opacity {
                    swap_checkers(&mut opacity);
                    around.fields.push(("opacity", opacity, place));
                }
                self.only_inside(id, around, turned, section)
            }
            "bumpmap" => {
                let mut textures = self.nested(id, Kind::Texture);
                let mut scale = self.float(id, "scale").unwrap_or(1.0);
                if let [(_, texture)] = &mut textures[..]
                    && self.objects.list[*texture].plugin == "scale"
                    && let Some((factor, inner)) = self.scale_of(*texture)
                {
                    scale *= factor;
                    *texture = inner;
                }
                if let [(_, texture)] = textures[..]
                    && self.objects.list[texture].plugin == "checkerboard"
                {
                    // Mitsuba cannot compute its slope either.
                    self.unsupported_plugin(texture);
                } else if let [(_, texture)] = textures[..]
                    && let Some(mut fields) = self.texture(texture, turned)
                {
                    fields.push(("scale", Toml::Float(scale)));
                    around.fields.push(("bump", Toml::Table(fields), place));
                } else if textures.len() != 1 {
                    let message = "bsdf \"bumpmap\": expected exactly one nested texture";
                    self.log.invalid(Some(place), message);
                }
                self.only_inside(id, around, turned, section)
            }
            "normalmap" => {
                match self.member(id, "normalmap") {
                    Some(member) => {
                        if let Some(map @ Toml::Table(_)) = self.textured_member(id, member, cie::Kind::Factor, turned)
                        {
                            around.fields.push(("normal_map", map, place));
                        }
                    }
                    None => {
                        let message = "bsdf \"normalmap\": the texture \"normalmap\" is missing";
                        self.log.invalid(Some(place), message);
                    }
                }
                self.only_inside(id, around, turned, section)
            }
            "coating" | "roughcoating" => {
                let inner = self.uncoated(id);
                self.inside(id, inner, around, turned, section)
            }
            _ => {
                let kind = self.plain(id, turned, section)?;
                self.finish(id);
                Some(self.finish_material(&kind, around, section))
            }
        }
    }

    /// The only BSDF inside another.
    fn only_inside(&mut self, id: Id, around: Around, turned: bool, section: &mut Section) -> Option<Through> {
        let nested = self.nested(id, Kind::Bsdf);
        self.finish(id);
        if nested.len() > 1 {
            let message = format!("{}: expected one nested BSDF, found {}", self.title(id), nested.len());
            self.log.invalid(Some(self.objects.list[id].place), message);
        }
        self.inside(id, nested.first().map(|(_, inner)| *inner), around, turned, section)
    }

    fn inside(
        &mut self,
        id: Id,
        inner: Option<Id>,
        around: Around,
        turned: bool,
        section: &mut Section,
    ) -> Option<Through> {
        match inner {
            Some(inner) => self.bsdf(inner, around, turned, section),
            None => {
                let message = format!("{}: the nested BSDF is missing", self.title(id));
                self.log.fatal(Some(self.objects.list[id].place), message)
            }
        }
    }

    fn finish_material(&mut self, kind: &Plain, around: Around, section: &mut Section) -> Through {
        match (around.two_sided, kind.two_sided) {
            (Some(place), Some(_)) => section.set("two_sided", Toml::Boolean(true), place),
            (Some(place), None) => {
                let message = "bsdf \"twosided\": only materials without a transmission can be nested";
                self.log.invalid(Some(place), message);
            }
            // Conductors are two-sided here by default, one-sided in Mitsuba.
            (None, Some(true)) => section.set("two_sided", Toml::Boolean(false), kind.place),
            (None, _) => {}
        }
        for (i, (key, value, place)) in around.fields.iter().enumerate() {
            if around.fields[..i].iter().any(|(before, ..)| before == key) {
                let message = format!("a material takes one {key}; this is the second around the same BSDF");
                self.log.unsupported(*place, message);
            } else if kind.null {
                let message = format!("a bsdf \"null\" takes no {key}");
                self.log.unsupported(*place, message);
            } else {
                section.set(key, value.clone(), *place);
            }
        }
        match around.fields.iter().any(|(key, ..)| *key == "opacity") {
            true => Through::Sheet,
            false => kind.through,
        }
    }
}

/// Mitsuba 3.9.1 swaps the colours of a chequerboard where it expects numbers (`eval_1`).
fn swap_checkers(opacity: &mut Toml) {
    if let Toml::Table(fields) = opacity
        && let Some(("checkerboard", Toml::Array(colors))) = fields.first_mut()
    {
        colors.reverse();
    }
}
