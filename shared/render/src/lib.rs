//! The renderer: which radiance does a pass of a scene bring to each pixel?
//!
//! Data goes one way. A [`SceneDescription`](world::SceneDescription) becomes a [`Scene`](world::Scene) ready for rays.
//! Scene and [`JobSettings`](beamfarm_image::job::JobSettings) give a [`RenderPlan`](plan::RenderPlan), made once. An
//! [`Engine`](plan::engine::Engine) turns the plan into a [`PassImage`](plan::engine::PassImage) for each pass index;
//! the one for processors enters at [`render_pass`](cpu::pass::render_pass). The crate knows no file formats.
//!
//! ```text
//! SceneDescription ── Scene::new ── Scene ── RenderPlan::new ── RenderPlan
//!                                     └─────── render_pass ──────────┘
//! in a pass:
//! lights ── beam::trace ─┬─ beam::store ─┬─ beam::estimate ─┐
//!                        └─ photon_map ──┤                  ├─ PassImage: film, layers, mattes
//! camera ── transport ───────────────────┴─ direct light ───┘
//! ```
//!
//! The first pass of a job:
//!
//! ```
//! use beamfarm_image::job::JobSettings;
//! use beamfarm_render::cpu::pass::render_pass;
//! use beamfarm_render::plan::RenderPlan;
//! use beamfarm_render::plan::engine::{NoPass, PassImage};
//! use beamfarm_render::world::{Scene, SceneDescription};
//!
//! fn first_pass(description: SceneDescription, settings: JobSettings) -> Result<PassImage, NoPass> {
//!     let scene = Scene::new(description);
//!     let plan = RenderPlan::new(&scene, settings);
//!     render_pass(&scene, &plan, 0)
//! }
//! ```
//!
//! | question                                   | module                                        |
//! | ------------------------------------------ | --------------------------------------------- |
//! | where is a beam traced, stored, evaluated? | [`cpu::beam::trace`], [`cpu::beam::store`], [`cpu::beam::estimate`] |
//! | where are photons on surfaces kept?        | [`cpu::photon_map`]                           |
//! | which estimator counts which light path?   | [`cpu::transport`], and for a scene [`plan::estimators`] |
//! | how are two estimators weighted?           | [`plan::weights`]                             |
//! | what does a pass do?                       | [`cpu::pass`]                                 |
//! | what does a plan ask of an engine?         | [`plan::engine`]                              |
//! | which stages does a scene need?            | [`plan`]                                      |
//! | which plan is best?                        | [`plan::pilot`]                               |
//! | how wide are kernels?                      | [`plan::kernel`], [`plan::footprint`]         |
//! | what are photons aimed at?                 | [`plan::targeting`]                           |
//! | what sees what, by rules?                  | [`world::rules`], [`world::mask`]             |
//! | what becomes of a material's parameters?   | [`world::bsdf`]                               |
//! | which wavelengths has dispersed light?     | [`world::spectrum`]                           |
//! | which radii suit a known number of passes? | [`plan::budget`]                              |
//! | what is the image compared with?           | [`cpu::reference`](mod@cpu::reference)        |
//! | does it converge as the theory says?       | [`cpu::convergence`]                          |
//! | how is a running pass stopped?             | [`world::interrupt`]                          |
//! | does light get through the media?          | [`cpu::probe`]                                |

pub mod cpu;
pub mod math;
pub mod parallel;
pub mod plan;
mod roulette;
pub mod sampler;
pub mod warp;
mod wide;
pub mod world;
