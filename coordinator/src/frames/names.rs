//! Names of the frames' images and of their report.

use crate::failure::Failure;
use crate::job::JobArgs;
use crate::output::{default_names, make_folder};
use beamfarm_scene::numbered;
use std::path::{Path, PathBuf};

/// File names of the frames.
#[derive(Clone, Debug)]
pub struct Names {
    /// The requested name, with a run of `#`.
    asked: Option<PathBuf>,
    /// Parent of the frames' job folders, if requested.
    jobs: Option<PathBuf>,
    /// The scene file.
    scene: PathBuf,
}

impl Names {
    /// The requested names, or names derived from the scene.
    pub fn new(args: &JobArgs) -> Result<Self, Failure> {
        if let Some(path) = &args.output {
            let name = path.file_name().map(|name| name.to_string_lossy());
            if !name.is_some_and(|name| name.contains('#') && name.ends_with(".exr")) {
                return Err(Failure::usage(format!(
                    "--frames: {}: expected a name with a run of # for the frame's number that ends in .exr, as in \
                     frame.####.exr",
                    path.display()
                )));
            }
            // Frames usually get a folder of their own.
            if let Some(folder) = path.parent() {
                make_folder(folder)?;
            }
        }
        Ok(Self {
            asked: args.output.clone(),
            jobs: args.job.clone(),
            scene: args.settings.of.scene.clone(),
        })
    }

    /// A frame's image, if a name was requested.
    pub fn image(&self, frame: i64) -> Option<PathBuf> {
        let asked = self.asked.as_ref()?;
        let name = asked.file_name()?.to_string_lossy();
        Some(asked.with_file_name(numbered(&name, frame)))
    }

    /// Possible images of a frame: the requested one, or those with default names.
    pub fn images(&self, frame: i64) -> Vec<PathBuf> {
        match self.image(frame) {
            Some(image) => vec![image],
            None => default_names(&self.scene, &Self::ending(frame)),
        }
    }

    /// Suffix of a frame's default image name.
    pub fn ending(frame: i64) -> String {
        numbered(".####", frame)
    }

    /// A frame's job folder, if requested.
    pub fn job(&self, frame: i64) -> Option<PathBuf> {
        Some(self.jobs.as_ref()?.join(numbered("####", frame)))
    }

    /// A title for all frames: the name without its suffix.
    fn title(&self) -> String {
        match self.asked.as_deref().and_then(Path::file_stem) {
            Some(stem) => stem.to_string_lossy().into_owned(),
            None => {
                let stem = self.scene.file_stem().unwrap_or_default();
                format!("{}.####", stem.to_string_lossy())
            }
        }
    }

    /// The report on all frames: next to the images, named like them without the number.
    pub fn report(&self) -> PathBuf {
        let title = self.title();
        let plain: String = match title.rfind('#') {
            Some(last) => {
                let before = title[..=last].trim_end_matches('#');
                format!("{}{}", before.trim_end_matches(['.', '_', '-']), &title[last + 1..])
            }
            None => title,
        };
        let plain = if plain.is_empty() { "frames".into() } else { plain };
        let name = format!("{plain}.report.json");
        self.asked
            .as_ref()
            .map_or_else(|| PathBuf::from(&name), |asked| asked.with_file_name(&name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_run_is_the_number() {
        let names = |asked: Option<&str>| Names {
            asked: asked.map(PathBuf::from),
            jobs: Some("jobs".into()),
            scene: "there/disco.toml".into(),
        };
        let own = names(Some("out#/frame.####.exr"));
        assert_eq!(own.image(12), Some("out#/frame.0012.exr".into()));
        assert_eq!(own.job(12), Some("jobs/0012".into()));
        assert_eq!(own.title(), "frame.####");
        assert_eq!(own.report(), PathBuf::from("out#/frame.report.json"));
        assert_eq!(names(Some("##_a.exr")).report(), PathBuf::from("_a.report.json"));
        assert_eq!(names(Some("####.exr")).report(), PathBuf::from("frames.report.json"));
        assert_eq!(own.images(12), [PathBuf::from("out#/frame.0012.exr")]);
        let default = names(None);
        assert_eq!(default.images(12), [PathBuf::from("disco.0012.exr")]);
        assert_eq!((default.image(1), Names::ending(-3)), (None, ".-003".into()));
        assert_eq!(default.report(), PathBuf::from("disco.report.json"));
    }
}
