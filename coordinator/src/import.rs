//! Command-line options for reading and changing a scene.

use crate::failure::Failure;
use beamfarm_scene::{Edits, ImportOptions, is_mitsuba};
use beamfarm_worker::complain;
use clap::Args;
use std::num::ParseFloatError;
use std::path::{Path, PathBuf};

/// Print on stderr what became of a scene.
pub fn announce(notes: &[String], left_out: &[String]) {
    for note in notes {
        complain!("note: {note}");
    }
    for part in left_out {
        complain!("left out: {part}");
    }
}

/// The scene field that selects the frame to render.
const FRAME: &str = "animation.frame";

/// How a scene is read, and what is changed of it.
#[derive(Args, Clone, Debug, Default)]
pub struct ImportArgs {
    /// Set a field of the scene, as in -D camera.fov=40; may be repeated
    ///
    /// Further examples: -D lights.0.power=100, -D materials.glass.ior=1.33. In a Mitsuba scene it sets the value of
    /// $NAME.
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parameter, help_heading = "Scene")]
    pub parameters: Vec<(String, String)>,

    /// Scale the size of the image: 50%, or 0.5
    #[arg(long, value_name = "S", value_parser = scale, conflicts_with_all = ["width", "height"])]
    #[arg(help_heading = "Image")]
    pub scale: Option<f64>,

    /// Width in pixels; without --height the image keeps its proportions [default: the scene's]
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Image")]
    pub width: Option<u32>,

    /// Height in pixels; without --width the image keeps its proportions [default: the scene's]
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Image")]
    pub height: Option<u32>,

    /// Render only this window: X,Y,W,H in pixels, from the upper left
    #[arg(long, value_name = "X,Y,W,H", value_parser = crop, help_heading = "Image")]
    pub crop: Option<[u32; 4]>,

    /// Leave out unsupported parts of a Mitsuba scene instead of failing
    ///
    /// What is left out is listed.
    #[arg(long, help_heading = "Scene")]
    skip_unsupported: bool,

    /// Let glass, water and diamond that a Mitsuba scene names disperse light
    ///
    /// They then bend light of each wavelength by another angle.
    #[arg(long, help_heading = "Scene")]
    spectral: bool,

    /// Let meshes, .mtl, glTF and included files name files in this folder, too; may be repeated
    ///
    /// What the scene file names itself may lie anywhere.
    #[arg(long, value_name = "DIR", help_heading = "Scene")]
    pub allow_outside: Vec<PathBuf>,

    /// Fail if there is any note on the scene
    ///
    /// Notes name what is not as it should be and could look wrong: glass that is open, media that overlap, fields that
    /// have no effect.
    #[arg(long, help_heading = "Scene")]
    strict: bool,

    /// Read the scene at this frame.
    #[arg(skip)]
    pub frame: Option<i64>,
}

fn parameter(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE".to_owned()),
    }
}

/// A number or a percentage.
pub fn share(text: &str) -> Result<f64, ParseFloatError> {
    match text.strip_suffix('%') {
        Some(percent) => percent.trim_end().parse::<f64>().map(|n| n / 100.0),
        None => text.parse(),
    }
}

fn scale(text: &str) -> Result<f64, String> {
    match share(text) {
        Ok(number) if number > 0.0 && number <= 1000.0 => Ok(number),
        _ => Err("expected a percentage as in 50%, or a factor as in 0.5".into()),
    }
}

fn crop(text: &str) -> Result<[u32; 4], String> {
    let numbers: Result<Vec<u32>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let window = numbers.ok().and_then(|numbers| <[u32; 4]>::try_from(numbers).ok());
    let window = window.filter(|[_, _, width, height]| *width > 0 && *height > 0);
    window.ok_or_else(|| "expected X,Y,W,H as in 100,50,320,240".into())
}

impl ImportArgs {
    /// Whether the command line sets the frame.
    pub fn says_frame(&self) -> bool {
        self.parameters.iter().any(|(name, _)| name == FRAME)
    }

    /// Fails if notes on the scene are errors and there are any.
    pub fn refuse(&self, notes: &[String]) -> Result<(), Failure> {
        if !self.strict || notes.is_empty() {
            return Ok(());
        }
        announce(notes, &[]);
        let count = notes.len();
        let noun = if count == 1 { "note" } else { "notes" };
        Err(Failure::usage(format!(
            "{count} {noun} on the scene, and --strict allows none"
        )))
    }

    /// Options for the scene's reader.
    pub fn options(&self, scene: &Path) -> Result<ImportOptions, Failure> {
        let is_mitsuba = is_mitsuba(scene);
        if !is_mitsuba && self.skip_unsupported {
            let path = scene.display();
            let message = format!("{path}: --skip-unsupported is for Mitsuba scenes, whose names end in .xml");
            return Err(Failure::usage(message));
        }
        if !is_mitsuba && self.spectral {
            let path = scene.display();
            let message = format!(
                "{path}: --spectral is for Mitsuba scenes, whose names end in .xml; here a material says `ior = {{ preset \
                 = \"bk7\" }}`"
            );
            return Err(Failure::usage(message));
        }
        let (parameters, mut fields) = match is_mitsuba {
            true => (self.parameters.clone(), Vec::new()),
            false => (Vec::new(), self.parameters.clone()),
        };
        fields.extend(self.frame.map(|frame| (FRAME.to_owned(), frame.to_string())));
        Ok(ImportOptions {
            parameters,
            skip_unsupported: self.skip_unsupported,
            spectral: self.spectral,
            allow_outside: self.allow_outside.clone(),
            edits: Edits {
                fields,
                width: self.width,
                height: self.height,
                scale: self.scale,
                crop: self.crop,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_factors_and_windows_have_four_sides() {
        for (text, expected) in [("50%", 0.5), ("0.25", 0.25), ("200 %", 2.0)] {
            assert_eq!(scale(text), Ok(expected), "{text}");
        }
        assert_eq!(crop("1, 2,3,4"), Ok([1, 2, 3, 4]));
        for text in ["", "0", "-1", "nan", "x%"] {
            assert!(scale(text).is_err() && crop(text).is_err(), "{text}");
        }
        for text in ["1,2,3", "1,2,3,0", "1,2,3,4,5", "1,2,-3,4"] {
            assert!(crop(text).is_err(), "{text}");
        }
    }
}
