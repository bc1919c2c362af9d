//! Odds that camera paths and photon paths have to agree on: how the light that both find is shared between them, and
//! when a path ends by chance.

use crate::estimators::{Caustics, PathEnds};
use crate::plan::RenderPlan;
use crate::world::Scene;
use beamfarm_image::radius::Schedule;

/// What photons at x, many of which blur together, are better by than one gather ray that meets the same number of
/// photons at D, all by the one direction.
pub(crate) const DEEPER_ODDS: f32 = 4.0;

/// Expected photons of a pass in a kernel as wide as those of unscattered light get, for a density per area of 1: what
/// weighs photons that were reflected once against gather rays to the same light.
pub(crate) fn first_odds(plan: &RenderPlan, pass_index: u64) -> f32 {
    let scale = Schedule::new(&plan.settings).surface_scale(pass_index) as f32;
    let radius = plan.radii.ceiling * scale;
    plan.surface_paths as f32 * (std::f32::consts::PI * radius * radius)
}

/// By light: expected caustic photons of a pass in a kernel, for an emission of 1 per area and solid angle of what is
/// emitted: what weighs them against camera paths that meet the light by way of specular surfaces. Zero where only one
/// of the two finds it.
pub(crate) fn caustic_odds(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Vec<f32> {
    let odds = CAUSTIC_SHARE * first_odds(plan, pass_index);
    let odds_of = |light: usize| match plan.estimators.caustics_of(light) {
        Caustics::Shared => odds * plan.emitters().pmf(light),
        Caustics::Photons | Caustics::Paths => 0.0,
    };
    (0..scene.lights().len()).map(odds_of).collect()
}

/// Kernels of caustics are narrower than the widest, for which their odds stand.
const CAUSTIC_SHARE: f32 = 0.5;

/// What photons on gloss are worth against gather rays, of what their odds say: [`GLOSS_SHARE`], and less where photons
/// are few: those of a pass in a kernel of scattered light, were they spread evenly over a sphere around the scene,
/// over those that their odds take for granted.
pub(crate) fn gloss_odds(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> f32 {
    let scale = Schedule::new(&plan.settings).surface_scale(pass_index) as f32;
    let radius = plan.radii.smooth_ceiling * scale / scene.bounds().radius;
    let photons = plan.surface_paths as f32 * radius * radius * 0.25;
    GLOSS_SHARE * (photons / DEEPER_ODDS).min(1.0)
}

/// Gather rays from gloss go to the light that is best there, and into cells of their own: each does better than one
/// direction drawn by itself, for which the odds stand.
const GLOSS_SHARE: f32 = 0.1;

/// How well photons find some light, compared to gather rays: a number where both do, or which of them does. One number
/// in all, as photons are many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odds(f32);

impl Odds {
    /// Photons alone find it.
    pub const PHOTONS_ONLY: Self = Self(f32::INFINITY);
    /// It is left to gather rays, from where there are any.
    pub const GATHER_RAYS: Self = Self(0.0);
    /// It is for gather rays alone: rules keep it off the surface that the photon is on.
    pub const UNSEEN: Self = Self(-1.0);

    /// Both find it: for what the numbers mean see [`gather_share`].
    pub(crate) fn shared(odds: f32) -> Self {
        Self(odds)
    }

    /// Whether gather rays may find it.
    pub(crate) fn counts_gather_rays(self) -> bool {
        self.0 < f32::INFINITY
    }

    /// Share of photons in it, where gather rays have this `density`. `scale`: factor on the odds.
    pub(crate) fn photon_share(self, scale: f32, density: f32) -> f32 {
        match self {
            Self::UNSEEN => 0.0,
            Self(odds) => 1.0 - gather_share(odds * scale, density),
        }
    }
}

/// Share of a gather ray from x to D in the light that D sends to x and that photons find as well, by the balance
/// heuristic (Veach 1997, section 9.2.2): how many photons of the pass are expected to come from the light by D into a
/// kernel at x, over the density of the same path from x. Of both, what happens between D and x: `odds`, the photons'
/// density per solid angle at D over the cosine there, times their number, and `density`, the same of the ray at x.
/// Where photons are by far the better, they are left alone.
pub(crate) fn gather_share(odds: f32, density: f32) -> f32 {
    let ratio = odds / density;
    if ratio < SURE_RATIO { 1.0 / (1.0 + ratio) } else { 0.0 }
}

/// Ratio from which on photons count all.
const SURE_RATIO: f32 = 3.0;

/// Least way between two vertices, in the widest kernels' radii, for a camera path to end at the second by the photons
/// there: from nearer by, their blur would be seen, in corners and creases most of all.
const LEAST_FLIGHT: f32 = 2.0;

/// Least way between two vertices for a camera path of a pass to end at the second, scene units.
pub(crate) fn least_flight(plan: &RenderPlan, pass_index: u64) -> f32 {
    if plan.estimators.ends() == PathEnds::Second {
        return 0.0;
    }
    let scale = Schedule::new(&plan.settings).surface_scale(pass_index) as f32;
    LEAST_FLIGHT * plan.radii.smooth_ceiling * scale
}

/// Paths that go on from vertex to vertex do so with this many times their throughput.
pub(crate) const ROULETTE_FACTOR: f32 = 2.0;

/// From this many turns on, camera paths that only deltas have turned end by chance.
pub(crate) const ROULETTE_DEPTH: u32 = 24;

/// From this many scatterings on, a path goes on with at most [`MAX_SURVIVAL`], so that light which is trapped (total
/// internal reflection in a clear sphere, say) ends as well. Late and mild, because each survival makes the path
/// heavier.
pub(crate) const TRAPPED_DEPTH: u32 = 1024;
/// Highest probability of going on beyond [`TRAPPED_DEPTH`].
pub(crate) const MAX_SURVIVAL: f32 = 0.999;
