//! A glTF file used as a scene file: the native scene that shows it.

use crate::assets::gltf::{self, Whole};
use crate::disk::read_file;
use crate::error::SceneError;
use crate::gather::{Authors, with_assets};
use crate::paths;
use crate::reach::Reach;
use beamfarm_image::bundle;
use std::collections::BTreeMap;
use std::path::Path;

/// Whether a scene file is glTF, judged by its name.
pub fn is_gltf(path: &Path) -> bool {
    let is = |ending: &std::ffi::OsStr| ["glb", "gltf"].iter().any(|known| ending.eq_ignore_ascii_case(known));
    path.extension().is_some_and(is)
}

/// A scene for `folder` that names the file relative to it.
pub fn scene(path: &Path, folder: &Path, reach: &Reach) -> Result<Whole, SceneError> {
    let wrong = |message: String| SceneError {
        file: path.to_owned(),
        line: None,
        message,
    };
    let bytes = read_file(path, bundle::MAX_BYTES).map_err(wrong)?;
    let way = paths::relative(path, folder);
    let way = way
        .to_str()
        .ok_or_else(|| wrong("the file's path is not UTF-8".into()))?;
    // The files next to it are found as for any scene that names it.
    let quoted = toml::Value::from(way);
    let naming =
        format!("image = {{ width = 1, height = 1 }}\ncamera = {{ gltf = {quoted} }}\n[[gltf]]\nfile = {quoted}\n");
    let naming = ("scene.toml".into(), naming.into_bytes());
    let named = with_assets(naming, path, folder, (reach, Authors::USER_OF_GLTF), &BTreeMap::new());
    let named = named.map_err(|error| wrong(error.message))?;
    let beside = |file: &str| {
        let file = named.files.get(&bundle::key(&gltf::beside(way, file)));
        file.map(Vec::as_slice)
    };
    gltf::scene(way, &bytes, &beside).map_err(|flaw| wrong(flaw.message))
}
