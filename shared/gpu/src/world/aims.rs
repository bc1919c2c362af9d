//! Photon targets, as in `kernels/aim.wgsl`.

use super::geometry::{FlatGeometry, MOST_STACK};
use super::reason::{Of, Reason, Why};
use crate::device::{Buffer, Device};
use crate::error::Result;
use crate::kernels::Needs;
use beamfarm_render::math::{PI, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::targeting::{self, Targets, WIDE, own_directions};
use beamfarm_render::warp;
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::LightKind;
use bytemuck::{Pod, Zeroable};

/// How a light's photons are aimed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aim {
    /// Share of photons that start as the light emits them.
    pub plain: f32,
    /// Index of its first disc.
    pub first: u32,
    /// Number of discs; 0: its photons are not aimed.
    pub count: u32,
    /// Root of the discs' hierarchy, among the nodes of the scene.
    pub root: u32,
    /// W/sr of a point, and of a spot on its axis; for light from one direction, its fluence times its density;
    /// radiance of surfaces and of environments.
    pub emitted: [f32; 3],
    /// Density of directions per solid angle, if it is constant.
    pub own_pdf: f32,
    /// Share of an environment's aimed photons that use the light's own directions.
    pub own_directions: f32,
    padding: [u32; 3],
}

/// A disc that photons are aimed at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct AimDisc {
    /// Its centre, render space.
    pub center: [f32; 3],
    /// Radius, scene units.
    pub radius: f32,
    /// Unit direction to the light.
    pub normal: [f32; 3],
    /// Cosine of the cone of directions to a distant light.
    pub cos_spread: f32,
    /// Probability of the disc over its area.
    pub density: f32,
    /// Probability of this disc and those before it.
    pub sum: f32,
    /// The cone, as 1 - cos.
    pub cone: f32,
    /// Density per solid angle in it, times the share of directions drawn from it.
    pub cone_pdf: f32,
}

/// The targets of a plan.
#[derive(Clone, Debug, Default)]
pub struct FlatAims {
    /// By light; empty if no photons are aimed.
    pub aims: Vec<Aim>,
    /// The discs of all lights.
    pub discs: Vec<AimDisc>,
    /// Stack entries that a ray through a hierarchy of discs may need.
    stack: u64,
}

/// Parts of a plan's targets that kernels do not support.
pub fn reasons(plan: &RenderPlan) -> Vec<Reason> {
    let targets = plan.targets.as_deref();
    let missing = |what: &'static str| Reason {
        of: Of::Plan,
        field: "targets",
        why: Why::Missing(what),
    };
    let mut reasons = Vec::new();
    if targets.is_some_and(Targets::rejects) {
        reasons.push(missing("photons that are dropped where they miss"));
    }
    let stack = targets
        .into_iter()
        .flat_map(Targets::aims)
        .map(|(_, aim)| aim.discs.stack());
    if stack.max().is_some_and(|entries| entries as u64 > MOST_STACK) {
        reasons.push(missing("rays through as many discs"));
    }
    reasons
}

impl FlatAims {
    /// Lays out the targets of a plan. The hierarchies of discs follow those of the scene.
    #[must_use]
    pub fn new(scene: &Scene, plan: &RenderPlan, geometry: &mut FlatGeometry) -> Self {
        let mut flat = Self::default();
        for (number, aim) in plan.targets.as_deref().into_iter().flat_map(Targets::aims) {
            flat.aims.resize(scene.description().lights.len(), Aim::default());
            let first = flat.discs.len() as u32;
            flat.stack = flat.stack.max(aim.discs.stack() as u64);
            flat.aims[number] = Aim {
                plain: aim.plain,
                first,
                count: aim.discs.len() as u32,
                root: geometry.add_boxes(aim.discs.nodes(), first),
                ..of_light(&scene.description().lights[number].kind)
            };
            let disc = |(disc, sum): (&targeting::Disc, f32)| AimDisc {
                center: disc.center.to_array(),
                radius: disc.radius,
                normal: disc.normal.to_array(),
                cos_spread: disc.cos_spread,
                density: disc.density,
                sum,
                cone: 1.0 - disc.cos_spread,
                cone_pdf: (1.0 - WIDE) * warp::uniform_cone_pdf(disc.cos_spread),
            };
            flat.discs.extend(aim.discs.with_sums().map(disc));
        }
        flat
    }

    /// The needs of the kernel that starts photons, given those of the scene's other kernels.
    #[must_use]
    pub fn needs(&self, of_scene: Needs) -> Needs {
        let entries = self.stack.next_power_of_two() as u32;
        Needs {
            aims: !self.aims.is_empty(),
            stack: of_scene.stack.max(entries),
            ..of_scene
        }
    }

    /// Uploads them to a device, if there are any.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device) -> Result<Option<AimBuffers>> {
        if self.aims.is_empty() {
            return Ok(None);
        }
        Ok(Some(AimBuffers {
            aims: device.buffer("aims", &self.aims)?,
            discs: device.buffer("discs that photons are aimed at", &self.discs)?,
        }))
    }
}

/// Targets on a device: bindings 60 and 61.
#[derive(Debug)]
pub struct AimBuffers {
    /// By light.
    pub aims: Buffer,
    /// The discs of all lights.
    pub discs: Buffer,
}

/// Values shared by all discs of a light.
fn of_light(kind: &LightKind) -> Aim {
    let (emitted, own_pdf, own) = match kind {
        LightKind::Point { intensity, .. } => (*intensity, 0.25 / PI, 0.0),
        LightKind::Spot(spot) => (spot.intensity, 0.0, 0.0),
        LightKind::Projector(projector) => (projector.intensity, 0.0, 0.0),
        LightKind::Goniometric(lamp) => (lamp.scale, 0.0, 0.0),
        LightKind::Laser(laser) => (laser.irradiance, 0.0, 0.0),
        LightKind::Directional(sun) => (sun.fluence() * sun.pdf(), sun.pdf(), 0.0),
        LightKind::Area { radiance, .. } => (*radiance, 0.0, 0.0),
        LightKind::Volume(_) => (Vec3::ZERO, 0.25 / PI, 0.0),
        LightKind::Environment(sky) => (sky.radiance(Vec3::Z), warp::uniform_sphere_pdf(), own_directions(sky)),
    };
    Aim {
        emitted: emitted.to_array(),
        own_pdf,
        own_directions: own,
        ..Aim::default()
    }
}
