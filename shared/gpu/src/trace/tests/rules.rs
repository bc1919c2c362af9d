//! Paths with photon visibility rules.

use super::*;
use beamfarm_render::plan::weights::FoundBy;
use beamfarm_render::world::rules::{HiddenSet, ObjectSets, Rules};

/// A set of classes, which have 32 bits.
fn set(rules: &mut Rules, first: u32) -> HiddenSet {
    let row = rules.rows.len() as u32;
    rules.rows.push(first);
    HiddenSet { row, first }
}

/// The box of fog: photons of the lamp, of walls and of fog pass through the mirror, so that none is trapped in it;
/// those of a bulb and of the other box do not. The bulb's photons are kept off fog and box, and photons contribute
/// what walls scatter.
fn ruled() -> Scene {
    let mut scene = scenes::box_of_fog();
    scenes::bulb(&mut scene);
    let (objects, lights) = (scene.objects.len(), scene.lights.len());
    let free = ObjectSets {
        is_gathered: true,
        gathers: true,
        one_ray: true,
        ..ObjectSets::default()
    };
    let mut rules = Rules {
        class: (0..(objects + lights) as u32).collect(),
        objects,
        rows: vec![0],
        of_object: vec![free; objects],
        of_light: vec![HiddenSet::default(); lights],
        shadow_of_light: vec![HiddenSet::default(); lights],
        of_medium: vec![HiddenSet::default(); scene.media.len()],
        unlit: vec![false; scene.media.len() * lights],
        light_kinds: (
            (0..lights as u8).collect(),
            (objects..objects + lights).map(|c| c as u32).collect(),
        ),
        touches_photons: true,
        ..Rules::default()
    };
    let of_light = |light: usize| 1_u32 << (objects + light);
    rules.of_light[0] = set(&mut rules, 1 << 2);
    rules.of_object[0].photon = set(&mut rules, 1 << 2);
    rules.of_object[0].is_gathered = false;
    rules.of_object[1].photon = set(&mut rules, of_light(1));
    rules.of_medium[0] = set(&mut rules, of_light(1) | 1 << 2);
    rules.unlit[1] = true;
    scene.rules = Some(rules);
    Scene::new(scene)
}

#[test]
fn paths_by_rules_leave_what_they_leave_on_a_processor() {
    let Some(tested) = tested() else { return };
    let scene = ruled();
    let mut counts = [0; 3];
    for (media, surfaces, pass) in [
        (None, None, 0),
        (Some(Technique::Photons), Some(Technique::Photons), 50),
    ] {
        let plan = RenderPlan::new(&scene, settings(600, media, surfaces));
        assert_eq!(TraceTables::new(&scene, &plan, pass).plan.ends_paths, 2);
        let more = compare(tested, "ruled box of fog", &scene, &plan, pass);
        counts.iter_mut().zip(more).for_each(|(count, more)| *count += more);
    }
    assert!(counts[0] > 500 && counts[1] > 500, "{counts:?}");
    // Every light has some, and rules keep some off.
    let plan = RenderPlan::new(&scene, settings(600, None, None));
    let photons = trace_paths(&scene, &plan, 0, 0..plan.surface_paths).surface;
    let of_kind = |kind: u8| photons.iter().filter(|photon| photon.light_kind == kind).count();
    let by_rule = photons
        .iter()
        .filter(|photon| photon.found_by == FoundBy::PathsByRule)
        .count();
    assert!(of_kind(0) > 20 && of_kind(1) > 20 && by_rule > 5);
}
