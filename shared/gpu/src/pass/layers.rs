//! Layers beside the picture: by what paths find, and by the first surface of each.

use super::paths::{Found, Named};
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels;
use crate::self_test::Together;
use crate::world::reason::{Of, Reason, Why};
use crate::world::{NONE, WorldBuffers};
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_image::matte::Matte;
use beamfarm_render::math::Vec3;
use beamfarm_render::plan::aov::{LayerPlan, Parts};
use bytemuck::{Pod, Zeroable};

/// The first surface in a pixel, as `kernels/path_first.wgsl` has it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct First {
    /// Unit shading normal.
    pub normal: [f32; 3],
    /// Distance along the camera's axis.
    pub depth: f32,
    pub albedo: [f32; 3],
    /// Its object, or [`NONE`].
    pub object: u32,
}

/// What keeps layers from devices.
pub(super) fn reasons(layers: &[Layer]) -> Vec<Reason> {
    let missing = |what: &'static str| Reason {
        of: Of::Plan,
        field: "layers",
        why: Why::Missing(what),
    };
    let mut all: Vec<Reason> = Vec::new();
    for layer in layers {
        let reason = match layer {
            Layer::Light(_) => missing("layers of single lights"),
            Layer::Motion => missing("layer of motion"),
            Layer::BeamDensity => missing("layer of beams"),
            Layer::Targets => missing("layer of photon targets"),
            Layer::Alpha | Layer::Depth | Layer::Normal | Layer::Albedo => continue,
            Layer::Direct | Layer::Surface | Layer::Volume | Layer::Odd => continue,
            Layer::Objects | Layer::Materials => continue,
        };
        if !all.contains(&reason) {
            all.push(reason);
        }
    }
    all
}

/// Whether some layer is of first surfaces.
pub(super) fn have_firsts(layers: &LayerPlan) -> bool {
    let is_of_first = |layer: &Layer| matches!(layer, Layer::Depth | Layer::Normal | Layer::Albedo);
    layers.mattes() > 0 || layers.layers.iter().any(is_of_first)
}

/// Bytes that they take on a device.
pub(super) fn bytes(layers: &LayerPlan, pixels: u64) -> u64 {
    match have_firsts(layers) {
        true => pixels * size_of::<First>() as u64,
        false => 0,
    }
}

/// What finds the first surfaces of a pass.
pub(super) struct Firsts {
    kernel: Kernel,
    /// A [`First`] of each pixel.
    pub found: Buffer,
}

impl Firsts {
    pub fn new(on: Together, world: &WorldBuffers, pixels: u64) -> Result<Self> {
        Ok(Self {
            kernel: world.geometry.kernel(&on, &kernels::PATH_FIRST, "find_first"),
            found: on.empty("first surfaces", pixels * size_of::<First>() as u64)?,
        })
    }

    /// Find those of paths that have started and taken no step, in so many slots.
    pub fn run(&self, work: &mut Work, named: &Named, slots: u32) -> Result<()> {
        let groups = Groups::Count(slots.div_ceil(64));
        named
            .clone()
            .with(&[("firsts", &self.found)])
            .run(work, &self.kernel, groups)
    }
}

/// The layers of a pass, by what was found in its pixels. `picture`: all radiance.
pub(super) fn of_pass(
    plan: &LayerPlan,
    is_odd: bool,
    picture: &Film,
    found: &[Found],
    firsts: &[First],
) -> (Vec<Film>, Vec<Matte>) {
    let parts: Vec<Parts> = (found.iter().enumerate())
        .map(|(pixel, found)| parts(found, firsts.get(pixel)))
        .collect();
    let film = |layer: &Layer| {
        let mut film = Film::new(picture.width, picture.height);
        match layer {
            Layer::Odd if is_odd => film.pixels.clone_from(&picture.pixels),
            _ => {
                let values = parts.iter().map(|parts| parts.value(layer, None));
                (film.pixels.iter_mut().zip(values)).for_each(|(pixel, value)| *pixel = value);
            }
        }
        film
    };
    let matte = |matte: usize| {
        let ids: Vec<u32> = parts.iter().map(|parts| plan.id(matte, parts.object)).collect();
        Matte::leaf(&ids)
    };
    (
        plan.films().iter().map(film).collect(),
        (0..plan.mattes()).map(matte).collect(),
    )
}

fn parts(found: &Found, first: Option<&First>) -> Parts {
    let first = first.filter(|first| first.object != NONE);
    Parts {
        first: first.map(|first| (first.depth, Vec3::from(first.normal), Vec3::from(first.albedo))),
        object: first.map(|first| first.object),
        let_through: found.let_through,
        direct: found.direct.into(),
        surface: found.surface.into(),
        volume: found.volume.into(),
        ..Parts::default()
    }
}
