//! BSDFs that mix other BSDFs.

use super::plain::{Plain, set_type};
use super::{Around, Through};
use crate::mitsuba::write::{Section, Toml};
use crate::mitsuba::xml::{Id, Kind};
use crate::mitsuba::{Converter, FileLine, unique};

/// A material in a mixture.
struct Part {
    name: String,
    through: Through,
}

/// A part and its numeric weight.
struct Share {
    part: Part,
    weight: f64,
}

impl Converter<'_> {
    /// Blends two BSDFs. Enclosing BSDFs apply to both.
    pub(super) fn blend(&mut self, id: Id, mut around: Around, turned: bool, section: &mut Section) -> Option<Through> {
        let place = self.objects.list[id].place;
        let nested = self.nested(id, Kind::Bsdf);
        let weight = self.number_or_texture(id, "weight", turned);
        let [(_, first), (_, second)] = nested[..] else {
            let message = format!("{}: expected two nested BSDFs, found {}", self.title(id), nested.len());
            return self.log.fatal(Some(place), message);
        };
        self.finish(id);
        let two_sided = around.two_sided.take();
        let parts = [
            self.part(first, two_sided, turned)?,
            self.part(second, two_sided, turned)?,
        ];
        let through = blended(parts, weight.unwrap_or(Toml::Float(0.5)), place, section);
        Some(self.finish_mix(place, through, around, section))
    }

    /// Mixes any number of BSDFs by weight; the remaining light is absorbed.
    pub(super) fn mixture(
        &mut self,
        id: Id,
        mut around: Around,
        turned: bool,
        section: &mut Section,
    ) -> Option<Through> {
        let place = self.objects.list[id].place;
        let nested = self.nested(id, Kind::Bsdf);
        let given = self.number_list(id, "weights");
        let conserves = self.boolean(id, "ensure_energy_conservation").unwrap_or(true);
        self.finish(id);
        let weights = given.unwrap_or_default();
        let total: f64 = weights.iter().sum();
        if weights.len() != nested.len() || weights.iter().any(|w| *w < 0.0) || total <= 0.0 {
            let message = format!(
                "{}: weights: expected {} numbers that are not negative, one for each nested BSDF, and not all 0; found \
                 {weights:?}",
                self.title(id),
                nested.len()
            );
            return self.log.fatal(Some(place), message);
        }
        if total > 1.0 + 1e-6 {
            let message = format!("{}: the weights add up to {total}, and are made less", self.title(id));
            match conserves {
                true => self.log.note(place, message),
                false => self.log.unsupported(place, message),
            }
        }
        let weighted = nested.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0);
        let weighted: Vec<(Id, f64)> = weighted.map(|((_, inner), weight)| (*inner, *weight)).collect();
        let rest = 1.0 - total;
        if let [(only, _)] = weighted[..]
            && rest < 1e-6
        {
            return self.inside(id, Some(only), around, turned, section);
        }
        let two_sided = around.two_sided.take();
        let mut shares = Vec::new();
        for (inner, weight) in weighted {
            let part = self.part(inner, two_sided, turned)?;
            shares.push(Share { part, weight });
        }
        if rest >= 1e-6 {
            let part = self.black(place);
            shares.push(Share { part, weight: rest });
        }
        let through = self.mixed(shares, place, section)?;
        Some(self.finish_mix(place, through, around, section))
    }

    /// A sheet without gloss: without `spec_trans` it only scatters, by the diffuse lobes of `principled` and, by
    /// `diff_trans`, uniformly to its other side.
    pub(super) fn thin(&mut self, id: Id, around: Around, turned: bool, section: &mut Section) -> Option<Through> {
        let place = self.objects.list[id].place;
        let [glossy, through] =
            ["spec_trans", "diff_trans"].map(|name| match self.number_or_texture(id, name, turned) {
                None => Some(0.0),
                Some(Toml::Float(number)) => Some(number),
                Some(_) => None,
            });
        let (Some(0.0), Some(through)) = (glossy, through) else {
            let message = "bsdf \"principledthin\" is not supported where it is glossy (spec_trans above 0), which no \
                sheet here is, or with a texture as diff_trans; expected \"principled\", or \"thindielectric\", which \
                is smooth. Where it is left out its shapes are grey and diffuse";
            self.log.unsupported(place, message);
            self.finished.insert(id);
            return None;
        };
        self.ignore(
            id,
            &[
                // Parameters of the missing gloss.
                "anisotropic",
                "eta",
                "spec_tint",
                "diffuse_reflectance_sampling_rate",
                "specular_reflectance_sampling_rate",
                "specular_transmittance_sampling_rate",
                "diffuse_transmittance_sampling_rate",
            ],
        );
        let scatter = |this: &mut Self, section: &mut Section| {
            set_type(section, "principled", place);
            this.field(id, "base_color", "base_color", turned, section);
            this.number_field(id, "roughness", turned, section);
            section.set("specular", Toml::Float(0.0), place);
            this.lobes(id, turned, section);
            section.set("two_sided", Toml::Boolean(true), place);
        };
        let weight = (0.5 * through).clamp(0.0, 1.0);
        if weight == 0.0 {
            scatter(self, section);
            self.finish(id);
            return Some(self.finish_mix(place, Through::No, around, section));
        }
        let [front, back] = ["front", "back"].map(|side| unique(&mut self.materials.names, &format!("sheet-{side}")));
        let mut reflecting = Section::named("materials", &front, place);
        scatter(self, &mut reflecting);
        let mut transmitting = Section::named("materials", &back, place);
        set_type(&mut transmitting, "translucent", place);
        self.field(id, "base_color", "transmittance", turned, &mut transmitting);
        self.finish(id);
        self.materials.sections.extend([reflecting, transmitting]);
        let parts = [(front, Through::No), (back, Through::Sheet)].map(|(name, through)| Part { name, through });
        let through = blended(parts, Toml::Float(weight), place, section);
        Some(self.finish_mix(place, through, around, section))
    }

    /// Write the weighted parts into a section, as nested blends.
    fn mixed(&mut self, mut shares: Vec<Share>, place: FileLine, section: &mut Section) -> Option<Through> {
        let second = shares.split_off(shares.len().div_ceil(2));
        let [one, two] = [&shares, &second].map(|half| half.iter().map(|share| share.weight).sum::<f64>());
        let parts = [self.half(shares, place)?, self.half(second, place)?];
        Some(blended(parts, Toml::Float(two / (one + two)), place, section))
    }

    /// Half of the parts as one material.
    fn half(&mut self, mut shares: Vec<Share>, place: FileLine) -> Option<Part> {
        if shares.len() < 2 {
            return shares.pop().map(|share| share.part);
        }
        let name = unique(&mut self.materials.names, "mix");
        let mut section = Section::named("materials", &name, place);
        let through = self.mixed(shares, place, &mut section)?;
        self.materials.sections.push(section);
        Some(Part { name, through })
    }

    /// A BSDF of a mixture as its own material.
    fn part(&mut self, id: Id, two_sided: Option<FileLine>, turned: bool) -> Option<Part> {
        let object = &self.objects.list[id];
        let name = object.id.as_deref().unwrap_or(&object.plugin);
        let name = unique(&mut self.materials.names, &format!("{name}-part"));
        let mut section = Section::named("materials", &name, object.place);
        let sides = Around {
            two_sided,
            fields: Vec::new(),
        };
        let through = self.bsdf(id, sides, turned, &mut section)?;
        self.materials.sections.push(section);
        Some(Part { name, through })
    }

    /// A black material.
    fn black(&mut self, place: FileLine) -> Part {
        let name = unique(&mut self.materials.names, "black");
        let mut section = Section::named("materials", &name, place);
        section.set("type", Toml::string("diffuse"), place);
        section.set("reflectance", Toml::Float(0.0), place);
        self.materials.sections.push(section);
        Part {
            name,
            through: Through::No,
        }
    }

    fn finish_mix(&mut self, place: FileLine, through: Through, around: Around, section: &mut Section) -> Through {
        let kind = Plain {
            place,
            through,
            two_sided: None,
            null: false,
        };
        self.finish_material(&kind, around, section)
    }
}

/// Write a blend of two parts; returns whether light passes through it.
fn blended(parts: [Part; 2], weight: Toml, place: FileLine, section: &mut Section) -> Through {
    let through = match parts.each_ref().map(|part| part.through) {
        [Through::Sheet, _] | [_, Through::Sheet] => Through::Sheet,
        [Through::Boundary, _] | [_, Through::Boundary] => Through::Boundary,
        [Through::No, Through::No] => Through::No,
    };
    let names = parts.map(|part| Toml::String(part.name));
    section.set("type", Toml::string("blend"), place);
    section.set("materials", Toml::Array(names.into()), place);
    section.set("weight", weight, place);
    through
}
