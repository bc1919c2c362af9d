//! What is tested through the public interfaces of several crates. One program, since linking the renderer takes longer
//! than most tests, and since all of them keep all cores busy to the end.

#![allow(clippy::unwrap_used)]

mod beams;
mod choices;
mod farm;
mod files;
mod media;
mod modules;
mod rules;
mod spectrum;
mod surfaces;
mod targeting;
mod truth;
