//! Scenes that can be rendered mean what the format says.

mod fields;
mod lights;
mod places;
mod setup;
