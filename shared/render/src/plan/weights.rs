//! MIS weights between photons and camera paths that find the same light: the balance heuristic (Veach 1997, section
//! 9.2.2) between the densities of both, as in vertex merging (Georgiev et al. 2012).
//!
//! They are taken at the vertex x where photons arrive, or at the surface y that camera paths go to from there. For
//! photons, the density is how many of the pass are expected in a kernel at x by the same path, `N pi r^2 p`, with p
//! their density per area and solid angle. For camera paths, it is the density of their direction at x over its cosine
//! there.

use crate::plan::RenderPlan;
use crate::plan::estimators::{Caustics, PathEnds};
use crate::world::Scene;
use beamfarm_image::radius::Schedule;

/// What the weights of a pass depend on.
#[derive(Clone, Debug)]
pub struct Weights {
    /// `N pi r^2` of a kernel as wide as for unscattered light.
    pub in_kernel: f32,
    /// By light: the same for its caustics. Zero if only one of the two finds them.
    pub in_caustic: Vec<f32>,
    /// Factor on the photons that gloss sees: less than one if a pass has so few that the widest kernel holds less than
    /// one.
    pub on_gloss: f32,
    /// Shortest way between two vertices after which photons may end a camera path at the second, scene units. At less
    /// distance their blur would show, most of all in corners and creases.
    pub least_flight: f32,
}

/// Expected photons of a pass in a kernel, for photons that were reflected or scattered more than once: their density
/// is unknown. A half and a quarter do equally well; four has 1.4 times the variance in rooms lit through panes.
pub(crate) const DEEPER: f32 = 1.0;
/// Factor on the kernels of caustics, which are narrower than those of unscattered light. A factor of one has 1.12
/// times the variance where a glass sphere stands under a sky.
const CAUSTIC_KERNEL: f32 = 0.5;
/// [`Weights::least_flight`], in radii of the widest kernels.
const LEAST_FLIGHT: f32 = 2.0;

impl Weights {
    /// The weights of a pass.
    pub fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self {
        let scale = Schedule::new(&plan.settings).surface_scale(pass_index) as f32;
        let radius = plan.radii.ceiling * scale;
        let widest = plan.radii.smooth_ceiling * scale;
        let in_kernel = plan.surface_paths as f32 * (std::f32::consts::PI * radius * radius);
        let in_caustic = |light: usize| match plan.estimators.caustics_of(light) {
            Caustics::Shared => CAUSTIC_KERNEL * in_kernel * plan.emitters().pmf(light),
            Caustics::Photons | Caustics::Paths => 0.0,
        };
        // Photons of a pass in the widest kernel, if they were spread evenly over a sphere around the scene.
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
    /// Photons alone find it.
    Photons,
    /// Camera paths find it, from wherever they go on.
    Paths,
    /// Camera paths find it, from everywhere: rules keep it off the photon's surface.
    PathsByRule,
    /// Both, balanced. Holds the number of expected photons, without the camera path's density.
    Both(f32),
}

impl FoundBy {
    /// A photon's weight against camera paths of this density. `scale`: factor on the expected photons.
    pub(crate) fn photon_weight(self, scale: f32, paths: f32) -> f32 {
        match self {
            Self::Photons => 1.0,
            Self::Paths | Self::PathsByRule => 0.0,
            Self::Both(photons) => 1.0 - path_weight(photons * scale, paths),
        }
    }
}

/// A camera path's weight against photons, by the densities of both. Zero if there is no path.
pub(crate) fn path_weight(photons: f32, paths: f32) -> f32 {
    let ratio = photons / paths;
    if ratio.is_nan() { 0.0 } else { 1.0 / (1.0 + ratio) }
}
