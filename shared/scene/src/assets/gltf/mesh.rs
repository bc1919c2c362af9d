//! The triangles of a glTF file's primitives, in their rest pose.

use super::accessor::Buffers;
use super::node::Placed;
use crate::assets::Flaw;
use crate::assets::mesh::RawMesh;
use beamfarm_render::math::Rgb;
use glam::{DAffine3, DMat3, DVec2, DVec3, DVec4};
use gltf::Semantic;
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;

/// How a mesh's vertices are moved before the mesh is placed.
#[derive(Default)]
pub struct Pose {
    /// Morph target weights.
    pub weights: Vec<f32>,
    /// A skin's joint transforms, in the file's space.
    pub joints: Option<Vec<DAffine3>>,
}

impl Pose {
    /// The rest pose of a node's mesh. `placed`: all nodes, in the file's space.
    pub fn at_rest(node: &gltf::Node<'_>, placed: &[Placed<'_>], buffers: &Buffers<'_>) -> Result<Self, Flaw> {
        let own = node.weights().or_else(|| node.mesh()?.weights());
        let weights = own.unwrap_or_default().to_vec();
        let Some(skin) = node.skin() else {
            return Ok(Self { weights, joints: None });
        };
        let from_bind: Vec<DAffine3> = match skin.inverse_bind_matrices() {
            None => Vec::new(),
            Some(accessor) => {
                let matrices = buffers.numbers::<16>(&accessor, "inverse bind matrices")?;
                let affine = |m: [f64; 16]| {
                    let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
                    DAffine3::from_cols(column(0), column(1), column(2), column(3))
                };
                matrices.into_iter().map(affine).collect()
            }
        };
        let joints = skin.joints().enumerate().map(|(i, joint)| {
            let found = placed.iter().find(|p| p.node.index() == joint.index());
            let to = found.map_or(DAffine3::IDENTITY, |p| p.world_from_node);
            to * from_bind.get(i).copied().unwrap_or(DAffine3::IDENTITY)
        });
        Ok(Self {
            weights,
            joints: Some(joints.collect()),
        })
    }
}

/// What is read from vertices in addition to positions and normals.
pub struct Taken {
    /// The UV set.
    pub uv_set: u32,
    /// Whether tangents are read, if there are normals.
    pub tangents: bool,
}

/// Positions and normals alone.
pub const PLAIN: Taken = Taken {
    uv_set: 0,
    tangents: false,
};

/// The triangles of a primitive; `None` for points and lines.
pub fn mesh(
    primitive: &gltf::Primitive<'_>,
    buffers: &Buffers<'_>,
    taken: &Taken,
    pose: &Pose,
) -> Result<Option<RawMesh>, Flaw> {
    if !matches!(
        primitive.mode(),
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        return Ok(None);
    }
    let vectors = |vectors: Vec<[f64; 3]>| -> Vec<DVec3> { vectors.into_iter().map(DVec3::from).collect() };
    let positions = buffers.attribute(primitive, &Semantic::Positions, "positions")?;
    let mut raw = RawMesh {
        positions: vectors(positions.ok_or("it has no positions")?),
        ..RawMesh::default()
    };
    let count = raw.positions.len();
    let same_count = |n: usize, what: &str| match n == count {
        true => Ok(()),
        false => Err(Flaw::from(format!("it has {count} positions and {n} {what}"))),
    };
    if let Some(normals) = buffers.attribute(primitive, &Semantic::Normals, "normals")? {
        raw.normals = vectors(normals);
        same_count(raw.normals.len(), "normals")?;
    }
    let uvs = buffers.attribute::<2>(primitive, &Semantic::TexCoords(taken.uv_set), "texture coordinates")?;
    if let Some(uvs) = uvs {
        same_count(uvs.len(), "texture coordinates")?;
        // The renderer's v runs upwards.
        raw.uvs = uvs.into_iter().map(|[u, v]| DVec2::new(u, 1.0 - v)).collect();
    }
    // Tangents without normals are ignored (glTF 2.0, 3.7.2.1).
    if taken.tangents
        && !raw.normals.is_empty()
        && let Some(tangents) = buffers.attribute::<4>(primitive, &Semantic::Tangents, "tangents")?
    {
        same_count(tangents.len(), "tangents")?;
        raw.tangents = tangents.into_iter().map(tangent).collect();
    }
    for (target, weight) in primitive.morph_targets().zip(&pose.weights) {
        if *weight == 0.0 {
            continue;
        }
        let moves = [
            (target.positions(), &mut raw.positions),
            (target.normals(), &mut raw.normals),
        ];
        for (accessor, vectors_there) in moves {
            let Some(accessor) = accessor.filter(|_| !vectors_there.is_empty()) else {
                continue;
            };
            let by = vectors(buffers.numbers(&accessor, "vectors of a morph target")?);
            same_count(by.len(), "vectors of a morph target")?;
            for (at, by) in vectors_there.iter_mut().zip(by) {
                *at += f64::from(*weight) * by;
            }
        }
    }
    for (target, weight) in primitive.morph_targets().zip(&pose.weights) {
        let Some(accessor) = target.tangents().filter(|_| *weight != 0.0 && !raw.tangents.is_empty()) else {
            continue;
        };
        let by = vectors(buffers.numbers(&accessor, "vectors of a morph target")?);
        same_count(by.len(), "vectors of a morph target")?;
        for (at, by) in raw.tangents.iter_mut().zip(by).filter(|(_, by)| by.is_finite()) {
            *at += (f64::from(*weight) * by).extend(0.0);
        }
    }
    if let Some(joints) = &pose.joints {
        skin(&mut raw, primitive, buffers, joints)?;
    }
    if let Some(triangles) = buffers.triangles(primitive)? {
        raw.triangles = triangles;
        return Ok(Some(raw));
    }
    let indices = match primitive.indices() {
        Some(accessor) => buffers.indices(&accessor)?,
        None => (0..u32::try_from(count).map_err(|_| "it has more than 2^32 vertices")?).collect(),
    };
    raw.triangles = match primitive.mode() {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, v)| match i % 2 {
                0 => [v[0], v[1], v[2]],
                _ => [v[0], v[2], v[1]],
            })
            .collect(),
        Mode::TriangleFan => match indices.split_first() {
            Some((center, rim)) => rim.windows(2).map(|v| [v[0], v[1], *center]).collect(),
            None => Vec::new(),
        },
        _ => indices.as_chunks().0.to_vec(),
    };
    Ok(Some(raw))
}

/// A tangent and its handedness; zero if it has no direction.
fn tangent([x, y, z, w]: [f64; 4]) -> DVec4 {
    let along = DVec3::new(x, y, z);
    let along = if along.is_finite() { along } else { DVec3::ZERO };
    along.extend(if w < 0.0 { -1.0 } else { 1.0 })
}

/// Linear vertex colours of a primitive, and whether any is not opaque. `None`: there are none, or all are opaque
/// white.
pub fn colors(primitive: &gltf::Primitive<'_>, buffers: &Buffers<'_>) -> Result<Option<(Vec<Rgb>, bool)>, Flaw> {
    let semantic = Semantic::Colors(0);
    let what = "colours of vertices";
    let has_alpha = primitive
        .get(&semantic)
        .is_some_and(|accessor| accessor.dimensions() == Dimensions::Vec4);
    let colors: Option<Vec<[f64; 4]>> = match has_alpha {
        true => buffers.attribute::<4>(primitive, &semantic, what)?,
        false => {
            let colors = buffers.attribute::<3>(primitive, &semantic, what)?;
            colors.map(|colors| colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
        }
    };
    let Some(colors) = colors else {
        return Ok(None);
    };
    let count = buffers.vertices(primitive)?;
    if colors.len() != count {
        return Err(format!("it has {count} positions and {} {what}", colors.len()).into());
    }
    // Reflectances are at most 1.
    let color = |[r, g, b, _]: &[f64; 4]| Rgb::from_array([r, g, b].map(|x| x.clamp(0.0, 1.0) as f32));
    let is_cut = colors.iter().any(|[.., a]| *a < 1.0);
    let colors: Vec<Rgb> = colors.iter().map(color).collect();
    let matters = is_cut || colors.iter().any(|color| *color != Rgb::ONE);
    Ok(matters.then_some((colors, is_cut)))
}

/// Skin vertices by up to four joints each.
fn skin(
    raw: &mut RawMesh,
    primitive: &gltf::Primitive<'_>,
    buffers: &Buffers<'_>,
    joints: &[DAffine3],
) -> Result<(), Flaw> {
    let (Some(names), Some(weights)) = (
        buffers.attribute::<4>(primitive, &Semantic::Joints(0), "joints")?,
        buffers.attribute::<4>(primitive, &Semantic::Weights(0), "weights")?,
    ) else {
        return Ok(());
    };
    for (what, n) in [("joints", names.len()), ("weights", weights.len())] {
        if n != raw.positions.len() {
            return Err(format!("it has {} positions and {n} {what}", raw.positions.len()).into());
        }
    }
    for (i, (names, weights)) in names.into_iter().zip(weights).enumerate() {
        let sum: f64 = weights.iter().sum();
        if sum.is_nan() || sum <= 0.0 {
            continue;
        }
        let mut linear = DMat3::ZERO;
        let mut offset = DVec3::ZERO;
        for (name, weight) in names.into_iter().zip(weights) {
            let joint = joints.get(name as usize);
            let joint =
                joint.ok_or_else(|| format!("vertex {i} names joint {name}, but there are {}", joints.len()))?;
            linear += joint.matrix3 * (weight / sum);
            offset += joint.translation * (weight / sum);
        }
        raw.positions[i] = linear * raw.positions[i] + offset;
        if let Some(normal) = raw.normals.get_mut(i) {
            *normal = linear * *normal;
        }
        if let Some(tangent) = raw.tangents.get_mut(i) {
            *tangent = (linear * tangent.truncate()).extend(tangent.w);
        }
    }
    Ok(())
}
