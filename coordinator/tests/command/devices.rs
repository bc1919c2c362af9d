//! Passes on GPUs: listing, refusals, and the bits of renders. The command may be built without them, and there may be
//! no device: tests that cannot run then print a note and pass.

use crate::setup::{LONG, attribute, beamfarm, fail, folder_with, line, output, run, scene, spawn, succeed, text};
use beamfarm_image::job::EngineKind;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const NOT_BUILT: &str = "error: this program was built without the engine gpu: `cargo build --release --features gpu` \
                         makes one that has it\n";

/// A place where the Vulkan loader finds no driver.
fn without_drivers(folder: &Path, args: &[&str]) -> Command {
    let mut command = beamfarm(folder, args);
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(name, folder.join("no-driver.json"));
    }
    command.env_remove("VK_ADD_DRIVER_FILES");
    command
}

/// Exit code and stderr of a command that prints nothing else.
fn failed(command: Command) -> (Option<i32>, String) {
    let output = output(command);
    assert_eq!(text(&output.stdout), "");
    (output.status.code(), text(&output.stderr).to_owned())
}

/// Whether the command was built with the engine gpu.
fn is_built(folder: &Path) -> bool {
    let (code, stderr) = failed(without_drivers(folder, &["devices"]));
    let is_built = stderr != NOT_BUILT;
    if !is_built {
        assert_eq!(code, Some(2));
        println!("not tried: the command is built without the engine gpu");
    }
    is_built
}

/// Whether it has a device as well.
pub fn has_device(folder: &Path) -> bool {
    let there = is_built(folder) && run(folder, &["devices"]).status.success();
    if !there {
        println!("not tried: there is no device");
    }
    there
}

/// A picture that devices can render.
fn easy() -> String {
    scene([16, 12], 2, 200)
}

/// The same with something that devices cannot render.
fn hard() -> String {
    let easy = easy();
    format!(
        "{easy}[[shapes]]\ntype = \"cylinder\"\nname = \"tube\"\np0 = [0, 3, 0]\np1 = [1, 3, 0]\nradius = 0.1\n\
         emission = {{ radiance = 1.0 }}\n[[shapes]]\ntype = \"sphere\"\nname = \"egg\"\ncenter = [2, 3, 0]\n\
         radius = 0.1\ntransform = [{{ scale = [1, 2, 1] }}]\nemission = {{ radiance = 1.0 }}\n{NOT_FOR_DEVICES}"
    )
}

/// One of each kind of surface, shape and light that only processors render.
const NOT_FOR_DEVICES: &str = r#"
[materials.leaf]
type = "translucent"
[materials.skin]
type = "principled"
subsurface = 1
subsurface_radius = 0.1
[materials.fur]
type = "hair"
[materials.pile]
type = "velvet"
[materials.felt]
type = "sheen"
[materials.clay]
type = "diffuse"
roughness = 0.5
[materials.silk]
type = "principled"
diffuse_roughness = 0.5
sheen_weight = 0.5
[materials.pan]
type = "rough_conductor"
preset = "gold"
alpha_u = 0.1
alpha_v = 0.4
[materials.car]
type = "principled"
coat_weight = 1
specular_color = [1, 0.5, 0]
thin_film_thickness = 0.3
[media.flame]
type = "homogeneous"
emission = 1
[materials.nothing]
type = "null"
[[shapes]]
type = "sphere"
material = "leaf"
center = [4, 3, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "skin"
center = [5, 3, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "pile"
center = [4, 4, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "pan"
center = [5, 4, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "felt"
center = [4, 5, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "clay"
center = [5, 5, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "silk"
center = [6, 5, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "car"
center = [6, 4, 0]
radius = 0.1
[[shapes]]
type = "sphere"
material = "nothing"
interior = "flame"
center = [6, 3, 0]
radius = 0.1
[[shapes]]
type = "curves"
name = "lock"
basis = "linear"
material = "fur"
points = [[7, 3, 0, 0.1], [8, 3, 0, 0.1]]
"#;

#[test]
fn devices_are_listed_with_their_tests() {
    let folder = folder_with(&easy());
    let path = folder.path();
    if !is_built(path) {
        return;
    }
    let output = run(path, &["devices"]);
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    if stderr.contains("no Vulkan device") {
        assert_eq!(output.status.code(), Some(1));
        println!("not tried: there is no device");
        return;
    }
    let mut lines = stdout.lines();
    let head: Vec<&str> = lines.next().unwrap().split_whitespace().collect();
    assert_eq!(head, ["device", "kind", "memory", "driver", "test"], "{stdout}");
    let can_be_used = lines.clone().any(|line| line.contains(" passed in "));
    assert_eq!(output.status.code(), Some(if can_be_used { 0 } else { 1 }), "{stderr}");
    for (number, line) in lines.enumerate() {
        let number = number.to_string();
        assert_eq!(line.split_whitespace().next(), Some(&*number), "{stdout}");
        if line.contains("llvmpipe") {
            assert!(line.contains("software") && line.contains("GiB"), "{line}");
            assert!(line.contains("s: division native, roots native"), "{line}");
        }
    }
}

#[test]
fn without_vulkan_there_is_one_sentence() {
    let folder = folder_with(&easy());
    let path = folder.path();
    let expected = match is_built(path) {
        true => (
            Some(1),
            "error: no Vulkan device was found: is a driver installed?\n".to_owned(),
        ),
        false => (Some(2), NOT_BUILT.to_owned()),
    };
    for args in [
        &["devices"][..],
        &["render", "scene.toml", "--engine", "gpu", "-o", "a.exr"],
        &["render", "scene.toml", "-D", "render.engine=gpu", "-o", "a.exr"],
        &["replay", "scene.toml", "--engine", "gpu", "--pass", "0"],
    ] {
        assert_eq!(failed(without_drivers(path, args)), expected, "{args:?}");
        assert!(!path.join("a.exr").exists());
    }
    // Processors need no device, and the command line overrides the scene.
    let args = ["-D", "render.engine=gpu", "--engine", "cpu", "-o", "a.exr", "--quiet"];
    let output = output(without_drivers(path, &[&["render", "scene.toml"], &args[..]].concat()));
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(
        attribute(&path.join("a.exr"), "beamfarmEngine"),
        EngineKind::Cpu.identity()
    );

    let (code, stderr) = fail(path, &["render", "scene.toml", "--engine", "tpu"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("expected cpu, gpu or auto"), "{stderr}");
}

/// What a job of processors reports when it is to go on with a device.
fn others() -> String {
    let [cpu, gpu] = [EngineKind::Cpu, EngineKind::Gpu].map(EngineKind::identity);
    format!("engine {cpu} there, {gpu} here")
}

/// This happens only where the scene or the user leaves the choice to the command, and it prints the reason.
#[test]
fn auto_stays_with_processors_where_there_is_no_card() {
    let folder = folder_with(&easy());
    let path = folder.path();
    let why = match is_built(path) {
        true => "note: engine cpu: no Vulkan device was found: is a driver installed?",
        false => "note: engine cpu: this program was built without the engine gpu",
    };
    for auto in [["--engine", "auto"], ["-D", "render.engine=auto"]] {
        let args = [&["render", "scene.toml", "--passes", "1", "-o", "a.exr"][..], &auto].concat();
        let output = output(without_drivers(path, &args));
        let stderr = text(&output.stderr);
        assert!(output.status.success(), "{stderr}");
        assert_eq!(stderr.matches(why).count(), 1, "{stderr}");
        assert_eq!(
            attribute(&path.join("a.exr"), "beamfarmEngine"),
            EngineKind::Cpu.identity()
        );
    }
    // Options must be passed on to renders in other processes and to later ones.
    for command in [
        &["serve", "scene.toml", "--listen", "127.0.0.1:0"][..],
        &["replay", "scene.toml", "--pass", "0"],
    ] {
        let (code, stderr) = fail(path, &[command, &["--engine", "auto"]].concat());
        assert_eq!(code, 2);
        assert!(stderr.contains("expected --engine cpu or --engine gpu"), "{stderr}");
    }
}

#[test]
fn a_device_that_is_not_there_is_named() {
    let folder = folder_with(&easy());
    let path = folder.path();
    if !has_device(path) {
        return;
    }
    for gpu in ["nobody's", "99"] {
        let args = ["render", "scene.toml", "--engine", "gpu", "--gpu", gpu, "-o", "a.exr"];
        let (code, stderr) = fail(path, &args);
        assert_eq!(code, 1, "{stderr}");
        let start = format!("error: there is no device \"{gpu}\"; there are: 0 ");
        assert!(stderr.starts_with(&start) && stderr.lines().count() == 1, "{stderr}");
    }
}

/// All of it, before anything is rendered, even if the device is elsewhere.
#[test]
fn what_keeps_a_scene_from_devices_is_told_at_once() {
    let folder = folder_with(&hard());
    let path = folder.path();
    let explained = succeed(path, &["explain", "scene.toml"]);
    let told: Vec<&str> = explained.lines().filter(|line| line.starts_with("engine: ")).collect();
    if !is_built(path) {
        assert!(told.is_empty(), "{told:?}");
        return;
    }
    let reasons: Vec<&str> = told
        .iter()
        .map(|line| line.strip_prefix("engine: gpu not possible, ").unwrap())
        .collect();
    for expected in [
        "light \"egg\": shape: kernels have no spheres that emit and are stretched",
        "light \"tube\": shape: kernels have no cylinders that emit",
        "material \"leaf\": type: kernels have no translucent surfaces",
        "material \"skin\": subsurface: kernels have no media beneath surfaces",
        "material \"fur\": type: kernels have no hair",
        "material \"pile\": type: kernels have no velvet",
        "material \"felt\": type: kernels have no sheen of microfibers",
        "material \"clay\": roughness: kernels have no rough diffuse surfaces",
        "material \"silk\": diffuse_roughness: kernels have no rough diffuse surfaces",
        "material \"silk\": sheen_weight: kernels have no sheen of microfibers",
        "material \"pan\": alpha_u: kernels have no microfacets that are rougher in one direction",
        "material \"car\": coat_weight: kernels have no clear coats",
        "material \"car\": specular_color: kernels have no reflections with a colour of their own",
        "material \"car\": thin_film_thickness: kernels have no thin films",
        "light \"flame\": emission: kernels have no media that emit",
        "object \"lock\": type: kernels have no curves and points",
    ] {
        let count = reasons.iter().filter(|reason| reason.starts_with(expected)).count();
        assert_eq!(count, 1, "{reasons:?}");
    }
    let expected = format!(
        "error: the engine gpu cannot render this scene:\n  {}\n",
        reasons.join("\n  ")
    );
    let serve = [
        "serve",
        "scene.toml",
        "--engine",
        "gpu",
        "--listen",
        "127.0.0.1:0",
        "-o",
        "a.exr",
    ];
    let (code, stderr) = failed(without_drivers(path, &serve));
    let own: String = stderr
        .split_inclusive('\n')
        .filter(|line| !line.starts_with("note: "))
        .collect();
    assert_eq!((code, own), (Some(2), expected));
    assert!(!path.join("a.exr").exists() && !path.join("a.job").exists());
    // With any layers.
    let easy = folder_with(&easy());
    let explain = |more: &[&str]| succeed(easy.path(), &[&["explain", "scene.toml"], more].concat());
    assert!(line(&explain(&[]), "engine: ").starts_with("engine: gpu possible, takes "));
    let told = explain(&["--aov", "motion,depth,beam_density"]);
    assert!(line(&told, "engine: ").starts_with("engine: gpu possible, takes "));
}

/// A job begun with one engine does not go on with the other, and a worker without the job's engine says so and ends.
#[test]
fn a_job_is_of_one_engine() {
    let folder = folder_with(&easy());
    let path = folder.path();
    if !is_built(path) {
        return;
    }
    succeed(path, &["render", "scene.toml", "--job", "a.job", "-o", "a.exr"]);
    let of_gpu = ["serve", "scene.toml", "--engine", "gpu", "--listen", "127.0.0.1:0"];
    let (code, stderr) = fail(path, &[&of_gpu[..], &["--job", "a.job", "-o", "a.exr"]].concat());
    assert_eq!(code, 2);
    assert!(stderr.contains(&others()), "{stderr}");

    let mut serve = spawn(beamfarm(
        path,
        &[&of_gpu[..], &["--job", "b.job", "-o", "b.exr"]].concat(),
    ));
    let address = serve.out.wait_for("listening on ");
    let begun = Instant::now();
    let (code, stderr) = failed(without_drivers(
        path,
        &["worker", "--connect", &address, "--log", "error"],
    ));
    assert_eq!(
        (code, &*stderr),
        (
            Some(6),
            "error: refused by the coordinator: the job is for the engine gpu, which this worker does not offer: no Vulkan \
             device was found: is a driver installed?\n"
        )
    );
    assert!(begun.elapsed() < LONG);
    // Status shows it.
    let status = succeed(path, &["status", &address]);
    assert!(status.contains("\nengine    gpu 8\n"), "{status}");
    assert!(
        line(&status, "          ")
            .ends_with("cannot serve this job: no Vulkan device was found: is a driver installed?"),
        "{status}"
    );
    let status = succeed(path, &["status", &address, "--json"]);
    assert!(
        status.contains("\"unable\"") && status.contains("\"times\": 1"),
        "{status}"
    );
    serve.signal("-INT");
    assert_eq!(serve.wait().code(), Some(4));
    let job = std::fs::read_to_string(path.join("b.job/job.json")).unwrap();
    assert!(job.contains("\"engine\": \"gpu 8\""), "{job}");
}

/// Before it looks for a coordinator.
#[test]
fn a_worker_that_lacks_what_it_was_to_offer_says_so() {
    let folder = folder_with(&easy());
    let path = folder.path();
    let nowhere = ["worker", "--connect", "http://127.0.0.1:1", "--patience", "1ms"];
    let worker = |more: &[&str]| failed(without_drivers(path, &[&nowhere, more].concat()));
    let (code, stderr) = worker(&["--engine", "cpu", "--gpu", "0"]);
    assert_eq!((code, &*stderr), (Some(2), "error: --gpu: --engine has no gpu\n"));
    let (code, stderr) = worker(&["--engine", "tpu"]);
    assert_eq!(code, Some(2));
    assert!(stderr.contains("expected cpu or gpu"), "{stderr}");
    let expected = match is_built(path) {
        true => "error: no Vulkan device was found: is a driver installed?\n",
        false => NOT_BUILT,
    };
    for more in [
        &["--engine", "gpu"][..],
        &["--gpu", "all"],
        &["--gpu", "0,1", "--engine", "gpu,cpu"],
    ] {
        assert_eq!(worker(more), (Some(6), expected.to_owned()), "{more:?}");
    }
    // No device was asked for, and there is none.
    let (code, stderr) = worker(&[]);
    assert_eq!(code, Some(3), "{stderr}");
    if has_device(path) && !succeed(path, &["devices"]).contains("discrete") {
        let (code, stderr) = fail(path, &[&nowhere[..], &["--engine", "gpu"]].concat());
        assert_eq!(code, 6);
        let start = "error: there is no card here that can be used, and what is none has to be named by --gpu: ";
        assert!(stderr.starts_with(start) && stderr.lines().count() == 1, "{stderr}");
        let (code, stderr) = fail(path, &[&nowhere[..], &["--gpu", "0"]].concat());
        assert_eq!(code, 3, "{stderr}");
    }
}

/// Each device is a worker, and those that a job cannot use leave it to the others.
#[test]
fn devices_of_one_machine_are_workers_and_so_are_its_processors() {
    let folder = folder_with(&easy());
    let path = folder.path();
    if !has_device(path) {
        return;
    }
    let listed = succeed(path, &["devices"]);
    let name = listed
        .lines()
        .nth(1)
        .and_then(|line| line.split_whitespace().nth(1))
        .unwrap();
    let mut serve = spawn(beamfarm(
        path,
        &[
            "serve",
            "scene.toml",
            "--listen",
            "127.0.0.1:0",
            "-o",
            "a.exr",
            "--passes",
            "2",
        ],
    ));
    let address = serve.out.wait_for("listening on ");
    let both = format!("0,{name}");
    let args = [
        "worker",
        "--connect",
        &address,
        "--name",
        "node",
        "--gpu",
        &both,
        "--no-cache",
    ];
    // Or the processor finishes before the device is ready.
    succeed(path, &["pause", &address]);
    let mut worker = spawn(beamfarm(path, &args));
    let ended = worker.log.wait_for(&format!("\"node gpu {name}\" has ended: "));
    let refused = "refused by the coordinator: the job is for the engine cpu";
    assert!(ended.starts_with(refused), "{ended}");
    succeed(path, &["resume", &address]);
    worker.log.wait_for("done after 2 passes");
    assert!(worker.wait().success() && serve.wait().success());
}

/// A command that uses what Mesa compiled for earlier tests: with a software driver, compiling takes longer than
/// everything else.
fn with_compiled(folder: &Path, args: &[&str]) -> Command {
    let mut command = beamfarm(folder, args);
    let compiled = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compiled-kernels");
    command.env("MESA_SHADER_CACHE_DIR", &compiled);
    // The variable's name in older versions.
    command.env("MESA_GLSL_CACHE_DIR", &compiled);
    command
}

/// A farm's passes on a device, the image's attributes, and one of the passes once more. There are no photons, which
/// would need further kernels to be compiled.
#[test]
fn passes_on_a_device_have_the_same_bits_again() {
    let folder = folder_with(&easy().replace("\"photons\"", "\"paths\""));
    let path = folder.path();
    if !has_device(path) {
        return;
    }
    let on_device = ["--engine", "gpu"];
    let render = |name: &str, more: &[&str]| {
        let job = format!("{name}.job");
        let image = format!("{name}.exr");
        let args = ["render", "scene.toml", "--passes", "1", "--job", &job, "-o", &image];
        let output = output(with_compiled(path, &[&args, more].concat()));
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout).to_owned()
    };
    let first = render("a", &on_device);
    let pixels = line(&first, "pixels ");
    assert!(
        first.contains("from 1 worker") && first.contains("rendered by the engine gpu 8"),
        "{first}"
    );
    assert_eq!(attribute(&path.join("a.exr"), "beamfarmEngine"), "gpu 8");
    let report = std::fs::read_to_string(path.join("a.job/report.json")).unwrap();
    assert!(report.contains("\"engine\": \"gpu 8\""), "{report}");
    let replay = [&["replay", "scene.toml", "--pass", "0"], &on_device[..]].concat();
    let replay = output(with_compiled(path, &replay));
    assert!(replay.status.success(), "{}", text(&replay.stderr));
    assert_eq!(line(text(&replay.stdout), "pass 0 "), format!("pass 0 {pixels}"));
    // Both are measured; the job uses the better one and has its bits.
    let auto = [
        "render",
        "scene.toml",
        "--passes",
        "1",
        "--job",
        "d.job",
        "-o",
        "d.exr",
        "--gpu",
        "0",
    ];
    let auto = output(with_compiled(path, &[&auto[..], &["--engine", "auto"]].concat()));
    let said = text(&auto.stderr);
    assert!(auto.status.success(), "{said}");
    let note = said.lines().find(|line| line.starts_with("note: engine ")).unwrap();
    assert!(
        note.contains("error² x time is 0.") && note.contains("% error"),
        "{note}"
    );
    let job = std::fs::read_to_string(path.join("d.job/job.json")).unwrap();
    assert_eq!(
        note.starts_with("note: engine gpu: "),
        job.contains("\"engine\": \"gpu 8\""),
        "{note}"
    );
    // The processor's bits differ, and its passes are not added to these.
    let by_processor = render("b", &[]);
    assert_ne!(line(&by_processor, "pixels "), pixels);
    assert!(!by_processor.contains("engine"), "{by_processor}");
    for jobs in [["a.job", "b.job"], ["b.job", "a.job"]] {
        let (code, stderr) = fail(path, &[&["merge"], &jobs[..], &["-o", "c.exr"]].concat());
        assert_eq!(code, 2);
        assert!(stderr.contains("engine ") && stderr.contains("gpu 8"), "{stderr}");
    }
    let args = ["render", "scene.toml", "--passes", "2", "--job", "b.job", "-o", "b.exr"];
    let (code, stderr) = fail(path, &[&args, &on_device[..]].concat());
    assert_eq!(code, 2);
    assert!(stderr.contains(&others()), "{stderr}");
    // A resumed job is not measured again.
    let auto = succeed(path, &[&args[..], &["--engine", "auto"]].concat());
    assert!(
        auto.contains("resuming b.job with 1 passes") && !auto.contains("engine"),
        "{auto}"
    );
}
