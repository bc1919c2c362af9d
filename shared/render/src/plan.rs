//! The plan: which stages this scene needs, made once, with the reason for each.

use crate::aov::{LayerPlan, NoSuchGroup};
use crate::bsdf::Material;
use crate::estimators::Estimators;
use crate::kernel::KernelRadii;
use crate::light::LightSelector;
use crate::medium::Medium;
use crate::targeting::Targets;
use crate::world::Scene;
use beamfarm_image::job::{Budget, JobSettings, ScheduleKind};
use beamfarm_image::layer::Layer;
use std::fmt;
use std::sync::Arc;

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
            Some(radius) => KernelRadii::fixed(radius),
            None => KernelRadii::of_extent(extent),
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
