//! Scenes for layout tests.

use super::*;
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::{Frame, Rgb, Vec2, Vec3};
use beamfarm_render::world::RenderDefaults;
use beamfarm_render::world::bsdf::{
    self, Coat, Dispersion, Distribution, Extras, Index, Interface, MaterialDescription, MaterialKind,
    NormalPerturbation, RoughCoat, Tint,
};
use beamfarm_render::world::camera::{self, Projection};
use beamfarm_render::world::filter::PixelFilter;
use beamfarm_render::world::geometry::{Boundary, Mesh, Object, Placement, Shape};
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_render::world::light::{self, Environment, LightKind, Pattern, Projector, Ramp, SceneBounds, Spot, Sun};
use beamfarm_render::world::medium::bricks::{Bricks, Core, RawDensity};
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{self, Heterogeneous, Homogeneous};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use glam::{Affine2, Affine3A, DAffine3, DVec3, IVec3, Mat3};
use std::collections::BTreeMap;
use std::sync::Arc;

pub const GREY: Texture = Texture::Constant(Rgb::splat(0.5));

pub fn empty() -> SceneDescription {
    SceneDescription {
        camera: camera::Camera {
            projection: Projection::Perspective,
            position: Vec3::new(0.0, 0.0, -5.0),
            frame: Frame::from_normal(Vec3::Z),
            half_width: 0.5,
            shift: Vec2::ZERO,
            aperture: 0.0,
            focus_distance: 1.0,
            width: 4,
            height: 2,
            filter: PixelFilter::Box,
        },
        camera_medium: None,
        world_medium: None,
        objects: Vec::new(),
        materials: Vec::new(),
        material_names: BTreeMap::new(),
        media: Vec::new(),
        media_names: Vec::new(),
        lights: Vec::new(),
        bounds: SceneBounds {
            center: Vec3::ZERO,
            radius: 200.0,
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

/// Far enough from the others, by number.
pub fn placement(number: usize) -> Placement {
    let at = Vec3::new(3.0 * number as f32, 0.0, 0.0);
    Placement {
        render_from_object: Affine3A::from_translation(at),
        object_from_render: Affine3A::from_translation(-at),
    }
}

pub fn triangle() -> Shape {
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    }
}

pub fn sphere(placement: Placement) -> Shape {
    Shape::Sphere { placement, flip: false }
}

pub fn add_object(scene: &mut SceneDescription, shape: Shape, material: u32) -> u32 {
    let number = scene.objects.len();
    scene.objects.push(Object {
        name: format!("object {number}"),
        material,
        ..Object::new(shape)
    });
    number as u32
}

/// A material with an object of it.
pub fn add(scene: &mut SceneDescription, name: &str, material: impl Into<bsdf::Material>) -> u32 {
    let number = scene.materials.len() as u32;
    scene.materials.push(material.into());
    if !name.is_empty() {
        scene.material_names.insert(number, name.to_owned());
    }
    let shape = match triangle() {
        Shape::Mesh { mesh, .. } => Shape::Mesh {
            mesh,
            placement: placement(scene.objects.len()),
        },
        other => other,
    };
    add_object(scene, shape, number)
}

pub fn add_light(scene: &mut SceneDescription, name: &str, kind: LightKind) -> u32 {
    scene.lights.push(light::Light {
        name: name.to_owned(),
        kind,
        group: LightGroup::named("all"),
    });
    scene.lights.len() as u32 - 1
}

pub fn colors_of_vertices_squared() -> Texture {
    Texture::VertexColors(Some(Arc::new(Texture::VertexColors(None))))
}

pub fn add_medium(scene: &mut SceneDescription, name: &str, medium: medium::Medium) -> MediumId {
    scene.media.push(medium);
    scene.media_names.push(name.to_owned());
    Some(scene.media.len() as u16 - 1)
}

pub fn even(kind: MaterialKind) -> MaterialDescription {
    MaterialDescription::new(kind, true)
}

pub fn diffuse(reflectance: Texture) -> MaterialKind {
    MaterialKind::Diffuse { reflectance }
}

pub fn image() -> Arc<Image> {
    Arc::new(Image {
        width: 2,
        height: 2,
        pixels: vec![Rgb::ONE, Rgb::ZERO, Rgb::ONE, Rgb::splat(0.5)],
        alpha: Vec::new(),
    })
}

pub fn picture() -> Texture {
    Texture::Image {
        image: image(),
        filter: TextureFilter::Bilinear,
        wrap: Wrap::Repeat,
        image_from_uv: Affine2::IDENTITY,
    }
}

pub fn squares() -> Texture {
    Texture::Checkerboard {
        colors: [Rgb::ONE, Rgb::splat(0.1)],
        squares_from_uv: Affine2::IDENTITY,
    }
}

pub fn fog(phase: Phase) -> Homogeneous {
    Homogeneous {
        sigma_a: Rgb::new(0.25, 0.5, 0.0),
        sigma_s: Rgb::new(1.0, 2.0, 0.5),
        phase,
    }
}

pub fn cloud(phase: Phase) -> medium::Medium {
    let density = RawDensity {
        cores: [([0; 3], Core::Constant(1.0))].into(),
        samples: [IVec3::ZERO, IVec3::splat(7)],
        domain: [DVec3::ZERO, DVec3::splat(7.0)],
        to_object: DAffine3::IDENTITY,
    };
    let bricks = Arc::new(Bricks::new(&density).unwrap());
    let estimator = Estimator::RatioTracking;
    let cloud = Heterogeneous::new([Rgb::ZERO, Rgb::ONE], phase, estimator, bricks, DAffine3::IDENTITY);
    medium::Medium::Heterogeneous(cloud)
}

pub fn dielectric(eta: f32, tint: Tint) -> MaterialKind {
    MaterialKind::Dielectric { eta, tint }
}

pub fn add_materials(scene: &mut SceneDescription) {
    let (eta, k) = (Rgb::ONE, Rgb::ONE);
    let alpha = Scalar::constant(0.2);
    let distribution = Distribution::Ggx;
    let rough_metal = MaterialKind::RoughConductor {
        distribution,
        alpha: alpha.clone(),
        eta,
        k,
        reflectance: GREY,
    };
    // Not on any object.
    add(scene, "not used", even(rough_metal.clone()));
    scene.objects.clear();
    add(scene, "metal", even(rough_metal));
    let frosted = MaterialKind::RoughDielectric {
        distribution,
        alpha,
        eta: 1.5,
        tint: Tint::NONE,
    };
    add(scene, "frosted", even(frosted));
    let plastic = MaterialKind::Plastic {
        reflectance: GREY,
        specular_reflectance: GREY,
        coat: Coat::new(1.5, false),
    };
    add(scene, "plastic", even(plastic));
    let rough_plastic = MaterialKind::RoughPlastic {
        reflectance: GREY,
        specular_reflectance: GREY,
        coat: Box::new(RoughCoat::new(distribution, 0.2, 1.5, false)),
    };
    add(scene, "rough plastic", even(rough_plastic));
    let principled = |extras: Option<Box<Extras>>| MaterialKind::Principled {
        base_color: GREY,
        metallic: Scalar::constant(0.0),
        roughness: Scalar::constant(0.5),
        interface: Interface::Eta(1.5),
        extras,
    };
    add(scene, "paint", even(principled(None)));
    let clear = Extras {
        spec_trans: Scalar::constant(1.0),
        ..Extras::NONE
    };
    add(scene, "clear", even(principled(Some(Box::new(clear)))));
    let blend = MaterialKind::Blend {
        parts: Box::new([diffuse(GREY), diffuse(GREY)].map(|kind| bsdf::Material::new(kind, true))),
        weight: GREY,
    };
    add(scene, "blend", even(blend));
    add(scene, "poster", even(diffuse(picture())));
    add(scene, "", even(diffuse(picture())));
    add(scene, "floor", even(MaterialKind::Mirror { reflectance: squares() }));
    let conductor = MaterialKind::Conductor {
        eta,
        k,
        reflectance: Texture::VertexColors(None),
    };
    add(scene, "vertices", even(conductor));
    add(scene, "squared", even(diffuse(colors_of_vertices_squared())));
    let tint = Tint {
        reflectance: picture(),
        transmittance: squares(),
    };
    add(scene, "window", even(dielectric(1.5, tint.clone())));
    add(scene, "pane", even(MaterialKind::ThinDielectric { eta: 1.5, tint }));
    let bump = NormalPerturbation::BumpMap {
        height: picture(),
        scale: 1.0,
    };
    let leaf = MaterialDescription {
        opacity: Some(GREY),
        normal_perturbation: Some(bump),
        ..even(diffuse(picture()))
    };
    add(scene, "leaf", leaf);
    let bricks = MaterialDescription {
        normal_perturbation: Some(NormalPerturbation::NormalMap(picture())),
        ..even(diffuse(GREY))
    };
    add(scene, "bricks", bricks);
    let dispersion = Dispersion {
        inside: Index::of_abbe(1.62, 36.4),
        outside: Index::of_abbe(1.0, 1e9),
    };
    let prism = MaterialDescription {
        dispersion: Some(Box::new(dispersion)),
        ..even(dielectric(1.62, Tint::NONE))
    };
    add(scene, "prism", prism);
}

/// An image sky with a bright sun, split into two lights, rotated.
pub fn sky_with_a_sun() -> Vec<Environment> {
    let pixel = |i: u32| match (i % 16, i / 16) {
        (11, 2) => Rgb::new(30.0, 25.0, 20.0),
        (x, y) if y < 5 => Rgb::new(0.2, 0.3 + 0.02 * x as f32, 0.9),
        _ => Rgb::new(0.1, 0.05, 0.0),
    };
    let image = Arc::new(Image {
        width: 16,
        height: 9,
        pixels: (0..16 * 9).map(pixel).collect(),
        alpha: Vec::new(),
    });
    let turn = Mat3::from_rotation_y(0.7) * Mat3::from_diagonal(Vec3::new(1.0, 1.0, -1.0));
    Environment::sky_and_suns(&image, Rgb::new(0.5, 0.6, 0.7), turn)
}

pub fn add_lights(scene: &mut SceneDescription) {
    let grey = add(scene, "grey", even(diffuse(GREY)));
    let material = scene.objects[grey as usize].material;
    let lamp = Projector {
        position: Vec3::new(0.0, 9.0, 0.0),
        axes: [Vec3::X, Vec3::Y, Vec3::Z],
        half: Vec2::ONE,
        image: image(),
        filter: TextureFilter::Bilinear,
        lit: [Vec2::NEG_ONE, Vec2::ONE],
        intensity: Rgb::ONE,
        cone: None,
    };
    let cone = Some([0.5, 0.4]);
    add_light(scene, "slides", LightKind::Projector(lamp.clone()));
    add_light(scene, "gobo", LightKind::Projector(Projector { cone, ..lamp }));
    let sky = Environment::new(Some(image()), Rgb::ONE, Mat3::IDENTITY);
    add_light(scene, "sky", LightKind::Environment(sky));
    let (pattern, radiance) = Pattern::new(Texture::VertexColors(None), Rgb::ONE, &triangle(), None).unwrap();
    let pattern = Arc::new(pattern);
    let stretched = Affine3A::from_translation(Vec3::X * 30.0) * Affine3A::from_scale(Vec3::new(1.0, 2.0, 1.0));
    let stretched = Placement {
        render_from_object: stretched,
        object_from_render: stretched.inverse(),
    };
    let cylinder = Shape::Cylinder {
        placement: placement(31),
        flip: false,
    };
    let shapes = [
        (triangle(), Some(pattern.clone())),
        (sphere(stretched), None),
        (cylinder, Some(pattern)),
    ];
    for (number, (shape, pattern)) in shapes.into_iter().enumerate() {
        let object = add_object(scene, shape, material);
        let kind = LightKind::Area {
            object,
            radiance,
            pattern,
            two_sided: false,
            spread: None,
            soft: false,
        };
        let light = add_light(scene, &format!("lamp {number}"), kind);
        scene.objects[object as usize].light = Some(light);
    }
}

/// One of each kind that kernels support.
pub fn supported() -> SceneDescription {
    let mut scene = empty();
    let mist = fog(Phase::HenyeyGreenstein { g: -0.7 });
    let haze = add_medium(&mut scene, "haze", medium::Medium::Homogeneous(fog(Phase::Isotropic)));
    let mist = add_medium(&mut scene, "mist", medium::Medium::Homogeneous(mist));
    scene.world_medium = haze;
    let colour = Texture::Constant(Rgb::new(0.25, 0.5, 0.75));
    let one_sided = MaterialDescription::new(diffuse(colour.clone()), false);
    add(&mut scene, "wall", one_sided);
    add(&mut scene, "black", even(diffuse(Texture::Constant(Rgb::ZERO))));
    let tint = Tint {
        reflectance: colour.clone(),
        transmittance: GREY,
    };
    add(&mut scene, "glass", even(dielectric(1.25, tint.clone())));
    add(
        &mut scene,
        "pane",
        even(MaterialKind::ThinDielectric { eta: 1.75, tint }),
    );
    let metal = MaterialKind::Conductor {
        eta: Rgb::new(0.125, 2.0, 1e9),
        k: Rgb::new(3.0, 4.0, f32::INFINITY),
        reflectance: colour.clone(),
    };
    add(&mut scene, "metal", even(metal));
    add(&mut scene, "mirror", even(MaterialKind::Mirror { reflectance: colour }));
    let filled = add(&mut scene, "boundary", even(MaterialKind::Null));
    scene.objects[filled as usize].boundary = Some(Boundary {
        interior: mist,
        exterior: haze,
    });
    scene.objects[2].boundary = Some(Boundary {
        interior: None,
        exterior: haze,
    });
    let lamp = add_object(&mut scene, triangle(), 0);
    let area = LightKind::Area {
        object: lamp,
        radiance: Rgb::ONE,
        pattern: None,
        two_sided: true,
        spread: None,
        soft: false,
    };
    let light = add_light(&mut scene, "lamp", area);
    scene.objects[lamp as usize].light = Some(light);
    let position = Vec3::new(0.0, 9.0, 0.0);
    let intensity = Rgb::ONE;
    add_light(&mut scene, "bulb", LightKind::Point { position, intensity });
    let spot = Spot {
        position,
        frame: Frame::from_normal(Vec3::NEG_Y),
        intensity,
        cutoff: 0.5,
        beam_width: 0.25,
        ramp: Ramp::Smooth,
        radius: 0.0,
        soft: false,
    };
    add_light(&mut scene, "spot", LightKind::Spot(spot));
    let sun = Sun {
        direction: Vec3::NEG_Y,
        irradiance: Rgb::ONE,
        half_angle: 0.0,
    };
    add_light(&mut scene, "sun", LightKind::Directional(sun));
    let sky = Environment::new(None, Rgb::ONE, Mat3::IDENTITY);
    add_light(&mut scene, "sky", LightKind::Environment(sky));
    scene.camera.filter = PixelFilter::Gaussian { stddev: 0.5 };
    scene
}
