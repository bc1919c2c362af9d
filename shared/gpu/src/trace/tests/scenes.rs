//! Scenes that photons are traced through.
//!
//! All media absorb some light. Without absorption, scattering would leave a photon's flux unchanged except for
//! rounding, which would then decide whether roulette draws a number: no two paths would agree for long.

use crate::world::tests::volumes;
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::{Frame, Rgb, Vec2, Vec3};
use beamfarm_render::world::bsdf::{Dispersion, Index, Material, MaterialDescription, MaterialKind, Tint};
use beamfarm_render::world::camera::{Camera, Projection};
use beamfarm_render::world::filter::PixelFilter;
use beamfarm_render::world::geometry::{Boundary, Mesh, Object, Placement, Shape};
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_render::world::light::{Environment, Light, LightKind, Ramp, SceneBounds, Spot, Sun};
use beamfarm_render::world::medium::{Homogeneous, Medium, MediumId};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::{RenderDefaults, Scene, SceneDescription};
use glam::{Affine3A, Mat3};
use std::collections::BTreeMap;
use std::sync::Arc;

pub const WHITE: u32 = 0;
pub const GREY: u32 = 1;
pub const MIRROR: u32 = 2;
pub const GLASS: u32 = 3;
pub const PANE: u32 = 4;
pub const METAL: u32 = 5;
pub const NULL: u32 = 6;
pub const BLACK: u32 = 7;

fn materials() -> Vec<Material> {
    let constant = |r: f32, g: f32, b: f32| Texture::Constant(Rgb::new(r, g, b));
    let even = |kind| Material::new(kind, true);
    let diffuse = |reflectance| MaterialKind::Diffuse { reflectance };
    let metal = MaterialKind::Conductor {
        eta: Rgb::new(0.2, 0.4, 1.3),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: constant(1.0, 1.0, 1.0),
    };
    let tint = Tint {
        reflectance: constant(1.0, 1.0, 1.0),
        transmittance: constant(1.0, 0.9, 0.8),
    };
    vec![
        even(diffuse(constant(0.8, 0.7, 0.6))),
        even(diffuse(constant(0.3, 0.4, 0.5))),
        even(MaterialKind::Mirror {
            reflectance: constant(0.9, 0.9, 0.95),
        }),
        even(MaterialKind::Dielectric {
            eta: 1.5,
            tint: Tint::NONE,
        }),
        even(MaterialKind::ThinDielectric { eta: 1.4, tint }),
        even(metal),
        even(MaterialKind::Null),
        even(diffuse(constant(0.0, 0.0, 0.0))),
    ]
}

/// Only a camera, 2.8 in front of the centre.
pub fn empty() -> SceneDescription {
    SceneDescription {
        camera: Camera {
            projection: Projection::Perspective,
            position: Vec3::new(0.0, 0.0, -2.8),
            frame: Frame::from_normal(Vec3::Z),
            half_width: 0.4,
            shift: Vec2::ZERO,
            aperture: 0.0,
            focus_distance: 1.0,
            width: 32,
            height: 32,
            filter: PixelFilter::Box,
        },
        camera_medium: None,
        world_medium: None,
        objects: Vec::new(),
        materials: materials(),
        material_names: BTreeMap::new(),
        media: Vec::new(),
        media_names: Vec::new(),
        lights: Vec::new(),
        bounds: SceneBounds {
            center: Vec3::ZERO,
            radius: 3.0,
        },
        defaults: RenderDefaults::default(),
        rules: None,
        notes: Vec::new(),
        photon_rules: Vec::new(),
        motion: None,
        has_frames: false,
        interrupt: Interrupt::default(),
    }
}

fn add(scene: &mut SceneDescription, shape: Shape, material: u32, boundary: Option<[MediumId; 2]>) -> u32 {
    let number = scene.objects.len() as u32;
    scene.objects.push(Object {
        name: format!("object {number}"),
        material,
        boundary: boundary.map(|[interior, exterior]| Boundary { interior, exterior }),
        ..Object::new(shape)
    });
    number
}

fn light(scene: &mut SceneDescription, kind: LightKind) {
    let number = scene.lights.len() as u32;
    if let LightKind::Area { object, .. } = &kind {
        scene.objects[*object as usize].light = Some(number);
    }
    scene.lights.push(Light {
        name: format!("light {number}"),
        kind,
        group: LightGroup::named("all"),
    });
}

fn placed(map: Affine3A) -> Placement {
    Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    }
}

fn sphere(center: [f32; 3], radius: f32) -> Shape {
    let map = Affine3A::from_translation(center.into()) * Affine3A::from_scale(Vec3::splat(radius));
    Shape::Sphere {
        placement: placed(map),
        flip: false,
    }
}

/// The square of side 2 in the xy plane, transformed, with normal z.
fn square(map: Affine3A) -> Shape {
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let mesh = Mesh {
        positions: corners.map(|c| map.transform_point3(c.into())).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    }
}

/// A box between two corners, with outward normals and an optional placement.
fn cuboid(low: [f32; 3], high: [f32; 3], is_placed: bool) -> Shape {
    let (low, high) = (Vec3::from(low), Vec3::from(high));
    let map = Affine3A::from_translation(low) * Affine3A::from_scale(high - low);
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let positions = (0..8).map(corner);
    let positions = match is_placed {
        true => positions.collect(),
        false => positions.map(|p| map.transform_point3(p)).collect(),
    };
    let mesh = Mesh {
        positions,
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..Mesh::default()
    };
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: if is_placed { placed(map) } else { Placement::IDENTITY },
    }
}

/// Rolling hills with shading normals.
fn hills(map: Affine3A) -> Shape {
    const SIDE: u32 = 6;
    let mut mesh = Mesh::default();
    for i in 0..=SIDE * (SIDE + 2) {
        let (x, y) = (i % (SIDE + 1), i / (SIDE + 1));
        let at = |k: u32| 2.0 * k as f32 / SIDE as f32 - 1.0;
        let height = 0.1 * ((x * 7 + y * 5) % 4) as f32;
        mesh.positions
            .push(map.transform_point3(Vec3::new(at(x), at(y), height)));
        let tilt = Vec3::new(0.1 * (x % 3) as f32 - 0.1, 0.1 * (y % 2) as f32, 1.0);
        mesh.normals.push(map.transform_vector3(tilt).normalize());
        if x < SIDE && y < SIDE {
            let row = SIDE + 1;
            mesh.triangles.push([i, i + 1, i + row]);
            mesh.triangles.push([i + 1, i + row + 1, i + row]);
        }
    }
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    }
}

fn fog(scene: &mut SceneDescription, sigma_s: [f32; 3], sigma_a: [f32; 3], g: f32) -> MediumId {
    scene.media.push(Medium::Homogeneous(Homogeneous {
        sigma_a: sigma_a.into(),
        sigma_s: sigma_s.into(),
        phase: match g {
            0.0 => Phase::Isotropic,
            g => Phase::HenyeyGreenstein { g },
        },
    }));
    scene.media_names.push(format!("fog {}", scene.media.len()));
    Some(scene.media.len() as u16 - 1)
}

/// A frame that looks along y, in which a square is a floor.
fn lying(at: [f32; 3], half: f32) -> Affine3A {
    Affine3A::from_translation(at.into())
        * Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2)
        * Affine3A::from_scale(Vec3::splat(half))
}

/// Faces down.
fn hanging(at: [f32; 3], half: f32) -> Affine3A {
    Affine3A::from_translation(at.into())
        * Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2)
        * Affine3A::from_scale(Vec3::splat(half))
}

fn lamp(scene: &mut SceneDescription, map: Affine3A, radiance: f32, two_sided: bool) {
    let object = add(scene, square(map), BLACK, None);
    let radiance = Rgb::new(radiance, 0.9 * radiance, 0.7 * radiance);
    light(
        scene,
        LightKind::Area {
            object,
            radiance,
            pattern: None,
            two_sided,
            spread: None,
            soft: false,
        },
    );
}

/// A room full of fog, with a lamp and two boxes, one with a placement.
pub fn box_of_fog() -> SceneDescription {
    let mut scene = empty();
    let haze = fog(&mut scene, [0.3, 0.35, 0.4], [0.02, 0.01, 0.0], 0.0);
    scene.world_medium = haze;
    scene.camera.position = Vec3::new(0.0, 0.0, -0.95);
    add(&mut scene, cuboid([-1.0; 3], [1.0; 3], false), WHITE, None);
    add(
        &mut scene,
        cuboid([-0.7, -1.0, 0.0], [-0.2, 0.2, 0.5], true),
        GREY,
        None,
    );
    add(
        &mut scene,
        cuboid([0.2, -1.0, -0.2], [0.7, -0.4, 0.4], false),
        MIRROR,
        None,
    );
    lamp(&mut scene, hanging([0.0, 0.98, 0.0], 0.25), 8.0, false);
    scene
}

/// Adds a point light inside.
pub fn bulb(scene: &mut SceneDescription) {
    let position = Vec3::new(-0.3, 0.5, -0.4);
    let intensity = Rgb::new(1.0, 1.1, 1.2);
    light(scene, LightKind::Point { position, intensity });
}

/// A glass ball in endless fog, over a floor with a hole, under a ball-shaped spot.
fn ball_of_glass() -> SceneDescription {
    let mut scene = empty();
    let haze = fog(&mut scene, [0.1, 0.15, 0.2], [0.04, 0.02, 0.05], 0.7);
    scene.world_medium = haze;
    add(&mut scene, sphere([0.0, 0.2, 0.0], 0.5), GLASS, Some([None, haze]));
    add(&mut scene, hills(lying([0.0, -1.0, 0.0], 1.5)), WHITE, None);
    add(&mut scene, sphere([0.9, -0.6, 0.2], 0.3), METAL, None);
    light(
        &mut scene,
        LightKind::Spot(Spot {
            position: Vec3::new(0.3, 2.5, -0.4),
            frame: Frame::from_normal(Vec3::new(-0.1, -0.98, 0.15).normalize()),
            intensity: Rgb::new(10.0, 9.0, 8.0),
            cutoff: 0.5,
            beam_width: 0.3,
            ramp: Ramp::Smooth,
            radius: 0.2,
            soft: false,
        }),
    );
    scene
}

/// Mirrors all around, a pane, a cylinder, a disc and a point light.
fn box_of_mirrors() -> SceneDescription {
    let mut scene = empty();
    scene.camera.position = Vec3::new(0.0, 0.0, -0.9);
    add(&mut scene, cuboid([-1.0; 3], [1.0; 3], false), MIRROR, None);
    add(&mut scene, square(lying([0.0, -0.8, 0.0], 0.7)), WHITE, None);
    let map = Affine3A::from_translation(Vec3::new(0.4, -0.8, 0.3))
        * Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2)
        * Affine3A::from_scale(Vec3::new(0.2, 0.2, 0.9));
    let tube = Shape::Cylinder {
        placement: placed(map),
        flip: false,
    };
    add(&mut scene, tube, GREY, None);
    let disc = Shape::Disc {
        placement: placed(lying([-0.4, -0.3, 0.2], 0.3)),
        flip: true,
    };
    add(&mut scene, disc, WHITE, None);
    add(&mut scene, square(Affine3A::from_scale(Vec3::splat(0.6))), PANE, None);
    light(
        &mut scene,
        LightKind::Point {
            position: Vec3::new(-0.2, 0.5, -0.3),
            intensity: Rgb::new(1.0, 1.1, 1.2),
        },
    );
    scene
}

/// Fogs in a fog: two adjacent boxes on a floor, a ball across empty space, one in another.
fn fogs() -> SceneDescription {
    let mut scene = empty();
    let thin = fog(&mut scene, [0.05, 0.05, 0.06], [0.03, 0.02, 0.02], 0.0);
    let red = fog(&mut scene, [1.0, 0.3, 0.2], [0.05, 0.1, 0.2], 0.3);
    let blue = fog(&mut scene, [0.2, 0.4, 1.2], [0.2, 0.1, 0.0], -0.4);
    let ink = fog(&mut scene, [0.0; 3], [1.0, 0.5, 2.0], 0.0);
    scene.world_medium = thin;
    add(&mut scene, square(lying([0.0, -1.0, 0.0], 2.0)), WHITE, None);
    let [left, right] = [
        cuboid([-1.0; 3], [0.0, 0.0, 0.5], false),
        cuboid([0.0, -1.0, -1.0], [1.0, 0.0, 0.5], false),
    ];
    add(&mut scene, left, NULL, Some([red, thin]));
    add(&mut scene, right, NULL, Some([blue, thin]));
    add(&mut scene, sphere([0.0, 0.9, 0.0], 0.6), NULL, Some([blue, thin]));
    add(&mut scene, sphere([0.1, 0.9, 0.0], 0.3), NULL, Some([ink, blue]));
    add(&mut scene, sphere([-0.5, -0.5, -0.3], 0.25), GLASS, Some([None, red]));
    let sky = Environment::new(None, Rgb::new(0.5, 0.6, 0.9), Mat3::IDENTITY);
    light(&mut scene, LightKind::Environment(sky));
    lamp(&mut scene, hanging([0.3, 2.0, 0.2], 0.3), 30.0, true);
    scene
}

/// A sun of finite size, and one without, on panes, glass and other objects.
fn in_the_sun() -> SceneDescription {
    let mut scene = empty();
    add(&mut scene, square(lying([0.0, -1.0, 0.0], 2.0)), GREY, None);
    add(&mut scene, sphere([-0.8, -0.1, 0.0], 0.8), GLASS, Some([None, None]));
    add(&mut scene, square(lying([0.9, 0.2, 0.0], 0.8)), PANE, None);
    add(
        &mut scene,
        cuboid([0.3, -1.0, -0.3], [0.8, -0.4, 0.3], false),
        WHITE,
        None,
    );
    for (direction, half_angle) in [(Vec3::new(0.3, -0.9, 0.2), 0.02), (Vec3::new(-0.4, -0.7, -0.1), 0.0)] {
        light(
            &mut scene,
            LightKind::Directional(Sun {
                direction: direction.normalize(),
                irradiance: Rgb::new(1.0, 0.9, 0.8),
                half_angle,
            }),
        );
    }
    scene
}

/// A glass ball and a mirror under a lamp that camera paths meet as well.
fn under_a_lamp() -> SceneDescription {
    let mut scene = empty();
    add(&mut scene, square(lying([0.0, -1.0, 0.0], 1.5)), WHITE, None);
    add(&mut scene, sphere([-0.5, -0.4, 0.0], 0.5), GLASS, None);
    add(
        &mut scene,
        cuboid([0.2, -1.0, -0.3], [0.9, -0.2, 0.3], true),
        MIRROR,
        None,
    );
    lamp(&mut scene, hanging([0.0, 1.5, 0.0], 0.5), 5.0, false);
    scene
}

/// Varying densities: one in a ball inside another that surrounds everything, one that only absorbs in fog, and one
/// whose box begins inside the ball that it fills.
fn smokes() -> SceneDescription {
    let mut scene = empty();
    let add_medium = |scene: &mut SceneDescription, medium: Medium| {
        scene.media.push(medium);
        scene.media_names.push(format!("smoke {}", scene.media.len()));
        Some(scene.media.len() as u16 - 1)
    };
    let mut media: Vec<Option<Medium>> = volumes::media().into_iter().map(Some).collect();
    let mut take = |scene: &mut SceneDescription, number: usize, sigma_s: f32| {
        let mut medium = media[number].take().unwrap();
        if let Medium::Heterogeneous(medium) = &mut medium {
            medium.sigma_a += 0.1;
            medium.sigma_s *= sigma_s;
        }
        add_medium(scene, medium)
    };
    let around = take(&mut scene, 4, 0.2);
    let inside = take(&mut scene, 0, 1.0);
    let coloured = take(&mut scene, 1, 1.0);
    let ink = take(&mut scene, 2, 0.0);
    scene.world_medium = around;
    scene.camera.position = Vec3::new(0.5, 0.8, -1.5);
    add(&mut scene, square(lying([0.5, 0.1, 0.8], 2.0)), WHITE, None);
    add(&mut scene, sphere([0.3, 0.8, 1.4], 0.6), NULL, Some([inside, around]));
    add(
        &mut scene,
        sphere([1.2, 0.7, 0.3], 0.55),
        NULL,
        Some([coloured, around]),
    );
    add(&mut scene, sphere([-0.6, 0.6, 0.5], 0.4), NULL, Some([ink, around]));
    add(&mut scene, sphere([0.3, 0.5, 0.3], 0.2), GLASS, Some([None, around]));
    lamp(&mut scene, hanging([0.5, 2.4, 0.8], 0.4), 20.0, false);
    scene
}

/// A ball and a bar of dispersive glass, over a floor in fog.
pub fn prism() -> Scene {
    let mut scene = empty();
    let haze = fog(&mut scene, [0.2, 0.25, 0.3], [0.02; 3], 0.3);
    scene.world_medium = haze;
    let tint = Tint::NONE;
    for (number, (nd, abbe)) in [(1.7, 8.0), (1.5, 20.0)].into_iter().enumerate() {
        let dispersion = Dispersion {
            inside: Index::of_abbe(nd, abbe),
            outside: Index::Constant(1.0),
        };
        let eta = nd as f32;
        let kind = MaterialKind::Dielectric {
            eta,
            tint: tint.clone(),
        };
        let glass = MaterialDescription {
            dispersion: Some(Box::new(dispersion)),
            ..MaterialDescription::new(kind, true)
        };
        scene.materials.push(glass.into());
        let shape = match number {
            0 => sphere([-0.4, 0.5, 0.3], 0.45),
            _ => cuboid([0.2, 0.2, 0.0], [0.9, 0.9, 0.6], false),
        };
        let material = scene.materials.len() as u32 - 1;
        add(&mut scene, shape, material, Some([None, haze]));
    }
    add(&mut scene, square(lying([0.2, -0.3, 0.3], 2.0)), WHITE, None);
    lamp(&mut scene, hanging([0.2, 1.9, 0.3], 0.5), 20.0, false);
    Scene::new(scene)
}

/// All of them, by name.
pub fn all() -> [(&'static str, Scene); 7] {
    [
        ("box of fog", Scene::new(box_of_fog())),
        ("ball of glass", Scene::new(ball_of_glass())),
        ("box of mirrors", Scene::new(box_of_mirrors())),
        ("fogs", Scene::new(fogs())),
        ("in the sun", Scene::new(in_the_sun())),
        ("under a lamp", Scene::new(under_a_lamp())),
        ("smokes", Scene::new(smokes())),
    ]
}
