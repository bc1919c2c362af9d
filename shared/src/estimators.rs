//! Which estimator counts which light path, as far as that depends on the scene. The table is in [`crate::transport`].

use crate::bsdf::{Bsdf, Material};
use crate::geometry::bounds;
use crate::light::LightKind;
use crate::math::Vec3;
use crate::medium::Medium;
use crate::plan::{KernelRadii, Scene};

/// What is chosen once for a scene.
#[derive(Clone, Debug, Default)]
pub struct Estimators {
    /// By medium: beams bring all of the light that it scatters. In the others camera paths are scattered themselves, and beams
    /// bring caustics alone.
    pub beams: Vec<bool>,
    /// By light: camera paths meet it behind specular surfaces as well, and photons bring no caustics of it.
    pub is_met: Vec<bool>,
    /// Something is specular or has a lobe that is followed.
    specular: bool,
    /// Some light's photons may come by way of specular surfaces or followed lobes.
    pub caustics: bool,
    /// Some of them from a light that no camera path meets, and by followed lobes.
    pub unmet_caustics: bool,
    /// Photon paths go on from vertex to vertex, for the beams that they leave: camera paths end where photons bring everything,
    /// and what comes by way of specular surfaces is found by photons alone.
    pub deep: bool,
    /// Rules tell what photons see, which camera paths do not obey: these end at their second vertex.
    pub ends_at_second: bool,
}

/// An environment whose brightest direction is at most so much brighter than the mean is met often enough by chance.
const MOST_UNEVEN: f32 = 16.0;

/// Least free path and least size of a medium whose light beams bring, in kernel radii: in others kernels would be wider than
/// what they blur.
const LEAST_FREE_PATH: f32 = 6.0;
const LEAST_SIZE: f32 = 12.0;

impl Estimators {
    /// By what is in the scene, and how wide kernels are.
    pub fn new(scene: &Scene, radii: &KernelRadii) -> Self {
        let description = scene.description();
        let rules = description.rules.as_ref();
        let ends_at_second = rules.is_some_and(|rules| rules.touches_photons && !rules.paths_obey);
        let is_used = |test: &dyn Fn(&Material) -> bool| {
            let mut objects = description.objects.iter();
            objects.any(|o| test(&description.materials[o.material as usize]))
        };
        let beams: Vec<bool> = (0..description.media.len())
            .map(|id| {
                description.media[id].scatters()
                    && (ends_at_second || suits_beams(scene, radii, id))
            })
            .collect();
        let deep = ends_at_second || beams.contains(&true);
        let is_met: Vec<bool> = description
            .lights
            .iter()
            .map(|light| match &light.kind {
                LightKind::Environment(environment) => {
                    !deep && environment.unevenness() <= MOST_UNEVEN
                }
                _ => false,
            })
            .collect();
        let followed = is_used(&|m| m.is_followed() || m.has_narrow_lobe());
        let specular = followed || is_used(&|m| m.has_delta() && !m.is_null());
        let unmet = |light: &crate::light::Light| light.kind.is_delta();
        Self {
            beams,
            specular,
            caustics: specular && is_met.iter().any(|met| !met),
            unmet_caustics: followed && description.lights.iter().any(unmet),
            is_met,
            deep,
            ends_at_second,
        }
    }

    /// The same with photon paths that go on from surface to surface.
    pub fn deepened(&self) -> Self {
        Self {
            is_met: vec![false; self.is_met.len()],
            caustics: self.specular,
            deep: true,
            ..self.clone()
        }
    }

    /// Whether beams bring all the light of some medium.
    pub fn any_beams(&self) -> bool {
        self.beams.iter().any(|beams| *beams)
    }

    /// Whether beams bring some light to media where camera paths are scattered: caustics, or what other media scatter.
    pub fn leave_beams(&self) -> bool {
        self.caustics || self.any_beams()
    }

    /// Whether camera paths may end at a surface like this one, by the photons there: narrow lobes see few of them.
    #[inline]
    pub fn ends_paths(&self, bsdf: &Bsdf) -> bool {
        self.ends_at_second || self.deep && !bsdf.is_glossy()
    }
}

/// Whether kernels are narrow beside the medium and beside the way of light in it.
fn suits_beams(scene: &Scene, radii: &KernelRadii, id: usize) -> bool {
    let medium = &scene.media()[id];
    let radius = radii.smooth_ceiling;
    let size = match medium {
        Medium::Homogeneous(_) => size_of_medium(scene, id),
        Medium::Heterogeneous(medium) => {
            let samples = medium.bricks().samples().as_vec3();
            let to_render = medium.to_samples().inverse();
            let sides = [Vec3::X, Vec3::Y, Vec3::Z]
                .map(|axis| to_render.transform_vector3(axis * samples.dot(axis)));
            let sides = sides.map(Vec3::length);
            sides.into_iter().fold(f32::INFINITY, f32::min)
        }
    };
    medium.free_path() >= LEAST_FREE_PATH * radius && size >= LEAST_SIZE * radius
}

/// The shortest side of the smallest object that the medium fills; infinite where it is around everything.
fn size_of_medium(scene: &Scene, id: usize) -> f32 {
    let id = Some(id as u16);
    let sides = scene.objects().iter().filter_map(|object| {
        let boundary = object.boundary?;
        (boundary.interior == id).then(|| {
            let (min, max) = bounds(&object.shape);
            (max - min).min_element()
        })
    });
    sides.fold(f32::INFINITY, f32::min)
}
