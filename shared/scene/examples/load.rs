//! How long it takes from a scene's files to a first pass of 128 x 128 pixels, and how much memory.
//!
//!     cargo run --release -p beamfarm-scene --example load -- --make /tmp/load 5000000
//!     cargo run --release -p beamfarm-scene --example load -- /tmp/load/ply.toml
//!
//! The first writes a bumpy glass ball of so many triangles as a PLY, an OBJ and a glTF file, each with a scene; the
//! second times a scene, on `--threads N` (two). `beamfarm render` and `bench` take the same scenes.

use beamfarm_image::job::JobSettings;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::Shape;
use beamfarm_scene::{Files, Store, read_bundle};
use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let mut threads = 2;
    let mut arguments = std::env::args().skip(1);
    let usage = "expected --make FOLDER TRIANGLES, or [--threads N] SCENE";
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--make" => {
                let (folder, triangles) = (arguments.next().ok_or(usage)?, arguments.next().ok_or(usage)?);
                make(Path::new(&folder), triangles.parse()?)?;
            }
            "--threads" => threads = arguments.next().ok_or(usage)?.parse()?,
            path => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
                pool.install(|| measure(Path::new(path)))?;
            }
        }
    }
    Ok(())
}

fn measure(path: &Path) -> Result<(), Failure> {
    let begun = Instant::now();
    let mut last = 0.0;
    let mut part = |what: &str| {
        let now = begun.elapsed().as_secs_f64();
        println!("  {what:<12} {:7.2} s", now - last);
        last = now;
    };
    println!("{}", path.display());
    let files: Files = read_bundle(path)?.into();
    part("files");
    let description = Store::default().load(&files)?;
    part("scene");
    let triangles: usize = description
        .objects
        .iter()
        .map(|object| match &object.shape {
            Shape::Mesh { mesh, .. } => mesh.triangles.len(),
            _ => 0,
        })
        .sum();
    let mut scene = Scene::new(description);
    part("hierarchies");
    scene.resize(128, 128);
    let settings = JobSettings {
        paths_per_pass: 1000,
        ..scene.description().defaults.job_settings()
    };
    let plan = RenderPlan::new(&scene, settings);
    part("plan");
    let film = render_pass(&scene, &plan, 0).expect("a pass").film;
    part("first pass");
    for pass in 1..5 {
        render_pass(&scene, &plan, pass).expect("a pass");
    }
    part("four passes");
    let sum: f64 = film.pixels.iter().flatten().map(|x| f64::from(*x)).sum();
    println!("  sum of the first pass {sum}, of {triangles} triangles");
    if let Some(bytes) = peak_memory() {
        println!(
            "  at most {:.0} MB, {:.0} bytes a triangle",
            bytes / 1e6,
            bytes / triangles as f64
        );
    }
    Ok(())
}

/// The most memory that this process has had at a time, bytes; where the system says it.
fn peak_memory() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(1024.0 * kilobytes)
}

/// Vertices and triangles of a bumpy ball.
struct Ball {
    rows: u32,
    columns: u32,
}

impl Ball {
    fn vertices(&self) -> impl Iterator<Item = [f32; 3]> {
        let (rows, columns) = (self.rows, self.columns);
        (0..=rows).flat_map(move |row| {
            let (sin_theta, cos_theta) = libm::sincos(std::f64::consts::PI * f64::from(row) / f64::from(rows));
            (0..columns).map(move |column| {
                let (sin_phi, cos_phi) = libm::sincos(std::f64::consts::TAU * f64::from(column) / f64::from(columns));
                let radius = 1.0 + 0.02 * libm::sin(8.0 * cos_theta) * libm::cos(6.0 * sin_phi);
                [sin_theta * cos_phi, cos_theta, sin_theta * sin_phi].map(|x| (radius * x) as f32)
            })
        })
    }

    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let columns = self.columns;
        (0..self.rows).flat_map(move |row| {
            (0..columns).flat_map(move |column| {
                let at = |row: u32, column: u32| row * columns + column % columns;
                let [a, b] = [at(row, column), at(row, column + 1)];
                let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
                [[a, b, d], [a, d, c]]
            })
        })
    }

    fn vertex_count(&self) -> u32 {
        (self.rows + 1) * self.columns
    }

    fn triangle_count(&self) -> u32 {
        2 * self.rows * self.columns
    }

    fn ply(&self, out: &mut impl Write) -> Result<(), Failure> {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.vertex_count(),
            self.triangle_count()
        )?;
        for x in self.vertices().flatten() {
            out.write_all(&x.to_le_bytes())?;
        }
        for triangle in self.triangles() {
            out.write_all(&[3])?;
            for v in triangle {
                out.write_all(&v.to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn obj(&self, out: &mut impl Write) -> Result<(), Failure> {
        for [x, y, z] in self.vertices() {
            writeln!(out, "v {x} {y} {z}")?;
        }
        for [a, b, c] in self.triangles() {
            writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        Ok(())
    }

    fn glb(&self, out: &mut impl Write) -> Result<(), Failure> {
        let [at_triangles, of_triangles] = [12 * self.vertex_count(), 12 * self.triangle_count()];
        let length = at_triangles + of_triangles;
        let mut json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{length}}}],"bufferViews":[
            {{"buffer":0,"byteLength":{at_triangles}}},
            {{"buffer":0,"byteOffset":{at_triangles},"byteLength":{of_triangles}}}],"accessors":[
            {{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[-2,-2,-2],"max":[2,2,2]}},
            {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":4}}]}}],
            "nodes":[{{"mesh":0,"translation":[0,1.1,0]}}],"scenes":[{{"nodes":[0]}}],"scene":0}}"#,
            self.vertex_count(),
            3 * self.triangle_count(),
        );
        while json.len() % 4 != 0 {
            json.push(' ');
        }
        let json_length = json.len() as u32;
        for word in [0x4654_6c67, 2, 28 + json_length + length, json_length, 0x4e4f_534a] {
            out.write_all(&word.to_le_bytes())?;
        }
        out.write_all(json.as_bytes())?;
        for word in [length, 0x004e_4942] {
            out.write_all(&word.to_le_bytes())?;
        }
        for x in self.vertices().flatten() {
            out.write_all(&x.to_le_bytes())?;
        }
        for v in self.triangles().flatten() {
            out.write_all(&v.to_le_bytes())?;
        }
        Ok(())
    }
}

fn make(folder: &Path, triangles: u32) -> Result<(), Failure> {
    fs::create_dir_all(folder)?;
    let rows = (f64::from(triangles) / 4.0).sqrt().ceil().max(2.0) as u32;
    let ball = Ball {
        rows,
        columns: triangles.div_ceil(2 * rows).max(3),
    };
    let file = |name: &str| -> Result<_, Failure> { Ok(BufWriter::new(File::create(folder.join(name))?)) };
    let mut out = file("ball.ply")?;
    ball.ply(&mut out)?;
    out.flush()?;
    let mut out = file("ball.obj")?;
    ball.obj(&mut out)?;
    out.flush()?;
    let mut out = file("ball.glb")?;
    ball.glb(&mut out)?;
    out.flush()?;
    let shape = |file: &str| {
        format!(
            "[[shapes]]\ntype = \"mesh\"\nfile = \"{file}\"\nmaterial = \"glass\"\nsmooth = true\n\
             transform = [{{ translate = [0, 1.1, 0] }}]\n"
        )
    };
    for (name, placed) in [
        ("ply", shape("ball.ply")),
        ("obj", shape("ball.obj")),
        ("glb", "[[gltf]]\nfile = \"ball.glb\"\n".to_owned()),
    ] {
        fs::write(folder.join(name).with_extension("toml"), format!("{SCENE}{placed}"))?;
    }
    Ok(())
}

const SCENE: &str = r#"
[image]
width = 128
height = 128
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
