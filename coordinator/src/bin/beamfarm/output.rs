//! Where images go.

use crate::failure::Failure;
use beamfarm_image::atomic::remove_leftovers;
use beamfarm_image::error::ImageError;
use beamfarm_image::exr::{ImageMeta, made_of_samples, write_image};
use beamfarm_image::merge::Average;
use beamfarm_image::png::write_png;
use beamfarm_worker::visible;
use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Print a text that people page through or cut short: a reader that goes away before its end is no failure.
pub fn print_text(text: &str) -> Result<(), Failure> {
    match io::stdout().lock().write_all(visible(text).as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::io(error)),
        _ => Ok(()),
    }
}

/// What the reference's image is called beside the scene's name.
pub const REFERENCE: &str = "-reference";

/// The two files of a picture.
#[derive(Clone, Debug)]
pub struct Output {
    pub exr: PathBuf,
    pub png: PathBuf,
    /// Whether the EXR gets the standard error.
    pub standard_error: bool,
    /// Whether the EXR is to say that photons which missed all targets were dropped.
    pub drops_photons: bool,
}

impl Output {
    /// The files that were asked for, or those named after the scene. Checks that they can be written, so that nobody
    /// learns after a night that they cannot.
    ///
    /// `ending`: of the default's stem. An image that another kind of command made is only overwritten by name.
    pub fn new(asked: Option<&Path>, scene: &Path, ending: &str, standard_error: bool) -> Result<Self, Failure> {
        let exr = match asked {
            Some(path) => path.to_owned(),
            None => {
                let stem = scene.file_stem().unwrap_or(OsStr::new("image"));
                let mut name = stem.to_owned();
                name.push(ending);
                let path = Path::new(&name).with_added_extension("exr");
                refuse_others_work(&path, ending)?;
                path
            }
        };
        if exr.extension() != Some(OsStr::new("exr")) {
            let message = format!("{}: expected a name that ends in .exr", exr.display());
            return Err(Failure::usage(message));
        }
        let folder = match exr.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let probe = tempfile::Builder::new().prefix(".beamfarm-").tempfile_in(folder);
        if let Err(error) = probe {
            let message = format!("cannot write to {}: {error}", folder.display());
            return Err(Failure::io(message));
        }
        let png = exr.with_extension("png");
        for path in [&exr, &png] {
            // Nobody is worse off than before if that cannot be done.
            let _ = remove_leftovers(path);
        }
        Ok(Self {
            exr,
            png,
            standard_error,
            drops_photons: false,
        })
    }

    /// What people call the picture: its file's name.
    pub fn title(&self) -> String {
        let stem = self.exr.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// Write both.
    pub fn write(&self, average: &Average, meta: &ImageMeta, exposure: f32) -> Result<(), ImageError> {
        write_image(&self.exr, average, meta)?;
        write_png(&self.png, &average.beauty, exposure)
    }
}

/// What this command did not make itself stays, unless somebody names it.
fn refuse_others_work(path: &Path, ending: &str) -> Result<(), Failure> {
    let Some(samples) = made_of_samples(path) else {
        return Ok(());
    };
    let of_reference = ending == REFERENCE;
    if samples == of_reference {
        return Ok(());
    }
    let path = path.display();
    let command = if samples { "reference" } else { "render" };
    Err(Failure::usage(format!(
        "{path} was made by `beamfarm {command}`: -o {path} writes over it, another name keeps it"
    )))
}
