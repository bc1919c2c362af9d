//! Camera paths in wavefronts: all active paths take a step together, round by round.

use super::constants;
use super::photons::{Asked, Photons};
use crate::beams::Way;
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::{self, Needs, Program};
use crate::scan::Scan;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::WorldBuffers;
use crate::world::materials::SPLIT_PATHS;
use beamfarm_render::plan::RenderPlan;
use bytemuck::{Pod, Zeroable};

/// An active path, as in `kernels/path.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Path {
    pub origin: [f32; 3],
    pub medium: u32,
    pub dir: [f32; 3],
    pub phase: u32,
    pub beta: [f32; 3],
    pub depth: u32,
    pub track: [f32; 3],
    pub flags: u32,
    pub point: [f32; 3],
    pub density: f32,
    pub facing: [f32; 3],
    pub projected: f32,
    pub share: f32,
    pub rest: f32,
    pub splits: u32,
    pub distance: f32,
    pub behind: f32,
    pub x: u32,
    pub y: u32,
    pub surface: u32,
}

/// A waiting branch of a path, likewise.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Branch {
    pub origin: [f32; 3],
    pub medium: u32,
    pub dir: [f32; 3],
    pub depth: u32,
    pub beta: [f32; 3],
    pub flags: u32,
    pub track: [f32; 3],
    pub surface: u32,
    pub share: f32,
    pub rest: f32,
    pub padding: [u32; 2],
}

/// The light that a path has found, likewise.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Found {
    /// Direct light, at the film.
    pub direct: [f32; 3],
    /// Number of traced rays.
    pub rays: u32,
    /// From surfaces and media.
    pub surface: [f32; 3],
    /// Number of contributing beams.
    pub beams: u32,
    /// Light scattered by media.
    pub volume: [f32; 3],
    /// Transmittance to the environment, for paths that meet no surface.
    pub let_through: f32,
}

/// Buffers by their names in kernels.
#[derive(Clone, Default)]
pub(super) struct Named<'a>(Vec<(&'static str, &'a Buffer)>);

impl<'a> Named<'a> {
    /// The buffers of a scene.
    pub fn of_world(world: &'a WorldBuffers) -> Self {
        Self(world.named().collect())
    }

    /// The same with additional buffers; among equal names the later one counts.
    pub fn with(mut self, more: &[(&'static str, &'a Buffer)]) -> Self {
        self.0.extend_from_slice(more);
        self
    }

    /// Runs a kernel with the buffers that it uses.
    pub fn run(&self, work: &mut Work, kernel: &Kernel, groups: Groups) -> Result<()> {
        let of_name = |name| {
            self.0
                .iter()
                .rev()
                .find(|(own, _)| *own == name)
                .map(|(_, buffer)| *buffer)
        };
        let buffers: Vec<&Buffer> = kernel.ready()?.buffer_names().filter_map(of_name).collect();
        work.run(kernel, &buffers, groups)?;
        Ok(())
    }
}

/// Bytes of the elements of kernel-only buffers.
pub(super) const SIZES: [(&str, u64); 7] = [
    ("Sampler", 40),
    ("SurfacePoint", 64),
    ("PathVertex", 96),
    ("PathSegment", 48),
    ("Tail", 16),
    ("PhotonRequest", 96),
    ("Material", 96),
];

/// Most branches that can wait per path. Paths through a ball, a diamond or a prism rarely have more at once; beyond
/// that, paths choose one way by chance.
const BRANCHES: u32 = 4;

/// Most waiting branches per path, if these kinds of surfaces occur: one bit each.
pub(super) fn branches(surfaces: u32) -> u32 {
    if surfaces & SPLIT_PATHS == 0 { 0 } else { BRANCHES }
}

/// Bytes per slot for branches.
pub(super) fn bytes_of_branches(surfaces: u32) -> u64 {
    u64::from(branches(surfaces)) * size_of::<Branch>() as u64
}

/// Bytes of a transmittance step along a segment.
const BYTES_OF_STEP: u64 = 24;
/// Initial room for steps per segment, on average.
const STEPS_OF_SEGMENT: u32 = 16;

/// Initial room for steps, if some medium's density varies.
pub(super) fn first_steps(slots: u32) -> u32 {
    slots.saturating_mul(STEPS_OF_SEGMENT)
}

/// Bytes per slot for steps.
pub(super) fn bytes_of_steps() -> u64 {
    4 + u64::from(STEPS_OF_SEGMENT) * BYTES_OF_STEP
}

/// Bytes per slot in all buffers, with this many records per path.
pub(super) fn bytes_of_slot(records: u32) -> u64 {
    let of_kernels: u64 = SIZES.iter().map(|(_, bytes)| bytes).sum();
    // Photon contributions and gathered light; three lists of numbers.
    (size_of::<Path>() + records as usize * size_of::<Found>()) as u64 + of_kernels + 2 * 16 + 3 * 4
}

/// Buffers for the paths of a launch, and the kernels that advance them.
pub(super) struct Paths {
    most: u32,
    most_steps: u32,
    start: Kernel,
    meet: Kernel,
    /// Present if some medium's density varies.
    cross: Option<Cross>,
    step: Kernel,
    lit: Kernel,
    /// Present if beams contribute the light of some medium.
    scattered_once: Option<Kernel>,
    add_photons: Kernel,
    add_gathered: Kernel,
    mark: Kernel,
    pack: Kernel,
    to_film: Kernel,
    threads: Sizing,
    scan: Scan,
    paths: Buffer,
    branches: Buffer,
    samplers: Buffer,
    found: Buffer,
    met: Buffer,
    vertices: Buffer,
    segments: Buffer,
    tails: Buffer,
    requests: Buffer,
    surfaces: Buffer,
    from_photons: Buffer,
    gathered: Buffer,
    alive: Buffer,
    on_way: [Buffer; 2],
    /// If light groups have layers: 0, and then their numbers, from 1 on.
    light_groups: Vec<Buffer>,
}

/// Moves paths through media of varying density.
struct Cross {
    count_steps: Kernel,
    go_through: Kernel,
    scan: Scan,
    places: Buffer,
    /// Six words per step: see `kernels/attenuation.wgsl`.
    steps: Buffer,
}

impl Paths {
    /// Most steps, for segments in media of varying density.
    pub fn most_steps(&self) -> u32 {
        self.most_steps
    }

    /// Most slots.
    pub fn most(&self) -> u32 {
        self.most
    }

    #[cfg(test)]
    pub fn bytes(&self) -> u64 {
        let Self {
            paths,
            branches,
            samplers,
            found,
            met,
            vertices,
            segments,
            tails,
            requests,
            surfaces,
            from_photons,
            gathered,
            alive,
            on_way: [first, second],
            ..
        } = self;
        let of_path = [paths, samplers, found, met, vertices, segments, tails, requests];
        let others = [branches, surfaces, from_photons, gathered, alive, first, second];
        of_path.iter().chain(&others).map(|buffer| buffer.size()).sum()
    }

    /// For at most this many slots of each pass, and transmittance steps along their segments.
    pub fn new(on: Together, world: &WorldBuffers, plan: &RenderPlan, (most, most_steps): (u32, u32)) -> Result<Self> {
        let any_beams = plan.estimators.any_beams();
        let groups = match plan.layers.groups() as u32 {
            0 => 0..0,
            groups => 0..groups + 1,
        };
        let each = |name, bytes: usize| on.empty(name, bytes as u64 * u64::from(most));
        let of_kernel = |name, of: usize| on.empty(name, SIZES[of].1 * u64::from(most));
        let with_rays = |program: &Program, entry| world.geometry.kernel(&on, program, entry);
        let of_groups = Needs {
            light_groups: world.geometry.needs.light_groups,
            ..Needs::ALL
        };
        Ok(Self {
            most,
            most_steps: if world.geometry.needs.varies { most_steps } else { 0 },
            start: on.kernel(&kernels::PATH_START, "start"),
            meet: with_rays(&kernels::PATH_MEET, "meet"),
            cross: (world.geometry.needs.varies)
                .then(|| {
                    Ok(Cross {
                        count_steps: with_rays(&kernels::PATH_CROSS, "count_steps"),
                        go_through: with_rays(&kernels::PATH_CROSS, "go_through"),
                        scan: Scan::new(on, most)?,
                        places: each("steps of segments", 4)?,
                        steps: on.empty("transmittance along segments", BYTES_OF_STEP * u64::from(most_steps))?,
                    })
                })
                .transpose()?,
            step: with_rays(&kernels::PATH_STEP, "go_on"),
            lit: with_rays(&kernels::PATH_LIT, "lit"),
            scattered_once: any_beams.then(|| with_rays(&kernels::PATH_FOG, "scattered_once")),
            add_photons: on.kernel_for(&kernels::PATH_ADD, "add_photons", of_groups),
            add_gathered: on.kernel_for(&kernels::PATH_ADD, "add_gathered", of_groups),
            mark: on.kernel(&kernels::PATH_PACK, "mark"),
            pack: on.kernel(&kernels::PATH_PACK, "pack"),
            to_film: on.kernel(&kernels::PATH_FILM, "to_film"),
            threads: Sizing::new(on, "threads")?,
            scan: Scan::new(on, most)?,
            paths: each("paths", size_of::<Path>())?,
            branches: each(
                "branches of paths",
                bytes_of_branches(world.geometry.needs.surfaces) as usize,
            )?,
            samplers: of_kernel("random numbers of paths", 0)?,
            found: each(
                "what paths have found",
                constants::records(&plan.layers) as usize * size_of::<Found>(),
            )?,
            met: of_kernel("what paths have met", 1)?,
            vertices: of_kernel("vertices of paths", 2)?,
            segments: of_kernel("segments of paths", 3)?,
            tails: of_kernel("throughput of segments", 4)?,
            requests: of_kernel("what is asked of photons", 5)?,
            surfaces: of_kernel("surfaces at vertices", 6)?,
            from_photons: each("what photons bring", 16)?,
            gathered: each("what is gathered", 16)?,
            alive: each("paths that go on", 4)?,
            on_way: [each("paths on their way", 4)?, each("paths on their way", 4)?],
            light_groups: groups
                .map(|number| on.device.buffer("group of lights", &[number]))
                .collect::<Result<_>>()?,
        })
    }
}

/// Active paths of a launch.
pub(super) struct Launch<'a> {
    paths: &'a Paths,
    /// Buffers of the scene, and the launch's constants.
    given: Named<'a>,
    /// What photons have stored.
    photons: Option<&'a Photons>,
    world: &'a WorldBuffers,
    /// Key of the chords' random numbers.
    key: &'a Buffer,
    /// The number of slots, in its first word.
    count: &'a Buffer,
    /// Which of two lists holds the slots of active paths.
    from: usize,
    /// Segments are coherent in groups of 64.
    is_first: bool,
    slots: u32,
}

/// The inputs of a launch.
#[derive(Clone)]
pub(super) struct Given<'a> {
    /// The scene.
    pub world: &'a WorldBuffers,
    /// Its buffers, and the launch's constants.
    pub named: Named<'a>,
    /// What photons have stored.
    pub photons: Option<&'a Photons>,
    /// Key of the chords' random numbers.
    pub key: &'a Buffer,
    /// The number of slots, in its first word.
    pub count: &'a Buffer,
    /// The number of slots.
    pub slots: u32,
}

impl<'a> Launch<'a> {
    /// Starts paths at the camera.
    pub fn new(work: &mut Work, paths: &'a Paths, given: Given<'a>) -> Result<Self> {
        let Given {
            world,
            named,
            photons,
            key,
            count,
            slots,
        } = given;
        let mut launch = Self {
            paths,
            given: named,
            photons,
            world,
            key,
            count,
            from: 0,
            is_first: true,
            slots: slots.min(paths.most),
        };
        let groups = Groups::Count(launch.slots.div_ceil(64));
        launch.named().run(work, &paths.start, groups)?;
        // Slots beyond the borders of the picture have no path.
        paths.threads.run(work, launch.count)?;
        launch.pack(work)?;
        Ok(launch)
    }

    /// All buffers that path kernels may use.
    pub fn named(&self) -> Named<'a> {
        let paths = self.paths;
        let crossing = paths.cross.as_ref().map(|cross| {
            [
                ("step_places", &cross.places),
                ("all_steps", cross.scan.total()),
                ("segment_steps", &cross.steps),
            ]
        });
        let given = self.given.clone().with(crossing.as_ref().map_or(&[], |all| &all[..]));
        given.with(&[
            ("sizes", &paths.threads.sizes),
            ("paths", &paths.paths),
            ("branches", &paths.branches),
            ("samplers", &paths.samplers),
            ("found", &paths.found),
            ("met", &paths.met),
            ("path_vertices", &paths.vertices),
            ("segments", &paths.segments),
            ("tails", &paths.tails),
            ("requests", &paths.requests),
            ("asked_surfaces", &paths.surfaces),
            ("from_photons", &paths.from_photons),
            ("gathered", &paths.gathered),
            ("alive", &paths.alive),
            ("alive_count", paths.scan.total()),
            ("on_way", &paths.on_way[self.from]),
            ("next_on_way", &paths.on_way[1 - self.from]),
        ])
    }

    /// Keeps only active paths.
    fn pack(&mut self, work: &mut Work) -> Result<()> {
        let paths = self.paths;
        let named = self.named();
        let groups = Groups::From(&paths.threads.sizes);
        named.run(work, &paths.mark, groups)?;
        paths.scan.run(work, self.count, &paths.alive)?;
        named.run(work, &paths.pack, groups)?;
        self.from = 1 - self.from;
        self.count = paths.scan.total();
        Ok(())
    }

    /// Advances all paths by one step.
    pub fn round(&mut self, work: &mut Work) -> Result<()> {
        let paths = self.paths;
        paths.threads.run(work, self.count)?;
        let of_all_light = self.named();
        let groups = Groups::From(&paths.threads.sizes);
        of_all_light.run(work, &paths.meet, groups)?;
        if let Some(cross) = &paths.cross {
            of_all_light.run(work, &cross.count_steps, groups)?;
            cross.scan.run(work, self.count, &cross.places)?;
            of_all_light.run(work, &cross.go_through, groups)?;
        }
        let own = [&paths.step, &paths.lit];
        for kernel in own.into_iter().chain(&paths.scattered_once) {
            of_all_light.run(work, kernel, groups)?;
        }
        if let Some(photons) = self.photons {
            let asked = |light_group| Asked {
                count: self.count,
                segments: &paths.segments,
                steps: paths.cross.as_ref().map(|cross| &cross.steps),
                key: self.key,
                gathered: &paths.gathered,
                requests: &paths.requests,
                surfaces: &paths.surfaces,
                from_photons: &paths.from_photons,
                light_group,
            };
            // For all lights together, and then by group.
            let of_groups = paths.light_groups.iter().map(Some);
            let of_all = paths.light_groups.is_empty().then_some(None);
            for light_group in of_all.into_iter().chain(of_groups) {
                let asked = asked(light_group);
                let named = light_group.map(|number| of_all_light.clone().with(&[("of_light_group", number)]));
                let named = named.as_ref().unwrap_or(&of_all_light);
                if photons.has_surface() {
                    photons.estimate(work, self.world, &asked)?;
                    named.run(work, &paths.add_photons, groups)?;
                }
                if photons.has_beams() {
                    let way = if self.is_first { Way::ByTile } else { Way::ByRay };
                    photons.gather(work, self.world, way, &asked)?;
                    named.run(work, &paths.add_gathered, groups)?;
                }
            }
        }
        self.is_first = false;
        self.pack(work)
    }

    /// Writes the light found so far to the film, and the pass's state to its head.
    pub fn to_film(&self, work: &mut Work, film: &'a Buffer) -> Result<()> {
        let groups = Groups::Count(self.slots.div_ceil(64));
        self.named()
            .with(&[("film", film)])
            .run(work, &self.paths.to_film, groups)
    }
}
