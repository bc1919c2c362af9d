//! beamfarm's library: everything about images and passes that does not need a network.
//!
//! Data goes one way: a scene file becomes a [`SceneDescription`](scene::SceneDescription), that a
//! [`Scene`](plan::Scene) and a [`RenderPlan`](plan::RenderPlan); [`render_pass`](pass::render_pass) makes a
//! [`Film`](film::Film) of one pass; the [`TreeSum`](merge::TreeSum) of passes gives the average, which [`exr`] and
//! [`png`] write.
//!
//! | question                                   | module                                          |
//! | ------------------------------------------ | ----------------------------------------------- |
//! | where is a beam traced, stored, evaluated? | `beam::{trace, store, estimate}`                |
//! | which estimator counts which light path?   | `transport`, and for a scene `estimators`       |
//! | what does a pass do?                       | `pass`                                          |
//! | which stages does a scene need?            | `plan`                                          |
//! | what are photons aimed at?                 | `target`                                        |
//! | how does the radius shrink?                | [`radius`]                                      |
//! | which radii suit a known number of passes? | `budget`                                     |
//! | how are passes averaged?                   | [`merge`]                                       |
//! | what is the image compared with?           | `reference`                                     |
//! | how large is the bias of the average?      | [`bias`]                                        |
//! | does it converge as the theory says?       | `convergence`                                   |
//!
//! The renderer is behind the feature `render`; without it the crate holds what a coordinator needs.
#![cfg_attr(
    feature = "render",
    doc = r##"
# Example

```
use beamfarm_shared::bundle::Bundle;
use beamfarm_shared::merge::{Node, TreeSum};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::scene::SceneDescription;

let text = r#"
[image]
width = 32
height = 24
[camera]
origin = [0, 0, 3]
target = [0, 0, 0]
fov = 40
[[shapes]]
type = "sphere"
center = [0, 0, 0]
radius = 1
[[lights]]
type = "point"
position = [2, 2, 3]
power = 100
"#;
let mut bundle = Bundle { scene: "ball.toml".into(), ..Bundle::default() };
bundle.files.insert("ball.toml".into(), text.into());

let scene = Scene::new(SceneDescription::load(&bundle)?);
let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
let mut sum = TreeSum::new(32, 24);
for pass_index in 0..4 {
    let pass = render_pass(&scene, &plan, pass_index);
    sum.insert(Node::leaf(pass_index, pass.film))?;
}
let image = sum.average().expect("four passes are complete");
assert!(image.beauty.pixels[12 * 32 + 16][0] > 0.0);
# Ok::<(), Box<dyn std::error::Error>>(())
```
"##
)]

pub mod atomic;
pub mod bias;
pub mod bundle;
pub mod error;
pub mod exr;
pub mod film;
pub mod job;
pub mod layer;
pub mod merge;
pub mod metrics;
pub mod png;
pub mod radius;

#[cfg(feature = "render")]
pub mod beam;
#[cfg(feature = "render")]
pub mod bsdf;
#[cfg(feature = "render")]
pub mod budget;
#[cfg(feature = "render")]
pub mod camera;
#[cfg(feature = "render")]
pub mod convergence;
#[cfg(feature = "render")]
mod crossing;
#[cfg(feature = "render")]
pub mod estimators;
#[cfg(feature = "render")]
mod extent;
#[cfg(feature = "render")]
pub mod filter;
#[cfg(feature = "render")]
pub mod footprint;
#[cfg(feature = "render")]
pub mod geometry;
#[cfg(feature = "render")]
pub mod light;
#[cfg(feature = "render")]
pub mod math;
#[cfg(feature = "render")]
pub mod medium;
#[cfg(feature = "render")]
pub mod parts;
#[cfg(feature = "render")]
pub mod pass;
#[cfg(feature = "render")]
pub mod phase;
#[cfg(feature = "render")]
pub mod plan;
#[cfg(feature = "render")]
pub mod reference;
#[cfg(feature = "render")]
pub mod rules;
#[cfg(feature = "render")]
pub mod sampler;
#[cfg(feature = "render")]
pub mod scene;
#[cfg(feature = "render")]
mod shadow;
#[cfg(feature = "render")]
pub mod surface;
#[cfg(feature = "render")]
pub mod target;
#[cfg(feature = "render")]
pub mod texture;
#[cfg(feature = "render")]
pub mod transport;
#[cfg(feature = "render")]
pub mod warp;
#[cfg(feature = "render")]
mod wide;
