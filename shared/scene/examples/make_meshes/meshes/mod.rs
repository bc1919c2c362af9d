//! The meshes of the example scenes, each from a formula. Lengths in scene units; normals point out of solids.
//!
//! Positions are computed in double precision with functions that are compiled in, and rounded once, so that every
//! machine makes the same files.

mod ball;
mod car;
mod cut;
mod lathe;
mod sea;

use glam::DVec3;

/// A mesh of polygons.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// One unit normal a vertex, or none at all: flat faces.
    pub normals: Vec<DVec3>,
    /// Convex polygons of up to 255 vertices, counter-clockwise seen from outside.
    pub faces: Vec<Vec<u32>>,
}

/// Every mesh and the name of its file.
pub fn all() -> Vec<(&'static str, Mesh)> {
    vec![
        ("bumpy-sphere.ply", ball::bumpy()),
        ("mirror-ball.ply", ball::mirror_ball()),
        ("spot-reflector.ply", lathe::spot_reflector()),
        ("spot-lens.ply", lathe::spot_lens()),
        ("spot-housing.ply", lathe::spot_housing()),
        ("headlight-reflector.ply", lathe::headlight_reflector()),
        ("headlight-glass.ply", lathe::headlight_glass()),
        ("headlight-housing.ply", lathe::headlight_housing()),
        ("goblet.ply", lathe::goblet()),
        ("ring.ply", lathe::ring()),
        ("tyre.ply", lathe::tyre()),
        ("car-body.ply", car::body()),
        ("car-trim.ply", car::trim()),
        ("water.ply", sea::water()),
        ("sand.ply", sea::sand()),
        ("basin.ply", sea::basin()),
        ("fish.ply", sea::fish()),
        ("prism.ply", cut::prism()),
        ("brilliant.ply", cut::brilliant()),
    ]
}

impl Mesh {
    /// Binary little-endian PLY: single-precision positions and normals, polygons as lists of indices.
    pub fn to_ply(&self) -> Vec<u8> {
        let normals = match self.normals.is_empty() {
            true => "",
            false => "property float nx\nproperty float ny\nproperty float nz\n",
        };
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float \
             z\n{normals}element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
            self.positions.len(),
            self.faces.len()
        );
        let mut bytes = header.into_bytes();
        let push = |bytes: &mut Vec<u8>, v: DVec3| {
            for x in v.as_vec3().to_array() {
                bytes.extend(x.to_le_bytes());
            }
        };
        for (i, position) in self.positions.iter().enumerate() {
            push(&mut bytes, *position);
            if let Some(normal) = self.normals.get(i) {
                push(&mut bytes, *normal);
            }
        }
        for face in &self.faces {
            bytes.push(face.len() as u8);
            for index in face {
                bytes.extend(index.to_le_bytes());
            }
        }
        bytes
    }

    /// Add a flat polygon with vertices of its own.
    fn push_polygon(&mut self, corners: &[DVec3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.faces.push((first..first + corners.len() as u32).collect());
    }

    /// Give every vertex the mean of its faces' normals, weighted by area.
    fn smooth(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for face in &self.faces {
            let corners: Vec<DVec3> = face.iter().map(|v| self.positions[*v as usize]).collect();
            let fan = corners[1..].windows(2);
            let normal: DVec3 = fan.map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0])).sum();
            face.iter().for_each(|v| sums[*v as usize] += normal);
        }
        self.normals = sums.into_iter().map(DVec3::normalize).collect();
    }
}
