//! Shapes, and shape groups with their instances.

use super::bsdf::Through;
use super::write::{Section, Toml};
use super::xml::{Content, Id, Kind};
use super::{Converter, FileLine, cie, transform};
use std::collections::{BTreeMap, BTreeSet};

impl Converter<'_> {
    /// A single shape; groups and instances wait for [`Self::shape_groups`].
    pub fn shape(&mut self, id: Id, shapes: &mut Vec<Section>) {
        match self.objects.list[id].plugin.as_str() {
            "shapegroup" | "instance" => {}
            _ => {
                let section = Section::item("shapes", self.objects.list[id].place);
                let mut shape = self.surface(id, section, true);
                let mut emitters = self.nested(id, Kind::Emitter).into_iter();
                if let Some(shape) = &mut shape
                    && emitters.any(|(_, emitter)| self.objects.list[emitter].plugin == "area")
                {
                    self.hide(shape);
                }
                shapes.extend(shape);
                shapes.append(&mut self.skins);
            }
        }
    }

    /// One record of instances for each member of each instanced group.
    pub fn shape_groups(&mut self, scene: Id, shapes: &mut Vec<Section>) {
        let objects = self.objects;
        let mut instances: BTreeMap<Id, Vec<(Toml, FileLine)>> = BTreeMap::new();
        let mut order = Vec::new();
        let mut seen = BTreeSet::new();
        for member in &objects.list[scene].members {
            let Content::Object(id) = member.content else {
                continue;
            };
            let object = &objects.list[id];
            if object.kind != Kind::Shape {
                continue;
            }
            if object.plugin == "shapegroup" {
                if seen.insert(id) {
                    order.push(id);
                }
            } else if object.plugin == "instance" {
                let groups = self.nested(id, Kind::Shape);
                let steps = transform::write(self.transform(id, "to_world"));
                self.finish(id);
                match groups[..] {
                    [(_, group)] if objects.list[group].plugin == "shapegroup" => {
                        if seen.insert(group) {
                            order.push(group);
                        }
                        instances.entry(group).or_default().push((steps, object.place));
                    }
                    _ => {
                        let message = "shape \"instance\": expected one reference to a shape \"shapegroup\"";
                        self.log.invalid(Some(object.place), message);
                    }
                }
            }
        }
        for group in order {
            let place = objects.list[group].place;
            let members = self.nested(group, Kind::Shape);
            self.finish(group);
            for (_, member) in members {
                let inner = &objects.list[member];
                if matches!(inner.plugin.as_str(), "shapegroup" | "instance") {
                    let message = "shape \"shapegroup\": groups within groups are not supported";
                    self.log.unsupported(inner.place, message);
                    continue;
                }
                if let Some((_, emitter)) = self.nested(member, Kind::Emitter).first() {
                    let message =
                        "shape \"shapegroup\": emitters within it are not supported (nor are they in Mitsuba)";
                    self.log.unsupported(objects.list[*emitter].place, message);
                }
                // Converted even if unused, so that its faults are reported.
                let shape = self.surface(member, Section::item("shape", inner.place), false);
                let skins = std::mem::take(&mut self.skins);
                let Some(transforms) = instances.get(&group) else {
                    continue;
                };
                let name = inner.id.as_ref().or(objects.list[group].id.as_ref());
                let parts = shape.map(|shape| (name, shape)).into_iter();
                for (name, part) in parts.chain(skins.into_iter().map(|skin| (None, skin))) {
                    let mut section = Section::item("shapes", inner.place);
                    if let Some(name) = name {
                        section.set("name", Toml::string(name), inner.place);
                    }
                    section.set("type", Toml::string("instances"), place);
                    section.set("shape", part.into_inline(), inner.place);
                    section.set_lines("transforms", transforms.clone(), place);
                    shapes.push(section);
                }
            }
        }
    }

    /// A shape with its material, media and emission, written to a section.
    fn surface(&mut self, id: Id, mut shape: Section, named: bool) -> Option<Section> {
        let object = &self.objects.list[id];
        let place = object.place;
        if named && let Some(name) = &object.id {
            shape.set("name", Toml::string(name), place);
        }
        let kind = match object.plugin.as_str() {
            "sphere" => "sphere",
            "rectangle" => "rectangle",
            "cube" => "cube",
            "disk" => "disc",
            "cylinder" => "cylinder",
            "ply" | "obj" | "serialized" => "mesh",
            "bsplinecurve" | "linearcurve" => "curves",
            "sdfgrid" => {
                let message = format!(
                    "{}: grids of distances are not supported; expected a mesh, curves, a sphere, a rectangle, a cube, a \
                     disk or a cylinder",
                    self.title(id)
                );
                self.log.unsupported(place, message);
                self.finished.insert(id);
                return None;
            }
            _ => {
                self.unsupported_plugin(id);
                // Report the faults of nested objects too.
                self.bounds_and_material(id, &mut shape, false);
                return None;
            }
        };
        shape.set("type", Toml::string(kind), place);
        let mut turned = false;
        match kind {
            "sphere" => {
                if let Some(center) = self.vector(id, "center") {
                    shape.set("center", Toml::numbers(&center), place);
                }
                self.radius(id, &mut shape);
            }
            "cylinder" => {
                for name in ["p0", "p1"] {
                    if let Some(point) = self.vector(id, name) {
                        shape.set(name, Toml::numbers(&point), place);
                    }
                }
                self.radius(id, &mut shape);
            }
            "curves" => {
                let file = self.member(id, "filename").map_or(place, |m| m.place);
                if let Some((asset, _)) = self.asset(id, "filename") {
                    shape.set("file", asset, file);
                }
                if object.plugin == "linearcurve" {
                    shape.set("basis", Toml::string("linear"), place);
                }
            }
            "mesh" => {
                let file = self.member(id, "filename").map_or(place, |m| m.place);
                if let Some((asset, path)) = self.asset(id, "filename") {
                    let asset = self.with_attribute(id, asset, &path);
                    shape.set("file", asset, file);
                }
                if let Some(member) = self.member(id, "shape_index")
                    && let Some(index) = self.integer(id, "shape_index")
                    && index != 0
                {
                    shape.set("shape_index", Toml::Integer(index), member.place);
                }
                if let Some(member) = self.member(id, "max_smooth_angle") {
                    let message =
                        "max_smooth_angle is passed over: edges are as the file's normals have them, else smooth";
                    self.log.note(member.place, message);
                }
                // These only affect how it is stored.
                self.ignore(id, &["collapse", "srgb"]);
                let faceted = self.boolean(id, "face_normals").unwrap_or(false);
                let normals = if faceted { "face_normals" } else { "smooth" };
                let normals_place = self.member(id, "face_normals").map_or(place, |m| m.place);
                shape.set(normals, Toml::Boolean(true), normals_place);
                // Mitsuba flips the v of OBJ files by default.
                let default = object.plugin == "obj";
                turned = self.boolean(id, "flip_tex_coords").unwrap_or(default);
            }
            _ => {}
        }
        let steps = self.transform(id, "to_world");
        let steps_place = self.member(id, "to_world").map_or(place, |m| m.place);
        let flip_place = self.member(id, "flip_normals").map_or(steps_place, |m| m.place);
        let mut flip = self.boolean(id, "flip_normals").unwrap_or(false);
        if kind == "sphere" {
            let m = transform::compose(steps).matrix3;
            // Mitsuba turns a mirrored sphere inside out.
            flip ^= m.determinant() < 0.0;
            let lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
            if lengths.iter().any(|l| (l - lengths[0]).abs() > 1e-5 * lengths[0]) {
                let message =
                    "shape \"sphere\": its to_world makes it an ellipsoid, which Mitsuba would render as a sphere";
                self.log.note(steps_place, message);
            }
        }
        if kind == "curves" {
            self.tell_of_curves(id, steps, steps_place);
        } else if flip {
            shape.set("flip_normals", Toml::Boolean(true), flip_place);
        }
        if !steps.is_empty() {
            shape.set("transform", transform::write(steps), steps_place);
        }
        self.bounds_and_material(id, &mut shape, turned);
        Some(shape)
    }

    /// Note how curves differ here.
    fn tell_of_curves(&mut self, id: Id, steps: &[transform::Step], place: FileLine) {
        let size = transform::compose(steps).matrix3.determinant().abs();
        let size = libm::cbrt(size);
        if (size - 1.0).abs() > 1e-3 {
            let message = format!(
                "{}: its to_world scales the radii of its curves with them",
                self.title(id)
            );
            self.log.note(place, message);
        }
        if let Some((member, _)) = self.nested(id, Kind::Emitter).first() {
            let message = format!("{}: curves do not emit", self.title(id));
            self.log.unsupported(member.place, message);
        }
    }

    fn radius(&mut self, id: Id, shape: &mut Section) {
        if let Some(member) = self.member(id, "radius")
            && let Some(radius) = self.float(id, "radius")
        {
            shape.set("radius", Toml::Float(radius), member.place);
        }
    }

    fn bounds_and_material(&mut self, id: Id, shape: &mut Section, turned: bool) {
        let object = &self.objects.list[id];
        let geometry = shape.without("name");
        let bsdfs = self.nested(id, Kind::Bsdf);
        if let Some((member, _)) = bsdfs.get(1) {
            let message = format!("{}: expected one BSDF", self.title(id));
            self.log.invalid(Some(member.place), message);
        }
        let mut through = Through::No;
        if let Some((member, bsdf)) = bsdfs.first()
            && let Some(material) = self.material(*bsdf, object.id.as_deref(), turned)
        {
            through = material.through;
            shape.set("material", Toml::String(material.name), member.place);
        }
        let is_curves = matches!(object.plugin.as_str(), "bsplinecurve" | "linearcurve");
        for (member, emitter) in self.nested(id, Kind::Emitter).into_iter().filter(|_| !is_curves) {
            self.area_light(emitter, shape, member.place, turned);
        }
        self.boundary(id, through, geometry, shape);
        // Only Mitsuba's differentiable integrators use it.
        self.ignore(id, &["silhouette_sampling_weight"]);
        self.finish(id);
    }

    fn area_light(&mut self, id: Id, shape: &mut Section, place: FileLine, turned: bool) {
        if self.objects.list[id].plugin != "area" {
            return self.unsupported_plugin(id);
        }
        let mut emission = Section::table("emission", place);
        match self.member(id, "radiance") {
            Some(member) => {
                if let Some(radiance) = self.textured_member(id, member, cie::Kind::Emission, turned) {
                    emission.set("radiance", radiance, place);
                }
            }
            None => emission.set("radiance", Toml::Float(1.0), place),
        }
        self.sampling(id);
        self.finish(id);
        if !emission.is_empty() {
            shape.set("emission", emission.into_inline(), place);
        }
    }

    /// The media on both sides, given for every transmitting surface, since Mitsuba's defaults differ. `geometry`: the
    /// shape without name and material.
    fn boundary(&mut self, id: Id, through: Through, mut geometry: Section, shape: &mut Section) {
        let own = self.objects.list[id].place;
        let members = ["interior", "exterior"].map(|name| {
            let member = self.member(id, name)?;
            match member.content {
                Content::Object(medium) if self.objects.list[medium].kind == Kind::Medium => Some((member, medium)),
                _ => {
                    self.wrong(id, member, "expected a medium");
                    None
                }
            }
        });
        if !members.iter().any(Option::is_some) {
            if through == Through::Boundary && self.objects.list.iter().any(|o| o.kind == Kind::Medium) {
                // In Mitsuba a surface without media leaves the medium as it is.
                shape.set("boundary", Toml::Boolean(false), own);
            }
            return;
        }
        // Such a surface bounds no medium here, so a coincident boundary without a surface is added.
        let sheet = through == Through::Sheet;
        if sheet {
            let sides = members.map(|member| member.map(|(_, medium)| medium));
            if sides[0] == sides[1] {
                return;
            }
            let name = self.materials.boundary(own);
            geometry.set("material", Toml::String(name), own);
        }
        let shape = if sheet { &mut geometry } else { shape };
        let plugin = self.objects.list[id].plugin.as_str();
        if through != Through::No && !matches!(plugin, "sphere" | "cube") {
            // Mitsuba does not check that there is an inside.
            shape.set("open", Toml::Boolean(true), own);
        }
        let world = self.world.and_then(|world| self.medium(world, None));
        for (i, field) in ["interior", "exterior"].into_iter().enumerate() {
            let (name, place) = match members[i] {
                Some((member, medium)) => (self.medium(medium, Some(field)), member.place),
                None => (None, own),
            };
            if through == Through::No {
                if members[i].is_some() && field == "interior" {
                    let message = format!(
                        "{}: no light gets into it, its interior medium is left out",
                        self.title(id)
                    );
                    self.log.note(place, message);
                }
                continue;
            }
            // The native defaults: nothing inside, the world's medium outside.
            let default = if field == "interior" { None } else { world.clone() };
            if name != default {
                shape.set(field, Toml::String(name.unwrap_or_else(|| "none".to_string())), place);
            }
        }
        if sheet {
            self.skins.push(geometry);
        }
    }
}
