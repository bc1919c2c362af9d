//! What is in a scene file? This crate reads scenes with the meshes, images and volumes that they name, validates them,
//! and builds the [`SceneDescription`](beamfarm_render::world::SceneDescription) that the renderer takes. Native scenes
//! are TOML; Mitsuba's XML and glTF are converted to TOML first, so that one parser checks everything.
//!
//! ```text
//! .xml ---------- mitsuba --+                             files named: assets, reach
//! .glb, .gltf --- lone -----+                                       |
//!                           v                                       v
//! .toml ----------------> text --> time --> parse --> records --> assemble --> SceneDescription
//!                           ^     (keys at        (with places       ^
//!                         desk    a moment)        in the text)   Store (kept from earlier scenes)
//! ```
//!
//! [`SceneFile::read`] gathers a scene file and its assets from disk into a bundle, and [`SceneFile::load`] builds the
//! scene. [`load()`] does the same for a bundle in memory, as workers get it. A [`Store`] speeds up successive scenes
//! that share files.
//!
//! Errors are [`SceneError`]s with file, line and field; [`errors`] finds those of a whole file at once. [`desk`] edits
//! a file's text without losing its comments. [`json_schema`] describes the native format to editors. [`Reach`] decides
//! which files a scene may read.
//!
//! # Example
//!
//! ```
//! use beamfarm_image::bundle::Bundle;
//! use beamfarm_image::merge::{Node, TreeSum};
//! use beamfarm_render::cpu::pass::render_pass;
//! use beamfarm_render::plan::RenderPlan;
//! use beamfarm_render::world::Scene;
//!
//! let text = r#"
//! [image]
//! width = 32
//! height = 24
//! [camera]
//! origin = [0, 0, 3]
//! target = [0, 0, 0]
//! fov = 40
//! [[shapes]]
//! type = "sphere"
//! center = [0, 0, 0]
//! radius = 1
//! [[lights]]
//! type = "point"
//! position = [2, 2, 3]
//! power = 100
//! "#;
//! let mut bundle = Bundle { scene: "ball.toml".into(), ..Bundle::default() };
//! bundle.files.insert("ball.toml".into(), text.into());
//!
//! let scene = Scene::new(beamfarm_scene::load(&bundle)?);
//! let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
//! let mut sum = TreeSum::new(32, 24);
//! for pass_index in 0..4 {
//!     let pass = render_pass(&scene, &plan, pass_index).expect("a pass");
//!     sum.insert(Node::leaf(pass_index, pass.film))?;
//! }
//! let image = sum.average().expect("four passes are complete");
//! assert!(image.beauty.pixels[12 * 32 + 16][0] > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod assets;
mod cie;
pub mod desk;
mod disk;
mod edits;
mod error;
mod faults;
mod files;
mod frames;
mod gather;
mod kinds;
mod load;
mod lone;
mod made;
mod meaning;
mod mitsuba;
mod options;
mod parse;
mod paths;
mod place;
mod reach;
mod revised;
mod scene_file;
mod source;
mod store;
mod time;
mod transform;
mod values;

pub use assemble::Extent;
pub use edits::Edits;
pub use error::SceneError;
pub use faults::{errors, errors_of_text};
pub use files::{ContentHash, File, Files};
pub use frames::{frames, numbered};
pub use load::load;
pub use lone::is_gltf;
pub use meaning::differences;
pub use mitsuba::{Imported, Origin, import, is_mitsuba};
pub use options::ImportOptions;
pub use parse::json_schema_with_keys as json_schema;
pub use reach::{Reach, Written};
pub use scene_file::{SceneFile, SceneText, read_bundle};
pub use store::Store;
