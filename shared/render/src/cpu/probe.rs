//! What is known of a scene within milliseconds, before anything is rendered of it: whether light gets through its
//! media.

use crate::cpu::beam::trace::trace_photons;
use crate::math::{Vec3, mean};
use crate::plan::RenderPlan;
use crate::world::Scene;
use crate::world::medium::Medium;

/// Places along each side of a box at which densities are looked up.
const PLACES: u32 = 8;
/// Photon paths that are followed, and how often so many until some arrive.
const PATHS: u32 = 256;
const BATCHES: u64 = 16;

/// By medium: the mean optical depth of what it fills, from one side to the other by the shortest way: of the objects
/// whose inside it is, that of the thickest. 0 of media that fill nothing alone.
pub fn optical_depths(scene: &Scene) -> Vec<f32> {
    let mut depths = vec![0.0_f32; scene.media().len()];
    for (object, &(low, high)) in scene.objects().iter().zip(&scene.boxes) {
        if let Some(id) = object.boundary.and_then(|boundary| boundary.interior) {
            let medium = &scene.media()[usize::from(id)];
            let depth = mean_extinction(medium, low, high) * (high - low).min_element();
            // A depth that is no number is none.
            depths[usize::from(id)] = depths[usize::from(id)].max(depth);
        }
    }
    depths
}

/// Over a box, per scene unit.
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
    /// Their rays: one of each, and one more each time that something scattered one.
    pub rays: u64,
    /// How many of these met anything.
    pub met: u64,
}

impl Followed {
    /// None of them met anything.
    pub fn is_lost(&self) -> bool {
        self.paths > 0 && self.met == 0
    }
}

/// Follow photon paths of a plan, if it has any: a few, and only if all are lost up to 4,096.
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
