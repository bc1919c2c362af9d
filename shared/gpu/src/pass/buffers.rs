//! Output buffers of passes that are rendered together.

use super::constants;
use super::layers::{self, Firsts};
use super::paths::{Found, Paths, first_steps};
use super::photons::{Photons, Room};
use super::seen::Seen;
use super::{Memory, ROUNDS};
use crate::device::Buffer;
use crate::error::{Error, Result};
use crate::kernels::Needs;
use crate::self_test::{Tested, Together};

/// Path slots that fill a device: on an H200, four times the paths of a 512 x 512 picture took 1.2 to 1.5 times as
/// long.
const SLOTS_OF_ALL: u32 = 1 << 20;
/// Most passes that are rendered together, and the share of a card's memory that they may take (one in this many).
pub(super) const MOST_TOGETHER: u32 = 16;
const SHARE_OF_MEMORY: u64 = 4;

/// The buffers that passes write.
pub(super) struct Buffers {
    /// Number of passes that have room together.
    pub passes: u32,
    pub photons: Option<Photons>,
    pub paths: Paths,
    pub film: Buffer,
    /// Present if some layer needs first surfaces.
    pub firsts: Option<Firsts>,
    /// Steps submitted before checking whether paths are left: slightly more than the previous passes took.
    pub rounds: u32,
    made_for: MadeFor,
}

/// The properties of a scene and its plan that determine the buffers.
#[derive(Clone, Copy, PartialEq, Eq)]
struct MadeFor {
    /// Needs of kernels with rays, and of the kernel that starts photons.
    needs: [Needs; 2],
    has_walls: bool,
    beams: bool,
    surface_photons: bool,
    paths: u32,
    any_beams: bool,
    light_groups: usize,
    has_firsts: bool,
    size: [u32; 2],
}

impl MadeFor {
    fn new(Seen { scene, plan, world }: Seen) -> Self {
        let objects = 0..scene.description().objects.len() as u32;
        let camera = &scene.description().camera;
        Self {
            needs: [world.geometry.needs, world.needs_of_starts],
            has_walls: objects.into_iter().any(|object| scene.is_wall(object)),
            beams: plan.beams,
            surface_photons: plan.surface_photons,
            paths: plan.surface_paths,
            any_beams: plan.estimators.any_beams(),
            light_groups: plan.layers.groups(),
            has_firsts: layers::have_firsts(&plan.layers),
            size: [camera.width, camera.height],
        }
    }
}

impl Buffers {
    /// For this many passes together and slots of each, or for fewer passes if memory is short.
    pub fn new(tested: &Tested, seen: Seen, (most, passes): (u32, u32)) -> Result<Self> {
        let Seen { scene, plan, world } = seen;
        let camera = &scene.description().camera;
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let room = (most, first_steps(most));
        fewer_where_full(passes, |passes| {
            let on = Together { tested, passes };
            let photons = || Photons::new(on, seen, Room::first_guess(scene, plan));
            Ok(Self {
                passes,
                paths: Paths::new(on, world, plan, room)?,
                photons: plan.has_photons().then(photons).transpose()?,
                film: on.empty(
                    "film",
                    constants::elements_of_film(&plan.layers, pixels) * size_of::<Found>() as u64,
                )?,
                firsts: (layers::have_firsts(&plan.layers))
                    .then(|| Firsts::new(on, world, pixels))
                    .transpose()?,
                rounds: ROUNDS,
                made_for: MadeFor::new(seen),
            })
        })
    }

    /// Needs that kernels with rays, and the kernel that starts photons, are compiled for.
    pub fn made_for(&self) -> [Needs; 2] {
        self.made_for.needs
    }

    /// Adapts the buffers to what another pass sees: after motion some may have to be remade, for at most this many
    /// slots and passes together.
    pub fn suit(&mut self, tested: &Tested, seen: Seen, room: (u32, u32)) -> Result<()> {
        if self.made_for != MadeFor::new(seen) {
            *self = Self::new(tested, seen, room)?;
        }
        match &mut self.photons {
            Some(photons) => photons.look_at(&tested.device, seen.scene),
            None => Ok(()),
        }
    }

    pub fn room(&self) -> Option<Room> {
        self.photons.as_ref().map(Photons::room)
    }
}

/// Makes something for this many passes together, halving the number while memory is short.
pub(super) fn fewer_where_full<T>(mut passes: u32, make: impl Fn(u32) -> Result<T>) -> Result<T> {
    loop {
        match make(passes) {
            Err(Error::OutOfMemory { .. }) if passes > 1 => passes /= 2,
            made => return made,
        }
    }
}

/// Number of passes to render together: enough to fill a device with paths, within its share of memory.
pub(super) fn passes_for(memory: Memory, slots: u32, of_device: Option<u64>) -> u32 {
    let of_passes = (memory.photons + memory.paths).max(1);
    let have_room = of_device.map_or(u64::from(MOST_TOGETHER), |all| all / SHARE_OF_MEMORY / of_passes);
    let fill = u64::from(SLOTS_OF_ALL / slots.max(1));
    fill.min(have_room).clamp(1, MOST_TOGETHER.into()) as u32
}
