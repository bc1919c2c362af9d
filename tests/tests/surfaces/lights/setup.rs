//! Lights and shapes of every kind.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks_by, blur, truth};
use beamfarm_image::job::{Technique, Techniques};
use beamfarm_image::layer::LightGroup;
use beamfarm_render::math::{Frame, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
use beamfarm_render::world::light::{Environment, Light, LightKind, Pattern, Ramp, SceneBounds, Spot, Sun};
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use glam::{Affine2, Affine3A, Mat3};
use std::sync::Arc;

/// Chance of a false alarm per test function, if everything is right and the seeds were fresh.
pub const SIGNIFICANCE: f64 = 0.01;

pub const SAMPLES: u64 = 200_000;

pub const RADIANCE: Rgb = Rgb::new(3.0, 2.0, 0.5);

pub const BOUNDS: SceneBounds = SceneBounds {
    center: Vec3::new(1.0, -2.0, 0.5),
    radius: 7.0,
};

pub fn light(kind: LightKind) -> Light {
    Light {
        name: String::new(),
        kind,
        group: LightGroup::named(""),
    }
}

pub fn placement(map: Affine3A) -> Placement {
    Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    }
}

pub fn sphere(map: Affine3A) -> Shape {
    Shape::Sphere {
        placement: placement(map),
        flip: false,
    }
}

pub fn ball(center: Vec3, radius: f32) -> Shape {
    sphere(Affine3A::from_translation(center) * Affine3A::from_scale(Vec3::splat(radius)))
}

pub fn disc(map: Affine3A) -> Shape {
    Shape::Disc {
        placement: placement(map),
        flip: false,
    }
}

pub fn cylinder(map: Affine3A, flip: bool) -> Shape {
    Shape::Cylinder {
        placement: placement(map),
        flip,
    }
}

pub fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Shape {
    Shape::Mesh {
        mesh: Arc::new(Mesh {
            positions,
            triangles,
            ..Mesh::default()
        }),
        placement: Placement::IDENTITY,
    }
}

/// A rectangle spanned by two edges from a corner; its normal is their cross product.
pub fn rectangle(corner: Vec3, a: Vec3, b: Vec3) -> Shape {
    mesh(
        vec![corner, corner + a, corner + a + b, corner + b],
        vec![[0, 1, 2], [0, 2, 3]],
    )
}

/// A tetrahedron around the origin, all corners at distance `size`.
pub fn tetrahedron(center: Vec3, size: f32) -> Shape {
    let corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
    mesh(
        corners
            .iter()
            .map(|c| center + Vec3::from(c.map(|x| x as f32)).normalize() * size)
            .collect(),
        vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    )
}

pub fn emitter(shape: Shape) -> (Vec<Object>, Light) {
    let object = Object {
        light: Some(0),
        ..Object::new(shape)
    };
    let kind = LightKind::Area {
        object: 0,
        radiance: RADIANCE,
        pattern: None,
        two_sided: false,
        spread: None,
        soft: false,
    };
    (vec![object], light(kind))
}

/// The same, its radiance varying by an image.
pub fn patterned(shape: Shape) -> (Vec<Object>, Light) {
    let texture = Texture::Image {
        image: Arc::new(speckled(3, 2, 2.0)),
        filter: TextureFilter::Bilinear,
        wrap: Wrap::Repeat,
        image_from_uv: Affine2::IDENTITY,
    };
    let pattern = Pattern::new(texture, RADIANCE, &shape, None).map(|(pattern, mean)| (Arc::new(pattern), mean));
    let (objects, mut light) = emitter(shape);
    if let (
        LightKind::Area {
            radiance,
            pattern: of_light,
            ..
        },
        Some((pattern, mean)),
    ) = (&mut light.kind, pattern)
    {
        (*radiance, *of_light) = (mean, Some(pattern));
    }
    (objects, light)
}

pub fn point(position: Vec3) -> Light {
    light(LightKind::Point {
        position,
        intensity: RADIANCE,
    })
}

pub fn spot(position: Vec3, axis: Vec3, beam_width: f32, cutoff: f32) -> Light {
    light(LightKind::Spot(Spot {
        position,
        frame: Frame::from_normal(axis.normalize()),
        intensity: RADIANCE,
        cutoff: cutoff.to_radians(),
        beam_width: beam_width.to_radians(),
        ramp: Ramp::Linear,
        radius: 0.0,
        soft: false,
    }))
}

/// The same spot as a ball and with another ramp.
pub fn of_ball(mut light: Light, radius: f32, ramp: Ramp) -> Light {
    if let LightKind::Spot(spot) = &mut light.kind {
        (spot.radius, spot.ramp) = (radius, ramp);
    }
    light
}

pub fn sun(direction: Vec3) -> Light {
    wide_sun(direction, 0.0)
}

/// `angle`: the full angle, in degrees.
pub fn wide_sun(direction: Vec3, angle: f32) -> Light {
    light(LightKind::Directional(Sun {
        direction: direction.normalize(),
        irradiance: RADIANCE,
        half_angle: 0.5 * angle.to_radians(),
    }))
}

pub fn sky(image: Option<Image>) -> Light {
    let rotation = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-0.4);
    let image = image.map(Arc::new);
    light(LightKind::Environment(Environment::new(image, RADIANCE, rotation)))
}

/// Pixels of random brightness, some black, one `peak` times as bright.
pub fn speckled(width: u32, height: u32, peak: f32) -> Image {
    let mut rng = Sampler::new(5, 0, Purpose::Test, 0);
    let mut pixels: Vec<Rgb> = (0..width * height)
        .map(|_| {
            let lit = if rng.next_1d() < 0.5 { 0.0 } else { 1.0 };
            Rgb::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * lit
        })
        .collect();
    let at = pixels.len() / 3;
    pixels[at] = Rgb::splat(peak);
    Image {
        width,
        height,
        pixels,
        alpha: Vec::new(),
    }
}

/// Shapes of every kind, with a name.
pub fn shapes() -> Vec<(&'static str, Shape)> {
    let tilt = Affine3A::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 0.8);
    let at = Affine3A::from_translation(Vec3::new(0.5, 0.3, -1.0));
    vec![
        ("ball", ball(Vec3::new(0.5, 0.3, -1.0), 0.4)),
        (
            "ellipsoid",
            sphere(at * tilt * Affine3A::from_scale(Vec3::new(1.0, 0.3, 0.6))),
        ),
        ("disc", disc(at * tilt * Affine3A::from_scale(Vec3::new(0.8, 0.5, 1.0)))),
        (
            "cylinder",
            cylinder(at * tilt * Affine3A::from_scale(Vec3::new(0.3, 0.5, 1.2)), false),
        ),
        (
            "rectangle",
            rectangle(
                Vec3::new(-1.0, 0.0, -0.5),
                Vec3::new(1.2, 0.1, 0.0),
                Vec3::new(0.3, 0.2, 0.9),
            ),
        ),
        ("tetrahedron", tetrahedron(Vec3::new(0.5, 0.3, -1.0), 0.8)),
    ]
}

pub const PHOTONS: Option<Technique> = Some(Technique::Photons);
pub const PATHS: Option<Technique> = Some(Technique::Paths);

/// Every technique, for media, surfaces and caustics, finds the light that the path tracer finds. `images`: how many of
/// the path tracer.
pub fn found_once(scene: &Scene, ways: &[[Option<Technique>; 3]], images: u64) {
    let mut suite = Suite::new(SIGNIFICANCE);
    let truth = truth(scene, images, 8, 8);
    for (seed, &[media, surfaces, caustics]) in (0..).zip(ways) {
        let techniques = Techniques {
            media,
            surfaces,
            caustics,
            aimed: None,
        };
        let found = blocks_by(scene, techniques, seed, 8);
        suite.same_blocks(&techniques.to_string(), &found, &truth, 5e-3);
        assert!(
            found.noise(&truth) < 0.03 * blur(),
            "{techniques}: {}",
            found.noise(&truth)
        );
    }
    suite.finish();
}

/// A lamp over a glass ball, on a ground of this size.
pub fn on_a_ground(size: f32) -> String {
    format!(
        r#"
[image]
width = 32
height = 32
[render]
passes = 128
paths = 8000
radius = 0.02
[camera]
origin = [0.2, 1.6, 2.2]
target = [-0.35, 0.0, -0.1]
fov = 30.0
[materials.floor]
type = "diffuse"
reflectance = 0.5
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.57
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = {size} }}]
material = "floor"
[[shapes]]
type = "sphere"
center = [-0.45, 0.56, -0.045]
radius = 0.186
material = "glass"
[[shapes]]
type = "rectangle"
transform = [{{ scale = 0.08 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0.0, 2.2, 0.2] }}]
emission = {{ radiance = 55.0 }}
"#
    )
}
