//! Photons go to lights by their possible contribution to the picture: neither an endless ground nor much stronger
//! lights take them from a small lamp.

use super::setup::on_a_ground;
use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, scene};

/// Significance 1e-3 for all blocks of all pictures. A larger ground reflects little more onto the ball: it lies below
/// the horizon of everything visible.
#[test]
fn the_ground_takes_no_photons_from_a_lamp() {
    let mut suite = Suite::new(1e-3);
    let sky = "[[lights]]\ntype = \"environment\"\nradiance = 0.5\n";
    let [near, far, farther] = [10.0, 100.0, 10_000.0].map(|size| blocks(&scene(&(on_a_ground(size) + sky)), 8));
    suite.same_blocks("100", &far, &near, 5e-3);
    suite.same_blocks("10,000", &farther, &near, 5e-3);
    suite.finish();
    for picture in [&near, &far, &farther] {
        assert!(picture.noise(&near) < 0.02, "{}", picture.noise(&near));
    }
}
