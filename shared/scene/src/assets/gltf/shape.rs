//! Shapes of a glTF file's nodes: one per primitive of a mesh, or instances where nodes share it.

use super::accessor::Buffers;
use super::material::{Materials, Surface};
use super::mesh::{self, Pose};
use super::node::Placed;
use super::notes::Notes;
use super::write::{matrix, quoted};
use crate::assets::Flaw;
use crate::assets::mesh::RawMesh;
use glam::DAffine3;
use gltf::material::AlphaMode;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The shapes so far, and their sources.
pub struct Shapes<'s, 'a, 'b> {
    pub file: &'s str,
    pub buffers: &'s Buffers<'s>,
    /// `None`: materials are not read.
    pub materials: Option<Materials<'a, 'b>>,
    pub world_from_file: &'s DAffine3,
    /// The nodes in the file's space.
    pub at_rest: Vec<Placed<'a>>,
    pub notes: &'s mut Notes,
    /// As TOML.
    pub text: String,
    pub meshes: BTreeMap<String, RawMesh>,
}

/// Nodes that share a mesh.
struct Users<'p, 'a> {
    mesh: gltf::Mesh<'a>,
    nodes: Vec<&'p Placed<'a>>,
    /// Suffix that distinguishes the mesh's files from those of another pose.
    suffix: String,
    pose: Pose,
}

impl<'a> Shapes<'_, 'a, '_> {
    /// Add the shapes of all nodes.
    pub fn add(&mut self, placed: &[Placed<'a>]) -> Result<(), Flaw> {
        let mut users: BTreeMap<(usize, Option<usize>), Users<'_, 'a>> = BTreeMap::new();
        for node in placed {
            let Some(mesh) = node.node.mesh() else { continue };
            let is_posed = node.node.skin().is_some() || node.node.weights().is_some();
            let own = is_posed.then(|| node.node.index());
            if let Some(known) = users.get_mut(&(mesh.index(), own)) {
                known.nodes.push(node);
                continue;
            }
            let in_node = |flaw: Flaw| format!("the node {:?}: {}", node.name, flaw.message);
            let pose = Pose::at_rest(&node.node, &self.at_rest, self.buffers).map_err(in_node)?;
            users.insert(
                (mesh.index(), own),
                Users {
                    mesh,
                    nodes: vec![node],
                    suffix: own.map_or(String::new(), |node| format!(".node{node}")),
                    pose,
                },
            );
        }
        users.values().try_for_each(|users| self.add_mesh(users))
    }

    fn add_mesh(&mut self, users: &Users<'_, 'a>) -> Result<(), Flaw> {
        let [first, ..] = &users.nodes[..] else { return Ok(()) };
        for primitive in users.mesh.primitives() {
            let in_mesh = |flaw: Flaw| {
                format!(
                    "the node {:?}: primitive {} of its mesh: {}",
                    first.name,
                    primitive.index(),
                    flaw.message
                )
            };
            let colors = match &self.materials {
                None => None,
                Some(_) => mesh::colors(&primitive, self.buffers).map_err(in_mesh)?,
            };
            let surface = match &mut self.materials {
                None => None,
                Some(materials) => {
                    Some(materials.surface(primitive.material().index(), colors.is_some(), self.notes)?)
                }
            };
            let taken = surface.as_ref().map_or(mesh::PLAIN, |surface| mesh::Taken {
                uv_set: surface.uv_set,
                tangents: surface.has_directions,
            });
            let raw = mesh::mesh(&primitive, self.buffers, &taken, &users.pose).map_err(in_mesh)?;
            let Some(mut raw) = raw else {
                self.notes
                    .add_of("points and lines are left out: of nodes", &format!("{:?}", first.name));
                continue;
            };
            if let Some((colors, is_cut)) = colors {
                raw.colors = colors;
                if is_cut && primitive.material().alpha_mode() != AlphaMode::Opaque {
                    self.notes.add_of(
                        "the opacity of colours of vertices does not count: of nodes",
                        &format!("{:?}", first.name),
                    );
                }
            }
            let raw = raw.checked().map_err(in_mesh)?;
            self.add_primitive(users, &primitive, raw, surface.as_ref());
        }
        Ok(())
    }

    fn add_primitive(
        &mut self,
        users: &Users<'_, 'a>,
        primitive: &gltf::Primitive<'a>,
        raw: RawMesh,
        surface: Option<&Surface>,
    ) {
        let file = format!(
            "{}:mesh{}.{}{}",
            self.file,
            users.mesh.index(),
            primitive.index(),
            users.suffix
        );
        let mut fields = vec!["type = \"mesh\"".to_string(), format!("file = {}", quoted(&file))];
        let mut emits = false;
        if let Some(surface) = surface {
            fields.push(format!("material = \"{}\"", surface.id));
            fields.extend(self.inside(&raw, surface));
            if let Some(radiance) = &surface.emission {
                emits = true;
                // Light on the inner side of a closed mesh would stay there.
                let sides = match surface.emits_on_both && raw.solid().is_err() {
                    true => ", two_sided = true",
                    false => "",
                };
                fields.push(format!("emission = {{ radiance = {radiance}{sides} }}"));
                if surface.is_unlit {
                    fields.push("visible = [\"camera\", \"reflected\", \"refracted\"]".to_string());
                }
            }
        }
        self.meshes.insert(file, raw);
        let several = users.mesh.primitives().len() > 1;
        let name = |node: &Placed<'_>| match several {
            true => quoted(&format!("{} ({})", node.name, primitive.index())),
            false => quoted(&node.name),
        };
        // A skinned mesh is placed by its joints, not by its node.
        let place = |node: &Placed<'_>| match users.pose.joints {
            Some(_) => matrix(self.world_from_file),
            None => matrix(&node.world_from_node),
        };
        let text = &mut self.text;
        match &users.nodes[..] {
            [first, _, ..] if !emits => {
                let _ = writeln!(
                    text,
                    "[[shapes]]\nname = {}\ntype = \"instances\"\nshape = {{ {} }}\ntransforms = [",
                    name(first),
                    fields.join(", ")
                );
                for node in &users.nodes {
                    let _ = writeln!(text, "  [{}],", place(node));
                }
                text.push_str("]\n");
            }
            nodes => {
                for node in nodes {
                    let _ = writeln!(
                        text,
                        "[[shapes]]\nname = {}\n{}\ntransform = [{}]",
                        name(node),
                        fields.join("\n"),
                        place(node),
                    );
                }
            }
        }
    }

    /// The medium inside glass.
    fn inside(&mut self, raw: &RawMesh, surface: &Surface) -> Option<String> {
        if !surface.is_glass {
            return None;
        }
        match (raw.solid(), &surface.interior) {
            (Ok(_), Some(medium)) => Some(format!("interior = \"{medium}\"")),
            (Ok(_), None) => None,
            (Err(_), interior) => {
                if interior.is_some() {
                    self.notes.add_of(
                        "the attenuation of KHR_materials_volume is left out where a mesh is not closed: materials",
                        &surface.name,
                    );
                }
                Some("boundary = false".to_string())
            }
        }
    }
}
