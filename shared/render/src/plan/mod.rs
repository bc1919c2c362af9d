//! The plan: which stages a scene needs, decided once, with the reason for each.
//!
//! This module decides; `stages` words the reasons.

pub mod aov;
pub mod budget;
mod emitters;
pub mod engine;
pub mod estimators;
pub mod footprint;
pub mod frustum;
pub mod kernel;
pub mod pilot;
mod rare;
mod stages;
pub mod targeting;
mod thin;
pub mod weights;

use crate::plan::aov::{LayerPlan, NoSuchGroup};
use crate::plan::estimators::{Estimators, PathEnds, SurfaceLight, widest_kernel, widest_kernel_in};
use crate::plan::frustum::Frustum;
use crate::plan::kernel::{Extent, KernelRadii, WidestBeams};
use crate::plan::targeting::{Places, Targets};
use crate::world::bsdf::{BsdfFlags, Material};
use crate::world::camera::Camera;
use crate::world::light::LightSelector;
use crate::world::medium::Medium;
use crate::world::spectrum::{WAVES, WaveSet};
use crate::world::{Scene, SceneDescription};
use beamfarm_image::job::{Budget, JobSettings, ScheduleKind, Targeting, Technique, Techniques};
use beamfarm_image::layer::Layer;
use emitters::emitters;
use stages::Stage;
use std::fmt;
use std::sync::Arc;

/// Pixels per photon path that leaves surface photons, where fewer paths leave beams.
const PIXELS_PER_SURFACE_PATH: u64 = 4;
/// Most such paths for each one that leaves beams.
const MAX_SURFACE_PATHS: u32 = 8;

/// Four gather rays where photons end them at what they meet. With many pixels per photon path, more rays cost more
/// than the noise that they remove. Where paths go on, the first ray is not most of their work.
const GLOSS_RAYS_SIDE: u32 = 2;

const SPLITS: u32 = 8;

/// For provisional plans: the number of paths that ordinary kernels suit, the largest factor on kernels for fewer
/// paths, paths that leave surface photons for each one that leaves beams, splits, and the factor on the probability
/// that paths go on.
const ENOUGH_PATHS: f32 = 4_000.0;
const MOST_WIDER: f32 = 4.0;
const FEW_SURFACE_PATHS: u32 = 4;
const FEW_SPLITS: u32 = 2;
const LITTLE_PATIENCE: f32 = 0.5;

/// Whether photons alone obey rules, so that the picture is what they find.
fn photons_decide(scene: &Scene) -> bool {
    let rules = scene.description().rules.as_ref();
    rules.is_some_and(|rules| rules.touches_photons && !rules.paths_obey)
}

fn waves(scene: &Scene) -> u8 {
    if scene.disperses { WAVES } else { 0 }
}

/// What every pass of a job does. Its `Display` is what `beamfarm explain` prints.
#[derive(Clone, Debug)]
pub struct RenderPlan {
    /// The job.
    pub settings: JobSettings,
    /// Beams are left and gathered, in media whose light they bring and for caustics.
    pub beams: bool,
    /// Surface photons are stored, for caustics and for what such media send to surfaces.
    pub surface_photons: bool,
    /// Which light photons bring, and which camera paths find.
    pub estimators: Estimators,
    /// The lights that photons start from, unless the targets choose others.
    pub emitters: LightSelector,
    /// Gather rays sent by gloss at the surface that camera paths meet first: a square grid with this many along each
    /// side.
    pub gloss_rays_side: u32,
    /// Most splits of a camera path, over all its branches.
    pub splits: u32,
    /// Factor on the probability that paths go on from vertex to vertex.
    pub patience: f32,
    /// Photon paths that leave surface photons. The first of these, as many as the settings say, leave beams as well.
    pub surface_paths: u32,
    /// Photon paths start evenly: the noise of their average is lower than that of independent paths, to which the laws
    /// of convergence apply.
    pub is_even: bool,
    /// Kernel radii.
    pub radii: KernelRadii,
    /// By medium: its widest beams.
    pub widest_beams: Vec<WidestBeams>,
    /// The radius that kernel radii are fractions of, scene units.
    extent: f32,
    /// The same, if it is that of the visible part and not the scene's.
    extent_seen: Option<f32>,
    /// Hardly any photon of a light that matters comes near the visible part.
    has_rare_light: bool,
    /// Where camera paths find beams of media whose light these bring, if not everywhere.
    pub view: Option<Frustum>,
    /// What photons are aimed at, if they are aimed.
    pub targets: Option<Arc<Targets>>,
    /// Wavelengths of a pass, in scenes where some surface disperses light; otherwise 0.
    pub waves: u8,
    /// The layers besides the beauty.
    pub layers: LayerPlan,
    stages: Vec<Stage>,
}

impl RenderPlan {
    /// The wavelengths of a pass, if it has any.
    pub fn wave_set(&self, pass_index: u64) -> Option<WaveSet> {
        (self.waves > 0).then(|| WaveSet::of_pass(self.waves, self.settings.seed, pass_index))
    }

    /// Decide the stages.
    pub fn new(scene: &Scene, settings: JobSettings) -> Self {
        Self::by_places(scene, settings, &mut Places::default())
    }

    /// As [`Self::new`], for several plans of one scene. `places`: what earlier plans have found.
    fn by_places(scene: &Scene, settings: JobSettings, places: &mut Places) -> Self {
        let description = scene.description();
        let contents = Contents::of(description);
        let fixed = description.defaults.radius;
        let extent = Extent::of(scene);
        let radii = match fixed {
            Some(radius) => KernelRadii::fixed(radius),
            None => KernelRadii::of_extent(extent.radius),
        };
        let extent_seen = (extent.is_of_part && fixed.is_none()).then_some(extent.radius);
        let has_rare_light = rare::has_rare_light(scene, &extent);
        let mut techniques = settings.techniques;
        // A technique that a pilot tries is not set by the user: aimed photons do not go to what is mirrored.
        let may_aim = matches!(description.defaults.targeting, Targeting::On | Targeting::Reject);
        if has_rare_light && !may_aim && !photons_decide(scene) {
            techniques.surfaces = techniques.surfaces.or(Some(Technique::Paths));
            techniques.media = techniques.media.or(Some(Technique::Paths));
        }
        let estimators = Estimators::new(scene, &radii, extent.radius, techniques);
        let mut aim = |estimators: &Estimators| aim(scene, &settings, estimators, extent.radius, places);
        let goes_on = estimators.photons_go_on() || techniques.surfaces.is_some();
        let instead = match goes_on || contents.surfaces == 0 || !contents.lit {
            true => None,
            false => aimed_instead_of_paths(&estimators, targeting(scene, &settings), &mut aim),
        };
        let (estimators, aimed) = match instead {
            Some((estimators, aimed)) => (estimators, Some(aimed)),
            None => (estimators, None),
        };
        let beams = contents.leave_beams(&estimators);
        let surface_photons = contents.store_surface_photons(&estimators);
        let (targets, on_targets) = match (aimed, beams || surface_photons) {
            (Some(aimed), _) => aimed,
            (None, true) => aim(&estimators),
            (None, false) => (None, "no photon paths".into()),
        };
        let plan = Self {
            settings,
            beams,
            surface_photons,
            emitters: emitters(scene, &estimators, extent.radius),
            gloss_rays_side: match estimators.ends() {
                PathEnds::Never => 1,
                PathEnds::FarEnough | PathEnds::First | PathEnds::Second => GLOSS_RAYS_SIDE,
            },
            splits: SPLITS,
            patience: 1.0,
            surface_paths: match beams && surface_photons {
                true => surface_paths_beside_beams(&description.camera, settings.paths_per_pass),
                false => settings.paths_per_pass,
            },
            is_even: true,
            radii,
            widest_beams: widest_beams(scene, &settings, &estimators),
            estimators,
            extent: extent.radius,
            extent_seen,
            has_rare_light,
            view: Frustum::of(scene),
            targets: targets.map(Arc::new),
            waves: waves(scene),
            layers: LayerPlan::default(),
            stages: Vec::new(),
        };
        plan.with_stages(scene, &contents, on_targets)
    }

    /// A quick plan for pictures that are looked at only briefly; no pilot is run. It is meant for few paths and few
    /// pixels, whose noise would be worse than blur. So kernels are as wide as photons are few, and beams bring the
    /// light of all media, whatever the settings say.
    pub fn provisional(scene: &Scene, settings: JobSettings) -> Self {
        let description = scene.description();
        let contents = Contents::of(description);
        let techniques = Techniques {
            // Paths that scatter again and again take too long, and their light comes in drops.
            media: Some(Technique::Photons),
            ..settings.techniques
        };
        let extent = Extent::roughly_of(scene).radius;
        let ordinary = KernelRadii::of_extent(extent);
        let mut estimators = Estimators::roughly(scene, &ordinary, extent, techniques);
        let beams = contents.leave_beams(&estimators);
        let surface_photons = contents.store_surface_photons(&estimators);
        if estimators.ends() == PathEnds::FarEnough && surface_photons {
            estimators.surfaces = SurfaceLight::Photons(PathEnds::First);
        }
        let paths = settings.paths_per_pass;
        let wider = (ENOUGH_PATHS / paths as f32).sqrt().clamp(1.0, MOST_WIDER);
        // No wider than suits the media.
        let radii = ordinary
            .times(wider)
            .at_most(widest_kernel(scene).max(ordinary.smooth_ceiling));
        let plan = Self {
            settings: JobSettings {
                budget: None,
                // Kernels for these paths alone.
                reference_paths: paths,
                techniques,
                ..settings
            },
            beams,
            surface_photons,
            emitters: emitters(scene, &estimators, extent),
            gloss_rays_side: 1,
            splits: FEW_SPLITS,
            patience: LITTLE_PATIENCE,
            estimators,
            surface_paths: match beams && surface_photons {
                true => {
                    surface_paths_beside_beams(&description.camera, paths).min(paths.saturating_mul(FEW_SURFACE_PATHS))
                }
                false => paths,
            },
            is_even: true,
            radii,
            widest_beams: scene.media().iter().map(WidestBeams::within).collect(),
            extent,
            extent_seen: None,
            has_rare_light: false,
            view: Frustum::of(scene),
            targets: None,
            waves: waves(scene),
            layers: LayerPlan::default(),
            stages: Vec::new(),
        };
        plan.with_stages(scene, &contents, "the plan is provisional".into())
    }

    /// The plan of the same job for another moment of its exposure. A pass is right with any plan; sharing one costs
    /// least.
    #[must_use]
    pub fn at(&self, middle: &Scene, moment: &Scene) -> Self {
        if !middle.is_like(moment) {
            let mut plan = Self::new(moment, self.settings);
            plan.layers = LayerPlan::of(moment, &self.layers.layers);
            return plan;
        }
        Self {
            emitters: emitters(moment, &self.estimators, self.extent),
            view: Frustum::of(moment),
            ..self.clone()
        }
    }

    /// How many plain photons one photon is worth, if photons are aimed.
    fn gain(&self) -> Option<f64> {
        let targets = self.targets.as_deref()?;
        Some(targets.gain(self.emitters()).into())
    }

    fn with_stages(mut self, scene: &Scene, contents: &Contents, on_targets: String) -> Self {
        self.stages = stages::all(scene, &self, contents, on_targets);
        self
    }

    /// The lights that photons start from, with the share of each.
    pub fn emitters(&self) -> &LightSelector {
        let chosen = self.targets.as_deref().and_then(Targets::emitters);
        chosen.unwrap_or(&self.emitters)
    }

    /// Whether a pass needs photons.
    pub fn has_photons(&self) -> bool {
        self.beams || self.surface_photons
    }

    /// Whether photons must bring light of which hardly any comes near the visible part. Aimed photons go only to what
    /// is seen directly, not to what that mirrors.
    pub(crate) fn waits_for_rare_light(&self) -> bool {
        self.has_rare_light && (self.estimators.ends() != PathEnds::Never || self.estimators.any_beams())
    }

    /// Render these layers as well. The beauty stays the same to the last bit.
    pub fn with_layers(mut self, scene: &Scene, layers: &[Layer]) -> Result<Self, NoSuchGroup> {
        self.layers = LayerPlan::new(scene, layers)?;
        self.stages.push(stages::layers(layers));
        Ok(self)
    }
}

/// What decides about stages: numbers of media and objects in the scene.
struct Contents {
    /// Media that scatter.
    scattering: usize,
    /// Objects that cause caustics.
    specular: usize,
    /// Objects on which photons are visible.
    surfaces: usize,
    /// Objects that are only boundaries of media.
    boundaries: usize,
    /// Objects that are not opaque.
    cut_out: usize,
    /// There is a light.
    lit: bool,
}

impl Contents {
    fn of(description: &SceneDescription) -> Self {
        let used = |test: &dyn Fn(&Material) -> bool| {
            let objects = description.objects.iter();
            objects
                .filter(|o| test(&description.materials[o.material as usize]))
                .count()
        };
        Self {
            scattering: description.media.iter().filter(|m| m.scatters()).count(),
            specular: used(&Material::turns_paths),
            surfaces: used(&|m| !m.is_specular()),
            boundaries: used(&|m| m.is_null()),
            cut_out: used(&|m| m.has(BsdfFlags::PASSABLE) && !m.is_null()),
            lit: !description.lights.is_empty(),
        }
    }

    /// Whether light comes by way of specular surfaces for photons to bring.
    fn has_caustics(&self, estimators: &Estimators) -> bool {
        estimators.has_caustics() && self.lit
    }

    fn leave_beams(&self, estimators: &Estimators) -> bool {
        self.lit && (estimators.any_beams() || self.has_caustics(estimators) && self.scattering > 0)
    }

    fn store_surface_photons(&self, estimators: &Estimators) -> bool {
        self.surfaces > 0 && self.lit && (estimators.photons_go_on() || self.has_caustics(estimators))
    }
}

/// What photons are aimed at, if they are, and what to report about it.
type Aimed = (Option<Targets>, String);

/// Whether to aim photons: as a pilot found best, or as the scene says.
fn targeting(scene: &Scene, settings: &JobSettings) -> Targeting {
    match settings.techniques.aimed {
        Some(true) => Targeting::On,
        Some(false) => Targeting::Off,
        None => scene.description().defaults.targeting,
    }
}

/// Media whose beams would be too wide, but which the settings assign to beams, get narrow ones. Surfaces and other
/// media keep theirs.
fn widest_beams(scene: &Scene, settings: &JobSettings, estimators: &Estimators) -> Vec<WidestBeams> {
    let is_said =
        settings.techniques.media == Some(Technique::Photons) && scene.description().defaults.radius.is_none();
    let of_medium = |(id, medium): (usize, &Medium)| {
        let widest = WidestBeams::within(medium);
        match is_said && estimators.is_by_beams(id as u16) {
            true => widest.at_most(widest_kernel_in(scene, id)),
            false => widest,
        }
    };
    scene.media().iter().enumerate().map(of_medium).collect()
}

fn aim(scene: &Scene, settings: &JobSettings, estimators: &Estimators, extent: f32, places: &mut Places) -> Aimed {
    let mode = targeting(scene, settings);
    let emitters = emitters(scene, estimators, extent);
    Targets::prepare(scene, (estimators, &emitters), settings.seed, mode, places)
}

/// Estimators with photons that go on from surface to surface, where only targets ask for it: the targets find what
/// camera paths would be slow to find.
fn aimed_instead_of_paths(
    estimators: &Estimators,
    mode: Targeting,
    aim: &mut impl FnMut(&Estimators) -> Aimed,
) -> Option<(Estimators, Aimed)> {
    let deeper = estimators.deepened();
    let (targets, told) = aim(&deeper);
    let targets = targets.filter(|targets| targets.outdo_paths(mode))?;
    Some((deeper, (Some(targets), told)))
}

/// Beams cost more than surface photons. If a plan has both, more paths leave surface photons only, up to about one for
/// a few pixels.
fn surface_paths_beside_beams(camera: &Camera, paths: u32) -> u32 {
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    let enough = (pixels / PIXELS_PER_SURFACE_PATH).min(u64::from(u32::MAX)) as u32;
    enough.clamp(paths, paths.saturating_mul(MAX_SURFACE_PATHS))
}

impl fmt::Display for RenderPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (is_in, heading) in [
            (true, "Stages of every pass:"),
            (false, "Stages that this scene does without, and why:"),
        ] {
            let stages: Vec<&Stage> = self.stages.iter().filter(|stage| stage.is_in() == is_in).collect();
            if stages.is_empty() {
                continue;
            }
            writeln!(f, "{heading}")?;
            for stage in stages {
                writeln!(f, "{stage}")?;
            }
            writeln!(f)?;
        }
        writeln!(f, "Kernel radii, base radius times radius scale:")?;
        let schedule = match self.settings.schedule {
            ScheduleKind::Pass => "once a pass",
            ScheduleKind::Beam => "once a beam",
        };
        let alpha = self.settings.alpha;
        match self.settings.budget {
            None => writeln!(f, "radius scale: shrinks {schedule}, alpha {alpha:.4}")?,
            Some(Budget { passes, scale }) => writeln!(
                f,
                "radius scale: {scale:.4} for {passes} passes, then shrinks, alpha {alpha:.4}"
            )?,
        }
        write!(
            f,
            "base radii: {:.3e} to {:.3e} scene units",
            self.radii.floor, self.radii.smooth_ceiling
        )?;
        if let Some(radius) = self.extent_seen {
            write!(f, ", set by the part that the camera sees: radius {radius:.3}")?;
        }
        let narrowest = self
            .widest_beams
            .iter()
            .map(|of| of.smooth)
            .fold(f32::INFINITY, f32::min);
        match narrowest < self.radii.smooth_ceiling {
            true => writeln!(f, "; in the densest medium at most {narrowest:.3e}"),
            false => writeln!(f),
        }
    }
}
