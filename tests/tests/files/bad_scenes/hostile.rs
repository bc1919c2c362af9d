//! Malicious scenes and assets: nested without end, claiming what they do not hold, reaching for files.

use super::{VIEW, error_of};
use beamfarm_image::bundle::MAX_KEY_BYTES;
use beamfarm_scene::read_bundle;
use exr::prelude::WritableImage;

/// Deeper than any scene, and than any stack can bear.
const DEEP: usize = 100_000;

#[test]
fn deep_nesting_is_refused() {
    let arrays = "[".repeat(DEEP);
    let closed = format!("{arrays}1{}", "]".repeat(DEEP));
    let tables = "{ a = ".repeat(DEEP);
    let keys = vec!["a"; DEEP].join(".");
    for text in [
        arrays.clone(),
        format!("a = {arrays}"),
        format!("a = {closed}"),
        format!("a = {tables}"),
        format!("a = {tables}1{}", "}".repeat(DEEP)),
        format!("{keys} = 1"),
        format!("[{keys}]"),
        format!("[[{keys}]]"),
        format!("a = {{ {keys} = 1 }}"),
        format!("[[shapes]]\ntype = \"sphere\"\ncenter = {closed}"),
        format!("[[shapes]]\ntype = \"sphere\"\ntransform = [{{ matrix = {closed} }}]"),
        format!("[media.fog]\ntype = \"homogeneous\"\nphase = {{ type = {closed} }}"),
        format!("[materials.{keys}]\ntype = \"diffuse\""),
        // A shape can contain another only as its single inner shape.
        format!("[[shapes]]\n{}", "shape = { type = \"instances\", ".repeat(DEEP)),
        format!("[[shapes]]\n{}.type = \"sphere\"", vec!["shape"; DEEP].join(".")),
    ] {
        let error = error_of(&format!("{VIEW}{text}"), &[]);
        assert!(error.message.len() < 1000, "{} bytes", error.message.len());
    }
    let within = format!("{VIEW}[[shapes]]\n{}.type = \"sphere\"", vec!["shape"; 20].join("."));
    let error = error_of(&within, &[]).to_string();
    assert!(error.contains("missing field `type`"), "{error}");
}

/// A texture outside the scene's folder is found, but its key in the bundle stays inside.
#[test]
fn files_outside_of_the_folder_have_confined_keys() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("scenes");
    for name in ["scenes", "meshes"] {
        std::fs::create_dir(root.path().join(name)).unwrap();
    }
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let absolute = root.path().join("meshes/a.obj");
    for name in ["meshes/a.obj", "scenes/b.obj"] {
        std::fs::write(root.path().join(name), obj).unwrap();
    }
    let shapes: String = ["../meshes/a.obj", "./b.obj", "b.obj", &absolute.to_string_lossy()]
        .iter()
        .map(|file| format!("[[shapes]]\ntype = \"mesh\"\nfile = '{file}'\n"))
        .collect();
    let scene = folder.join("scene.toml");
    std::fs::write(&scene, format!("{VIEW}{shapes}")).unwrap();
    let bundle = read_bundle(&scene).unwrap();
    let rooted = format!("%2F{}", absolute.to_string_lossy());
    let keys: Vec<&str> = bundle.files.keys().map(|key| &**key).collect();
    assert_eq!(keys, ["%2E%2E/meshes/a.obj", &rooted, "b.obj", "scene.toml"]);
    assert_eq!(beamfarm_scene::load(&bundle).unwrap().objects.len(), 4);
}

#[test]
fn paths_that_are_too_long_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    let file = "a".repeat(MAX_KEY_BYTES + 1);
    let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"{file}\"");
    std::fs::write(&scene, text).unwrap();
    let error = read_bundle(&scene).unwrap_err();
    assert_eq!(error.line, Some(5));
    assert!(error.message.ends_with("is longer than 1024 bytes"), "{error}");
}

/// The first line of the mesh's error.
fn mesh_error(name: &str, bytes: impl Into<Vec<u8>>) -> String {
    let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"{name}\"");
    let error = error_of(&text, &[(name, bytes.into())]).to_string();
    assert!(error.len() < 400, "{error}");
    error
}

#[test]
fn indices_of_obj_files_stay_within() {
    for (face, expected) in [
        ("1 2 4", "a.obj:6: the face names vertex 4, but there are 3"),
        ("1 2 0", "a.obj:6: "),
        ("1 2 -4", "a.obj:6: "),
        ("1 2 -9223372036854775808", "a.obj:6: "),
        (
            "1/-2 2/1 3/1",
            "a.obj:6: a face counts back to -2, but there are 1 before it",
        ),
        ("1//-9 2//1 3//1", "a.obj:6: a face counts back to -9"),
        (
            "1 2 9223372036854775807",
            "a.obj:6: the face names vertex 9223372036854775807, but there are 3",
        ),
        ("1 2 99999999999999999999", "a.obj:6: "),
        ("1 2 4294967297", "a.obj:6: the face names vertex 4294967297"),
        ("1/1 2/2 3/1", "a.obj:6: the face names UV 2, but there are 1"),
        ("1//7 2//7 3//7", "a.obj:6: the face names normal 7, but there are 1"),
    ] {
        let error = mesh_error(
            "a.obj",
            format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf {face}\n"),
        );
        assert!(error.starts_with(expected), "{face}: {error}");
    }
}

#[test]
fn ply_files_hold_what_they_claim() {
    let header = |vertices: &str, list: &str, faces: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list {list} vertex_indices\nend_header\n"
        )
        .into_bytes()
    };
    let corners: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let face = |indices: [u32; 3]| -> Vec<u8> {
        let bytes = indices.iter().flat_map(|i| i.to_le_bytes());
        [3].into_iter().chain(bytes).collect()
    };
    let file = |header: Vec<u8>, face: &[u8]| [&header[..], &corners, face].concat();
    for (bytes, expected) in [
        (
            file(header("3", "uchar uint", "1"), &face([0, 1, 3])),
            "a.ply: triangle 0 (from zero) names vertex 3, but there are 3",
        ),
        (
            file(header("3", "uchar uint", "1"), &face([0, 1, u32::MAX])),
            "a.ply: triangle 0 (from zero) names vertex 4294967295",
        ),
        (
            file(header("3", "uchar int", "1"), &face([0, 1, 1 << 31])),
            "a.ply: triangle 0 (from zero) names vertex 4294967295",
        ),
        (
            file(header("3", "uchar uint", "2"), &face([0, 1, 2])),
            "a.ply: Unexpected end of file",
        ),
        (
            file(header("3", "uchar uint", "1000000000000"), &face([0, 1, 2])),
            "a.ply: the file is too short for the 1000000000000 `face` elements it claims",
        ),
        (
            file(header("1000000000000", "uchar uint", "1"), &face([0, 1, 2])),
            "a.ply: the file is too short for the 1000000000000 `vertex` elements it claims",
        ),
        // A list that claims to have 16 GB.
        (file(header("3", "uint uint", "1"), &u32::MAX.to_le_bytes()), "a.ply: "),
        (file(header("3", "int uint", "1"), &i32::MIN.to_le_bytes()), "a.ply: "),
    ] {
        let error = mesh_error("a.ply", bytes);
        assert!(error.starts_with(expected), "{error}");
    }
}

/// Volumes that claim terabytes in a few bytes.
#[test]
fn volumes_hold_what_they_claim() {
    let scene = |file: &str| {
        format!(
            "{VIEW}[media.fog]\ntype = \"heterogeneous\"\nsigma_a = 1\nsigma_s = 1\ndensity = {{ file = \"{file}\" }}"
        )
    };
    let mut vol = b"VOL\x03".to_vec();
    vol.extend(1i32.to_le_bytes());
    vol.extend([65536i32; 3].iter().flat_map(|n| n.to_le_bytes()));
    vol.extend(1i32.to_le_bytes());
    vol.extend([0; 24 + 64]);
    let error = error_of(&scene("a.vol"), &[("a.vol", vol.clone())]).to_string();
    assert!(
        error.starts_with("a.vol: a grid of 65536 x 65536 x 65536 samples takes 1125899906842624 bytes; 64 follow"),
        "{error}"
    );
    vol[8..12].copy_from_slice(&i32::MAX.to_le_bytes());
    let error = error_of(&scene("a.vol"), &[("a.vol", vol)]).to_string();
    assert!(error.contains("expected 1 to 65536 samples"), "{error}");
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/data/volumes");
    let vdb = std::fs::read(format!("{folder}/sparse.vdb")).unwrap();
    for length in [100, vdb.len() / 2, vdb.len() - 1] {
        let error = error_of(&scene("a.vdb"), &[("a.vdb", vdb[..length].to_vec())]);
        assert!(error.to_string().starts_with("a.vdb: "), "{error}");
    }
}

/// Pictures that claim terabytes in a few bytes.
#[test]
fn images_hold_what_they_claim() {
    let texture = |name: &str, bytes: Vec<u8>| {
        let text = format!("{VIEW}[materials.x]\ntype = \"diffuse\"\nreflectance = {{ image = \"{name}\" }}");
        error_of(&text, &[(name, bytes)]).to_string()
    };
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 8, 2, 0, 0, 0]);
    png.extend(crc32(&png[12..]).to_be_bytes());
    png.extend(b"\0\0\0\0IDAT");
    let error = texture("a.png", png);
    assert!(
        error.starts_with("a.png: the image has 2147483647 x 2147483647 pixels; expected 1 to"),
        "{error}"
    );

    let mut exr = Vec::new();
    exr::prelude::Image::from_channels((4, 4), exr::prelude::SpecificChannels::rgb(|_| (1f32, 1f32, 1f32)))
        .write()
        .to_buffered(std::io::Cursor::new(&mut exr))
        .unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = exr.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    for high in [i32::MAX, 1 << 20, 8191] {
        exr[at + 8..at + 12].copy_from_slice(&high.to_le_bytes());
        exr[at + 12..at + 16].copy_from_slice(&high.to_le_bytes());
        let error = texture("a.exr", exr.clone());
        assert!(error.starts_with("a.exr: "), "{error}");
    }
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}
