//! Mitsuba's XML scenes. Numbers attributed to Mitsuba were read back from Mitsuba 3.9.1 (`mi.load_string` and
//! `mi.traverse`, variant `scalar_rgb`).

mod equality;
mod errors;
mod limits;
mod materials;
mod media;
mod sensors;
mod shapes;
mod structure;
mod values;

use beamfarm_render::world::SceneDescription;
use beamfarm_scene::{ImportOptions, Imported, SceneFile, import};
use std::path::Path;
use tempfile::TempDir;

const SENSOR: &str = r#"<sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="8"/><rfilter type="box"/></film></sensor>"#;

/// A scene of these elements without a sensor.
fn bare(elements: &str) -> String {
    format!("<scene version=\"3.0.0\">\n{elements}\n</scene>")
}

/// A scene of these elements, from line 2 on, and a sensor after them.
fn with_sensor(elements: &str) -> String {
    bare(&format!("{elements}\n{SENSOR}"))
}

/// A folder with these files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    folder
}

fn import_in(folder: &Path, options: &ImportOptions) -> Result<Imported, Vec<String>> {
    import(&folder.join("scene.xml"), folder, options).map_err(|error| {
        let prefix = format!("{}/", folder.display());
        let text = error.to_string().replace(&prefix, "");
        text.lines().map(str::to_string).collect()
    })
}

fn try_import(xml: &str) -> Result<Imported, Vec<String>> {
    import_in(folder(&[("scene.xml", xml)]).path(), &ImportOptions::default())
}

/// The native scene of a whole XML file.
fn native(xml: &str) -> String {
    match try_import(xml) {
        Ok(imported) => imported.text,
        Err(errors) => panic!("{}", errors.join("\n")),
    }
}

/// The errors of a whole XML file, one line each.
fn errors(xml: &str) -> Vec<String> {
    match try_import(xml) {
        Ok(imported) => panic!("expected errors, found\n{}", imported.text),
        Err(errors) => errors,
    }
}

/// The scene that a whole XML file describes.
fn scene(xml: &str) -> SceneDescription {
    scene_in(folder(&[("scene.xml", xml)]).path())
}

fn scene_in(folder: &Path) -> SceneDescription {
    let file = SceneFile::read(&folder.join("scene.xml"), &ImportOptions::default());
    let scene = file.and_then(|file| file.load());
    scene.unwrap_or_else(|error| panic!("{error}"))
}

/// The value of a field of the native scene: on the first line that begins with it, below a heading.
fn field<'a>(native: &'a str, heading: &str, name: &str) -> Option<&'a str> {
    let mut lines = native.lines().skip_while(|line| *line != heading).skip(1);
    lines
        .by_ref()
        .take_while(|line| !line.starts_with('['))
        .find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "))
}

#[track_caller]
fn assert_error(xml: &str, place: &str, words: &[&str]) {
    let errors = errors(xml);
    let found = errors
        .iter()
        .any(|e| e.starts_with(place) && words.iter().all(|word| e.contains(word)));
    assert!(found, "{place} {words:?} not in {errors:#?}");
}
