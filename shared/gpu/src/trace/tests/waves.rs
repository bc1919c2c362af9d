//! Photons with wavelengths.

use super::{Beam, ROOM, TOGETHER, compare, scenes, settings, trace};
use crate::testing::tested;
use beamfarm_image::job::Technique;
use beamfarm_render::plan::RenderPlan;
use std::collections::BTreeSet;

/// Path by path as on the processor: the same wavelengths and the same refraction.
#[test]
fn photons_that_are_split_leave_what_they_leave_on_a_processor() {
    let Some(tested) = tested() else { return };
    let scene = scenes::prism();
    let photons = Some(Technique::Photons);
    for (media, surfaces, pass) in [(None, None, 0), (photons, photons, 50)] {
        let plan = RenderPlan::new(&scene, settings(400, media, surfaces));
        assert!(plan.waves > 0);
        let [beams, surface, _] = compare(tested, "prism", &scene, &plan, pass);
        assert!(beams > 300 && surface > 100, "{beams} {surface}");
        let got = trace(tested, &scene, &plan, pass, ROOM, TOGETHER);
        let of_beams: BTreeSet<u32> = got.beams.iter().map(|beam| beam.medium >> Beam::WAVE_BITS).collect();
        let of_photons: BTreeSet<u32> = got.photons.iter().map(|photon| photon.arrival >> 16).collect();
        let all: BTreeSet<u32> = (0..=u32::from(plan.waves)).collect();
        assert_eq!(of_beams, all);
        assert!(of_photons.len() > 6 && of_photons.is_subset(&all), "{of_photons:?}");
    }
}
