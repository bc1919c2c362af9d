//! Parameters shared by several BSDFs.

use crate::mitsuba::value::Value;
use crate::mitsuba::write::{Section, Toml};
use crate::mitsuba::xml::{Content, Id};
use crate::mitsuba::{Converter, cie, named};

/// The range of roughness in the native format.
pub(super) const ALPHA: [f64; 2] = [0.001, 1.0];
/// The largest roughness of anisotropic microfacets.
const MOST_ALPHA: f64 = 100.0;

impl Converter<'_> {
    /// A colour or texture in [0, 1].
    pub(super) fn field(&mut self, id: Id, name: &str, field: &'static str, turned: bool, section: &mut Section) {
        if let Some(member) = self.member(id, name)
            && let Some(value) = self.textured_member(id, member, cie::Kind::Factor, turned)
        {
            section.set(field, value, member.place);
        }
    }

    /// A colour or texture in [0, 1] with the same name in both formats and a default of 1.
    pub(super) fn factor(&mut self, id: Id, name: &'static str, turned: bool, section: &mut Section) {
        if let Some(member) = self.member(id, name)
            && let Some(value) = self.textured_member(id, member, cie::Kind::Factor, turned)
            && value != Toml::Float(1.0)
        {
            section.set(name, value, member.place);
        }
    }

    /// Indices of refraction; the default is a named material in air.
    pub(super) fn iors(&mut self, id: Id, inside: &str, section: &mut Section) {
        for (name, field, default) in [("int_ior", "ior", inside), ("ext_ior", "exterior_ior", "air")] {
            let place = self.member(id, name).map_or(self.objects.list[id].place, |m| m.place);
            if let Some(ior) = self.ior(id, name, default) {
                let by_wavelength = self.dispersive(id, name, default).filter(|_| self.spectral);
                section.set(field, by_wavelength.unwrap_or(Toml::Float(ior)), place);
            }
        }
    }

    /// The wavelength-dependent index of a named substance, if known.
    fn dispersive(&self, id: Id, name: &str, default: &str) -> Option<Toml> {
        let substance = match self.member(id, name) {
            None => default,
            Some(member) => match &member.content {
                Content::Value(Value::String(name)) => name,
                _ => return None,
            },
        };
        let preset = named::dispersive(substance)?;
        Some(Toml::table([("preset", Toml::String(preset.to_owned()))]))
    }

    pub(super) fn ior(&mut self, id: Id, name: &str, default: &str) -> Option<f64> {
        let Some(member) = self.member(id, name) else {
            return named::ior(default);
        };
        let Content::Value(Value::String(known)) = &member.content else {
            let ior = self.float(id, name)?;
            if ior > 0.0 {
                return Some(ior);
            }
            self.wrong(
                id,
                member,
                &format!("expected an index of refraction above 0, found {ior}"),
            );
            return None;
        };
        let ior = named::ior(known);
        if ior.is_none() {
            let names: Vec<_> = named::iors().collect();
            let message = format!(
                "no index of refraction is known for \"{known}\"; expected one of {}",
                names.join(", ")
            );
            self.wrong(id, member, &message);
        }
        ior
    }

    /// Eta and k over the outside's index, which versions before 2 give; `None` for a perfect mirror.
    pub(super) fn conductor(&mut self, id: Id) -> Option<([f64; 3], [f64; 3])> {
        let outside = match self.member(id, "ext_eta") {
            Some(_) => self.ior(id, "ext_eta", "air").unwrap_or(1.0),
            None => 1.0,
        };
        let (eta, mut k) = self.conductor_in_vacuum(id)?;
        for (k, eta) in k.iter_mut().zip(eta) {
            if *k == 0.0 && eta == 0.0 {
                // It reflects everything, with any k.
                *k = 1.0;
            }
        }
        Some((eta.map(|c| c / outside), k.map(|c| c / outside)))
    }

    fn conductor_in_vacuum(&mut self, id: Id) -> Option<([f64; 3], [f64; 3])> {
        let material = self.string(id, "material");
        let given = ["eta", "k"].map(|name| self.member(id, name));
        match (material, given) {
            (None | Some("none"), [None, None]) => None,
            (None | Some("none"), _) => {
                let eta = self.index(id, "eta");
                let k = self.index(id, "k");
                if let [Some(one), None] | [None, Some(one)] = given {
                    self.wrong(id, one, "expected both of eta and k");
                }
                Some((eta.unwrap_or([0.0; 3]), k.unwrap_or([1.0; 3])))
            }
            (Some(name), given) => {
                let member = self.member(id, "material");
                if let Some(one) = given.into_iter().flatten().next() {
                    self.wrong(id, one, "expected a material, or eta and k, not both");
                }
                let found = named::conductor(name);
                if let (None, Some(member)) = (found, member) {
                    let names: Vec<_> = named::conductors().collect();
                    let message = format!("no conductor \"{name}\" is known; expected none, {}", names.join(", "));
                    self.wrong(id, member, &message);
                }
                found
            }
        }
    }

    /// `textured`: whether UVs are turned, if textures are allowed.
    pub(super) fn roughness(&mut self, id: Id, textured: Option<bool>, section: &mut Section) {
        let (takes_texture, turned) = (textured.is_some(), textured.unwrap_or_default());
        let place = self.objects.list[id].place;
        let alpha = match (self.member(id, "alpha_u"), self.member(id, "alpha_v")) {
            (None, None) => match self.member(id, "alpha") {
                Some(member) if matches!(member.content, Content::Object(_)) && takes_texture => {
                    if let Some(texture @ Toml::Table(_)) = self.number_or_texture(id, "alpha", turned) {
                        section.set("alpha", texture, member.place);
                        self.distribution_field(id, section);
                        return;
                    }
                    None
                }
                Some(_) => self.float(id, "alpha"),
                None => Some(0.1),
            },
            (Some(_), Some(_)) if takes_texture => {
                self.two_roughnesses(id, turned, section);
                self.distribution_field(id, section);
                return;
            }
            (Some(member), Some(_)) => {
                let (u, v) = (self.float(id, "alpha_u"), self.float(id, "alpha_v"));
                match (u, v) {
                    (Some(u), Some(v)) if u != v && u > 0.0 && v > 0.0 => {
                        let mean = (u * v).sqrt();
                        let message = format!(
                            "{}: a roughness of coats that differs by direction becomes its geometric mean, {mean:.4}",
                            self.title(id)
                        );
                        self.log.note(member.place, message);
                        Some(mean)
                    }
                    _ => u,
                }
            }
            (Some(member), None) | (None, Some(member)) => {
                self.wrong(id, member, "expected both of alpha_u and alpha_v");
                None
            }
        };
        let alpha = alpha.unwrap_or(0.1);
        let within = alpha.clamp(ALPHA[0], ALPHA[1]);
        if alpha != within {
            let message = format!("{}: the roughness {alpha} becomes {within}", self.title(id));
            self.log.note(place, message);
        }
        section.set("alpha", Toml::Float(within), place);
        self.distribution_field(id, section);
    }

    /// The roughness along u and across it.
    fn two_roughnesses(&mut self, id: Id, turned: bool, section: &mut Section) {
        let title = self.title(id);
        let mut given = Vec::new();
        for name in ["alpha_u", "alpha_v"] {
            let (Some(member), Some(mut value)) = (self.member(id, name), self.number_or_texture(id, name, turned))
            else {
                continue;
            };
            if let Toml::Float(alpha) = &mut value {
                let within = alpha.clamp(ALPHA[0], MOST_ALPHA);
                if *alpha != within {
                    let message = format!("{title}: the roughness {alpha} becomes {within}");
                    self.log.note(member.place, message);
                }
                *alpha = within;
            }
            given.push((name, value, member.place));
        }
        match &given[..] {
            [(_, Toml::Float(u), place), (_, Toml::Float(v), _)] if u == v && *u <= ALPHA[1] => {
                section.set("alpha", Toml::Float(*u), *place);
            }
            _ => {
                for (name, value, place) in given {
                    section.set(name, value, place);
                }
            }
        }
    }

    fn distribution_field(&mut self, id: Id, section: &mut Section) {
        let place = self.objects.list[id].place;
        if self.distribution(id) == "beckmann" {
            section.set("distribution", Toml::string("beckmann"), place);
        }
        // Affects only how directions are sampled.
        self.ignore(id, &["sample_visible"]);
    }

    /// The microfacet distribution of a rough BSDF.
    fn distribution(&mut self, id: Id) -> &'static str {
        let object = &self.objects.list[id];
        if object.plugin.ends_with("GGX") {
            self.ignore(id, &["distribution"]);
            return "ggx";
        }
        match self.word(id, "distribution", &["beckmann", "ggx", "as", "phong"]) {
            Some("ggx") => "ggx",
            Some(old @ ("as" | "phong")) => {
                let message = format!(
                    "{}: the distribution \"{old}\" is taken as \"beckmann\"",
                    self.title(id)
                );
                self.log.note(object.place, message);
                "beckmann"
            }
            _ => "beckmann",
        }
    }

    /// Eta or k of a conductor; slightly negative table values are accepted as in Mitsuba.
    fn index(&mut self, id: Id, name: &str) -> Option<[f64; 3]> {
        let member = self.member(id, name)?;
        let color = self.color_as_it_is(id, member, cie::Kind::Unbounded)?;
        if color.iter().any(|c| *c < 0.0) {
            let message = format!("{}: {name}: negative channels of {color:?} become 0", self.title(id));
            self.log.note(member.place, message);
        }
        Some(color.map(|c| c.max(0.0)))
    }

    /// A number in [0, 1], or a texture of such numbers.
    pub(super) fn number_field(&mut self, id: Id, name: &'static str, turned: bool, section: &mut Section) {
        if let Some(member) = self.member(id, name)
            && let Some(value) = self.number_or_texture(id, name, turned)
        {
            section.set(name, value, member.place);
        }
    }

    /// A number, or a texture of numbers.
    pub(super) fn number_or_texture(&mut self, id: Id, name: &str, turned: bool) -> Option<Toml> {
        let member = self.member(id, name)?;
        let Content::Object(texture) = member.content else {
            return self.float(id, name).map(Toml::Float);
        };
        match self.spectrum(texture, cie::Kind::Unbounded) {
            Some(color) => color.map(|[r, g, b]| Toml::Float((r + g + b) / 3.0)),
            None => {
                let mut table = Toml::Table(self.texture(texture, turned)?);
                super::swap_checkers(&mut table);
                Some(table)
            }
        }
    }

    /// The lobes of `principled` other than its base. Returns whether light may pass through.
    pub(super) fn lobes(&mut self, id: Id, turned: bool, section: &mut Section) -> bool {
        let mut goes_through = false;
        for name in [
            "spec_trans",
            "spec_tint",
            "sheen",
            "sheen_tint",
            "flatness",
            "clearcoat",
            "clearcoat_gloss",
        ] {
            let tints = match name {
                "sheen_tint" => Some("sheen"),
                "clearcoat_gloss" => Some("clearcoat"),
                _ => None,
            };
            // Parameters of an absent lobe change nothing.
            let is_off = |lobe| self.number_or(id, lobe, 1.0) == 0.0 || self.member(id, lobe).is_none();
            if tints.is_some_and(is_off) {
                self.ignore(id, &[name]);
                continue;
            }
            let Some(member) = self.member(id, name) else {
                continue;
            };
            match self.number_or_texture(id, name, turned) {
                None | Some(Toml::Float(0.0)) => {}
                Some(value) => {
                    goes_through |= name == "spec_trans";
                    section.set(name, value, member.place);
                }
            }
        }
        goes_through
    }
}
