//! A table of numerically hard cases, each rendered: `cargo run --release -p beamfarm-tests --example hard_cases`.

use beamfarm_harness::hard_cases::{Case, Outcome, cases, ordinary};
use std::time::Instant;

fn main() {
    let timed = |case: &Case| -> (Outcome, f64) {
        let begun = Instant::now();
        let outcome = case.render();
        let seconds = begun.elapsed().as_secs_f64();
        (outcome, seconds / case.passes as f64)
    };
    let ordinary = ordinary();
    // The first run warms up caches and clocks.
    timed(&ordinary);
    let (_, usual) = timed(&ordinary);
    println!("| case | beams a pass | evaluations a pass | radiance over truth | time a pass |");
    println!("|:--|--:|--:|--:|--:|");
    for case in [ordinary].into_iter().chain(cases()) {
        let (outcome, seconds) = timed(&case);
        let ratio = &outcome.ratio[0];
        println!(
            "| {} | {} | {} | {:.4} ± {:.4} | {:.2} |",
            case.name,
            outcome.stats.beams / case.passes,
            outcome.stats.beam_evaluations / case.passes,
            ratio.mean(),
            ratio.std_error(),
            seconds / usual,
        );
    }
}
