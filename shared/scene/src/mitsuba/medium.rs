//! Media.

use super::transform;
use super::value::Value;
use super::write::{Section, Toml};
use super::xml::{Content, Id, Kind, Member};
use super::{Converter, FileLine, cie, property, unique};
use glam::DVec3;
use std::collections::BTreeSet;

/// An extinction or albedo, constant or varying.
enum Coefficient {
    Constant([f64; 3]),
    Grid(Id),
}

/// A parameter's value and place.
struct Placed<T> {
    place: FileLine,
    value: T,
}

impl Converter<'_> {
    /// The name of a medium, converted once.
    pub fn medium(&mut self, id: Id, hint: Option<&str>) -> Option<String> {
        if let Some(name) = self.media.get(&id) {
            return Some(name.clone());
        }
        let object = &self.objects.list[id];
        let name = match (object.id.as_deref(), hint) {
            (Some("none"), _) => unique(&mut self.media_names, "none"),
            (Some(own), _) => own.to_string(),
            (None, hint) => unique(&mut self.media_names, hint.unwrap_or("medium")),
        };
        let mut section = Section::named("media", &name, object.place);
        match object.plugin.as_str() {
            "homogeneous" | "heterogeneous" => self.coefficients(id, &mut section),
            _ => {
                self.unsupported_plugin(id);
                return None;
            }
        }
        let phases = self.nested(id, Kind::Phase);
        if let Some((member, phase)) = phases.first()
            && let Some(phase) = self.phase(*phase)
        {
            section.set("phase", phase, member.place);
        }
        if let Some((member, _)) = phases.get(1) {
            let message = format!("{}: expected one phase function", self.title(id));
            self.log.invalid(Some(member.place), message);
        }
        // These only affect Mitsuba's sampling.
        self.ignore(
            id,
            &[
                "sample_emitters",
                "has_spectral_extinction",
                "majorant_resolution_factor",
            ],
        );
        self.finish(id);
        self.media_sections.push(section);
        self.media.insert(id, name.clone());
        Some(name)
    }

    fn coefficients(&mut self, id: Id, section: &mut Section) {
        let place = self.objects.list[id].place;
        let scale = self.float(id, "scale").unwrap_or(1.0);
        if scale < 0.0
            && let Some(member) = self.member(id, "scale")
        {
            self.wrong(
                id,
                member,
                &format!("expected a number that is not negative, found {scale}"),
            );
        }
        // Mitsuba 3.9 takes only sigma_t and albedo; the other pair is common in older scenes.
        let pair = ["sigma_s", "sigma_a"].map(|name| self.member(id, name));
        if let [Some(sigma_s), Some(sigma_a)] = pair {
            return self.scattering_and_absorption(id, [sigma_s, sigma_a], scale, section);
        }
        if let Some(one) = pair.into_iter().flatten().next() {
            self.wrong(id, one, "expected both of sigma_s and sigma_a");
            return;
        }
        let albedo = Placed {
            place: self.member(id, "albedo").map_or(place, |m| m.place),
            value: self.coefficient(id, "albedo", 0.75),
        };
        if let Some(Coefficient::Constant(albedo)) = albedo.value
            && albedo.iter().any(|c| !(0.0..=1.0).contains(c))
            && let Some(member) = self.member(id, "albedo")
        {
            let message = format!("expected numbers from 0 to 1, found {albedo:?}");
            self.wrong(id, member, &message);
        }
        let place = self.member(id, "sigma_t").map_or(place, |m| m.place);
        match self.coefficient(id, "sigma_t", 1.0) {
            Some(Coefficient::Constant(sigma_t)) => {
                let value = sigma_t.map(|c| c * scale);
                self.constant_extinction(id, Placed { place, value }, albedo, section);
            }
            Some(Coefficient::Grid(value)) => {
                self.varying_extinction(id, Placed { place, value }, scale, albedo, section);
            }
            None => {}
        }
    }

    fn scattering_and_absorption(
        &mut self,
        id: Id,
        [sigma_s, sigma_a]: [&Member; 2],
        scale: f64,
        section: &mut Section,
    ) {
        let place = self.objects.list[id].place;
        section.set("type", Toml::string("homogeneous"), place);
        for (name, member) in [("sigma_s", sigma_s), ("sigma_a", sigma_a)] {
            if let Some(color) = self.color(id, name, cie::Kind::Unbounded) {
                section.set(name, Toml::color(color.map(|c| c * scale)), member.place);
            }
        }
        for name in ["sigma_t", "albedo"] {
            if let Some(member) = self.member(id, name) {
                self.wrong(
                    id,
                    member,
                    "expected sigma_s and sigma_a, or sigma_t and albedo, never mixed",
                );
            }
        }
    }

    /// A constant extinction.
    fn constant_extinction(
        &mut self,
        id: Id,
        sigma_t: Placed<[f64; 3]>,
        albedo: Placed<Option<Coefficient>>,
        section: &mut Section,
    ) {
        if let Some(Coefficient::Grid(grid)) = albedo.value {
            return self.constant_with_grid(
                id,
                sigma_t,
                Placed {
                    place: albedo.place,
                    value: grid,
                },
                section,
            );
        }
        let confined = self.objects.list[id].plugin == "heterogeneous";
        let kind = match confined {
            true => "heterogeneous",
            false => "homogeneous",
        };
        section.set("type", Toml::string(kind), self.objects.list[id].place);
        section.set("sigma_t", Toml::color(sigma_t.value), sigma_t.place);
        if confined {
            section.set("density", self.constant_box(id), sigma_t.place);
        }
        match albedo.value {
            Some(Coefficient::Constant(value)) => {
                section.set("albedo", Toml::color(value), albedo.place);
            }
            Some(Coefficient::Grid(_)) | None => {}
        }
    }

    /// A constant extinction with an albedo grid: a density of 1 in the albedo's box.
    fn constant_with_grid(&mut self, id: Id, sigma_t: Placed<[f64; 3]>, albedo: Placed<Id>, section: &mut Section) {
        let place = self.objects.list[id].place;
        section.set("type", Toml::string("heterogeneous"), place);
        section.set("sigma_t", Toml::color(sigma_t.value), sigma_t.place);
        let cube = Toml::table([
            ("min", Toml::numbers(&[0.0; 3])),
            ("max", Toml::numbers(&[1.0; 3])),
            ("voxel", Toml::Float(1.0)),
        ]);
        section.set("density", cube, sigma_t.place);
        let Some((file, steps)) = self.grid(albedo.value) else {
            return;
        };
        section.set("albedo", file, albedo.place);
        if !steps.is_empty() {
            section.set("transform", transform::write(&steps), albedo.place);
        }
        let message = format!(
            "{}: with an albedo in a grid the medium ends where the grid does, however large its shape is",
            self.title(id)
        );
        self.log.note(albedo.place, message);
    }

    /// An extinction grid, which becomes the density.
    fn varying_extinction(
        &mut self,
        id: Id,
        sigma_t: Placed<Id>,
        scale: f64,
        albedo: Placed<Option<Coefficient>>,
        section: &mut Section,
    ) {
        let place = self.objects.list[id].place;
        let grid_place = self.objects.list[sigma_t.value].place;
        if self.channels(sigma_t.value) == Some(3) {
            let message = format!(
                "{}: sigma_t: a grid of extinctions that differ by colour is not supported; expected one channel, and \
                 the colours in the albedo. Where it is left out there is no medium",
                self.title(id)
            );
            self.log.unsupported(grid_place, message);
            // If it is left out, the medium is empty.
            return self.nothing(place, section);
        }
        section.set("type", Toml::string("heterogeneous"), place);
        section.set("sigma_t", Toml::Float(1.0), sigma_t.place);
        if scale != 1.0 {
            let place = self.member(id, "scale").map_or(place, |m| m.place);
            section.set("scale", Toml::Float(scale), place);
        }
        let Some((file, steps)) = self.grid(sigma_t.value) else {
            return;
        };
        section.set("density", file, grid_place);
        if !steps.is_empty() {
            section.set("transform", transform::write(&steps), grid_place);
        }
        match albedo.value {
            Some(Coefficient::Constant(value)) => {
                section.set("albedo", Toml::color(value), albedo.place);
            }
            Some(Coefficient::Grid(grid)) => {
                let Some((file, own)) = self.grid(grid) else {
                    return;
                };
                section.set("albedo", file, albedo.place);
                if own != steps {
                    let message = format!(
                        "{}: an albedo that is not placed as sigma_t is is not supported",
                        self.title(id)
                    );
                    self.log.unsupported(albedo.place, message);
                }
            }
            None => {}
        }
    }

    /// A density of 1 where Mitsuba puts a heterogeneous medium of constant extinction: in the axis-aligned bounds of
    /// the extinction's transformed unit cube, regardless of the shape's size. Homogeneous media fill their shapes.
    fn constant_box(&mut self, id: Id) -> Toml {
        let steps = match self.member(id, "sigma_t").map(|member| &member.content) {
            Some(Content::Object(volume)) => self.transform(*volume, "to_world"),
            _ => &[],
        };
        let map = transform::compose(steps);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in 0..8 {
            let corner = DVec3::from([1, 2, 4].map(|bit| f64::from(corner & bit != 0)));
            let corner = map.transform_point3(corner);
            (low, high) = (low.min(corner), high.max(corner));
        }
        Toml::table([
            ("min", Toml::numbers(&low.to_array())),
            ("max", Toml::numbers(&high.to_array())),
            // One sample suffices.
            ("voxel", Toml::Float((high - low).max_element())),
        ])
    }

    /// A number, a colour, or a volume.
    fn coefficient(&mut self, id: Id, name: &str, default: f64) -> Option<Coefficient> {
        let Some(member) = self.member(id, name) else {
            return Some(Coefficient::Constant([default; 3]));
        };
        let color = match &member.content {
            Content::Value(value) => self.constant(id, member, value)?,
            Content::Object(volume) => {
                let volume = *volume;
                match self.objects.list[volume].plugin.as_str() {
                    "gridvolume" => return Some(Coefficient::Grid(volume)),
                    "constvolume" => {
                        let value = self.color(volume, "value", cie::Kind::Unbounded);
                        self.ignore(volume, &["to_world"]);
                        self.finish(volume);
                        value.or_else(|| {
                            let message = "volume \"constvolume\": the parameter \"value\" is missing or wrong";
                            self.log.fatal(Some(self.objects.list[volume].place), message)
                        })?
                    }
                    _ => match self.spectrum(volume, cie::Kind::Factor) {
                        Some(color) => color?,
                        None => {
                            self.unsupported_plugin(volume);
                            return None;
                        }
                    },
                }
            }
        };
        Some(Coefficient::Constant(color))
    }

    fn constant(&mut self, id: Id, member: &Member, value: &Value) -> Option<[f64; 3]> {
        let Some(color) = property::color(value, cie::Kind::Factor) else {
            let message = format!("expected a colour or a volume, found {}", value.describe());
            self.wrong(id, member, &message);
            return None;
        };
        if matches!(value, Value::Rgb(_)) && color.iter().any(|c| !(0.0..=1.0).contains(c)) {
            let message = format!(
                "Mitsuba takes an <rgb> from 0 to 1 here, found {color:?}; put the rest into <float name=\"scale\">"
            );
            self.wrong(id, member, &message);
            return None;
        }
        self.in_range(id, member, color, cie::Kind::Unbounded)
    }

    /// The medium outside of all shapes: the one outside of some shape and inside of none. If that is ambiguous, the
    /// sensor's medium.
    pub fn world_medium(&self, scene: Id) -> Option<Id> {
        let objects = &self.objects.list;
        let named = |shape: Id, name: &str| {
            let members = objects[shape].members.iter();
            members
                .filter(|m| m.name.as_deref() == Some(name))
                .find_map(|m| match m.content {
                    Content::Object(id) if objects[id].kind == Kind::Medium => Some(id),
                    _ => None,
                })
        };
        let inner = |owner: Id, kind: Kind| {
            let mut members = objects[owner].members.iter();
            members.find_map(move |m| match m.content {
                Content::Object(id) if objects[id].kind == kind => Some(id),
                _ => None,
            })
        };
        let sensor = inner(scene, Kind::Sensor).and_then(|sensor| inner(sensor, Kind::Medium));
        let mut inside = BTreeSet::new();
        let mut outside = BTreeSet::new();
        for (id, object) in objects.iter().enumerate() {
            if object.kind == Kind::Shape {
                let sides = ["interior", "exterior"].map(|name| named(id, name));
                if sides != [None, None] {
                    inside.insert(sides[0]);
                    outside.insert(sides[1]);
                }
            }
        }
        let mut worlds = outside.difference(&inside);
        match (worlds.next(), worlds.next()) {
            (Some(world), None) => *world,
            _ => sensor,
        }
    }
}
