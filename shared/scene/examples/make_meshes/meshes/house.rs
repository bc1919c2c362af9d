//! Parts of houses.

use super::Mesh;

/// Frame of a sash window of width 1.1 and height 1.7, standing on y = 0, its wall at z = 0 and facing +z: a sill, a
/// lintel, posts and bars. The pane, at z = 0.02, is left out.
pub fn window() -> Mesh {
    let mut mesh = Mesh::default();
    let mut part = |from: [f64; 3], to: [f64; 3]| super::push_box(&mut mesh, from, to, 0.008);
    part([-0.70, -0.12, -0.05], [0.70, 0.0, 0.20]);
    part([-0.66, 1.70, -0.05], [0.66, 1.92, 0.12]);
    part([-0.74, 1.92, -0.05], [0.74, 1.98, 0.20]);
    for side in [-1.0, 1.0] {
        part([0.55 * side, 0.0, -0.05], [0.66 * side, 1.70, 0.10]);
    }
    part([-0.03, 0.0, -0.05], [0.03, 1.70, 0.05]);
    part([-0.55, 0.95, -0.05], [0.55, 1.02, 0.06]);
    mesh
}
