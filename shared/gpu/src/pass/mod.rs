//! Whole passes on a device: photons, what they leave, camera paths, and the film.
//!
//! | question                                  | module                      |
//! | ----------------------------------------- | --------------------------- |
//! | what keeps a scene or plan from a device? | `reasons`                   |
//! | what does a pass depend on?               | `constants`                 |
//! | what do photons leave?                    | `photons`                   |
//! | how do camera paths go on?                | `paths`; `kernels/path.wgsl` |

mod constants;
mod paths;
mod photons;
mod reasons;
#[cfg(test)]
mod tests;

use crate::device::{Buffer, Kind, Reading, Work};
use crate::error::{Error, Result};
use crate::self_test::Tested;
use crate::trace::{Told, TraceTables};
use crate::world::reason::Reason;
use crate::world::waves::Waves;
use crate::world::{FlatWorld, WorldBuffers};
use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::radius::Schedule;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::{CameraWork, PassImage};
use beamfarm_render::world::Scene;
use constants::{PassConstants, Slots};
use paths::{Found, Given, Launch, Named, Paths};
use photons::{Photons, Room};
use std::sync::{Mutex, PoisonError};

/// Slots of paths that are on their way together, at most.
const MOST_SLOTS: u32 = 1 << 18;
/// The same of drivers in software, which are given up when they take too long for what they are given at once.
const MOST_SLOTS_OF_SOFTWARE: u32 = 1 << 14;
/// Slots of a tile of 8 x 8 pixels.
const TILE: u32 = 64;
/// Elements of a film before its pixels.
const HEAD: usize = 3;
/// Steps that are handed over first, where nothing is known of a scene's paths.
const ROUNDS: u32 = 32;

/// Bytes of a device's memory that passes take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The scene.
    pub world: u64,
    /// Photons, beams and what they are found by.
    pub photons: u64,
    /// Camera paths, and the film.
    pub paths: u64,
}

impl Memory {
    /// All of it.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.world + self.photons + self.paths
    }
}

/// Renders passes of a scene by a plan on a device.
pub struct GpuPass<'a> {
    tested: &'a Tested,
    scene: &'a Scene,
    plan: &'a RenderPlan,
    world: WorldBuffers,
    /// Those that are handed over have them in turn.
    buffers: Mutex<Buffers>,
    /// Whether passes are handed over before those before them are back. A driver in software gains nothing by it, and
    /// is given up when it takes too long for what it has.
    is_ahead: bool,
}

/// What passes write.
struct Buffers {
    photons: Option<Photons>,
    paths: Paths,
    film: Buffer,
    /// So many steps are handed over before it is asked whether paths are left: a few more than were taken last.
    rounds: u32,
}

impl Buffers {
    fn room(&self) -> Option<Room> {
        self.photons.as_ref().map(Photons::room)
    }
}

impl<'a> GpuPass<'a> {
    /// All that keeps a scene and its plan from devices whose largest buffer has so many bytes.
    #[must_use]
    pub fn reasons(scene: &Scene, plan: &RenderPlan, largest_buffer: u64) -> Vec<Reason> {
        let mut reasons = FlatWorld::new(scene, largest_buffer).err().unwrap_or_default();
        reasons.extend(reasons::of_plan(plan));
        reasons
    }

    /// About what passes take on a card. Of a scene that is not for devices, nothing.
    #[must_use]
    pub fn memory(scene: &Scene, plan: &RenderPlan) -> Memory {
        let Ok(world) = FlatWorld::new(scene, u64::MAX) else {
            return Memory::default();
        };
        let camera = &scene.description().camera;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let together = u64::from(slots(scene).min(MOST_SLOTS));
        Memory {
            world: world.bytes(),
            photons: if plan.has_photons() {
                photons::bytes(scene, plan)
            } else {
                0
            },
            paths: together * (paths::bytes_of_slot() + if world.varies() { paths::bytes_of_steps() } else { 0 })
                + (pixels + HEAD as u64) * size_of::<Found>() as u64,
        }
    }

    /// Bring a scene to a device.
    ///
    /// # Errors
    /// [`Error::Unsuitable`] with all of [`Self::reasons`], and the device's.
    pub fn new(tested: &'a Tested, scene: &'a Scene, plan: &'a RenderPlan) -> Result<Self> {
        let most = match tested.device.listed().kind {
            Kind::Software => MOST_SLOTS_OF_SOFTWARE,
            Kind::Discrete | Kind::Integrated | Kind::Virtual | Kind::Other => MOST_SLOTS,
        };
        Self::with_slots(tested, scene, plan, most)
    }

    /// With so many slots of paths, at most: a multiple of those of a tile.
    fn with_slots(tested: &'a Tested, scene: &'a Scene, plan: &'a RenderPlan, most: u32) -> Result<Self> {
        let device = &tested.device;
        let mut reasons = reasons::of_plan(plan);
        let world = FlatWorld::new(scene, device.largest_buffer());
        let world = match world {
            Ok(world) if reasons.is_empty() => world,
            Ok(_) => return Err(unsuitable(tested, &reasons)),
            Err(more) => {
                reasons.extend(more);
                return Err(unsuitable(tested, &reasons));
            }
        };
        let world = world.upload(device)?;
        let camera = &scene.description().camera;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let most = most.min(slots(scene));
        let room = (most, paths::first_steps(most));
        let buffers = Buffers {
            paths: Paths::new(tested, &world, room, plan.estimators.any_beams())?,
            photons: plan
                .has_photons()
                .then(|| Photons::new(tested, &world, (scene, plan), Room::first_guess(scene, plan)))
                .transpose()?,
            film: device.empty("film", (pixels + HEAD as u64) * size_of::<Found>() as u64)?,
            rounds: ROUNDS,
        };
        tested.compile()?;
        Ok(Self {
            tested,
            scene,
            plan,
            world,
            buffers: Mutex::new(buffers),
            is_ahead: device.listed().kind != Kind::Software,
        })
    }

    #[cfg(test)]
    fn bytes_of_paths(&self) -> u64 {
        let buffers = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        buffers.paths.bytes() + buffers.film.size()
    }

    /// Render a pass. The same bits on every device.
    ///
    /// # Errors
    /// The device's.
    pub fn render(&self, pass_index: u64) -> Result<PassImage> {
        self.end(self.begin(pass_index)?)
    }

    /// Hand a pass over without waiting for it, so that a device has work while the pass before goes back.
    ///
    /// # Errors
    /// The device's.
    pub fn begin(&self, pass_index: u64) -> Result<Begun> {
        let mut film = None;
        let all = slots(self.scene);
        let buffers = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_ahead && all <= buffers.paths.most() {
            self.photons(&buffers, pass_index)?;
            let device = &self.tested.device;
            film = Some(self.launch(&buffers, pass_index, (0, all), |mut launch, mut work| {
                for _ in 0..buffers.rounds {
                    launch.round(&mut work)?;
                }
                launch.to_film(&mut work, &buffers.film)?;
                work.submit()?;
                device.begin_read::<Found>(&buffers.film, HEAD + self.pixels())
            })?);
        }
        let (room, steps) = (buffers.room(), buffers.paths.most_steps());
        Ok(Begun {
            pass_index,
            film,
            room,
            steps,
        })
    }

    /// Wait for a pass that was [begun](Self::begin), or render it where it could not be.
    ///
    /// # Errors
    /// The device's.
    pub fn end(&self, begun: Begun) -> Result<PassImage> {
        let Begun {
            pass_index,
            film,
            room,
            steps,
        } = begun;
        let found = film
            .map(|film| self.tested.device.end_read::<Found>(film))
            .transpose()?;
        let mut buffers = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        // Where paths are left, all is done again.
        let known = found.and_then(|found| Gone::new(&found));
        let mut known = known.filter(|gone| gone.left == 0 && gone.most_steps <= steps);
        if let Some(gone) = &known {
            buffers.rounds = steps_for(gone.steps);
        }
        let mut room = room;
        let (told, found) = loop {
            let (told, found) = match known.take() {
                Some(gone) => (gone.told, gone.found),
                None => {
                    room = buffers.room();
                    self.photons(&buffers, pass_index)?;
                    self.camera(&mut buffers, pass_index)?
                }
            };
            let Some(had) = room else {
                break (told, found);
            };
            let more = had.more(&told);
            if more == had && told.unfinished == 0 {
                break (told, found);
            }
            if buffers.room() != room {
                // A pass before this one has made more since this was handed over.
                continue;
            }
            if more == had {
                return Err(Error::Refused {
                    device: self.tested.device.listed().name.clone(),
                    what: format!("pass {pass_index}"),
                    reason: format!("{} photon paths do not come to an end", told.unfinished),
                });
            }
            // With room and time for all of them the bits are what they would have been.
            buffers.photons = None;
            buffers.photons = Some(Photons::new(self.tested, &self.world, (self.scene, self.plan), more)?);
        };
        Ok(self.picture(pass_index, told, &found))
    }

    /// Trace the photons of a pass, if it has any.
    fn photons(&self, buffers: &Buffers, pass_index: u64) -> Result<()> {
        let Some(photons) = &buffers.photons else {
            return Ok(());
        };
        let tables = TraceTables::new(self.scene, self.plan, pass_index);
        photons.run(self.tested, &self.world, &tables)?;
        if self.tested.device.listed().kind == Kind::Software {
            // What is waited for is not to take too long.
            self.tested.device.finish()?;
        }
        Ok(())
    }

    /// The film, and what is told of it.
    fn picture(&self, pass_index: u64, told: Told, found: &[Found]) -> PassImage {
        let camera = &self.scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        let mut work = CameraWork::default();
        for (pixel, found) in film.pixels.iter_mut().zip(found) {
            *pixel = std::array::from_fn(|c| found.direct[c] + found.surface[c] + found.volume[c]);
            work.rays += u64::from(found.rays);
            work.evaluations += u64::from(found.beams);
        }
        if let Some(offset) = constants::offset(self.scene, self.plan, pass_index) {
            camera.filter.reconstruct([&mut film], offset);
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
            non_finite: film.non_finite(),
            ..PassStats::default()
        };
        PassImage {
            film,
            layers: Vec::new(),
            mattes: Vec::new(),
            radius_scale: Schedule::new(&self.plan.settings).scale(pass_index),
            stats,
            photon_rays: 0,
            camera: work,
        }
    }

    /// Render passes, each as by itself.
    ///
    /// # Errors
    /// The device's.
    pub fn render_all(&self, indices: &[u64]) -> Result<Vec<PassImage>> {
        indices.iter().map(|index| self.render(*index)).collect()
    }

    /// What the paths of all pixels find.
    fn camera(&self, buffers: &mut Buffers, pass_index: u64) -> Result<(Told, Vec<Found>)> {
        let device = &self.tested.device;
        let (all, most) = (slots(self.scene), buffers.paths.most());
        let mut steps = 0;
        let mut first = 0;
        while first < all {
            let count = most.min(all - first);
            let is_last = first + count == all;
            let gone = self.launch(buffers, pass_index, (first, count), |mut launch, mut work| {
                loop {
                    for _ in 0..buffers.rounds {
                        launch.round(&mut work)?;
                    }
                    launch.to_film(&mut work, &buffers.film)?;
                    work.submit()?;
                    // The only answer that is waited for, but for paths that are longer than any that matters.
                    let pixels = if is_last { self.pixels() } else { 0 };
                    let gone = Gone::new(&device.read::<Found>(&buffers.film, HEAD + pixels)?);
                    match gone {
                        Some(gone) if gone.left > 0 => work = device.work(),
                        gone => return Ok(gone),
                    }
                }
            })?;
            let Some(gone) = gone else { break };
            if gone.most_steps > buffers.paths.most_steps() {
                // With room for all of them it is done again.
                let room = (most, gone.most_steps.saturating_add(gone.most_steps / 4));
                buffers.paths = Paths::new(self.tested, &self.world, room, self.plan.estimators.any_beams())?;
                continue;
            }
            first += count;
            steps = steps.max(gone.steps);
            if is_last {
                buffers.rounds = steps_for(steps);
                return Ok((gone.told, gone.found));
            }
        }
        Ok((Told::default(), Vec::new()))
    }

    /// Begin the paths of some slots: the first of them, and how many.
    fn launch<'s, R>(
        &'s self,
        buffers: &Buffers,
        pass_index: u64,
        (first, count): (u32, u32),
        go_on: impl FnOnce(Launch, Work<'s>) -> Result<R>,
    ) -> Result<R> {
        let device = &self.tested.device;
        let uses = constants::uses(self.scene, self.plan, pass_index);
        let uses = device.buffer("lights and media of the plan", &uses)?;
        let nothing = device.buffer("nothing told", &[Told::default()])?;
        let columns = self.scene.description().camera.width.div_ceil(8);
        let slots = Slots { first, count, columns };
        let constants = PassConstants::new(self.scene, self.plan, pass_index, slots);
        let waves = Waves::new(self.scene, self.plan, pass_index);
        let key = [vec![constants.chord_key], waves.words()].concat();
        let key = device.buffer("key of chords", &key)?;
        let constants = device.buffer("plan", &[constants])?;
        let count = device.buffer("slots", &[slots.count])?;
        let rounds_taken = device.buffer("rounds", &[0_u32; 2])?;
        let named = Named::of_world(&self.world).with(&[
            ("constants", &constants),
            ("uses", &uses),
            ("rounds_taken", &rounds_taken),
            ("told", buffers.photons.as_ref().map_or(&nothing, Photons::told)),
        ]);
        let given = Given {
            world: &self.world,
            named,
            photons: buffers.photons.as_ref(),
            key: &key,
            count: &count,
            slots: slots.count,
        };
        let mut work = device.work();
        let launch = Launch::new(&mut work, &buffers.paths, given)?;
        go_on(launch, work)
    }

    fn pixels(&self) -> usize {
        let camera = &self.scene.description().camera;
        camera.width as usize * camera.height as usize
    }
}

/// A pass that was handed over.
#[derive(Debug)]
pub struct Begun {
    pass_index: u64,
    /// Its film, on its way back; none where all is left to do.
    film: Option<Reading>,
    /// What there was for its photons.
    room: Option<Room>,
    /// What there was for steps of its segments.
    steps: u32,
}

/// How a film says that a pass has gone: at its head, see `kernels/path_film.wgsl`.
struct Gone {
    told: Told,
    /// Paths that have not ended.
    left: u32,
    /// Steps that paths have taken.
    steps: u32,
    /// Of the transmittance along the segments of a step, the most: above what there is room for, what they gather is
    /// missing.
    most_steps: u32,
    /// By pixel.
    found: Vec<Found>,
}

impl Gone {
    fn new(film: &[Found]) -> Option<Self> {
        let ([head, more, last], found) = film.split_first_chunk::<HEAD>()?;
        Some(Self {
            told: Told {
                beams: head.beams,
                photons: head.spare,
                unfinished: more.rays,
                steps: last.rays,
            },
            left: head.rays,
            steps: more.beams,
            most_steps: last.beams,
            found: found.to_vec(),
        })
    }
}

/// Steps that are handed over for paths like those that took so many: a few more.
fn steps_for(taken: u32) -> u32 {
    taken + taken / 4 + 1
}

/// All slots of a picture's paths.
fn slots(scene: &Scene) -> u32 {
    let camera = &scene.description().camera;
    camera.width.div_ceil(8) * camera.height.div_ceil(8) * TILE
}

fn unsuitable(tested: &Tested, reasons: &[Reason]) -> Error {
    let all: Vec<String> = reasons.iter().map(ToString::to_string).collect();
    Error::Unsuitable {
        device: tested.device.listed().name.clone(),
        reasons: all.join("; "),
    }
}
