//! Small random scenes for comparing passes with the path tracer on cases that nobody thought of.
//!
//! Each seed is a scene. What a path tracer cannot find is excluded by construction: where surfaces may be mirrors,
//! glass, or less rough than [`material::WIDE`], all lights have some size; and point lights are never in fog, where
//! their variance is infinite. There are no visibility rules for photons, of which the path tracer knows nothing.

pub mod assets;
pub mod body;
pub mod builder;
pub mod cloth;
pub mod draw;
pub mod light;
pub mod material;
pub mod medium;
pub mod strands;
pub mod variations;
pub mod world;

use assets::Asset;
use beamfarm_image::bundle::Bundle;
use beamfarm_render::world::Scene;
use beamfarm_render::world::SceneDescription;
use builder::Builder;
use draw::{Draw, table};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A scene file and the files that it names.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomScene {
    /// The scene file.
    pub table: Table,
    /// Its other files.
    pub assets: Vec<Asset>,
}

impl RandomScene {
    /// The scene of a seed.
    pub fn new(seed: u64) -> Self {
        let mut b = Builder::new(Draw::new(seed));
        let mut camera = world::fill(&mut b);
        variations::vary(&mut b, seed);
        variations::vary_light_and_view(&mut b, &mut camera, seed);
        variations::split_light(&mut b, seed);
        variations::size_lights(&mut b, seed);
        variations::grow_graphs(&mut b, seed);
        variations::sink_in(&mut b, seed);
        variations::narrow_and_widen(&mut b, &mut camera, seed);
        variations::kindle(&mut b, seed);
        strands::grow(&mut b, seed);
        variations::brush(&mut b, seed);
        variations::pile(&mut b, seed);
        cloth::weave(&mut b, seed);
        variations::glaze(&mut b, seed);
        light::soften(&mut b, seed);
        let side = Value::Integer(world::SIDE);
        let mut scene = table([
            ("image", table([("width", side.clone()), ("height", side)]).into()),
            ("render", table([("paths", Value::Integer(4000))]).into()),
            ("camera", camera.into()),
        ]);
        if let Some(medium) = b.world {
            scene.insert("world".into(), table([("medium", medium.into())]).into());
        }
        for (key, tables) in [("media", b.media), ("materials", b.materials)] {
            if !tables.is_empty() {
                scene.insert(key.into(), tables.into());
            }
        }
        for (key, list) in [("shapes", b.shapes), ("lights", b.lights), ("rules", b.rules)] {
            if !list.is_empty() {
                let list: Vec<Value> = list.into_iter().map(Value::from).collect();
                scene.insert(key.into(), list.into());
            }
        }
        Self {
            table: scene,
            assets: b.assets,
        }
    }

    /// Reads a written scene.
    pub fn read(path: &Path) -> std::io::Result<Self> {
        let text = std::fs::read_to_string(path)?;
        let table: Table = text.parse().map_err(std::io::Error::other)?;
        let mut assets = Vec::new();
        for entry in std::fs::read_dir(path.parent().unwrap_or(Path::new(".")))? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if text.contains(&format!("\"{name}\"")) {
                let bytes = std::fs::read(entry.path())?;
                assets.push(Asset { name, bytes });
            }
        }
        Ok(Self { table, assets })
    }

    /// The text of the scene file.
    pub fn toml(&self) -> String {
        self.table.to_string()
    }

    /// The scene's description, if it is valid.
    pub fn description(&self) -> Result<SceneDescription, String> {
        let mut bundle = Bundle {
            scene: "random.toml".into(),
            ..Bundle::default()
        };
        for Asset { name, bytes } in &self.assets {
            bundle.files.insert(name.clone(), bytes.clone());
        }
        let text = self.toml().into_bytes();
        bundle.files.insert("random.toml".into(), text);
        beamfarm_scene::load(&bundle).map_err(|error| error.to_string())
    }

    /// The scene, if it is valid.
    pub fn load(&self) -> Result<Scene, String> {
        self.description().map(Scene::new)
    }

    /// Writes NAME.toml and its files into a folder of that name.
    pub fn write(&self, folder: &Path, name: &str) -> std::io::Result<PathBuf> {
        let folder = folder.join(name);
        std::fs::create_dir_all(&folder)?;
        let text = self.toml();
        for Asset { name, bytes } in &self.assets {
            if text.contains(&format!("\"{name}\"")) {
                std::fs::write(folder.join(name), bytes)?;
            }
        }
        let path = folder.join(format!("{name}.toml"));
        std::fs::write(&path, text)?;
        Ok(path)
    }

    /// A summary in one line: kinds of shapes, materials, media and lights, with their main properties.
    pub fn summary(&self) -> String {
        let mut words = BTreeSet::new();
        let tables = |key: &str| -> Vec<&Table> {
            let entries = self.table.get(key);
            let named = entries.and_then(Value::as_table).into_iter().flat_map(Table::values);
            let listed = entries.and_then(Value::as_array).into_iter().flatten();
            named.chain(listed).filter_map(Value::as_table).collect()
        };
        let kind = |table: &Table| table.get("type").and_then(Value::as_str).unwrap_or("?").to_owned();
        for material in tables("materials") {
            let mut word = kind(material);
            for key in [
                "alpha",
                "alpha_u",
                "alpha_v",
                "roughness",
                "anisotropic",
                "anisotropy_strength",
            ] {
                if let Some(value) = material.get(key) {
                    word += &format!("({value})");
                }
            }
            if material.get("ior").is_some_and(Value::is_table) {
                word += "+dispersion";
            }
            for key in [
                "bump",
                "opacity",
                "sheen_weight",
                "diffuse_roughness",
                "thin_film_thickness",
            ] {
                if material.contains_key(key) {
                    word += &format!("+{key}");
                }
            }
            words.insert(word);
        }
        for medium in tables("media") {
            let sigma = medium.get("sigma_t").or(medium.get("sigma_s"));
            words.insert(format!(
                "{} {}",
                kind(medium),
                sigma.map_or_else(String::new, Value::to_string)
            ));
        }
        for shape in tables("shapes") {
            let mut word = kind(shape);
            for key in ["emission", "visible"] {
                if shape.contains_key(key) {
                    word += &format!("+{key}");
                }
            }
            words.insert(word);
        }
        words.extend(tables("lights").into_iter().map(kind));
        for key in ["world", "rules"] {
            if self.table.contains_key(key) {
                words.insert(key.into());
            }
        }
        words.into_iter().collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn seeds_are_valid_scenes() {
        let mut words = String::new();
        for seed in 0..250 {
            let scene = RandomScene::new(seed);
            assert_eq!(scene, RandomScene::new(seed));
            if let Err(error) = scene.description() {
                panic!("seed {seed}: {error}\n{}", scene.toml());
            }
            words += &scene.summary();
            words += &scene.toml();
        }
        for word in [
            "sphere",
            "cube",
            "disc",
            "rectangle",
            "cylinder",
            "mesh",
            "instances",
            "diffuse",
            "mirror",
            "conductor",
            "rough_conductor",
            "dielectric",
            "rough_dielectric",
            "thin_dielectric",
            "plastic",
            "rough_plastic",
            "principled",
            "null",
            "curves",
            "points",
            "hair",
            "bump",
            "opacity",
            "homogeneous",
            "heterogeneous",
            "blend",
            "noise",
            "height",
            "blobs",
            ".vol",
            "point",
            "spot",
            "directional",
            "environment",
            "image",
            "rules",
            "visible",
            "aperture",
            "exterior",
            "world",
            "checkerboard",
            "laser",
            "spread",
            "fisheye",
            "node",
            "voronoi",
            "generated",
            "-other",
            "clearcoat",
            "coat_weight",
            "thin_film_thickness",
            "velvet",
            "sheen_weight",
            "diffuse_roughness",
            "spec_trans",
            "sheen",
            "soft_falloff",
        ] {
            assert!(words.contains(word), "{word}");
        }
    }
}
