//! One pass: a pure function of the scene, the plan and the pass index.

use crate::beam::estimate::{self, CameraSegments, LANES};
use crate::beam::store::{BeamMap, Candidates, Packet};
use crate::beam::trace::{Photons, trace_photons};
use crate::film::Film;
use crate::job::PassStats;
use crate::math::{Rgb, Vec2};
use crate::plan::{RenderPlan, Scene};
use crate::sampler::{Purpose, Sampler, mix64};
use crate::surface::SurfacePhotonMap;
use crate::transport::CameraTracer;
use rayon::prelude::*;

/// What a pass returns.
#[derive(Clone, Debug)]
pub struct PassImage {
    /// Radiance.
    pub film: Film,
    /// Counters.
    pub stats: PassStats,
}

/// Pixels along the side of a tile: neighbours whose straight segments look for beams together.
const TILE: u32 = 8;
const TILE_PIXELS: usize = (TILE * TILE) as usize;
const _: () = assert!(TILE_PIXELS <= estimate::PACKET);

/// Render a pass on the current rayon pool. The bits do not depend on the pool.
pub fn render_pass(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> PassImage {
    let mut stats = PassStats::default();
    let photons = if plan.beams || plan.surface_photons {
        stats.paths = plan.settings.paths_per_pass as u64;
        trace_photons(scene, plan, pass_index)
    } else {
        Photons::default()
    };
    stats.beams = photons.beams.len() as u64;
    stats.beam_bytes = (size_of_val(&photons.beams[..]) + photons.steps.bytes()) as u64;
    stats.surface_photons = photons.surface.len() as u64;
    let (beams, surface) = rayon::join(
        || {
            plan.beams
                .then(|| BeamMap::new(photons.beams, photons.steps, scene.bounds()))
        },
        || {
            plan.surface_photons
                .then(|| SurfacePhotonMap::new(photons.surface))
        },
    );
    let camera = CameraPass {
        tracer: CameraTracer {
            scene,
            plan,
            photons: surface.as_ref(),
        },
        beams: beams.as_ref(),
        pass_index,
        chord_key: mix64(mix64(plan.settings.seed) ^ mix64(pass_index) ^ Purpose::Chords as u64),
    };
    let (film, evaluations) = camera.render();
    stats.beam_evaluations = evaluations;
    stats.non_finite = film.non_finite();
    PassImage { film, stats }
}

struct CameraPass<'a> {
    tracer: CameraTracer<'a>,
    beams: Option<&'a BeamMap>,
    pass_index: u64,
    chord_key: u64,
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Scratch {
    camera: CameraSegments,
    candidates: Candidates,
}

impl CameraPass<'_> {
    fn render(&self) -> (Film, u64) {
        let camera = &self.tracer.scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        let columns = camera.width.div_ceil(TILE);
        let rows = camera.height.div_ceil(TILE);
        let tiles: Vec<(Vec<[f32; 3]>, u64)> = (0..columns * rows)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, tile| {
                self.tile(tile % columns * TILE, tile / columns * TILE, scratch)
            })
            .collect();
        let mut evaluations = 0;
        for (index, (pixels, count)) in tiles.into_iter().enumerate() {
            evaluations += count;
            let (x0, y0) = (index as u32 % columns * TILE, index as u32 / columns * TILE);
            for (i, pixel) in pixels.into_iter().enumerate() {
                let (x, y) = tile_pixel(i as u32);
                if x0 + x < camera.width && y0 + y < camera.height {
                    film.pixels[((y0 + y) * camera.width + x0 + x) as usize] = pixel;
                }
            }
        }
        (film, evaluations)
    }

    /// The pixels of a tile in the order of [`tile_pixel`], and the number of beam evaluations.
    fn tile(&self, x0: u32, y0: u32, scratch: &mut Scratch) -> (Vec<[f32; 3]>, u64) {
        let scene = self.tracer.scene;
        let camera = &scene.description().camera;
        let mut radiance = [Rgb::ZERO; TILE_PIXELS];
        scratch.camera.clear();
        for (i, value) in radiance.iter_mut().enumerate() {
            let (x, y) = tile_pixel(i as u32);
            let (x, y) = (x0 + x, y0 + y);
            if x >= camera.width || y >= camera.height {
                continue;
            }
            let chunk = y as u64 * camera.width as u64 + x as u64;
            let seed = self.tracer.plan.settings.seed;
            let mut sampler = Sampler::new(seed, self.pass_index, Purpose::Camera, chunk);
            let image = Vec2::new(x as f32, y as f32) + sampler.next_2d();
            let ray = camera.ray(image, sampler.next_2d());
            let segments = &mut scratch.camera;
            *value = self.tracer.trace(ray, i as u16, &mut sampler, segments);
        }
        let evaluations = match self.beams {
            Some(beams) => {
                let key = mix64(self.chord_key ^ ((y0 as u64) << 32 | x0 as u64));
                self.gather_beams(beams, key, scratch, &mut radiance)
            }
            None => 0,
        };
        (radiance.iter().map(|c| c.to_array()).collect(), evaluations)
    }

    fn gather_beams(
        &self,
        beams: &BeamMap,
        key: u64,
        scratch: &mut Scratch,
        radiance: &mut [Rgb; TILE_PIXELS],
    ) -> u64 {
        let Scratch { camera, candidates } = scratch;
        let CameraSegments { segments, steps } = camera;
        let mut evaluations = 0;
        // Stable: within a run, in the order of pixels.
        segments.sort_by_key(|s| (s.medium, s.straight.unwrap_or(u16::MAX)));
        for run in segments.chunk_by(|a, b| (a.medium, a.straight) == (b.medium, b.straight)) {
            // Straight segments of a tile are near each other; of the others, only a few together may be.
            let packet_size = if run[0].straight.is_some() {
                TILE_PIXELS
            } else {
                LANES
            };
            for packet in run.chunks(packet_size) {
                let bounds = Packet::new(packet.iter().map(|s| (s.ray, s.length)));
                beams.candidates(&bounds, candidates);
                let medium = &self.tracer.scene.media()[packet[0].medium as usize];
                let sum = estimate::gather(beams, medium, packet, steps, &candidates.found, key);
                evaluations += sum.evaluations();
                for (i, segment) in packet.iter().enumerate() {
                    radiance[segment.pixel as usize] += segment.beta * sum.of(i);
                }
            }
        }
        evaluations
    }
}

/// Position of the i-th pixel of a tile, along a Z curve, so that every eight are a block of 4 x 2.
fn tile_pixel(i: u32) -> (u32, u32) {
    let spread = |i: u32| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4);
    (spread(i), spread(i >> 1))
}
