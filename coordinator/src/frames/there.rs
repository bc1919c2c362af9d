//! Existing images of frames: whether they are what a command would make, and intact.

use super::ahead::Order;
use super::record::FrameRecord;
use crate::aov::Aov;
use crate::failure::Failure;
use crate::job::JobArgs;
use crate::output::denoised_name;
use crate::progress;
use crate::settings::Budgeted;
use beamfarm_image::error::ImageError;
use beamfarm_image::exr::{MadeOf, pixel_hash, read_rgb};
use beamfarm_image::film::Film;
use beamfarm_image::job::EngineKind;
use beamfarm_image::png::{is_sound, view_of, write_png};
use beamfarm_image::view::View;
use beamfarm_render::world::RenderDefaults;
use beamfarm_scene::SceneFile;
use std::path::Path;

impl Order {
    /// The record of a frame whose image exists and is right, with its PNG updated to the requested view; `None` if it
    /// must be rendered. An image that would be right but is damaged is reported.
    pub(super) fn kept(&self, frame: i64, args: &JobArgs, image: &Path) -> Result<Option<FrameRecord>, Failure> {
        let Some(made) = MadeOf::read(image) else {
            // An image of another program can still be read.
            if image.exists()
                && let Err(error) = read_rgb(image)
            {
                tell_damage(frame, image, &why(error));
            }
            return Ok(None);
        };
        let denoised = args.denoise.then(|| denoised_name(image));
        if !image.with_extension("png").exists() || denoised.as_ref().is_some_and(|denoised| !denoised.exists()) {
            return Ok(None);
        }
        // No pilot is needed to see that there is nothing to do.
        let file = args.settings.of.file()?;
        // Errors in the scene are reported when it is rendered.
        let Ok(defaults) = file.defaults() else {
            return Ok(None);
        };
        let view = args.view.over(defaults.view);
        if !self.is_there(frame, args, (image, &made), file)? {
            return Ok(None);
        }
        let known = self.known.get(&frame).filter(|known| known.is_of(image, &made));
        let film = match whole(image, known.and_then(|known| known.pixels.as_deref())) {
            Ok(film) => film,
            Err(damage) => {
                tell_damage(frame, image, &damage);
                return Ok(None);
            }
        };
        if let Some(denoised) = &denoised {
            match whole(denoised, None) {
                Ok(film) => show(denoised, &film, view)?,
                Err(damage) => {
                    tell_damage(frame, denoised, &damage);
                    return Ok(None);
                }
            }
        }
        show(image, &film, view)?;
        let kept = known.cloned();
        Ok(Some(kept.unwrap_or_else(|| {
            FrameRecord::kept(frame, args, image, (made, &film))
        })))
    }

    /// Whether the image is what this command would make.
    fn is_there(
        &self,
        frame: i64,
        args: &JobArgs,
        (image, made): (&Path, &MadeOf),
        file: SceneFile,
    ) -> Result<bool, Failure> {
        let defaults = file.defaults()?;
        let is_enough = match self.known.get(&frame) {
            Some(known) if known.answers(args) && known.is_of(image, made) => true,
            _ => has_passes(args, made, &defaults),
        };
        Ok(
            is_enough
                && has_settings(args, made, &defaults)
                && file.canonical_bundle().hash().to_string() == made.scene,
        )
    }
}

fn tell_damage(frame: i64, image: &Path, damage: &str) {
    let image = image.display();
    progress::complain(&format!(
        "warning: {image} is damaged ({damage}): frame {frame} is rendered anew"
    ));
}

/// All pixels of an image; an error describes the damage. `hash`: of its pixels, if known.
///
/// Headers alone are not enough: after a power loss a disk may keep them, followed by zeros.
fn whole(image: &Path, hash: Option<&str>) -> Result<Film, String> {
    let film = read_rgb(image).map_err(why)?;
    match hash.is_none_or(|hash| pixel_hash(&film) == hash) {
        true => Ok(film),
        false => Err("its pixels are not those of the report".into()),
    }
}

/// What is wrong, without the file name.
fn why(error: ImageError) -> String {
    match error {
        ImageError::File { message, .. } => message,
        ImageError::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    }
}

/// Update the PNG next to an image to this view.
fn show(image: &Path, film: &Film, view: View) -> Result<(), ImageError> {
    let png = image.with_extension("png");
    match view_of(&png) == Some(view) && is_sound(&png) {
        true => Ok(()),
        false => write_png(&png, film, view),
    }
}

/// Whether it has the requested passes. For a time or error limit, only the record of all frames can tell.
fn has_passes(args: &JobArgs, made: &MadeOf, defaults: &RenderDefaults) -> bool {
    let is_open = args.time.is_some() || args.target_error.is_some();
    match args.passes {
        Some(passes) => made.passes >= passes,
        None => !is_open && made.passes >= defaults.passes,
    }
}

/// Whether it was made with the requested settings, as far as no pilot chooses them.
fn has_settings(args: &JobArgs, made: &MadeOf, defaults: &RenderDefaults) -> bool {
    let of = &args.settings.of;
    let paths = of.paths.or(defaults.paths_per_pass).map(u64::from);
    let budget = match args.settings.budget {
        None | Some(Budgeted::Endless) => made.budget.is_none(),
        Some(Budgeted::Passes(passes)) => {
            let begins = format!("{passes} passes at ");
            made.budget.as_ref().is_some_and(|budget| budget.starts_with(&begins))
        }
    };
    // An automatic choice accepts either engine.
    let engine = args.settings.engine.unwrap_or(defaults.engine).said();
    let of_engine = |made: &str| match engine {
        Some(engine) => made == engine.identity(),
        None => EngineKind::identified(made).is_ok(),
    };
    let shown = |aov: &Aov| made.channels.iter().any(|name| name.starts_with(&aov.channels()));
    made.seed == of.seed_or(defaults.seed)
        && made.alpha == of.alpha.unwrap_or(defaults.alpha)
        && paths.is_none_or(|paths| paths == made.paths_per_pass)
        && budget
        && of_engine(&made.engine)
        && Aov::all(&args.settings.aov).iter().all(shown)
}
