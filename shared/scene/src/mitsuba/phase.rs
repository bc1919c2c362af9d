//! Phase functions.

use super::Converter;
use super::write::Toml;
use super::xml::{Id, Kind};

impl Converter<'_> {
    /// A phase function in the native format; `None` for isotropic ones.
    pub fn phase(&mut self, id: Id) -> Option<Toml> {
        let phase = self.any_phase(id);
        phase.filter(|phase| *phase != Toml::string("isotropic"))
    }

    fn any_phase(&mut self, id: Id) -> Option<Toml> {
        let object = &self.objects.list[id];
        let phase = match object.plugin.as_str() {
            "isotropic" => Toml::string("isotropic"),
            "hg" => {
                let g = self.float(id, "g").unwrap_or(0.8);
                Toml::table([("type", Toml::string("hg")), ("g", Toml::Float(g))])
            }
            "blendphase" => {
                let weight = match self.member(id, "weight") {
                    Some(_) => self.float(id, "weight"),
                    None => {
                        let message = "phase \"blendphase\": the parameter \"weight\" is missing";
                        self.log.invalid(Some(object.place), message);
                        None
                    }
                };
                let nested = self.nested(id, Kind::Phase);
                self.finish(id);
                let [(_, first), (_, second)] = nested[..] else {
                    let message = format!(
                        "phase \"blendphase\": expected two nested phase functions, found {}",
                        nested.len()
                    );
                    self.log.invalid(Some(object.place), message);
                    return None;
                };
                for inner in [first, second] {
                    if self.objects.list[inner].plugin == "blendphase" {
                        let message = "phase \"blendphase\": a blend of blends is not supported";
                        self.log.unsupported(self.objects.list[inner].place, message);
                        return None;
                    }
                }
                let phases = [first, second].map(|inner| self.any_phase(inner));
                let [Some(first), Some(second)] = phases else {
                    return None;
                };
                Toml::table([
                    ("type", Toml::string("blend")),
                    ("weight", Toml::Float(weight?.clamp(0.0, 1.0))),
                    ("phases", Toml::Array(vec![first, second])),
                ])
            }
            _ => {
                self.unsupported_plugin(id);
                return None;
            }
        };
        self.finish(id);
        Some(phase)
    }
}
