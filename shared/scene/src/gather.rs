//! A native scene file with the files that it names.

use crate::assets::{gltf, mesh, mtl};
use crate::disk::{read_file, text_of};
use crate::error::SceneError;
use crate::parse::{Fault, SceneRecord, Snapshot};
use crate::source;
use crate::time::When;
use beamfarm_image::bundle::{self, Bundle};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// A bundle of a native scene file and its assets, which lie in `folder` unless they were made. Errors name `path`.
pub fn with_assets(
    name: String,
    bytes: Vec<u8>,
    path: &Path,
    folder: &Path,
    made: &BTreeMap<String, Vec<u8>>,
) -> Result<Bundle, SceneError> {
    let scene = bundle::key(&name);
    let files = gather(&scene, bytes, path, folder, |key, path, room| {
        let made = made.iter().find(|(name, _)| bundle::key(name) == key);
        made.map_or_else(|| read_file(path, room), |(_, bytes)| Ok(bytes.clone()))
    })?;
    Ok(Bundle { scene, files })
}

/// A native scene file and its assets, which lie in `folder`, each as `read` gives it by its key, its path and the most
/// bytes that it may have. Errors name `path`.
pub fn gather<B: AsRef<[u8]> + Clone>(
    scene: &str,
    scene_file: B,
    path: &Path,
    folder: &Path,
    read: impl Fn(&str, &Path, u64) -> Result<B, String>,
) -> Result<BTreeMap<String, B>, SceneError> {
    let text = text_of(path, scene_file.as_ref())?;
    let located = |fault: Fault| source::locate(path, text, &fault);
    let middle = SceneRecord::snapshot(text, When::Middle).map_err(located)?;
    let others = match middle.blurs {
        true => middle.times_of_files.as_slice(),
        false => &[],
    };
    let others = others.iter().map(|time| SceneRecord::snapshot(text, When::At(*time)));
    let others: Vec<Snapshot> = others.collect::<Result<_, _>>().map_err(located)?;
    let records = || [&middle].into_iter().chain(&others).map(|snapshot| &snapshot.record);
    let mut room = bundle::MAX_BYTES.saturating_sub(text.len() as u64);
    let mut files = BTreeMap::from([(scene.to_owned(), scene_file.clone())]);
    let mut put = |files: &mut BTreeMap<String, B>, written: &str| {
        let key = bundle::key(written);
        if files.contains_key(&key) {
            return Ok(());
        }
        bundle::check_key(&key)?;
        if files.len() == bundle::MAX_FILES {
            return Err(format!(
                "the scene names more files than the {} that it may have",
                bundle::MAX_FILES
            ));
        }
        let file =
            read(&key, &folder.join(written), room).map_err(|reason| format!("the file \"{written}\": {reason}"))?;
        room = room.saturating_sub(file.as_ref().len() as u64);
        files.insert(key, file);
        Ok(())
    };
    let at = |span: Range<usize>| move |reason: String| source::locate(path, text, &Fault::new(span, reason));
    for asset in records().flat_map(SceneRecord::assets) {
        put(&mut files, asset.get_ref()).map_err(at(asset.span()))?;
    }
    for asset in records().flat_map(SceneRecord::gltf_files) {
        let name = asset.get_ref();
        let named = {
            let bytes = files.get(&bundle::key(name)).map_or(&[][..], AsRef::as_ref);
            gltf::files(bytes).map_err(|flaw| in_asset(folder, name, None, flaw.message))?
        };
        for file in named {
            put(&mut files, &gltf::beside(name, &file)).map_err(at(asset.span()))?;
        }
    }
    for asset in records().flat_map(SceneRecord::obj_files) {
        let name = asset.get_ref();
        let bytes_of = |files: &BTreeMap<String, B>, name: &str| files.get(&bundle::key(name)).cloned();
        let libraries = bytes_of(&files, name).map(|bytes| mesh::libraries(bytes.as_ref()));
        for (line, library) in libraries.unwrap_or_default() {
            let library = mtl::beside(name, &library);
            put(&mut files, &library).map_err(|reason| in_asset(folder, name, Some(line), reason))?;
            let images = bytes_of(&files, &library).map(|bytes| mtl::files(bytes.as_ref()));
            let images = images.unwrap_or(Ok(Vec::new()));
            let images = images.map_err(|flaw| in_asset(folder, &library, flaw.line, flaw.message))?;
            for (line, image) in images {
                let image = mtl::beside(&library, &image);
                put(&mut files, &image).map_err(|reason| in_asset(folder, &library, Some(line), reason))?;
            }
        }
    }
    Ok(files)
}

fn in_asset(folder: &Path, name: &str, line: Option<usize>, message: String) -> SceneError {
    SceneError {
        file: folder.join(name),
        line,
        message,
    }
}
