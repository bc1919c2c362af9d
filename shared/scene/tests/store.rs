//! Scenes from a store are what they are without it, and are made from what is already there.

use beamfarm_image::bundle::Bundle;
use beamfarm_image::film::Film;
use beamfarm_render::cpu::pass::{Cpu, render_pass};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::NoPass;
use beamfarm_render::world::geometry::{Mesh, Shape};
use beamfarm_render::world::{Scene, SceneDescription};
use beamfarm_scene::{File, Files, Store, load, read_bundle};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

fn files(name: &str) -> Files {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name);
    read_bundle(&path).expect("a scene of the repository").into()
}

fn text(files: &Files) -> String {
    String::from_utf8(files.files[&files.scene].bytes().to_vec()).expect("text")
}

/// The files with something in the scene's text replaced.
fn with(files: &Files, old: &str, new: &str) -> Files {
    let text = text(files);
    assert!(text.contains(old), "{old}");
    files.with_text(&text.replacen(old, new, 1))
}

fn bundle(files: &Files) -> Bundle {
    let of_one = |(key, file): (&String, &File)| (key.clone(), file.bytes().to_vec());
    Bundle {
        scene: files.scene.clone(),
        files: files.files.iter().map(of_one).collect(),
    }
}

fn pass(mut scene: Scene) -> Film {
    scene.resize(24, 16);
    let settings = scene.description().defaults.job_settings();
    let settings = beamfarm_image::job::JobSettings {
        paths_per_pass: 300,
        ..settings
    };
    let plan = RenderPlan::new(&scene, settings);
    render_pass(&scene, &plan, 3).expect("a pass").film
}

fn bits(film: &Film) -> Vec<[u32; 3]> {
    film.pixels.iter().map(|p| p.map(f32::to_bits)).collect()
}

fn meshes(description: &SceneDescription) -> Vec<&Arc<Mesh>> {
    let objects = description.objects.iter();
    let meshes = objects.filter_map(|object| match &object.shape {
        Shape::Mesh { mesh, .. } => Some(mesh),
        _ => None,
    });
    meshes.collect()
}

fn same_meshes(a: &SceneDescription, b: &SceneDescription) -> Vec<bool> {
    let pairs = meshes(a).into_iter().zip(meshes(b));
    pairs.map(|(a, b)| Arc::ptr_eq(a, b)).collect()
}

/// Whatever a store has seen before, a pass has the bits that it has without one; also where the scene is made like
/// another.
#[test]
fn passes_have_the_bits_that_they_have_without_a_store() {
    for name in [
        "bumpy-sphere.toml",
        "surface-caustics.toml",
        "light-linking.toml",
        "cloud.toml",
    ] {
        let files = files(name);
        let expected = bits(&pass(Scene::new(load(&bundle(&files)).unwrap())));
        let mut store = Store::default();
        let sketch = Scene::new(store.sketch(&files, [0.3, 0.1, -2.0]).unwrap());
        let first = Scene::new(store.load(&files).unwrap());
        let other = Scene::new_like(&sketch, store.load(&files).unwrap());
        assert!(!other.shares_hierarchies_with(&sketch), "{name}");
        let again = Scene::new_like(&first, store.load(&files).unwrap());
        assert!(again.shares_hierarchies_with(&first), "{name}");
        for scene in [first, other, again] {
            assert_eq!(bits(&pass(scene)), expected, "{name}");
        }
    }
}

/// What moves is what is made anew: nothing for a camera or a colour, one placement for an object.
#[test]
fn sketches_make_only_what_differs() {
    let before = files("ocean.toml");
    let mut store = Store::default();
    let mut sketch = |files: &Files| store.sketch(files, [0.0, -5.3, 8.0]).unwrap();
    let first = Scene::new(sketch(&before));
    let moved = with(&before, "origin = [0.0, -5.3, 8.0]", "origin = [0.5, -5.1, 7.0]");
    let camera = Scene::new_like(&first, sketch(&moved));
    assert!(camera.shares_hierarchies_with(&first));
    let position = camera.description().camera.position;
    assert!(
        (position - glam::Vec3::new(0.5, 0.2, -1.0)).length() < 1e-6,
        "{position}"
    );
    let coloured = with(&before, "[0.55, 0.48, 0.36]", "[0.1, 0.48, 0.36]");
    let colour = Scene::new_like(&camera, sketch(&coloured));
    assert!(colour.shares_hierarchies_with(&first));
    let shifted = with(
        &before,
        "file = \"meshes/sand.ply\"",
        "file = \"meshes/sand.ply\"\ntransform = [{ translate = [0, 0.1, 0] }]",
    );
    let object = Scene::new_like(&colour, sketch(&shifted));
    assert!(!object.shares_hierarchies_with(&first));
    let same = same_meshes(first.description(), object.description());
    assert!(same.len() > 10 && same.iter().all(|same| *same), "{same:?}");
}

/// At rest, a colour makes no mesh and no hierarchy anew; the camera moves all that stands in render space.
#[test]
fn exact_scenes_make_only_what_differs() {
    let before = files("bumpy-sphere.toml");
    let mut store = Store::default();
    let first = Scene::new(store.load(&before).unwrap());
    let coloured = with(&before, "[0.24, 0.22, 0.21]", "[0.5, 0.22, 0.21]");
    let colour = Scene::new_like(&first, store.load(&coloured).unwrap());
    assert!(colour.shares_hierarchies_with(&first));
    let expected = pass(Scene::new(load(&bundle(&coloured)).unwrap()));
    assert_eq!(bits(&pass(colour)), bits(&expected));
    let moved = with(&before, "origin = [0.0, 1.9, 5.2]", "origin = [0.1, 1.9, 5.2]");
    let camera = Scene::new_like(&first, store.load(&moved).unwrap());
    assert!(!camera.shares_hierarchies_with(&first));
    let expected = pass(Scene::new(load(&bundle(&moved)).unwrap()));
    assert_eq!(bits(&pass(camera)), bits(&expected));
}

/// A file of the same name with other bytes is another file; and what is not used for some time is dropped.
#[test]
fn changed_files_are_noticed() {
    let before = files("ocean.toml");
    let mut store = Store::default();
    let first = store.load(&before).unwrap();
    let mut changed = before.clone();
    let fish = before.files["meshes/fish.ply"].clone();
    changed.files.insert("meshes/bumpy-sphere.ply".into(), fish);
    let other = store.load(&changed).unwrap();
    let same = same_meshes(&first, &other);
    assert_eq!(same.iter().filter(|same| !**same).count(), 4, "the rocks: {same:?}");
    let expected = pass(Scene::new(load(&bundle(&changed)).unwrap()));
    assert_eq!(bits(&pass(Scene::new(other))), bits(&expected));
    let small = with(&files("sphere-caustic.toml"), "width = 512", "width = 256");
    (0..8).for_each(|_| drop(store.load(&small).unwrap()));
    let weak: Vec<_> = meshes(&first).into_iter().map(Arc::downgrade).collect();
    drop(first);
    assert!(weak.iter().all(|mesh| mesh.upgrade().is_none()));
}

/// Whatever is wrong is told as without a store, also after what was right.
#[test]
fn errors_are_those_of_load() {
    let right = files("ocean.toml");
    let mut broken = right.clone();
    broken
        .files
        .insert("meshes/sand.ply".into(), File::new(&b"ply\nformat ascii 1.0\n"[..]));
    let mut lacking = right.clone();
    lacking.files.remove("meshes/fish.ply");
    let wrong = [
        with(&right, "ior = 1.33", "ior = 0"),
        with(&right, "material = \"sand\"", "material = \"sans\""),
        with(&right, "target = [0.0, -3.4, 0.0]", "target = [0.0, -5.3, 8.0]"),
        with(
            &right,
            "interior = \"sea\"",
            "interior = \"sea\"\ntransform = [{ scale = [1, 0, 1] }]",
        ),
        with(&right, "[materials.sand]", "[materials.sand"),
        broken,
        lacking,
    ];
    let mut store = Store::default();
    store.load(&right).unwrap();
    for files in wrong {
        let expected = load(&bundle(&files)).unwrap_err();
        for _ in 0..2 {
            assert_eq!(store.load(&files).unwrap_err().to_string(), expected.to_string());
            assert_eq!(
                store.sketch(&files, [0.0; 3]).unwrap_err().to_string(),
                expected.to_string()
            );
        }
    }
    assert!(store.load(&right).is_ok());
}

/// A sketch shows what the scene looks like: nearly as much light in all, and none of it missing.
#[test]
fn sketches_show_the_scene() {
    for name in ["sphere-caustic.toml", "bumpy-sphere.toml", "ocean.toml"] {
        let files = files(name);
        let mut store = Store::default();
        let mean = |mut scene: Scene, provisional: bool| {
            scene.resize(40, 30);
            let mut settings = scene.description().defaults.job_settings();
            settings.paths_per_pass = 1000;
            let plan = match provisional {
                true => RenderPlan::provisional(&scene, settings),
                false => RenderPlan::new(&scene, settings),
            };
            let passes = 6;
            let mut sum = 0.0;
            for pass_index in 0..passes {
                let film = render_pass(&scene, &plan, pass_index).expect("a pass").film;
                let values: Vec<f32> = film.pixels.iter().flatten().map(|x| x.min(2.0)).collect();
                assert!(values.iter().all(|x| x.is_finite()), "{name}");
                sum += values.iter().map(|x| f64::from(*x)).sum::<f64>() / values.len() as f64;
            }
            sum / f64::from(passes as u32)
        };
        let exact = mean(Scene::new(store.load(&files).unwrap()), false);
        let sketch = mean(Scene::new(store.sketch(&files, [0.0; 3]).unwrap()), true);
        assert!((sketch / exact - 1.0).abs() < 0.3, "{name}: {sketch}, exact {exact}");
    }
}

/// A pass of a scene that is interrupted is over soon, and no picture.
#[test]
fn interrupted_passes_are_over_soon_and_no_pictures() {
    let description = load(&bundle(&files("bumpy-sphere.toml"))).unwrap();
    let scene = Scene::new(description);
    let interrupt = scene.description().interrupt.clone();
    let mut settings = scene.description().defaults.job_settings();
    settings.paths_per_pass = 20_000;
    let plan = RenderPlan::new(&scene, settings);
    let start = Instant::now();
    let none = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(150));
            interrupt.raise();
        });
        render_pass(&scene, &plan, 0).err()
    });
    assert_eq!(none, Some(NoPass::Interrupted));
    // All of it would take seconds.
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    let start = Instant::now();
    assert_eq!(render_pass(&scene, &plan, 1).err(), Some(NoPass::Interrupted));
    let clone = scene.description().clone();
    let question = beamfarm_render::plan::pilot::Question::new(settings, None);
    beamfarm_render::plan::pilot::Choice::new(&Cpu, &clone, question);
    beamfarm_render::plan::budget::Pilot::new(&Cpu, &clone, settings);
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
}
