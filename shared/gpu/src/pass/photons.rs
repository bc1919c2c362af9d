//! What the photons of a pass leave, and what camera paths gather of it.

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

/// Beams and photons of a path that there is room for at first.
const FIRST_GUESS: u32 = 6;
/// Steps of the transmittance along a beam, on average.
const STEPS_OF_BEAM: u32 = 8;
/// At least so many.
const LEAST: u32 = 4096;
/// Rays of a path that there is time for at first, and more than any has.
const FIRST_RAYS: u32 = 512;
const MOST_RAYS: u32 = 1 << 15;

/// What there is room and time for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Room {
    pub most: Capacities,
    /// Rays of a path.
    pub rays: u32,
}

/// What traces photons and lays them out.
pub(super) struct Photons {
    room: Room,
    trace: Trace,
    media: Buffer,
    /// Where any stand.
    walls: Option<WallBuffers>,
    beams: Option<Beams>,
    surface: Option<Surface>,
}

struct Beams {
    /// In a scene with walls.
    near: Option<Walls>,
    pieces: Pieces,
    gather: Gather,
}

struct Surface {
    /// In a scene with walls.
    near: Option<PhotonWalls>,
    map: PhotonMap,
    estimate: PhotonEstimate,
}

impl Room {
    /// Where nothing is known of a plan's passes yet.
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

/// Bytes of a beam, its ends, and five pieces of it with what they are found by; and of a photon likewise.
const BYTES_OF_BEAM: u64 = 850;
const BYTES_OF_PHOTON: u64 = 240;
/// Bytes of a path while it is followed, of as many as are followed together; and of each afterwards.
const BYTES_OF_PATH: u64 = 376;
const MOST_BYTES_OF_PATHS: u64 = 256 << 20;
const BYTES_AFTERWARDS: u64 = 8;

/// About the memory that passes take at first.
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

/// Whether the density of some medium may vary.
pub(super) fn varies(scene: &Scene) -> bool {
    let media = &scene.description().media;
    media.iter().any(|medium| matches!(medium, Medium::Heterogeneous(_)))
}

/// What media of a scene do to beams, and what may stand near these.
fn around(device: &Device, scene: &Scene) -> Result<(Buffer, Option<WallBuffers>)> {
    let mut media: Vec<Scattering> = scene.description().media.iter().map(Scattering::from).collect();
    if media.is_empty() {
        media.push(Scattering::default());
    }
    let walls = FlatWalls::new(scene).map(|walls| walls.upload(device));
    Ok((device.buffer("media that scatter", &media)?, walls.transpose()?))
}

impl Photons {
    /// With so much room for each pass.
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

    /// Have them do for a scene whose things have moved.
    pub fn look_at(&mut self, device: &Device, scene: &Scene) -> Result<()> {
        (self.media, self.walls) = around(device, scene)?;
        Ok(())
    }

    /// What there is room and time for.
    pub fn room(&self) -> Room {
        self.room
    }

    /// A [`Told`] of each pass.
    pub fn told(&self) -> &Buffer {
        self.trace.told()
    }

    /// Trace those of passes, and lay them out.
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

    /// What may stand near beams and photons.
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

    /// Gather along segments of camera paths.
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

    /// Sum up what photons bring to vertices of camera paths.
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

/// What camera paths ask, and where the answers go.
pub(super) struct Asked<'a> {
    /// How many are asked for, in its first word.
    pub count: &'a Buffer,
    /// Segments of the paths.
    pub segments: &'a Buffer,
    /// Transmittance along them, where the density of some medium varies.
    pub steps: Option<&'a Buffer>,
    /// Of the random numbers of chords; and then the pass's wavelengths.
    pub key: &'a Buffer,
    /// What is gathered along the segments.
    pub gathered: &'a Buffer,
    /// Vertices of the paths.
    pub requests: &'a Buffer,
    /// What is there.
    pub surfaces: &'a Buffer,
    /// What photons bring there.
    pub from_photons: &'a Buffer,
    /// Where groups of lights have layers: the number of the one whose light is asked for, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}
