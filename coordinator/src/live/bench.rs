//! The scene being edited: its text, its history, and what follows from it.

mod looks;
mod told;

use super::messages::FromPage;
use crate::failure::Failure;
use crate::settings::SceneArgs;
use beamfarm_coordinator::revisions::Style;
use beamfarm_image::atomic::write_file;
use beamfarm_image::job::{EngineKind, JobSettings, Techniques};
use beamfarm_image::view::View;
use beamfarm_image::{bundle, input};
use beamfarm_proto::bytes::Bytes;
use beamfarm_proto::{FileEntry, FileHash, Manifest, Revision, RevisionNumber};
use beamfarm_render::world::{Scene, SceneDescription, Seen};
use beamfarm_scene::desk::{self, CameraMove};
use beamfarm_scene::{
    Edits, File, Files, ImportOptions, Reach, SceneError, SceneFile, Store, Written, is_gltf, is_mitsuba,
};
use beamfarm_worker::complain;
use looks::Looks;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Limits of the undo history: steps, and bytes of text.
const UNDO_STEPS: usize = 1000;
const UNDO_BYTES: usize = 64 << 20;

/// The camera may be this many scene radii away from the origin of render space.
const FAR: f32 = 0.5;
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

    /// What is visible at a point of the picture.
    pub fn seen_at(&mut self, x: f64, y: f64) -> Option<Seen> {
        let description = &self.description;
        let scene = self.scene.get_or_insert_with(|| Scene::new(description.clone()));
        scene.seen_at(x as f32, y as f32)
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
