//! The example scenes: their meshes match their formulas, they load, and each makes a picture.

#[path = "../../../shared/scene/examples/make_meshes/meshes/mod.rs"]
mod meshes;

use beamfarm_image::job::{EngineKind, JobSettings, Techniques};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::read_bundle;
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn files(folder: &Path, ending: &str) -> BTreeSet<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder of scenes");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths
        .filter(|path| path.extension().is_some_and(|e| e == ending))
        .collect()
}

#[test]
fn committed_meshes_are_what_the_program_makes() {
    let folder = folder().join("meshes");
    let mut made = BTreeSet::new();
    for (name, mesh) in meshes::all() {
        let path = folder.join(name);
        let committed = std::fs::read(&path).unwrap();
        assert!(
            committed == mesh.to_ply(),
            "{name} differs; run the example make_meshes"
        );
        made.insert(path);
    }
    assert_eq!(files(&folder, "ply"), made);
}

/// Faces wind around the mean of their corners' normals, which have unit length.
#[test]
fn normals_of_meshes_agree_with_their_faces() {
    for (name, mesh) in meshes::all() {
        for normal in &mesh.normals {
            assert!((normal.length() - 1.0).abs() < 1e-9, "{name}: {normal}");
        }
        for face in mesh.faces.iter().filter(|_| !mesh.normals.is_empty()) {
            let corner = |i: usize| mesh.positions[face[i] as usize];
            let mean: DVec3 = face.iter().map(|v| mesh.normals[*v as usize]).sum();
            for i in 2..face.len() {
                let geometric = (corner(i - 1) - corner(0)).cross(corner(i) - corner(0));
                assert!(mean.dot(geometric) > 0.0, "{name}: {face:?}");
            }
        }
    }
}

#[test]
fn every_scene_makes_a_picture() {
    let scenes = files(&folder(), "toml");
    assert!(scenes.len() >= 6, "{scenes:?}");
    for path in scenes {
        let bundle = read_bundle(&path).unwrap();
        let mut description = beamfarm_scene::load(&bundle).unwrap();
        // Its other moments have images in the scene's own size.
        description.motion = None;
        let camera = &mut description.camera;
        (camera.width, camera.height) = (32, 32 * camera.height / camera.width);
        let defaults = description.defaults;
        let scene = Scene::new(description);
        let settings = JobSettings {
            seed: defaults.seed,
            alpha: defaults.alpha,
            schedule: defaults.schedule,
            budget: None,
            paths_per_pass: 2000,
            reference_paths: 2000,
            techniques: Techniques::default(),
            engine: EngineKind::default(),
        };
        let plan = RenderPlan::new(&scene, settings);
        let pass = render_pass(&scene, &plan, 0).expect("a pass");
        assert_eq!(pass.stats.non_finite, 0, "{path:?}");
        let lit = pass.film.pixels.iter().filter(|p| p.iter().sum::<f32>() > 1e-4);
        let (lit, all) = (lit.count(), pass.film.pixels.len());
        assert!(2 * lit > all, "{path:?}: {lit} of {all} pixels are lit");
    }
}
