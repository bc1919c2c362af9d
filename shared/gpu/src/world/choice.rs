//! Which light is chosen at a point, and what it emits there, as `kernels/direct.wgsl` has it.

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

/// A light reduced to what matters for choosing it, and what it emits. Render space; what is not used is zero.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LightSource {
    /// Middle of the light; of what is directional, the direction of travel.
    pub center: [f32; 3],
    /// All around, from afar, everywhere, in a cone, before a plane, in a pyramid: 0 to 5.
    pub region: u32,
    /// Of a cone or pyramid; or a point of the plane.
    pub apex: [f32; 3],
    /// Square of its radius.
    pub softening: f32,
    /// Of a cone; or the normal of the plane.
    pub axis: [f32; 3],
    /// Mean channel of the flux per steradian, W/sr; of the irradiance of what comes from afar, W/m^2.
    pub intensity: f32,
    /// W/sr of a point, and of a spot on its axis; W/m^2 of what is directional; W/(m^2 sr) of surfaces and of what is
    /// all around. With a texture, where that is one.
    pub emitted: [f32; 3],
    /// Cosine of a cone's half angle; the sine of that of a sun.
    pub width: f32,
    /// The object that shadow rays to it pass through, or [`NONE`](super::NONE).
    pub unshadowing: u32,
    /// Not 0 where rays may pass its surface unseen: all of its direct light is that of samples. 2 where paths that go
    /// on from where lights were sampled look at it nevertheless.
    pub only_sampled: u32,
    /// Where normals of a pyramid's planes are in [`LightChoices::tables`].
    pub table: u32,
    /// Its own bit of classes.
    pub class_bit: u32,
    /// That of its surface.
    pub shape_class: u32,
    /// What shadow rays to it do not see wherever they start, by bits of classes.
    pub hides: u32,
    /// What its photons do not see, likewise.
    pub photon_hides: u32,
    padding: u32,
}

/// How lights are chosen, and what shadow rays look at.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Lighting {
    /// How many there are.
    pub lights: u32,
    /// 1 where lights are few enough to be weighed at each point, and more than one.
    pub is_weighed: u32,
    /// 1 where shadow rays have to look at what they pass.
    pub shadow_rays_walk: u32,
    /// 1: there are rules of what rays see.
    pub has_rules: u32,
    /// What rays from the camera do not see, by bits of classes.
    pub camera_hides: u32,
    /// What rays of paths from their second vertex on do not see, likewise.
    pub gather_hides: u32,
    /// Where [`LightChoices::tables`] say by medium and light, 1 or 0, that nothing of it comes there straight; 0:
    /// nowhere.
    pub unlit: u32,
}

/// What lights are chosen by.
#[derive(Clone, Debug)]
pub struct LightChoices {
    /// By their numbers in the scene.
    pub sources: Vec<LightSource>,
    /// Running sums of their shares of the power: of those aimed at, then of all, then of those that some surfaces are
    /// lit by; zero where none is ever chosen. Then what [`Lights::tables`](super::lights::Lights::tables) has of each
    /// light, and then what [`Lighting::unlit`] says.
    pub tables: Vec<f32>,
    /// The rest.
    pub lighting: Lighting,
}

/// Running sums as [`LightChoices::tables`] begin with them.
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
    /// Of a scene, all of whose lights kernels have, and of what they and its rules are there.
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

    /// Bring it to a device.
    ///
    /// # Errors
    /// The device's.
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
        // Scenes that have one are refused.
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
        // By planes in a table.
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
        // Scenes that have one are refused.
        LightKind::Volume(_) => Vec3::ZERO,
    };
    emitted.to_array()
}

#[cfg(test)]
mod tests;
