//! Scenes for tests of light sampling.

use super::*;
use crate::world::tests::scenes::{GREY, add_light, add_object, diffuse, empty, even};
use beamfarm_render::math::{Frame, Vec2};
use beamfarm_render::world::geometry::{Mesh, Placement, Shape};
use beamfarm_render::world::light::{Environment, Pattern, Projector, Ramp, Spot, Sun, lit_part};
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use glam::{Affine2, Affine3A, Mat3, Quat};
use std::sync::Arc;

pub const VALUE: Rgb = Rgb::new(1.5, 0.25, 30.0);

pub fn point_light(position: Vec3) -> LightKind {
    LightKind::Point {
        position,
        intensity: VALUE,
    }
}

pub fn sky(value: Rgb) -> LightKind {
    LightKind::Environment(Environment::new(None, value, Mat3::IDENTITY))
}

pub fn sun(direction: Vec3, half_angle: f32) -> LightKind {
    LightKind::Directional(Sun {
        direction: direction.normalize(),
        irradiance: VALUE,
        half_angle,
    })
}

/// An emitting surface of triangles.
pub fn add_lamp(scene: &mut SceneDescription, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, two_sided: bool) {
    let mesh = Mesh {
        positions,
        triangles,
        ..Mesh::default()
    };
    let shape = Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    };
    let object = add_object(scene, shape, 0);
    let kind = LightKind::Area {
        object,
        radiance: VALUE,
        pattern: None,
        two_sided,
        spread: None,
        soft: false,
    };
    let light = add_light(scene, "lamp", kind);
    scene.objects[object as usize].light = Some(light);
}

/// A round emitter, rotated, stretched by `scale` and moved: a ball, or a disc.
pub fn add_round_lamp(scene: &mut SceneDescription, scale: Vec3, is_ball: bool, [flip, two_sided]: [bool; 2]) {
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
    let map = Affine3A::from_scale_rotation_translation(scale, turn, Vec3::new(0.5, -0.25, 1.0));
    let placement = Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    };
    let shape = match is_ball {
        true => Shape::Sphere { placement, flip },
        false => Shape::Disc { placement, flip },
    };
    let object = add_object(scene, shape, 0);
    let kind = LightKind::Area {
        object,
        radiance: VALUE,
        pattern: None,
        two_sided,
        spread: None,
        soft: false,
    };
    let light = add_light(scene, "lamp", kind);
    scene.objects[object as usize].light = Some(light);
}

pub fn add_lamps(scene: &mut SceneDescription) {
    let corners = vec![
        Vec3::new(2.0, 1.0, 0.5),
        Vec3::new(3.0, 1.1, 0.5),
        Vec3::new(3.0, 2.0, -0.5),
        Vec3::new(2.0, 1.9, -0.5),
    ];
    add_lamp(scene, corners.clone(), vec![[0, 1, 2]], false);
    add_lamp(scene, corners.clone(), vec![[0, 1, 2]], true);
    let moved = corners.iter().map(|p| *p - Vec3::Y * 4.0).collect();
    add_lamp(scene, moved, vec![[0, 1, 2], [0, 2, 3]], false);
    // A rough sheet of triangles of many sizes.
    let mut chance = Chance::new(8);
    let positions = (0..20).map(|_| chance.direction() * chance.unit() - Vec3::X * 3.0);
    add_lamp(
        scene,
        positions.collect(),
        (0..18).map(|i| [i, i + 1, i + 2]).collect(),
        false,
    );
}

pub fn spot(beam_width: f32, cutoff: f32, ramp: Ramp, radius: f32, chance: &mut Chance) -> LightKind {
    LightKind::Spot(Spot {
        position: chance.direction() * 2.0,
        frame: Frame::from_normal(chance.direction()),
        intensity: VALUE,
        cutoff,
        beam_width,
        ramp,
        radius,
        soft: false,
    })
}

/// One or more of each kind.
pub fn all_kinds() -> SceneDescription {
    let mut scene = empty();
    scene.materials.push(even(diffuse(GREY)).into());
    scene.bounds.radius = 6.0;
    let mut chance = Chance::new(9);
    add_light(&mut scene, "bulb", point_light(Vec3::new(1.0, -2.5, 3.0)));
    for kind in [
        spot(0.2, 0.35, Ramp::Linear, 0.0, &mut chance),
        spot(0.3, 0.300_01, Ramp::Linear, 0.0, &mut chance),
        spot(0.0, 1.2, Ramp::Linear, 0.4, &mut chance),
        spot(0.1, 0.12, Ramp::Linear, 0.3, &mut chance),
        spot(0.1, 0.5, Ramp::Smooth, 0.4, &mut chance),
        spot(0.0, 1.5, Ramp::Smooth, 0.0, &mut chance),
        spot(1.0, 2.2, Ramp::Linear, 0.1, &mut chance),
        sun(Vec3::new(0.1, -1.0, 0.3), 0.0),
        sun(Vec3::new(0.5, -1.0, -0.3), 0.0047),
        sun(Vec3::new(-0.5, 1.0, -0.3), 1.2),
        sky(VALUE),
    ] {
        add_light(&mut scene, "light", kind);
    }
    add_lamps(&mut scene);
    scene
}

/// A random image, black in places, with a bright spot.
pub fn picture(width: u32, height: u32, chance: &mut Chance) -> Arc<Image> {
    let pixel = |_| match chance.unit() {
        x if x < 0.3 => Rgb::ZERO,
        x if x > 0.95 => Rgb::new(20.0, 10.0, 5.0),
        x => Rgb::new(x, chance.unit(), chance.unit()),
    };
    Arc::new(Image {
        width,
        height,
        pixels: (0..width * height).map(pixel).collect(),
        alpha: Vec::new(),
    })
}

pub fn projector(filter: TextureFilter, cone: Option<[f32; 2]>, chance: &mut Chance) -> LightKind {
    let frame = Frame::from_normal(chance.direction());
    let mut image = (*picture(9, 7, chance)).clone();
    // Dark on the left and at the bottom.
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        if i % 9 < 3 || i / 9 > 4 {
            *pixel = Rgb::ZERO;
        }
    }
    LightKind::Projector(Projector {
        position: chance.direction() * 2.0,
        axes: [frame.s, frame.t, frame.n],
        half: match cone {
            Some([cutoff, _]) => Vec2::splat(beamfarm_render::math::tan(cutoff)),
            None => Vec2::new(0.8, 0.4),
        },
        lit: lit_part(&image, filter),
        image: Arc::new(image),
        filter,
        intensity: VALUE,
        cone,
    })
}

/// Gives the newest lamp a varying radiance.
fn vary(scene: &mut SceneDescription, texture: Texture) {
    let Some(LightKind::Area {
        object,
        radiance,
        pattern,
        ..
    }) = scene.lights.last_mut().map(|light| &mut light.kind)
    else {
        panic!("it is no lamp")
    };
    let shape = &scene.objects[*object as usize].shape;
    let (found, mean) = Pattern::new(texture, VALUE, shape, None).unwrap();
    (*radiance, *pattern) = (mean, Some(Arc::new(found)));
}

/// Skies, projectors, and lamps of varying radiance.
pub fn pictures() -> SceneDescription {
    let mut scene = empty();
    scene.materials.push(even(diffuse(GREY)).into());
    scene.bounds.radius = 6.0;
    let mut chance = Chance::new(12);
    let turn = Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 2.1);
    let mirrored = turn * Mat3::from_diagonal(Vec3::new(1.0, 1.0, -1.0));
    for (width, height, turn) in [(16, 9, turn), (5, 12, mirrored), (1, 1, Mat3::IDENTITY)] {
        let image = match width {
            1 => Arc::new(Image {
                width,
                height,
                pixels: vec![Rgb::ONE],
                alpha: Vec::new(),
            }),
            _ => picture(width, height, &mut chance),
        };
        let sky = Environment::new(Some(image), VALUE, turn);
        add_light(&mut scene, "sky", LightKind::Environment(sky));
    }
    for (filter, cone) in [
        (TextureFilter::Bilinear, None),
        (TextureFilter::Nearest, Some([0.6, 0.4])),
    ] {
        let kind = projector(filter, cone, &mut chance);
        add_light(&mut scene, "projector", kind);
    }
    let mut image = |filter: TextureFilter, wrap: Wrap| Texture::Image {
        image: picture(6, 5, &mut chance),
        filter,
        wrap,
        image_from_uv: Affine2::from_scale_angle_translation(Vec2::new(1.5, 0.7), 0.4, Vec2::new(0.2, -0.1)),
    };
    add_lamps(&mut scene);
    vary(&mut scene, image(TextureFilter::Bilinear, Wrap::Repeat));
    let corners = [[-1.0, -4.0], [1.0, -4.0], [1.0, -3.0], [-1.0, -3.0]];
    let mesh = Mesh {
        positions: corners.map(|[x, y]| Vec3::new(x, y, 0.5 * x)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![Vec2::ZERO, Vec2::X * 2.0, Vec2::new(2.0, 1.0), Vec2::Y],
        ..Mesh::default()
    };
    let (positions, triangles) = (mesh.positions.clone(), mesh.triangles.clone());
    add_lamp(&mut scene, positions, triangles, true);
    if let Some(object) = scene.objects.last_mut() {
        object.shape = Shape::Mesh {
            mesh: Arc::new(mesh),
            placement: Placement::IDENTITY,
        };
    }
    vary(&mut scene, image(TextureFilter::Nearest, Wrap::Mirror));
    for (scale, is_ball, sides) in [
        (Vec3::splat(0.75), true, [false, false]),
        (Vec3::splat(0.5), true, [true, true]),
        (Vec3::new(0.5, 2.0, 1.0), false, [false, true]),
    ] {
        add_round_lamp(&mut scene, scale, is_ball, sides);
        vary(&mut scene, image(TextureFilter::Bilinear, Wrap::Clamp));
    }
    let colors = [Rgb::ONE, Rgb::new(0.0, 0.5, 0.25)];
    add_round_lamp(&mut scene, Vec3::splat(0.3), true, [false, false]);
    let squares_from_uv = Affine2::from_scale(Vec2::new(6.0, 3.0));
    vary(
        &mut scene,
        Texture::Checkerboard {
            colors,
            squares_from_uv,
        },
    );
    scene
}

/// This many bulbs, the last of them far away and dark.
pub fn bulbs(count: u16) -> SceneDescription {
    let mut scene = empty();
    let mut chance = Chance::new(u64::from(count));
    for i in 0..count {
        let intensity = VALUE * f32::from(count - 1 - i);
        let position = chance.direction() * 3.0;
        add_light(&mut scene, "bulb", LightKind::Point { position, intensity });
    }
    scene
}
