//! BSDFs without an equivalent, converted to the nearest one with a note on the difference.

use super::parameters::ALPHA;
use super::plain::Plain;
use crate::mitsuba::write::{Section, Toml};
use crate::mitsuba::xml::{Content, Id, Kind};
use crate::mitsuba::{Converter, cie};

impl Converter<'_> {
    /// The BSDF as which a plugin is converted.
    pub(super) fn stand_in(&mut self, id: Id) -> &'static str {
        let object = &self.objects.list[id];
        let (plugin, why) = match object.plugin.as_str() {
            "roughdiffuse" => ("diffuse", "its roughness is left out"),
            "pplastic" => ("roughplastic", "polarisation and its own diffuse base are left out"),
            // From forks that predate Mitsuba's own GGX.
            "roughconductorGGX" => ("roughconductor", "with the distribution ggx"),
            "roughdielectricGGX" => ("roughdielectric", "with the distribution ggx"),
            _ => return "",
        };
        let message = format!("{} is taken as \"{plugin}\": {why}", self.title(id));
        self.log.note(object.place, message);
        if object.plugin == "roughdiffuse" {
            self.ignore(id, &["alpha", "use_fast_approx"]);
        }
        plugin
    }

    /// `phong` and `ward`: a microfacet coat over a diffuse base, with the nearest roughness and the same reflectance
    /// at normal incidence.
    pub(super) fn glossy(&mut self, id: Id, turned: bool, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        let alpha = match self.objects.list[id].plugin.as_str() {
            // Walter et al. 2007, 5.2, "Phong distribution": the width of the slopes.
            "phong" => (2.0 / (self.number_or(id, "exponent", 30.0).max(0.0) + 2.0)).sqrt(),
            _ => {
                let [u, v] = ["alpha_u", "alpha_v"].map(|name| self.number_or(id, name, 0.1).max(0.0));
                self.ignore(id, &["variant"]);
                (u * v).sqrt()
            }
        };
        let specular = match self.member(id, "specular_reflectance").map(|member| &member.content) {
            Some(Content::Value(_)) => self.color(id, "specular_reflectance", cie::Kind::Factor),
            Some(Content::Object(_)) | None => {
                self.ignore(id, &["specular_reflectance"]);
                Some([0.2; 3])
            }
        };
        let mean = specular.unwrap_or([0.2; 3]).iter().sum::<f64>() / 3.0;
        // Beyond this it is metal, which has no base.
        let root = mean.clamp(1e-4, 0.5).sqrt();
        let ior = (1.0 + root) / (1.0 - root);
        let alpha = alpha.clamp(ALPHA[0], ALPHA[1]);
        section.set("type", Toml::string("rough_plastic"), place);
        self.field(id, "diffuse_reflectance", "reflectance", turned, section);
        section.set("ior", Toml::Float(ior), place);
        section.set("exterior_ior", Toml::Float(1.0), place);
        section.set("alpha", Toml::Float(alpha), place);
        section.set("distribution", Toml::string("beckmann"), place);
        let message = format!(
            "{} is taken as \"roughplastic\" with alpha {alpha:.4} and an index of refraction of {ior:.4}: gloss is like \
             its own, but grows towards grazing angles",
            self.title(id)
        );
        self.log.note(place, message);
        Plain::opaque(place, false)
    }

    /// A number; the default if it is missing or a texture.
    pub(super) fn number_or(&mut self, id: Id, name: &str, default: f64) -> f64 {
        match self.member(id, name).map(|member| &member.content) {
            Some(Content::Value(_)) => self.float(id, name).unwrap_or(default),
            _ => default,
        }
    }

    /// The BSDF below a coat without an equivalent; the coat is left out.
    pub(super) fn uncoated(&mut self, id: Id) -> Option<Id> {
        let object = &self.objects.list[id];
        if !matches!(object.plugin.as_str(), "coating" | "roughcoating") {
            return None;
        }
        let message = format!(
            "{}: the coat is left out; what it lies on is darker or less glossy than it was",
            self.title(id)
        );
        self.log.note(object.place, message);
        let inner = self.nested(id, Kind::Bsdf).first().map(|(_, inner)| *inner);
        for member in &object.members {
            member.used.set(true);
        }
        self.finish(id);
        inner
    }
}
