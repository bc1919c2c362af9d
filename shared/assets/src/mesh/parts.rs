//! Splits a mesh by material.

use super::RawMesh;
use std::collections::HashMap;

/// A vertex that the part does not have yet.
const NONE: u32 = u32::MAX;

impl RawMesh {
    /// A mesh per material that the file names, in file order, each with only the vertices it needs. `None`: triangles
    /// without a material.
    pub fn by_material(&self) -> Vec<(Option<&str>, Self)> {
        let mut parts: Vec<(Option<&str>, Self)> = Vec::new();
        let mut known = HashMap::new();
        let unnamed = (0, None);
        let named = self.materials.iter().map(|(first, name)| (*first, Some(name.as_str())));
        let begins: Vec<(usize, Option<&str>)> = std::iter::once(unnamed).chain(named).collect();
        for (i, (first, name)) in begins.iter().enumerate() {
            let end = begins.get(i + 1).map_or(self.triangles.len(), |next| next.0);
            let Some(triangles @ [_, ..]) = self.triangles.get(*first..end) else {
                continue;
            };
            let part = *known.entry(*name).or_insert_with(|| {
                parts.push((*name, Self::default()));
                parts.len() - 1
            });
            parts[part].1.triangles.extend_from_slice(triangles);
        }
        let mut numbers = vec![NONE; self.positions.len()];
        for (_, part) in &mut parts {
            let mut own = Vec::new();
            for v in part.triangles.as_flattened_mut() {
                let number = &mut numbers[*v as usize];
                if *number == NONE {
                    *number = own.len() as u32;
                    own.push(*v as usize);
                }
                *v = *number;
            }
            own.iter().for_each(|v| numbers[*v] = NONE);
            part.positions = own.iter().map(|v| self.positions[*v]).collect();
            part.normals = own.iter().filter_map(|v| self.normals.get(*v).copied()).collect();
            part.uvs = own.iter().filter_map(|v| self.uvs.get(*v).copied()).collect();
            part.colors = own.iter().filter_map(|v| self.colors.get(*v).copied()).collect();
            part.tangents = own.iter().filter_map(|v| self.tangents.get(*v).copied()).collect();
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DVec2, DVec3};

    #[test]
    fn parts_have_their_triangles_and_vertices() {
        let text = "mtllib a b.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1\n\
            usemtl red\nusemtl dark green\nf 1/1/1 3/1/1 4/2/1\nusemtl red\nf 2/2/1 3/1/1 4/1/1\n\
            usemtl dark green\nf 1/1/1 2/2/1 3/1/1 4/2/1\nusemtl blue\n";
        let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
        let parts = mesh.by_material();
        let found: Vec<_> = parts.iter().map(|(name, part)| (*name, part.triangles.len())).collect();
        assert_eq!(found, [(None, 1), (Some("dark green"), 3), (Some("red"), 1)]);
        let green = &parts[1].1;
        assert_eq!(green.area(&DAffine3::IDENTITY), 1.5);
        assert_eq!(green.positions[..3], [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        assert_eq!(green.uvs[2], DVec2::X);
        assert_eq!(green.normals, vec![DVec3::Z; green.positions.len()]);
        assert_eq!(parts[2].1.positions.len(), 3);
        // A mesh without material names stays whole.
        let plain = RawMesh::rectangle();
        let whole = plain.by_material();
        assert!(whole.len() == 1 && whole[0].0.is_none() && whole[0].1 == plain);
    }

    #[test]
    fn libraries_are_named_with_their_lines() {
        let text = b"# a\nmtllib one.mtl\r\n  mtllib a b.mtl c.MTL \nv 0 0 0\nmtllib\n# mtllib no.mtl\nmtllibs x\n";
        let expected = [(2, "one.mtl"), (3, "a b.mtl"), (3, "c.MTL")].map(|(line, name)| (line, name.to_owned()));
        assert_eq!(super::super::libraries(text), expected);
    }
}
