//! How the PNG shows radiance, from the command line.

use beamfarm_image::view::{View, ViewTransform, white};
use clap::{Args, ValueEnum};

#[derive(Args, Clone, Debug)]
pub struct ViewArgs {
    /// How the PNG shows radiance [default: the scene's, or standard]
    ///
    /// The EXR stays linear.
    #[arg(long, value_name = "VIEW", value_enum, help_heading = "Output")]
    view: Option<Shown>,

    /// Exposure of the PNG in stops; 1 doubles the brightness [default: the scene's, or 0]
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = stops, help_heading = "Output")]
    exposure: Option<f32>,

    /// Temperature of the light that looks white in the PNG, 1000 to 25000 K [default: the scene's, or 6500]
    #[arg(long, value_name = "K", value_parser = kelvin, help_heading = "Output")]
    white_balance: Option<f32>,
}

/// What `--view` takes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    /// As it is, clipped
    Standard,
    /// By a curve of film that rolls lights off (Hable 2010)
    Filmic,
    /// AgX, Blender's default: what is bright and colourful becomes white by degrees
    Agx,
}

impl ViewArgs {
    /// The requested view, with the rest from `view`.
    pub fn over(&self, view: View) -> View {
        View {
            transform: self.view.map_or(view.transform, |shown| match shown {
                Shown::Standard => ViewTransform::Standard,
                Shown::Filmic => ViewTransform::Filmic,
                Shown::Agx => ViewTransform::Agx,
            }),
            exposure: self.exposure.unwrap_or(view.exposure),
            white_balance: self.white_balance.unwrap_or(view.white_balance),
        }
    }
}

fn stops(text: &str) -> Result<f32, String> {
    let stops = text.trim().parse().ok().filter(|stops: &f32| stops.is_finite());
    stops.ok_or_else(|| "expected a number of stops".into())
}

/// With or without the unit.
fn kelvin(text: &str) -> Result<f32, String> {
    let number = text.trim().trim_end_matches(['K', 'k']).trim_end();
    let kelvin = number.parse().ok().filter(|kelvin| white::RANGE.contains(kelvin));
    kelvin.ok_or_else(|| "expected a temperature from 1000 to 25000 kelvin".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temperatures_are_kelvin_within_a_range() {
        for (text, expected) in [("3200", 3200.0), ("2856K", 2856.0), ("25000 K", 25_000.0)] {
            assert_eq!(kelvin(text), Ok(expected), "{text}");
        }
        for text in ["", "K", "999", "25001", "nan", "-3000", "warm"] {
            assert!(kelvin(text).is_err(), "{text}");
        }
        assert_eq!(stops("-1.5"), Ok(-1.5));
        for text in ["", "inf", "nan", "1e99", "x"] {
            assert!(stops(text).is_err(), "{text}");
        }
    }
}
