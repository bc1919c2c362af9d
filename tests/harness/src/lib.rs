//! Statistics for tests of random code: chi-square tests of samplers against their densities, z-tests of estimates.
//! Also the readers that are fuzzed.
//!
//! A test states its significance: how often it would fail if everything were right. Seeds are fixed, so a passing test
//! keeps passing; when the code changes, the significance says what to expect from the new draw.

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
