//! How do the bytes of an asset become numbers? This crate decodes the meshes, curves, images and volumes that scenes
//! name. No header's claim is believed before the bytes are there: a damaged or hostile file gives a [`Flaw`], not a
//! panic or a huge allocation.
//!
//! ```text
//! .ply .obj .serialized ---- mesh ----> RawMesh (double precision) --> solid, displaced, to_mesh
//! .ply .txt ---------------- strands -> RawStrands ------------------> to_strands
//! .png .jpg .exr .hdr ... -- image ---> Picture (linear RGB)
//! .vdb .vol ---------------- volume --> RawDensity (samples)
//! buffers of glTF ---------- meshopt, draco, elements --> bytes and numbers
//! ```
//!
//! Start at [`mesh::RawMesh::read_nth`], [`strands::RawStrands::read`], [`image::read_picture`] and [`volume::read`].
//! The caller reads the files; this crate sees only names and bytes.
//!
//! It is a separate crate so that every build can optimise it; the code that parses scenes is built without.
//!
//! # Example
//!
//! ```
//! use beamfarm_assets::mesh::RawMesh;
//!
//! let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
//! let mesh = RawMesh::read_nth("square.obj", square, 0, false)?;
//! assert_eq!(mesh.triangles.len(), 2);
//!
//! let flaw = RawMesh::read_nth("bad.obj", b"v 0 0 0\nv 1 0\n", 0, false).unwrap_err();
//! assert_eq!(flaw.line, Some(2));
//! # Ok::<(), beamfarm_assets::Flaw>(())
//! ```

#[cfg(test)]
mod damage;
pub mod draco;
pub mod elements;
pub mod image;
pub mod mesh;
pub mod meshopt;
mod parallel;
mod ply_number;
pub mod strands;
pub mod volume;

/// What is wrong with an asset.
#[derive(Debug)]
pub struct Flaw {
    /// Line from one, for text formats, if known.
    pub line: Option<usize>,
    /// What is wrong and what was expected.
    pub message: String,
}

impl<M: Into<String>> From<M> for Flaw {
    fn from(message: M) -> Self {
        Self {
            line: None,
            message: message.into(),
        }
    }
}

/// The line, from one, of a byte offset in a text.
pub fn line_of(text: &[u8], byte: usize) -> usize {
    let before = text.get(..byte).unwrap_or(text);
    1 + before.iter().filter(|b| **b == b'\n').count()
}
