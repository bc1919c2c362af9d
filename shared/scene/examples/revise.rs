//! How long a look at a revised scene takes: from its text to what a pass needs, after the camera has moved, a colour
//! has changed, or an object has moved, and a pass of a coarse picture. Medians over 20 revisions, milliseconds, on two
//! threads.
//!
//!     cargo run --release -p beamfarm-scene --example revise -- scenes/bumpy-sphere.toml scenes/ocean.toml
//!
//! `--million` adds a scene with a mesh of a million triangles, made on the fly; `--pictures FOLDER` writes what each
//! scene looks like.

use beamfarm_image::job::JobSettings;
use beamfarm_image::png::write_png;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::{File, Files, Store, read_bundle};
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use toml_edit::{Array, DocumentMut, Item, Value};

const REVISIONS: usize = 20;
const THREADS: usize = 2;
const WIDTHS: [u32; 5] = [160, 240, 320, 480, 960];
const PATHS: [u32; 3] = [1000, 2000, 4000];
/// After which no more passes are timed, milliseconds.
const LONGEST: f64 = 500.0;
/// Of the pictures that are written, and of plans that are timed.
const LOOK: (u32, u32) = (240, 1000);

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let mut scenes: Vec<(String, Files)> = Vec::new();
    let mut pictures = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--million" => scenes.push(("a million triangles".into(), million()?)),
            "--pictures" => pictures = arguments.next().map(PathBuf::from),
            path => scenes.push((path.to_owned(), read_bundle(Path::new(path))?.into())),
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS).build()?;
    for (name, files) in scenes {
        pool.install(|| measure(&name, &files, pictures.as_deref()))?;
    }
    Ok(())
}

/// What a user does.
#[derive(Clone, Copy)]
enum Edit {
    Camera,
    Colour,
    Object,
}

fn measure(name: &str, files: &Files, pictures: Option<&Path>) -> Result<(), Failure> {
    let text = String::from_utf8(files.files[&files.scene].bytes().to_vec())?;
    let document: DocumentMut = text.parse()?;
    let origin = numbers(&document["camera"]["origin"]).unwrap_or_default();
    let mut store = Store::default();
    let start = Instant::now();
    let mut scene = Scene::new(store.sketch(files, origin)?);
    println!("{name}\n  first load {:.1} ms", milliseconds(start));
    let aspect = {
        let camera = scene.description().camera;
        f64::from(camera.height) / f64::from(camera.width)
    };
    let size = |width: u32| (width, (f64::from(width) * aspect).round().max(1.0) as u32);
    for (what, edit) in [
        ("moved camera", Edit::Camera),
        ("changed colour", Edit::Colour),
        ("moved object", Edit::Object),
    ] {
        let mut times = [const { Vec::new() }; 4];
        for revision in 1..=REVISIONS {
            let edited = edited(&document, edit, revision);
            let start = Instant::now();
            let files = files.with_text(&edited);
            let description = store.sketch(&files, origin)?;
            times[0].push(milliseconds(start));
            let start_of_scene = Instant::now();
            scene = Scene::new_like(&scene, description);
            times[1].push(milliseconds(start_of_scene));
            let start_of_plan = Instant::now();
            let (width, height) = size(LOOK.0);
            scene.resize(width, height);
            RenderPlan::provisional(&scene, settings(&scene, LOOK.1));
            times[2].push(milliseconds(start_of_plan));
            times[3].push(milliseconds(start));
        }
        let [load, scene, plan, all] = times.map(median);
        println!("  {what:<15} {all:6.2} ms: load {load:.2}, scene {scene:.2}, plan {plan:.2}");
    }
    if let Some(folder) = pictures {
        let (width, height) = size(LOOK.0);
        let mut scene = Scene::new(store.sketch(files, origin)?);
        scene.resize(width, height);
        let plan = RenderPlan::provisional(&scene, settings(&scene, LOOK.1));
        let film = render_pass(&scene, &plan, 0).expect("a pass").film;
        let stem = Path::new(name).file_stem().unwrap_or_default();
        let path = folder.join(stem).with_extension("png");
        write_png(&path, &film, scene.description().defaults.view)?;
        println!("{plan}");
    }
    for paths in PATHS {
        let mut line = format!("  {paths} paths:");
        for width in WIDTHS {
            let (width, height) = size(width);
            scene.resize(width, height);
            let plan = RenderPlan::provisional(&scene, settings(&scene, paths));
            let mut times = Vec::new();
            let all = Instant::now();
            for pass_index in 0..REVISIONS as u64 {
                let start = Instant::now();
                render_pass(&scene, &plan, pass_index).expect("a pass");
                times.push(milliseconds(start));
                if milliseconds(all) > LONGEST {
                    break;
                }
            }
            let _ = write!(line, "  {width}: {:.1} ms", median(times));
        }
        println!("{line}");
    }
    Ok(())
}

fn settings(scene: &Scene, paths: u32) -> JobSettings {
    JobSettings {
        paths_per_pass: paths,
        ..scene.description().defaults.job_settings()
    }
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

fn numbers(item: &Item) -> Option<[f64; 3]> {
    let array = item.as_array()?;
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|i| i as f64));
    let all: Option<Vec<f64>> = array.iter().map(number).collect();
    all?.try_into().ok()
}

fn edited(document: &DocumentMut, edit: Edit, revision: usize) -> String {
    let mut document = document.clone();
    let step = 1e-3 * revision as f64;
    match edit {
        Edit::Camera => {
            if let Some([x, y, z]) = numbers(&document["camera"]["origin"]) {
                document["camera"]["origin"] = Array::from_iter([x + step, y, z]).into();
            }
        }
        Edit::Colour => {
            let materials = document.get_mut("materials").and_then(Item::as_table_mut);
            let mut materials = materials.into_iter().flat_map(|table| table.iter_mut());
            if let Some((_, material)) = materials.find(|(_, material)| material.get("reflectance").is_some()) {
                material["reflectance"] = Array::from_iter([0.3 + step, 0.2, 0.25]).into();
            }
        }
        Edit::Object => {
            let shapes = document
                .get_mut("shapes")
                .and_then(Item::as_array_of_tables_mut)
                .into_iter()
                .flat_map(|shapes| shapes.iter_mut());
            let mut movable: Vec<_> = shapes.filter(|shape| shape.get("transforms").is_none()).collect();
            movable.sort_by_key(|shape| shape.get("type").and_then(Item::as_str) != Some("mesh"));
            if let Some(shape) = movable.first_mut() {
                let mut steps = shape
                    .get("transform")
                    .and_then(Item::as_array)
                    .cloned()
                    .unwrap_or_default();
                let mut translation = toml_edit::InlineTable::new();
                translation.insert("translate", Value::Array(Array::from_iter([step, 0.0, 0.0])));
                steps.push(translation);
                shape["transform"] = steps.into();
            }
        }
    }
    document.to_string()
}

/// A glass ball of a million triangles, bumpy, on a floor.
fn million() -> Result<Files, Failure> {
    let (columns, rows) = (1000u32, 500u32);
    let mut ply = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        columns * (rows + 1),
        2 * columns * rows
    )
    .into_bytes();
    for row in 0..=rows {
        for column in 0..columns {
            let (sin_theta, cos_theta) = libm::sincos(std::f64::consts::PI * f64::from(row) / f64::from(rows));
            let (sin_phi, cos_phi) = libm::sincos(std::f64::consts::TAU * f64::from(column) / f64::from(columns));
            let radius = 1.0 + 0.02 * libm::sin(8.0 * cos_theta) * libm::cos(6.0 * sin_phi);
            for x in [sin_theta * cos_phi, cos_theta, sin_theta * sin_phi] {
                ply.extend(((radius * x) as f32).to_le_bytes());
            }
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |row: u32, column: u32| (row * columns + column % columns) as i32;
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            for triangle in [[a, b, d], [a, d, c]] {
                ply.push(3);
                triangle.iter().for_each(|v| ply.extend(v.to_le_bytes()));
            }
        }
    }
    let text = r#"
[image]
width = 640
height = 400
[camera]
origin = [0.0, 2.0, 6.0]
target = [0.0, 0.6, 0.0]
fov = 40.0
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.floor]
type = "diffuse"
reflectance = [0.4, 0.4, 0.5]
[[shapes]]
type = "mesh"
file = "ball.ply"
material = "glass"
smooth = true
transform = [{ translate = [0, 1.1, 0] }]
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 5.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[lights]]
type = "spot"
position = [3.0, 6.0, 2.0]
target = [0.0, 1.0, 0.0]
cutoff_angle = 30.0
intensity = 200.0
[[lights]]
type = "environment"
radiance = [0.1, 0.12, 0.15]
"#;
    let mut files = Files {
        scene: "million.toml".into(),
        ..Files::default()
    };
    files.files.insert("million.toml".into(), File::new(text.as_bytes()));
    files.files.insert("ball.ply".into(), File::new(ply));
    Ok(files)
}
