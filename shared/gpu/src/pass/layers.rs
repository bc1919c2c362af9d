//! Layers other than the picture, from what paths find and from each path's first surface.

use super::constants::GROUPS_OF_RECORD;
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
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::plan::aov::{LayerPlan, Parts};
use bytemuck::{Pod, Zeroable};

/// The first surface in a pixel, as in `kernels/path_first.wgsl`.
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

/// Most light groups with layers: beam words have no more bits for them.
const MOST_GROUPS: usize = 255;

/// The reason why a device cannot render these layers, if any.
pub(super) fn reason(plan: &LayerPlan) -> Option<Reason> {
    let (count, most) = (plan.groups() as u64, MOST_GROUPS as u64);
    (count > most).then_some(Reason {
        of: Of::Plan,
        field: "layers",
        why: Why::Many { count, most },
    })
}

/// Whether some layer needs first surfaces.
pub(super) fn have_firsts(layers: &LayerPlan) -> bool {
    let is_of_first = |layer: &Layer| matches!(layer, Layer::Depth | Layer::Normal | Layer::Albedo);
    layers.mattes() > 0 || layers.layers.iter().any(is_of_first)
}

/// Bytes of device memory for layers.
pub(super) fn bytes(layers: &LayerPlan, pixels: u64) -> u64 {
    match have_firsts(layers) {
        true => pixels * size_of::<First>() as u64,
        false => 0,
    }
}

/// Finds the first surfaces of a pass.
pub(super) struct Firsts {
    kernel: Kernel,
    /// A [`First`] per pixel.
    pub found: Buffer,
}

impl Firsts {
    pub fn new(on: Together, world: &WorldBuffers, pixels: u64) -> Result<Self> {
        Ok(Self {
            kernel: world.geometry.kernel(&on, &kernels::PATH_FIRST, "find_first"),
            found: on.empty("first surfaces", pixels * size_of::<First>() as u64)?,
        })
    }

    /// Finds those of paths that have started and taken no step, in this many slots.
    pub fn run(&self, work: &mut Work, named: &Named, slots: u32) -> Result<()> {
        let groups = Groups::Count(slots.div_ceil(64));
        named
            .clone()
            .with(&[("firsts", &self.found)])
            .run(work, &self.kernel, groups)
    }
}

/// The inputs of a pass's layers.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub pass_index: u64,
    /// All radiance.
    pub picture: &'a Film,
    /// By pixel, then by record: see [`records`](super::constants::records).
    pub found: &'a [Found],
    /// By pixel, if any layer needs first surfaces.
    pub firsts: &'a [First],
}

/// The layers of a pass. `along`: by pixel, the results of camera rays alone, if any layer needs them.
pub(super) fn of_pass(plan: &LayerPlan, known: Known, along: Vec<Parts>) -> (Vec<Film>, Vec<Matte>) {
    let Known {
        picture, found, firsts, ..
    } = known;
    let pixels = picture.pixels.len();
    let is_odd = known.pass_index % 2 == 1;
    let mut parts = along;
    parts.resize(pixels, Parts::default());
    for (pixel, parts) in parts.iter_mut().enumerate() {
        add_found(parts, &found[pixel], firsts.get(pixel));
        let of_group = |group: usize| {
            let found = &found[pixel + (1 + group / GROUPS_OF_RECORD) * pixels];
            Rgb::from([found.direct, found.surface, found.volume][group % GROUPS_OF_RECORD])
        };
        parts.groups = (0..plan.groups()).map(of_group).collect();
    }
    let film = |(number, layer): (usize, &Layer)| {
        let mut film = Film::new(picture.width, picture.height);
        match layer {
            Layer::Odd if is_odd => film.pixels.clone_from(&picture.pixels),
            _ => {
                let values = parts
                    .iter()
                    .map(|parts| parts.value(layer, plan.group_of_layer(number)));
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
        plan.films().iter().enumerate().map(film).collect(),
        (0..plan.mattes()).map(matte).collect(),
    )
}

fn add_found(parts: &mut Parts, found: &Found, first: Option<&First>) {
    let first = first.filter(|first| first.object != NONE);
    parts.first = first.map(|first| (first.depth, Vec3::from(first.normal), Vec3::from(first.albedo)));
    parts.object = first.map(|first| first.object);
    parts.let_through = found.let_through;
    parts.direct = found.direct.into();
    parts.surface = found.surface.into();
    parts.volume = found.volume.into();
    parts.beams = found.beams;
}
