//! Scenes from text, and rays through them.

use beamfarm_image::bundle::Bundle;
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::SurfaceHit;
use beamfarm_render::world::geometry::accel::Geometry;
use std::collections::BTreeMap;

/// The camera stands at (0, 0, 5).
pub const VIEW: &str = "image = { width = 8, height = 4 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 90 }
";

pub fn load_with(text: &str, assets: &[(&str, Vec<u8>)]) -> SceneDescription {
    let mut files: BTreeMap<_, _> = assets
        .iter()
        .map(|(name, bytes)| (name.to_string(), bytes.clone()))
        .collect();
    files.insert("scene.toml".to_string(), text.as_bytes().to_vec());
    let scene = "scene.toml".to_string();
    beamfarm_scene::load(&Bundle { scene, files }).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

pub fn load(text: &str) -> SceneDescription {
    load_with(&format!("{VIEW}{text}"), &[])
}

/// The first hit of a ray given in world space.
pub fn hit(scene: &SceneDescription, origin: [f32; 3], dir: [f32; 3]) -> Option<SurfaceHit> {
    let ray = Ray {
        origin: Vec3::from(origin) - Vec3::new(0.0, 0.0, 5.0),
        dir: Vec3::from(dir).normalize(),
    };
    Geometry::new(&scene.objects).intersect(&scene.objects, &ray, f32::INFINITY, &|_| false)
}

/// An octahedron with vertex normals, centred away from the origin.
pub const OCTAHEDRON: &str = "v 11 0 0\nv 9 0 0\nv 10 1 0\nv 10 -1 0\nv 10 0 1\nv 10 0 -1\n\
    vn 1 0 0\nvn -1 0 0\nvn 0 1 0\nvn 0 -1 0\nvn 0 0 1\nvn 0 0 -1\n\
    f 1//1 3//3 5//5\nf 3//3 2//2 5//5\nf 2//2 4//4 5//5\nf 4//4 1//1 5//5\n\
    f 3//3 1//1 6//6\nf 2//2 3//3 6//6\nf 4//4 2//2 6//6\nf 1//1 4//4 6//6\n";

pub fn octahedron() -> [(&'static str, Vec<u8>); 1] {
    [("octahedron.obj", OCTAHEDRON.as_bytes().to_vec())]
}
