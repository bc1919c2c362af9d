//! Passes of scenes with dispersion, against the processor's: see `expectation.rs`.

use super::expectation::{agrees, by_paths, lit_room, small};
use super::smoke::in_smoke;
use super::{ball, fill, fog, is_long};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{
    Dispersion, Distribution, Extras, Index, Interface, Material, MaterialDescription, MaterialKind, Tint,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::Texture;

/// A strongly dispersive material.
fn split(kind: MaterialKind, nd: f64, abbe: f64) -> Material {
    let dispersion = Dispersion {
        inside: Index::of_abbe(nd, abbe),
        outside: Index::Constant(1.0),
    };
    let description = MaterialDescription {
        dispersion: Some(Box::new(dispersion)),
        ..MaterialDescription::new(kind, true)
    };
    description.into()
}

fn clear(nd: f64, abbe: f64) -> Material {
    let (eta, tint) = (nd as f32, Tint::NONE);
    split(MaterialKind::Dielectric { eta, tint }, nd, abbe)
}

fn add(scene: &mut SceneDescription, material: Material) -> u32 {
    scene.materials.push(material);
    scene.materials.len() as u32 - 1
}

/// A ball of flint glass in a room with a lamp.
fn flint() -> SceneDescription {
    let mut scene = lit_room();
    let flint = add(&mut scene, clear(1.7, 8.0));
    ball(&mut scene, [-0.5, -0.2, 0.1], 0.7, flint);
    scene
}

/// The same in fog, with a ball of another glass next to it.
pub(super) fn flint_in_fog() -> SceneDescription {
    let mut scene = flint();
    let mist = fog(&mut scene, 0.1, 0.3);
    scene.world_medium = mist;
    let number = scene.objects.len() as u32 - 1;
    fill(&mut scene, number, None, mist);
    let other = add(&mut scene, clear(1.4, 20.0));
    let other = ball(&mut scene, [0.8, 0.9, -0.3], 0.4, other);
    fill(&mut scene, other, None, mist);
    scene
}

#[test]
fn light_that_is_split_on_the_way_of_paths() {
    agrees("split by paths", by_paths(flint()), 0.05);
}

#[test]
fn light_that_is_split_on_the_way_of_photons() {
    agrees("split with photons", flint(), 0.05);
}

#[test]
fn light_that_is_split_in_fog() {
    if !is_long() {
        return;
    }
    agrees("split in fog", small(flint_in_fog()), 0.1);
}

/// Paths scatter in it.
#[test]
fn light_that_is_split_in_fog_by_paths() {
    agrees("split in fog by paths", small(by_paths(flint_in_fog())), 0.2);
}

/// The combination needs other kernels, which take long to compile.
#[test]
fn light_that_is_split_in_smoke() {
    if !is_long() {
        return;
    }
    let mut scene = in_smoke();
    let flint = add(&mut scene, clear(1.7, 8.0));
    ball(&mut scene, [0.6, 0.9, -0.2], 0.5, flint);
    agrees("split in smoke", small(scene), 0.1);
}

/// Balls of rough glass and of a partly glass blend; with coated glass.
fn rough(is_coated: bool) -> SceneDescription {
    let mut scene = lit_room();
    let white = || Texture::Constant(Rgb::ONE);
    let frosted = |alpha: f32| MaterialKind::RoughDielectric {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(alpha),
        eta: 1.6,
        tint: Tint::NONE,
    };
    let coated = MaterialKind::Principled {
        base_color: white(),
        metallic: Scalar::constant(0.1),
        roughness: Scalar::constant(0.2),
        interface: Interface::Eta(1.6),
        extras: Some(Box::new(Extras {
            spec_trans: Scalar::constant(0.9),
            clearcoat: Scalar::constant(0.5),
            ..Extras::NONE
        })),
    };
    let paint = MaterialKind::Diffuse {
        reflectance: Texture::Constant(Rgb::new(0.2, 0.6, 0.3)),
    };
    let blend = MaterialKind::Blend {
        parts: Box::new([Material::new(paint, true), clear(1.7, 8.0)]),
        weight: Texture::Constant(Rgb::splat(0.6)),
    };
    let mut surfaces = vec![
        split(frosted(0.3), 1.6, 10.0),
        split(frosted(0.05), 1.6, 10.0),
        Material::new(blend, true),
    ];
    if is_coated {
        surfaces.push(split(coated, 1.6, 10.0));
    }
    for (i, surface) in surfaces.into_iter().enumerate() {
        let (x, y) = ((i % 2) as f32 - 0.8, 0.8 - (i / 2) as f32);
        let surface = add(&mut scene, surface);
        ball(&mut scene, [x, y, 0.0], 0.42, surface);
    }
    scene
}

/// The combination needs other kernels, which take long to compile.
#[test]
fn rough_surfaces_split_light_on_the_way_of_paths() {
    if !is_long() {
        return;
    }
    agrees("rough surfaces split by paths", by_paths(rough(true)), 0.1);
}

#[test]
fn rough_surfaces_split_light_on_the_way_of_photons() {
    if !is_long() {
        return;
    }
    agrees("rough surfaces split with photons", rough(false), 0.2);
}
