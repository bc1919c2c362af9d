//! A coarse picture for when there is no other. It is part of no pass.

use beamfarm_coordinator::Farm;
use beamfarm_image::film::Film;
use beamfarm_image::job::JobSettings;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Width in pixels and photon paths of sketches: the first is done at once, however slow the scene is.
const STEPS: [(u32, u32); 6] = [
    (16, 64),
    (64, 500),
    (128, 1_000),
    (256, 2_000),
    (512, 4_000),
    (1024, 8_000),
];
/// A step takes at most this many times as long as the one before.
const LONGER: u32 = 10;
/// Enough time to show something of almost every scene.
pub const GLANCE: Duration = Duration::from_millis(100);
/// Rendering time when somebody waits for the sketch (`LOOK`), and total time including loading the scene (`AT_MOST`).
pub const LOOK: Duration = Duration::from_secs(1);
const AT_MOST: Duration = Duration::from_secs(2);

/// A coarse picture.
#[derive(Clone, Debug)]
pub struct Sketch {
    /// The rendered pixels.
    film: Film,
    /// Photon paths; `None` for a sketch of camera paths only.
    paths: Option<u32>,
    /// Size of the full picture, width and height in pixels.
    full: [u32; 2],
}

impl Sketch {
    /// A sketch with a provisional plan, as fine as possible in about this time.
    pub fn new(scene: &mut Scene, settings: JobSettings, patience: Duration) -> Option<Self> {
        Self::by(scene, patience, |scene, paths| beams(scene, settings, paths))
    }

    /// The same with this width in pixels and number of photon paths.
    pub fn once(scene: &mut Scene, settings: JobSettings, (width, paths): (u32, u32)) -> Option<Self> {
        Self::step(scene, width, |scene| beams(scene, settings, paths))
    }

    /// A sketch of a job's scene. `None`: it cannot be rendered or takes too long to load.
    pub async fn of_job(farm: Arc<Farm>) -> Option<Self> {
        let (sender, sketch) = oneshot::channel();
        // A thread that is not joined.
        std::thread::spawn(move || {
            let description = beamfarm_scene::load(&farm.bundle()).ok();
            let sketch = description.and_then(|it| Self::new(&mut Scene::new(it), farm.job().settings, LOOK));
            // Fails if it comes too late.
            let _ = sender.send(sketch);
        });
        timeout(AT_MOST, sketch).await.ok()?.ok()?
    }

    /// A sketch by `render`, which gets a number of photon paths and returns the number used.
    pub fn by(
        scene: &mut Scene,
        patience: Duration,
        mut render: impl FnMut(&Scene, u32) -> Option<(Film, Option<u32>)>,
    ) -> Option<Self> {
        let begun = Instant::now();
        let mut best: Option<Self> = None;
        for (width, paths) in STEPS {
            let before = begun.elapsed();
            let sketch = Self::step(scene, width, |scene| render(scene, paths))?;
            let is_full = sketch.film.width == sketch.full[0];
            best = Some(sketch);
            let took = begun.elapsed() - before;
            if is_full || begun.elapsed() + LONGER * took > patience {
                break;
            }
        }
        best
    }

    fn step(scene: &mut Scene, width: u32, render: impl FnOnce(&Scene) -> Option<(Film, Option<u32>)>) -> Option<Self> {
        let camera = &scene.description().camera;
        let full = [camera.width, camera.height];
        let width = width.min(full[0]);
        let height = u64::from(full[1]) * u64::from(width) / u64::from(full[0]);
        scene.resize(width, (height as u32).max(1));
        let rendered = render(scene);
        scene.resize(full[0], full[1]);
        let (mut film, paths) = rendered?;
        for pixel in film.pixels.iter_mut().filter(|p| !p.iter().all(|c| c.is_finite())) {
            *pixel = [0.0; 3];
        }
        Some(Self { film, paths, full })
    }

    /// Number of rendered pixels.
    pub fn pixels(&self) -> usize {
        self.film.pixels.len()
    }

    /// Whether nothing is visible.
    pub fn is_black(&self) -> bool {
        self.film.pixels.as_flattened().iter().all(|value| *value == 0.0)
    }

    /// Enlarged to full size, with pixels as squares.
    pub fn enlarged(&self) -> Film {
        let [width, height] = self.full;
        let mut film = Film::new(width, height);
        let from = |at: u32, full: u32, coarse: u32| (u64::from(at) * u64::from(coarse) / u64::from(full)) as usize;
        for (y, row) in (0..height).zip(film.pixels.chunks_exact_mut(width as usize)) {
            let row_here = from(y, height, self.film.height) * self.film.width as usize;
            for (x, pixel) in (0..width).zip(row) {
                *pixel = self.film.pixels[row_here + from(x, width, self.film.width)];
            }
        }
        film
    }
}

fn beams(scene: &Scene, settings: JobSettings, paths: u32) -> Option<(Film, Option<u32>)> {
    let settings = JobSettings {
        paths_per_pass: paths,
        ..settings
    };
    let plan = RenderPlan::provisional(scene, settings);
    let film = render_pass(scene, &plan, 0).ok()?.film;
    Some((film, plan.has_photons().then_some(plan.surface_paths)))
}

impl fmt::Display for Sketch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Film { width, height, .. }, [full_width, full_height]) = (&self.film, self.full);
        let by = match self.paths {
            Some(paths) => format!("{paths} photon paths"),
            None => "one camera path a pixel".into(),
        };
        write!(
            f,
            "a coarse picture of the whole image, {width} x {height} pixels by {by}, scaled up to {full_width} x \
             {full_height}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_become_squares_of_the_full_size() {
        let film = Film {
            width: 2,
            height: 1,
            pixels: vec![[1.0; 3], [2.0; 3]],
        };
        let sketch = Sketch {
            film,
            paths: None,
            full: [5, 3],
        };
        let film = sketch.enlarged();
        let row: Vec<f32> = film.pixels[10..].iter().map(|p| p[0]).collect();
        assert_eq!((film.width, film.height, row), (5, 3, vec![1.0, 1.0, 1.0, 2.0, 2.0]));
    }
}
