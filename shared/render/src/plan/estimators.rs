//! Which estimator counts which light path, as far as this depends on the scene. For the table, see
//! [`crate::cpu::transport`].

use crate::math::{Ray, Rgb, Vec2, Vec3};
use crate::plan::kernel::KernelRadii;
use crate::warp::uniform_sphere;
use crate::world::Scene;
use crate::world::bsdf::{Bsdf, BsdfFlags, Material};
use crate::world::geometry::SurfaceHit;
use crate::world::light::environment::MOST_UNEVEN;
use crate::world::light::{Light, LightKind};
use crate::world::medium::Medium;
use beamfarm_image::job::{Technique, Techniques};

/// What brings the light that a medium scatters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MediumLight {
    /// Photon beams bring all of it.
    Beams,
    /// Camera paths, which are scattered themselves; beams bring only caustics. Also for media that do not scatter.
    Paths,
}

/// What finds a light's caustics: its light that comes by way of specular surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caustics {
    /// Photons.
    Photons,
    /// Photons and camera paths, balanced: camera paths meet the light now and then.
    Shared,
    /// Camera paths: the light is all around, so they meet it behind specular surfaces as well.
    Paths,
}

/// Where photons end camera paths, by bringing everything there that is not direct light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnds {
    /// Nowhere: camera paths go on from surface to surface.
    Never,
    /// At a surface beyond the first, far enough from it, that has no narrow lobe.
    FarEnough,
    /// At the second surface, whatever it is: rules restrict what photons see, and camera paths do not obey them.
    Second,
    /// At the first surface that has no narrow lobe.
    First,
}

/// What finds the light that comes by way of surfaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SurfaceLight {
    /// Camera paths; photons end at the first surface that is not specular. Holds, by light, what finds its caustics.
    Paths(Vec<Caustics>),
    /// Photons go on from surface to surface, for the beams that they leave or because caustics need them anyway.
    /// Photons alone find what comes by way of specular surfaces.
    Photons(PathEnds),
}

/// The estimators, chosen once for a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimators {
    /// By medium. Where beams bring all of a medium's light, photons go on.
    pub media: Vec<MediumLight>,
    /// For surfaces.
    pub surfaces: SurfaceLight,
    /// There is a light, and some surface is specular or has a lobe that is followed.
    pub specular: bool,
    /// Some photons may come from a light that no camera path meets, by way of followed lobes.
    pub unmet_caustics: bool,
}

/// Size of a surface that counts as far away, in radii of the visible part.
const FAR: f32 = 6.0;
/// Points along a side of the picture from which to look for emissive surfaces, and directions from each point.
const LOOKS: Looks = Looks {
    side: 4,
    directions: 512,
};
/// Fewer of both, for a quick plan.
const FEW_LOOKS: Looks = Looks {
    side: 2,
    directions: 128,
};

#[derive(Clone, Copy)]
struct Looks {
    side: usize,
    directions: usize,
}

/// Lights that camera paths meet less often would make fireflies behind specular surfaces: their light comes in drops
/// of one over this.
const LEAST_MET: f32 = 1.0 / 512.0;

/// Least free path and size of a medium whose light beams bring, in kernel radii. In other media, kernels would be
/// wider than what they blur.
const LEAST_FREE_PATH: f32 = 6.0;
const LEAST_SIZE: f32 = 12.0;

impl Estimators {
    /// Chosen by the scene's content, the kernels' width, the radius of the visible part, and the techniques that are
    /// set.
    pub fn new(scene: &Scene, radii: &KernelRadii, extent: f32, techniques: Techniques) -> Self {
        Self::by_looks(scene, radii, extent, techniques, LOOKS)
    }

    /// As [`Self::new`], but rougher about which lights are met, where that is hard to tell.
    pub(crate) fn roughly(scene: &Scene, radii: &KernelRadii, extent: f32, techniques: Techniques) -> Self {
        Self::by_looks(scene, radii, extent, techniques, FEW_LOOKS)
    }

    fn by_looks(scene: &Scene, radii: &KernelRadii, extent: f32, techniques: Techniques, looks: Looks) -> Self {
        let description = scene.description();
        let rules = description.rules.as_ref();
        let ends_at_second = ends_at_second(scene);
        let is_used = |test: &dyn Fn(&Material) -> bool| {
            let mut objects = description.objects.iter();
            objects.any(|o| test(&description.materials[o.material as usize]))
        };
        let least = |least| lights_often_met(scene, least, looks);
        let all = description.lights.len();
        let (met, shared) = match techniques.caustics {
            Some(Technique::Photons) => (vec![false; all], None),
            Some(Technique::Paths) => (least(LEAST_MET), None),
            // Rules say what sees what.
            None if rules.is_some() => (least(1.0 / MOST_UNEVEN), None),
            None => (least(1.0 / MOST_UNEVEN), Some(least(LEAST_MET))),
        };
        let caustics = met.into_iter().enumerate().map(|(light, met)| match &shared {
            _ if met => Caustics::Paths,
            Some(shared) if shared[light] => Caustics::Shared,
            _ => Caustics::Photons,
        });
        let caustics: Vec<Caustics> = caustics.collect();
        // Hardly any photon of a distant surface that surrounds the scene reaches the visible part.
        let is_far = |light: &Light| {
            let object = light.kind.object();
            object.is_some_and(|object| scene.extents[object as usize] > FAR * extent)
        };
        let mut lights = description.lights.iter().zip(&caustics);
        let sends_photons = lights.any(|(light, found)| *found != Caustics::Paths || !is_far(light));
        let media: Vec<MediumLight> = (0..description.media.len())
            .map(|id| {
                let suits = || match techniques.media {
                    _ if scene.is_enclosed(id as u16) => false,
                    Some(technique) => technique == Technique::Photons,
                    None => sends_photons && widest_kernel_in(scene, id) >= radii.smooth_ceiling,
                };
                match description.media[id].scatters() && (ends_at_second || suits()) {
                    true => MediumLight::Beams,
                    false => MediumLight::Paths,
                }
            })
            .collect();
        let any_beams = media.contains(&MediumLight::Beams);
        let followed = is_used(&|m| m.has(BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE));
        let specular = followed || is_used(&Material::turns_paths);
        // Photons traced for the caustics of all lights bring more light at hardly any cost.
        let are_by_photons = || !caustics.is_empty() && caustics.iter().all(|found| *found == Caustics::Photons);
        let ends = match techniques.surfaces {
            Some(technique) => technique == Technique::Photons,
            None => any_beams || specular && are_by_photons(),
        };
        let unmet = |light: &Light| light.kind.is_unmet();
        Self {
            media,
            specular: specular && !caustics.is_empty(),
            unmet_caustics: followed && description.lights.iter().any(unmet),
            surfaces: match (ends_at_second, ends, any_beams) {
                (true, ..) => SurfaceLight::Photons(PathEnds::Second),
                (false, true, _) => SurfaceLight::Photons(PathEnds::FarEnough),
                (false, false, true) => SurfaceLight::Photons(PathEnds::Never),
                (false, false, false) => SurfaceLight::Paths(caustics),
            },
        }
    }

    /// The same estimators, with photon paths that go on from surface to surface.
    pub fn deepened(&self) -> Self {
        Self {
            surfaces: SurfaceLight::Photons(PathEnds::FarEnough),
            ..self.clone()
        }
    }

    /// Whether photon paths go on from surface to surface.
    pub fn photons_go_on(&self) -> bool {
        matches!(self.surfaces, SurfaceLight::Photons(_))
    }

    /// Where photons end camera paths.
    pub fn ends(&self) -> PathEnds {
        match self.surfaces {
            SurfaceLight::Paths(_) => PathEnds::Never,
            SurfaceLight::Photons(ends) => ends,
        }
    }

    /// What finds a light's caustics.
    #[inline]
    pub fn caustics_of(&self, light: usize) -> Caustics {
        match &self.surfaces {
            SurfaceLight::Paths(caustics) => caustics[light],
            SurfaceLight::Photons(_) => Caustics::Photons,
        }
    }

    /// Number of lights whose caustics are found this way.
    pub fn count(&self, found: Caustics) -> usize {
        match &self.surfaces {
            SurfaceLight::Paths(caustics) => caustics.iter().filter(|of_light| **of_light == found).count(),
            SurfaceLight::Photons(_) => 0,
        }
    }

    /// Whether photons of some light may arrive by way of specular surfaces or followed lobes.
    pub fn has_caustics(&self) -> bool {
        let brought = match &self.surfaces {
            SurfaceLight::Paths(caustics) => caustics.iter().any(|found| *found != Caustics::Paths),
            SurfaceLight::Photons(_) => true,
        };
        self.specular && brought
    }

    /// Whether photons of a light are useful.
    pub fn brings_photons(&self, light: usize) -> bool {
        self.caustics_of(light) != Caustics::Paths
    }

    /// Whether beams bring all the light of a medium.
    #[inline]
    pub fn is_by_beams(&self, medium: u16) -> bool {
        self.media[usize::from(medium)] == MediumLight::Beams
    }

    /// Whether beams bring all the light of some medium.
    pub fn any_beams(&self) -> bool {
        self.media.contains(&MediumLight::Beams)
    }

    /// Whether beams bring some light to media that scatter camera paths: caustics, or what other media scatter.
    pub fn leave_beams(&self) -> bool {
        self.has_caustics() || self.any_beams()
    }

    /// Whether photons may end camera paths at a surface like this one: narrow lobes see few photons.
    #[inline]
    pub fn ends_paths(&self, bsdf: &Bsdf) -> bool {
        match self.ends() {
            PathEnds::Never => false,
            PathEnds::FarEnough | PathEnds::First => !bsdf.has(BsdfFlags::GLOSSY),
            PathEnds::Second => true,
        }
    }
}

/// By light: whether a path that goes on by chance meets it with at least this probability, wherever the path is.
fn lights_often_met(scene: &Scene, least: f32, looks: Looks) -> Vec<bool> {
    let Looks { side, directions } = looks;
    let camera = &scene.description().camera;
    let objects = scene.objects();
    let met_by =
        |ray: &Ray, hides: &dyn Fn(u32) -> bool| (scene.geometry).intersect(objects, ray, f32::INFINITY, hides);
    // What the camera sees that is no light, and the camera itself.
    let mut points = vec![camera.position];
    for ray in camera.rays_over_image(side) {
        let hit = met_by(&ray, &|o| objects[o as usize].light.is_some());
        points.extend(hit.map(|hit| hit.point));
    }
    let sees = |light: usize, object: u32| {
        let rays = points.iter().flat_map(|&origin| {
            (0..directions).map(move |i| {
                // Fibonacci's lattice.
                let turns = i as f32 * 0.618_034;
                let u = Vec2::new((i as f32 + 0.5) / directions as f32, turns.fract());
                let dir = uniform_sphere(u);
                Ray { origin, dir }
            })
        });
        let is_lit = |ray: &Ray| {
            let hit = met_by(ray, &|o| o != object);
            let faces = |hit: &SurfaceHit| {
                let light = &scene.lights()[light];
                light.has_pattern() && (light.is_two_sided() || hit.ng.dot(ray.dir) < 0.0)
                    || scene.emitted(hit, ray.dir, f32::INFINITY) != Rgb::ZERO
            };
            hit.is_some_and(|hit| faces(&hit))
        };
        rays.filter(is_lit).count()
    };
    let enough = (points.len() * directions) as f32 * least;
    // At most the solid angle of the ball around it.
    let is_large = |object: u32| {
        let (min, max) = scene.boxes[object as usize];
        let (center, radius) = (0.5 * (min + max), 0.5 * (max - min).length());
        let share = |point: &Vec3| {
            let sin = (radius / point.distance(center)).min(1.0);
            0.5 * (1.0 - (1.0 - sin * sin).sqrt())
        };
        points.iter().map(share).sum::<f32>() * directions as f32 >= enough
    };
    let is_met = |(light, kind): (usize, &LightKind)| match kind {
        LightKind::Environment(environment) => environment.unevenness() * least <= 1.0,
        LightKind::Area { object, .. } => {
            !scene.only_sampled(light)
                && !scene.is_interrupted()
                && is_large(*object)
                && sees(light, *object) as f32 >= enough
        }
        LightKind::Point { .. }
        | LightKind::Spot(_)
        | LightKind::Projector(_)
        | LightKind::Goniometric(_)
        | LightKind::Laser(_)
        | LightKind::Directional(_)
        | LightKind::Volume(_) => false,
    };
    let lights = scene.lights().iter().map(|light| &light.kind);
    lights.enumerate().map(is_met).collect()
}

/// Whether camera paths must end at the second surface: rules restrict what photons see, and the paths do not obey
/// them.
fn ends_at_second(scene: &Scene) -> bool {
    let rules = scene.description().rules.as_ref();
    rules.is_some_and(|rules| rules.touches_photons && !rules.paths_obey)
}

/// Kernels up to this radius are narrow compared with every scattering medium, and with the light's free path in it;
/// scene units. Beams are of no use in media that light enters only through diffuse surfaces.
pub fn widest_kernel(scene: &Scene) -> f32 {
    let media = scene.media().iter().enumerate();
    let beams_serve = |id: usize| !scene.is_enclosed(id as u16) || ends_at_second(scene);
    let scattering = media.filter(|(id, medium)| medium.scatters() && beams_serve(*id));
    let widest = scattering.map(|(id, _)| widest_kernel_in(scene, id));
    widest.fold(f32::INFINITY, f32::min)
}

/// As [`widest_kernel`], for one medium.
pub(super) fn widest_kernel_in(scene: &Scene, id: usize) -> f32 {
    let medium = &scene.media()[id];
    let size = match medium {
        Medium::Homogeneous(_) => size_of_medium(scene, id),
        Medium::Heterogeneous(medium) => {
            let samples = medium.bricks().samples().as_vec3();
            let to_render = medium.to_samples().inverse();
            let sides = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_render.transform_vector3(axis * samples.dot(axis)));
            let sides = sides.map(Vec3::length);
            sides.into_iter().fold(f32::INFINITY, f32::min)
        }
    };
    (medium.free_path() / LEAST_FREE_PATH).min(size / LEAST_SIZE)
}

/// The shortest side of the smallest object that the medium fills; infinite if the medium fills the surroundings.
fn size_of_medium(scene: &Scene, id: usize) -> f32 {
    let id = Some(id as u16);
    let sides = scene
        .objects()
        .iter()
        .zip(&scene.boxes)
        .filter_map(|(object, (min, max))| {
            let boundary = object.boundary?;
            (boundary.interior == id).then(|| (*max - *min).min_element())
        });
    sides.fold(f32::INFINITY, f32::min)
}
