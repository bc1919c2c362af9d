//! The scene being edited: its text, its history, and what follows from it.

use super::messages::{Camera, FromPage, ToPage};
use crate::failure::Failure;
use crate::settings::SceneArgs;
use beamfarm_coordinator::revisions::Style;
use beamfarm_image::atomic::write_file;
use beamfarm_image::job::{EngineKind, JobSettings, Techniques};
use beamfarm_image::view::{View, ViewTransform};
use beamfarm_image::{bundle, input};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{FileEntry, FileHash, Manifest, Revision, RevisionNumber};
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::{RenderDefaults, Scene, SceneDescription, Seen};
use beamfarm_scene::desk::{self, CameraMove, Thing};
use beamfarm_scene::{
    Edits, File, Files, ImportOptions, Reach, SceneError, SceneFile, Store, Written, is_gltf, is_mitsuba,
};
use beamfarm_worker::complain;
use glam::DVec3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Limits of the undo history: steps, and bytes of text.
const UNDO_STEPS: usize = 1000;
const UNDO_BYTES: usize = 64 << 20;

/// The camera may be this many scene radii away from the origin of render space.
const FAR: f32 = 0.5;
/// Where handles of lights without a position are drawn, to be turned there: the distance from the camera as a fraction
/// of its target's, and the height above the target as a fraction of half the picture's width there.
const SKY: [f64; 2] = [1.0, 0.22];
/// Pages treat parallel rays as starting this far behind the camera, as a multiple of the radius of scene and image.
const FAR_BEHIND: f64 = 1e5;

/// Why a change is refused.
#[derive(Debug)]
pub struct Refusal {
    pub path: Option<String>,
    pub line: Option<usize>,
    pub message: String,
}

impl From<String> for Refusal {
    fn from(message: String) -> Self {
        Self {
            path: None,
            line: None,
            message,
        }
    }
}

impl Refusal {
    /// An error in the scene file by its line, in another file by its name.
    fn of(error: SceneError, scene: &Path) -> Self {
        let of_scene = error.file.file_name() == scene.file_name();
        let SceneError { file, line, message } = error;
        match of_scene {
            true => Self {
                path: None,
                line,
                message,
            },
            false => Self {
                path: None,
                line: None,
                message: format!("{}: {message}", file.display()),
            },
        }
    }
}

/// The effect of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changed {
    /// Pixels change.
    Picture,
    /// Only things that no pixel depends on: the view, a comment.
    Looks,
    /// None at all.
    Nothing,
}

/// An undo step.
struct Before {
    text: String,
    /// The gesture that changed the text.
    gesture: Option<String>,
}

/// Settings that no pixel depends on and that are not part of the scene's meaning.
#[derive(Clone, Copy)]
struct Looks {
    view: View,
    passes: u64,
}

impl Looks {
    fn of(files: &Files) -> Self {
        let table = files.files.get(&files.scene).and_then(|file| {
            let text = std::str::from_utf8(file.bytes()).ok()?;
            toml::from_str::<toml::Table>(text).ok()
        });
        let render = table.as_ref().and_then(|table| table.get("render"));
        let field = |name: &str| render.and_then(|render| render.get(name));
        let number = |name: &str| match field(name) {
            Some(toml::Value::Float(number)) => Some(*number as f32),
            Some(toml::Value::Integer(number)) => Some(*number as f32),
            _ => None,
        };
        let transform = field("view").and_then(|name| ViewTransform::named(name.as_str()?));
        let passes = field("passes").and_then(toml::Value::as_integer);
        let defaults = RenderDefaults::default();
        Self {
            view: View {
                transform: transform.unwrap_or(defaults.view.transform),
                exposure: number("exposure").unwrap_or(defaults.view.exposure),
                white_balance: number("white_balance").unwrap_or(defaults.view.white_balance),
            },
            passes: passes
                .and_then(|passes| u64::try_from(passes).ok())
                .unwrap_or(defaults.passes),
        }
    }
}

/// The scene being edited.
pub struct Bench {
    args: SceneArgs,
    options: ImportOptions,
    /// The file that "save" writes.
    file: PathBuf,
    /// Folders where the scene's files may be.
    reach: Arc<Reach>,
    /// The text on disk; `None`: not there yet, as the scene was converted.
    on_disk: Option<String>,
    text: String,
    undo: Vec<Before>,
    redo: Vec<String>,
    /// Files of the last text that could be rendered, as written and in canonical form.
    files: Files,
    meant: Files,
    /// Files that are on disk only after saving, by their names in the text.
    made: BTreeMap<String, File>,
    looks: Looks,
    number: RevisionNumber,
    store: Store,
    description: SceneDescription,
    /// The scene for tracing rays, built on demand.
    scene: Option<Scene>,
    /// The origin of sketches, in world coordinates.
    origin: [f64; 3],
    /// The last pilot's choice.
    techniques: Option<Techniques>,
}

impl Bench {
    /// Open a scene file.
    pub fn open(args: &SceneArgs) -> Result<Self, Failure> {
        // Report all errors at once, as `render` does.
        args.check(&args.file()?)?;
        let options = args.import.options(&args.scene)?;
        let plain = ImportOptions {
            edits: Edits::default(),
            ..options.clone()
        };
        let read = SceneFile::read(&args.scene, &plain)?;
        let is_native = !is_mitsuba(&args.scene) && !is_gltf(&args.scene);
        let text = String::from_utf8_lossy(read.text()).into_owned();
        let file = args.scene.with_extension("toml");
        let file = if is_native { args.scene.clone() } else { file };
        let reach = read.reach;
        let files = Files::from(read.bundle).revised(&file, (&text, Written::ByUser), &options.edits, &reach)?;
        if let Some(note) = reach.note() {
            complain!("note: {}: {note}", args.scene.display());
        }
        let made = read.made.into_iter();
        let made = made.filter_map(|name| Some((name.clone(), files.files.get(&bundle::key(&name))?.clone())));
        let made = made.collect();
        let meant = files.clone().canonical();
        let eye = desk::eye(&meant)?;
        let mut store = Store::default();
        let description = store.sketch(&meant, eye.origin)?;
        Ok(Self {
            args: args.clone(),
            options,
            file,
            reach,
            on_disk: is_native.then(|| text.clone()),
            text,
            undo: Vec::new(),
            redo: Vec::new(),
            looks: Looks::of(&files),
            files,
            meant,
            made,
            number: RevisionNumber(1),
            store,
            description,
            scene: None,
            origin: eye.origin,
            techniques: None,
        })
    }

    /// Apply a change requested by a page.
    pub fn change(&mut self, change: &FromPage) -> Result<Changed, Refusal> {
        match change {
            FromPage::Undo { .. } => Ok(self.step(false)?),
            FromPage::Redo { .. } => Ok(self.step(true)?),
            FromPage::Revert { .. } => match self.on_disk.clone() {
                Some(text) => self.put(text, None),
                None => Err("the scene is not on the disk in this form yet".to_owned().into()),
            },
            FromPage::Written { .. } => self.read_again(),
            FromPage::Focus { x, y, .. } => {
                let seen = self.seen_at(*x, *y).ok_or_else(|| "nothing is there".to_owned())?;
                let depth = round(f64::from(seen.depth));
                let text = desk::set(&self.text, "camera.focus_distance", Some(Value::from(depth)))?;
                self.put(text, None)
            }
            FromPage::Camera {
                gesture,
                origin,
                target,
                up,
                fov,
                ..
            } => {
                let to = CameraMove {
                    origin: *origin,
                    target: *target,
                    up: *up,
                    fov: *fov,
                };
                let text = desk::camera(&self.text, to)?;
                self.put(text, Some(gesture))
            }
            FromPage::Set {
                gesture, path, value, ..
            } => {
                let value = (!value.is_null()).then(|| value.clone());
                let at_path = |refusal: Refusal| Refusal {
                    path: Some(path.clone()),
                    ..refusal
                };
                let text = desk::set(&self.text, path, value).map_err(|message| at_path(message.into()))?;
                self.put(text, Some(gesture)).map_err(at_path)
            }
            FromPage::Move { gesture, thing, by, .. } => {
                let text = desk::translate(self.base(gesture), thing, *by)?;
                self.put(text, Some(gesture))
            }
            FromPage::Turn {
                gesture,
                thing,
                axis,
                angle,
                ..
            } => {
                let text = desk::turn(self.base(gesture), thing, *axis, *angle)?;
                self.put(text, Some(gesture))
            }
            _ => Ok(Changed::Nothing),
        }
    }

    /// The scene file, or a file that it names, has changed on disk.
    pub fn read_again(&mut self) -> Result<Changed, Refusal> {
        let text = match self.on_disk {
            Some(_) => read_text(&self.file).map_err(|error| Refusal::of(error, &self.file))?,
            None => return Ok(Changed::Nothing),
        };
        self.on_disk = Some(text.clone());
        // The names may be unchanged although the contents differ.
        self.files = Files {
            scene: self.files.scene.clone(),
            files: BTreeMap::new(),
        };
        self.put_by(Written::ByUser, text, None)
    }

    /// Write the scene file. Returns what was done, for display.
    pub fn save(&mut self) -> Result<String, String> {
        let file = self.file.display();
        if self.on_disk.is_none() && self.file.exists() {
            return Err(format!(
                "{file} is there already, and was not made from this scene: move it away"
            ));
        }
        for (name, file) in &self.made {
            write_file(&self.folder().join(name), file.bytes()).map_err(|error| error.to_string())?;
        }
        self.made.clear();
        write_file(&self.file, self.text.as_bytes()).map_err(|error| error.to_string())?;
        self.on_disk = Some(self.text.clone());
        Ok(format!("saved {file}"))
    }

    /// Whether the text differs from that on disk.
    pub fn is_dirty(&self) -> bool {
        self.on_disk.as_ref() != Some(&self.text)
    }

    /// The scene file to be written, and the scene's other files.
    pub fn paths(&self) -> Vec<PathBuf> {
        let folder = self.folder();
        let native = self.on_disk.is_some().then(|| self.file.clone());
        let assets = self.files.files.keys().filter(|key| **key != self.files.scene);
        native.into_iter().chain(assets.map(|key| folder.join(key))).collect()
    }

    /// The scene file that "save" writes.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The number of the scene's state.
    pub fn number(&self) -> RevisionNumber {
        self.number
    }

    /// The scene in canonical form.
    pub fn meant(&self) -> &Files {
        &self.meant
    }

    /// The scene as prepared for sketches.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The revision for workers, with the files that they may request.
    pub fn revision(&self) -> (Revision, BTreeMap<FileHash, Bytes>) {
        let entry = |(path, file): (&String, &beamfarm_scene::File)| FileEntry {
            path: path.clone(),
            hash: FileHash(file.hash()),
            size: file.bytes().len() as u64,
        };
        let named = self.meant.files.iter();
        let files = named
            .clone()
            .map(|(_, file)| (FileHash(file.hash()), Bytes::from_owner(file.bytes().clone())));
        let text = self.meant.files.get(&self.meant.scene);
        let revision = Revision {
            number: self.number,
            manifest: Manifest {
                scene: self.meant.scene.clone(),
                files: named.map(entry).collect(),
            },
            text: text
                .map(|file| Bytes::from_owner(file.bytes().clone()))
                .unwrap_or_default(),
        };
        (revision, files.collect())
    }

    /// The style of sketches with an engine.
    pub fn style(&self, engine: EngineKind) -> Style {
        let settings = self.description.defaults.job_settings();
        Style {
            settings: JobSettings {
                techniques: self.techniques.unwrap_or(settings.techniques),
                engine,
                ..settings
            },
            origin: self.origin,
        }
    }

    /// Set a pilot's choice.
    pub fn chose(&mut self, techniques: Techniques) {
        self.techniques = Some(techniques);
    }

    /// How the picture is displayed.
    pub fn view(&self) -> View {
        self.looks.view
    }

    /// Number of passes of the scene's job.
    pub fn passes(&self) -> u64 {
        self.looks.passes
    }

    /// Number the unchanged scene as a new state.
    pub fn begin_anew(&mut self) {
        self.number.0 += 1;
    }

    /// The scene for the page.
    pub fn scene(&self, seq: u64) -> ToPage {
        let title = self.args.scene.file_stem().unwrap_or_default();
        let name = self.file.file_name().unwrap_or_default();
        ToPage::Scene {
            revision: self.number.0,
            seq,
            title: title.to_string_lossy().into_owned(),
            file: name.to_string_lossy().into_owned(),
            dirty: self.is_dirty(),
            undo: !self.undo.is_empty(),
            redo: !self.redo.is_empty(),
            camera: self.camera(),
            things: self.things(),
            fields: desk::fields(&self.text),
        }
    }

    /// What is visible at a point of the picture.
    pub fn seen_at(&mut self, x: f64, y: f64) -> Option<Seen> {
        let description = &self.description;
        let scene = self.scene.get_or_insert_with(|| Scene::new(description.clone()));
        scene.seen_at(x as f32, y as f32)
    }

    /// The answer to a click.
    pub fn picked(&mut self, x: f64, y: f64) -> ToPage {
        let seen = self.seen_at(x, y);
        let object = seen.map(|seen| seen.object as usize);
        let ids = desk::object_ids(&self.text);
        let objects = &self.description.objects;
        let world = |point: [f32; 3]| std::array::from_fn(|i| f64::from(point[i]) + self.origin[i]);
        ToPage::Picked {
            thing: object.and_then(|object| ids.get(object).cloned()),
            name: object.and_then(|object| Some(objects.get(object)?.name.clone())),
            point: seen.map(|seen| world(seen.point)),
            distance: seen.map(|seen| f64::from(seen.depth)),
            material: object.and_then(|object| desk::material_of(&self.text, object)),
        }
    }

    fn camera(&self) -> Camera {
        let camera = &self.description.camera;
        let eye = desk::eye(&self.meant).ok();
        let forward = camera.frame.n;
        let origin: [f64; 3] = std::array::from_fn(|i| f64::from(camera.position[i]) + self.origin[i]);
        let target = std::array::from_fn(|i| origin[i] + f64::from(forward[i]));
        // The page assumes that rays meet in one point; parallel ones meet very far behind.
        let back = match camera.projection {
            Projection::Perspective | Projection::Panoramic(_) => 0.0,
            Projection::Orthographic => FAR_BEHIND * f64::from(self.description.bounds.radius + camera.half_width),
        };
        let on_plane = |size: f32| match camera.projection {
            Projection::Perspective | Projection::Panoramic(_) => f64::from(size),
            Projection::Orthographic => f64::from(size) / back,
        };
        let fov = eye.and_then(|eye| eye.fov);
        let fixed = match (eye, camera.projection) {
            (None, _) => Some("the scene's camera cannot be found"),
            (_, Projection::Orthographic) => Some("an orthographic camera is moved in the scene's text"),
            (_, Projection::Panoramic(_)) => Some("a panoramic camera is moved in the scene's text"),
            _ => None,
        };
        let sense = camera.frame.s.cross(camera.frame.t).dot(camera.frame.n);
        Camera {
            origin: std::array::from_fn(|i| eye.map_or(origin, |eye| eye.origin)[i] - back * f64::from(forward[i])),
            target: eye.map_or(target, |eye| eye.target),
            up: eye.map_or([0.0, 1.0, 0.0], |eye| eye.up),
            fov: fov.map_or(40.0, |(fov, _)| fov),
            fov_axis: fov.map_or("x", |(_, axis)| axis),
            tan_x: on_plane(camera.half_width),
            width: camera.width,
            height: camera.height,
            shift: [on_plane(camera.shift.x), on_plane(camera.shift.y)],
            // Left-handed, unless the image is mirrored.
            flip_x: sense > 0.0,
            aperture: f64::from(camera.aperture),
            focus_distance: f64::from(camera.focus_distance),
            fixed: fixed.map(str::to_owned),
        }
    }

    /// Everything that has handles. Light from infinitely far away gets a handle in the picture, to be turned there.
    fn things(&self) -> Vec<Thing> {
        let mut things = desk::things(&self.text, &self.description, self.origin);
        let Ok(eye) = desk::eye(&self.meant) else {
            return things;
        };
        let [origin, target] = [eye.origin, eye.target].map(DVec3::from);
        let up = self.description.camera.frame.t.as_dvec3();
        let distance = (target - origin).length();
        let half_width = f64::from(self.description.camera.half_width);
        let half_width = match self.description.camera.projection {
            // The page cannot locate points in panoramic pictures.
            Projection::Panoramic(_) => return Vec::new(),
            Projection::Perspective => distance * half_width,
            Projection::Orthographic => half_width,
        };
        let place = origin + (target - origin) * SKY[0] + up * (half_width * SKY[1]);
        for thing in things.iter_mut().filter(|thing| thing.kind == "directional") {
            thing.at = Some(place.to_array());
        }
        things
    }

    fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new(""))
    }

    /// The text from which a gesture's total changes are applied.
    fn base(&self, gesture: &str) -> &str {
        match self.undo.last() {
            Some(before) if before.gesture.as_deref() == Some(gesture) => &before.text,
            _ => &self.text,
        }
    }

    /// Accept a new text from a page, if it is a valid scene.
    fn put(&mut self, text: String, gesture: Option<&str>) -> Result<Changed, Refusal> {
        self.put_by(Written::ByPage, text, gesture)
    }

    fn put_by(&mut self, by: Written, text: String, gesture: Option<&str>) -> Result<Changed, Refusal> {
        let changed = self.show(by, &text)?;
        if text == self.text {
            return Ok(changed);
        }
        let is_same_gesture = self
            .undo
            .last()
            .is_some_and(|before| before.gesture.is_some() && before.gesture.as_deref() == gesture);
        let text = std::mem::replace(&mut self.text, text);
        if !is_same_gesture {
            self.undo.push(Before {
                text,
                gesture: gesture.map(str::to_owned),
            });
        }
        self.redo.clear();
        let mut bytes: usize = self.undo.iter().map(|before| before.text.len()).sum();
        while self.undo.len() > UNDO_STEPS || bytes > UNDO_BYTES && self.undo.len() > 1 {
            bytes -= self.undo.remove(0).text.len();
        }
        Ok(match changed {
            Changed::Nothing => Changed::Looks,
            changed => changed,
        })
    }

    /// Undo or redo one step.
    fn step(&mut self, forth: bool) -> Result<Changed, Refusal> {
        let next = match forth {
            true => self.redo.last().cloned(),
            false => self.undo.last().map(|before| before.text.clone()),
        };
        let Some(next) = next else {
            return Ok(Changed::Nothing);
        };
        let changed = self.show(Written::ByPage, &next)?;
        let text = std::mem::replace(&mut self.text, next);
        match forth {
            true => {
                self.redo.pop();
                self.undo.push(Before { text, gesture: None });
            }
            false => {
                self.undo.pop();
                self.redo.push(text);
                // The rest of an interrupted gesture becomes a separate step.
                if let Some(before) = self.undo.last_mut() {
                    before.gesture = None;
                }
            }
        }
        Ok(match changed {
            Changed::Nothing => Changed::Looks,
            changed => changed,
        })
    }

    /// Switch to the scene of a text. On error nothing changes.
    fn show(&mut self, by: Written, text: &str) -> Result<Changed, Refusal> {
        let file = self.file.clone();
        self.try_to_show(by, text).map_err(|error| {
            let refusal = Refusal::of(error, &file);
            Refusal {
                path: refusal.line.and_then(|line| desk::path_at(text, line)),
                ..refusal
            }
        })
    }

    fn try_to_show(&mut self, by: Written, text: &str) -> Result<Changed, SceneError> {
        let files = self
            .files
            .revised(&self.file, (text, by), &self.options.edits, &self.reach)?;
        let meant = files.clone().canonical();
        let is_same = meant.scene == self.meant.scene
            && meant.files.len() == self.meant.files.len()
            && (meant.files.iter().zip(&self.meant.files)).all(|(a, b)| a.0 == b.0 && a.1.hash() == b.1.hash());
        if is_same {
            self.looks = Looks::of(&files);
            self.files = files;
            return Ok(Changed::Nothing);
        }
        // Uses the text as written, as errors give its lines.
        let mut description = self.store.sketch(&files, self.origin)?;
        // Single precision is finest near the origin: when the camera has moved far away, choose a new one.
        let mut origin = self.origin;
        let strayed = description.camera.position.length();
        if strayed > FAR * description.bounds.radius
            && let Ok(eye) = desk::eye(&meant)
        {
            origin = eye.origin;
            description = self.store.sketch(&files, origin)?;
        }
        self.origin = origin;
        self.description = description;
        self.looks = Looks::of(&files);
        self.files = files;
        self.meant = meant;
        self.scene = None;
        self.number.0 += 1;
        Ok(Changed::Picture)
    }
}

fn read_text(file: &Path) -> Result<String, SceneError> {
    let wrong = |message: String| SceneError {
        file: file.to_owned(),
        line: None,
        message,
    };
    let bytes = input::read(file, bundle::MAX_BYTES).map_err(|error| wrong(error.to_string()))?;
    String::from_utf8(bytes).map_err(|_| wrong("the scene file is not UTF-8 text".into()))
}

/// Four digits suffice for a focus distance.
fn round(value: f64) -> f64 {
    let scale = libm::pow(10.0, 3.0 - libm::floor(libm::log10(value.abs().max(1e-30))));
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests;
