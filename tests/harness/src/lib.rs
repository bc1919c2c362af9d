//! Statistics for tests of random code: chi-square tests of samplers against their densities, z-tests of estimates; and
//! the readers that are fuzzed.
//!
//! A test states its significance: how often it would fail if all were right. Seeds are fixed, so that a test that
//! passes goes on passing; when it is changed, the significance says what to expect of the new draw.

pub mod browser;
pub mod chi2;
pub mod differential;
pub mod furnace;
pub mod fuzz;
pub mod hard_cases;
pub mod mitsuba;
pub mod path_tracer;
pub mod point_in_fog;
pub mod quadrature;
pub mod random_scene;
pub mod render;
pub mod suite;
pub mod z_test;

pub use chi2::{Chi2, Chi2Result};
pub use suite::Suite;
pub use z_test::MeanEstimate;
