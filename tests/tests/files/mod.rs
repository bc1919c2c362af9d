//! Scene files: what they may say, and what is said of those that are wrong.

mod bad_scenes;
mod example_scenes;
mod glass;
mod gltf;
mod misplaced;
mod mitsuba_import;
mod outside;
mod scenes;
mod schema;
