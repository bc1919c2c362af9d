//! Which files on disk become files of a scene: those that it uses in its folder, and those that its user names
//! elsewhere.

use beamfarm_scene::{Edits, File, Files, ImportOptions, Reach, SceneFile, Written};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const HEAD: &str = "image = { width = 8, height = 6 }\ncamera = { origin = [0, 0, 3], target = [0, 0, 0], fov = 40 }\n\
    lights = [{ type = \"point\", position = [0, 3, 0], power = 9 }]\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";

/// A disk with `scene/`, `beside/` and a `secret` above them.
struct Disk {
    folder: TempDir,
}

impl Disk {
    fn new() -> Self {
        let disk = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        for (name, text) in [
            ("secret", "a secret"),
            ("beside/out.ply", PLY),
            ("scene/in.ply", PLY),
            ("scene/a.bin", ""),
        ] {
            disk.put(name, text);
        }
        let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
        for name in ["scene/a.bin", "beside/a.bin"] {
            fs::write(disk.path(name), &bytes).unwrap();
        }
        disk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// The keys of the scene's files without its own, and its note on files elsewhere; or the error's message.
    fn read(&self, name: &str, allowed: &[&str]) -> Result<(Vec<String>, Option<String>), String> {
        let options = ImportOptions {
            allow_outside: allowed.iter().map(|name| self.path(name)).collect(),
            ..ImportOptions::default()
        };
        let file = SceneFile::read(&self.path(name), &options).map_err(|error| error.to_string())?;
        file.load().map_err(|error| error.to_string())?;
        let keys = file.bundle.files.keys().filter(|key| **key != file.bundle.scene);
        Ok((keys.cloned().collect(), file.reach.note()))
    }
}

/// A glTF file of a triangle in this buffer, with further buffers and images that nothing uses.
fn gltf(buffer: &str, unused: &str) -> String {
    format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "scenes": [{{ "nodes": [0] }}], "nodes": [{{ "mesh": 0 }}, {{ "mesh": 1 }}],
        "meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0 }}, "material": 0 }}] }},
            {{ "primitives": [{{ "attributes": {{ "POSITION": 1 }}, "material": 1 }}] }}],
        "materials": [{{ "occlusionTexture": {{ "index": 0 }} }}, {{ "emissiveTexture": {{ "index": 0 }} }}],
        "textures": [{{ "source": 0 }}], "images": [{{ "uri": "{unused}" }}, {{ "uri": "{unused}" }}],
        "buffers": [{{ "byteLength": 36, "uri": "{buffer}" }}, {{ "byteLength": 36, "uri": "{unused}" }},
            {{ "byteLength": 4, "uri": "{unused}" }}],
        "bufferViews": [{{ "buffer": 0, "byteLength": 36 }}, {{ "buffer": 1, "byteLength": 36 }}],
        "accessors": [
            {{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [1,1,0] }},
            {{ "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [1,1,0] }}] }}"#
    )
}

fn xml(shapes: &str) -> String {
    format!(
        "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"><film type=\"hdrfilm\"/>\
         </sensor><emitter type=\"constant\"/>{shapes}</scene>"
    )
}

fn is_refused(read: Result<(Vec<String>, Option<String>), String>, what: &str) {
    let error = read.expect_err(what);
    assert!(error.contains("outside of the scene's folder"), "{what}: {error}");
    assert!(error.contains("--allow-outside"), "{what}: {error}");
}

/// Unused files are not read, wherever they lie, and may even be missing.
#[test]
fn only_what_is_used_of_a_gltf_file_is_read() {
    let disk = Disk::new();
    disk.put("scene/scene.toml", &format!("{HEAD}[[gltf]]\nfile = \"a.gltf\"\n"));
    for unused in ["../secret", "../../../../../../etc/passwd", "nowhere", "in.ply"] {
        disk.put("scene/a.gltf", &gltf("a.bin", unused));
        for (scene, expected) in [
            ("scene/scene.toml", ["a.bin", "a.gltf"]),
            ("scene/a.gltf", ["a.bin", "a.gltf"]),
        ] {
            let (keys, note) = disk.read(scene, &[]).unwrap();
            assert_eq!(keys, expected, "{scene}: {unused}");
            assert_eq!(note, None);
        }
    }
}

/// The file that the user gives may name files elsewhere; no other file may.
#[test]
fn the_file_that_is_given_may_name_files_anywhere_and_others_may_not() {
    let disk = Disk::new();
    let outside = disk.path("beside/out.ply");
    let mesh = |file: &str| format!("{HEAD}[[shapes]]\ntype = \"mesh\"\nfile = {file:?}\n");
    for file in ["../beside/out.ply", outside.to_str().unwrap(), "in.ply"] {
        disk.put("scene/scene.toml", &mesh(file));
        let (keys, note) = disk.read("scene/scene.toml", &[]).unwrap();
        assert_eq!(keys.len(), 1);
        assert_eq!(note.is_some(), file != "in.ply");
        assert!(note.is_none_or(|note| note.contains("out.ply")));
    }
    // A glTF file, given directly and named by another file.
    disk.put("scene/scene.toml", &format!("{HEAD}[[gltf]]\nfile = \"a.gltf\"\n"));
    disk.put("scene/a.gltf", &gltf("../beside/a.bin", "nowhere"));
    let (keys, note) = disk.read("scene/a.gltf", &[]).unwrap();
    assert_eq!(keys, ["%2E%2E/beside/a.bin", "a.gltf"]);
    assert!(note.unwrap().contains("beside/a.bin"));
    is_refused(disk.read("scene/scene.toml", &[]), "a buffer");
    is_refused(
        disk.read("scene/scene.toml", &["scene"]),
        "a buffer, with another folder",
    );
    assert_eq!(disk.read("scene/scene.toml", &["beside"]).unwrap(), (keys, None));
    // One that lies elsewhere may use its own folder, and nothing more.
    disk.put(
        "scene/scene.toml",
        &format!("{HEAD}[[gltf]]\nfile = \"../beside/a.gltf\"\n"),
    );
    disk.put("beside/a.gltf", &gltf("a.bin", "nowhere"));
    assert_eq!(disk.read("scene/scene.toml", &[]).unwrap().0.len(), 2);
    disk.put("beside/a.gltf", &gltf("../far/a.bin", "nowhere"));
    disk.put("far/a.bin", "");
    is_refused(disk.read("scene/scene.toml", &[]), "a buffer of one elsewhere");
    // Materials of a mesh, and their images.
    disk.put("scene/a.obj", OBJ);
    let text = mesh("a.obj") + "mtl = true\n";
    disk.put("scene/scene.toml", &text);
    disk.put("scene/a.obj", &OBJ.replace("a.mtl", "../secret.mtl"));
    disk.put("secret.mtl", "newmtl a\nKd 1 1 1\n");
    is_refused(disk.read("scene/scene.toml", &[]), "an .mtl file");
    disk.put("scene/a.obj", OBJ);
    disk.put("scene/a.mtl", "newmtl a\nmap_Kd ../secret\n");
    is_refused(disk.read("scene/scene.toml", &[]), "an image");
    // XML: what the file itself names, what an included file names, and what one passes to the other as a parameter.
    let ply = |file: &str| format!("<shape type=\"ply\"><string name=\"filename\" value=\"{file}\"/></shape>");
    let picture = "<texture type=\"bitmap\" id=\"t\"><string name=\"filename\" value=\"../secret\"/></texture>";
    let spectrum = "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" filename=\"../secret\"/>\
        </bsdf></shape>";
    disk.put("scene/scene.xml", &xml(&ply("../beside/out.ply")));
    let (keys, note) = disk.read("scene/scene.xml", &[]).unwrap();
    assert_eq!((keys, note.is_some()), (vec!["%2E%2E/beside/out.ply".to_owned()], true));
    let include = "<include filename=\"more.xml\"/>";
    disk.put("scene/scene.xml", &xml(include));
    for (more, what) in [
        (ply("../beside/out.ply"), "a mesh"),
        (spectrum.to_owned(), "a spectrum"),
        ("<include filename=\"../secret\"/>".to_owned(), "an include"),
        (format!("<path value=\"../beside\"/>{}", ply("out.ply")), "a path"),
    ] {
        disk.put("scene/more.xml", &format!("<scene version=\"3.0.0\">{more}</scene>"));
        is_refused(disk.read("scene/scene.xml", &[]), what);
    }
    let used = "<shape type=\"sphere\"><bsdf type=\"diffuse\"><ref name=\"reflectance\" id=\"t\"/></bsdf></shape>";
    disk.put("scene/more.xml", &format!("<scene version=\"3.0.0\">{picture}</scene>"));
    disk.put("scene/scene.xml", &xml(&format!("{include}{used}")));
    is_refused(
        disk.read("scene/scene.xml", &[]),
        "a texture that the file itself refers to",
    );
    disk.put(
        "scene/more.xml",
        &format!("<scene version=\"3.0.0\">{}</scene>", ply("out.ply")),
    );
    disk.put(
        "scene/scene.xml",
        &xml(&format!("<path value=\"../beside\"/>{include}")),
    );
    assert_eq!(disk.read("scene/scene.xml", &[]).unwrap().0, ["%2E%2E/beside/out.ply"]);
    disk.put("scene/scene.xml", &xml("<include filename=\"../beside/more.xml\"/>"));
    disk.put(
        "beside/more.xml",
        &format!("<scene version=\"3.0.0\">{}</scene>", ply("in.ply")),
    );
    assert_eq!(disk.read("scene/scene.xml", &[]).unwrap().0, ["in.ply"]);
}

#[cfg(unix)]
#[test]
fn links_count_as_what_they_lead_to() {
    use std::os::unix::fs::symlink;
    let disk = Disk::new();
    symlink("../beside", disk.path("scene/way")).unwrap();
    symlink("in.ply", disk.path("scene/same.ply")).unwrap();
    symlink("scene", disk.path("alias")).unwrap();
    let mesh = |file: &str| format!("{HEAD}[[shapes]]\ntype = \"mesh\"\nfile = {file:?}\n");
    disk.put("scene/scene.toml", &mesh("same.ply"));
    for scene in ["scene/scene.toml", "alias/scene.toml"] {
        assert_eq!(disk.read(scene, &[]).unwrap(), (vec!["same.ply".to_owned()], None));
    }
    disk.put("scene/scene.toml", &mesh("way/out.ply"));
    let error = disk.read("scene/scene.toml", &[]).unwrap_err();
    assert!(error.contains("a link leads out of the scene's folder"), "{error}");
    assert_eq!(disk.read("scene/scene.toml", &["beside"]).unwrap().0, ["way/out.ply"]);
}

/// Whatever a page sends, it stays in the scene's folder, and nothing elsewhere is revealed.
#[test]
fn pages_stay_in_the_folder() {
    let disk = Disk::new();
    let path = disk.path("scene/scene.toml");
    let mesh = |file: &str| format!("{HEAD}[[shapes]]\ntype = \"mesh\"\nfile = {file:?}\n");
    disk.put("scene/scene.toml", &mesh("../beside/out.ply"));
    disk.put("scene/a.gltf", &gltf("../beside/other.bin", "nowhere"));
    disk.put("scene/a.obj", &OBJ.replace("a.mtl", "../secret"));
    let opened = SceneFile::read(&path, &ImportOptions::default()).unwrap();
    let reach = opened.reach.clone();
    let files = Files::from(opened.bundle);
    let edit = |files: &Files, text: &str, reach: &Reach| {
        files.revised(&path, (text, Written::ByPage), &Edits::default(), reach)
    };
    let inside = edit(&files, &mesh("in.ply"), &reach).unwrap();
    assert!(inside.files.contains_key("in.ply"));
    // A file that was in use stays available where it is no longer kept.
    let back = edit(&inside, &mesh("../beside/out.ply"), &reach).unwrap();
    let kept = |files: &Files| files.files["%2E%2E/beside/out.ply"].hash();
    assert_eq!(kept(&back), File::new(PLY.as_bytes()).hash());
    let said = |text: &str| {
        let error = edit(&files, text, &reach).unwrap_err();
        let (_, reason) = error.message.rsplit_once("\": ").unwrap();
        reason.to_owned()
    };
    let secret = disk.path("secret");
    for file in [
        "../secret",
        "../none",
        "none",
        "/etc/passwd",
        "/etc/none",
        "..",
        ".",
        secret.to_str().unwrap(),
    ] {
        assert_eq!(
            said(&mesh(file)),
            "there is no such file in the scene's folder",
            "{file}"
        );
    }
    for text in [
        format!("{HEAD}[[gltf]]\nfile = \"a.gltf\"\n"),
        mesh("a.obj") + "mtl = true\n",
    ] {
        assert_eq!(said(&text), "there is no such file in the scene's folder", "{text}");
    }
}

/// Scenes of the repository that use other folders still work.
#[test]
fn a_scene_elsewhere_may_name_what_lies_here() {
    let disk = Disk::new();
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/meshes");
    let names = fs::read_dir(here).unwrap().map(|entry| entry.unwrap().path());
    let mesh = names
        .into_iter()
        .find(|path| path.extension().is_some_and(|ending| ending == "ply"))
        .unwrap();
    let text = format!(
        "{HEAD}[[shapes]]\ntype = \"mesh\"\nfile = {:?}\n",
        mesh.to_str().unwrap()
    );
    disk.put("scene/scene.toml", &text);
    assert!(disk.read("scene/scene.toml", &[]).unwrap().1.is_some());
}
