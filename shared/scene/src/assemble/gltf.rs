//! glTF files: read as pieces of a scene file, then built as if they stood in it.

use super::kept::{Decoded, Kept, KeptPiece, PlaceBits, map_bits};
use super::{Assets, Moving, Parts, Problem, asset_problem};
use crate::assets::gltf::{self, Choice, LightUnit, There};
use crate::assets::mesh::RawMesh;
use crate::files::Source;
use crate::parse::{
    CameraRecord, Extent, Eye, Fault, FovAxis, GltfCameraRecord, GltfRecord, LightUnitName, PieceRecord, SceneRecord,
};
use crate::values::Spanned;
use crate::{source, transform};
use beamfarm_image::bundle;
use beamfarm_render::world::texture::Image;
use glam::DAffine3;
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

/// The bytes of a file, by the path that the scene gives.
fn bytes<'b>(source: Source<'b>, path: &Spanned<String>) -> Result<&'b [u8], Fault> {
    let name = path.get_ref();
    let found = source.bytes(&bundle::key(name));
    found.ok_or_else(|| Fault::new(path.span(), format!("the bundle lacks the file \"{name}\"")))
}

fn place(record: &GltfRecord) -> Result<DAffine3, Fault> {
    match &record.transform {
        Some(steps) => transform::compose(steps.get_ref()),
        None => Ok(DAffine3::IDENTITY),
    }
}

impl Parts<'_> {
    /// Add the contents of a glTF file.
    pub fn add_gltf(&mut self, record: &GltfRecord) -> Result<(), Problem> {
        let path = &record.file;
        let piece = self.assets.piece(record)?;
        let text = &piece.text;
        self.assets.add(&piece);
        // Spans of the scene file mean nothing within the piece.
        let moving = match (piece.moves && self.assets.seconds.is_some()) || self.moving.has(record.transform.as_ref())
        {
            true => Moving::Everything,
            false => Moving::Places(&[]),
        };
        let outer = std::mem::replace(&mut self.moving, moving);
        let notes = piece.notes.iter();
        self.notes.extend(notes.map(|note| asset_problem(path, note.clone())));
        let parsed: PieceRecord = toml::from_str(text).map_err(|e| in_file(path, text, &e.into()))?;
        let before = self.notes.len();
        self.add_piece(&parsed)
            .map_err(|problem| in_piece(path, text, problem))?;
        self.moving = outer;
        // The spans of these notes are those of the piece.
        let notes = self.notes.split_off(before).into_iter();
        self.notes.extend(notes.map(|note| in_piece(path, text, note)));
        Ok(())
    }

    fn add_piece(&mut self, piece: &PieceRecord) -> Result<(), Problem> {
        let outer = self.materials.enter(&piece.materials, &mut self.assets)?;
        let outer_media = self.media.enter(&piece.media, self.render_origin, &mut self.assets)?;
        self.add_lights(&piece.lights)?;
        for (i, shape) in piece.shapes.iter().enumerate() {
            let name = shape.name.clone().unwrap_or_else(|| format!("shapes[{i}]"));
            self.add_shape(shape, &name)?;
        }
        self.media.leave(outer_media);
        self.materials.leave(outer);
        Ok(())
    }
}

/// A fault in a piece, as a fault of the file that it comes from.
fn in_file(path: &Spanned<String>, text: &str, fault: &Fault) -> Problem {
    let located = source::locate(Path::new(path.get_ref()), text, fault);
    asset_problem(path, located.message)
}

fn in_piece(path: &Spanned<String>, text: &str, problem: Problem) -> Problem {
    match problem {
        Problem::Scene(fault) => in_file(path, text, &fault),
        Problem::NoArea(_) => asset_problem(path, "a mesh has no area"),
        Problem::Asset { flaw, .. } => asset_problem(path, flaw),
    }
}

impl Assets<'_> {
    /// The contents of a glTF file.
    fn piece(&mut self, record: &GltfRecord) -> Result<Arc<KeptPiece>, Problem> {
        let path = &record.file;
        let choice = Choice {
            materials: record.materials.unwrap_or(true),
            lights: record.lights.unwrap_or(true),
            light_unit: record.light_unit.map(|unit| match unit {
                LightUnitName::Watt => LightUnit::Watt,
                LightUnitName::Lumen => LightUnit::Lumen,
            }),
        };
        let source = self.source;
        let bytes = bytes(source, path)?;
        let world_from_file = place(record)?;
        let content = source.content(&bundle::key(path.get_ref()));
        let key = (path.get_ref().clone(), content, choice);
        let Kept { pieces, clock, .. } = &mut *self.kept;
        let is_right = |(_, piece): &(_, Arc<KeptPiece>)| {
            let mut beside = piece.beside.iter();
            beside.all(|(key, content)| source.content(key) == *content)
        };
        let known = pieces.get_if(clock, &key, is_right);
        let moves = match &known {
            Some((_, piece)) => piece.moves,
            None => gltf::is_animated(bytes),
        };
        let seconds = self.seconds.filter(|_| moves);
        let place: PlaceBits = (map_bits(&world_from_file), seconds.map(f64::to_bits));
        if let Some((_, piece)) = known.as_ref().filter(|(known, _)| *known == place) {
            return Ok(piece.clone());
        }
        let read = RefCell::new(Vec::new());
        let beside = |file: &str| {
            let key = bundle::key(&gltf::beside(path.get_ref(), file));
            let bytes = source.bytes(&key);
            read.borrow_mut().push((key.clone(), source.content(&key)));
            bytes
        };
        let there = There {
            world_from_file: &world_from_file,
            seconds,
        };
        let piece = gltf::read(path.get_ref(), bytes, &beside, there, choice);
        let piece = piece.map_err(|flaw| asset_problem(path, flaw))?;
        // The file's contents do not depend on where it is placed; only skins and morph targets depend on the time.
        let known = known.map(|(_, piece)| piece);
        let mesh = |(name, raw): (String, RawMesh)| {
            let known = known.as_ref().and_then(|piece| piece.meshes.get(&name));
            let known = known.filter(|known| known.raw == raw);
            let mesh = known.cloned().unwrap_or_else(|| Arc::new(Decoded::new(raw)));
            (name, mesh)
        };
        let image = |(name, image): (String, Arc<Image>)| {
            let known = known.as_ref().and_then(|piece| piece.images.get(&name));
            let image = known.cloned().unwrap_or(image);
            (name, image)
        };
        let piece = Arc::new(KeptPiece {
            text: piece.text,
            meshes: piece.meshes.into_iter().map(mesh).collect(),
            images: piece.images.into_iter().map(image).collect(),
            notes: piece.notes,
            beside: read.take(),
            moves,
        });
        pieces.put(clock, key, (place, piece.clone()));
        Ok(piece)
    }

    /// Add the meshes and images that the file holds.
    fn add(&mut self, piece: &KeptPiece) {
        let meshes = piece.meshes.iter();
        self.meshes
            .extend(meshes.map(|(name, mesh)| (bundle::key(name), mesh.clone())));
        let images = piece.images.iter();
        self.images
            .extend(images.map(|(name, image)| (bundle::key(name), image.clone())));
    }

    /// Whether the scene's camera comes from a glTF file, whose animation may move it.
    pub fn camera_plays(&self, scene: &SceneRecord) -> bool {
        let file = scene.camera.get_ref().gltf.as_ref();
        self.seconds.is_some() && file.is_some_and(|path| bytes(self.source, path).is_ok_and(gltf::is_animated))
    }

    /// Where the scene's camera is, as given by the scene or by a glTF file.
    pub fn eye(&mut self, scene: &SceneRecord) -> Result<Eye, Problem> {
        let camera: &CameraRecord = scene.camera.get_ref();
        let Some(path) = &camera.gltf else {
            return Ok(camera.eye(scene.camera.span())?);
        };
        // The place that the scene gives the same file.
        let same = |record: &&GltfRecord| record.file.get_ref() == path.get_ref();
        let world_from_file = match scene.gltf.iter().find(same) {
            Some(record) => place(record)?,
            None => DAffine3::IDENTITY,
        };
        let wanted = camera.gltf_camera.as_ref().map(|name| name.get_ref().clone());
        let content = self.source.content(&bundle::key(path.get_ref()));
        let (source, seconds) = (self.source, self.seconds);
        let place = (map_bits(&world_from_file), seconds.map(f64::to_bits));
        let bytes = bytes(source, path)?;
        let Kept { cameras, clock, .. } = &mut *self.kept;
        let text = cameras.get_or(clock, (content, wanted.clone(), place), || {
            let beside = |file: &str| source.bytes(&bundle::key(&gltf::beside(path.get_ref(), file)));
            let there = There {
                world_from_file: &world_from_file,
                seconds,
            };
            gltf::camera(bytes, &beside, wanted.as_deref(), there).map_err(|flaw| asset_problem(path, flaw))
        })?;
        let read: GltfCameraRecord = toml::from_str(&text).map_err(|e| in_file(path, &text, &e.into()))?;
        let span = path.span();
        Ok(Eye {
            origin: read.origin,
            target: Spanned::new(span.clone(), read.target),
            up: Some(Spanned::new(span.clone(), read.up)),
            extent: match (read.fov, read.view_width) {
                (Some(fov), _) => Extent::Angle(Spanned::new(span, fov.0), FovAxis::Y),
                (None, Some(width)) => Extent::Width(Spanned::new(span, width)),
                (None, None) => return Err(Fault::new(span, "the camera has no field of view").into()),
            },
        })
    }
}
