//! What the plan reports about each stage: whether a scene has it, and why.

use super::{Contents, RenderPlan};
use crate::plan::estimators::{Caustics, MediumLight, PathEnds};
use crate::world::Scene;
use crate::world::camera::Projection;
use crate::world::medium::{Heterogeneous, Medium};
use crate::world::spectrum::WAVES;
use beamfarm_image::job::Technique;
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
            State::In => "uses ",
            State::Out => "skips",
        };
        write!(f, "{state}  {:<33}  {}", self.name, self.reason)
    }
}

/// `1 medium`, `2 media`.
fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
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

    /// Whether passes have it.
    pub(super) fn is_in(&self) -> bool {
        matches!(self.state, State::In)
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
        photon_paths(scene, plan, contents),
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
    let said = || format!("{WAVES} wavelengths a pass: some index of refraction depends on the wavelength");
    Stage::either(
        "dispersion",
        scene.disperses,
        said,
        "no index of refraction depends on the wavelength",
    )
}

fn motion_blur(scene: &Scene) -> Stage {
    let motion = scene.description().motion.as_ref();
    let shutter = motion.filter(|motion| motion.blurs()).map(|motion| motion.shutter());
    let moments = || {
        let [open, close] = shutter.unwrap_or_default();
        format!("each pass sees one moment between {open} and {close} frames")
    };
    let still = match motion {
        Some(_) => "nothing moves while the shutter is open",
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

fn photon_paths(scene: &Scene, plan: &RenderPlan, contents: &Contents) -> Stage {
    let said = || {
        format!(
            "{} a pass from {}",
            plan.settings.paths_per_pass,
            counted(scene.lights().len(), "light", "lights")
        )
    };
    let otherwise = match (contents.surfaces, contents.scattering) {
        (0, 0) => "nothing that light could reach",
        _ => "camera paths find all light",
    };
    Stage::either(
        "photon paths",
        plan.beams || plan.surface_photons,
        said,
        lit_or(contents, otherwise),
    )
}

fn photon_beams(plan: &RenderPlan, contents: &Contents) -> Stage {
    let said = || {
        let by_beams = by_beams(plan);
        let media = |count| counted(count, "scattering medium", "scattering media");
        match (by_beams, contents.scattering - by_beams) {
            (0, others) => format!("caustics in {}", media(others)),
            (_, 0) => format!("all light in {}", media(by_beams)),
            (_, others) => format!("all light in {}, caustics in {others} more", media(by_beams)),
        }
    };
    let otherwise = match (contents.scattering, plan.settings.techniques.media) {
        (0, _) => "no medium scatters light",
        (_, Some(Technique::Paths)) => "camera paths scatter in all media, as the scene or the pilot chose",
        _ => "camera paths scatter in all media: these are dense, small or enclosed, or lit from all around",
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
        || {
            let media = counted(count, "homogeneous scattering medium", "homogeneous scattering media");
            format!("in {media}: it needs no beams")
        },
        lit_or(contents, "beams bring the light of no homogeneous medium"),
    )
}

fn closed_transmittance(scene: &Scene) -> Stage {
    let count = scene.media().len() - heterogeneous(scene).count();
    Stage::either(
        "transmittance in closed form",
        count > 0,
        || counted(count, "homogeneous medium", "homogeneous media"),
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
        let mut walked = counted(*boundaries, "index-matched boundary", "index-matched boundaries");
        if *cut_out > 0 {
            walked += ", ";
            walked += &counted(*cut_out, "object that is not opaque", "objects that are not opaque");
        }
        match scene.meetings.count() {
            0 => walked,
            count => {
                let met = counted(
                    count,
                    "object that reaches into others",
                    "objects that reach into others",
                );
                format!("{walked}, {met}")
            }
        }
    };
    Stage::either(
        "boundary walk of shadow rays",
        scene.shadow_rays_walk,
        said,
        "no index-matched boundary between media, and everything else is opaque",
    )
}

fn surface_photons(plan: &RenderPlan, contents: &Contents) -> Stage {
    let said = || {
        let mut brought = Vec::new();
        if contents.has_caustics(&plan.estimators) {
            let objects = counted(contents.specular, "specular object", "specular objects");
            brought.push(format!("caustics of {objects}"));
        }
        if by_beams(plan) > 0 {
            let media = counted(by_beams(plan), "medium", "media");
            brought.push(format!("light scattered by {media}"));
        }
        if plan.estimators.ends() != PathEnds::Never {
            brought.push("light from other surfaces".into());
        }
        let objects = counted(
            contents.surfaces,
            "object that is not specular",
            "objects that are not specular",
        );
        format!(
            "on {objects}, {} paths a pass: {}",
            plan.surface_paths,
            brought.join(", ")
        )
    };
    let otherwise = "no caustics for photons and no light from beams: camera paths find everything";
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
        PathEnds::Second => "rules say what photons see: camera paths end at the second surface",
        PathEnds::FarEnough => "camera paths end at the next surface that is far enough from the first",
        PathEnds::First => "camera paths end at the first surface",
        PathEnds::Never => "camera paths go on from surface to surface",
    };
    let reason = match ends != PathEnds::Never && !plan.surface_photons {
        true => "no surface photons",
        false => reason,
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
        (true, true, _) => "photons are traced anyway and bring all caustics",
        (true, false, true) => "camera paths find caustics of lights all around, photons those of small lights",
        (true, false, false) => "camera paths rarely meet the lights: photons bring all caustics",
    };
    Stage::either(
        "caustics by photons and paths",
        shared > 0 && plan.surface_photons,
        || {
            let lights = counted(shared, "light", "lights");
            format!("both find caustics of {lights} that camera paths meet now and then, weighted by their densities")
        },
        otherwise,
    )
}

fn view_of_beams(plan: &RenderPlan) -> Stage {
    let otherwise = match plan.beams {
        true => "camera paths may go anywhere: every beam is stored",
        false => "no beams",
    };
    Stage::either(
        "beams in view only",
        plan.beams && plan.view.is_some(),
        || "camera paths go nowhere else: other beams are not stored".into(),
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
            "{} in {} bytes of sets{}",
            counted(rules.rules, "rule", "rules"),
            rules.bytes(),
            match plan.estimators.ends() {
                PathEnds::Second => ", photons obey them",
                PathEnds::Never | PathEnds::FarEnough | PathEnds::First => "",
            }
        ),
        None => "no rule has an effect: every ray sees everything".into(),
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
