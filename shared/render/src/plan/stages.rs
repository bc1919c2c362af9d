//! What the plan reports about each stage: whether a scene has it, and why.

use super::{Contents, RenderPlan};
use crate::plan::estimators::{Caustics, MediumLight, PathEnds};
use crate::world::Scene;
use crate::world::camera::Projection;
use crate::world::medium::{Heterogeneous, Medium};
use crate::world::spectrum::WAVES;
use beamfarm_image::layer::Layer;
use std::fmt;

/// A stage, and why a scene has it or not.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    name: &'static str,
    state: State,
    reason: String,
}

#[derive(Clone, Copy, Debug)]
enum State {
    In,
    Out,
}

/// A line of `beamfarm explain`.
impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = match self.state {
            State::In => "in ",
            State::Out => "out",
        };
        write!(f, "{state}  {:<30} {}", self.name, self.reason)
    }
}

impl Stage {
    /// With one reason, for both states.
    fn new(name: &'static str, is_in: bool, reason: String) -> Self {
        let state = match is_in {
            true => State::In,
            false => State::Out,
        };
        Self { name, state, reason }
    }

    /// With a reason for each state.
    fn either(name: &'static str, is_in: bool, if_in: impl FnOnce() -> String, if_out: &str) -> Self {
        let reason = if is_in { if_in() } else { if_out.to_owned() };
        Self::new(name, is_in, reason)
    }
}

/// All stages except the layers, in the order of the report. `on_targets`: what to report about targets.
pub(super) fn all(scene: &Scene, plan: &RenderPlan, contents: &Contents, on_targets: String) -> Vec<Stage> {
    vec![
        photon_paths(scene, plan),
        Stage::new("photon targeting", plan.targets.is_some(), on_targets),
        photon_beams(plan, contents),
        view_of_beams(plan),
        sampled_in_fog(scene, plan, contents),
        closed_transmittance(scene),
        tracked_transmittance(scene),
        boundary_walk(scene, contents),
        surface_photons(plan, contents),
        balanced_caustics(plan),
        ends_of_paths(plan),
        direct_light(contents),
        visibility_rules(scene, plan),
        thin_lens(scene),
        motion_blur(scene),
        dispersion(scene),
    ]
}

fn dispersion(scene: &Scene) -> Stage {
    let said = || format!("{WAVES} wavelengths a pass: the index of some material depends on them");
    Stage::either(
        "dispersion",
        scene.disperses,
        said,
        "no index depends on the wavelength",
    )
}

fn motion_blur(scene: &Scene) -> Stage {
    let motion = scene.description().motion.as_ref();
    let shutter = motion.filter(|motion| motion.blurs()).map(|motion| motion.shutter());
    let moments = || {
        let [open, close] = shutter.unwrap_or_default();
        format!("each pass has a moment between {open} and {close} frames")
    };
    let still = match motion {
        Some(_) => "the shutter is open for no time in which something moves",
        None => "nothing moves",
    };
    Stage::either("motion blur", shutter.is_some(), moments, still)
}

/// The reason for a missing stage, or that there is no light.
fn lit_or(contents: &Contents, otherwise: &'static str) -> &'static str {
    if contents.lit { otherwise } else { "no light" }
}

/// Number of media whose light beams bring.
fn by_beams(plan: &RenderPlan) -> usize {
    let media = plan.estimators.media.iter();
    media.filter(|light| **light == MediumLight::Beams).count()
}

fn heterogeneous(scene: &Scene) -> impl Iterator<Item = &Heterogeneous> {
    scene.media().iter().filter_map(|medium| match medium {
        Medium::Heterogeneous(medium) => Some(medium),
        Medium::Homogeneous(_) => None,
    })
}

fn photon_paths(scene: &Scene, plan: &RenderPlan) -> Stage {
    let said = || {
        format!(
            "{} a pass from {} light(s)",
            plan.settings.paths_per_pass,
            scene.lights().len()
        )
    };
    Stage::either(
        "photon paths",
        plan.beams || plan.surface_photons,
        said,
        "no light, or nothing that it could reach",
    )
}

fn photon_beams(plan: &RenderPlan, contents: &Contents) -> Stage {
    let said = || {
        let by_beams = by_beams(plan);
        format!(
            "all light of {by_beams} scattering medium/media, caustics in {}",
            contents.scattering - by_beams
        )
    };
    let otherwise = match contents.scattering {
        0 => "no medium scatters light",
        _ => "media are dense or small: camera paths are scattered in them",
    };
    Stage::either("photon beams", plan.beams, said, lit_or(contents, otherwise))
}

fn sampled_in_fog(scene: &Scene, plan: &RenderPlan, contents: &Contents) -> Stage {
    let is_sampled = |m: &Medium| matches!(m, Medium::Homogeneous(_)) && m.scatters();
    let media = scene.media().iter().zip(&plan.estimators.media);
    let count = media
        .filter(|(m, light)| **light == MediumLight::Beams && is_sampled(m))
        .count();
    Stage::either(
        "unscattered light in fog, sampled",
        count > 0 && contents.lit,
        || format!("{count} homogeneous scattering medium/media: no beams for it"),
        lit_or(contents, "beams bring the light of no homogeneous medium"),
    )
}

fn closed_transmittance(scene: &Scene) -> Stage {
    let count = scene.media().len() - heterogeneous(scene).count();
    Stage::either(
        "transmittance in closed form",
        count > 0,
        || format!("{count} homogeneous medium/media"),
        "no homogeneous medium",
    )
}

fn tracked_transmittance(scene: &Scene) -> Stage {
    let tracked = heterogeneous(scene).map(|medium| {
        let [x, y, z] = medium.bricks().samples().to_array();
        format!("{} in a box of {x} x {y} x {z} samples", medium.estimator)
    });
    let tracked: Vec<String> = tracked.collect();
    Stage::either(
        "transmittance by random walks",
        !tracked.is_empty(),
        || tracked.join("; "),
        "no heterogeneous medium",
    )
}

fn boundary_walk(scene: &Scene, contents: &Contents) -> Stage {
    let Contents {
        boundaries, cut_out, ..
    } = contents;
    let said = || {
        let mut walked = format!("{boundaries} index-matched boundary/boundaries of media");
        if *cut_out > 0 {
            walked += &format!(", {cut_out} object(s) that are not opaque");
        }
        match scene.meetings.count() {
            0 => walked,
            count => format!("{walked}, {count} object(s) that reach into others"),
        }
    };
    Stage::either(
        "boundary walk of shadow rays",
        scene.shadow_rays_walk,
        said,
        "no index-matched boundary between media, everything else is opaque",
    )
}

fn surface_photons(plan: &RenderPlan, contents: &Contents) -> Stage {
    let said = || {
        let caustics = match contents.has_caustics(&plan.estimators) {
            true => format!("caustics of {} specular object(s), ", contents.specular),
            false => String::new(),
        };
        format!(
            "on {} object(s) that are not specular, {} paths a pass: {caustics}light scattered by {} medium/media",
            contents.surfaces,
            plan.surface_paths,
            by_beams(plan)
        )
    };
    let otherwise = "no caustics and no light that beams bring: camera paths find everything";
    Stage::either(
        "surface photons",
        plan.surface_photons,
        said,
        lit_or(contents, otherwise),
    )
}

/// Where camera paths look up all photons, and end.
fn ends_of_paths(plan: &RenderPlan) -> Stage {
    let ends = plan.estimators.ends();
    let reason = match ends {
        PathEnds::Second => "rules tell what photons see: camera paths end at the second surface",
        PathEnds::FarEnough => "camera paths end where they meet a surface behind the first, far enough from it",
        PathEnds::First => "camera paths end at the first surface",
        PathEnds::Never => "camera paths go on from surface to surface",
    };
    Stage::new(
        "photons at the ends of paths",
        ends != PathEnds::Never && plan.surface_photons,
        reason.into(),
    )
}

fn balanced_caustics(plan: &RenderPlan) -> Stage {
    let estimators = &plan.estimators;
    let shared = estimators.count(Caustics::Shared);
    let any_met = estimators.count(Caustics::Paths) > 0;
    let otherwise = match (estimators.specular, estimators.photons_go_on(), any_met) {
        (false, ..) => "nothing is specular",
        (true, true, _) => "photons are traced anyway, and bring them all",
        (true, false, true) => "camera paths alone find those of lights all around, photons those of small ones",
        (true, false, false) => "camera paths hardly meet the lights: photons bring them all",
    };
    Stage::either(
        "caustics by photons and paths",
        shared > 0 && plan.surface_photons,
        || format!("those of {shared} light(s) that camera paths meet now and then, weighed by both densities"),
        otherwise,
    )
}

fn view_of_beams(plan: &RenderPlan) -> Stage {
    let otherwise = match plan.beams {
        true => "camera paths may come anywhere: every beam is stored",
        false => "no beams",
    };
    Stage::either(
        "beams in view alone",
        plan.beams && plan.view.is_some(),
        || "camera paths come nowhere else: other beams are not stored".into(),
        otherwise,
    )
}

fn direct_light(contents: &Contents) -> Stage {
    Stage::either(
        "direct light",
        contents.surfaces > 0 && contents.lit,
        || "light and BSDF sampling, balanced".into(),
        lit_or(contents, "no surface to light directly"),
    )
}

fn visibility_rules(scene: &Scene, plan: &RenderPlan) -> Stage {
    let rules = scene.description().rules.as_ref();
    let reason = match rules {
        Some(rules) => format!(
            "{} rule(s) in {} bytes of sets{}",
            rules.rules,
            rules.bytes(),
            match plan.estimators.ends() {
                PathEnds::Second => ", photons obey them",
                PathEnds::Never | PathEnds::FarEnough | PathEnds::First => "",
            }
        ),
        None => "no rule with an effect: every ray sees everything".into(),
    };
    Stage::new("visibility rules", rules.is_some(), reason)
}

fn thin_lens(scene: &Scene) -> Stage {
    let camera = &scene.description().camera;
    let aperture = camera.aperture;
    Stage::either(
        "thin lens",
        aperture > 0.0,
        || format!("aperture {aperture}"),
        match camera.projection {
            Projection::Perspective => "aperture 0: a pinhole",
            Projection::Orthographic => "aperture 0: parallel rays",
            Projection::Panoramic(_) => "a panorama: a pinhole",
        },
    )
}

/// What is rendered besides the beauty.
pub(super) fn layers(layers: &[Layer]) -> Stage {
    let names = || layers.iter().map(Layer::to_string).collect::<Vec<_>>();
    Stage::either("layers", !layers.is_empty(), || names().join(", "), "none asked for")
}
