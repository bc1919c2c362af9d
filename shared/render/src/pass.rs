//! One pass: a pure function of the scene, the plan and the pass index.

use crate::aov::{Parts, Recorder};
use crate::beam::estimate::{CameraSegment, CameraSegments, Gather, Sharing, Vectors};
use crate::beam::store::BeamMap;
use crate::beam::trace::{Photons, trace_photons};
use crate::math::{Ray, Rgb};
use crate::medium::transmittance::StepFunctions;
use crate::odds::{first_odds, gloss_odds, least_flight};
use crate::photon_map::SurfacePhotonMap;
use crate::plan::RenderPlan;
use crate::sampler::{Purpose, Sampler, mix64};
use crate::sight::{Ruled, Sight, Start, Unruled};
use crate::transport::{CameraTracer, PathContext};
use crate::world::Scene;
use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::radius::Schedule;
use rayon::prelude::*;

/// What a pass returns.
#[derive(Clone, Debug)]
pub struct PassImage {
    /// Radiance.
    pub film: Film,
    /// What the plan has beside it, in its order.
    pub layers: Vec<Film>,
    /// What kernel radii of the pass were scaled by.
    pub radius_scale: f64,
    /// Counters.
    pub stats: PassStats,
}

/// Pixels along the side of a tile: neighbours whose straight segments look for beams together.
const TILE: u32 = 32;
const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// Render a pass on the current rayon pool. The bits do not depend on the pool.
pub fn render_pass(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> PassImage {
    let mut stats = PassStats::default();
    let photons = if plan.beams || plan.surface_photons {
        stats.paths = plan.surface_paths as u64;
        trace_photons(scene, plan, pass_index)
    } else {
        Photons::default()
    };
    stats.beams = (photons.beams.len() + photons.smooth_beams.len()) as u64;
    stats.surface_photons = photons.surface.len() as u64;
    let (beams, surface) = rayon::join(
        || {
            plan.beams.then(|| Beams {
                sharp: BeamMap::new(photons.beams, photons.steps),
                smooth: BeamMap::new(photons.smooth_beams, StepFunctions::default()),
            })
        },
        || plan.surface_photons.then(|| SurfacePhotonMap::new(photons.surface)),
    );
    stats.beam_bytes = beams
        .as_ref()
        .map_or(0, |beams| beams.sharp.bytes() + beams.smooth.bytes()) as u64;
    let photon_pass = PhotonPass {
        scene,
        plan,
        pass_index,
        photons: surface.as_ref(),
        beams: beams.as_ref(),
    };
    let (film, layers, evaluations) = match &scene.description().rules {
        None => photon_pass.camera_pass(Unruled).render(),
        Some(rules) => photon_pass.camera_pass(Ruled(rules)).render(),
    };
    stats.beam_evaluations = evaluations;
    stats.non_finite = layers.iter().chain([&film]).map(Film::non_finite).sum();
    PassImage {
        film,
        layers,
        radius_scale: Schedule::new(&plan.settings).scale(pass_index),
        stats,
    }
}

/// The beams of a pass.
struct Beams {
    /// Which each camera segment gathers for itself.
    sharp: BeamMap,
    /// Which segments share: see [`Sharing`].
    smooth: BeamMap,
}

/// What photons of a pass have left for the camera to find.
struct PhotonPass<'a> {
    scene: &'a Scene,
    plan: &'a RenderPlan,
    pass_index: u64,
    photons: Option<&'a SurfacePhotonMap>,
    beams: Option<&'a Beams>,
}

impl<'a> PhotonPass<'a> {
    fn camera_pass<V: Sight>(&self, sight: V) -> CameraPass<'a, V> {
        let Self { plan, pass_index, .. } = *self;
        CameraPass {
            tracer: CameraTracer {
                scene: self.scene,
                plan,
                photons: self.photons,
                first_odds: first_odds(plan, pass_index),
                gloss_odds: gloss_odds(self.scene, plan, pass_index),
                least_flight: least_flight(plan, pass_index),
                sight,
            },
            beams: self.beams,
            pass_index,
            vectors: Vectors::widest(),
            chord_key: mix64(mix64(plan.settings.seed) ^ mix64(pass_index) ^ Purpose::Chords as u64),
        }
    }
}

struct CameraPass<'a, V> {
    tracer: CameraTracer<'a, V>,
    beams: Option<&'a Beams>,
    pass_index: u64,
    vectors: Vectors,
    chord_key: u64,
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Scratch {
    camera: CameraSegments,
    /// By pixel, when the plan has layers.
    parts: Vec<Parts>,
}

/// The pixels of a tile in the order of [`tile_pixel`].
struct Tile {
    radiance: [Rgb; TILE_PIXELS],
    layers: Vec<[[f32; 3]; TILE_PIXELS]>,
    evaluations: u64,
}

impl<V: Sight> CameraPass<'_, V> {
    /// Radiance, layers, and the number of beam evaluations.
    fn render(&self) -> (Film, Vec<Film>, u64) {
        let camera = &self.tracer.scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        let mut layers = vec![film.clone(); self.tracer.plan.layers.layers.len()];
        let columns = camera.width.div_ceil(TILE);
        let rows = camera.height.div_ceil(TILE);
        let tiles: Vec<Tile> = (0..columns * rows)
            .into_par_iter()
            // Tiles differ a hundredfold: each is shared out by itself.
            .with_max_len(1)
            .map_init(Scratch::default, |scratch, tile| {
                self.tile(tile % columns * TILE, tile / columns * TILE, scratch)
            })
            .collect();
        let mut evaluations = 0;
        for (index, tile) in tiles.into_iter().enumerate() {
            evaluations += tile.evaluations;
            let (x0, y0) = (index as u32 % columns * TILE, index as u32 / columns * TILE);
            for (i, radiance) in tile.radiance.into_iter().enumerate() {
                let (x, y) = tile_pixel(i as u32);
                if x0 + x < camera.width && y0 + y < camera.height {
                    let at = ((y0 + y) * camera.width + x0 + x) as usize;
                    film.pixels[at] = radiance.to_array();
                    for (layer, pixels) in layers.iter_mut().zip(&tile.layers) {
                        layer.pixels[at] = pixels[i];
                    }
                }
            }
        }
        (film, layers, evaluations)
    }

    fn tile(&self, x0: u32, y0: u32, scratch: &mut Scratch) -> Tile {
        let scene = self.tracer.scene;
        let camera = &scene.description().camera;
        let mut radiance = [Rgb::ZERO; TILE_PIXELS];
        scratch.camera.clear();
        let plan = &self.tracer.plan.layers;
        scratch.parts.clear();
        if !plan.layers.is_empty() {
            scratch.parts.resize(TILE_PIXELS, Parts::new(plan.groups()));
        }
        for (i, value) in radiance.iter_mut().enumerate() {
            let (x, y) = tile_pixel(i as u32);
            let (x, y) = (x0 + x, y0 + y);
            if x >= camera.width || y >= camera.height {
                continue;
            }
            let chunk = y as u64 * camera.width as u64 + x as u64;
            let seed = self.tracer.plan.settings.seed;
            let mut sampler = Sampler::new(seed, self.pass_index, Purpose::Camera, chunk);
            let image = camera.sample(x, y, sampler.next_2d());
            let ray = camera.ray(image, sampler.next_2d());
            if plan.counts_targets() {
                scratch.parts[i].targets = self.targets_along(&ray);
            }
            let mut context = PathContext {
                sampler,
                pixel: i as u16,
                segments: &mut scratch.camera,
                record: Recorder::new(plan, scratch.parts.get_mut(i)),
            };
            *value = self.tracer.trace(ray, &mut context);
        }
        let evaluations = match self.beams {
            Some(beams) => {
                let tile = (y0 as u64) << 32 | x0 as u64;
                self.gather_beams(beams, tile, scratch, &mut radiance)
            }
            None => 0,
        };
        let parts = &scratch.parts;
        let values = |(number, layer)| {
            let group = plan.group_of_layer(number);
            std::array::from_fn(|i| parts[i].value(layer, group))
        };
        Tile {
            radiance,
            layers: plan.layers.iter().enumerate().map(values).collect(),
            evaluations,
        }
    }

    /// Photon targets along a camera ray, up to what it meets.
    fn targets_along(&self, ray: &Ray) -> u32 {
        let CameraTracer { scene, plan, sight, .. } = &self.tracer;
        let Some(targets) = &plan.targets else {
            return 0;
        };
        let hidden = sight.from(Start::Camera);
        let is_passed = |object: u32| scene.passable[object as usize] || sight.hides(hidden, object);
        let objects = scene.objects();
        let hit = scene.geometry.intersect(objects, ray, f32::INFINITY, is_passed);
        targets.count(ray, hit.map_or(f32::INFINITY, |hit| hit.t))
    }

    /// `tile`: where it is, a number of its own.
    fn gather_beams(&self, beams: &Beams, tile: u64, scratch: &mut Scratch, radiance: &mut [Rgb; TILE_PIXELS]) -> u64 {
        let Scratch { camera, parts } = scratch;
        let CameraSegments { segments, steps } = camera;
        let seed = self.tracer.plan.settings.seed;
        let mut sampler = Sampler::new(seed, self.pass_index, Purpose::Sharing, tile);
        let key = mix64(self.chord_key ^ tile);
        let mut evaluations = 0;
        // Stable: within a run, in the order of pixels.
        segments.sort_by_key(|s| (s.medium, s.way));
        for run in segments.chunk_by(|a, b| (a.medium, a.way) == (b.medium, b.way)) {
            let medium = run[0].medium;
            let sharp = Gather {
                map: &beams.sharp,
                medium: &self.tracer.scene.media()[medium as usize],
                steps,
                group: None,
                key,
                vectors: self.vectors,
            };
            let smooth = Gather {
                map: &beams.smooth,
                key: mix64(key),
                ..sharp
            };
            let radius = beams.smooth.mean_radius(medium);
            let place = |s: &CameraSegment| tile_pixel(s.pixel.into());
            let sharing = (radius > 0.0).then(|| Sharing::new(run, radius, place, &mut sampler));
            let gather = |group| {
                let mut all = Gather { group, ..sharp }.along(run);
                if let Some(sharing) = &sharing {
                    let shared = Gather { group, ..smooth }.along_shared(sharing);
                    for (sum, shared) in all.radiance.iter_mut().zip(shared.radiance) {
                        *sum += shared;
                    }
                    all.evaluations += shared.evaluations;
                }
                all
            };
            let gathered = gather(None);
            evaluations += gathered.evaluations;
            for (segment, sum) in run.iter().zip(gathered.radiance) {
                let scattered = segment.beta * sum;
                radiance[segment.pixel as usize] += scattered;
                if let Some(parts) = parts.get_mut(segment.pixel as usize) {
                    parts.add(segment.part, scattered);
                }
            }
            if self.tracer.plan.layers.counts_beams() {
                // One by one: gathering side by side counts for all of them together, which is quicker.
                for segment in run.chunks(1) {
                    let counts = [&sharp, &smooth].map(|of| of.along(segment).evaluations);
                    parts[segment[0].pixel as usize].beams += (counts[0] + counts[1]) as u32;
                }
            }
            for group in self.tracer.plan.layers.group_numbers() {
                for (segment, sum) in run.iter().zip(gather(Some(group)).radiance) {
                    parts[segment.pixel as usize].groups[group.index()] += segment.beta * sum;
                }
            }
        }
        evaluations
    }
}

/// Position of the i-th pixel of a tile, along a Z curve, so that every sixteen are a block of 4 x 4.
fn tile_pixel(i: u32) -> (u32, u32) {
    let spread = |i: u32| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8) | (i >> 4 & 16);
    (spread(i), spread(i >> 1))
}
