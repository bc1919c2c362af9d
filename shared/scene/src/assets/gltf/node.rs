//! The nodes of a glTF file's scene and their placements.

use super::accessor::Buffers;
use crate::assets::Flaw;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::scene::Transform;

/// A node and its placement.
pub struct Placed<'a> {
    pub node: gltf::Node<'a>,
    /// Its name, or its number if it has none.
    pub name: String,
    pub world_from_node: DAffine3,
    /// Whether neither it nor an ancestor is hidden.
    pub is_shown: bool,
}

/// The nodes of the default scene, or else of the first, or else all nodes; parents come before children.
pub fn placed<'a>(document: &'a gltf::Document, world_from_file: &DAffine3) -> Result<Vec<Placed<'a>>, Flaw> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let mut seen = vec![false; document.nodes().len()];
    let mut waiting: Vec<(gltf::Node<'a>, DAffine3, bool)> = match scene {
        Some(scene) => scene.nodes().map(|node| (node, *world_from_file, true)).collect(),
        None => Vec::new(),
    };
    waiting.reverse();
    let mut placed = Vec::new();
    while let Some((node, world_from_parent, is_shown)) = waiting.pop() {
        let name = match node.name() {
            Some(name) => name.to_string(),
            None => format!("node {}", node.index()),
        };
        // Each node has at most one parent, so that none is visited twice or contains itself.
        if std::mem::replace(&mut seen[node.index()], true) {
            return Err(format!("the node {name:?} is in the scene more than once").into());
        }
        let world_from_node =
            world_from_parent * local(&node.transform()).map_err(|reason| format!("the node {name:?}: {reason}"))?;
        let visibility = node.extension_value("KHR_node_visibility");
        let own = visibility.and_then(|visibility| visibility.get("visible")?.as_bool());
        let is_shown = is_shown && own.unwrap_or(true);
        let first_child = waiting.len();
        waiting.extend(node.children().map(|child| (child, world_from_node, is_shown)));
        waiting[first_child..].reverse();
        placed.push(Placed {
            node,
            name,
            world_from_node,
            is_shown,
        });
    }
    Ok(placed)
}

/// The visible nodes, with nodes of `EXT_mesh_gpu_instancing` once per instance.
pub fn shown<'a>(
    document: &'a gltf::Document,
    placed: Vec<Placed<'a>>,
    buffers: &Buffers<'_>,
) -> Result<Vec<Placed<'a>>, Flaw> {
    let mut shown = Vec::new();
    for place in placed.into_iter().filter(|place| place.is_shown) {
        let in_node = |flaw: Flaw| Flaw::from(format!("the node {:?}: {}", place.name, flaw.message));
        let Some(instances) = instances(document, &place.node, buffers).map_err(in_node)? else {
            shown.push(place);
            continue;
        };
        shown.extend(instances.into_iter().map(|instance| Placed {
            node: place.node.clone(),
            name: place.name.clone(),
            world_from_node: place.world_from_node * instance,
            is_shown: true,
        }));
    }
    Ok(shown)
}

/// Transforms of a node's instances relative to the node; `None` without instances.
fn instances(
    document: &gltf::Document,
    node: &gltf::Node<'_>,
    buffers: &Buffers<'_>,
) -> Result<Option<Vec<DAffine3>>, Flaw> {
    let extension = node.extension_value("EXT_mesh_gpu_instancing");
    let Some(attributes) = extension.and_then(|extension| extension.get("attributes")?.as_object()) else {
        return Ok(None);
    };
    let accessor = |name: &str| match attributes.get(name) {
        None => Ok(None),
        Some(index) => {
            let found = index
                .as_u64()
                .and_then(|i| document.accessors().nth(usize::try_from(i).ok()?));
            let accessor = found.ok_or_else(|| Flaw::from(format!("its instances' {name} is no accessor")))?;
            Ok::<_, Flaw>(Some(accessor))
        }
    };
    let (translations, rotations, scales) = (accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?);
    let counts = [&translations, &rotations, &scales].map(|accessor| accessor.as_ref().map(gltf::Accessor::count));
    let Some(count) = counts.iter().flatten().next().copied() else {
        return Ok(None);
    };
    if counts.iter().flatten().any(|other| *other != count) {
        return Err("its instances have as many translations as rotations and scales".into());
    }
    let vectors = |accessor: Option<gltf::Accessor<'_>>, otherwise: f64, what: &str| match accessor {
        Some(accessor) => buffers.numbers::<3>(&accessor, what),
        None => Ok(vec![[otherwise; 3]; count]),
    };
    let translations = vectors(translations, 0.0, "translations of instances")?;
    let scales = vectors(scales, 1.0, "scales of instances")?;
    let rotations = match rotations {
        Some(accessor) => buffers.numbers::<4>(&accessor, "rotations of instances")?,
        None => vec![[0.0, 0.0, 0.0, 1.0]; count],
    };
    let made = translations
        .into_iter()
        .zip(rotations)
        .zip(scales)
        .map(|((translation, rotation), scale)| {
            let rotation = DQuat::from_array(rotation);
            let length = rotation.length();
            let rotation = if length > 0.0 {
                rotation / length
            } else {
                DQuat::IDENTITY
            };
            DAffine3::from_scale_rotation_translation(scale.into(), rotation, translation.into())
        });
    Ok(Some(made.collect()))
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
