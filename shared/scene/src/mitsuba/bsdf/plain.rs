//! BSDFs that contain no others.

use super::Through;
use crate::mitsuba::write::{Section, Toml};
use crate::mitsuba::xml::Id;
use crate::mitsuba::{Converter, FileLine, cie};

/// A written BSDF that contains no others.
#[derive(Clone, Copy)]
pub(super) struct Plain {
    pub place: FileLine,
    pub through: Through,
    /// Whether it is two-sided here by default; `None` if that does not apply.
    pub two_sided: Option<bool>,
    pub null: bool,
}

impl Plain {
    pub(super) fn opaque(place: FileLine, two_sided: bool) -> Self {
        Self {
            place,
            through: Through::No,
            two_sided: Some(two_sided),
            null: false,
        }
    }

    fn transmitting(place: FileLine, through: Through) -> Self {
        Self {
            place,
            through,
            two_sided: None,
            null: false,
        }
    }
}

pub(super) fn set_type(section: &mut Section, kind: &str, place: FileLine) {
    section.set("type", Toml::string(kind), place);
}

impl Converter<'_> {
    /// Write a BSDF that contains no others. `None` if it is not supported.
    pub(super) fn plain(&mut self, id: Id, turned: bool, section: &mut Section) -> Option<Plain> {
        let object = &self.objects.list[id];
        let place = object.place;
        let plugin = match self.stand_in(id) {
            "" => object.plugin.as_str(),
            other => other,
        };
        Some(match plugin {
            "diffuse" => {
                set_type(section, "diffuse", place);
                self.field(id, "reflectance", "reflectance", turned, section);
                Plain::opaque(place, false)
            }
            "dielectric" => self.dielectric(id, "dielectric", turned, section),
            "thindielectric" => self.dielectric(id, "thin_dielectric", turned, section),
            "roughdielectric" => self.dielectric(id, "rough_dielectric", turned, section),
            "conductor" => self.metal(id, false, turned, section),
            "roughconductor" => self.metal(id, true, turned, section),
            "plastic" => self.plastic(id, false, turned, section),
            "roughplastic" => self.plastic(id, true, turned, section),
            "phong" | "ward" => self.glossy(id, turned, section),
            "polarizer" => self.polarizer(id, section),
            "principled" => self.principled(id, turned, section),
            "hair" => self.hair(id, section),
            "null" => {
                set_type(section, "null", place);
                Plain {
                    null: true,
                    ..Plain::transmitting(place, Through::Boundary)
                }
            }
            _ => {
                self.unsupported_plugin(id);
                return None;
            }
        })
    }

    /// For unpolarised light: half passes through, whatever the axis.
    fn polarizer(&mut self, id: Id, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        set_type(section, "thin_dielectric", place);
        section.set("ior", Toml::Float(1.0), place);
        section.set("exterior_ior", Toml::Float(1.0), place);
        let color = match self.member(id, "transmittance") {
            Some(_) => self.color(id, "transmittance", cie::Kind::Factor).unwrap_or([1.0; 3]),
            None => [1.0; 3],
        };
        section.set("specular_transmittance", Toml::color(color.map(|c| 0.5 * c)), place);
        let message = "bsdf \"polarizer\": light has no polarisation here; half of it goes through";
        self.log.note(place, message);
        self.ignore(id, &["theta", "polarizing"]);
        Plain::transmitting(place, Through::Sheet)
    }

    /// The model of Chiang et al. as in Mitsuba, whose absorption is per fibre radius too.
    fn hair(&mut self, id: Id, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        set_type(section, "hair", place);
        let melanin = ["eumelanin", "pheomelanin"];
        match self.member(id, "sigma_a") {
            Some(member) => {
                let scale = self.float(id, "scale").unwrap_or(1.0);
                if let Some(color) = self.color(id, "sigma_a", cie::Kind::Unbounded) {
                    section.set("absorption", Toml::color(color.map(|c| c * scale)), member.place);
                }
                if let Some(second) = melanin.iter().find_map(|name| self.member(id, name)) {
                    let message = "bsdf \"hair\": it is given by sigma_a or by its melanin; expected one of them";
                    self.log.invalid(Some(second.place), message);
                }
            }
            None => {
                for (name, default) in melanin.into_iter().zip([1.3, 0.2]) {
                    let amount = self.float(id, name).unwrap_or(default);
                    section.set(name, Toml::Float(amount), place);
                }
                self.ignore(id, &["scale"]);
            }
        }
        for (name, field) in [
            ("longitudinal_roughness", "beta_m"),
            ("azimuthal_roughness", "beta_n"),
            ("scale_tilt", "tilt"),
        ] {
            if let (Some(member), Some(number)) = (self.member(id, name), self.float(id, name)) {
                section.set(field, Toml::Float(number), member.place);
            }
        }
        for (name, field, default) in [("int_ior", "ior", "amber"), ("ext_ior", "exterior_ior", "air")] {
            if let Some(ior) = self.ior(id, name, default) {
                section.set(field, Toml::Float(ior), place);
            }
        }
        Plain::transmitting(place, Through::Sheet)
    }

    fn dielectric(&mut self, id: Id, kind: &str, turned: bool, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        set_type(section, kind, place);
        self.iors(id, "bk7", section);
        if kind == "rough_dielectric" {
            self.roughness(id, Some(turned), section);
            scattered_once(section, place);
        }
        for name in ["specular_reflectance", "specular_transmittance"] {
            self.factor(id, name, turned, section);
        }
        let through = match kind {
            "thin_dielectric" => Through::Sheet,
            _ => Through::Boundary,
        };
        Plain::transmitting(place, through)
    }

    fn metal(&mut self, id: Id, rough: bool, turned: bool, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        let fresnel = self.conductor(id);
        match (rough, fresnel) {
            (false, None) => set_type(section, "mirror", place),
            _ => {
                let kind = if rough { "rough_conductor" } else { "conductor" };
                set_type(section, kind, place);
                // Without Fresnel, everything is reflected.
                let (eta, k) = fresnel.unwrap_or(([0.0; 3], [1.0; 3]));
                section.set("eta", Toml::color(eta), place);
                section.set("k", Toml::color(k), place);
            }
        }
        if rough {
            self.roughness(id, Some(turned), section);
            scattered_once(section, place);
        }
        self.field(id, "specular_reflectance", "reflectance", turned, section);
        Plain::opaque(place, true)
    }

    fn plastic(&mut self, id: Id, rough: bool, turned: bool, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        set_type(section, if rough { "rough_plastic" } else { "plastic" }, place);
        self.field(id, "diffuse_reflectance", "reflectance", turned, section);
        self.iors(id, "polypropylene", section);
        if rough {
            self.roughness(id, None, section);
        }
        if self.boolean(id, "nonlinear") == Some(true) {
            section.set("nonlinear", Toml::Boolean(true), place);
        }
        self.factor(id, "specular_reflectance", turned, section);
        Plain::opaque(place, false)
    }

    fn principled(&mut self, id: Id, turned: bool, section: &mut Section) -> Plain {
        let place = self.objects.list[id].place;
        set_type(section, "principled", place);
        scattered_once(section, place);
        self.field(id, "base_color", "base_color", turned, section);
        for name in ["metallic", "roughness", "anisotropic"] {
            self.number_field(id, name, turned, section);
        }
        if let Some(eta) = self.float(id, "eta") {
            section.set("ior", Toml::Float(eta), place);
        }
        self.number_field(id, "specular", turned, section);
        let goes_through = self.lobes(id, turned, section);
        self.ignore(
            id,
            &[
                "main_specular_sampling_rate",
                "clearcoat_sampling_rate",
                "diffuse_reflectance_sampling_rate",
                "spec_trans_sampling_rate",
            ],
        );
        match goes_through {
            true => Plain::transmitting(place, Through::Boundary),
            false => Plain::opaque(place, false),
        }
    }
}

/// Mitsuba's microfacets lose the energy of multiple bounces.
fn scattered_once(section: &mut Section, place: FileLine) {
    section.set("multiple_scattering", Toml::Boolean(false), place);
}
