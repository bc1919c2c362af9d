//! Choices among words: what the renderer's enums are called in scene files.

use beamfarm_image::{job, view};
use beamfarm_render::world::{light, rules, texture};
use schemars::JsonSchema;
use serde::Deserialize;

/// Types of rays.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RayType {
    /// From the camera.
    Camera,
    /// Seen in a mirror or on glass.
    Reflected,
    /// Seen through glass.
    Refracted,
    /// From a surface to a light.
    Shadow,
    /// From a light, a surface or a medium, with the light that it sends on.
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

/// How an image is interpolated.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TextureFilter {
    /// Linearly between the centres of pixels.
    #[default]
    Bilinear,
    /// Not at all.
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

/// How a spot's intensity falls to nothing.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Falloff {
    /// Linearly in the angle, as in Mitsuba.
    #[default]
    Linear,
    /// By x² (3 - 2 x), x linear in the cosine, as in Blender.
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

/// How irradiance varies across a laser's beam.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BeamProfile {
    /// The same up to the radius.
    #[default]
    Flat,
    /// As exp(-2 r² / w²) with w the radius, up to 3 w.
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

/// How an image goes on beyond its edges.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// From the other edge.
    #[default]
    Repeat,
    /// Mirrored at each edge.
    Mirror,
    /// With the pixels at its edge.
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
    /// Of the three colours.
    #[serde(rename = "luminance")]
    Luminance,
    /// A PNG's opacity, 1 where it has none.
    #[serde(rename = "a")]
    Alpha,
}

/// How the radius scale depends on the pass: once a pass, or as if it shrank after every beam.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleKind {
    /// Shrink once a pass.
    Pass,
    /// Shrink once a beam, so that the number of paths in a pass does not matter.
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

/// What finds light whose way to what the camera sees is not straight.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Technique {
    /// Photons, where camera paths look them up and end.
    Photons,
    /// Camera paths that go on.
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
    /// A device by Vulkan.
    Gpu,
    /// What is better where it is rendered.
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

/// When photons are aimed.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Targeting {
    /// Of lights where that makes far less noise.
    Auto,
    /// Never.
    Off,
    /// Of every light that is seen from somewhere.
    On,
    /// Photons that miss all targets are dropped. Biased: light that the targets do not know of is missing.
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

/// How linear radiance becomes what a screen shows.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ViewTransform {
    /// As it is, clipped.
    Standard,
    /// By a curve of film that rolls lights off.
    Filmic,
    /// AgX, as Blender has it: what is bright and colourful becomes white by degrees.
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
