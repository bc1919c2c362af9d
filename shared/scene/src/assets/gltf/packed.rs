//! Packed data of a glTF file: buffer views packed by meshopt, primitives by Draco. Unpacked fallbacks are not read.

use crate::assets::Flaw;
use beamfarm_assets::draco;
use beamfarm_assets::meshopt::{self, Filter, Layout, Mode};
use gltf::buffer::View;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const DRACO: &str = "KHR_draco_mesh_compression";

/// A view's description of its packed bytes.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PackedView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    filter: Option<String>,
}

/// A primitive's description of its packed mesh.
#[derive(Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PackedPrimitive {
    pub buffer_view: usize,
    /// Draco's ids of the attributes.
    attributes: BTreeMap<String, u32>,
}

impl PackedPrimitive {
    /// Whether the mesh holds an accessor's data.
    pub fn has(&self, primitive: &gltf::Primitive<'_>, accessor: &gltf::Accessor<'_>) -> bool {
        let is_indices = primitive.indices().is_some_and(|i| i.index() == accessor.index());
        let mut attributes = primitive.attributes();
        is_indices
            || attributes.any(|(semantic, a)| {
                a.index() == accessor.index() && self.attributes.contains_key(&semantic.to_string())
            })
    }
}

/// How Draco packed a primitive, if it did.
pub fn draco_of(primitive: &gltf::Primitive<'_>) -> Option<PackedPrimitive> {
    let extension = primitive.extension_value(DRACO)?;
    PackedPrimitive::deserialize(extension).ok()
}

fn meshopt_of<'v>(view: &'v View<'_>) -> Option<&'v serde_json::Value> {
    MESHOPT.iter().find_map(|name| view.extension_value(name))
}

/// The buffer with a view's bytes.
pub fn buffer_of(view: &View<'_>) -> usize {
    let packed = meshopt_of(view).and_then(|extension| extension.get("buffer")?.as_u64());
    let packed = packed.and_then(|index| usize::try_from(index).ok());
    packed.unwrap_or(view.buffer().index())
}

/// Whether a buffer has no bytes of its own because its views are packed.
pub fn is_placeholder(buffer: &gltf::Buffer<'_>) -> bool {
    let is_bare = matches!(buffer.source(), gltf::buffer::Source::Bin) && buffer.index() > 0;
    is_bare || MESHOPT.iter().any(|name| buffer.extension_value(name).is_some())
}

/// Where a view's bytes are.
pub struct Place {
    pub view: usize,
    pub buffer: usize,
    pub offset: usize,
    pub length: usize,
}

impl Place {
    /// The place that the view itself gives.
    pub fn of(view: &View<'_>) -> Self {
        Self {
            view: view.index(),
            buffer: view.buffer().index(),
            offset: view.offset(),
            length: view.length(),
        }
    }
}

type Once<T> = OnceLock<Result<T, String>>;

/// Packed data, unpacked on first use.
#[derive(Default)]
pub struct Packed {
    views: BTreeMap<usize, Once<Vec<u8>>>,
    /// Meshes by the view they are stored in.
    meshes: BTreeMap<usize, (Place, Once<draco::Mesh>)>,
}

/// An attribute of a Draco mesh.
pub struct PackedAttribute<'p> {
    pub attribute: &'p draco::Attribute,
    pub points: usize,
}

impl Packed {
    pub fn of(document: &gltf::Document) -> Self {
        let mut packed = Self::default();
        for view in document.views().filter(|view| meshopt_of(view).is_some()) {
            packed.views.insert(view.index(), OnceLock::new());
        }
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives()) {
            let Some(draco) = draco_of(&primitive) else { continue };
            if let Some(view) = document.views().nth(draco.buffer_view) {
                let mesh = || (Place::of(&view), OnceLock::new());
                packed.meshes.entry(draco.buffer_view).or_insert_with(mesh);
            }
        }
        packed
    }

    /// The bytes of a packed view; `None` if it is not packed. `stored`: bytes as stored in a buffer.
    pub fn view<'b>(
        &self,
        view: &View<'_>,
        stored: impl Fn(&Place) -> Result<&'b [u8], String>,
    ) -> Option<Result<&[u8], String>> {
        let slot = self.views.get(&view.index())?;
        let unpacked = slot.get_or_init(|| {
            let in_view = |reason: String| format!("buffer view {}, packed by meshopt: {reason}", view.index());
            let extension = meshopt_of(view).unwrap_or(&serde_json::Value::Null);
            let said = PackedView::deserialize(extension).map_err(|e| in_view(e.to_string()))?;
            let bytes = stored(&Place {
                view: view.index(),
                buffer: said.buffer,
                offset: said.byte_offset,
                length: said.byte_length,
            })?;
            let layout = said.layout().map_err(in_view)?;
            meshopt::decode(bytes, &layout).map_err(|flaw| in_view(flaw.message))
        });
        Some(unpacked.as_deref().map_err(Clone::clone))
    }

    /// The mesh in a view.
    fn mesh<'b>(&self, view: usize, stored: impl Fn(&Place) -> Result<&'b [u8], String>) -> Result<&draco::Mesh, Flaw> {
        let mesh = self.meshes.get(&view);
        let (place, slot) =
            mesh.ok_or_else(|| format!("its mesh by Draco is in buffer view {view}, which is not there"))?;
        let unpacked = slot.get_or_init(|| draco::decode(stored(place)?).map_err(|flaw| flaw.message));
        unpacked.as_ref().map_err(|reason| reason.clone().into())
    }

    /// The mesh of a Draco primitive. `stored`: bytes as stored in a buffer.
    pub fn of_primitive<'b>(
        &self,
        primitive: &gltf::Primitive<'_>,
        stored: impl Fn(&Place) -> Result<&'b [u8], String>,
    ) -> Result<Option<&draco::Mesh>, Flaw> {
        draco_of(primitive)
            .map(|draco| self.mesh(draco.buffer_view, stored))
            .transpose()
    }

    /// An attribute of a Draco primitive. It is found by primitive, not by accessor: the accessor only describes it,
    /// and several attributes may name the same one.
    pub fn of_attribute<'b>(
        &self,
        primitive: &gltf::Primitive<'_>,
        semantic: &gltf::Semantic,
        stored: impl Fn(&Place) -> Result<&'b [u8], String>,
    ) -> Result<Option<PackedAttribute<'_>>, Flaw> {
        let Some(draco) = draco_of(primitive) else {
            return Ok(None);
        };
        let Some(&id) = draco.attributes.get(&semantic.to_string()) else {
            return Ok(None);
        };
        let view = draco.buffer_view;
        let mesh = self.mesh(view, stored)?;
        let attribute = mesh.attributes.get(&id);
        let attribute = attribute.ok_or_else(|| {
            format!("the mesh of Draco in buffer view {view} has no attribute {id} of numbers that glTF has")
        })?;
        let points = mesh.points;
        Ok(Some(PackedAttribute { attribute, points }))
    }
}

impl PackedView {
    fn layout(&self) -> Result<Layout, String> {
        let mode = match &self.mode[..] {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            "INDICES" => Mode::Indices,
            mode => {
                return Err(format!(
                    "it has the mode {mode:?}; expected ATTRIBUTES, TRIANGLES or INDICES"
                ));
            }
        };
        let filter = match self.filter.as_deref() {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some("COLOR") => Filter::Color,
            Some(filter) => return Err(format!("it has the filter {filter:?}, which is not known")),
        };
        Ok(Layout {
            mode,
            filter,
            count: self.count,
            stride: self.byte_stride,
        })
    }
}
