//! Shared by the tests of passes: scenes, and how to render them.

mod aims;
mod bits;
mod branches;
mod camera;
mod expectation;
mod layers;
mod layout;
mod light_groups;
mod moments;
mod pictures;
mod reasons;
mod revisions;
mod rules;
mod smoke;
mod waves;

use super::GpuPass;
use crate::self_test::Tested;
use crate::world::tests::scenes::{add_light, add_medium, add_object, diffuse, empty};
use beamfarm_image::job::{JobSettings, Targeting, Technique, Techniques};
use beamfarm_render::math::{Frame, Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::world::bsdf::{MaterialDescription, MaterialKind, Tint};
use beamfarm_render::world::geometry::{Boundary, Mesh, Placement, Shape};
use beamfarm_render::world::light::{LightKind, SceneBounds};
use beamfarm_render::world::medium::{Homogeneous, Medium, MediumId};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::{Scene, SceneDescription};
use glam::Affine3A;
use std::sync::Arc;

/// Looks along -z from (0, 0, 1.9), 32 x 32 pixels.
fn stage() -> SceneDescription {
    let mut scene = empty();
    scene.camera.position = Vec3::new(0.0, 0.0, 1.9);
    scene.camera.frame = Frame {
        s: Vec3::X,
        t: Vec3::Y,
        n: Vec3::NEG_Z,
    };
    scene.camera.half_width = 0.7;
    (scene.camera.width, scene.camera.height) = (32, 32);
    scene.bounds = SceneBounds {
        center: Vec3::ZERO,
        radius: 4.0,
    };
    scene.defaults.paths_per_pass = Some(500);
    scene.defaults.radius = Some(0.1);
    scene.defaults.targeting = Targeting::Off;
    scene
}

fn material(scene: &mut SceneDescription, kind: MaterialKind, two_sided: bool) -> u32 {
    scene.materials.push(MaterialDescription::new(kind, two_sided).into());
    scene.materials.len() as u32 - 1
}

fn matt(scene: &mut SceneDescription, reflectance: [f32; 3]) -> u32 {
    material(scene, diffuse(Texture::Constant(Rgb::from_array(reflectance))), true)
}

/// From the index of refraction inside over that outside.
fn glass(scene: &mut SceneDescription, eta: f32) -> u32 {
    let tint = Tint::NONE;
    material(scene, MaterialKind::Dielectric { eta, tint }, true)
}

/// A rectangle that faces the side from which these corners are counter-clockwise.
fn quad(scene: &mut SceneDescription, corners: [Vec3; 4], material: u32) -> u32 {
    let mesh = Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let shape = Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    };
    add_object(scene, shape, material)
}

/// The inside of a cube of side 4. Returns its six walls.
fn room(scene: &mut SceneDescription, material: u32) -> [u32; 6] {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    std::array::from_fn(|wall| {
        let sign = if wall % 2 == 0 { 1.0 } else { -1.0 };
        let n = axes[wall / 2] * sign;
        let (s, t) = (axes[(wall / 2 + 1) % 3] * sign, axes[(wall / 2 + 2) % 3]);
        // Facing inwards.
        let corners = [n - s - t, n - s + t, n + s + t, n + s - t].map(|corner| 2.0 * corner);
        quad(scene, corners, material)
    })
}

fn ball(scene: &mut SceneDescription, center: [f32; 3], radius: f32, material: u32) -> u32 {
    let placed = Affine3A::from_translation(Vec3::from_array(center)) * Affine3A::from_scale(Vec3::splat(radius));
    let placement = Placement {
        render_from_object: placed,
        object_from_render: placed.inverse(),
    };
    add_object(scene, Shape::Sphere { placement, flip: false }, material)
}

fn emits(scene: &mut SceneDescription, object: u32, radiance: [f32; 3]) {
    let kind = LightKind::Area {
        object,
        radiance: Rgb::from_array(radiance),
        pattern: None,
        two_sided: false,
        spread: None,
        soft: false,
    };
    let light = add_light(scene, "lamp", kind);
    scene.objects[object as usize].light = Some(light);
}

/// A lamp under the ceiling of [`room`].
fn lamp(scene: &mut SceneDescription, size: f32, radiance: [f32; 3]) {
    let black = matt(scene, [0.0; 3]);
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let lamp = quad(scene, corners.map(|[x, z]| Vec3::new(size * x, 1.9, size * z)), black);
    emits(scene, lamp, radiance);
}

/// Walls that reflect `rho` and emit the rest: the radiance inside is 1.
fn furnace(rho: f32) -> SceneDescription {
    let mut scene = stage();
    let wall = matt(&mut scene, [rho; 3]);
    for wall in room(&mut scene, wall) {
        emits(&mut scene, wall, [1.0 - rho; 3]);
    }
    scene
}

fn fog(scene: &mut SceneDescription, absorption: f32, g: f32) -> MediumId {
    let phase = match g == 0.0 {
        true => Phase::Isotropic,
        false => Phase::HenyeyGreenstein { g },
    };
    let fog = Homogeneous {
        sigma_a: Rgb::splat(absorption),
        sigma_s: Rgb::new(0.3, 0.4, 0.5),
        phase,
    };
    add_medium(scene, "fog", Medium::Homogeneous(fog))
}

/// Sets the media inside an object and around it.
fn fill(scene: &mut SceneDescription, object: u32, interior: MediumId, exterior: MediumId) {
    scene.objects[object as usize].boundary = Some(Boundary { interior, exterior });
}

/// No photons: camera paths find all light.
const BY_PATHS: Techniques = Techniques {
    media: Some(Technique::Paths),
    surfaces: Some(Technique::Paths),
    caustics: Some(Technique::Paths),
    aimed: Some(false),
};

fn plan(scene: &Scene, seed: u64) -> RenderPlan {
    let settings = JobSettings {
        seed,
        ..scene.description().defaults.job_settings()
    };
    RenderPlan::new(scene, settings)
}

fn render(tested: &Tested, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> PassImage {
    let pass = GpuPass::new(tested, scene, plan).unwrap();
    pass.render(pass_index).unwrap()
}

/// Whether long tests run: `BEAMFARM_LONG=1`.
fn is_long() -> bool {
    std::env::var("BEAMFARM_LONG").is_ok_and(|value| !value.is_empty() && value != "0")
}
