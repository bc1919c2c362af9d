//! Where images go.

use crate::failure::Failure;
use crate::sketch::Sketch;
use beamfarm_image::atomic::remove_leftovers;
use beamfarm_image::denoise::{Input, denoise};
use beamfarm_image::error::ImageError;
use beamfarm_image::exr::{
    DenoisedMeta, ImageMeta, MadeOf, Names, Provenance, SketchMeta, write_denoised, write_image, write_sketch,
};
use beamfarm_image::film::Film;
use beamfarm_image::job::SceneHash;
use beamfarm_image::layer::Layer;
use beamfarm_image::merge::Average;
use beamfarm_image::png::write_png;
use beamfarm_image::view::View;
use beamfarm_proto::VERSION;
use beamfarm_worker::visible;
use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tracing::warn;

/// Print a text that people may page or cut: a reader that closes early is not a failure.
pub fn print_text(text: &str) -> Result<(), Failure> {
    match io::stdout().lock().write_all(visible(text).as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::io(error)),
        _ => Ok(()),
    }
}

/// Suffix of the reference's default name.
pub const REFERENCE: &str = "-reference";

/// Check that an image can be written here: the name ends in .exr and its folder exists and is writable. Commands check
/// before long work.
pub fn check(image: &Path) -> Result<(), Failure> {
    if image.extension() != Some(OsStr::new("exr")) {
        let message = format!("{}: expected a name that ends in .exr", image.display());
        return Err(Failure::usage(message));
    }
    let folder = match image.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let (image, shown) = (image.display(), folder.display());
    match std::fs::metadata(folder) {
        Ok(found) if !found.is_dir() => {
            let message = format!("{image}: {shown} is a file, not a folder: name another with -o");
            return Err(Failure::io(message));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let message = format!("{image}: the folder {shown} does not exist: make it, or name another with -o");
            return Err(Failure::io(message));
        }
        _ => {}
    }
    match tempfile::Builder::new().prefix(".beamfarm-").tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => {
            let why = error.to_string();
            // Without the name of the probe file.
            let why = why.split(" at path ").next().unwrap_or_default();
            let message = format!("cannot write to the folder {shown}: {why}");
            Err(Failure::because_of(&error, message))
        }
    }
}

/// Create a command's output folder with its parents.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::io(format!("cannot make the folder {}: {error}", folder.display())))
}

/// The files of an image.
#[derive(Clone, Debug)]
pub struct Output {
    pub exr: PathBuf,
    pub png: PathBuf,
    /// The scene file as named in the EXR.
    pub scene_file: Option<String>,
    /// Whether the EXR includes the standard error.
    pub standard_error: bool,
    /// Whether the EXR notes that photons which missed all targets were dropped.
    pub drops_photons: bool,
    /// Names of what its mattes separate.
    pub names: Names,
    /// Depth of the empty background; `None`: infinite.
    pub empty_depth: Option<f32>,
    /// Whether to also write a denoised picture.
    pub denoise: bool,
    /// What to write if there is no image.
    pub sketch: Option<Sketch>,
}

/// Default job folder of an image.
pub fn job_beside(image: &Path) -> PathBuf {
    image.with_extension("job")
}

impl Output {
    /// The requested files, or files named after the scene. Checks that they can be written, so that this does not fail
    /// after hours of rendering.
    ///
    /// `ending`: suffix of the default name. An image of another kind of command is overwritten only if it is named.
    pub fn new(asked: Option<&Path>, scene: &Path, ending: &str, standard_error: bool) -> Result<Self, Failure> {
        let scene_file = name_of(scene);
        let exr = Self::path(asked, scene, ending)?;
        check(&exr)?;
        let png = exr.with_extension("png");
        for path in [&exr, &png] {
            // Failing to remove them does no harm.
            let _ = remove_leftovers(path);
        }
        Ok(Self {
            exr,
            png,
            scene_file,
            standard_error,
            drops_photons: false,
            names: Names::default(),
            empty_depth: None,
            denoise: false,
            sketch: None,
        })
    }

    /// Path of the EXR: the requested one, or one named after the scene.
    pub fn path(asked: Option<&Path>, scene: &Path, ending: &str) -> Result<PathBuf, Failure> {
        match asked {
            Some(path) => Ok(path.to_owned()),
            None => default_name(scene, ending, name_of(scene).as_deref()),
        }
    }

    /// The picture's title: its file name.
    pub fn title(&self) -> String {
        let stem = self.exr.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// Write the image, and the denoised picture if requested. If that one cannot be made, the log says why, and the
    /// image remains.
    pub fn write(&self, average: &Average, meta: &ImageMeta, view: View) -> Result<(), ImageError> {
        // In parallel: at the end of a job most of the remaining time goes into compression.
        std::thread::scope(|scope| {
            let png = scope.spawn(|| write_png(&self.png, &average.beauty, view));
            write_image(&self.exr, average, meta)?;
            png.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })?;
        if self.denoise {
            let path = denoised_name(&self.exr);
            match denoised(average, meta) {
                Ok((film, meta)) => write_both(&path, &film, &meta, view)?,
                Err(why) => warn!("{} is not written: {why}", path.display()),
            }
        }
        Ok(())
    }
}

impl Output {
    /// Write a coarse picture as there is no other. An existing image stays, and the picture gets a similar name.
    /// Returns what was written, for display.
    pub fn write_sketch(&self, sketch: &Sketch, scene: SceneHash, view: View) -> Result<String, ImageError> {
        let is_there = MadeOf::read(&self.exr).is_some() || Provenance::read(&self.exr).is_some_and(|it| it.of_samples);
        let exr = match is_there {
            true => self.exr.with_extension("sketch.exr"),
            false => self.exr.clone(),
        };
        let png = exr.with_extension("png");
        let film = sketch.enlarged();
        let meta = SketchMeta {
            sketch: sketch.to_string(),
            scene,
            scene_file: self.scene_file.clone(),
            version: VERSION.into(),
        };
        write_sketch(&exr, &film, &meta)?;
        write_png(&png, &film, view)?;
        Ok(format!("wrote {} and {}: {sketch}", exr.display(), png.display()))
    }
}

/// Name of the denoised picture of an image.
pub fn denoised_name(image: &Path) -> PathBuf {
    image.with_extension("denoised.exr")
}

/// Write a denoised picture as EXR and PNG.
pub fn write_both(path: &Path, film: &Film, meta: &DenoisedMeta, view: View) -> Result<(), ImageError> {
    write_denoised(path, film, meta)?;
    write_png(&path.with_extension("png"), film, view)
}

fn denoised(average: &Average, meta: &ImageMeta) -> Result<(Film, DenoisedMeta), String> {
    let find = |wanted: &Layer| {
        let mut both = meta.layers.iter().zip(&average.layers);
        let found = both.find(|(layer, _)| *layer == wanted);
        let (_, film) = found.ok_or_else(|| format!("there is no layer {wanted}"))?;
        Ok::<_, String>(film)
    };
    let depth = Layer::Depth.in_image(find(&Layer::Depth)?, meta.empty_depth.unwrap_or(f32::INFINITY));
    let film = denoise(&Input {
        passes: average.passes,
        beauty: &average.beauty,
        odd: find(&Layer::Odd)?,
        albedo: find(&Layer::Albedo)?,
        normal: find(&Layer::Normal)?,
        depth: depth.first().map_or(&[], |(_, values)| values),
    });
    let film = film.map_err(|error| error.to_string())?;
    Ok((film, DenoisedMeta::of(average, meta)))
}

/// A scene file as FOLDER/FILE; `None` if it does not exist.
fn name_of(scene: &Path) -> Option<String> {
    let scene = scene.canonicalize().ok()?;
    let file = scene.file_name()?.to_string_lossy();
    let name = match scene.parent().and_then(Path::file_name) {
        Some(folder) => format!("{}/{file}", folder.to_string_lossy()),
        None => file.into_owned(),
    };
    // Characters that an EXR attribute can hold.
    let name: Vec<char> = name.escape_default().collect();
    let beyond = name.len().saturating_sub(255);
    Some(name[beyond..].iter().collect())
}

/// Default names of this scene's image: STEM.exr in the current folder, and FOLDER-STEM.exr, with `ending` after the
/// stem.
pub fn default_names(scene: &Path, ending: &str) -> Vec<PathBuf> {
    let stem = scene.file_stem().unwrap_or(OsStr::new("image"));
    let named = |before: Option<&OsStr>| {
        let mut name = before.map(OsStr::to_owned).unwrap_or_default();
        name.push(if before.is_some() { "-" } else { "" });
        name.push(stem);
        name.push(ending);
        Path::new(&name).with_added_extension("exr")
    };
    let scene = scene.canonicalize().ok();
    let folder = scene.as_deref().and_then(Path::parent).and_then(Path::file_name);
    let names = [Some(named(None)), folder.map(|folder| named(Some(folder)))];
    names.into_iter().flatten().collect()
}

/// STEM.exr in the current folder, or FOLDER-STEM.exr if another scene of that name has its image there. `ending`
/// follows the stem.
///
/// Files that this command did not make are kept unless they are named.
fn default_name(scene: &Path, ending: &str, scene_file: Option<&str>) -> Result<PathBuf, Failure> {
    let names: Vec<(PathBuf, Option<Provenance>)> = default_names(scene, ending)
        .into_iter()
        .map(|path| {
            let made = Provenance::read(&path);
            (path, made)
        })
        .collect();
    let file_of = |made: &Option<Provenance>| made.as_ref().and_then(|made| made.scene_file.clone());
    let own = |(_, made): &&(PathBuf, Option<Provenance>)| file_of(made).is_some_and(|file| Some(&*file) == scene_file);
    let free = |(_, made): &&(PathBuf, Option<Provenance>)| file_of(made).is_none_or(|file| Some(&*file) == scene_file);
    let Some((path, made)) = names.iter().find(own).or_else(|| names.iter().find(free)) else {
        let taken: Vec<String> = names.iter().map(|(path, _)| path.display().to_string()).collect();
        return Err(Failure::usage(format!(
            "{}: images of other scenes; name another with -o",
            taken.join(", ")
        )));
    };
    let of_reference = ending == REFERENCE;
    match made {
        Some(made) if made.of_samples != of_reference => {
            let path = path.display();
            let command = if made.of_samples { "reference" } else { "render" };
            Err(Failure::usage(format!(
                "{path} was made by `beamfarm {command}`: -o {path} writes over it, another name keeps it"
            )))
        }
        _ => Ok(path.clone()),
    }
}
