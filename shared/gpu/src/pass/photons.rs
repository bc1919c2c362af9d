//! What the photons of a pass store, and what camera paths gather from it.

use super::seen::Seen;
use crate::beams::{FlatWalls, Functions, Gather, Hiding, Near, Pieces, Scattering, Segments, WallBuffers, Walls, Way};
use crate::device::{Buffer, Device, Work};
use crate::error::Result;
use crate::photons::{PhotonEstimate, PhotonMap, PhotonRequests};
use crate::self_test::Together;
use crate::trace::{Capacities, PhotonWalls, Told, Trace, TraceBuffers, TraceTables, bytes_of_steps};
use crate::world::WorldBuffers;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::medium::Medium;

/// Initial room for beams and photons per path.
const FIRST_GUESS: u32 = 6;
/// Average transmittance steps per beam.
const STEPS_OF_BEAM: u32 = 8;
/// Least room.
const LEAST: u32 = 4096;
/// Initial limit of rays per path, more than any usually has.
const FIRST_RAYS: u32 = 512;
const MOST_RAYS: u32 = 1 << 15;

/// Room for results, and limits on work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Room {
    pub most: Capacities,
    /// Rays per path.
    pub rays: u32,
}

/// Traces photons and lays them out for searching.
pub(super) struct Photons {
    room: Room,
    trace: Trace,
    media: Buffer,
    /// Present if there are walls.
    walls: Option<WallBuffers>,
    beams: Option<Beams>,
    surface: Option<Surface>,
}

struct Beams {
    /// Present in a scene with walls.
    near: Option<Walls>,
    pieces: Pieces,
    gather: Gather,
}

struct Surface {
    /// Present in a scene with walls.
    near: Option<PhotonWalls>,
    map: PhotonMap,
    estimate: PhotonEstimate,
}

impl Room {
    /// Before anything is known of a plan's passes.
    pub fn first_guess(scene: &Scene, plan: &RenderPlan) -> Self {
        let most = |is_used: bool, paths: u32| match is_used {
            true => paths.saturating_mul(FIRST_GUESS).max(LEAST),
            false => 1,
        };
        let beams = most(plan.beams, plan.settings.paths_per_pass);
        Self {
            most: Capacities {
                beams,
                photons: most(plan.surface_photons, plan.surface_paths),
                steps: if varies(scene) {
                    beams.saturating_mul(STEPS_OF_BEAM)
                } else {
                    0
                },
            },
            rays: FIRST_RAYS,
        }
    }

    /// More of what was missing.
    pub fn more(self, told: &Told) -> Self {
        let more = |most: u32, told: u32| {
            if told > most {
                told.saturating_add(told / 4)
            } else {
                most
            }
        };
        Self {
            most: Capacities {
                beams: more(self.most.beams, told.beams),
                photons: more(self.most.photons, told.photons),
                steps: more(self.most.steps, told.steps),
            },
            rays: if told.unfinished > 0 { MOST_RAYS } else { self.rays },
        }
    }
}

/// Bytes per beam, with its ends, five pieces and their search structures; and per photon likewise.
const BYTES_OF_BEAM: u64 = 850;
const BYTES_OF_PHOTON: u64 = 240;
/// Bytes per path while it is traced, the most for all paths traced together, and bytes per path afterwards.
const BYTES_OF_PATH: u64 = 376;
const MOST_BYTES_OF_PATHS: u64 = 256 << 20;
const BYTES_AFTERWARDS: u64 = 8;

/// Approximate initial memory of passes.
pub(super) fn bytes(scene: &Scene, plan: &RenderPlan) -> u64 {
    let most = Room::first_guess(scene, plan).most;
    let of_steps = if varies(scene) { bytes_of_steps(most) } else { 0 };
    let paths = u64::from(plan.surface_paths);
    u64::from(most.beams) * BYTES_OF_BEAM
        + u64::from(most.photons) * BYTES_OF_PHOTON
        + (paths * BYTES_OF_PATH).min(MOST_BYTES_OF_PATHS)
        + paths * BYTES_AFTERWARDS
        + of_steps
}

/// Whether some medium's density may vary.
pub(super) fn varies(scene: &Scene) -> bool {
    let media = &scene.description().media;
    media.iter().any(|medium| matches!(medium, Medium::Heterogeneous(_)))
}

/// Scattering data of a scene's media, and its walls.
fn around(device: &Device, scene: &Scene) -> Result<(Buffer, Option<WallBuffers>)> {
    let mut media: Vec<Scattering> = scene.description().media.iter().map(Scattering::from).collect();
    if media.is_empty() {
        media.push(Scattering::default());
    }
    let walls = FlatWalls::new(scene).map(|walls| walls.upload(device));
    Ok((device.buffer("media that scatter", &media)?, walls.transpose()?))
}

impl Photons {
    /// With this much room for each pass.
    pub fn new(on: Together, Seen { scene, plan, world }: Seen, room: Room) -> Result<Self> {
        let most = room.most;
        let geometry = &world.geometry;
        let (media, walls) = around(&on.device, scene)?;
        let beams = || {
            let near = walls.is_some().then(|| Walls::new(on, geometry, most.beams));
            Ok(Beams {
                gather: match &near {
                    Some(_) => Gather::by_walls(on, geometry, most.beams)?,
                    None => Gather::of_media(on, geometry.needs, most.beams)?,
                },
                near: near.transpose()?,
                pieces: Pieces::new(on, most.beams)?,
            })
        };
        let surface = || {
            let near = walls.is_some().then(|| PhotonWalls::new(on, geometry));
            Ok(Surface {
                near: near.transpose()?,
                map: PhotonMap::new(on, most.photons)?,
                estimate: PhotonEstimate::new(on, geometry, most.photons)?,
            })
        };
        Ok(Self {
            room,
            trace: Trace::of_rays(on, world, (plan.surface_paths, most), room.rays)?,
            beams: plan.beams.then(beams).transpose()?,
            surface: plan.surface_photons.then(surface).transpose()?,
            media,
            walls,
        })
    }

    /// Adapts to a scene whose objects have moved.
    pub fn look_at(&mut self, device: &Device, scene: &Scene) -> Result<()> {
        (self.media, self.walls) = around(device, scene)?;
        Ok(())
    }

    /// The current room and limits.
    pub fn room(&self) -> Room {
        self.room
    }

    /// A [`Told`] of each pass.
    pub fn told(&self) -> &Buffer {
        self.trace.told()
    }

    /// Traces the photons of passes, and lays them out.
    pub fn run(&self, on: Together, world: &WorldBuffers, passes: &[TraceTables]) -> Result<()> {
        let tables = TraceBuffers::new(&on.device, passes)?;
        let mut work = on.work();
        self.trace.run(&mut work, world, &tables)?;
        work.submit()?;
        let mut work = on.work();
        let (trace, walls) = (&self.trace, self.near(world));
        if let Some(Beams { near, pieces, .. }) = &self.beams {
            if let (Some(near), Some(walls)) = (near, &walls) {
                let beams = [trace.beams(), trace.beam_ends()];
                near.run(&mut work, walls, trace.beam_count(), beams)?;
            }
            pieces.run(&mut work, trace.beam_count(), trace.beams())?;
        }
        if let Some(Surface { near, map, .. }) = &self.surface {
            if let (Some(near), Some(walls)) = (near, &walls) {
                near.run(&mut work, walls, trace.photon_count(), trace.photons())?;
            }
            map.run(&mut work, trace.photon_count(), trace.photons())?;
        }
        work.submit()
    }

    /// The walls that may be near beams and photons.
    fn near<'a>(&'a self, world: &'a WorldBuffers) -> Option<Near<'a>> {
        let geometry = &world.geometry;
        self.walls.as_ref().map(|walls| Near { geometry, walls })
    }

    /// Whether there are beams.
    pub fn has_beams(&self) -> bool {
        self.beams.is_some()
    }

    /// Whether photons on surfaces are stored.
    pub fn has_surface(&self) -> bool {
        self.surface.is_some()
    }

    /// Gathers along segments of camera paths.
    pub fn gather(&self, work: &mut Work, world: &WorldBuffers, way: Way, asked: &Asked) -> Result<()> {
        let Some(Beams { near, pieces, gather }) = &self.beams else {
            return Ok(());
        };
        let of = Segments {
            count: asked.count,
            segments: asked.segments,
            media: &self.media,
            key: asked.key,
            varying: match (self.trace.steps(), asked.steps) {
                (Some(of_beams), Some(of_segments)) => Some(Functions {
                    volumes: &world.volumes,
                    of_beams,
                    of_segments,
                }),
                _ => None,
            },
            light_group: asked.light_group,
        };
        let (Some(of_beams), Some(near)) = (near, self.near(world)) else {
            return gather.run(work, way, &of, pieces, asked.gathered);
        };
        let hiding = Hiding {
            near,
            planes: of_beams.planes(),
            beams: self.trace.beams(),
        };
        gather.run_by_walls(work, way, &of, (pieces, hiding), asked.gathered)
    }

    /// Sums photon contributions at vertices of camera paths.
    pub fn estimate(&self, work: &mut Work, world: &WorldBuffers, asked: &Asked) -> Result<()> {
        let Some(Surface { map, estimate, .. }) = &self.surface else {
            return Ok(());
        };
        let of = PhotonRequests {
            count: asked.count,
            requests: asked.requests,
            surfaces: asked.surfaces,
            key: asked.key,
            texels: &world.textures.texels,
            radiance: asked.from_photons,
            light_group: asked.light_group,
        };
        estimate.run(work, &of, map, &world.geometry)
    }
}

/// Requests of camera paths, and the buffers for answers.
pub(super) struct Asked<'a> {
    /// The number of requests, in its first word.
    pub count: &'a Buffer,
    /// Segments of the paths.
    pub segments: &'a Buffer,
    /// Transmittance along them, if some medium's density varies.
    pub steps: Option<&'a Buffer>,
    /// Key of the chords' random numbers, followed by the pass's wavelengths.
    pub key: &'a Buffer,
    /// Light gathered along the segments.
    pub gathered: &'a Buffer,
    /// Vertices of the paths.
    pub requests: &'a Buffer,
    /// The surfaces there.
    pub surfaces: &'a Buffer,
    /// Photon contributions there.
    pub from_photons: &'a Buffer,
    /// If light groups have layers: the group whose light is requested, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}
