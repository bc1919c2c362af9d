//! Readers for the asset files that a scene names.

#[cfg(test)]
#[path = "../../../assets/src/damage.rs"]
mod damage;
pub mod gltf;
pub mod ies;
pub mod mtl;

pub use beamfarm_assets::{Flaw, image, mesh, strands, volume};
