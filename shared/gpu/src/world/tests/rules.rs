//! Visibility rules, as words of bits.

use super::*;
use crate::trace::TraceTables;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::rules::HiddenSet;

const BULBS: usize = 2;

/// A set of classes.
fn set(rules: &mut Rules, classes: &[u32]) -> HiddenSet {
    let first = classes.iter().map(|class| 1 << class).sum();
    let row = rules.rows.len() as u32;
    rules.rows.push(first);
    HiddenSet { row, first }
}

/// Two walls and two bulbs, each in its own class.
fn scene(change: impl FnOnce(&mut Rules)) -> SceneDescription {
    let mut scene = empty();
    add(&mut scene, "wall", even(diffuse(GREY)));
    add(&mut scene, "other wall", even(diffuse(GREY)));
    for position in [Vec3::X, Vec3::Y] {
        let intensity = Rgb::ONE;
        add_light(&mut scene, "bulb", LightKind::Point { position, intensity });
    }
    let sets = ObjectSets {
        is_gathered: true,
        gathers: true,
        one_ray: true,
        ..ObjectSets::default()
    };
    let mut rules = Rules {
        class: vec![0, 1, 2, 3],
        objects: 2,
        rows: vec![0],
        of_object: vec![sets; 2],
        of_light: vec![HiddenSet::default(); BULBS],
        shadow_of_light: vec![HiddenSet::default(); BULBS],
        paths_obey: true,
        ..Rules::default()
    };
    change(&mut rules);
    scene.rules = Some(rules);
    scene
}

#[test]
fn what_rays_do_not_see_is_a_word_of_bits() {
    let scene = scene(|rules| {
        rules.camera = set(rules, &[1]);
        rules.of_object[0].reflected = set(rules, &[0, 1]);
        rules.of_object[0].refracted = set(rules, &[0]);
        // The second bulb does not light it.
        rules.of_object[1].shadow = set(rules, &[0, 3]);
        rules.of_object[1].one_ray = false;
        rules.shadow_of_light[1] = set(rules, &[1]);
    });
    let world = FlatWorld::new(&Scene::new(scene), u64::MAX).unwrap();
    let bit = |class: u32| 1_u32 << (8 + class);
    let of = |number: usize| {
        let surface = &world.surfaces[number];
        let hidden = [surface.reflected, surface.refracted, surface.shadow];
        (hidden, surface.lit_by, surface.bits)
    };
    assert_eq!(of(0), ([bit(0) | bit(1), bit(0), 0], 0, 7));
    assert_eq!(of(1), ([0, 0, bit(0) | bit(3)], 2, 6));
    let class = |number: usize| world.geometry.objects[number].classes >> 8;
    assert_eq!([class(0), class(1)], [1, 2]);
    let lighting = &world.choices.lighting;
    assert_eq!(
        (lighting.has_rules, lighting.camera_hides, lighting.gather_hides),
        (1, bit(1), 0)
    );
    let sources = &world.choices.sources;
    assert_eq!([sources[0].class_bit, sources[1].class_bit], [bit(2), bit(3)]);
    assert_eq!([sources[0].hides, sources[1].hides], [0, bit(1)]);
    // For both bulbs, twice, and then for the first alone.
    assert_eq!(world.choices.tables, [0.5, 1.0, 0.5, 1.0, 1.0, 1.0]);
}

/// If no photon sees a wall, it hides none of their light from what is behind it.
#[test]
fn what_no_photon_sees_is_no_wall() {
    let scene = scene(|rules| {
        let wall = set(rules, &[1]);
        rules.of_object.iter_mut().for_each(|sets| sets.photon = wall);
        rules.of_light.fill(wall);
        rules.gather = wall;
        rules.touches_photons = true;
    });
    let world = FlatWorld::new(&Scene::new(scene), u64::MAX).unwrap();
    let is_no_wall = |number: usize| world.geometry.objects[number].classes & NO_WALLS != 0;
    assert_eq!([is_no_wall(0), is_no_wall(1)], [false, true]);
    assert_eq!(world.choices.lighting.gather_hides, 1 << 9);
}

/// Photons that see what others do not, of each kind.
#[test]
fn photons_have_words_of_their_own() {
    let mut description = scene(|rules| {
        rules.of_object[0].photon = set(rules, &[1, 2]);
        rules.of_object[1].is_gathered = false;
        rules.of_object[1].is_glossy = true;
        rules.of_light[1] = set(rules, &[0]);
        rules.of_medium = vec![set(rules, &[3])];
        rules.unlit = vec![false, true];
        rules.touches_photons = true;
        rules.paths_obey = false;
    });
    let haze = medium::Medium::Homogeneous(medium::Homogeneous {
        sigma_a: Rgb::ONE,
        sigma_s: Rgb::ONE,
        phase: Phase::Isotropic,
    });
    add_medium(&mut description, "haze", haze);
    let scene = Scene::new(description);
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let bit = |class: u32| 1_u32 << (8 + class);
    let of = |number: usize| (world.surfaces[number].photon, world.surfaces[number].bits);
    assert_eq!([of(0), of(1)], [(bit(1) | bit(2), 7), (0, 11)]);
    assert_eq!(
        world.choices.sources.iter().map(|s| s.photon_hides).collect::<Vec<_>>(),
        [0, bit(0)]
    );
    let unlit = &world.choices.tables[world.choices.lighting.unlit as usize..];
    assert_eq!(unlit, [0.0, 1.0]);
    let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
    let tables = TraceTables::new(&scene, &plan, 0);
    assert_eq!(tables.plan.ends_paths, 2);
    let of_objects: Vec<_> = tables.objects.iter().map(|o| (o.bits & 4, o.hides)).collect();
    assert_eq!(of_objects, [(0, bit(1) | bit(2)), (4, 0)]);
    let of_lights: Vec<_> = tables.lights.iter().map(|l| (l.class_bit, l.hides)).collect();
    assert_eq!(of_lights, [(bit(2), 0), (bit(3), bit(0))]);
    assert_eq!(tables.media[0].hides, bit(3));
}

#[test]
fn rules_that_kernels_have_not_are_named() {
    let many = scene(|rules| rules.class = vec![0, 1, 2, 24]);
    assert_eq!(texts(many), ["rules: there are 25, and 24 are the most"]);
}
