//! Recognises files of other programs given as scene files.

use std::path::Path;

/// What a file that is not a scene is, judged by its name, and what to do.
pub fn refusal(path: &Path) -> Option<String> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    let name = path.file_name()?.to_string_lossy();
    let convert = "convert it to glTF (.glb), for example in Blender";
    Some(match ending.as_str() {
        "obj" | "ply" | "serialized" => format!(
            "a mesh is no scene; write a scene file (.toml) with a camera, a light and the lines [[shapes]], \
             type = \"mesh\", file = \"{name}\", or {convert}"
        ),
        "blend" => {
            "Blender's files are not read; export the scene with Beamfarm's add-on for Blender, or as glTF (.glb)"
                .into()
        }
        "usd" | "usda" | "usdc" | "usdz" => format!("USD is not read; {convert}"),
        "fbx" => format!("FBX is not read; {convert}"),
        "abc" => format!("Alembic is not read; {convert}"),
        "dae" => format!("Collada is not read; {convert}"),
        "stl" => format!("STL is not read; {convert}"),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use crate::{ImportOptions, SceneFile, errors, frames};

    #[test]
    fn files_of_other_programs_are_no_scenes() {
        let folder = tempfile::tempdir().unwrap();
        for (name, words) in [
            ("a.obj", "file = \"a.obj\", or convert it to glTF"),
            ("a.PLY", "a mesh is no scene"),
            ("a.usd", "USD is not read; convert it to glTF (.glb)"),
            ("a.usda", "USD is not read"),
            ("a.usdc", "USD is not read"),
            ("a.usdz", "USD is not read"),
            ("a.blend", "add-on for Blender, or as glTF"),
            ("a.fbx", "FBX is not read; convert"),
            ("a.abc", "Alembic is not read; convert"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, "v 0 0 0\n").unwrap();
            let options = ImportOptions::default();
            let error = SceneFile::read(&path, &options).unwrap_err();
            assert_eq!((error.line, &error.file), (None, &path));
            assert!(error.message.contains(words), "{error}");
            assert!(frames(&path, &options).unwrap_err().message.contains(words));
            // It has no other errors.
            assert!(errors(&path, &options).is_empty());
        }
    }
}
