//! The sensor, its film and its sampler.

use super::transform::{self, Step};
use super::write::{Section, Toml};
use super::xml::{Id, Kind};
use super::{Converter, FileLine};
use glam::{DMat3, DVec3};

/// The sections of the native scene that come from the sensor.
pub struct SensorParts {
    pub image: Section,
    pub render: Section,
    pub camera: Section,
}

impl Converter<'_> {
    pub fn sensor(&mut self, id: Id) -> SensorParts {
        let object = &self.objects.list[id];
        let place = object.place;
        let mut view = SensorParts {
            image: Section::table("image", place),
            render: Section::table("render", place),
            camera: Section::table("camera", place),
        };
        let thin_lens = object.plugin == "thinlens";
        let parallel = object.plugin == "orthographic";
        if !thin_lens && !parallel && object.plugin != "perspective" {
            self.unsupported_plugin(id);
        }
        let films = self.nested(id, Kind::Film);
        let (width, height) = match films.first() {
            Some((_, film)) => self.film(*film, &mut view.image),
            None => self.film_size(None, &mut view.image, place),
        };
        for (_, sampler) in self.nested(id, Kind::Sampler) {
            if let Some((count, place)) = self.sampler(sampler) {
                view.render.set("passes", Toml::Integer(count), place);
            }
        }
        if parallel {
            self.parallel(id, &mut view.camera);
        } else {
            self.placement(id, &mut view.camera);
            self.field_of_view(id, width as f64 / height as f64, &mut view.camera);
        }
        if thin_lens {
            self.lens(id, &mut view.camera);
        } else if !parallel {
            let x = self.float(id, "principal_point_offset_x").unwrap_or(0.0);
            let y = self.float(id, "principal_point_offset_y").unwrap_or(0.0);
            if (x, y) != (0.0, 0.0) {
                let place = self.member(id, "principal_point_offset_x").map_or(place, |m| m.place);
                view.camera.set("principal_point", Toml::numbers(&[x, y]), place);
            }
        }
        // The native camera has no clipping planes, and nothing moves.
        self.ignore(
            id,
            &[
                "near_clip",
                "far_clip",
                "shutter_open",
                "shutter_close",
                // Only meaningful with a lens; Mitsuba accepts it for a pinhole too.
                "focus_distance",
            ],
        );
        let media = self.nested(id, Kind::Medium);
        if let Some((member, medium)) = media.first() {
            if let Some(name) = self.medium(*medium, None) {
                view.camera.set("medium", Toml::String(name), member.place);
            }
        } else if self.objects.list.iter().any(|o| o.kind == Kind::Medium) {
            // Mitsuba trusts the file and does not search for the medium.
            view.camera.set("medium", Toml::string("none"), place);
        }
        self.finish(id);
        view
    }

    /// The sample count, which becomes the number of passes.
    pub fn sampler(&mut self, id: Id) -> Option<(i64, FileLine)> {
        let object = &self.objects.list[id];
        let message = format!(
            "the sampler \"{}\" is replaced; its sample_count is the default number of passes",
            object.plugin
        );
        self.log.note(object.place, message);
        let member = self.member(id, "sample_count");
        let count = self.integer(id, "sample_count");
        if let (Some(member), Some(count)) = (member, count)
            && count < 1
        {
            self.wrong(id, member, &format!("expected at least 1, found {count}"));
        }
        member.and_then(|member| Some((count?, member.place)))
    }

    /// Writes the film and returns the image's size in pixels.
    fn film(&mut self, id: Id, image: &mut Section) -> (i64, i64) {
        let object = &self.objects.list[id];
        match object.plugin.as_str() {
            "hdrfilm" | "mfilm" => {}
            "ldrfilm" => {
                let message =
                    "film \"ldrfilm\": images are linear here; exposure and gamma are left to what shows them";
                self.log.note(object.place, message);
            }
            _ => self.unsupported_plugin(id),
        }
        let size = self.film_size(Some(id), image, object.place);
        let filters = self.nested(id, Kind::Filter);
        match filters.first() {
            Some((_, filter)) => self.filter(*filter, image),
            None => image.set("filter", Toml::string("gaussian"), object.place),
        }
        if self.boolean(id, "sample_border") == Some(true)
            && let Some(member) = self.member(id, "sample_border")
        {
            let message =
                "film: sample_border: no samples are taken beyond the image's border; pixels there are noisier";
            self.log.note(member.place, message);
        }
        // These only affect how the image is stored.
        self.ignore(
            id,
            &[
                "file_format",
                "pixel_format",
                "component_format",
                "banner",
                "compensate",
                "gamma",
                "exposure",
                "tonemap_method",
                "attach_log",
                "high_quality_edges",
                "variable",
                "digits",
            ],
        );
        self.pass_over(id);
        self.finish(id);
        size
    }

    fn film_size(&mut self, film: Option<Id>, image: &mut Section, place: FileLine) -> (i64, i64) {
        let mut whole = |name: &str, least: i64| -> Option<(i64, FileLine)> {
            let id = film?;
            let member = self.member(id, name)?;
            let value = self.integer(id, name)?;
            if (least..=1 << 20).contains(&value) {
                return Some((value, member.place));
            }
            self.wrong(
                id,
                member,
                &format!("expected at least {least} and not millions, found {value}"),
            );
            None
        };
        let (width, height) = (whole("width", 1), whole("height", 1));
        let offset = [whole("crop_offset_x", 0), whole("crop_offset_y", 0)];
        let crop = [whole("crop_width", 1), whole("crop_height", 1)];
        let width = width.unwrap_or((768, place));
        let height = height.unwrap_or((576, place));
        image.set("width", Toml::Integer(width.0), width.1);
        image.set("height", Toml::Integer(height.0), height.1);
        if let Some((_, place)) = offset.iter().chain(&crop).flatten().next() {
            let [x, y] = offset.map(|n| n.map_or(0, |n| n.0));
            let w = crop[0].map_or(width.0, |n| n.0);
            let h = crop[1].map_or(height.0, |n| n.0);
            if x + w > width.0 || y + h > height.0 {
                let message = format!(
                    "film \"hdrfilm\": the crop window of {w} x {h} pixels at {x}, {y} does not fit into {} x {}",
                    width.0, height.0
                );
                self.log.invalid(Some(*place), message);
            } else if (x, y, w, h) != (0, 0, width.0, height.0) {
                let crop = Toml::table([
                    ("x", Toml::Integer(x)),
                    ("y", Toml::Integer(y)),
                    ("width", Toml::Integer(w)),
                    ("height", Toml::Integer(h)),
                ]);
                image.set("crop", crop, *place);
            }
        }
        (width.0, height.0)
    }

    fn filter(&mut self, id: Id, image: &mut Section) {
        let object = &self.objects.list[id];
        let (name, parameter) = match object.plugin.as_str() {
            "box" => {
                self.finish(id);
                // This is the native default.
                return;
            }
            "tent" => ("tent", "radius"),
            "gaussian" => ("gaussian", "stddev"),
            other => {
                let message =
                    format!("the filter \"{other}\" is replaced by a gaussian one: pixels are a little softer");
                self.log.note(object.place, message);
                self.pass_over(id);
                return image.set("filter", Toml::string("gaussian"), object.place);
            }
        };
        let filter = match self.float(id, parameter) {
            None => Toml::string(name),
            Some(size) => Toml::table([("type", Toml::string(name)), (parameter, Toml::Float(size))]),
        };
        image.set("filter", filter, object.place);
        self.pass_over(id);
        self.finish(id);
    }

    /// Origin, target and up.
    fn placement(&mut self, id: Id, camera: &mut Section) {
        let steps = self.transform(id, "to_world");
        let place = self
            .member(id, "to_world")
            .map_or(self.objects.list[id].place, |m| m.place);
        let mut set = |name, v: &[f64; 3]| camera.set(name, Toml::numbers(v), place);
        if let [Step::LookAt { origin, target, up }] = steps {
            set("origin", origin);
            set("target", target);
            set("up", up);
            return;
        }
        let map = transform::compose(steps);
        let mut m = map.matrix3;
        let scale = m.x_axis.length();
        if scale > 0.0 && (scale - 1.0).abs() > 1e-4 {
            // The lens has a size of its own, so that scaling the camera means nothing. `axes` checks the rest.
            m *= 1.0 / scale;
            let message = format!("{}: to_world: its scale of {scale} is left out", self.title(id));
            self.log.note(place, message);
        }
        self.axes(id, map.translation, m, camera);
    }

    /// An orthographic camera. Mitsuba's spans -1 to 1 along its own x axis.
    fn parallel(&mut self, id: Id, camera: &mut Section) {
        let map = transform::compose(self.transform(id, "to_world"));
        let place = self
            .member(id, "to_world")
            .map_or(self.objects.list[id].place, |m| m.place);
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
        let [x, y, _] = columns.map(DVec3::length);
        let [s, t, n] = columns.map(DVec3::normalize_or_zero);
        camera.set("projection", Toml::string("orthographic"), place);
        camera.set("view_width", Toml::Float(2.0 * x), place);
        if (x - y).abs() > 1e-4 * x {
            let message = format!(
                "{}: to_world: pixels that are not square ({x} by {y}) are not supported",
                self.title(id)
            );
            self.log.unsupported(place, message);
        }
        self.axes(id, map.translation, DMat3::from_cols(s, t, n), camera);
    }

    /// Origin, target and up from the axes of the sensor's space, which must be orthogonal.
    fn axes(&mut self, id: Id, origin: DVec3, m: DMat3, camera: &mut Section) {
        let place = self
            .member(id, "to_world")
            .map_or(self.objects.list[id].place, |m| m.place);
        let gram = m.transpose() * m;
        let apart = (gram - DMat3::IDENTITY).to_cols_array();
        let apart = apart
            .into_iter()
            .fold(0.0, |most: f64, x| if x.is_nan() { x } else { most.max(x.abs()) });
        // As strict as Mitsuba about lengths, and equally so about angles; versions before 2 accepted anything.
        let most = if self.objects.list[id].old { 0.05 } else { 1e-3 };
        if apart > 1e-3 && apart <= most {
            let message = format!("{}: to_world: it shears a little, which is left out", self.title(id));
            self.log.note(place, message);
        }
        if apart.is_nan() || apart > most {
            let message = format!(
                "{}: to_world: a sensor's transform must not scale or shear",
                self.title(id)
            );
            self.log.invalid(Some(place), message);
            return;
        }
        let mut set = |name, v: DVec3| camera.set(name, Toml::numbers(&v.to_array()), place);
        set("origin", origin);
        set("target", origin + m * DVec3::Z);
        set("up", m * DVec3::Y);
        if m.determinant() < 0.0 {
            camera.set("flip_x", Toml::Boolean(true), place);
        }
    }

    fn field_of_view(&mut self, id: Id, aspect: f64, camera: &mut Section) {
        let Some((degrees, axis, place)) = self.view_angle(id, aspect) else {
            return;
        };
        camera.set("fov", Toml::Float(degrees), place);
        if axis != "x" {
            let place = self.member(id, "fov_axis").map_or(place, |m| m.place);
            camera.set("fov_axis", Toml::string(axis), place);
        }
    }

    /// The horizontal field of view, in degrees, of an image with this aspect ratio; by default that of a 50 mm lens.
    pub(super) fn width_angle(&mut self, id: Id, aspect: f64) -> Option<(f64, FileLine)> {
        let (degrees, axis, place) = self.view_angle(id, aspect)?;
        let along_x = match axis {
            "smaller" => aspect <= 1.0,
            "larger" => aspect >= 1.0,
            axis => axis == "x",
        };
        let half = libm::tan(0.5 * degrees.to_radians()) * if along_x { 1.0 } else { aspect };
        Some((
            if along_x {
                degrees
            } else {
                2.0 * libm::atan(half).to_degrees()
            },
            place,
        ))
    }

    /// A field of view in degrees and its axis, possibly the diagonal. `None` after an error.
    fn view_angle(&mut self, id: Id, aspect: f64) -> Option<(f64, &'static str, FileLine)> {
        const AXES: [&str; 5] = ["x", "y", "diagonal", "smaller", "larger"];
        let place = self.objects.list[id].place;
        let fov = self.member(id, "fov");
        let focal_length = self.member(id, "focal_length");
        let (degrees, axis, place) = match (fov, focal_length) {
            (Some(member), None) => {
                let axis = self.word(id, "fov_axis", &AXES).unwrap_or("x");
                (self.float(id, "fov")?, axis, member.place)
            }
            (None, member) => {
                let text = self.string(id, "focal_length").unwrap_or("50mm");
                let number = text.trim().trim_end_matches("mm").trim().parse::<f64>();
                let millimetres = match number {
                    Ok(length) if length > 0.0 && length.is_finite() => length,
                    _ => {
                        if let Some(member) = member {
                            let message = format!("expected a length such as 50mm, found \"{text}\"");
                            self.wrong(id, member, &message);
                        }
                        return None;
                    }
                };
                // The diagonal of 36 x 24 mm film.
                let half = libm::atan(f64::hypot(36.0, 24.0) / (2.0 * millimetres));
                (2.0 * half.to_degrees(), "diagonal", member.map_or(place, |m| m.place))
            }
            (Some(_), Some(member)) => {
                self.wrong(id, member, "expected fov or focal_length, not both");
                return None;
            }
        };
        if !(degrees > 0.0 && degrees < 180.0) {
            let message = format!(
                "{}: fov: expected an angle between 0 and 180 degrees, found {degrees}",
                self.title(id)
            );
            return self.log.fatal(Some(place), message);
        }
        Some(match axis {
            "diagonal" => {
                let diagonal = libm::tan(0.5 * degrees.to_radians());
                let half_width = diagonal / (1.0 + 1.0 / (aspect * aspect)).sqrt();
                (2.0 * libm::atan(half_width).to_degrees(), "x", place)
            }
            axis => (degrees, axis, place),
        })
    }

    fn lens(&mut self, id: Id, camera: &mut Section) {
        let place = self.objects.list[id].place;
        let aperture = self.member(id, "aperture_radius");
        match (aperture, self.float(id, "aperture_radius")) {
            (Some(member), Some(radius)) => camera.set("aperture", Toml::Float(radius), member.place),
            (Some(_), None) => {}
            (None, _) => {
                let message = "sensor \"thinlens\": the parameter \"aperture_radius\" is missing";
                self.log.invalid(Some(place), message);
            }
        }
        let far = self.float(id, "far_clip").unwrap_or(1e4);
        let distance = self.float(id, "focus_distance").unwrap_or(far);
        let place = self.member(id, "focus_distance").map_or(place, |m| m.place);
        camera.set("focus_distance", Toml::Float(distance), place);
    }
}
