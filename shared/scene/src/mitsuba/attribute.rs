//! Mesh attributes: copies of PLY files in which the attribute that a texture names becomes the vertex colours.

use super::Converter;
use super::property::Named;
use super::value::Value;
use super::write::Toml;
use super::xml::{Content, Id, Member};
use crate::assets::mesh::RawMesh;
use glam::DAffine3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

/// An attribute that a shape's texture names.
struct Wanted<'a> {
    member: &'a Member,
    name: &'a str,
    scale: f64,
}

/// Values per vertex or per face.
struct Values {
    of_faces: bool,
    colors: Vec<[f64; 3]>,
}

impl<'a> Converter<'a> {
    /// A shape's file, or a copy if its material or emission uses a mesh attribute.
    pub(super) fn with_attribute(&mut self, shape: Id, file: Toml, path: &Named) -> Toml {
        let mut wanted = Vec::new();
        self.wanted(shape, &mut wanted);
        let Some(first) = wanted.first() else {
            return file;
        };
        let same = |w: &Wanted<'_>| (w.name, w.scale) == (first.name, first.scale);
        if !wanted.iter().all(same) || self.objects.list[shape].plugin != "ply" {
            let message = "attributes of meshes are supported of PLY files, one for each shape";
            self.unsupported_attribute(first, message);
            return file;
        }
        match self.read(path).and_then(|bytes| copy(&bytes, first)) {
            Ok(bytes) => {
                let name = format!("{}-mesh{}.ply", self.stem, self.made.len() + 1);
                let message = format!("the mesh with its {} as colours is {name}, which is made", first.name);
                self.log.note(self.objects.list[shape].place, message);
                self.made.insert(name.clone(), bytes);
                Toml::string(name)
            }
            Err(reason) => {
                self.unsupported_attribute(first, &format!("{}: {reason}", path.path.display()));
                file
            }
        }
    }

    fn unsupported_attribute(&mut self, wanted: &Wanted<'_>, message: &str) {
        let message = format!("texture \"mesh_attribute\": {}: {message}", wanted.name);
        self.log.unsupported(wanted.member.place, message);
    }

    /// The attributes that an object's textures name.
    fn wanted(&self, id: Id, wanted: &mut Vec<Wanted<'a>>) {
        let objects = self.objects;
        for member in &objects.list[id].members {
            let Content::Object(inner) = member.content else {
                continue;
            };
            let texture = &objects.list[inner];
            if texture.plugin != "mesh_attribute" {
                self.wanted(inner, wanted);
                continue;
            }
            let value = |name: &str| texture.members.iter().find(|m| m.name.as_deref() == Some(name));
            let scale = match value("scale").map(|m| &m.content) {
                Some(Content::Value(Value::Float(scale))) => *scale,
                Some(Content::Value(Value::Integer(scale))) => *scale as f64,
                _ => 1.0,
            };
            if let Some(member) = value("name")
                && let Content::Value(Value::String(name)) = &member.content
            {
                wanted.push(Wanted { member, name, scale });
            }
        }
    }
}

/// A PLY file with an attribute as vertex colours.
fn copy(bytes: &[u8], wanted: &Wanted<'_>) -> Result<Vec<u8>, String> {
    let mut mesh = RawMesh::read_nth("mesh.ply", bytes, 0, false).map_err(|flaw| flaw.message)?;
    let values = values(bytes, wanted)?;
    if values.of_faces && mesh.normals.is_empty() {
        // Faces without shared vertices would lose smooth shading.
        mesh.normals = mesh.smooth_normals(&DAffine3::IDENTITY);
    }
    let expected = if values.of_faces {
        mesh.triangles.len()
    } else {
        mesh.positions.len()
    };
    if values.colors.len() != expected {
        return Err(format!("expected {expected} of them, found {}", values.colors.len()));
    }
    Ok(write(&mesh, &values))
}

fn values(bytes: &[u8], wanted: &Wanted<'_>) -> Result<Values, String> {
    let (of_faces, base) = match wanted.name.split_once('_') {
        Some(("vertex", base)) => (false, base),
        Some(("face", base)) => (true, base),
        _ => return Err("expected a name that begins with vertex_ or face_".to_string()),
    };
    let parser = Parser::<DefaultElement>::new();
    let ply = parser.read_ply(&mut &bytes[..]).map_err(|error| error.to_string())?;
    let element = if of_faces { "face" } else { "vertex" };
    let elements = ply.payload.get(element).map_or(&[][..], Vec::as_slice);
    let number = |element: &DefaultElement, name: &str| match element.get(name) {
        Some(Property::Float(x)) => Some(f64::from(*x)),
        Some(Property::Double(x)) => Some(*x),
        _ => None,
    };
    let three = ["0", "1", "2"].map(|i| format!("{base}_{i}"));
    let color = |element: &DefaultElement| {
        let [r, g, b] = three.each_ref().map(|name| number(element, name));
        match (r, g, b) {
            (Some(r), Some(g), Some(b)) => Some([r, g, b]),
            (Some(grey), None, None) => Some([grey; 3]),
            _ => None,
        }
    };
    let colors: Option<Vec<[f64; 3]>> = elements.iter().map(color).collect();
    let colors = colors.ok_or_else(|| format!("expected one property or three, from {base}_0 on, of floats"))?;
    Ok(Values {
        of_faces,
        colors: colors
            .into_iter()
            .map(|color| color.map(|c| c * wanted.scale))
            .collect(),
    })
}

/// Writes binary PLY; with values per face, no vertices are shared.
fn write(mesh: &RawMesh, values: &Values) -> Vec<u8> {
    let vertices: Vec<(usize, usize)> = match values.of_faces {
        false => (0..mesh.positions.len()).map(|v| (v, v)).collect(),
        true => {
            let faces = mesh.triangles.iter().enumerate();
            faces.flat_map(|(i, t)| t.map(|v| (v as usize, i))).collect()
        }
    };
    let parts = [
        ("x y z", true),
        ("nx ny nz", !mesh.normals.is_empty()),
        ("u v", !mesh.uvs.is_empty()),
        ("r g b", true),
    ];
    let names = parts
        .iter()
        .filter(|(_, has)| *has)
        .flat_map(|(names, _)| names.split(' '));
    let properties: String = names.map(|name| format!("property double {name}\n")).collect();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for (v, value) in vertices {
        let normal = mesh.normals.get(v).map_or(Vec::new(), |n| n.to_array().to_vec());
        let uv = mesh.uvs.get(v).map_or(Vec::new(), |uv| uv.to_array().to_vec());
        let numbers = [&mesh.positions[v].to_array()[..], &normal, &uv, &values.colors[value]].concat();
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    }
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let own = [0, 1, 2].map(|corner| (3 * i + corner) as u32);
        bytes.push(3);
        bytes.extend(
            if values.of_faces { own } else { *triangle }
                .map(u32::to_le_bytes)
                .concat(),
        );
    }
    bytes
}
