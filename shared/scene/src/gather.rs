//! Gathers a native scene file and the files it names.

use crate::assets::{gltf, mesh, mtl};
use crate::disk::text_of;
use crate::error::SceneError;
use crate::parse::{Fault, SceneRecord, Snapshot};
use crate::reach::{Reach, Written};
use crate::source;
use crate::time::When;
use beamfarm_image::bundle::{self, Bundle};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// Who wrote the file names.
#[derive(Clone, Copy)]
pub struct Authors {
    /// Those in the text.
    pub of_text: Written,
    /// Those in the glTF files that the text names.
    pub of_gltf: Written,
}

impl Authors {
    /// The user gave this text.
    pub const USER: Self = Self {
        of_text: Written::ByUser,
        of_gltf: Written::Elsewhere,
    };
    /// The user gave the glTF file that the text names.
    pub const USER_OF_GLTF: Self = Self {
        of_gltf: Written::ByUser,
        ..Self::USER
    };
    /// The text was converted from files of another format; `reach` already knows what the user's file names.
    pub const CONVERTED: Self = Self {
        of_text: Written::Elsewhere,
        of_gltf: Written::Elsewhere,
    };
    /// A web page changed the text.
    pub const PAGE: Self = Self {
        of_text: Written::ByPage,
        of_gltf: Written::ByPage,
    };
}

/// A place that names a file.
pub struct Naming<'a> {
    /// The key of the file in bundles.
    pub key: &'a str,
    /// Where the file is.
    pub path: &'a Path,
    /// The most bytes it may have.
    pub room: u64,
    pub written: Written,
}

/// A bundle of a native scene file and its assets, which are in `folder` within `reach`, or were made. Errors name
/// `path`.
pub fn with_assets(
    (name, bytes): (String, Vec<u8>),
    path: &Path,
    folder: &Path,
    (reach, authors): (&Reach, Authors),
    made: &BTreeMap<String, Vec<u8>>,
) -> Result<Bundle, SceneError> {
    let scene = bundle::key(&name);
    let files = gather(&scene, bytes, path, folder, authors, |naming| {
        let made = made.iter().find(|(name, _)| bundle::key(name) == naming.key);
        let read = || reach.read(naming.path, naming.room, naming.written);
        made.map_or_else(read, |(_, bytes)| Ok(bytes.clone()))
    })?;
    Ok(Bundle { scene, files })
}

/// A native scene file and its assets in `folder`, each as `read` returns it. Errors name `path`.
pub fn gather<B: AsRef<[u8]> + Clone>(
    scene: &str,
    scene_file: B,
    path: &Path,
    folder: &Path,
    authors: Authors,
    read: impl Fn(Naming<'_>) -> Result<B, String>,
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
    let mut put = |files: &mut BTreeMap<String, B>, written: &str, by: Written| {
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
        let naming = Naming {
            key: &key,
            path: &folder.join(written),
            room,
            written: by,
        };
        let file = read(naming).map_err(|reason| format!("the file \"{written}\": {reason}"))?;
        room = room.saturating_sub(file.as_ref().len() as u64);
        files.insert(key, file);
        Ok(())
    };
    let at = |span: Range<usize>| move |reason: String| source::locate(path, text, &Fault::new(span, reason));
    for asset in records().flat_map(SceneRecord::assets) {
        put(&mut files, asset.get_ref(), authors.of_text).map_err(at(asset.span()))?;
    }
    for asset in records().flat_map(SceneRecord::gltf_files) {
        let name = asset.get_ref();
        let named = {
            let bytes = files.get(&bundle::key(name)).map_or(&[][..], AsRef::as_ref);
            gltf::files(bytes).map_err(|flaw| in_asset(folder, name, None, flaw.message))?
        };
        for file in named {
            put(&mut files, &gltf::beside(name, &file), authors.of_gltf).map_err(at(asset.span()))?;
        }
    }
    let of_obj = match authors.of_gltf {
        Written::ByPage => Written::ByPage,
        _ => Written::Elsewhere,
    };
    for asset in records().flat_map(SceneRecord::obj_files) {
        let name = asset.get_ref();
        let bytes_of = |files: &BTreeMap<String, B>, name: &str| files.get(&bundle::key(name)).cloned();
        let libraries = bytes_of(&files, name).map(|bytes| mesh::libraries(bytes.as_ref()));
        for (line, library) in libraries.unwrap_or_default() {
            let library = mtl::beside(name, &library);
            put(&mut files, &library, of_obj).map_err(|reason| in_asset(folder, name, Some(line), reason))?;
            let images = bytes_of(&files, &library).map(|bytes| mtl::files(bytes.as_ref()));
            let images = images.unwrap_or(Ok(Vec::new()));
            let images = images.map_err(|flaw| in_asset(folder, &library, flaw.line, flaw.message))?;
            for (line, image) in images {
                let image = mtl::beside(&library, &image);
                put(&mut files, &image, of_obj).map_err(|reason| in_asset(folder, &library, Some(line), reason))?;
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
