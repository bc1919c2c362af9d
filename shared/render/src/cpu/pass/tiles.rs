//! The camera's part of a pass: the rays of its pixels, tile by tile, and the beams gathered along them.

use crate::cpu::beam::estimate::{CameraSegment, CameraSegments, Gather, Sharing, Vectors};
use crate::cpu::beam::store::Beams;
use crate::cpu::flow::Flow;
use crate::cpu::transport::{CameraTracer, PathContext};
use crate::math::{Ray, Rgb, Vec2};
use crate::parallel;
use crate::plan::aov::{Parts, Recorder};
use crate::plan::engine::{CameraWork, NoPass};
use crate::sampler::{Purpose, Sampler, mix64};
use crate::world::geometry::SurfaceHit;
use crate::world::mask::{Start, VisibilityMask};
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_image::matte::{Matte, NOTHING};

/// Pixels along the side of a tile: neighbouring pixels whose straight segments look for beams together.
const TILE: u32 = 32;
const TILE_PIXELS: usize = (TILE * TILE) as usize;
/// Pixels of a square block in a tile, whose rays gather side by side.
const BLOCK_PIXELS: usize = 16;

/// A square within the unit square that maps to the lens. A tile's rays go through one such square in a pass, and each
/// block's through a part of it, because rays near each other find beams together. The sixteen passes of a replication
/// visit all sixteen parts of the lens, in the tile's own order.
struct LensCell {
    /// The first corner.
    corner: Vec2,
    side: f32,
}

/// Parts along a side of the lens's square, and along a side of each part.
const LENS_CELLS: f32 = 4.0;

impl LensCell {
    const LENS: Self = Self {
        corner: Vec2::ZERO,
        side: 1.0,
    };

    /// One of the sixteen parts.
    fn part(&self, sampler: &mut Sampler) -> Self {
        let side = self.side / LENS_CELLS;
        Self {
            corner: self.corner + (sampler.next_2d() * LENS_CELLS).floor() * side,
            side,
        }
    }

    /// Where a ray goes through, from a point of the unit square.
    fn point(&self, u: Vec2) -> Vec2 {
        self.corner + u * self.side
    }
}

/// A tile's number, from its first pixel.
fn tile_number(x0: u32, y0: u32) -> u64 {
    (y0 as u64) << 32 | x0 as u64
}

/// The camera of a pass, and what its photons have left.
pub(super) struct CameraPass<'a, V> {
    pub tracer: CameraTracer<'a, V>,
    pub beams: Option<&'a Beams>,
    /// How things move, if a layer shows it.
    pub flow: Option<&'a Flow>,
    pub pass_index: u64,
    pub vectors: Vectors,
    pub chord_key: u64,
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Scratch {
    camera: CameraSegments,
    /// By pixel, if the plan has layers.
    parts: Vec<Parts>,
}

/// A camera ray of a tile's pixel.
struct CameraRay {
    /// The pixel's number in the tile.
    i: usize,
    /// The pixel's place in the image.
    x: u32,
    y: u32,
    ray: Ray,
    /// Random numbers of the path that starts with it.
    sampler: Sampler,
}

/// The pixels of a tile in the order of [`tile_pixel`].
struct Tile {
    radiance: [Rgb; TILE_PIXELS],
    layers: Vec<[[f32; 3]; TILE_PIXELS]>,
    mattes: Vec<[u32; TILE_PIXELS]>,
    work: CameraWork,
}

/// All tiles.
pub(super) struct Picture {
    pub film: Film,
    pub layers: Vec<Film>,
    pub mattes: Vec<Matte>,
    pub work: CameraWork,
}

impl<V: VisibilityMask> CameraPass<'_, V> {
    pub fn render(&self) -> Result<Picture, NoPass> {
        let camera = &self.tracer.scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        let mut layers = vec![film.clone(); self.tracer.plan.layers.films().len()];
        let mut ids = vec![vec![NOTHING; film.pixels.len()]; self.tracer.plan.layers.mattes()];
        let columns = camera.width.div_ceil(TILE);
        let rows = camera.height.div_ceil(TILE);
        // Tiles differ a hundredfold in work: each is a task.
        let tiles = parallel::map((columns * rows) as usize, |tile| {
            let (x, y) = (tile as u32 % columns, tile as u32 / columns);
            self.tile(x * TILE, y * TILE, &mut Scratch::default())
        });
        let mut work = CameraWork::default();
        for (index, tile) in tiles.into_iter().enumerate() {
            work += tile.work;
            let (x0, y0) = (index as u32 % columns * TILE, index as u32 / columns * TILE);
            for (i, radiance) in tile.radiance.into_iter().enumerate() {
                let (x, y) = tile_pixel(i as u32);
                if x0 + x < camera.width && y0 + y < camera.height {
                    let at = ((y0 + y) * camera.width + x0 + x) as usize;
                    film.pixels[at] = radiance.to_array();
                    for (layer, pixels) in layers.iter_mut().zip(&tile.layers) {
                        layer.pixels[at] = pixels[i];
                    }
                    for (ids, pixels) in ids.iter_mut().zip(&tile.mattes) {
                        ids[at] = pixels[i];
                    }
                }
            }
        }
        if self.tracer.scene.is_interrupted() {
            return Err(NoPass::Interrupted);
        }
        if let Some(offset) = self.offset() {
            camera.filter.reconstruct(layers.iter_mut().chain([&mut film]), offset);
        }
        Ok(Picture {
            film,
            layers,
            mattes: ids.iter().map(|ids| Matte::leaf(ids)).collect(),
            work,
        })
    }

    fn tile(&self, x0: u32, y0: u32, scratch: &mut Scratch) -> Tile {
        let mut radiance = [Rgb::ZERO; TILE_PIXELS];
        scratch.camera.clear();
        let plan = &self.tracer.plan.layers;
        scratch.parts.clear();
        if !plan.layers.is_empty() {
            scratch.parts.resize(TILE_PIXELS, Parts::new(plan.groups()));
        }
        let mut work = CameraWork::default();
        self.each_ray((x0, y0), |CameraRay { i, ray, sampler, .. }| {
            if let Some(parts) = scratch.parts.get_mut(i) {
                self.look_along(&ray, self.flow, parts);
            }
            let record = Recorder::new(plan, scratch.parts.get_mut(i));
            let mut context = PathContext::new(sampler, i as u16, &mut scratch.camera, record);
            radiance[i] = self.tracer.trace(ray, &mut context);
            work.rays += context.rays;
        });
        if let Some(beams) = self.beams {
            work += self.gather_beams(beams, tile_number(x0, y0), scratch, &mut radiance);
        }
        let parts = &scratch.parts;
        let is_odd = self.pass_index % 2 == 1;
        let values = |(number, layer): (usize, &Layer)| match layer {
            Layer::Odd if is_odd => radiance.map(|value| value.to_array()),
            _ => {
                let group = plan.group_of_layer(number);
                std::array::from_fn(|i| parts[i].value(layer, group))
            }
        };
        Tile {
            radiance,
            layers: plan.films().iter().enumerate().map(values).collect(),
            mattes: (0..plan.mattes())
                .map(|matte| std::array::from_fn(|i| plan.id(matte, parts[i].object)))
                .collect(),
            work,
        }
    }

    /// The rays of a tile's pixels, in the order of [`tile_pixel`].
    fn each_ray(&self, (x0, y0): (u32, u32), mut each: impl FnMut(CameraRay)) {
        let CameraTracer { scene, plan, .. } = &self.tracer;
        let camera = &scene.description().camera;
        let seed = plan.settings.seed;
        let mut cells = Sampler::even(seed, self.pass_index, Purpose::Lens, tile_number(x0, y0));
        let mut of_tile = LensCell::LENS;
        if plan.beams {
            of_tile = of_tile.part(&mut cells);
        }
        let mut cell = LensCell::LENS;
        let offset = self.offset();
        for i in 0..TILE_PIXELS {
            if i % BLOCK_PIXELS == 0 {
                if scene.is_interrupted() {
                    break;
                }
                if plan.beams {
                    cell = of_tile.part(&mut cells);
                }
            }
            let (x, y) = tile_pixel(i as u32);
            let (x, y) = (x0 + x, y0 + y);
            if x >= camera.width || y >= camera.height {
                continue;
            }
            let chunk = y as u64 * camera.width as u64 + x as u64;
            let mut sampler = Sampler::even(seed, self.pass_index, Purpose::Camera, chunk);
            let own = sampler.next_2d();
            let image = camera.sample(x, y, offset.unwrap_or(own));
            if !camera.sees(image) {
                continue;
            }
            let lens = sampler.next_2d();
            let ray = camera.ray(image, cell.point(lens));
            each(CameraRay { i, x, y, ray, sampler });
        }
    }

    /// What a ray alone tells about its pixel.
    fn look_along(&self, ray: &Ray, flow: Option<&Flow>, parts: &mut Parts) {
        if self.tracer.plan.layers.counts_targets() {
            parts.targets = self.targets_along(ray);
        }
        if let Some(flow) = flow {
            parts.motion = flow.along(self.tracer.scene, ray, self.first_hit(ray).as_ref());
        }
    }

    /// See [`super::along_rays`].
    pub fn along_rays(&self, flow: Option<&Flow>) -> Result<Vec<Parts>, NoPass> {
        let camera = &self.tracer.scene.description().camera;
        let (columns, rows) = (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
        let tiles = parallel::map((columns * rows) as usize, |tile| {
            let (x, y) = (tile as u32 % columns, tile as u32 / columns);
            let mut pixels = Vec::with_capacity(TILE_PIXELS);
            self.each_ray((x * TILE, y * TILE), |CameraRay { x, y, ray, .. }| {
                let mut parts = Parts::default();
                self.look_along(&ray, flow, &mut parts);
                pixels.push(((y * camera.width + x) as usize, parts));
            });
            pixels
        });
        if self.tracer.scene.is_interrupted() {
            return Err(NoPass::Interrupted);
        }
        let mut all = vec![Parts::default(); camera.width as usize * camera.height as usize];
        for (at, parts) in tiles.into_iter().flatten() {
            all[at] = parts;
        }
        Ok(all)
    }

    /// Where all samples lie in their pixels, if the filter spreads them over several pixels.
    fn offset(&self) -> Option<Vec2> {
        let CameraTracer { scene, plan, .. } = &self.tracer;
        let filter = &scene.description().camera.filter;
        (filter.spreads()).then(|| Sampler::even(plan.settings.seed, self.pass_index, Purpose::Film, 0).next_2d())
    }

    /// Photon targets along a camera ray, up to the first surface.
    fn targets_along(&self, ray: &Ray) -> u32 {
        let Some(targets) = &self.tracer.plan.targets else {
            return 0;
        };
        targets.count(ray, self.first_hit(ray).map_or(f32::INFINITY, |hit| hit.t))
    }

    /// The first surface that a camera ray meets.
    fn first_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        let CameraTracer { scene, mask, .. } = &self.tracer;
        let hidden = mask.from(Start::Camera);
        let is_passed = |object: u32| scene.passable[object as usize] || mask.hides(hidden, object);
        scene.meets(ray, f32::INFINITY, &is_passed)
    }

    /// `tile`: the tile's number.
    fn gather_beams(
        &self,
        beams: &Beams,
        tile: u64,
        scratch: &mut Scratch,
        radiance: &mut [Rgb; TILE_PIXELS],
    ) -> CameraWork {
        let Scratch { camera, parts } = scratch;
        let CameraSegments { segments, steps } = camera;
        let seed = self.tracer.plan.settings.seed;
        let mut sampler = Sampler::new(seed, self.pass_index, Purpose::Sharing, tile);
        let key = mix64(self.chord_key ^ tile);
        let mut work = CameraWork::default();
        let kind = |s: &CameraSegment| (s.medium, s.way, s.wave);
        // A stable sort: within a run, segments stay in the order of pixels.
        segments.sort_by_key(kind);
        for run in segments.chunk_by(|a, b| kind(a) == kind(b)) {
            if self.tracer.scene.is_interrupted() {
                break;
            }
            let medium = run[0].medium;
            let wave = run[0].wave;
            let beams = beams.seen_by(wave);
            let sharp = Gather {
                map: &beams.sharp,
                medium: &self.tracer.scene.media()[medium as usize],
                steps,
                scene: Some(self.tracer.scene),
                group: None,
                wave,
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
                    all.blocks += shared.blocks;
                }
                all
            };
            let tint = self.tracer.tint_of(wave);
            let gathered = gather(None);
            work.evaluations += gathered.evaluations;
            work.blocks += gathered.blocks;
            for (segment, sum) in run.iter().zip(gathered.radiance) {
                let scattered = tint * (segment.beta * sum);
                radiance[segment.pixel as usize] += scattered;
                if let Some(parts) = parts.get_mut(segment.pixel as usize) {
                    parts.add(segment.part, scattered);
                }
            }
            if self.tracer.plan.layers.counts_beams() {
                // One by one: the quicker side-by-side gathering only counts for all segments together.
                for segment in run.chunks(1) {
                    let counts = [&sharp, &smooth].map(|of| of.along(segment).evaluations);
                    parts[segment[0].pixel as usize].beams += (counts[0] + counts[1]) as u32;
                }
            }
            for group in self.tracer.plan.layers.group_numbers() {
                for (segment, sum) in run.iter().zip(gather(Some(group)).radiance) {
                    parts[segment.pixel as usize].groups[group.index()] += tint * (segment.beta * sum);
                }
            }
        }
        work
    }
}

/// Position of the i-th pixel of a tile along a Z curve: every sixteen form a block of 4 x 4.
fn tile_pixel(i: u32) -> (u32, u32) {
    let spread = |i: u32| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8) | (i >> 4 & 16);
    (spread(i), spread(i >> 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The passes of a replication visit each part of the lens once. Over tiles, a pass visits all parts equally often:
    /// chi-square of 15 degrees of freedom below its mean plus five standard deviations.
    #[test]
    fn tiles_visit_all_of_the_lens() {
        let part = |pass, tile| {
            let mut sampler = Sampler::even(1, pass, Purpose::Lens, tile);
            let cell = LensCell::LENS.part(&mut sampler);
            let Vec2 { x, y } = cell.point(Vec2::splat(0.5)) * LENS_CELLS;
            y as usize * LENS_CELLS as usize + x as usize
        };
        let mut counts = [0.0; 16];
        for tile in 0..1600 {
            counts[part(21, tile_number(32 * tile, 64))] += 1.0;
        }
        let chi: f64 = counts.iter().map(|n| (n - 100.0) * (n - 100.0) / 100.0).sum();
        assert!(chi < 15.0 + 5.0 * libm::sqrt(30.0), "{chi}");
        let mut visited = [false; 16];
        (16..32).for_each(|pass| visited[part(pass, 7)] = true);
        assert_eq!(visited, [true; 16]);
    }
}
