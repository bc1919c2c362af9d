//! The meshes of the example scenes, each from a formula. Lengths in scene units; normals point out of solids.
//!
//! Positions are computed in double precision with functions that are compiled in, and rounded once, so that every
//! machine makes the same files.

mod ball;
mod car;
mod chandelier;
mod cloth;
mod cut;
mod hand;
mod house;
mod land;
mod lathe;
mod loft;
mod sea;
mod table;

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
        ("fresnel-lens.ply", lathe::fresnel_lens()),
        ("lighthouse.ply", lathe::lighthouse()),
        ("lantern-roof.ply", lathe::lantern_roof()),
        ("goblet.ply", lathe::goblet()),
        ("ring.ply", lathe::ring()),
        ("tyre.ply", lathe::tyre()),
        ("car-body.ply", car::body()),
        ("car-panes.ply", car::panes()),
        ("car-chrome.ply", car::chrome()),
        ("headlight-pod.ply", lathe::headlight_pod()),
        ("tree.ply", land::bare()),
        ("fir.ply", land::fir()),
        ("window.ply", house::window()),
        ("lamp-post.ply", lathe::lamp_post()),
        ("stool.ply", lathe::stool()),
        ("speaker.ply", lathe::speaker()),
        ("bottle.ply", lathe::bottle()),
        ("candle.ply", lathe::candle()),
        ("bishop.ply", lathe::bishop()),
        ("hills.ply", land::hills()),
        ("curtain.ply", cloth::curtain()),
        ("pillow.ply", cloth::pillow()),
        ("quilt.ply", cloth::quilt()),
        ("table-cloth.ply", cloth::table_cloth()),
        ("cut-glass.ply", table::cut_glass()),
        ("cut-glass-wine.ply", table::wine()),
        ("cut-glass-wine-top.ply", table::wine_top()),
        ("decanter.ply", table::decanter()),
        ("prism-bar.ply", table::prism_bar()),
        ("water.ply", sea::water()),
        ("sand.ply", sea::sand()),
        ("basin.ply", sea::basin()),
        ("fish.ply", sea::fish()),
        ("prism.ply", cut::prism()),
        ("prism-ground.ply", cut::prism_ground()),
        ("brilliant.ply", cut::brilliant()),
        ("emerald-cut.ply", cut::emerald_cut()),
        ("crystal-drop.ply", cut::drop()),
        ("chandelier.ply", chandelier::frame()),
        ("hand.ply", hand::hand()),
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

    /// Put another mesh of the same kind beside this one.
    fn append(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        let moved = |face: Vec<u32>| face.into_iter().map(|v| v + first).collect();
        self.faces.extend(other.faces.into_iter().map(moved));
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

/// A box between two corners, its edges cut off at `cut`.
fn push_box(mesh: &mut Mesh, from: [f64; 3], to: [f64; 3], cut: f64) {
    let (a, b) = (DVec3::from(from), DVec3::from(to));
    let (center, half) = (0.5 * (a + b), 0.5 * (a - b).abs());
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    // The corner of the face across `axis`, on the sides that `signs` gives.
    let corner = |signs: [f64; 3], axis: usize| {
        let mut offset = DVec3::ZERO;
        for i in 0..3 {
            let inset = if i == axis { 0.0 } else { cut };
            offset += axes[i] * (signs[i] * (half[i] - inset));
        }
        center + offset
    };
    let mut push = |corners: &[DVec3]| {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let mut corners = corners.to_vec();
        if normal.dot(corners[0] - center) < 0.0 {
            corners.reverse();
        }
        mesh.push_polygon(&corners);
    };
    let signs = |axis: usize, own: f64, next: f64, last: f64| {
        let mut signs = [0.0; 3];
        signs[axis] = own;
        signs[(axis + 1) % 3] = next;
        signs[(axis + 2) % 3] = last;
        signs
    };
    for axis in 0..3 {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        for own in [-1.0, 1.0] {
            push(
                &[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(n, l)| corner(signs(axis, own, n, l), axis)),
            );
            // The edges along `axis`, between the faces across the two others.
            for other in [-1.0, 1.0] {
                let along = |end: f64| signs(axis, end, own, other);
                push(&[
                    corner(along(-1.0), next),
                    corner(along(1.0), next),
                    corner(along(1.0), last),
                    corner(along(-1.0), last),
                ]);
            }
        }
    }
    for i in 0..8 {
        let signs = [1, 2, 4].map(|bit| if i & bit == 0 { -1.0 } else { 1.0 });
        push(&[0, 1, 2].map(|axis| corner(signs, axis)));
    }
}
