//! Passes have the same bits from run to run, whatever else is rendered and however many paths run together.

use super::{ball, fog, furnace, glass, is_long, lamp, matt, plan, room, smoke, stage};
use crate::error::Error;
use crate::pass::buffers::{MOST_TOGETHER, fewer_where_full, passes_for};
use crate::pass::photons::{Photons, Room};
use crate::pass::{GpuPass, MOST_SLOTS_OF_SOFTWARE, Memory, ROUNDS, TILE};
use crate::self_test::Tested;
use crate::testing::{device, tested};
use beamfarm_image::film::Film;
use beamfarm_render::world::{Scene, SceneDescription};
use std::iter;

fn bits(film: &Film) -> Vec<u32> {
    film.pixels.as_flattened().iter().map(|value| value.to_bits()).collect()
}

/// A full scene: fog, glass, walls, a lamp.
fn all() -> SceneDescription {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.6, -0.3, 0.0], 0.6, clear);
    lamp(&mut scene, 0.6, [4.0, 3.0, 2.0]);
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    (scene.camera.width, scene.camera.height) = (20, 12);
    scene
}

/// Pictures, their pass, and the FNV-1a hash of their bits: what any device renders, until passes change.
const HASHES: &str = include_str!("hashes.txt");

fn hash(bits: &[u32]) -> u64 {
    let bytes = bits.iter().flat_map(|word| word.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn pictures_have_the_bits_of_all_devices() {
    let Some(tested) = tested() else { return };
    let mut got = String::new();
    for (name, description) in [("furnace", furnace(0.5)), ("all", all())] {
        let scene = Scene::new(description);
        let plan = plan(&scene, 5);
        let pass = GpuPass::new(tested, &scene, &plan).unwrap();
        for (index, picture) in [0, 17].into_iter().zip(pass.render_all(&[0, 17]).unwrap()) {
            got += &format!("{name} {index} {:016x}\n", hash(&bits(&picture.film)));
        }
    }
    assert_eq!(got, HASHES);
}

#[test]
fn passes_have_their_own_bits() {
    let Some(tested) = tested() else { return };
    for description in [furnace(0.5), all()] {
        let scene = Scene::new(description);
        let plan = plan(&scene, 5);
        let pass = GpuPass::new(tested, &scene, &plan).unwrap();
        let first = pass.render(3).unwrap();
        assert!(first.film.pixels.as_flattened().iter().any(|value| *value > 0.0));
        let again = pass.render_all(&[4, 3]).unwrap();
        assert_eq!(bits(&again[1].film), bits(&first.film));
        assert_ne!(bits(&again[0].film), bits(&first.film));
        // Tile after tile.
        let by_tiles = GpuPass::with_room(tested, &scene, &plan, (TILE, 1)).unwrap();
        assert_eq!(bits(&by_tiles.render(3).unwrap().film), bits(&first.film));
    }
}

/// Passes submitted while others are in flight, some of which need more room for photons or path steps than was known.
#[test]
fn passes_that_are_handed_over_early_have_their_own_bits() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(all());
    let plan = plan(&scene, 5);
    let mut pass = GpuPass::new(tested, &scene, &plan).unwrap();
    let expected: Vec<_> = (3..6).map(|i| bits(&pass.render(i).unwrap().film)).collect();
    pass.is_ahead = true;
    for (has_room, rounds) in [(true, ROUNDS), (false, ROUNDS), (true, 1)] {
        let mut buffers = pass.buffers.lock().unwrap();
        buffers.rounds = rounds;
        if !has_room {
            let mut small = Room::first_guess(&scene, &plan);
            (small.most.beams, small.most.photons) = (8, 8);
            buffers.photons = Some(Photons::new(tested.into(), pass.still(), small).unwrap());
        }
        drop(buffers);
        let begun: Vec<_> = (3..6).map(|i| pass.begin(&[i]).unwrap()).collect();
        for (begun, expected) in begun.into_iter().zip(&expected) {
            assert!(begun.films.is_some());
            assert_eq!(
                &bits(&pass.end(begun).unwrap()[0].film),
                expected,
                "{has_room}, {rounds}"
            );
        }
    }
}

/// Whatever is rendered along with them, and whether that needs more room or time.
#[test]
fn passes_that_are_rendered_together_have_their_own_bits() {
    let Some(tested) = tested() else { return };
    let cases = [(false, true, ROUNDS), (true, false, ROUNDS), (true, true, 1)];
    let smoke = || (smoke::by_beams(), &cases[1..2]);
    // Varying densities need other kernels, which take long to compile.
    for (description, cases) in iter::once((all(), &cases[..])).chain(is_long().then(smoke)) {
        let scene = Scene::new(description);
        let plan = plan(&scene, 5);
        let alone = GpuPass::new(tested, &scene, &plan).unwrap();
        let expected: Vec<_> = (3..8).map(|i| bits(&alone.render(i).unwrap().film)).collect();
        let mut pass = GpuPass::with_room(tested, &scene, &plan, (MOST_SLOTS_OF_SOFTWARE, 3)).unwrap();
        assert_eq!(pass.passes_together(), 3);
        for (is_ahead, has_room, rounds) in cases.iter().copied() {
            pass.is_ahead = is_ahead;
            let mut buffers = pass.lock();
            buffers.rounds = rounds;
            if !has_room {
                let mut small = Room::first_guess(&scene, &plan);
                (small.most.beams, small.most.photons) = (8, 8);
                let on = pass.together(3);
                buffers.photons = Some(Photons::new(on, pass.still(), small).unwrap());
            }
            drop(buffers);
            // Three, and then two.
            let got: Vec<_> = pass.render_all(&[3, 4, 5, 6, 7]).unwrap();
            let got: Vec<_> = got.iter().map(|image| bits(&image.film)).collect();
            assert!(got == expected, "{is_ahead}, {has_room}, {rounds}");
        }
        // With fewer together than were submitted.
        pass.lock().passes = 2;
        let begun = pass.begin(&[7, 3, 5]).unwrap();
        let got: Vec<_> = pass.end(begun).unwrap().iter().map(|image| bits(&image.film)).collect();
        assert!(got == [4, 0, 2].map(|i: usize| expected[i].clone()));
    }
}

#[test]
fn fewer_passes_are_rendered_together_where_there_is_no_memory() {
    let full = |what: &str| Error::OutOfMemory {
        device: "card".into(),
        what: what.into(),
        reason: "none is left".into(),
    };
    let made = fewer_where_full(12, |passes| if passes > 4 { Err(full("film")) } else { Ok(passes) });
    assert_eq!(made.unwrap(), 3);
    let none = fewer_where_full(12, |_| Err::<(), _>(full("film")));
    assert!(matches!(none, Err(Error::OutOfMemory { .. })));
    let memory = |photons| Memory {
        photons,
        ..Memory::default()
    };
    // Small pictures are rendered in large numbers, within a quarter of the memory.
    assert_eq!(passes_for(memory(1 << 20), 1 << 12, Some(1 << 33)), MOST_TOGETHER);
    assert_eq!(passes_for(memory(1 << 20), 1 << 12, None), MOST_TOGETHER);
    assert_eq!(passes_for(memory(1 << 20), 1 << 17, Some(1 << 33)), 8);
    assert_eq!(passes_for(memory(1 << 20), 1 << 18, Some(1 << 33)), 4);
    assert_eq!(passes_for(memory(1 << 29), 1 << 12, Some(1 << 33)), 4);
    assert_eq!(passes_for(memory(1 << 33), 1 << 12, Some(1 << 33)), 1);
    assert_eq!(passes_for(memory(1 << 20), 1 << 20, Some(1 << 33)), 1);
}

/// If memory for more photons is short, no later pass silently lacks them.
#[test]
fn passes_without_their_photons_are_errors() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(all());
    let plan = plan(&scene, 5);
    let mut pass = GpuPass::new(tested, &scene, &plan).unwrap();
    pass.lock().photons = None;
    for is_ahead in [false, true] {
        pass.is_ahead = is_ahead;
        let error = pass.render(3).err().map(|error| error.to_string());
        assert!(error.is_some_and(|text| text.ends_with("its photons have no room")));
    }
}

/// A pass on a lost device is an error, never a picture; another device renders it.
#[test]
fn a_pass_of_a_lost_device_is_rendered_again() {
    let (Some(tested), Some(device)) = (tested(), device()) else {
        return;
    };
    let doomed = Tested::test(device).unwrap();
    let scene = Scene::new(furnace(0.5));
    let plan = plan(&scene, 5);
    let again = GpuPass::new(tested, &scene, &plan).unwrap();
    // Drivers have cached the kernels of the other device.
    let first = bits(&again.render(3).unwrap().film);
    let before = GpuPass::new(&doomed, &scene, &plan).unwrap();
    assert_eq!(bits(&before.render(3).unwrap().film), first);
    doomed.device.lose();
    for _ in 0..2 {
        let error = before.render(4).err();
        assert!(matches!(error, Some(Error::Lost { .. })), "{error:?}");
    }
    let error = GpuPass::new(&doomed, &scene, &plan).err();
    assert!(matches!(error, Some(Error::Lost { .. })), "{error:?}");
    assert_eq!(bits(&again.render(3).unwrap().film), first);
    assert_ne!(bits(&again.render(4).unwrap().film), first);
}
