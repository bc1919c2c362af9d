//! Light sources: their emission, and how photons and shadow rays sample them.

pub(crate) mod cdf;
mod direct;
pub(crate) mod emission;
pub(crate) mod environment;
mod goniometric;
mod laser;
mod local;
mod pattern;
mod projector;
mod segment;
mod selector;
mod soft;
mod source;
mod spot;
mod spread;
mod sun;
mod volume;

pub use environment::{Environment, EnvironmentMap, EnvironmentSample, ImagePoint};
pub use goniometric::{AngularTable, Goniometric};
pub use laser::{Laser, Profile};
pub use local::LocalChoice;
pub use pattern::Pattern;
pub use projector::{Projector, lit_part};
pub use segment::{FogSegment, SegmentSample};
pub use selector::{LightChoice, LightSelector};
pub use soft::{SoftBall, SoftLine};
pub use source::{LightSources, MAX_WEIGHED as MANY_LIGHTS, Region, Source};
pub use spot::{Ramp, Spot};
pub use spread::Spread;
pub use sun::Sun;
pub use volume::{BlackBodies, Dark, EmissionField, Filled, Heat, VolumeEmission, VolumeLight};

use crate::math::{PI, Rgb, Vec2, Vec3};
use crate::world::geometry::Object;
use crate::world::texture::TexturePoint;
use beamfarm_image::layer::LightGroup;
use std::sync::Arc;

/// A light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name in the scene file, for messages.
    pub name: String,
    /// The kind and its parameters.
    pub kind: LightKind,
    /// The lights that share a layer with this one.
    pub group: LightGroup,
}

/// The kinds of lights. All values linear RGB.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// Isotropic point light.
    Point {
        /// Position, render space.
        position: Vec3,
        /// W/sr.
        intensity: Rgb,
    },
    /// A cone of light, from a point or from a ball that rays do not meet.
    Spot(Spot),
    /// A lamp that projects an image.
    Projector(Projector),
    /// A lamp with an intensity table over directions.
    Goniometric(Goniometric),
    /// Parallel light from a disc that rays do not meet.
    Laser(Laser),
    /// Light from infinitely far away, in one direction or a cone, that rays do not meet.
    Directional(Sun),
    /// A surface that emits on the side that its geometric normal points to, or on both, uniformly in all directions or
    /// in a cone.
    Area {
        /// Index into the scene's objects.
        object: u32,
        /// W/(m^2 sr); the mean if it varies. With a spread, that of a surface of the same power without one.
        radiance: Rgb,
        /// Variation over the surface, if any.
        pattern: Option<Arc<Pattern>>,
        /// Whether it emits on both sides.
        two_sided: bool,
        /// The cone around the normals that it emits into, if not the whole hemisphere.
        spread: Option<Spread>,
        /// For a ball that lets all light pass: whether its falloff is soft, see [`SoftBall`].
        soft: bool,
    },
    /// Radiance from all around.
    Environment(Environment),
    /// A medium that emits.
    Volume(Arc<VolumeLight>),
}

impl LightKind {
    /// The emitting object, if the light has one.
    #[inline]
    pub fn object(&self) -> Option<u32> {
        match self {
            Self::Area { object, .. } => Some(*object),
            Self::Point { .. }
            | Self::Spot(_)
            | Self::Projector(_)
            | Self::Goniometric(_)
            | Self::Laser(_)
            | Self::Directional(_)
            | Self::Environment(_)
            | Self::Volume(_) => None,
        }
    }

    /// No ray can meet it by chance.
    pub fn is_unmet(&self) -> bool {
        match self {
            Self::Point { .. }
            | Self::Spot(_)
            | Self::Projector(_)
            | Self::Goniometric(_)
            | Self::Laser(_)
            | Self::Directional(_) => true,
            Self::Area { .. } | Self::Environment(_) | Self::Volume(_) => false,
        }
    }
}

/// The start of a photon path.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// Start.
    pub origin: Vec3,
    /// Unit direction of travel.
    pub dir: Vec3,
    /// Geometric normal at the start for area lights, to offset the ray by.
    pub normal: Option<Vec3>,
    /// Flux that this sample would carry if it were the only one: Le cos / (pdf_position pdf_direction), W.
    pub power: Rgb,
    /// Density of the direction per solid angle (infinite for parallel light).
    pub pdf_dir: f32,
    /// Density of the position per area; for spots that are balls, across the direction; infinite for point lights.
    pub pdf_pos: f32,
    /// Triangle of a mesh that emits.
    pub primitive: u32,
}

/// Light towards a point, for shadow rays.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// Unit normal of the light at the sampled point; the opposite direction, if it has none.
    pub normal: Vec3,
    /// Triangle of a mesh that emits.
    pub primitive: u32,
    /// Distance, infinite for directional and environment lights.
    pub distance: f32,
    /// Radiance towards the point over `pdf`; for point and parallel lights, the irradiance across `wi`. Excludes
    /// visibility and media.
    pub weight: Rgb,
    /// Density per solid angle; 1 for point and parallel lights.
    pub pdf: f32,
    /// No ray can meet the light by chance.
    pub unmet: bool,
}

/// A point on an area light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Unit geometric normal, pointing outside.
    pub normal: Vec3,
    /// Triangle within a mesh.
    pub primitive: u32,
}

/// Where a ray met a light.
#[derive(Clone, Copy, Debug)]
pub struct LightHit {
    /// Unit geometric normal, pointing outside.
    pub normal: Vec3,
    /// Triangle within a mesh.
    pub primitive: u32,
    /// Distance along the ray.
    pub distance: f32,
}

/// A sphere around everything that can be hit, render space.
#[derive(Clone, Copy, Debug)]
pub struct SceneBounds {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
}

/// Uniform numbers for one emission.
#[derive(Clone, Copy, Debug)]
pub struct EmissionUniforms {
    /// Position on the light.
    pub position: Vec2,
    /// Direction.
    pub direction: Vec2,
    /// Primitive of a mesh, or depth in a ball.
    pub primitive: f32,
}

impl Light {
    /// Total emission into the scene, W. For infinitely distant lights, the flux through the disc that covers the
    /// bounds.
    pub fn power(&self, objects: &[Object], bounds: &SceneBounds) -> Rgb {
        match &self.kind {
            LightKind::Point { intensity, .. } => *intensity * (4.0 * PI),
            LightKind::Spot(spot) => spot.intensity * spot.solid_angle(),
            LightKind::Projector(projector) => projector.power(),
            LightKind::Goniometric(lamp) => lamp.power(),
            LightKind::Laser(laser) => laser.power(),
            LightKind::Directional(sun) => sun.fluence() * bounds.disc_area(),
            LightKind::Area { object, radiance, .. } => {
                *radiance * (self.sides() * PI * objects[*object as usize].shape.area())
            }
            LightKind::Environment(environment) => environment.fluence() * bounds.disc_area(),
            LightKind::Volume(light) => light.power(),
        }
    }

    /// Radiance that an area light emits from a point at an angle to its geometric normal, W/(m^2 sr); zero for other
    /// kinds.
    #[inline]
    pub fn radiance_area(&self, cos: f32, at: &TexturePoint) -> Rgb {
        match &self.kind {
            LightKind::Area {
                radiance,
                pattern,
                two_sided,
                spread,
                ..
            } if cos > 0.0 || *two_sided => {
                let radiance = match pattern {
                    None => *radiance,
                    Some(pattern) => pattern.radiance(at),
                };
                match spread {
                    None => radiance,
                    Some(spread) => radiance * spread.share(cos.abs()),
                }
            }
            LightKind::Area { .. }
            | LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            | LightKind::Environment(_)
            | LightKind::Volume(_) => Rgb::ZERO,
        }
    }

    /// Number of sides of a surface that emit.
    #[inline]
    pub(crate) fn sides(&self) -> f32 {
        if self.is_two_sided() { 2.0 } else { 1.0 }
    }

    /// Whether it is an area light that emits on both sides.
    #[inline]
    pub(crate) fn is_two_sided(&self) -> bool {
        matches!(self.kind, LightKind::Area { two_sided: true, .. })
    }

    /// The cone that an area light emits into, if it does not emit in all directions.
    #[inline]
    pub(crate) fn spread(&self) -> Option<&Spread> {
        match &self.kind {
            LightKind::Area { spread, .. } => spread.as_ref(),
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            | LightKind::Environment(_)
            | LightKind::Volume(_) => None,
        }
    }

    /// Projected solid angle of an area light's photons, which are uniform in it. `cos`: of the angle to the normal;
    /// infinite where no photon leaves at that angle.
    #[inline]
    pub(crate) fn projected_solid_angle(&self, cos: f32) -> f32 {
        match self.spread() {
            None => self.sides() * PI,
            Some(spread) if spread.holds(cos) => self.sides() * PI * spread.projected(),
            Some(_) => f32::INFINITY,
        }
    }

    /// Whether it is an area light whose radiance varies over its surface.
    pub(crate) fn has_pattern(&self) -> bool {
        matches!(self.kind, LightKind::Area { pattern: Some(_), .. })
    }

    /// Whether its radiance varies with texture coordinates.
    pub fn reads_uv(&self) -> bool {
        matches!(&self.kind, LightKind::Area { pattern: Some(pattern), .. } if pattern.reads_uv())
    }
}

impl SceneBounds {
    /// Area of the disc that the sphere covers, seen from afar.
    #[inline]
    pub(crate) fn disc_area(&self) -> f32 {
        PI * self.radius * self.radius
    }
}
