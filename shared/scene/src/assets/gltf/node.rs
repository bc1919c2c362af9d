//! The nodes of a glTF file's scene, each with its place.

use crate::assets::Flaw;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::scene::Transform;

/// A node and where it is.
pub struct Placed<'a> {
    pub node: gltf::Node<'a>,
    /// Its name, or its number.
    pub name: String,
    pub world_from_node: DAffine3,
}

/// The nodes of the default scene, or else the first, or else all, parents before their children.
pub fn placed<'a>(document: &'a gltf::Document, world_from_file: &DAffine3) -> Result<Vec<Placed<'a>>, Flaw> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let mut seen = vec![false; document.nodes().len()];
    let mut waiting: Vec<(gltf::Node<'a>, DAffine3)> = match scene {
        Some(scene) => scene.nodes().map(|node| (node, *world_from_file)).collect(),
        None => Vec::new(),
    };
    waiting.reverse();
    let mut placed = Vec::new();
    while let Some((node, world_from_parent)) = waiting.pop() {
        let name = match node.name() {
            Some(name) => name.to_string(),
            None => format!("node {}", node.index()),
        };
        // Each node has one parent at most, so none is met twice, and none is below itself.
        if std::mem::replace(&mut seen[node.index()], true) {
            return Err(format!("the node {name:?} is in the scene more than once").into());
        }
        let world_from_node =
            world_from_parent * local(&node.transform()).map_err(|reason| format!("the node {name:?}: {reason}"))?;
        let first_child = waiting.len();
        waiting.extend(node.children().map(|child| (child, world_from_node)));
        waiting[first_child..].reverse();
        placed.push(Placed {
            node,
            name,
            world_from_node,
        });
    }
    Ok(placed)
}

fn local(transform: &Transform) -> Result<DAffine3, &'static str> {
    match transform {
        Transform::Matrix { matrix } => {
            let [x, y, z, w] = matrix.map(|column| column.map(f64::from));
            if [x[3], y[3], z[3], w[3]] != [0.0, 0.0, 0.0, 1.0] {
                return Err("its matrix is not affine");
            }
            let column = |c: [f64; 4]| DVec3::new(c[0], c[1], c[2]);
            Ok(DAffine3::from_cols(column(x), column(y), column(z), column(w)))
        }
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            let length = rotation.length();
            if !(length > 0.0 && length.is_finite()) {
                return Err("its rotation is no quaternion of length 1");
            }
            let vector = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
            let rotation = DMat3::from_quat(rotation / length);
            Ok(DAffine3::from_mat3_translation(
                rotation * DMat3::from_diagonal(vector(scale)),
                vector(translation),
            ))
        }
    }
}
