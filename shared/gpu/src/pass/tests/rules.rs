//! Passes with visibility rules have the processor's expectation.

use super::expectation::{agrees, by_paths, small};
use super::{add_light, ball, fill, fog, glass, lamp, material, matt, plan, render, room, stage};
use crate::testing::tested;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::world::bsdf::{BsdfFlags, Distribution, MaterialDescription, MaterialKind, RoughCoat};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::rules::{HiddenSet, ObjectSets, Rules};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use beamfarm_render::world::{Scene, SceneDescription};

/// Assembles what rays do not see; a class per object, and then per light.
struct Unseen {
    things: Vec<usize>,
    rules: Rules,
}

impl Unseen {
    fn new(scene: &SceneDescription) -> Self {
        let (objects, lights) = (scene.objects.len(), scene.lights.len());
        let sets = ObjectSets {
            is_gathered: true,
            gathers: true,
            ..ObjectSets::default()
        };
        let nothing = HiddenSet::default();
        Self {
            things: (0..objects + lights).collect(),
            rules: Rules {
                class: (0..(objects + lights) as u32).collect(),
                objects,
                rows: vec![0],
                of_object: vec![sets; objects],
                of_light: vec![nothing; lights],
                shadow_of_light: vec![nothing; lights],
                of_medium: vec![nothing; scene.media.len()],
                unlit: vec![false; scene.media.len() * lights],
                light_kinds: (
                    (0..lights as u8).collect(),
                    (0..lights).map(|light| (objects + light) as u32).collect(),
                ),
                rules: 1,
                paths_obey: true,
                ..Rules::default()
            },
        }
    }

    /// A set of objects and lights.
    fn set(&mut self, objects: &[u32], lights: &[usize]) -> HiddenSet {
        let lights = lights.iter().map(|light| self.rules.objects + light);
        let things = objects.iter().map(|object| *object as usize).chain(lights);
        let first = things.map(|thing| 1 << self.things[thing]).sum();
        let row = self.rules.rows.len() as u32;
        self.rules.rows.push(first);
        HiddenSet { row, first }
    }

    /// For all photons.
    fn photons(&mut self, set: HiddenSet) {
        let rules = &mut self.rules;
        rules.of_object.iter_mut().for_each(|sets| sets.photon = set);
        rules.of_light.fill(set);
        rules.of_medium.fill(set);
        let lights = rules.of_light.len();
        for (i, unlit) in rules.unlit.iter_mut().enumerate() {
            *unlit = rules.rows[set.row as usize] >> (rules.objects + i % lights) & 1 == 1;
        }
        rules.gather = set;
        rules.touches_photons = true;
    }

    fn finished(mut self, mut scene: SceneDescription) -> SceneDescription {
        let objects = (1_u32 << self.rules.objects) - 1;
        let common = self.rules.gather.first & objects;
        for (number, sets) in self.rules.of_object.iter_mut().enumerate() {
            sets.one_ray = sets.shadow.first & objects == common;
            if self.rules.paths_obey {
                // Photons that see the same from everywhere.
                sets.photon = self.rules.gather;
            }
            sets.is_gathered = sets.photon.first & objects == common;
            let material = &scene.materials[scene.objects[number].material as usize];
            let seen = sets.reflected.first | sets.refracted.first;
            sets.is_glossy = material.has(BsdfFlags::ROUGH) && seen != 0;
        }
        scene.rules = Some(self.rules);
        scene
    }
}

fn add_bulb(scene: &mut SceneDescription, position: [f32; 3], intensity: [f32; 3]) {
    let (position, intensity) = (Vec3::from_array(position), Rgb::from_array(intensity));
    add_light(scene, "bulb", LightKind::Point { position, intensity });
}

/// Objects: six walls, a red ball, a lamp, a mirror, a green and a white ball. Lights: the lamp and two bulbs. Hardly
/// any light is reflected twice, which keeps noise low compared with the hidden light.
fn things() -> SceneDescription {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.1; 3]);
    room(&mut scene, grey);
    let red = matt(&mut scene, [0.3, 0.1, 0.05]);
    ball(&mut scene, [0.7, -0.6, -0.5], 0.6, red);
    lamp(&mut scene, 0.6, [4.0, 3.0, 2.0]);
    let reflectance = Texture::Constant(Rgb::splat(0.9));
    let mirror = material(&mut scene, MaterialKind::Mirror { reflectance }, true);
    ball(&mut scene, [-0.9, 0.3, -0.8], 0.8, mirror);
    let green = matt(&mut scene, [0.1, 0.3, 0.1]);
    ball(&mut scene, [0.2, 0.6, -0.2], 0.4, green);
    let white = matt(&mut scene, [0.3; 3]);
    ball(&mut scene, [-0.2, -1.0, -0.8], 0.5, white);
    add_bulb(&mut scene, [1.5, 1.5, 1.0], [8.0, 4.0, 4.0]);
    add_bulb(&mut scene, [-1.5, 1.0, 1.0], [4.0, 4.0, 8.0]);
    scene
}

const FLOOR: usize = 3;
const RED: u32 = 6;
const LAMP: u32 = 7;
const MIRROR: usize = 8;
const GREEN: u32 = 9;
const WHITE: u32 = 10;

/// Rules for rays of camera paths: only the mirror shows the red ball, and it shows neither lamp nor green ball; walls
/// receive no shadow from the green ball, the floor no light from one bulb; the other bulb shines through the white
/// ball, which the lamp does not light.
fn seen_by_some(scene: SceneDescription) -> SceneDescription {
    let mut unseen = Unseen::new(&scene);
    unseen.rules.camera = unseen.set(&[RED], &[]);
    let in_mirror = unseen.set(&[GREEN, LAMP], &[]);
    unseen.rules.of_object[MIRROR].reflected = in_mirror;
    let from_floor = unseen.set(&[GREEN], &[1]);
    unseen.rules.of_object[FLOOR].shadow = from_floor;
    let from_walls = unseen.set(&[GREEN], &[]);
    for wall in [0, 1, 2, 4, 5] {
        unseen.rules.of_object[wall].shadow = from_walls;
    }
    let to_bulb = unseen.set(&[WHITE], &[]);
    unseen.rules.shadow_of_light[2] = to_bulb;
    let from_white = unseen.set(&[], &[0]);
    unseen.rules.of_object[WHITE as usize].shadow = from_white;
    unseen.finished(scene)
}

/// With little light but that of bulbs, both engines agree pixel by pixel, except at edges.
#[test]
fn shadows_and_mirrors_obey_by_pixels() {
    let Some(tested) = tested() else { return };
    let mut scene = things();
    for material in &mut scene.materials {
        if let MaterialKind::Diffuse { reflectance } = &material.kind {
            let dark = reflectance.eval(&TexturePoint::default()) * 0.1;
            let kind = MaterialKind::Diffuse {
                reflectance: Texture::Constant(dark),
            };
            *material = MaterialDescription::new(kind, true).into();
        }
    }
    let LightKind::Area { radiance, .. } = &mut scene.lights[0].kind else {
        panic!("it is no lamp")
    };
    *radiance = Rgb::splat(0.02);
    let scene = Scene::new(seen_by_some(by_paths(scene)));
    let plan = plan(&scene, 3);
    let mut sums = [vec![0.0; 32 * 32], vec![0.0; 32 * 32]];
    for pass_index in 0..24 {
        let own = render_pass(&scene, &plan, pass_index).unwrap();
        let got = render(tested, &scene, &plan, pass_index);
        for (sums, film) in sums.iter_mut().zip([own.film, got.film]) {
            let pixels = film.pixels.iter().map(|[r, g, b]| r + g + b);
            sums.iter_mut().zip(pixels).for_each(|(sum, pixel)| *sum += pixel);
        }
    }
    let [own, got] = &sums;
    let differs = |(own, got): &(&f32, &f32)| (*got - *own).abs() > 0.1 * (*own + *got);
    let differ = own.iter().zip(got).filter(differs).count();
    println!("{differ} pixels differ");
    assert!(differ < 40, "{differ} pixels differ");
}

#[test]
fn things_that_some_rays_see() {
    agrees("things that some rays see", seen_by_some(things()), 0.05);
}

#[test]
fn things_that_some_rays_of_paths_see() {
    agrees(
        "things that some rays of paths see",
        by_paths(seen_by_some(things())),
        0.05,
    );
}

/// No photon sees the green ball, and one bulb has no photons; the lamp is hidden from the floor, so that no ray lights
/// the floor.
fn seen_by_no_photon(mut scene: SceneDescription) -> SceneDescription {
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [0.9, 0.6, -0.5], 0.4, clear);
    let mut unseen = Unseen::new(&scene);
    let photons = unseen.set(&[GREEN], &[1]);
    unseen.photons(photons);
    let from_floor = unseen.set(&[LAMP], &[]);
    unseen.rules.of_object[FLOOR].shadow = from_floor;
    unseen.finished(scene)
}

#[test]
fn things_that_no_photon_sees() {
    agrees("things that no photon sees", small(seen_by_no_photon(things())), 0.1);
}

#[test]
fn things_that_no_path_through_fog_sees() {
    let scene = by_paths(seen_by_no_photon(things()));
    agrees("things that no path through fog sees", small(scene), 0.2);
}

/// A coat of some roughness over a grey base.
fn coat(scene: &mut SceneDescription, alpha: f32) -> u32 {
    let kind = MaterialKind::RoughPlastic {
        reflectance: Texture::Constant(Rgb::splat(0.3)),
        specular_reflectance: Texture::Constant(Rgb::ONE),
        coat: Box::new(RoughCoat::new(Distribution::Ggx, alpha, 1.5, false)),
    };
    material(scene, kind, true)
}

/// The white ball is coated and the mirror is rough metal: neither shows the red ball, the metal shows no lamp, the
/// coat no light from one bulb.
fn seen_in_gloss(mut scene: SceneDescription) -> SceneDescription {
    let coated = coat(&mut scene, 0.2);
    scene.objects[WHITE as usize].material = coated;
    let reflectance = Texture::Constant(Rgb::splat(0.9));
    let metal = MaterialKind::RoughConductor {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(0.3),
        eta: Rgb::splat(0.2),
        k: Rgb::splat(3.0),
        reflectance,
    };
    scene.objects[MIRROR].material = material(&mut scene, metal, true);
    let mut unseen = Unseen::new(&scene);
    unseen.rules.of_object[MIRROR].reflected = unseen.set(&[RED, LAMP], &[]);
    unseen.rules.of_object[WHITE as usize].reflected = unseen.set(&[RED], &[1]);
    unseen.rules.of_object[WHITE as usize].shadow = unseen.set(&[GREEN], &[]);
    unseen.finished(scene)
}

#[test]
fn gloss_that_shows_some_things() {
    // Photons that continue to its caustics.
    let mut scene = things();
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [0.9, 0.6, -0.5], 0.4, clear);
    agrees("gloss that shows some things", seen_in_gloss(scene), 0.05);
}

#[test]
fn gloss_that_shows_some_things_to_paths() {
    let scene = by_paths(seen_in_gloss(things()));
    agrees("gloss that shows some things to paths", scene, 0.05);
}

/// Photon rules by origin: photons of one bulb pass through the white ball, those from the floor through the green one,
/// and those of the other bulb do not light the floor.
fn told_to_photons(unseen: &mut Unseen) {
    unseen.rules.paths_obey = false;
    unseen.rules.touches_photons = true;
    unseen.rules.of_light[1] = unseen.set(&[WHITE], &[]);
    unseen.rules.of_object[FLOOR].photon = unseen.set(&[GREEN], &[2]);
    unseen.rules.of_object[WHITE as usize].photon = unseen.set(&[], &[0]);
}

fn seen_by_some_photons(scene: SceneDescription) -> SceneDescription {
    let mut unseen = Unseen::new(&scene);
    told_to_photons(&mut unseen);
    unseen.finished(scene)
}

#[test]
fn things_that_some_photons_see() {
    agrees("things that some photons see", seen_by_some_photons(things()), 0.05);
}

/// Photons scattered by fog pass through the red ball, and those of one bulb are not stored in the fog; those of the
/// other do not enter the ball of fog, which they pass through.
fn seen_by_photons_in_fog(mut scene: SceneDescription) -> SceneDescription {
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    let clear = glass(&mut scene, 1.5);
    let around = scene.world_medium;
    let within = fog(&mut scene, 0.2, 0.0);
    let filled = ball(&mut scene, [0.9, 0.6, -0.5], 0.4, clear);
    fill(&mut scene, filled, within, around);
    let mut unseen = Unseen::new(&scene);
    told_to_photons(&mut unseen);
    unseen.rules.of_light[2] = unseen.set(&[filled], &[]);
    unseen.rules.of_medium[0] = unseen.set(&[RED], &[1]);
    unseen.rules.unlit = vec![false, true, false, false, false, true];
    unseen.finished(scene)
}

#[test]
fn things_that_some_photons_in_fog_see() {
    let scene = small(seen_by_photons_in_fog(things()));
    agrees("things that some photons in fog see", scene, 0.2);
}

/// Rules of all kinds, including the gloss's own.
fn told_to_all(mut scene: SceneDescription) -> SceneDescription {
    let coated = coat(&mut scene, 0.2);
    scene.objects[WHITE as usize].material = coated;
    scene.objects[FLOOR].material = coat(&mut scene, 0.4);
    let mut unseen = Unseen::new(&scene);
    told_to_photons(&mut unseen);
    unseen.rules.of_object[FLOOR].reflected = unseen.set(&[RED, LAMP], &[]);
    unseen.rules.of_object[WHITE as usize].reflected = unseen.set(&[GREEN], &[1]);
    unseen.rules.of_object[0].shadow = unseen.set(&[WHITE], &[]);
    unseen.rules.camera = unseen.set(&[GREEN], &[]);
    unseen.rules.shadow_of_light[2] = unseen.set(&[RED], &[]);
    // No ray brings it light from other surfaces.
    unseen.rules.of_object[RED as usize].gathers = false;
    unseen.finished(scene)
}

#[test]
fn things_that_rules_of_all_kinds_tell_of() {
    agrees("things that rules of all kinds tell of", told_to_all(things()), 0.05);
}
