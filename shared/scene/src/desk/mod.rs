//! Editing of scenes: what can be changed in a scene file, and the changes as functions from text to text that keep
//! comments and order.
//!
//! [`fields`] lists the numbers, colours, words and switches of a panel, and [`set`] writes one. [`camera`] moves the
//! camera. [`translate`] and [`turn`] move [`things`], which have ids: `lights.0`, `lights.0.target`, `shapes.2`, and
//! `shapes.2.7` for an instance. Error messages are meant for users.

mod camera;
mod digits;
mod fields;
mod lights;
mod line;
mod moves;
mod part;
mod schema;
mod set;
mod shapes;
mod steps;
mod things;
mod words;

pub use camera::{CameraMove, Eye, camera, eye};
pub use fields::{Field, FieldKind, fields};
pub use line::path_at;
pub use moves::{translate, turn};
pub use set::set;
pub use things::{Thing, material_of, object_ids, things};

#[cfg(test)]
mod tests;
