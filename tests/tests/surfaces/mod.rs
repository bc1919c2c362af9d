//! Cameras, lights and materials: what is sampled with which density, and what goes into which layer. Against formulas,
//! integrals and tables from Mitsuba.

mod any_ray;
mod bumps;
mod camera;
mod cloth;
mod coats;
mod densities;
mod energy;
mod gloss;
mod graphs;
mod hair;
mod lamps;
mod layers;
mod lights;
mod material_scenes;
mod materials;
mod nested;
mod orthographic;
mod scattering;
mod subsurface;
mod translucent;
mod vertex_colors;
