//! The layers that are rendered in addition to the image, from the command line.

use beamfarm_image::layer::{LIGHT, Layer};
use beamfarm_render::plan::aov::light_layers;
use beamfarm_render::world::SceneDescription;
use clap::ValueEnum;

/// What `--aov` takes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
#[value(rename_all = "snake_case")]
pub enum Aov {
    /// A: share of the pixel that surfaces and media cover. R, G, B are premultiplied; an environment that the camera
    /// sees is in them as well
    Alpha,
    /// Z: distance of the first surface along the camera's axis, scene units; where there is none, infinite, or the
    /// scene's `empty_depth`
    Depth,
    /// X, Y, Z: its shading normal, world space
    Normal,
    /// R, G, B: its reflectance
    Albedo,
    /// R, G, B: lights that the camera sees, and direct light on surfaces
    Direct,
    /// R, G, B: all other light of surfaces. The beauty is direct + surface + volume
    Surface,
    /// R, G, B: light that media scatter towards the camera
    Volume,
    /// light_NAME.R, G, B for each group of lights: what comes from it. The beauty is their sum
    Lights,
    /// R, G, B: standard error of the beauty
    Stderr,
    /// u, v: how the first surface moves in the image, pixels a frame, to the right and up. Where each frame is a file
    /// of its own, the shutter must be open
    Motion,
    /// Y: photon beams that a pass finds in the pixel
    BeamDensity,
    /// Y: photon targets before the first surface, or on it. Where the scene's targeting is "reject", photons that miss
    /// them are dropped, and the image is biased
    Targets,
    /// R, G, B: what passes of odd index add to the beauty, for `beamfarm denoise`: about half of it, whose noise does
    /// not depend on that of the other half
    Odd,
    /// CryptoObject00 to 02: which objects cover the pixel, by the convention of Cryptomatte
    CryptoObject,
    /// CryptoMaterial00 to 02: which materials do
    CryptoMaterial,
    /// All of them
    All,
}

impl Aov {
    /// The layers that denoising needs.
    pub const DENOISING: [Self; 4] = [Self::Depth, Self::Normal, Self::Albedo, Self::Odd];

    /// The requested layers, each once.
    pub fn all(asked: &[Self]) -> Vec<Self> {
        let wanted = |aov: &Self| asked.contains(aov) || asked.contains(&Self::All);
        let kinds = Self::value_variants().iter().copied();
        kinds.filter(wanted).collect()
    }

    /// Prefix of its channels' names in an image.
    pub fn channels(self) -> String {
        match self {
            Self::Lights => LIGHT.into(),
            Self::Stderr => "stderr.".into(),
            _ => self.layer().map_or(String::new(), |layer| layer.prefix()),
        }
    }

    pub fn layers(self, description: &SceneDescription) -> Vec<Layer> {
        match self {
            Self::Lights => light_layers(description),
            _ => self.layer().into_iter().collect(),
        }
    }

    /// The corresponding layer, if it is one.
    fn layer(self) -> Option<Layer> {
        let value = self.to_possible_value()?;
        value.get_name().parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Layers and options have the same names.
    #[test]
    fn channels_are_those_of_layers() {
        let of = |aov: Aov| (aov.layer().is_some(), aov.channels());
        for (aov, prefix) in [
            (Aov::Alpha, "A"),
            (Aov::Depth, "depth."),
            (Aov::BeamDensity, "beam_density."),
            (Aov::CryptoObject, "CryptoObject"),
            (Aov::CryptoMaterial, "CryptoMaterial"),
        ] {
            assert_eq!(of(aov), (true, prefix.to_string()));
        }
        let others: Vec<Aov> = (Aov::value_variants().iter().copied())
            .filter(|aov| aov.layer().is_none())
            .collect();
        assert_eq!(others, [Aov::Lights, Aov::Stderr, Aov::All]);
        assert_eq!(Aov::Lights.channels(), "light_");
    }
}
