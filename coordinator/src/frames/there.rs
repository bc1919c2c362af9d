//! Images of frames that are there already: whether they are those that a command would make, and whole.

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
    /// The frame whose image is there and right, shown in the view that is asked for; nothing where it is to be
    /// rendered. What would be right if it was not damaged is told.
    pub(super) fn kept(&self, frame: i64, args: &JobArgs, image: &Path) -> Result<Option<FrameRecord>, Failure> {
        let Some(made) = MadeOf::read(image) else {
            // Another program's image is one that can be read.
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
        // No pilot is needed to see that nothing is to be done.
        let file = args.settings.of.file()?;
        // What is wrong with a scene is told when it is to be rendered.
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

    /// Whether the image is the one that this command would make.
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

/// All pixels of an image; an error says what is damaged. `hash`: of its pixels, where that is known.
///
/// Headers alone do not tell: a disk that loses power may keep them, and zeros in place of what follows.
fn whole(image: &Path, hash: Option<&str>) -> Result<Film, String> {
    let film = read_rgb(image).map_err(why)?;
    match hash.is_none_or(|hash| pixel_hash(&film) == hash) {
        true => Ok(film),
        false => Err("its pixels are not those of the report".into()),
    }
}

/// What is wrong, without the name of the file.
fn why(error: ImageError) -> String {
    match error {
        ImageError::File { message, .. } => message,
        ImageError::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    }
}

/// Have the PNG beside an image show it in this view.
fn show(image: &Path, film: &Film, view: View) -> Result<(), ImageError> {
    let png = image.with_extension("png");
    match view_of(&png) == Some(view) && is_sound(&png) {
        true => Ok(()),
        false => write_png(&png, film, view),
    }
}

/// Whether it has the passes that are asked for. Where a time or an error is, the record of all frames has to say so.
fn has_passes(args: &JobArgs, made: &MadeOf, defaults: &RenderDefaults) -> bool {
    let is_open = args.time.is_some() || args.target_error.is_some();
    match args.passes {
        Some(passes) => made.passes >= passes,
        None => !is_open && made.passes >= defaults.passes,
    }
}

/// Whether it is made with the settings that are asked for, as far as no pilot chooses them.
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
    // Where it is to be found out, one of them was found.
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
