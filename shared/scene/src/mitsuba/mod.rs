//! Mitsuba 3's XML scenes, converted to the native format.
//!
//! Sources for the format's meaning: Mitsuba 3's documentation, and the behaviour of Mitsuba 3.9.1 (variants
//! `scalar_rgb` and `llvm_ad_rgb`).

mod attribute;
mod attributes;
mod bsdf;
mod emitter;
mod log;
mod medium;
mod named;
mod phase;
mod property;
mod sensor;
mod shape;
mod sky;
mod texture;
mod transform;
mod value;
mod volume;
mod write;
mod xml;

use crate::cie;
use crate::error::SceneError;
use crate::options::ImportOptions;
use crate::reach::{Reach, Written as Author};
use log::Log;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use value::Value;
use write::{Section, Toml, Written};
use xml::{Content, Id, Kind, Objects};

/// A line of one of the XML files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FileLine {
    /// Index of the file.
    pub file: usize,
    /// From one.
    pub line: usize,
}

/// A scene converted to the native format, with its origin.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The native scene file.
    pub text: String,
    /// What was replaced, each with its file and line.
    pub notes: Vec<String>,
    /// What was left out as unsupported, each with its file and line.
    pub left_out: Vec<String>,
    /// Generated files by their names in the native scene.
    pub made: BTreeMap<String, Vec<u8>>,
    origin: Origin,
}

/// Which lines of a native scene file come from which lines of XML.
#[derive(Clone, Debug)]
pub struct Origin {
    files: Vec<PathBuf>,
    places: Vec<Option<FileLine>>,
}

impl Origin {
    /// The origin of a scene made from a file without lines.
    pub(crate) fn whole(file: &Path) -> Self {
        Self {
            files: vec![file.to_owned()],
            places: Vec::new(),
        }
    }

    /// An error in the native scene file, relocated to the XML that it comes from.
    pub fn relocate(&self, error: SceneError) -> SceneError {
        let place = |line: usize| *self.places.get(line.checked_sub(1)?)?;
        // Blank lines have no place; an error on one belongs to what stands above.
        let found = error.line.and_then(|line| (1..=line).rev().find_map(place));
        match found.and_then(|place| Some((self.files.get(place.file)?, place.line))) {
            Some((file, line)) => SceneError {
                file: file.clone(),
                line: Some(line),
                ..error
            },
            None => SceneError {
                file: self.files.first().cloned().unwrap_or(error.file),
                line: None,
                ..error
            },
        }
    }
}

impl FileLine {
    /// Who wrote the text at this place.
    fn author(self) -> Author {
        match self.file {
            0 => Author::ByUser,
            _ => Author::Elsewhere,
        }
    }
}

impl Imported {
    /// The origin of the native scene file's lines.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }
}

/// Whether a scene file is Mitsuba's, judged by its name.
pub fn is_mitsuba(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("xml"))
}

/// Convert the scene in `path`. Files are named relative to `folder`, where the native scene file will be.
///
/// The error lists everything that is wrong with the XML, one line each.
pub fn import(path: &Path, folder: &Path, options: &ImportOptions) -> Result<Imported, SceneError> {
    import_within(path, folder, options, &Reach::new(path, &options.allow_outside))
}

/// [`import`], with files that are within `reach`.
pub fn import_within(
    path: &Path,
    folder: &Path,
    options: &ImportOptions,
    reach: &Reach,
) -> Result<Imported, SceneError> {
    let mut log = Log::default();
    let written = xml::read(path, &options.parameters, reach, &mut log)
        .map(|objects| Converter::new(&objects, path, folder, options.spectral, (reach, &mut log)).convert(path));
    let files = log.files.clone();
    let [notes, left_out] = log.finish(path, options.skip_unsupported)?;
    // Without an error there is a result.
    let written = written.unwrap_or_default();
    Ok(Imported {
        text: written.text,
        notes,
        left_out,
        made: written.made,
        origin: Origin {
            files,
            places: written.places,
        },
    })
}

/// The conversion. Each kind of object is converted in its own file.
struct Converter<'a> {
    objects: &'a Objects,
    reach: &'a Reach,
    log: &'a mut Log,
    /// Paths are written relative to this folder.
    folder: &'a Path,
    /// Whether named substances get a wavelength-dependent index.
    spectral: bool,
    /// Prefix for names of generated files.
    stem: String,
    made: BTreeMap<String, Vec<u8>>,
    materials: bsdf::Materials,
    media: BTreeMap<Id, String>,
    media_names: BTreeSet<String>,
    media_sections: Vec<Section>,
    /// The medium outside of all shapes.
    world: Option<Id>,
    /// Media boundaries on surfaces that bound no medium here, for the current shape.
    skins: Vec<Section>,
    /// Where an integrator hides emitters from the camera.
    hides_emitters: Option<FileLine>,
    /// Objects whose members have all been queried.
    finished: BTreeSet<Id>,
}

impl<'a> Converter<'a> {
    fn new(
        objects: &'a Objects,
        path: &Path,
        folder: &'a Path,
        spectral: bool,
        (reach, log): (&'a Reach, &'a mut Log),
    ) -> Self {
        let ids = |kind: Kind| {
            let of_kind = objects.list.iter().filter(move |o| o.kind == kind);
            of_kind.filter_map(|o| o.id.clone())
        };
        Self {
            objects,
            reach,
            log,
            folder,
            spectral,
            stem: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            made: BTreeMap::new(),
            materials: bsdf::Materials::new(ids(Kind::Bsdf)),
            media: BTreeMap::new(),
            media_names: ids(Kind::Medium).chain(["none".to_string()]).collect(),
            media_sections: Vec::new(),
            world: None,
            skins: Vec::new(),
            hides_emitters: None,
            finished: BTreeSet::new(),
        }
    }

    fn convert(mut self, path: &Path) -> Written {
        const SCENE: Id = 0;
        let scene = &self.objects.list[SCENE];
        self.world = self.world_medium(SCENE);
        self.hides_emitters = self.hides_emitters(SCENE);
        let referred = self.emitters_of_shapes();
        let mut view = None;
        let mut shapes = Vec::new();
        let mut lights = Vec::new();
        let mut passes = None;
        for member in &scene.members {
            let Content::Object(id) = member.content else {
                continue;
            };
            member.used.set(true);
            let object = &self.objects.list[id];
            match object.kind {
                Kind::Integrator => {
                    let mut message = format!(
                        "the integrator \"{}\" is replaced by progressive photon beams",
                        object.plugin
                    );
                    if let Some(depth) = self.max_depth(id).filter(|depth| *depth >= 0) {
                        message += &format!(
                            ", which follow light to its end: the light that its max_depth of {depth} leaves out \
                             is there"
                        );
                    }
                    self.log.note(object.place, message);
                }
                Kind::Sensor if view.is_none() => view = Some(self.sensor(id)),
                Kind::Sensor => {
                    let message = "a scene is rendered through its first sensor; this one is left out";
                    self.log.note(object.place, message);
                }
                Kind::Sampler => passes = self.sampler(id).or(passes),
                Kind::Shape => self.shape(id, &mut shapes),
                // Converted with the shape that refers to it.
                Kind::Emitter if object.plugin == "area" && referred.contains(&id) => {}
                Kind::Emitter => lights.extend(self.emitter(id)),
                Kind::Bsdf => {
                    self.material(id, None, false);
                }
                Kind::Medium => {
                    self.medium(id, None);
                }
                // Converted where they are used.
                Kind::Texture | Kind::Phase | Kind::Volume => {}
                Kind::Film | Kind::Filter => {
                    let message = format!("a <{}> outside of the sensor has no effect", object.kind.tag());
                    self.log.note(object.place, message);
                }
                Kind::Scene => {
                    let message = "<scene> cannot stand directly within <scene>";
                    self.log.invalid(Some(object.place), message);
                }
            }
        }
        self.shape_groups(SCENE, &mut shapes);
        self.finish(SCENE);
        let Some(mut view) = view else {
            let message = "the scene has no <sensor>";
            self.log.invalid(Some(scene.place), message);
            return Written::default();
        };
        if let Some((count, place)) = passes
            && view.render.is_empty()
        {
            view.render.set("passes", Toml::Integer(count), place);
        }
        let mut sections = vec![view.image];
        if !view.render.is_empty() {
            sections.push(view.render);
        }
        if let Some(world) = self.world
            && let Some(name) = self.media.get(&world)
        {
            let mut section = Section::table("world", self.objects.list[world].place);
            section.set("medium", Toml::string(name), self.objects.list[world].place);
            sections.push(section);
        }
        sections.push(view.camera);
        sections.extend(self.media_sections);
        sections.extend(self.materials.sections);
        sections.extend(shapes);
        sections.extend(lights);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let comment = format!("Converted by beamfarm from Mitsuba's {name}.");
        let mut written = Written::new(&comment, &sections);
        written.made = self.made;
        written
    }
}

impl Converter<'_> {
    fn emitters_of_shapes(&self) -> BTreeSet<Id> {
        let objects = &self.objects.list;
        let shapes = objects.iter().filter(|object| object.kind == Kind::Shape);
        let members = shapes.flat_map(|shape| &shape.members);
        let emitters = members.filter_map(|member| match member.content {
            Content::Object(id) if objects[id].kind == Kind::Emitter => Some(id),
            _ => None,
        });
        emitters.collect()
    }

    /// Where an integrator, or a nested one, hides emitters from the camera.
    fn hides_emitters(&mut self, id: Id) -> Option<FileLine> {
        let mut hides = None;
        for (_, integrator) in self.nested(id, Kind::Integrator) {
            let name = "hide_emitters";
            if self.boolean(integrator, name) == Some(true) {
                hides = self.member(integrator, name).map(|member| member.place);
            }
            hides = self.hides_emitters(integrator).or(hides);
        }
        hides
    }

    /// The number of path segments after which the integrator, or a nested one, stops; negative for never.
    fn max_depth(&self, id: Id) -> Option<i64> {
        let members = self.objects.list[id].members.iter();
        let mut depths = members.filter_map(|member| match member.content {
            Content::Value(Value::Integer(depth)) if member.name.as_deref() == Some("max_depth") => Some(depth),
            Content::Object(inner) if self.objects.list[inner].kind == Kind::Integrator => self.max_depth(inner),
            _ => None,
        });
        depths.next()
    }

    /// Hide an emitter from the camera if the integrator says so. Mitsuba's camera rays pass through such shapes and
    /// see black instead of an environment; mirrors show both.
    fn hide(&self, emitter: &mut Section) {
        if let Some(place) = self.hides_emitters {
            let rays = ["reflected", "refracted", "shadow", "photon"];
            let rays = rays.map(Toml::string).to_vec();
            emitter.set("visible", Toml::Array(rays), place);
        }
    }
}

/// An unused name: the wanted one, with a number if needed.
fn unique(taken: &mut BTreeSet<String>, wanted: &str) -> String {
    let mut name = wanted.to_string();
    let mut count = 1;
    while !taken.insert(name.clone()) {
        count += 1;
        name = format!("{wanted}-{count}");
    }
    name
}
