//! Fog, smoke, clouds and water. Against furnaces, integrals and one another.

mod fog_lights;
mod emission;
mod furnace;
mod grid_media;
mod hard_cases;
mod overlaps;
mod transmittance;
mod volumes;
