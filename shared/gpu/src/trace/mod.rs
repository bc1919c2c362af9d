//! A pass's photon paths on a device: the beams and surface photons that they store, in the order of paths.
//!
//! Paths are traced twice: first their beams and photons are counted, then they are written to their places. A path
//! queries the scene with one ray after another, for every purpose: what it meets, whether a displaced kernel is on the
//! same surface, which boundaries coincide. So a kernel contains a single ray search, and a dispatch advances each path
//! by a few rays.
//!
//! | question                                           | module, kernels                              |
//! | -------------------------------------------------- | -------------------------------------------- |
//! | what does a path depend on besides the scene?      | [`TraceTables`]; `trace_plan.wgsl`           |
//! | how large is a photon's footprint?                 | `footprint.wgsl`                             |
//! | how much of a kernel misses its surface?           | `edges.wgsl`                                 |
//! | what is a photon's state, and where does it start? | `photon_path.wgsl`                           |
//! | what is it aimed at?                               | [`FlatAims`](crate::world::aims); `aim.wgsl` |
//! | how does it travel?                                | `trace.wgsl`                                 |
//! | which walls cross a photon's kernel?               | [`PhotonWalls`]; `photon_walls.wgsl`         |

mod crossing;
mod plan;
mod rounds;
#[cfg(test)]
mod tests;

pub use crossing::PhotonWalls;
pub(crate) use plan::number_of_group;
pub use plan::{TraceBuffers, TracePlan, TraceTables, TracedLight, TracedMedium, TracedObject};

use crate::beams::{Beam, BeamEnds};
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::TRACE;
use crate::photons::SurfacePhoton;
use crate::scan::Scan;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::WorldBuffers;
use bytemuck::{Pod, Zeroable};
use rounds::{Batch, Phase};

/// Bytes of a path's state.
const STATE: u64 = 384;

/// Capacities of a pass's buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacities {
    /// Beams.
    pub beams: u32,
    /// Surface photons.
    pub photons: u32,
    /// Transmittance steps along beams in media of varying density.
    pub steps: u32,
}

/// Outcome of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Told {
    /// Beams that paths produce. Above the capacity, the excess ones are missing.
    pub beams: u32,
    /// Surface photons that they produce; likewise.
    pub photons: u32,
    /// Paths that are unfinished after the maximum number of rays: their remaining results are missing.
    pub unfinished: u32,
    /// Transmittance steps along beams in media of varying density. Above the capacity, those of some beams are
    /// missing.
    pub steps: u32,
}

/// Traces the photon paths of passes of one size.
pub struct Trace {
    begin: Kernel,
    advance: Kernel,
    look_for_live: Kernel,
    list_live: Kernel,
    count_left: Kernel,
    tell_live: Kernel,
    tell: Kernel,
    batches: Vec<Batch>,
    /// Dispatches before each check for remaining paths.
    rounds: Vec<u32>,
    live_scan: Scan,
    live_threads: Sizing,
    beam_scan: Scan,
    photon_scan: Scan,
    /// Present if some medium's density varies.
    steps: Option<Steps>,
    paths: Buffer,
    states: Buffer,
    live: Buffer,
    live_before: Buffer,
    beam_places: Buffer,
    photon_places: Buffer,
    beam_count: Buffer,
    photon_count: Buffer,
    told: Buffer,
    beams: Buffer,
    beam_ends: Buffer,
    photons: Buffer,
}

/// Transmittance along beams in media of varying density.
struct Steps {
    scan: Scan,
    places: Buffer,
    /// Two words per beam, and six per step: see `kernels/attenuation.wgsl`.
    steps: Buffer,
}

impl Trace {
    /// For passes of this many paths, on the scene's device.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, world: &WorldBuffers, paths: u32, most: Capacities) -> Result<Self> {
        let on = on.into();
        Self::with(on, world, (paths, most), rounds::Sizes::of(&on.device))
    }

    /// The same for paths with fewer rays, which takes less time: [`Told::unfinished`] counts those that need more.
    ///
    /// # Errors
    /// Device errors.
    pub fn of_rays(on: Together, world: &WorldBuffers, (paths, most): (u32, Capacities), rays: u32) -> Result<Self> {
        let sizes = rounds::Sizes::of(&on.device);
        let most_rays = rays.next_multiple_of(sizes.turns).min(sizes.most);
        let sizes = rounds::Sizes {
            most: most_rays,
            ..sizes
        };
        Self::with(on, world, (paths, most), sizes)
    }

    /// The same with other batch sizes, which change no bit.
    fn with<'a>(
        on: impl Into<Together<'a>>,
        world: &WorldBuffers,
        (paths, most): (u32, Capacities),
        sizes: rounds::Sizes,
    ) -> Result<Self> {
        let on = on.into();
        let kernel = |entry: &str| world.geometry.kernel(&on, &TRACE, entry);
        let each = |name, bytes: u64, count: u32| on.empty(name, bytes * u64::from(count));
        let batch = sizes.batch.min(paths).max(1);
        Ok(Self {
            begin: on.kernel_for(&TRACE, "begin", world.needs_of_starts),
            advance: kernel("advance"),
            look_for_live: kernel("look_for_live"),
            list_live: kernel("list_live"),
            count_left: kernel("count_left"),
            tell_live: kernel("tell_live"),
            tell: kernel("tell"),
            batches: rounds::batches(&on, paths, &sizes, most)?,
            rounds: sizes.rounds(),
            live_scan: Scan::new(on, batch)?,
            live_threads: Sizing::new(on, "threads")?,
            beam_scan: Scan::new(on, paths)?,
            photon_scan: Scan::new(on, paths)?,
            steps: (world.geometry.needs.varies)
                .then(|| {
                    Ok(Steps {
                        scan: Scan::new(on, paths)?,
                        places: each("steps of paths", 4, paths)?,
                        steps: on.empty("transmittance along beams", bytes_of_steps(most))?,
                    })
                })
                .transpose()?,
            paths: on.value("number of photon paths", paths)?,
            states: each("photon paths", STATE, batch)?,
            live: each("paths that are left", 4, batch)?,
            live_before: each("places of paths that are left", 4, batch)?,
            beam_places: each("beams of paths", 4, paths)?,
            photon_places: each("photons of paths", 4, paths)?,
            beam_count: each("number of beams", 4, 1)?,
            photon_count: each("number of photons", 4, 1)?,
            told: each("what is told of photon paths", size_of::<Told>() as u64, 1)?,
            beams: each("beams", size_of::<Beam>() as u64, most.beams)?,
            beam_ends: each("ends of beams", size_of::<BeamEnds>() as u64, most.beams)?,
            photons: each("photons", size_of::<SurfacePhoton>() as u64, most.photons)?,
        })
    }

    /// Traces the paths of a pass; their number is fixed at construction.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, world: &WorldBuffers, tables: &TraceBuffers) -> Result<()> {
        let run = Run {
            trace: self,
            world,
            tables,
        };
        for batch in &self.batches {
            run.batch(work, batch, &batch.counting)?;
            run.kernel(work, &self.count_left, &batch.counting, Groups::Count(batch.groups()))?;
        }
        self.beam_scan.run(work, &self.paths, &self.beam_places)?;
        self.photon_scan.run(work, &self.paths, &self.photon_places)?;
        if let Some(Steps { scan, places, .. }) = &self.steps {
            scan.run(work, &self.paths, places)?;
        }
        for batch in &self.batches {
            run.batch(work, batch, &batch.writing)?;
            run.kernel(work, &self.tell_live, &batch.writing, Groups::Count(1))?;
        }
        if let Some(last) = self.batches.last() {
            run.kernel(work, &self.tell, &last.writing, Groups::Count(1))?;
        }
        Ok(())
    }

    /// The number of [`Self::beams`], in its first word.
    #[must_use]
    pub fn beam_count(&self) -> &Buffer {
        &self.beam_count
    }

    /// [`Beam`]s in the order of their paths.
    #[must_use]
    pub fn beams(&self) -> &Buffer {
        &self.beams
    }

    /// What each beam starts and ends on: [`BeamEnds`].
    #[must_use]
    pub fn beam_ends(&self) -> &Buffer {
        &self.beam_ends
    }

    /// In a scene with varying densities, the beams' part of [`crate::beams::Functions`].
    #[must_use]
    pub fn steps(&self) -> Option<&Buffer> {
        self.steps.as_ref().map(|steps| &steps.steps)
    }

    /// The number of [`Self::photons`], in its first word.
    #[must_use]
    pub fn photon_count(&self) -> &Buffer {
        &self.photon_count
    }

    /// [`SurfacePhoton`]s in the order of their paths, before [`PhotonWalls`] are found.
    #[must_use]
    pub fn photons(&self) -> &Buffer {
        &self.photons
    }

    /// One [`Told`]: whether the pass is complete.
    #[must_use]
    pub fn told(&self) -> &Buffer {
        &self.told
    }
}

/// Bytes of the transmittance along beams.
pub(crate) fn bytes_of_steps(most: Capacities) -> u64 {
    8 * u64::from(most.beams) + 24 * u64::from(most.steps)
}

/// The trace of one pass.
struct Run<'a> {
    trace: &'a Trace,
    world: &'a WorldBuffers,
    tables: &'a TraceBuffers,
}

impl Run<'_> {
    /// Traces the paths of a batch from start to end.
    fn batch(&self, work: &mut Work, batch: &Batch, phase: &Phase) -> Result<()> {
        let trace = self.trace;
        let all = Groups::Count(batch.groups());
        self.kernel(work, &trace.begin, phase, all)?;
        trace.live_threads.run(work, &batch.count)?;
        for rounds in &trace.rounds {
            for _ in 0..*rounds {
                self.kernel(work, &trace.advance, phase, Groups::From(&trace.live_threads.sizes))?;
            }
            self.kernel(work, &trace.look_for_live, phase, all)?;
            trace.live_scan.run(work, &batch.count, &trace.live_before)?;
            self.kernel(work, &trace.list_live, phase, all)?;
            trace.live_threads.run(work, trace.live_scan.total())?;
        }
        Ok(())
    }

    fn kernel(&self, work: &mut Work, kernel: &Kernel, phase: &Phase, groups: Groups) -> Result<()> {
        let buffers: Vec<&Buffer> = kernel
            .ready()?
            .buffer_names()
            .filter_map(|name| self.buffer(name, phase))
            .collect();
        work.run(kernel, &buffers, groups)?;
        Ok(())
    }

    /// A buffer by its name in kernels.
    fn buffer<'a>(&'a self, name: &str, phase: &'a Phase) -> Option<&'a Buffer> {
        let (trace, tables) = (self.trace, self.tables);
        Some(match name {
            "sizes" => &trace.live_threads.sizes,
            "trace_round" => &phase.round,
            "paths" => &trace.states,
            "live" => &trace.live,
            "live_before" => &trace.live_before,
            "live_count" => trace.live_scan.total(),
            "beam_places" => &trace.beam_places,
            "photon_places" => &trace.photon_places,
            "all_beams" => trace.beam_scan.total(),
            "all_photons" => trace.photon_scan.total(),
            "beam_count" => &trace.beam_count,
            "photon_count" => &trace.photon_count,
            "told" => &trace.told,
            "beams" => &trace.beams,
            "beam_ends" => &trace.beam_ends,
            "surface_photons" => &trace.photons,
            "step_places" => &trace.steps.as_ref()?.places,
            "all_steps" => trace.steps.as_ref()?.scan.total(),
            "beam_steps" => &trace.steps.as_ref()?.steps,
            "trace_plan" => &tables.plan,
            "traced_lights" => &tables.lights,
            "traced_media" => &tables.media,
            "traced_objects" => &tables.objects,
            name => {
                return self
                    .world
                    .named()
                    .find(|(own, _)| *own == name)
                    .map(|(_, buffer)| buffer);
            }
        })
    }
}
