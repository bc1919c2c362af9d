//! glTF files: read as pieces of a scene file, which are built as if they stood in it.

use super::{Assets, Parts, Problem, asset_problem};
use crate::assets::gltf::{self, Choice};
use crate::assets::image::Encoding;
use crate::parse::{CameraRecord, Eye, Fault, FovAxis, GltfCameraRecord, GltfRecord, PieceRecord, SceneRecord};
use crate::values::Spanned;
use crate::{source, transform};
use beamfarm_image::bundle::{self, Bundle};
use glam::DAffine3;
use std::path::Path;

/// A file of the bundle by the path that the scene gives, and those beside it.
fn bytes<'b>(bundle: &'b Bundle, path: &Spanned<String>) -> Result<&'b [u8], Fault> {
    let name = path.get_ref();
    let found = bundle.files.get(&bundle::key(name));
    found
        .map(Vec::as_slice)
        .ok_or_else(|| Fault::new(path.span(), format!("the bundle lacks the file \"{name}\"")))
}

fn place(record: &GltfRecord) -> Result<DAffine3, Fault> {
    match &record.transform {
        Some(steps) => transform::compose(steps.get_ref()),
        None => Ok(DAffine3::IDENTITY),
    }
}

impl Parts<'_> {
    /// Add what a glTF file holds.
    pub fn add_gltf(&mut self, record: &GltfRecord) -> Result<(), Problem> {
        let path = &record.file;
        let bundle = self.assets.bundle;
        let beside = |file: &str| {
            let file = gltf::beside(path.get_ref(), file);
            bundle.files.get(&bundle::key(&file)).map(Vec::as_slice)
        };
        let choice = Choice {
            materials: record.materials.unwrap_or(true),
            lights: record.lights.unwrap_or(true),
        };
        let bytes = bytes(bundle, path)?;
        let piece = gltf::read(path.get_ref(), bytes, &beside, &place(record)?, choice)
            .map_err(|flaw| asset_problem(path, flaw))?;
        let text = &piece.text;
        self.assets.add(piece.meshes, piece.images);
        let parsed: PieceRecord = toml::from_str(text).map_err(|e| in_file(path, text, &e.into()))?;
        self.add_piece(&parsed).map_err(|problem| in_piece(path, text, problem))
    }

    fn add_piece(&mut self, piece: &PieceRecord) -> Result<(), Problem> {
        let outer = self.materials.enter(&piece.materials, &mut self.assets)?;
        self.add_lights(&piece.lights)?;
        for (i, shape) in piece.shapes.iter().enumerate() {
            let name = shape.name.clone().unwrap_or_else(|| format!("shapes[{i}]"));
            self.add_shape(shape, &name)?;
        }
        self.materials.leave(outer);
        Ok(())
    }
}

/// A fault of a piece is one of the file that it comes from.
fn in_file(path: &Spanned<String>, text: &str, fault: &Fault) -> Problem {
    let located = source::locate(Path::new(path.get_ref()), text, fault);
    asset_problem(path, located.message)
}

fn in_piece(path: &Spanned<String>, text: &str, problem: Problem) -> Problem {
    match problem {
        Problem::Scene(fault) => in_file(path, text, &fault),
        Problem::Asset { flaw, .. } => asset_problem(path, flaw),
    }
}

impl Assets<'_> {
    /// Files of the bundle's that other files hold.
    fn add(
        &mut self,
        meshes: impl IntoIterator<Item = (String, std::sync::Arc<super::RawMesh>)>,
        images: impl IntoIterator<Item = (String, std::sync::Arc<super::Image>)>,
    ) {
        let key = |name: String| bundle::key(&name);
        let meshes = meshes.into_iter().map(|(name, mesh)| (key(name), mesh));
        self.meshes.extend(meshes);
        let images = images.into_iter();
        let images = images.map(|(name, image)| ((key(name), Encoding::Srgb), image));
        self.images.extend(images);
    }
}

/// Where the scene's camera is: as the scene says, or as a glTF file does.
pub fn eye(scene: &SceneRecord, bundle: &Bundle) -> Result<Eye, Problem> {
    let camera: &CameraRecord = scene.camera.get_ref();
    let Some(path) = &camera.gltf else {
        return Ok(camera.eye(scene.camera.span())?);
    };
    // Where the scene puts the same file.
    let same = |record: &&GltfRecord| record.file.get_ref() == path.get_ref();
    let world_from_file = match scene.gltf.iter().find(same) {
        Some(record) => place(record)?,
        None => DAffine3::IDENTITY,
    };
    let wanted = camera.gltf_camera.as_ref().map(|name| &**name.get_ref());
    let text =
        gltf::camera(bytes(bundle, path)?, wanted, &world_from_file).map_err(|flaw| asset_problem(path, flaw))?;
    let read: GltfCameraRecord = toml::from_str(&text).map_err(|e| in_file(path, &text, &e.into()))?;
    let span = path.span();
    Ok(Eye {
        origin: read.origin,
        target: Spanned::new(span.clone(), read.target),
        up: Some(Spanned::new(span.clone(), read.up)),
        fov: Spanned::new(span, read.fov),
        fov_axis: FovAxis::Y,
    })
}
