//! The plan: which stages this scene needs, made once, with the reason for each.

use crate::bsdf::{Material, Tilt};
use crate::crossing::LightMedium;
use crate::estimators::Estimators;
use crate::footprint::Footprint;
use crate::geometry::{Geometry, Object, SurfaceHit, bounds, clearance};
use crate::job::{Budget, JobSettings, ScheduleKind};
use crate::layer::Layer;
use crate::light::{EmissionSample, Light, LightKind, LightSelector, LightSources, SceneBounds};
use crate::math::{Ray, Rgb, Vec3};
use crate::medium::{Medium, MediumId};
use crate::parts::{LayerPlan, NoSuchGroup};
use crate::sampler::Sampler;
use crate::scene::SceneDescription;
use crate::target::Targets;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// A scene made ready for rays: acceleration structures built, media around the camera and the lights found.
#[derive(Debug)]
pub struct Scene {
    description: SceneDescription,
    pub(crate) geometry: Geometry,
    pub(crate) selector: LightSelector,
    /// By what shadow rays do not see, where that is lights: the others.
    pub(crate) selectors: BTreeMap<u32, LightSelector>,
    /// The lights whose photons rules let leave something, where those are not all.
    pub(crate) emitters: Option<LightSelector>,
    /// The lights as those who choose among them see them.
    pub(crate) light_sources: LightSources,
    /// Medium that camera rays start in.
    pub(crate) camera_medium: MediumId,
    /// By light: medium that photons start in.
    pub(crate) light_media: Vec<LightMedium>,
    /// By light: the object that shadow rays to it pass through, because it cannot hide itself.
    pub(crate) unshadowing: Vec<Option<u32>>,
    /// Indices of the environment lights.
    pub(crate) environments: Vec<usize>,
    /// By object: rays may pass straight through it.
    pub(crate) passable: Vec<bool>,
    /// By object: diagonal of its box, scene units.
    pub(crate) extents: Vec<f32>,
    /// By medium: the shortest mean free path of all channels, scene units.
    pub(crate) free_paths: Vec<f32>,
    /// Whether shadow rays have to look at what they pass: boundaries of media, or surfaces that are not opaque.
    pub(crate) shadow_rays_walk: bool,
    /// There are surfaces that are nothing but boundaries of media.
    pub(crate) has_boundaries: bool,
}

impl Scene {
    /// Build the acceleration structures. Deterministic.
    pub fn new(description: SceneDescription) -> Self {
        let geometry = Geometry::new(&description.objects);
        let selector = LightSelector::new(
            &description.lights,
            &description.objects,
            &description.bounds,
        );
        let (selectors, emitters) = (selectors(&description), emitters(&description));
        let material = |o: &Object| &description.materials[o.material as usize];
        let passable: Vec<bool> = description
            .objects
            .iter()
            .map(|o| material(o).may_be_passed())
            .collect();
        let has_boundaries = description.objects.iter().any(|o| material(o).is_null());
        let mut materials = description.objects.iter().map(material);
        let shadow_rays_walk = materials.any(|m| m.opacity.is_some())
            || (has_boundaries && !description.media.is_empty());
        let unshadowing = |light: &Light| match light.kind {
            LightKind::Area { object, .. } => description.objects[object as usize]
                .shape
                .never_shadows_itself()
                .then_some(object),
            _ => None,
        };
        let is_environment = |light: &Light| matches!(light.kind, LightKind::Environment(_));
        let light_sources = LightSources::new(
            &description.lights,
            &description.objects,
            &description.bounds,
        );
        let mut scene = Self {
            geometry,
            selector,
            selectors,
            emitters,
            light_sources,
            camera_medium: None,
            light_media: Vec::new(),
            unshadowing: description.lights.iter().map(unshadowing).collect(),
            environments: (0..description.lights.len())
                .filter(|&i| is_environment(&description.lights[i]))
                .collect(),
            passable,
            extents: description
                .objects
                .iter()
                .map(|object| {
                    let (min, max) = bounds(&object.shape);
                    (max - min).length()
                })
                .collect(),
            free_paths: description.media.iter().map(Medium::free_path).collect(),
            shadow_rays_walk,
            has_boundaries,
            description,
        };
        scene.camera_medium = match scene.description.camera_medium {
            Some(named) => named,
            None => {
                let hidden = scene.description.rules.as_ref().map(|rules| rules.camera);
                scene.medium_seen(scene.description.camera.position, hidden)
            }
        };
        scene.light_media = (0..scene.lights().len())
            .map(|i| scene.find_light_medium(i))
            .collect();
        scene
    }

    /// What was read.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    pub(crate) fn objects(&self) -> &[Object] {
        &self.description.objects
    }
    pub(crate) fn lights(&self) -> &[Light] {
        &self.description.lights
    }
    pub(crate) fn media(&self) -> &[Medium] {
        &self.description.media
    }
    pub(crate) fn bounds(&self) -> &SceneBounds {
        &self.description.bounds
    }
    pub(crate) fn material(&self, hit: &SurfaceHit) -> &Material {
        self.material_of(hit.object)
    }
    /// What an object is made of.
    pub(crate) fn material_of(&self, object: u32) -> &Material {
        &self.description.materials[self.objects()[object as usize].material as usize]
    }
    /// Whether an object is the boundary of a medium at most.
    pub(crate) fn is_null(&self, object: u32) -> bool {
        self.material_of(object).is_null()
    }
    /// Whether the medium is the same on both sides of an object.
    pub(crate) fn bounds_nothing(&self, object: u32) -> bool {
        let boundary = self.objects()[object as usize].boundary;
        boundary.is_none_or(|b| b.interior == b.exterior)
    }
    /// Gives the hit the shading normal of its material's relief, if it has one, seen from `wo`.
    #[inline]
    pub(crate) fn tilt(&self, hit: &mut SurfaceHit, wo: Vec3) -> Option<Tilt> {
        let relief = self.material(hit).relief.as_ref()?;
        let shape = &self.objects()[hit.object as usize].shape;
        let (ns, tilt) = relief.normal(hit, shape.tangents(hit), wo);
        hit.ns = ns;
        Some(tilt)
    }
    /// Whether the direct light of this light is all counted by sampling it: rays may pass its surface unseen.
    pub(crate) fn only_sampled(&self, light: usize) -> bool {
        match self.lights()[light].kind {
            LightKind::Area { object, .. } => self.passable[object as usize],
            _ => false,
        }
    }
    /// How far to move a point on a light off its surface.
    pub(crate) fn clearance(&self, point: Vec3) -> f32 {
        clearance(point.abs().max_element() + self.bounds().radius)
    }

    /// Where a photon starts, off the surface that emits it.
    #[inline]
    pub(crate) fn start_of(&self, emission: &EmissionSample) -> Vec3 {
        match emission.normal {
            Some(n) => emission.origin + n * self.clearance(emission.origin),
            None => emission.origin,
        }
    }

    /// Transmittance of a medium along a ray over a distance.
    #[inline]
    pub(crate) fn transmittance(
        &self,
        medium: MediumId,
        ray: &Ray,
        distance: f32,
        sampler: &mut Sampler,
    ) -> Rgb {
        match medium {
            Some(id) => self.media()[id as usize].transmittance(ray, distance, sampler),
            None => Rgb::ONE,
        }
    }

    /// Radiance emitted at a hit against the direction of the ray that made it.
    #[inline]
    pub(crate) fn emitted(&self, hit: &SurfaceHit, dir: Vec3) -> Rgb {
        match self.objects()[hit.object as usize].light {
            Some(light) => self.lights()[light as usize].radiance_area(-hit.ng.dot(dir)),
            None => Rgb::ZERO,
        }
    }

    /// Radiance of one environment light from the direction `dir`.
    pub(crate) fn environment(&self, light: usize, dir: Vec3) -> Rgb {
        match &self.lights()[light].kind {
            LightKind::Environment(environment) => environment.radiance(dir),
            _ => Rgb::ZERO,
        }
    }
}

/// For each set of lights that shadow rays do not see: the others.
fn selectors(description: &SceneDescription) -> BTreeMap<u32, LightSelector> {
    let mut selectors = BTreeMap::new();
    let Some(rules) = &description.rules else {
        return selectors;
    };
    for sets in &rules.of_object {
        let sees = |light: usize| !rules.hides_light(sets.shadow, light);
        if (0..description.lights.len()).all(sees) {
            continue;
        }
        selectors.entry(sets.shadow.row).or_insert_with(|| {
            LightSelector::of_some(
                &description.lights,
                &description.objects,
                &description.bounds,
                sees,
            )
        });
    }
    selectors
}

/// The lights whose photons leave something somewhere, unless all may.
fn emitters(description: &SceneDescription) -> Option<LightSelector> {
    let rules = description.rules.as_ref()?;
    let objects = description.objects.iter().zip(&rules.of_object);
    let surfaces = objects.filter(|(object, _)| {
        let material = &description.materials[object.material as usize];
        !material.is_specular()
    });
    let media = description.media.iter().zip(&rules.of_medium);
    let media = media.filter(|(medium, _)| medium.scatters());
    let mut sets: Vec<_> = surfaces.map(|(_, sets)| sets.photon).collect();
    sets.extend(media.map(|(_, set)| *set));
    sets.sort_unstable_by_key(|set| set.row);
    sets.dedup();
    let matters = |light: usize| !sets.iter().all(|set| rules.hides_light(*set, light));
    if (0..description.lights.len()).all(matters) {
        return None;
    }
    Some(LightSelector::of_some(
        &description.lights,
        &description.objects,
        &description.bounds,
        matters,
    ))
}

/// From footprints to kernel radii, before the pass's scale.
#[derive(Clone, Copy, Debug)]
pub struct KernelRadii {
    /// Smallest base radius, scene units.
    pub floor: f32,
    /// Largest base radius of light that has been through specular surfaces only, scene units.
    pub ceiling: f32,
    /// Largest base radius of light that has been scattered, scene units.
    pub smooth_ceiling: f32,
}

/// Kernel radius over footprint radius: kernels of neighbouring photons overlap, those of surfaces by more, because they
/// average over fewer photons, and by yet more where light that has been scattered leaves little to blur.
const BEAM_OVERLAP: f32 = 1.5;
const SURFACE_OVERLAP: f32 = 3.0;
const SMOOTH_SURFACE_OVERLAP: f32 = 7.5;
/// Floor and ceilings of base radii as fractions of the radius of the scene, or of the part that the camera sees.
const FLOOR: f32 = 5e-4;
const CEILING: f32 = 1.6e-2;
const SMOOTH_CEILING: f32 = 4e-2;

impl KernelRadii {
    /// The base radius of a beam for its footprint.
    #[inline]
    pub fn beam(&self, footprint: &Footprint) -> f32 {
        self.bounded(footprint, footprint.radius() * BEAM_OVERLAP)
    }

    /// The base radius of a surface photon for its footprint. `share`: of that footprint's radius, when there are more surface
    /// photons than beams.
    #[inline]
    pub fn surface(&self, footprint: &Footprint, share: f32) -> f32 {
        let overlap = if footprint.is_smooth() {
            SMOOTH_SURFACE_OVERLAP
        } else {
            SURFACE_OVERLAP
        };
        self.bounded(footprint, footprint.radius() * share * overlap)
    }

    fn bounded(&self, footprint: &Footprint, radius: f32) -> f32 {
        let ceiling = if footprint.is_smooth() {
            self.smooth_ceiling
        } else {
            self.ceiling
        };
        radius.clamp(self.floor, ceiling)
    }
}

/// Pixels for each photon path that leaves surface photons, where paths for beams are fewer.
const PIXELS_PER_SURFACE_PATH: u64 = 4;
/// Most of those paths for each one that leaves beams.
const MAX_SURFACE_PATHS: u32 = 8;

/// Four gather rays: more cost more than the noise that they take away, where pixels are many for each photon path.
const GLOSS_RAYS_SIDE: u32 = 2;

/// What every pass of a job does. `Display` is what `beamfarm explain` prints.
#[derive(Clone, Debug)]
pub struct RenderPlan {
    /// The job.
    pub settings: JobSettings,
    /// Beams are left and gathered: in media whose light they bring, and of caustics.
    pub beams: bool,
    /// Surface photons are stored: of caustics, and of what such media send to surfaces.
    pub surface_photons: bool,
    /// Which light photons bring, and which camera paths find.
    pub estimators: Estimators,
    /// The lights that photons start at, where that is not all of them.
    pub emitters: Option<LightSelector>,
    /// Gather rays that gloss sends, at the surface that camera paths meet first: in a square, so many along each side.
    pub gloss_rays_side: u32,
    /// Photon paths that leave surface photons; the first of them, as many as the settings say, leave beams as well.
    pub surface_paths: u32,
    /// Kernel radii.
    pub radii: KernelRadii,
    /// Of what radius they are fractions, where that is not the scene's; scene units.
    extent_seen: Option<f32>,
    /// What photons are aimed at, if they are.
    pub targets: Option<Arc<Targets>>,
    /// What is rendered beside the beauty.
    pub layers: LayerPlan,
    explanation: Vec<(&'static str, bool, String)>,
}

impl RenderPlan {
    /// Decide the stages.
    pub fn new(scene: &Scene, settings: JobSettings) -> Self {
        let description = scene.description();
        let used = |test: &dyn Fn(&Material) -> bool| {
            let objects = description.objects.iter();
            objects
                .filter(|o| test(&description.materials[o.material as usize]))
                .count()
        };
        let scattering = description.media.iter().filter(|m| m.scatters()).count();
        let specular =
            used(&|m| m.has_delta() && !m.is_null() || m.is_followed() || m.has_narrow_lobe());
        let surfaces = used(&|m| !m.is_specular());
        let boundaries = used(&|m| m.is_null());
        let cut_out = used(&|m| m.opacity.is_some());
        let lit = !description.lights.is_empty();
        let fixed = description.defaults.radius;
        let extent_seen = crate::extent::of_radii(scene);
        let extent = extent_seen.unwrap_or(description.bounds.radius);
        let extent_seen = extent_seen.filter(|_| fixed.is_none());
        let radii = match fixed {
            Some(radius) => KernelRadii {
                floor: radius,
                ceiling: radius,
                smooth_ceiling: radius,
            },
            None => KernelRadii {
                floor: extent * FLOOR,
                ceiling: extent * CEILING,
                smooth_ceiling: extent * SMOOTH_CEILING,
            },
        };
        let mut estimators = Estimators::new(scene, &radii, extent);
        let mode = description.defaults.targeting;
        let prepare =
            |estimators: &Estimators| Targets::prepare(scene, estimators, settings.seed, mode);
        let mut found = None;
        if !estimators.deep && surfaces > 0 && lit {
            let deeper = estimators.deepened();
            if let (Some(targets), told) = prepare(&deeper)
                && targets.outdo_paths(mode)
            {
                found = Some((Some(targets), told));
                estimators = deeper;
            }
        }
        let by_beams = estimators.beams.iter().filter(|beams| **beams).count();
        let caustics = estimators.caustics && lit;
        let beams = lit && (by_beams > 0 || caustics && scattering > 0);
        let rules = description.rules.as_ref();
        let ruled = estimators.ends_at_second;
        let surface_photons = surfaces > 0 && lit && (estimators.deep || caustics);
        let (targets, on_targets) = match (found, beams || surface_photons) {
            (Some(found), _) => found,
            (None, true) => prepare(&estimators),
            (None, false) => (None, "no photon paths".into()),
        };
        let emitters = (!estimators.deep && estimators.is_met.contains(&true)).then(|| {
            LightSelector::of_some(
                &description.lights,
                &description.objects,
                &description.bounds,
                |light| !estimators.is_met[light],
            )
        });
        // Beams cost more than photons: where there are both, more paths leave photons alone, up to about one for a few
        // pixels.
        let paths = settings.paths_per_pass;
        let surface_paths = if beams && surface_photons {
            let camera = &description.camera;
            let pixels = u64::from(camera.width) * u64::from(camera.height);
            let enough = (pixels / PIXELS_PER_SURFACE_PATH).min(u64::from(u32::MAX)) as u32;
            enough.clamp(paths, paths.saturating_mul(MAX_SURFACE_PATHS))
        } else {
            paths
        };
        let lit_or = |otherwise| if lit { otherwise } else { "no light" };
        let because = |yes: bool, if_yes: String, if_no: &str| {
            if yes { if_yes } else { if_no.to_owned() }
        };
        let lens = description.camera.aperture > 0.0;
        let mut tracked = Vec::new();
        for medium in &description.media {
            if let Medium::Heterogeneous(medium) = medium {
                let [x, y, z] = medium.bricks().samples().to_array();
                tracked.push(format!(
                    "{} in a box of {x} x {y} x {z} samples",
                    medium.estimator
                ));
            }
        }
        let is_sampled = |m: &&Medium| matches!(m, Medium::Homogeneous(_)) && m.scatters();
        let sampled_fog = description.media.iter().zip(&estimators.beams);
        let sampled_fog = sampled_fog
            .filter(|(m, beams)| **beams && is_sampled(m))
            .count();
        let closed = description.media.len() - tracked.len();
        let explanation = vec![
            (
                "photon paths",
                beams || surface_photons,
                because(
                    beams || surface_photons,
                    format!(
                        "{} a pass from {} light(s)",
                        settings.paths_per_pass,
                        description.lights.len()
                    ),
                    "no light, or nothing that it could reach",
                ),
            ),
            ("photon targeting", targets.is_some(), on_targets),
            (
                "photon beams",
                beams,
                because(
                    beams,
                    format!(
                        "all light of {by_beams} scattering medium/media, caustics in {}",
                        scattering - by_beams
                    ),
                    lit_or(match scattering {
                        0 => "no medium scatters light",
                        _ => "media are dense or small: camera paths are scattered in them",
                    }),
                ),
            ),
            (
                "unscattered light in fog, sampled",
                sampled_fog > 0 && lit,
                because(
                    sampled_fog > 0 && lit,
                    format!("{sampled_fog} homogeneous scattering medium/media: no beams for it"),
                    lit_or("beams bring the light of no homogeneous medium"),
                ),
            ),
            (
                "transmittance in closed form",
                closed > 0,
                because(
                    closed > 0,
                    format!("{closed} homogeneous medium/media"),
                    "no homogeneous medium",
                ),
            ),
            (
                "transmittance by random walks",
                !tracked.is_empty(),
                because(
                    !tracked.is_empty(),
                    tracked.join("; "),
                    "no heterogeneous medium",
                ),
            ),
            (
                "boundary walk of shadow rays",
                scene.shadow_rays_walk,
                because(
                    scene.shadow_rays_walk,
                    match cut_out {
                        0 => format!("{boundaries} index-matched boundary/boundaries of media"),
                        _ => format!(
                            "{boundaries} index-matched boundary/boundaries of media, {cut_out} object(s) that are not opaque"
                        ),
                    },
                    "no index-matched boundary between media, everything else is opaque",
                ),
            ),
            (
                "surface photons",
                surface_photons,
                because(
                    surface_photons,
                    format!(
                        "on {surfaces} object(s) that are not specular, {surface_paths} paths a pass: {}light scattered by {by_beams} medium/media",
                        match caustics {
                            true => format!("caustics of {specular} specular object(s), "),
                            false => String::new(),
                        }
                    ),
                    lit_or(
                        "no caustics and no light that beams bring: camera paths find everything",
                    ),
                ),
            ),
            (
                "photons behind the second surface",
                ruled && surface_photons,
                match ruled {
                    true => {
                        "rules tell what photons see: camera paths end at the second surface".into()
                    }
                    false => "camera paths go on from surface to surface".into(),
                },
            ),
            (
                "direct light",
                surfaces > 0 && lit,
                because(
                    surfaces > 0 && lit,
                    "light and BSDF sampling, balanced".into(),
                    lit_or("no surface to light directly"),
                ),
            ),
            (
                "visibility rules",
                rules.is_some(),
                match rules {
                    Some(rules) => format!(
                        "{} rule(s) in {} bytes of sets{}",
                        rules.rules,
                        rules.bytes(),
                        if ruled { ", photons obey them" } else { "" }
                    ),
                    None => "no rule with an effect: every ray sees everything".into(),
                },
            ),
            (
                "thin lens",
                lens,
                because(
                    lens,
                    format!("aperture {}", description.camera.aperture),
                    "aperture 0: a pinhole",
                ),
            ),
        ];
        Self {
            settings,
            beams,
            surface_photons,
            estimators,
            emitters,
            gloss_rays_side: GLOSS_RAYS_SIDE,
            surface_paths,
            radii,
            extent_seen,
            targets: targets.map(Arc::new),
            layers: LayerPlan::default(),
            explanation,
        }
    }

    /// Render these layers as well. The beauty stays the same to the last bit.
    pub fn with_layers(mut self, scene: &Scene, layers: &[Layer]) -> Result<Self, NoSuchGroup> {
        self.layers = LayerPlan::new(scene, layers)?;
        self.explanation.push((
            "layers",
            !layers.is_empty(),
            match layers.is_empty() {
                true => "none asked for".into(),
                false => layers
                    .iter()
                    .map(Layer::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            },
        ));
        Ok(self)
    }
}

impl fmt::Display for RenderPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (stage, is_in, why) in &self.explanation {
            let sign = if *is_in { "in " } else { "out" };
            writeln!(f, "{sign}  {stage:<30} {why}")?;
        }
        let schedule = match self.settings.schedule {
            ScheduleKind::Pass => "once a pass",
            ScheduleKind::Beam => "once a beam",
        };
        let alpha = self.settings.alpha;
        match self.settings.budget {
            None => writeln!(
                f,
                "     radius scale: alpha {alpha:.4}, shrinking {schedule}"
            )?,
            Some(Budget { passes, scale }) => writeln!(
                f,
                "     radius scale: {scale:.4} for {passes} passes; beyond them alpha {alpha:.4}"
            )?,
        }
        write!(
            f,
            "     base radii: {:.3e} to {:.3e} scene units",
            self.radii.floor, self.radii.smooth_ceiling
        )?;
        match self.extent_seen {
            Some(radius) => writeln!(f, ", by the part that the camera sees: radius {radius:.3}"),
            None => writeln!(f),
        }
    }
}
