use super::*;
use crate::device::Groups;
use crate::kernels::{
    ARITHMETIC, BSDF, CAMERA, EMISSION, GROUPS, MATH, MEDIUM, PHASE, Program, TEXELS, TEXTURE, VECTORS, WARP, WIDE,
    WORLD,
};
use crate::testing::{same_layout, tested};
use beamfarm_render::math::{Frame, Rgb, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{self, MaterialKind, Tint};
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::filter::PixelFilter;
use beamfarm_render::world::geometry::{Boundary, Placement};
use beamfarm_render::world::light::{
    AngularTable, Filled, Goniometric, Laser, LightKind, Profile, Ramp, Spot, Spread, VolumeEmission, VolumeLight,
};
use beamfarm_render::world::medium;
use beamfarm_render::world::panorama::{Mapping, Panorama};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::rules::{ObjectSets, Rules};
use beamfarm_render::world::scalar::Scalar;
use glam::Affine3A;
use std::sync::Arc;

mod leaks;
mod rules;
pub(crate) mod scenes;
mod surface;
mod textures;
pub(crate) mod volumes;
mod waves;
use scenes::*;

fn texts(description: SceneDescription) -> Vec<String> {
    let reasons = FlatWorld::new(&Scene::new(description), u64::MAX).unwrap_err();
    reasons.iter().map(Reason::to_string).collect()
}

#[test]
fn materials_that_kernels_have_not_are_all_named() {
    let mut scene = empty();
    add_materials(&mut scene);
    let brushed = bsdf::Anisotropy {
        stretch: bsdf::Stretch::Across(Scalar::constant(0.4)),
        rotation: Scalar::constant(0.0),
        tangent: bsdf::Tangent::U,
    };
    let metal = MaterialKind::RoughConductor {
        distribution: bsdf::Distribution::Ggx,
        alpha: Scalar::constant(0.1),
        eta: Rgb::ONE,
        k: Rgb::ONE,
        reflectance: GREY,
    };
    let pan = bsdf::MaterialDescription {
        anisotropy: Some(Box::new(brushed)),
        ..even(metal)
    };
    add(&mut scene, "pan", pan);
    let expected = [
        r#"material "squared": reflectance: kernels have no colours of vertices times themselves"#,
        r#"material "pan": alpha_u: kernels have no microfacets that are rougher in one direction"#,
    ];
    assert_eq!(texts(scene), expected);
}

#[test]
fn lights_that_kernels_have_not_are_all_named() {
    let mut scene = empty();
    add_lights(&mut scene);
    let expected = [
        r#"light "lamp 0": radiance: kernels have no colours of vertices"#,
        r#"light "lamp 1": shape: kernels have no spheres that emit and are stretched"#,
        r#"light "lamp 2": radiance: kernels have no colours of vertices"#,
        r#"light "lamp 2": shape: kernels have no cylinders that emit"#,
    ];
    assert_eq!(texts(scene), expected);
}

#[test]
fn the_rest_that_kernels_have_not_is_all_named() {
    let mut scene = empty();
    let glass = add(&mut scene, "glass", even(dielectric(1.5, Tint::NONE)));
    let material = scene.objects[glass as usize].material;
    let [first, second] = [20.0, 21.0].map(|x| {
        let map = Affine3A::from_translation(Vec3::new(x, 4.0, 0.0));
        let placement = Placement {
            render_from_object: map,
            object_from_render: map.inverse(),
        };
        add_object(&mut scene, sphere(placement), material)
    });
    assert_eq!([first, second], [1, 2]);
    scene.camera.filter = PixelFilter::Tent { radius: 0.3 };
    let objects = scene.objects.len();
    scene.rules = Some(Rules {
        class: (24..25).cycle().take(objects).collect(),
        objects,
        rows: vec![0],
        of_object: vec![ObjectSets::default(); objects],
        of_medium: vec![Default::default(); scene.media.len()],
        ..Rules::default()
    });
    let expected = [
        "rules: there are 25, and 24 are the most",
        r#"object "object 1": shape: it reaches into "object 2" or touches it, and kernels cannot tell what is there"#,
        "filter: kernels have no filters that are narrower than a pixel",
    ];
    assert_eq!(texts(scene), expected);
}

#[test]
fn lamps_and_cameras_that_kernels_have_not_are_all_named() {
    let mut scene = supported();
    let LightKind::Area { spread, .. } = &mut scene.lights[0].kind else {
        panic!("{:?}", scene.lights[0]);
    };
    *spread = Spread::new(90.0);
    let name = scene.lights[0].name.clone();
    let frame = Frame::from_normal(Vec3::Z);
    let laser = Laser {
        position: Vec3::ZERO,
        frame,
        radius: 0.5,
        irradiance: Rgb::ONE,
        profile: Profile::Flat,
    };
    add_light(&mut scene, "laser", LightKind::Laser(laser));
    let spot = Spot {
        position: Vec3::ZERO,
        frame,
        intensity: Rgb::ONE,
        cutoff: 0.5,
        beam_width: 0.25,
        ramp: Ramp::Smooth,
        radius: 0.1,
        soft: true,
    };
    add_light(&mut scene, "spot", LightKind::Spot(spot));
    let whole = [0.0, 2.0 * std::f64::consts::PI];
    let table = AngularTable::new(&[0.0, 1.0], &whole, &[1.0; 4]).expect("a table");
    let lamp = Goniometric {
        position: Vec3::ZERO,
        axes: [frame.s, frame.t, frame.n],
        scale: Rgb::ONE,
        table: Arc::new(table),
    };
    add_light(&mut scene, "downlight", LightKind::Goniometric(lamp));
    let filled = Filled {
        low: Vec3::ZERO,
        high: Vec3::ONE,
        volume: 1.0,
    };
    let fire = VolumeLight::new(0, VolumeEmission::even(Rgb::ONE), &[filled]).expect("a light");
    add_light(&mut scene, "fire", LightKind::Volume(Arc::new(fire)));
    scene.camera.projection = Projection::Panoramic(Panorama {
        mapping: Mapping::Equirectangular,
        row: 1.0,
        circle: 1.0,
    });
    let expected = [
        r#"light "fire": emission: kernels have no media that emit"#.to_owned(),
        format!("light \"{name}\": spread: kernels have no surfaces that emit into a cone"),
        r#"light "laser": type: kernels have no lasers"#.to_owned(),
        r#"light "spot": position: kernels have no lights that are in several media"#.to_owned(),
        r#"light "spot": soft_falloff: kernels have no lamps with soft falloff"#.to_owned(),
        r#"light "downlight": ies: kernels have no lamps by tables of directions"#.to_owned(),
        "camera: projection: kernels have no panoramas".to_owned(),
    ];
    let mut found = texts(scene);
    found.sort();
    let mut expected = expected.to_vec();
    expected.sort();
    assert_eq!(found, expected);
}

#[test]
fn all_of_a_scene_is_where_kernels_look_for_it() {
    let world = FlatWorld::new(&Scene::new(supported()), u64::MAX).unwrap();
    let kinds: Vec<u32> = world.materials.records.iter().map(|m| m.surface.kind).collect();
    // Diffuse, diffuse without a colour, dielectric, thin dielectric, conductor, mirror, null.
    assert_eq!(kinds, [1, 1, 2, 3, 4, 5, 6]);
    let surfaces: Vec<_> = world.materials.records.iter().map(|m| m.surface).collect();
    let [wall, _, glass, pane, metal, mirror, _] = surfaces[..] else {
        panic!()
    };
    let colour = [0.25, 0.5, 0.75];
    assert_eq!((wall.reflectance, wall.bits), (colour, 0));
    assert_eq!((glass.reflectance, glass.transmittance), (colour, [0.5; 3]));
    assert_eq!((glass.eta, pane.eta), ([1.25; 3], [1.75; 3]));
    // Indices are capped at a million, where squares are finite.
    assert_eq!((metal.eta, metal.k), ([0.125, 2.0, 1e6], [3.0, 4.0, 1e6]));
    assert_eq!((mirror.reflectance, mirror.bits), (colour, 1));

    let surface = |object: usize| {
        let s = world.surfaces[object];
        [s.material, s.light, s.interior, s.exterior]
    };
    assert_eq!(surface(0), [0, NONE, NONE, NONE]);
    assert_eq!(surface(2), [2, NONE, VACUUM, 0]);
    assert_eq!(surface(6), [6, NONE, 1, 0]);
    assert_eq!(surface(7), [0, 0, NONE, NONE]);
    let classes: Vec<u32> = world.geometry.objects.iter().map(|o| o.classes).collect();
    let wall = VISIBLE | OPAQUE;
    let [glass, pane, null] = [
        wall | NO_WALLS | TRANSMITTING,
        wall | NO_WALLS | CLEAR | TRANSMITTING,
        NULL_BOUNDARIES | NO_WALLS | PASSABLE | TRANSMITTING,
    ];
    assert_eq!(classes, [wall, wall, glass, pane, wall, wall, null, wall]);

    let kinds: Vec<u32> = world.lights.iter().map(|light| light.kind).collect();
    // Two-sided area, point, smooth spot, directional, environment.
    assert_eq!(kinds, [6, 0, 2, 3, 7]);
    assert_eq!((world.emitters.len(), world.lights[0].count), (1, 1));

    assert_eq!(world.world_medium, 0);
    let [haze, mist] = world.media[..] else { panic!() };
    assert_eq!(
        (haze.sigma_t, haze.sigma_s, haze.g),
        ([1.25, 2.5, 0.5], [1.0, 2.0, 0.5], 0.0)
    );
    assert_eq!((mist.g, mist.phase.first.sign, mist.phase.weight), (-0.7, -1.0, 0.0));
    // All in the haze outside everything, like the camera.
    assert!(world.lights.iter().all(|light| light.medium == 0));
    assert_eq!(world.camera.medium, 0);
    assert_eq!(
        (world.camera.width, world.camera.height, world.camera.pixel),
        (4, 2, 0.25)
    );
}

/// All parts, and anything that exceeds the device's memory, in one list.
#[test]
fn reasons_of_all_kinds_come_together() {
    let mut scene = supported();
    scene.camera.filter = PixelFilter::Tent { radius: 0.3 };
    scene.world_medium = add_medium(&mut scene, "smoke", cloud(Phase::Isotropic));
    let stretched = Placement {
        render_from_object: Affine3A::from_scale(Vec3::new(1.0, 2.0, 1.0)),
        object_from_render: Affine3A::from_scale(Vec3::new(1.0, 0.5, 1.0)),
    };
    let egg = add_object(&mut scene, sphere(stretched), 0);
    let kind = LightKind::Area {
        object: egg,
        radiance: Rgb::ONE,
        pattern: None,
        two_sided: false,
        spread: None,
        soft: false,
    };
    add_light(&mut scene, "egg", kind);
    add(&mut scene, "poster", even(diffuse(colors_of_vertices_squared())));
    let reasons = FlatWorld::new(&Scene::new(scene), 100).unwrap_err();
    let texts: Vec<String> = reasons.iter().map(Reason::to_string).collect();
    let expected = [
        "filter: kernels have no filters that are narrower than a pixel",
        r#"material "poster": reflectance: kernels have no colours of vertices times themselves"#,
        r#"densities that vary: it takes a buffer of 3404 bytes, and the device's largest has 100"#,
        r#"light "egg": shape: kernels have no spheres that emit and are stretched"#,
    ];
    assert_eq!(texts[..4], expected);
    assert!(texts.len() > 4, "{texts:?}");
    assert!(
        texts[4..]
            .iter()
            .all(|text| text.contains("and the device's largest has 100")),
        "{texts:?}"
    );
}

/// Six words per object: material, flux, and the media beyond rays out of it and into it.
const LOOKED_UP: Program = Program {
    name: "looked up",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        PHASE,
        MEDIUM,
        CAMERA,
        TEXTURE,
        EMISSION,
        WORLD,
        "struct MaterialRecord { surface: Material, more: vec4f, parts: vec4f }
        @group(0) @binding(26) var<storage, read> materials: array<MaterialRecord>;
        @group(0) @binding(0) var<storage, read_write> found: array<array<f32, 6>>;
        fn scattering(number: u32) -> f32 {
            if (number == VACUUM) { return 0.0; }
            return media[number].sigma_s.x * (1.0 + media[number].g);
        }
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            if (i >= arrayLength(&surfaces)) { return; }
            let surface = surfaces[i];
            let up = vec3f(0.0, 0.0, 1.0);
            var flux = 0.0;
            if (surface.light != NONE) { flux = lights[surface.light].power.y * emitters[0].b.x; }
            found[i] = array(
                f32(materials[surface.material].surface.kind),
                flux,
                scattering(medium_towards(surface, up, up, VACUUM)),
                scattering(medium_towards(surface, up, -up, VACUUM)),
                scattering(medium_towards(surface, up, -up, 0u)),
                f32(camera.width),
            );
        }",
    ],
};

#[test]
fn kernels_find_what_objects_are() {
    let Some(tested) = tested() else { return };
    let device = &tested.device;
    let world = FlatWorld::new(&Scene::new(supported()), device.largest_buffer()).unwrap();
    let buffers = world.upload(device).unwrap();
    let output = device.empty("found", 24 * world.surfaces.len() as u64).unwrap();
    let mut work = device.work();
    let given = [
        &output,
        &buffers.surfaces,
        &buffers.materials,
        &buffers.lights,
        &buffers.emitters,
        &buffers.media,
        &buffers.camera,
    ];
    let kernel = tested.kernel(&LOOKED_UP, "main");
    work.run(&kernel, &given, Groups::Count(1)).unwrap();
    work.submit().unwrap();
    let found = device.read::<[f32; 6]>(&output, world.surfaces.len()).unwrap();
    // Where nothing is specified, a ray stays in the surroundings: the haze, which scatters 1, or vacuum.
    assert_eq!(found[0], [1.0, 0.0, 0.0, 0.0, 1.0, 4.0]);
    // Empty glass in the haze.
    assert_eq!(found[2], [2.0, 0.0, 1.0, 0.0, 0.0, 4.0]);
    // Mist in the haze: its mean cosine is -0.7.
    let mist = 1.0f32 + -0.7;
    assert_eq!(found[6], [6.0, 0.0, 1.0, mist, mist, 4.0]);
    // Half a square unit, both sides.
    assert!((found[7][1] - std::f32::consts::PI).abs() < 1e-6, "{:?}", found[7]);
}

#[test]
fn surfaces_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &LOOKED_UP,
        Surface {
            material,
            light,
            interior,
            exterior,
            reflected,
            refracted,
            shadow,
            lit_by,
            bits,
            photon
        }
    );
}

/// Unused parts have buffers as well.
#[test]
fn an_empty_scene_can_be_brought_to_a_device() {
    let Some(tested) = tested() else { return };
    let world = FlatWorld::new(&Scene::new(empty()), tested.device.largest_buffer()).unwrap();
    world.upload(&tested.device).unwrap();
}

/// A lamp inside a boundary, one outside, and one across it.
#[test]
fn photons_and_camera_rays_start_in_the_medium_around_them() {
    let mut scene = supported();
    let boundary = scene.objects[6].boundary;
    let ball = add_object(&mut scene, sphere(placement(40)), 6);
    scene.objects[ball as usize].boundary = boundary;
    let middle = Vec3::new(120.0, 0.0, 0.0);
    scene.camera.position = middle;
    let spot = |radius: f32| {
        LightKind::Spot(Spot {
            position: middle,
            frame: Frame::from_normal(Vec3::NEG_Y),
            intensity: Rgb::ONE,
            cutoff: 0.5,
            beam_width: 0.25,
            ramp: Ramp::Linear,
            radius,
            soft: false,
        })
    };
    let inside = add_light(&mut scene, "inside", spot(0.5));
    let world = FlatWorld::new(&Scene::new(scene.clone()), u64::MAX).unwrap();
    let mist = 1;
    assert_eq!(
        (world.lights[inside as usize].medium, world.camera.medium),
        (mist, mist)
    );
    assert_eq!(world.lights[1].medium, 0);
    add_light(&mut scene, "on both sides", spot(1.5));
    scene.camera.projection = Projection::Orthographic;
    scene.camera.half_width = 2.0;
    let expected = [
        "camera: position: kernels have no cameras that are in several media",
        r#"light "on both sides": position: kernels have no lights that are in several media"#,
    ];
    assert_eq!(texts(scene), expected);
}
