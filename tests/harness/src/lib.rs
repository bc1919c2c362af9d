//! Is random code right? Statistics for tests of it, and what tests share: scenes with known radiance, random scenes,
//! other renderers to compare with, and the readers that are fuzzed.
//!
//! ```text
//! text ── render::scene ── Scene ─┬─ render::blocks: our passes ───────┐
//!                                 └─ render::truth: the path tracer ───┴─ same_blocks ─┐
//! a sampler and its density ── Chi2 ──────────────────────────────────── chi2 ─────────┼─ Suite ── finish
//! samples of a known mean ── MeanEstimate ────────────────────────────── mean ─────────┘
//! ```
//!
//! The entrance is [`Suite`]. It takes p-values and judges them together. A test states its significance: how often it
//! would fail if everything were right. Seeds are fixed, so a passing test keeps passing; when the code changes, the
//! significance says what to expect from the new draw.
//!
//! # Example
//!
//! ```
//! use beamfarm_harness::{MeanEstimate, Suite};
//!
//! let mut mean = MeanEstimate::new();
//! for i in 0..1000 {
//!     mean.add(f64::from(i * 7919 % 1000) / 999.0);
//! }
//! let mut suite = Suite::new(1e-2);
//! suite.mean("numbers from 0 to 1", &mean, 0.5);
//! suite.finish();
//! ```

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
