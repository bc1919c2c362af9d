//! Scene files: what they may contain, and which errors wrong ones give.

mod bad_scenes;
mod example_scenes;
mod glass;
mod gltf;
mod misplaced;
mod mitsuba_import;
mod outside;
mod scenes;
mod schema;
