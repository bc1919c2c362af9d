//! Which buffers and images of a glTF file the rendered scene reads.

use super::open::Opened;
use super::packed;
use gltf::{Accessor, Document};
use std::collections::BTreeSet;

/// Numbers of buffers and of images.
#[derive(Debug, Default)]
pub struct Used {
    pub buffers: BTreeSet<usize>,
    pub images: BTreeSet<usize>,
}

impl Used {
    /// Those used by the meshes, skins and materials of the scene's nodes, and by animations.
    pub fn of(opened: &Opened<'_>) -> Self {
        let document = &opened.document;
        let mut used = Self::default();
        let mut materials = BTreeSet::new();
        for node in nodes(document) {
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                let targets = primitive.morph_targets();
                let moved = targets.flat_map(|t| [t.positions(), t.normals(), t.tangents()]);
                let accessors = primitive.attributes().map(|(_, accessor)| accessor);
                let of_draco = packed::draco_of(&primitive);
                let is_plain =
                    |accessor: &Accessor<'_>| of_draco.as_ref().is_none_or(|draco| !draco.has(&primitive, accessor));
                for accessor in accessors
                    .chain(primitive.indices())
                    .filter(is_plain)
                    .chain(moved.flatten())
                {
                    used.accessor(&accessor);
                }
                let view = of_draco.and_then(|draco| document.views().nth(draco.buffer_view));
                used.buffers.extend(view.iter().map(packed::buffer_of));
                materials.extend(primitive.material().index());
            }
            let binds = node.skin().and_then(|skin| skin.inverse_bind_matrices());
            if let Some(accessor) = binds {
                used.accessor(&accessor);
            }
        }
        for channel in document.animations().flat_map(|animation| animation.channels()) {
            used.accessor(&channel.sampler().input());
            used.accessor(&channel.sampler().output());
        }
        let textures: Vec<gltf::Texture<'_>> = document.textures().collect();
        let of_materials = materials.into_iter().filter_map(|i| opened.textures.get(i)).flatten();
        for texture in of_materials.filter_map(|i| textures.get(*i)) {
            let image = texture.source();
            used.images.insert(image.index());
            if let gltf::image::Source::View { view, .. } = image.source() {
                used.buffers.insert(packed::buffer_of(&view));
            }
        }
        used
    }

    fn accessor(&mut self, accessor: &Accessor<'_>) {
        let sparse = accessor.sparse().filter(|sparse| sparse.count() > 0);
        let changes = sparse.iter().flat_map(|s| [s.indices().view(), s.values().view()]);
        let views = accessor.view().into_iter().chain(changes);
        self.buffers.extend(views.map(|view| packed::buffer_of(&view)));
    }
}

/// The nodes of the chosen scene, without validation.
fn nodes(document: &Document) -> Vec<gltf::Node<'_>> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let mut seen = BTreeSet::new();
    let mut waiting: Vec<_> = scene.iter().flat_map(|scene| scene.nodes()).collect();
    let mut nodes = Vec::new();
    while let Some(node) = waiting.pop() {
        if seen.insert(node.index()) {
            waiting.extend(node.children());
            nodes.push(node);
        }
    }
    nodes
}
