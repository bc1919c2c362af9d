//! Word choices: the renderer's enums as scene files name them.

use beamfarm_image::{job, view};
use beamfarm_render::world::{light, rules, texture};
use schemars::JsonSchema;
use serde::Deserialize;

/// Ray types.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RayType {
    /// From the camera.
    Camera,
    /// Seen by reflection in a mirror, glass, metal or coat.
    Reflected,
    /// Seen through glass.
    Refracted,
    /// From a surface towards a light.
    Shadow,
    /// From a light, surface or medium, carrying its light onwards.
    Photon,
}

impl From<RayType> for rules::RayType {
    fn from(word: RayType) -> Self {
        match word {
            RayType::Camera => Self::Camera,
            RayType::Reflected => Self::Reflected,
            RayType::Refracted => Self::Refracted,
            RayType::Shadow => Self::Shadow,
            RayType::Photon => Self::Photon,
        }
    }
}

/// Interpolation of an image.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TextureFilter {
    /// Linear between pixel centres.
    #[default]
    Bilinear,
    /// None: the nearest pixel.
    Nearest,
}

impl From<TextureFilter> for texture::TextureFilter {
    fn from(word: TextureFilter) -> Self {
        match word {
            TextureFilter::Bilinear => Self::Bilinear,
            TextureFilter::Nearest => Self::Nearest,
        }
    }
}

/// Falloff of a spot's intensity.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Falloff {
    /// Linear in the angle, as in Mitsuba.
    #[default]
    Linear,
    /// x² (3 - 2 x), with x linear in the cosine, as in Blender.
    Smooth,
}

impl From<Falloff> for light::Ramp {
    fn from(word: Falloff) -> Self {
        match word {
            Falloff::Linear => Self::Linear,
            Falloff::Smooth => Self::Smooth,
        }
    }
}

/// Irradiance profile across a laser's beam.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BeamProfile {
    /// Constant up to the radius.
    #[default]
    Flat,
    /// exp(-2 r² / w²) with the radius w, up to 3 w.
    Gaussian,
}

impl From<BeamProfile> for light::Profile {
    fn from(word: BeamProfile) -> Self {
        match word {
            BeamProfile::Flat => Self::Flat,
            BeamProfile::Gaussian => Self::Gaussian,
        }
    }
}

/// Wrapping of an image beyond its edges.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Mirror at each edge.
    Mirror,
    /// Extend the edge pixels.
    Clamp,
}

impl From<Wrap> for texture::Wrap {
    fn from(word: Wrap) -> Self {
        match word {
            Wrap::Repeat => Self::Repeat,
            Wrap::Mirror => Self::Mirror,
            Wrap::Clamp => Self::Clamp,
        }
    }
}

/// One channel of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, JsonSchema)]
pub enum Channel {
    /// Red.
    #[serde(rename = "r")]
    Red,
    /// Green.
    #[serde(rename = "g")]
    Green,
    /// Blue.
    #[serde(rename = "b")]
    Blue,
    /// Luminance of the three colours.
    #[serde(rename = "luminance")]
    Luminance,
    /// Opacity of a PNG; 1 if it has none.
    #[serde(rename = "a")]
    Alpha,
}

/// How often the radius scale shrinks: once a pass, or as if after every beam.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleKind {
    /// Shrink once a pass.
    Pass,
    /// Shrink once a beam, so that the number of paths per pass does not matter.
    Beam,
}

impl From<ScheduleKind> for job::ScheduleKind {
    fn from(word: ScheduleKind) -> Self {
        match word {
            ScheduleKind::Pass => Self::Pass,
            ScheduleKind::Beam => Self::Beam,
        }
    }
}

/// The technique for indirect light.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Technique {
    /// Photons: camera paths look them up and end.
    Photons,
    /// Camera paths, which continue.
    Paths,
}

impl From<Technique> for job::Technique {
    fn from(word: Technique) -> Self {
        match word {
            Technique::Photons => Self::Photons,
            Technique::Paths => Self::Paths,
        }
    }
}

/// What renders passes.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// Processors.
    Cpu,
    /// A Vulkan device.
    Gpu,
    /// Whichever is better on the machine that renders.
    Auto,
}

impl From<Engine> for job::EngineChoice {
    fn from(word: Engine) -> Self {
        match word {
            Engine::Cpu => Self::Is(job::EngineKind::Cpu),
            Engine::Gpu => Self::Is(job::EngineKind::Gpu),
            Engine::Auto => Self::Auto,
        }
    }
}

/// Whether photons are aimed.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Targeting {
    /// Only those of lights where that greatly reduces noise.
    Auto,
    /// Never.
    Off,
    /// Those of every light that is seen from somewhere.
    On,
    /// Drop photons that miss all targets. Biased: light that the targets do not know of is missing.
    Reject,
}

impl From<Targeting> for job::Targeting {
    fn from(word: Targeting) -> Self {
        match word {
            Targeting::Auto => Self::Auto,
            Targeting::Off => Self::Off,
            Targeting::On => Self::On,
            Targeting::Reject => Self::Reject,
        }
    }
}

/// Conversion of linear radiance for display.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ViewTransform {
    /// Unchanged, clipped.
    Standard,
    /// A film curve that rolls off highlights.
    Filmic,
    /// AgX as in Blender: bright saturated colours gradually become white.
    Agx,
}

impl From<ViewTransform> for view::ViewTransform {
    fn from(word: ViewTransform) -> Self {
        match word {
            ViewTransform::Standard => Self::Standard,
            ViewTransform::Filmic => Self::Filmic,
            ViewTransform::Agx => Self::Agx,
        }
    }
}
