//! Tests through the public interfaces of several crates. They form one program because linking the renderer takes
//! longer than most tests, and because one program keeps all cores busy to the end.

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
