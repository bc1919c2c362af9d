//! MIS weights between photons and camera paths, where both find the same light: by the balance heuristic (Veach 1997,
//! section 9.2.2) between the densities of both, as vertex merging has them (Georgiev et al. 2012).
//!
//! Taken at the vertex x where photons arrive, or at the surface y that camera paths go to from there: of photons, how
//! many of the pass are expected in a kernel at x by the same path, `N pi r^2 p`, with p their density per area and
//! solid angle; of camera paths, the density of their direction at x over its cosine there.

use crate::plan::RenderPlan;
use crate::plan::estimators::{Caustics, PathEnds};
use crate::world::Scene;
use beamfarm_image::radius::Schedule;

/// What the weights of a pass depend on.
#[derive(Clone, Debug)]
pub struct Weights {
    /// `N pi r^2` of a kernel as wide as those of unscattered light get.
    pub in_kernel: f32,
    /// By light: the same of its caustics. Zero where only one of the two finds them.
    pub in_caustic: Vec<f32>,
    /// Factor on the photons that gloss sees: less than one where a pass has so few that the widest kernel holds less
    /// than one.
    pub on_gloss: f32,
    /// Least way between two vertices for a camera path to end at the second by the photons there, scene units: from
    /// nearer by, their blur would be seen, in corners and creases most of all.
    pub least_flight: f32,
}

/// Expected photons of a pass in a kernel, of those that were reflected or scattered more than once: their density is
/// not known. Half and a quarter do as well, four have 1.4 times the variance in rooms lit by way of panes.
pub(crate) const DEEPER: f32 = 1.0;
/// Kernels of caustics are narrower than those of unscattered light. A whole one has 1.12 times the variance where a
/// sphere of glass is in a sky.
const CAUSTIC_KERNEL: f32 = 0.5;
/// In radii of the widest kernels.
const LEAST_FLIGHT: f32 = 2.0;

impl Weights {
    /// Of a pass.
    pub fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self {
        let scale = Schedule::new(&plan.settings).surface_scale(pass_index) as f32;
        let radius = plan.radii.ceiling * scale;
        let widest = plan.radii.smooth_ceiling * scale;
        let in_kernel = plan.surface_paths as f32 * (std::f32::consts::PI * radius * radius);
        let in_caustic = |light: usize| match plan.estimators.caustics_of(light) {
            Caustics::Shared => CAUSTIC_KERNEL * in_kernel * plan.emitters().pmf(light),
            Caustics::Photons | Caustics::Paths => 0.0,
        };
        // Those of a pass in the widest kernel, were they spread evenly over a sphere around the scene.
        let share = widest / scene.bounds().radius;
        let photons = plan.surface_paths as f32 * share * share * 0.25;
        Self {
            in_kernel,
            in_caustic: (0..scene.lights().len()).map(in_caustic).collect(),
            on_gloss: photons.min(1.0),
            least_flight: match plan.estimators.ends() {
                PathEnds::Second => 0.0,
                PathEnds::Never | PathEnds::FarEnough | PathEnds::First => LEAST_FLIGHT * widest,
            },
        }
    }
}

/// Which technique finds the light that a photon brings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FoundBy {
    /// Photons alone.
    Photons,
    /// Camera paths, from wherever they go on.
    Paths,
    /// Camera paths, from everywhere: rules keep it off the surface that the photon is on.
    PathsByRule,
    /// Both, balanced: with this number of expected photons, the camera path's density left out.
    Both(f32),
}

impl FoundBy {
    /// Weight of a photon, where camera paths go on with this density. `scale`: factor on the expected photons.
    pub(crate) fn photon_weight(self, scale: f32, paths: f32) -> f32 {
        match self {
            Self::Photons => 1.0,
            Self::Paths | Self::PathsByRule => 0.0,
            Self::Both(photons) => 1.0 - path_weight(photons * scale, paths),
        }
    }
}

/// Weight of a camera path by its density and that of photons. None where there is no path.
pub(crate) fn path_weight(photons: f32, paths: f32) -> f32 {
    let ratio = photons / paths;
    if ratio.is_nan() { 0.0 } else { 1.0 / (1.0 + ratio) }
}
