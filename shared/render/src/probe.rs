//! What is known of a scene within milliseconds, before anything is rendered of it: whether light gets through its
//! media.

use crate::beam::trace::trace_photons;
use crate::math::{Vec3, mean};
use crate::medium::Medium;
use crate::plan::RenderPlan;
use crate::world::Scene;
use beamfarm_image::job::{JobSettings, PassStats};

/// Places along each side of a box at which densities are looked up.
const PLACES: u32 = 8;
/// Photon paths that are followed to see how far they go.
const PATHS: u32 = 64;
/// The same to see whether any arrives, and how often.
const BATCH: u32 = 256;
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

/// Rays of a photon path, mean of a few: one more than it is scattered. 0 where nothing scatters in media.
pub fn rays_of_a_path(scene: &Scene, settings: JobSettings) -> f32 {
    let settings = JobSettings {
        paths_per_pass: PATHS,
        ..settings
    };
    if !scene.media().iter().any(Medium::scatters) {
        return 0.0;
    }
    let plan = RenderPlan::provisional(scene, settings);
    match plan.has_photons() {
        true => trace_photons(scene, &plan, 0).rays as f32 / plan.surface_paths as f32,
        false => 0.0,
    }
}

/// What the photon paths of a plan leave: of so few that some leave something, or of 4,096.
pub fn photons_of(scene: &Scene, plan: &RenderPlan) -> PassStats {
    let mut stats = PassStats::default();
    if !plan.has_photons() {
        return stats;
    }
    let mut few = plan.clone();
    (few.settings.paths_per_pass, few.surface_paths) = (BATCH, BATCH);
    for batch in 0..BATCHES {
        let photons = trace_photons(scene, &few, batch);
        stats.paths += u64::from(BATCH);
        stats.beams += (photons.beams.len() + photons.smooth_beams.len()) as u64;
        stats.surface_photons += photons.surface.len() as u64;
        if stats.beams + stats.surface_photons > 0 {
            break;
        }
    }
    stats
}
