//! Inputs of a pass's camera paths in addition to the scene.

use super::HEAD;
use crate::sampler::Stream;
use crate::trace::number_of_group;
use crate::world::waves::{Etas, MOST_WAVES, Waves};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::aov::LayerPlan;
use beamfarm_render::plan::estimators::{Caustics, PathEnds};
use beamfarm_render::plan::weights::Weights;
use beamfarm_render::sampler::{Purpose, Sampler, mix64};
use beamfarm_render::world::Scene;
use bytemuck::{Pod, Zeroable};

/// As in `kernels/path.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PassConstants {
    /// Random numbers of camera paths.
    pub camera_stream: Stream,
    /// Random numbers of parts of the lens.
    pub lens_stream: Stream,
    /// Position of samples within their pixels, if it is the same for all.
    pub offset: [f32; 2],
    /// 1: it is.
    pub has_offset: u32,
    /// 1: tiles visit parts of the lens in turn.
    pub by_parts: u32,
    /// See [`Weights`].
    pub in_kernel: f32,
    /// See [`Weights`].
    pub least_flight: f32,
    /// Factor on the survival probability of paths.
    pub patience: f32,
    /// 1: photons go on from surface to surface.
    pub photons_go_on: u32,
    /// 1: paths end at photons far enough away; 2: also at first surfaces; 3: all end at their second surface.
    pub ends: u32,
    /// 1: beams contribute part of the light of media in which paths scatter.
    pub leave_beams: u32,
    /// Number of the launch's first slot.
    pub first: u32,
    /// Slots of the launch.
    pub slots: u32,
    /// Tiles per row.
    pub columns: u32,
    /// 1: photons bring caustics of lights that no path meets to lobes that paths follow.
    pub unmet_caustics: u32,
    /// See [`Weights`].
    pub on_gloss: f32,
    /// Wavelengths of the pass.
    pub waves: u32,
    /// Most splits of a path.
    pub splits: u32,
    /// Most branches that can wait per path.
    pub branches: u32,
    /// Key of the chords' random numbers.
    pub chord_key: [u32; 2],
    /// See [`Waves`].
    pub weights: [[f32; 3]; MOST_WAVES],
    /// See [`Waves`].
    pub etas: Etas,
    /// See [`records`].
    pub records: u32,
    padding: u32,
}

/// How the light of a light or a medium is found.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Use {
    /// For a light, its caustics: by photons, both, or paths, 0 to 2. For a medium: 1 if beams contribute all its
    /// light.
    pub way: u32,
    /// For a light: see [`Weights`].
    pub in_caustic: f32,
    /// For a light: the group whose layer it belongs to, from 1 on; 0: none.
    pub light_group: u32,
}

/// Slots of paths; 64 are a tile of 8 x 8 pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slots {
    /// The first slot.
    pub first: u32,
    /// Number of slots.
    pub count: u32,
    /// Tiles per row.
    pub columns: u32,
    /// Most branches that can wait in each.
    pub branches: u32,
}

/// Light groups in a [`Found`](super::paths::Found).
pub(super) const GROUPS_OF_RECORD: usize = 3;
/// Records per path: one for all light, and one for every three light groups.
pub(super) fn records(layers: &LayerPlan) -> u32 {
    1 + layers.groups().div_ceil(GROUPS_OF_RECORD) as u32
}

/// Elements of a film of this many pixels, including the head.
pub(super) fn elements_of_film(layers: &LayerPlan, pixels: u64) -> u64 {
    HEAD as u64 + pixels * u64::from(records(layers))
}

/// Position of all samples within their pixels, if they count for several pixels.
pub(super) fn offset(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Option<beamfarm_render::math::Vec2> {
    let filter = &scene.description().camera.filter;
    (filter.spreads()).then(|| Sampler::even(plan.settings.seed, pass_index, Purpose::Film, 0).next_2d())
}

impl PassConstants {
    /// For the slots of a launch.
    pub fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64, slots: Slots) -> Self {
        let waves = Waves::new(scene, plan, pass_index);
        let weights = Weights::new(scene, plan, pass_index);
        let seed = plan.settings.seed;
        let offset = offset(scene, plan, pass_index);
        let key = mix64(mix64(seed) ^ mix64(pass_index) ^ Purpose::Chords as u64);
        Self {
            camera_stream: Stream::new(seed, pass_index, Purpose::Camera),
            lens_stream: Stream::new(seed, pass_index, Purpose::Lens),
            offset: offset.map_or([0.0; 2], |offset| offset.to_array()),
            has_offset: offset.is_some().into(),
            by_parts: plan.beams.into(),
            in_kernel: weights.in_kernel,
            least_flight: weights.least_flight,
            patience: plan.patience,
            photons_go_on: plan.estimators.photons_go_on().into(),
            ends: match plan.estimators.ends() {
                // As on processors: where some light is left for rays to find, paths go on to it.
                PathEnds::First if scene.description().rules.is_none() && scene.lights_are_all_sampled() => 2,
                PathEnds::First | PathEnds::FarEnough => 1,
                PathEnds::Second => 3,
                PathEnds::Never => 0,
            },
            leave_beams: plan.estimators.leave_beams().into(),
            first: slots.first,
            slots: slots.count,
            columns: slots.columns,
            unmet_caustics: plan.estimators.unmet_caustics.into(),
            on_gloss: weights.on_gloss,
            waves: waves.count,
            splits: plan.splits,
            branches: slots.branches,
            chord_key: [key as u32, (key >> 32) as u32],
            weights: waves.weights,
            etas: waves.etas,
            records: records(&plan.layers),
            padding: 0,
        }
    }
}

/// By light, and then by medium.
pub(super) fn uses(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Vec<Use> {
    let weights = Weights::new(scene, plan, pass_index);
    let of_light = |(light, in_caustic): (usize, &f32)| Use {
        way: match plan.estimators.caustics_of(light) {
            Caustics::Photons => 0,
            Caustics::Shared => 1,
            Caustics::Paths => 2,
        },
        in_caustic: *in_caustic,
        light_group: number_of_group(&plan.layers, light),
    };
    let of_medium = |id: u16| Use {
        way: plan.estimators.is_by_beams(id).into(),
        in_caustic: 0.0,
        light_group: 0,
    };
    let media = 0..scene.description().media.len() as u16;
    let lights = weights.in_caustic.iter().enumerate().map(of_light);
    lights.chain(media.map(of_medium)).collect()
}
