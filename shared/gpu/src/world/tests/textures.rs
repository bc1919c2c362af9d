//! Values over surfaces.

use super::*;
use crate::kernels::{TEXELS, TEXTURE};
use crate::testing::{EACH, same};
use crate::world::geometry::tests::Random;
use crate::world::materials::FlatMaterials;
use crate::world::textures::{Field, SurfaceTexture};
use beamfarm_render::math::Vec2;
use beamfarm_render::world::bsdf::Material;
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, TexturePoint, Wrap};
use glam::Affine2;
use std::sync::Arc;

const TEXTURE_TEST: Program = Program {
    name: "texture_test",
    texts: &[
        GROUPS,
        TEXELS,
        TEXTURE,
        "struct Place { uv: vec2f, texture: u32 }
        @group(0) @binding(0) var<storage, read> places: array<Place>;
        @group(0) @binding(1) var<storage, read_write> values: array<vec3f>;
        fn each(i: u32) {
            if (i >= arrayLength(&places)) { return; }
            values[i] = texture_value(textures[places[i].texture], places[i].uv);
        }",
        EACH,
    ],
};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Place {
    uv: [f32; 2],
    texture: u32,
    padding: u32,
}

/// Images of all sizes, filters and wraps, under all kinds of maps, and checkerboards.
fn all_textures(random: &mut Random) -> Vec<Texture> {
    let maps = [
        Affine2::IDENTITY,
        Affine2::from_scale_angle_translation(Vec2::new(2.0, -3.0), 0.5, Vec2::new(0.3, -0.2)),
        Affine2::from_cols_array(&[1e30, -1e30, 1e30, 1e30, 1e30, 0.0]),
    ];
    let mut textures = Vec::new();
    for [width, height] in [[1, 1], [2, 2], [3, 2], [1, 5], [64, 37]] {
        let pixel = |_| Rgb::new(random.unit(), 4.0 * random.unit(), random.of(&[0.0, 1.0, 1e-30]));
        let image = Arc::new(Image {
            width,
            height,
            pixels: (0..width * height).map(pixel).collect(),
            alpha: Vec::new(),
        });
        for filter in [TextureFilter::Bilinear, TextureFilter::Nearest] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                textures.extend(maps.map(|image_from_uv| Texture::Image {
                    image: image.clone(),
                    filter,
                    wrap,
                    image_from_uv,
                }));
            }
        }
        textures.extend(maps.map(|squares_from_uv| Texture::Checkerboard {
            colors: [random.point().abs(), random.point().abs()],
            squares_from_uv,
        }));
    }
    textures
}

#[test]
fn textures_have_the_values_that_the_renderer_finds() {
    let Some(tested) = tested() else { return };
    let mut random = Random(31);
    let textures = all_textures(&mut random);
    let of = |texture: &Texture| Material::new(diffuse(texture.clone()), true);
    let materials: Vec<Material> = textures.iter().map(of).collect();
    let edges = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -0.5,
        2.0,
        1e-30,
        -1e-30,
        -1e-8,
        1e-8,
        0.999_999_94,
        1.000_000_1,
        1e7,
        -1e9,
        f32::MAX,
        f32::MIN,
    ];
    let place = |i: usize| {
        let mut coordinate = || match random.bits() % 8 {
            0 => random.of(&edges),
            // On an edge between pixels, or at the centre of one.
            1 => (random.bits() % 128) as f32 / random.of(&[2.0, 3.0, 6.0, 64.0, 128.0, 37.0]),
            2 => 1000.0 * random.unit() - 500.0,
            3 => random.unit(),
            _ => 6.0 * random.unit() - 3.0,
        };
        Place {
            uv: [coordinate(), coordinate()],
            texture: (i % materials.len()) as u32,
            padding: 0,
        }
    };
    let places: Vec<Place> = (0..100_000).map(place).collect();
    let device = &tested.device;
    let buffers = FlatMaterials::of(materials.iter().map(Some))
        .textures
        .upload(device, None)
        .unwrap();
    let input = device.buffer("places", &places).unwrap();
    let output = device.empty("values", 16 * places.len() as u64).unwrap();
    let given = [&[&input, &output][..], &buffers.in_order()].concat();
    let kernel = tested.kernel(&TEXTURE_TEST, "main");
    let mut work = device.work();
    work.run(&kernel, &given, Groups::Count(places.len().div_ceil(64) as u32))
        .unwrap();
    work.submit().unwrap();
    let values: Vec<[f32; 4]> = device.read(&output, places.len()).unwrap();
    for (place, found) in places.iter().zip(values) {
        let texture = &textures[place.texture as usize];
        let expected = texture.eval(&TexturePoint::of_uv(place.uv.into())).to_array();
        assert!(
            same(&found[..3], &expected),
            "{place:?} of {texture:?}: {found:?}, expected {expected:?}"
        );
    }
}

/// An image that many materials share is stored once; a constant has no texture.
#[test]
fn images_are_brought_to_a_device_once() {
    let image = image();
    let of = |wrap| {
        Material::new(
            diffuse(Texture::Image {
                image: image.clone(),
                filter: TextureFilter::Nearest,
                wrap,
                image_from_uv: Affine2::from_translation(Vec2::new(0.5, 0.25)),
            }),
            true,
        )
    };
    let materials = [
        Material::new(diffuse(squares()), true),
        of(Wrap::Mirror),
        Material::new(diffuse(GREY), true),
        of(Wrap::Clamp),
        Material::new(MaterialKind::Null, true),
    ];
    let flat = FlatMaterials::of(materials.iter().map(Some)).textures;
    let texture = |kind: u32, first: u32, size: u32, translation: [f32; 2]| SurfaceTexture {
        x_axis: [1.0, 0.0],
        y_axis: [0.0, 1.0],
        translation,
        kind,
        first,
        width: size,
        height: size,
        field: Field::Reflectance as u32,
        padding: 0,
    };
    let moved = [0.5, 0.25];
    let [mirrored, clamped] = [1 | 4 | 8, 1 | 4 | 16].map(|kind| texture(kind, 2, 2, moved));
    let expected = [texture(2, 0, 0, [0.0; 2]), mirrored, clamped];
    assert_eq!(flat.textures, expected);
    let pixels = [[1.0; 3], [0.1; 3], [1.0; 3], [0.0; 3], [1.0; 3], [0.5; 3]];
    assert_eq!(flat.texels, pixels);
}

#[test]
fn structs_of_textures_are_the_same_in_kernels() {
    same_layout!(
        &TEXTURE_TEST,
        SurfaceTexture {
            x_axis,
            y_axis,
            translation,
            kind,
            first,
            width,
            height,
            field,
            padding
        }
    );
}
