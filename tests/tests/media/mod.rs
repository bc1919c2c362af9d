//! Fog, smoke, clouds and water. Against furnaces, integrals and one another.

mod emission;
mod fog_lights;
mod furnace;
mod grid_media;
mod hard_cases;
mod overlaps;
mod transmittance;
mod volumes;
