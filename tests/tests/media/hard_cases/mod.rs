//! Numerically hard cases: everything stays finite, unbiased, and as fast as the ordinary.
//!
//! | hard case | where it is tested |
//! | --- | --- |
//! | ray parallel to a beam | `one_beam.rs`, down to an angle of zero |
//! | beam of zero length | here |
//! | camera inside a beam, glass or a medium | here |
//! | extreme radius scales | `shared/image/src/radius.rs` to 1e12; pictures of pass 1e6 here |
//! | scenes scaled by 1e-3 and 1e4 | here |
//! | scenes moved by 1e5 | `scenes/places.rs`: in render space they are the same |
//! | sigma_t of 0, also in one channel, and tiny | here |
//! | sigma_t of 1e4 | here |
//! | albedo of 1 | `furnace.rs`, and all furnaces here |
//! | Henyey and Greenstein's g of ±0.999 | here, finite and no more than the truth; exact along one beam in `one_beam.rs` |
//! | total internal reflection, index-matched glass, grazing angles | here; `bsdf/tests.rs` |
//! | coincident and degenerate triangles | here |
//! | lights at a boundary and inside glass; nested media | here; `near_lights.rs` |
//! | a majorant that a grid almost violates | here; `transmittance.rs`, `grid_media.rs` |
//! | a million passes of one value, and of a large one with noise | `shared/image/tests/merge.rs` |
//! | NaN and infinities | `shared/image/tests/merge.rs`; over the network in `farm/submissions.rs` |

mod beams;
mod dense;

use beamfarm_harness::Suite;
use beamfarm_harness::hard_cases::{cases, ordinary};

/// No case may need more than this many times the beams or evaluations of the ordinary one.
const MAX_WORK: f64 = 3.0;

#[test]
fn furnaces_are_one_and_cost_what_the_ordinary_one_does() {
    // Significance 1e-3 for the whole suite.
    let mut suite = Suite::new(1e-3);
    let ordinary = ordinary();
    let usual = ordinary.render().stats;
    for case in [ordinary].into_iter().chain(cases()) {
        let outcome = case.render();
        let name = case.name;
        assert_eq!(outcome.stats.non_finite, 0, "{name}");
        for (c, ratio) in outcome.ratio.iter().enumerate() {
            println!("{name}, channel {c}: {:.4} +- {:.4}", ratio.mean(), ratio.std_error());
            // The nearest value that kernels and the rarity of visible light explain.
            let least = if case.rarely_seen { 0.0 } else { 1.0 - case.allowance };
            let allowed = ratio.mean().clamp(least, 1.0 + case.allowance);
            suite.mean(format!("{name}, channel {c}"), ratio, allowed);
        }
        let per_path = |count: u64, paths: u64| count as f64 / paths.max(1) as f64;
        for (what, count, usual_count) in [
            ("beams", outcome.stats.beams, usual.beams),
            ("evaluations", outcome.stats.beam_evaluations, usual.beam_evaluations),
        ] {
            let work = per_path(count, outcome.stats.paths) / per_path(usual_count, usual.paths);
            println!("{name}: {what} {work:.2}");
            assert!(work <= MAX_WORK * case.work, "{name}: {what} {work}");
        }
    }
    suite.finish();
}
