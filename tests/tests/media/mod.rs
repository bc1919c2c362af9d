//! Fog, smoke, clouds and water, against furnaces, integrals and each other.

mod emission;
mod fog_lights;
mod furnace;
mod grid_media;
mod hard_cases;
mod overlaps;
mod transmittance;
mod volumes;
