//! Whole passes on a device: photons, what they store, camera paths, and the film.
//!
//! | question                                        | module                              |
//! | ----------------------------------------------- | ----------------------------------- |
//! | why can a device not render a scene or plan?    | `reasons`                           |
//! | what are a pass's inputs besides the scene?     | `constants`                         |
//! | how many passes have room together?             | `buffers`                           |
//! | what does a pass see of a moving scene?         | `moment`                            |
//! | what do photons store?                          | `photons`                           |
//! | how do camera paths go on?                      | `paths`; `kernels/path.wgsl`        |
//! | how are layers other than the picture rendered? | `layers`; `kernels/path_first.wgsl` |

mod buffers;
mod constants;
mod layers;
mod moment;
mod paths;
mod photons;
mod reasons;
mod seen;
#[cfg(test)]
mod tests;

use crate::device::{Kind, Reading, Work};
use crate::error::{Error, Result};
use crate::self_test::{Tested, Together};
use crate::trace::{Told, TraceTables};
use crate::world::reason::Reason;
use crate::world::waves::Waves;
use crate::world::{FlatWorld, WorldBuffers};
use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::radius::Schedule;
use beamfarm_render::cpu::pass::along_rays;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::{CameraWork, PassImage};
use beamfarm_render::world::{Motion, Scene};
use buffers::{Buffers, fewer_where_full, passes_for};
use constants::{PassConstants, Slots};
use layers::{First, Known};
pub use moment::Kept;
use moment::Moment;
use paths::{Found, Given, Launch, Named, Paths};
use photons::{Photons, Room};
use seen::Seen;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most path slots in flight together.
const MOST_SLOTS: u32 = 1 << 18;
/// The same for software drivers, which are given up if one submission takes too long.
const MOST_SLOTS_OF_SOFTWARE: u32 = 1 << 14;
/// Slots of a tile of 8 x 8 pixels.
const TILE: u32 = 64;
/// Elements of a film before its pixels.
const HEAD: usize = 4;
/// Steps submitted at first, before anything is known of a scene's paths.
const ROUNDS: u32 = 32;

/// Device memory of passes, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The scene.
    pub world: u64,
    /// Photons, beams and their search structures.
    pub photons: u64,
    /// Camera paths, and the film.
    pub paths: u64,
}

impl Memory {
    /// The total.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.world + self.photons + self.paths
    }
}

/// Renders passes of a scene on a device by a plan.
pub struct GpuPass<'a> {
    tested: &'a Tested,
    scene: &'a Scene,
    plan: &'a RenderPlan,
    world: WorldBuffers,
    /// For a scene with motion blur or revisions: the data on the device.
    flat: Option<FlatWorld>,
    /// Passes in flight use them in turn.
    buffers: Mutex<Buffers>,
    /// Whether passes are submitted before earlier ones are back. A software driver gains nothing by it, and is given
    /// up if it takes too long.
    is_ahead: bool,
}

impl<'a> GpuPass<'a> {
    /// All reasons why devices whose largest buffer has this many bytes cannot render a scene and its plan.
    #[must_use]
    pub fn reasons(scene: &Scene, plan: &RenderPlan, largest_buffer: u64) -> Vec<Reason> {
        let mut reasons = FlatWorld::new(scene, largest_buffer).err().unwrap_or_default();
        reasons.extend(reasons::of_plan(plan));
        reasons
    }

    /// Approximate memory of passes on a card; zero for a scene that devices cannot render.
    #[must_use]
    pub fn memory(scene: &Scene, plan: &RenderPlan) -> Memory {
        let Ok(world) = FlatWorld::new(scene, u64::MAX) else {
            return Memory::default();
        };
        let world = world.planned_by(scene, plan);
        let camera = &scene.description().camera;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let together = u64::from(slots(scene).min(MOST_SLOTS));
        let of_slot = paths::bytes_of_slot(constants::records(&plan.layers))
            + paths::bytes_of_branches(world.materials.needs())
            + if world.varies() { paths::bytes_of_steps() } else { 0 };
        Memory {
            world: world.bytes(),
            photons: if plan.has_photons() {
                photons::bytes(scene, plan)
            } else {
                0
            },
            paths: together * of_slot
                + constants::elements_of_film(&plan.layers, pixels) * size_of::<Found>() as u64
                + layers::bytes(&plan.layers, pixels),
        }
    }

    /// Uploads a scene to a device.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] with all of [`Self::reasons`], and device errors.
    pub fn new(tested: &'a Tested, scene: &'a Scene, plan: &'a RenderPlan) -> Result<Self> {
        let (most, _) = room(tested, scene);
        let passes = match tested.device.listed().kind {
            Kind::Software => 1,
            _ => passes_for(Self::memory(scene, plan), slots(scene), tested.device.listed().memory),
        };
        Self::with_room(tested, scene, plan, (most, passes))
    }

    /// With at most this many path slots, a multiple of a tile's; and this many passes together, if all slots of each
    /// have room.
    fn with_room(
        tested: &'a Tested,
        scene: &'a Scene,
        plan: &'a RenderPlan,
        (most, passes): (u32, u32),
    ) -> Result<Self> {
        let flat = flatten(tested, scene, plan)?;
        let world = flat.upload(&tested.device)?;
        let all = slots(scene);
        // With motion, each pass sees another moment.
        let passes = if all <= most && !moves(scene) { passes.max(1) } else { 1 };
        let seen = Seen {
            scene,
            plan,
            world: &world,
        };
        let buffers = Buffers::new(tested, seen, (most.min(all), passes))?;
        tested.compile()?;
        Ok(Self::with_buffers(
            tested,
            (scene, plan),
            (moves(scene).then_some(flat), world),
            buffers,
        ))
    }

    fn with_buffers(
        tested: &'a Tested,
        (scene, plan): (&'a Scene, &'a RenderPlan),
        (flat, world): (Option<FlatWorld>, WorldBuffers),
        buffers: Buffers,
    ) -> Self {
        Self {
            tested,
            scene,
            plan,
            world,
            flat,
            buffers: Mutex::new(buffers),
            is_ahead: tested.device.listed().kind != Kind::Software,
        }
    }

    /// Most passes that are rendered together.
    #[must_use]
    pub fn passes_together(&self) -> usize {
        self.lock().passes as usize
    }

    fn lock(&self) -> MutexGuard<'_, Buffers> {
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[cfg(test)]
    fn bytes_of_paths(&self) -> u64 {
        let buffers = self.lock();
        buffers.paths.bytes() + buffers.film.size()
    }

    /// Renders a pass. The bits are the same on every device.
    ///
    /// # Errors
    /// Device errors.
    pub fn render(&self, pass_index: u64) -> Result<PassImage> {
        let mut images = self.render_all(&[pass_index])?;
        images
            .pop()
            .ok_or_else(|| self.refused(pass_index, "it is missing".to_owned()))
    }

    /// Renders passes, [several together](Self::passes_together), each with the same bits as alone.
    ///
    /// # Errors
    /// Device errors.
    pub fn render_all(&self, indices: &[u64]) -> Result<Vec<PassImage>> {
        let mut images = Vec::new();
        for indices in indices.chunks(self.passes_together()) {
            images.extend(self.end(self.begin(indices)?)?);
        }
        Ok(images)
    }

    /// Submits passes without waiting, so that the device has work while earlier ones are read back.
    ///
    /// # Errors
    /// Device errors.
    pub fn begin(&self, indices: &[u64]) -> Result<Begun> {
        let mut films = None;
        let all = slots(self.scene);
        let mut buffers = self.lock();
        let have_room = all <= buffers.paths.most() && (1..=buffers.passes as usize).contains(&indices.len());
        if self.is_ahead && have_room {
            let moment = self.moment(&mut buffers, indices[0])?;
            let seen = moment.as_ref().map_or_else(|| self.still(), Moment::seen);
            self.photons(&buffers, indices, seen)?;
            let device = &self.tested.device;
            films = Some(
                self.launch(&buffers, (indices, seen), (0, all), |mut launch, mut work| {
                    for _ in 0..buffers.rounds {
                        launch.round(&mut work)?;
                    }
                    launch.to_film(&mut work, &buffers.film)?;
                    work.submit()?;
                    let firsts = buffers.firsts.as_ref();
                    let count = indices.len() * self.pixels();
                    let firsts = firsts.map(|firsts| device.begin_read::<First>(&firsts.found, count));
                    let film = device.begin_read::<Found>(&buffers.film, indices.len() * self.elements_of_film())?;
                    Ok((film, firsts.transpose()?))
                })?,
            );
        }
        let (room, steps) = (buffers.room(), buffers.paths.most_steps());
        Ok(Begun {
            indices: indices.to_vec(),
            films,
            room,
            steps,
        })
    }

    /// Waits for passes that were [begun](Self::begin); renders them again if something was missing.
    ///
    /// # Errors
    /// Device errors.
    pub fn end(&self, begun: Begun) -> Result<Vec<PassImage>> {
        let Begun {
            indices,
            films,
            room,
            steps,
        } = begun;
        let device = &self.tested.device;
        let mut found = None;
        if let Some((film, firsts)) = films {
            let firsts = firsts.map(|firsts| device.end_read::<First>(firsts)).transpose()?;
            found = Some((device.end_read::<Found>(film)?, firsts.unwrap_or_default()));
        }
        let mut buffers = self.lock();
        // If paths are left, everything is done again.
        let known = found.and_then(|(found, firsts)| Gone::all(&found, &firsts, indices.len()));
        let have_ended = |gone: &Gone| gone.left == 0 && gone.most_steps <= steps;
        let mut known = known.filter(|gone| gone.iter().all(have_ended));
        if let Some(gone) = &known {
            buffers.rounds = steps_for(gone);
        }
        let mut room = room;
        let mut images = Vec::new();
        while let rest = &indices[images.len()..]
            && !rest.is_empty()
        {
            let gone = match known.take() {
                Some(gone) => gone,
                None => {
                    let moment = self.moment(&mut buffers, rest[0])?;
                    let seen = moment.as_ref().map_or_else(|| self.still(), Moment::seen);
                    let together = &rest[..rest.len().min(buffers.passes as usize)];
                    room = buffers.room();
                    self.photons(&buffers, together, seen)?;
                    self.camera(&mut buffers, together, seen)?
                }
            };
            if let Some(had) = room {
                let more = gone.iter().fold(had, |room, gone| room.more(&gone.told));
                let unfinished = gone.iter().zip(rest).find(|(gone, _)| gone.told.unfinished > 0);
                if more != had || unfinished.is_some() {
                    // Earlier passes may have grown the room since these were submitted.
                    if buffers.room() == room {
                        if let (true, Some((gone, index))) = (more == had, unfinished) {
                            let paths = gone.told.unfinished;
                            return Err(self.refused(*index, format!("{paths} photon paths do not come to an end")));
                        }
                        let moment = self.moment(&mut buffers, rest[0])?;
                        let seen = moment.as_ref().map_or_else(|| self.still(), Moment::seen);
                        self.make_room(&mut buffers, more, seen)?;
                    }
                    // With enough room and time the bits are unaffected.
                    continue;
                }
            }
            for (gone, index) in gone.iter().zip(rest) {
                images.push(self.picture(*index, gone)?);
            }
        }
        Ok(images)
    }

    /// Makes more room for photons; for fewer passes together if memory is short.
    fn make_room(&self, buffers: &mut Buffers, room: Room, seen: Seen) -> Result<()> {
        buffers.photons = None;
        (buffers.photons, buffers.passes) = fewer_where_full(buffers.passes, |passes| {
            let on = self.together(passes);
            let photons = Photons::new(on, seen, room)?;
            Ok((Some(photons), passes))
        })?;
        Ok(())
    }

    fn together(&self, passes: u32) -> Together<'a> {
        let tested = self.tested;
        Together { tested, passes }
    }

    fn refused(&self, pass_index: u64, reason: String) -> Error {
        Error::Refused {
            device: self.tested.device.listed().name.clone(),
            what: format!("pass {pass_index}"),
            reason,
        }
    }

    /// Traces the photons of passes, if they have any.
    fn photons(&self, buffers: &Buffers, indices: &[u64], seen: Seen) -> Result<()> {
        let Some(photons) = &buffers.photons else {
            // They were dropped to grow the room, and memory was short: without them the picture would be dark.
            return match indices.first() {
                Some(first) if seen.plan.has_photons() => {
                    Err(self.refused(*first, "its photons have no room".to_owned()))
                }
                _ => Ok(()),
            };
        };
        let tables: Vec<_> = (indices.iter())
            .map(|index| TraceTables::new(seen.scene, seen.plan, *index))
            .collect();
        photons.run(self.together(indices.len() as u32), seen.world, &tables)?;
        if self.tested.device.listed().kind == Kind::Software {
            // Keeps each wait short.
            self.tested.device.finish()?;
        }
        Ok(())
    }

    /// The film and statistics of a pass.
    fn picture(&self, pass_index: u64, gone: &Gone) -> Result<PassImage> {
        let Gone {
            told, found, firsts, ..
        } = gone;
        let camera = &self.scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        let mut work = CameraWork::default();
        for (pixel, found) in film.pixels.iter_mut().zip(found) {
            *pixel = std::array::from_fn(|c| found.direct[c] + found.surface[c] + found.volume[c]);
            work.rays += u64::from(found.rays);
            work.evaluations += u64::from(found.beams);
        }
        let (mut layers, mut mattes) = (Vec::new(), Vec::new());
        if !self.plan.layers.layers.is_empty() {
            let known = Known {
                pass_index,
                picture: &film,
                found,
                firsts,
            };
            let mut along = Vec::new();
            if self.plan.layers.counts_targets() || self.plan.layers.has_motion() {
                // Rays without paths: processors are as fast.
                along = along_rays(self.scene, self.plan, pass_index)
                    .map_err(|why| self.refused(pass_index, why.to_string()))?;
            }
            (layers, mattes) = layers::of_pass(&self.plan.layers, known, along);
        }
        if let Some(offset) = constants::offset(self.scene, self.plan, pass_index) {
            camera.filter.reconstruct(layers.iter_mut().chain([&mut film]), offset);
        }
        let stats = PassStats {
            paths: if self.plan.has_photons() {
                self.plan.surface_paths.into()
            } else {
                0
            },
            beams: told.beams.into(),
            surface_photons: told.photons.into(),
            beam_evaluations: work.evaluations,
            non_finite: layers.iter().chain([&film]).map(Film::non_finite).sum(),
            ..PassStats::default()
        };
        Ok(PassImage {
            film,
            layers,
            mattes,
            radius_scale: Schedule::new(&self.plan.settings).scale(pass_index),
            stats,
            photon_rays: 0,
            camera: work,
        })
    }

    /// What the paths of all pixels find, pass by pass.
    fn camera(&self, buffers: &mut Buffers, indices: &[u64], seen: Seen) -> Result<Vec<Gone>> {
        let device = &self.tested.device;
        let (all, most) = (slots(self.scene), buffers.paths.most());
        let mut steps = 0;
        let mut first = 0;
        while first < all {
            let count = most.min(all - first);
            let is_last = first + count == all;
            let gone = self.launch(buffers, (indices, seen), (first, count), |mut launch, mut work| {
                loop {
                    for _ in 0..buffers.rounds {
                        launch.round(&mut work)?;
                    }
                    launch.to_film(&mut work, &buffers.film)?;
                    work.submit()?;
                    // Usually the only read that is waited for: only extremely long paths need more. If this is not the
                    // last part, there is one pass.
                    let elements = if is_last { self.elements_of_film() } else { HEAD };
                    let found = device.read::<Found>(&buffers.film, indices.len() * elements)?;
                    let mut firsts = Vec::new();
                    if let Some(buffer) = buffers.firsts.as_ref().filter(|_| is_last) {
                        firsts = device.read::<First>(&buffer.found, indices.len() * self.pixels())?;
                    }
                    match Gone::all(&found, &firsts, indices.len()) {
                        Some(gone) if gone.iter().any(|gone| gone.left > 0) => {
                            work = self.together(indices.len() as u32).work()
                        }
                        gone => return Ok(gone),
                    }
                }
            })?;
            let Some(gone) = gone else { break };
            let most_steps = gone.iter().map(|gone| gone.most_steps).max().unwrap_or_default();
            if most_steps > buffers.paths.most_steps() {
                // Repeats with room for all of them.
                let room = (most, most_steps.saturating_add(most_steps / 4));
                buffers.paths = Paths::new(self.together(buffers.passes), seen.world, seen.plan, room)?;
                continue;
            }
            first += count;
            steps = steps.max(steps_for(&gone));
            if is_last {
                buffers.rounds = steps;
                return Ok(gone);
            }
        }
        let first = indices.first().copied().unwrap_or_default();
        Err(self.refused(first, "its film is cut off".to_owned()))
    }

    /// Begins the paths of some slots of passes: the first slot, and their number.
    fn launch<R>(
        &self,
        buffers: &Buffers,
        (indices, seen): (&[u64], Seen),
        (first, count): (u32, u32),
        go_on: impl FnOnce(Launch, Work<'a>) -> Result<R>,
    ) -> Result<R> {
        let on = self.together(indices.len() as u32);
        let columns = seen.scene.description().camera.width.div_ceil(8);
        let branches = paths::branches(seen.world.geometry.needs.surfaces);
        let slots = Slots {
            first,
            count,
            columns,
            branches,
        };
        let constants: Vec<_> = (indices.iter())
            .map(|index| PassConstants::new(seen.scene, seen.plan, *index, slots))
            .collect();
        let uses: Vec<_> = (indices.iter())
            .flat_map(|index| constants::uses(seen.scene, seen.plan, *index))
            .collect();
        let words = |index: &u64| Waves::new(seen.scene, seen.plan, *index).words();
        let keys: Vec<_> = (constants.iter().zip(indices))
            .flat_map(|(constants, index)| [vec![constants.chord_key], words(index)].concat())
            .collect();
        let uses = on.device.parts("lights and media of the plan", &uses, on.passes)?;
        let key = on.device.parts("key of chords", &keys, on.passes)?;
        let constants = on.device.parts("plan", &constants, on.passes)?;
        let nothing = on.value("nothing told", Told::default())?;
        let count = on.value("slots", slots.count)?;
        let rounds_taken = on.value("rounds", [0_u32; 2])?;
        let named = Named::of_world(seen.world).with(&[
            ("constants", &constants),
            ("uses", &uses),
            ("rounds_taken", &rounds_taken),
            ("told", buffers.photons.as_ref().map_or(&nothing, Photons::told)),
        ]);
        let given = Given {
            world: seen.world,
            named,
            photons: buffers.photons.as_ref(),
            key: &key,
            count: &count,
            slots: slots.count,
        };
        let mut work = on.work();
        let launch = Launch::new(&mut work, &buffers.paths, given)?;
        if let Some(firsts) = &buffers.firsts {
            firsts.run(&mut work, &launch.named(), slots.count)?;
        }
        go_on(launch, work)
    }

    /// Elements of a pass's film, including the head.
    fn elements_of_film(&self) -> usize {
        constants::elements_of_film(&self.plan.layers, self.pixels() as u64) as usize
    }

    fn pixels(&self) -> usize {
        let camera = &self.scene.description().camera;
        camera.width as usize * camera.height as usize
    }
}

/// Submitted passes.
#[derive(Debug)]
pub struct Begun {
    indices: Vec<u64>,
    /// Their films and first surfaces on the way back; none if everything is still to be done.
    films: Option<(Reading, Option<Reading>)>,
    /// The room for their photons.
    room: Option<Room>,
    /// The room for steps of their segments.
    steps: u32,
}

/// The outcome of a pass, from the head of its film: see `kernels/path_film.wgsl`.
struct Gone {
    told: Told,
    /// Unfinished paths.
    left: u32,
    /// Steps that paths have taken.
    steps: u32,
    /// Most transmittance steps along the segments of any step. Above the available room, gathered light is missing.
    most_steps: u32,
    /// By pixel, then by record: see [`constants::records`].
    found: Vec<Found>,
    /// By pixel, if a layer needs first surfaces.
    firsts: Vec<First>,
}

impl Gone {
    /// From the films and first surfaces of this many passes.
    fn all(films: &[Found], firsts: &[First], passes: usize) -> Option<Vec<Self>> {
        let passes = passes.max(1);
        let (of_film, of_firsts) = (films.len() / passes, firsts.len() / passes);
        let films = films.chunks_exact(of_film.max(1)).enumerate();
        films
            .map(|(pass, film)| Self::new(film, &firsts[pass * of_firsts..][..of_firsts]))
            .collect()
    }

    fn new(film: &[Found], firsts: &[First]) -> Option<Self> {
        let ([head, more, steps, last], found) = film.split_first_chunk::<HEAD>()?;
        Some(Self {
            told: Told {
                beams: head.beams,
                photons: last.rays,
                unfinished: more.rays,
                steps: steps.rays,
            },
            left: head.rays,
            steps: more.beams,
            most_steps: steps.beams,
            found: found.to_vec(),
            firsts: firsts.to_vec(),
        })
    }
}

/// Steps to submit for paths like those of the given passes: slightly more than they took.
fn steps_for(passes: &[Gone]) -> u32 {
    let taken = passes.iter().map(|gone| gone.steps).max().unwrap_or_default();
    taken + taken / 4 + 1
}

/// Whether anything moves during the exposure.
fn moves(scene: &Scene) -> bool {
    scene.description().motion.as_ref().is_some_and(Motion::blurs)
}

/// Path slots of a picture.
fn slots(scene: &Scene) -> u32 {
    let camera = &scene.description().camera;
    camera.width.div_ceil(8) * camera.height.div_ceil(8) * TILE
}

/// Most path slots of a scene, and the number of passes if rendered one after the other.
fn room(tested: &Tested, scene: &Scene) -> (u32, u32) {
    let most = match tested.device.listed().kind {
        Kind::Software => MOST_SLOTS_OF_SOFTWARE,
        Kind::Discrete | Kind::Integrated | Kind::Virtual | Kind::Other => MOST_SLOTS,
    };
    (most.min(slots(scene)), 1)
}

/// A scene and its plan in the kernels' layout.
fn flatten(tested: &Tested, scene: &Scene, plan: &RenderPlan) -> Result<FlatWorld> {
    let mut reasons = reasons::of_plan(plan);
    match FlatWorld::new(scene, tested.device.largest_buffer()) {
        Ok(flat) if reasons.is_empty() => Ok(flat.planned_by(scene, plan)),
        Ok(_) => Err(unsuitable(tested, &reasons)),
        Err(more) => {
            reasons.extend(more);
            Err(unsuitable(tested, &reasons))
        }
    }
}

fn unsuitable(tested: &Tested, reasons: &[Reason]) -> Error {
    let all: Vec<String> = reasons.iter().map(ToString::to_string).collect();
    Error::Unsuitable {
        device: tested.device.listed().name.clone(),
        reasons: all.join("; "),
    }
}
