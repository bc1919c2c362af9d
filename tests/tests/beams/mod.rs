//! Beams and photons alone, against formulas: densities, kernels, and how a radius and many passes change them.

mod absorption;
mod axis_rays;
mod bias;
mod convergence;
mod cylinder;
mod energy;
mod error_estimate;
mod footprints;
mod many_beams;
mod near_lights;
mod one_beam;
mod rates;
mod scales;
mod single_scattering;
mod unseen;
mod weights;
