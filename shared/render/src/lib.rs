//! The renderer: a scene's description becomes a [`Scene`](world::Scene) ready for rays and a
//! [`RenderPlan`](plan::RenderPlan), and [`render_pass`](pass::render_pass) makes a film of one pass. It knows no file
//! formats.
//!
//! | question                                   | module                                          |
//! | ------------------------------------------ | ----------------------------------------------- |
//! | where is a beam traced, stored, evaluated? | [`beam::trace`], [`beam::store`], [`beam::estimate`] |
//! | where are photons on surfaces kept?        | [`photon_map`]                                  |
//! | which estimator counts which light path?   | [`transport`], and for a scene [`estimators`]   |
//! | what does a pass do?                       | [`pass`]                                        |
//! | which stages does a scene need?            | [`plan`]                                        |
//! | how wide are kernels?                      | [`kernel`], [`footprint`]                       |
//! | what are photons aimed at?                 | [`targeting`]                                   |
//! | who sees what, by rules?                   | [`rules`], [`sight`]                            |
//! | what becomes of a material's parameters?   | [`bsdf`]                                        |
//! | which wavelengths has light that is split? | [`spectrum`]                                    |
//! | which radii suit a known number of passes? | [`budget`]                                      |
//! | what is the image compared with?           | [`reference`](mod@reference)                    |
//! | does it converge as the theory says?       | [`convergence`]                                 |
//! | how is a pass stopped that has begun?      | [`interrupt`]                                   |
//! | does light get through the media?          | [`probe`]                                       |

pub mod aov;
pub mod balance;
pub mod beam;
pub mod bsdf;
pub mod budget;
pub mod camera;
pub mod convergence;
pub mod estimators;
pub mod filter;
mod flow;
pub mod footprint;
pub mod geometry;
pub mod interrupt;
pub mod kernel;
pub mod light;
pub mod math;
pub mod medium;
pub mod parallel;
pub mod pass;
pub mod phase;
pub mod photon_map;
pub mod plan;
pub mod probe;
pub mod reference;
mod roulette;
pub mod rules;
pub mod sampler;
pub mod scalar;
pub mod sight;
pub mod spectrum;
pub mod targeting;
pub mod texture;
pub mod transport;
pub mod view;
pub mod warp;
pub mod weights;
mod wide;
pub mod world;
