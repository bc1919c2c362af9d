//! What a small lamp brings through glass does not depend on the size of the ground.

use super::setup::on_a_ground;
use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, scene};

/// Significance 1e-3 for all blocks of all pictures. A ground of 300 was right when that of 1,000 was not: there,
/// kernels were no wider than the uncertainty of hits.
#[test]
fn the_ground_takes_no_caustic_from_a_lamp() {
    let mut suite = Suite::new(1e-3);
    let picture = |size| {
        let text = on_a_ground(size).replace("[camera]", "targeting = \"off\"\n[camera]");
        blocks(&scene(&text), 8)
    };
    let [near, far, farther] = [20.0, 1000.0, 10_000.0].map(picture);
    suite.same_blocks("1,000", &far, &near, 5e-3);
    suite.same_blocks("10,000", &farther, &near, 2e-2);
    suite.finish();
    for picture in [&far, &farther] {
        assert!(picture.noise(&near) < 0.02, "{}", picture.noise(&near));
    }
}
