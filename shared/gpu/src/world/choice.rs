//! The choice of a light at a point, and its emission there, as in `kernels/direct.wgsl`.

use super::lights::Light;
use super::rules::{FlatRules, OfLight};
use crate::device::{Buffer, Device};
use crate::error::Result;
use beamfarm_render::math::Vec3;
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::{self, LightKind, MANY_LIGHTS, Region, Source};
use bytemuck::{Pod, Zeroable};

pub(crate) const ALL_AROUND: u32 = 0;
pub(crate) const FROM_AFAR: u32 = 1;
pub(crate) const EVERYWHERE: u32 = 2;
pub(crate) const IN_CONE: u32 = 3;
pub(crate) const BEFORE_PLANE: u32 = 4;
pub(crate) const IN_PYRAMID: u32 = 5;

/// A light, reduced to what matters for the choice, and its emission. Render space; unused fields are zero.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LightSource {
    /// Centre of the light; for directional lights, the direction of travel.
    pub center: [f32; 3],
    /// Environment, from afar, everywhere, in a cone, in front of a plane, in a pyramid: 0 to 5.
    pub region: u32,
    /// Apex of a cone or pyramid; or a point of the plane.
    pub apex: [f32; 3],
    /// Squared radius.
    pub softening: f32,
    /// Axis of a cone; or the normal of the plane.
    pub axis: [f32; 3],
    /// Mean channel of the flux per steradian, W/sr; for distant lights of the irradiance, W/m^2.
    pub intensity: f32,
    /// W/sr of a point, and of a spot on its axis; W/m^2 of directional lights; W/(m^2 sr) of surfaces and
    /// environments. With a texture, the value where the texture is one.
    pub emitted: [f32; 3],
    /// Cosine of a cone's half angle; for a sun, the sine.
    pub width: f32,
    /// The object that shadow rays to it ignore, or [`NONE`](super::NONE).
    pub unshadowing: u32,
    /// Not 0 if rays may pass its surface unseen: all its direct light comes from light sampling. 2 if paths that
    /// continue from where lights were sampled inspect it nevertheless.
    pub only_sampled: u32,
    /// Where [`LightChoices::tables`] hold the normals of a pyramid's planes.
    pub table: u32,
    /// Its own class bit.
    pub class_bit: u32,
    /// The class bit of its surface.
    pub shape_class: u32,
    /// What shadow rays to it do not see, wherever they start, as class bits.
    pub hides: u32,
    /// What its photons do not see, likewise.
    pub photon_hides: u32,
    padding: u32,
}

/// How lights are chosen, and what shadow rays test.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Lighting {
    /// Number of lights.
    pub lights: u32,
    /// 1 if there are several lights, few enough to be weighed at each point.
    pub is_weighed: u32,
    /// 1 if shadow rays must inspect what they meet.
    pub shadow_rays_walk: u32,
    /// 1: there are visibility rules.
    pub has_rules: u32,
    /// What camera rays do not see, as class bits.
    pub camera_hides: u32,
    /// What rays of paths do not see from their second vertex on, likewise.
    pub gather_hides: u32,
    /// Offset into [`LightChoices::tables`] of flags by medium and light, 1 if no light comes there straight from the
    /// light, else 0; offset 0: there are none.
    pub unlit: u32,
}

/// The data for choosing lights.
#[derive(Clone, Debug)]
pub struct LightChoices {
    /// By light number.
    pub sources: Vec<LightSource>,
    /// Running sums of their shares of the power: of sampled lights, then of all, then of those that may illuminate
    /// some surfaces; zero if none is ever chosen. Then each light's part of
    /// [`Lights::tables`](super::lights::Lights::tables), and then the flags of [`Lighting::unlit`].
    pub tables: Vec<f32>,
    /// The parameters.
    pub lighting: Lighting,
}

/// The running sums at the start of [`LightChoices::tables`].
pub(super) fn sums(scene: &Scene) -> Vec<f32> {
    let lights = scene.description().lights.len();
    let (selectors, _) = super::rules::selectors(scene);
    let sums = selectors.into_iter().map(|selector| match selector.sums() {
        [] => vec![0.0; lights],
        sums => sums.to_vec(),
    });
    sums.flatten().collect()
}

impl LightChoices {
    /// For a scene whose lights kernels support, given the lights' tables and the rules.
    #[must_use]
    pub(super) fn new(scene: &Scene, rules: &FlatRules, lights: &[Light], mut tables: Vec<f32>) -> Self {
        let sources = lights.iter().enumerate().map(|(light, flat)| {
            let OfLight {
                class,
                shape_class,
                shadow,
                photon,
            } = rules.of_light(light);
            LightSource {
                table: flat.table,
                class_bit: class,
                shape_class,
                hides: shadow,
                photon_hides: photon,
                ..source(scene, light)
            }
        });
        let count = lights.len();
        let unlit = if rules.unlit.is_empty() { 0 } else { tables.len() as u32 };
        tables.extend(rules.unlit.iter().map(|unlit| f32::from(*unlit)));
        Self {
            sources: sources.collect(),
            tables,
            lighting: Lighting {
                lights: count as u32,
                is_weighed: u32::from(count != 1 && count <= MANY_LIGHTS),
                shadow_rays_walk: u32::from(scene.shadow_rays_walk()),
                has_rules: u32::from(rules.are_there),
                camera_hides: rules.camera,
                gather_hides: rules.gather,
                unlit,
            },
        }
    }

    /// Uploads them to a device.
    ///
    /// # Errors
    /// Device errors.
    pub(super) fn upload(&self, device: &Device, there: Option<(&Self, &ChoiceBuffers)>) -> Result<ChoiceBuffers> {
        let sources = there.map(|(flat, on)| (&flat.sources[..], &on.sources));
        let tables = there.map(|(flat, on)| (&flat.tables[..], &on.tables));
        Ok(ChoiceBuffers {
            sources: super::list(device, "light sources", &self.sources, sources)?,
            tables: super::list(device, "tables of lights", &self.tables, tables)?,
            lighting: device.buffer("lighting", &[self.lighting])?,
        })
    }
}

/// [`LightChoices`] on a device.
pub struct ChoiceBuffers {
    /// Binding 31.
    pub sources: Buffer,
    /// Binding 32.
    pub tables: Buffer,
    /// Binding 33.
    pub lighting: Buffer,
}

fn source(scene: &Scene, light: usize) -> LightSource {
    let flat = match &scene.light_sources().sources[light] {
        Source::Far {
            irradiance,
            direction,
            spread,
        } => LightSource {
            center: direction.unwrap_or(Vec3::ZERO).to_array(),
            region: if direction.is_some() { FROM_AFAR } else { ALL_AROUND },
            intensity: *irradiance,
            width: *spread,
            ..LightSource::zeroed()
        },
        // Such scenes are refused.
        Source::Beam(_) => LightSource::zeroed(),
        Source::Near {
            center,
            softening,
            intensity,
            region,
        } => LightSource {
            center: center.to_array(),
            softening: *softening,
            intensity: *intensity,
            ..within(region)
        },
    };
    LightSource {
        emitted: emitted(&scene.description().lights[light]),
        unshadowing: scene.unshadowing()[light].unwrap_or(super::NONE),
        only_sampled: match (scene.only_sampled(light), scene.only_sampled_by_paths(light)) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => 2,
        },
        ..flat
    }
}

fn within(region: &Region) -> LightSource {
    let (region, apex, axis, width) = match region {
        Region::Everywhere => (EVERYWHERE, Vec3::ZERO, Vec3::ZERO, 0.0),
        // Planes are in a table.
        Region::Pyramid { apex, planes: _ } => (IN_PYRAMID, *apex, Vec3::ZERO, 0.0),
        Region::Cone { apex, axis, cos } => (IN_CONE, *apex, *axis, *cos),
        Region::Before { point, normal } => (BEFORE_PLANE, *point, *normal, 0.0),
    };
    LightSource {
        region,
        apex: apex.to_array(),
        axis: axis.to_array(),
        width,
        ..LightSource::zeroed()
    }
}

fn emitted(light: &light::Light) -> [f32; 3] {
    let emitted = match &light.kind {
        LightKind::Point { intensity, .. } => *intensity,
        LightKind::Spot(spot) => spot.intensity,
        LightKind::Directional(sun) => sun.fluence(),
        LightKind::Area { radiance, pattern, .. } => pattern.as_ref().map_or(*radiance, |pattern| pattern.scale()),
        LightKind::Environment(environment) => match environment.map() {
            Some(map) => map.scale,
            None => environment.constant().unwrap_or(Vec3::ZERO),
        },
        LightKind::Projector(projector) => projector.intensity,
        LightKind::Goniometric(lamp) => lamp.scale,
        LightKind::Laser(laser) => laser.irradiance,
        // Such scenes are refused.
        LightKind::Volume(_) => Vec3::ZERO,
    };
    emitted.to_array()
}

#[cfg(test)]
mod tests;
