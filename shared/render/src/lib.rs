//! The renderer. Data goes one way: a description becomes a [`Scene`](world::Scene) ready for rays, that a
//! [`RenderPlan`](plan::RenderPlan), and an engine makes a film of each pass, on processors
//! [`render_pass`](cpu::pass::render_pass). It knows no file formats.
//!
//! | question                                   | module                                          |
//! | ------------------------------------------ | ----------------------------------------------- |
//! | where is a beam traced, stored, evaluated? | [`cpu::beam::trace`], [`cpu::beam::store`], [`cpu::beam::estimate`] |
//! | where are photons on surfaces kept?        | [`cpu::photon_map`]                             |
//! | which estimator counts which light path?   | [`cpu::transport`], and for a scene [`plan::estimators`] |
//! | how are two of them weighed?               | [`plan::weights`]                               |
//! | what does a pass do?                       | [`cpu::pass`]                                   |
//! | what does a plan ask of an engine?         | [`plan::engine`]                                |
//! | which stages does a scene need?            | [`plan`]                                        |
//! | which plan is best?                        | [`plan::pilot`]                                 |
//! | how wide are kernels?                      | [`plan::kernel`], [`plan::footprint`]           |
//! | what are photons aimed at?                 | [`plan::targeting`]                             |
//! | who sees what, by rules?                   | [`world::rules`], [`world::mask`]               |
//! | what becomes of a material's parameters?   | [`world::bsdf`]                                 |
//! | which wavelengths has light that is split? | [`world::spectrum`]                             |
//! | which radii suit a known number of passes? | [`plan::budget`]                                |
//! | what is the image compared with?           | [`cpu::reference`](mod@cpu::reference)          |
//! | does it converge as the theory says?       | [`cpu::convergence`]                            |
//! | how is a pass stopped that has begun?      | [`world::interrupt`]                            |
//! | does light get through the media?          | [`cpu::probe`]                                  |

pub mod cpu;
pub mod math;
pub mod parallel;
pub mod plan;
mod roulette;
pub mod sampler;
pub mod warp;
mod wide;
pub mod world;
