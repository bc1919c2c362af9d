//! What can be known of a scene within milliseconds, before rendering it: whether light gets through its media.

use crate::cpu::beam::trace::trace_photons;
use crate::math::{Vec3, mean};
use crate::plan::RenderPlan;
use crate::world::Scene;
use crate::world::medium::Medium;

/// Points along each side of a box at which to look up densities.
const PLACES: u32 = 8;
/// Photon paths in a batch, and the most batches to try until some paths arrive.
const PATHS: u32 = 256;
const BATCHES: u64 = 16;

/// By medium: the mean optical depth across the shortest side of the objects that it fills, for the thickest of them. 0
/// for media that fill no object.
pub fn optical_depths(scene: &Scene) -> Vec<f32> {
    let mut depths = vec![0.0_f32; scene.media().len()];
    for (object, &(low, high)) in scene.objects().iter().zip(&scene.boxes) {
        if let Some(id) = object.boundary.and_then(|boundary| boundary.interior) {
            let medium = &scene.media()[usize::from(id)];
            let depth = mean_extinction(medium, low, high) * (high - low).min_element();
            // A NaN depth counts as none.
            depths[usize::from(id)] = depths[usize::from(id)].max(depth);
        }
    }
    depths
}

/// Mean extinction over a box, per scene unit.
fn mean_extinction(medium: &Medium, low: Vec3, high: Vec3) -> f32 {
    let density = match medium {
        Medium::Homogeneous(_) => 1.0,
        Medium::Heterogeneous(medium) => {
            let place = |i: u32| (i as f32 + 0.5) / PLACES as f32;
            let places = (0..PLACES.pow(3)).map(|i| {
                let at = [i, i / PLACES, i / PLACES.pow(2)].map(|i| place(i % PLACES));
                medium.density(low + Vec3::from(at) * (high - low))
            });
            places.sum::<f32>() / PLACES.pow(3) as f32
        }
    };
    mean(medium.sigma_t()) * density
}

/// What became of some photon paths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Followed {
    /// Paths.
    pub paths: u32,
    /// Their rays: one each, and one more for each scattering.
    pub rays: u64,
    /// How many of these rays met anything.
    pub met: u64,
}

impl Followed {
    /// Whether none of the rays met anything.
    pub fn is_lost(&self) -> bool {
        self.paths > 0 && self.met == 0
    }
}

/// Follow a plan's photon paths, if it has any: 256, and up to 4,096 as long as all are lost.
pub fn follow_photons(scene: &Scene, plan: &RenderPlan) -> Followed {
    let mut followed = Followed::default();
    let mut few = plan.clone();
    (few.settings.paths_per_pass, few.surface_paths) = (PATHS, PATHS);
    for batch in (0..BATCHES).filter(|_| plan.has_photons()) {
        let photons = trace_photons(scene, &few, batch);
        followed.paths += PATHS;
        followed.rays += photons.rays;
        followed.met += photons.met;
        if !followed.is_lost() {
            break;
        }
    }
    followed
}
