//! Pictures of the job so far, for pages. They are made on demand, at a bounded rate, away from the threads that serve
//! others.

use super::shown::{self, Shown};
use crate::farm::Farm;
use beamfarm_image::error::ImageError;
use beamfarm_image::merge::{Average, Noise};
use beamfarm_proto::bytes::Bytes;
use std::sync::{Arc, Weak};
use std::time::Duration;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep};
use tracing::{Span, warn};

/// The least time between two averages.
const PAUSE: Duration = Duration::from_secs(1);
/// Averaging takes at most one part in this many of the time, as workers' deliveries wait for it.
const SHARE: u32 = 20;
/// Pictures that nobody requests for this long are dropped.
const FORGET: Duration = Duration::from_secs(30);
/// Encoded pictures that are kept: those that several people look at, and those that a slider just left.
const ENCODED: usize = 8;

/// The average of a prefix of passes.
pub(crate) struct Picture {
    pub average: Average,
    /// Its relative standard error; infinite for one pass.
    pub error: f64,
    /// Where its error is.
    pub noise: Noise,
}

#[derive(Default)]
struct Shelf {
    /// Newest first; the one before is kept for requests that are about to come.
    pictures: Vec<Arc<Picture>>,
    /// Complete passes at the last look, and whether the job was over.
    last_look: Option<(u64, bool)>,
    due: Option<Instant>,
    asked: Option<Instant>,
}

/// The pictures of a farm.
pub(crate) struct Pictures {
    farm: Arc<Farm>,
    shelf: Mutex<Shelf>,
    /// Locked while a picture is encoded and for as long again, so that a slider takes at most half a core.
    encoded: Arc<Mutex<Vec<Encoded>>>,
}

struct Encoded {
    /// Not identified by its number of passes: passes may be taken out and rendered again with different bits.
    of: Weak<Picture>,
    shown: Shown,
    png: Bytes,
}

impl Pictures {
    pub fn new(farm: Arc<Farm>) -> Self {
        Self {
            farm,
            shelf: Mutex::default(),
            encoded: Arc::default(),
        }
    }

    /// The picture of the complete passes, or the last one if it is recent.
    pub async fn latest(&self) -> Option<Arc<Picture>> {
        let mut shelf = self.shelf.lock().await;
        let now = Instant::now();
        shelf.asked = Some(now);
        let newest = shelf.pictures.first().cloned();
        let over = self.farm.end().is_some();
        let look = (self.farm.progress().prefix, over);
        let is_due = shelf.due.is_none_or(|due| now >= due) || over;
        if look.0 == 0 || !is_due || shelf.last_look == Some(look) {
            return newest;
        }
        let farm = self.farm.clone();
        let span = Span::current();
        let average = move || {
            let _job = span.entered();
            let average = farm.average()?;
            let error = average.relative_standard_error();
            let noise = average.noise();
            Some(Arc::new(Picture { average, error, noise }))
        };
        let made = tokio::task::spawn_blocking(average).await;
        let took = now.elapsed();
        shelf.due = Some(now + PAUSE.max(took * SHARE));
        shelf.last_look = Some(look);
        match made {
            Ok(Some(picture)) => {
                let passes = picture.average.passes;
                shelf.pictures.retain(|old| old.average.passes != passes);
                shelf.pictures.insert(0, picture.clone());
                shelf.pictures.truncate(2);
                Some(picture)
            }
            Ok(None) => newest,
            Err(error) => {
                warn!("a picture for the page: {error}");
                newest
            }
        }
    }

    /// The picture of this many passes if it is available, else the latest.
    pub async fn of(&self, passes: Option<u64>) -> Option<Arc<Picture>> {
        if let Some(passes) = passes {
            let shelf = self.shelf.lock().await;
            let mut pictures = shelf.pictures.iter();
            if let Some(picture) = pictures.find(|picture| picture.average.passes == passes) {
                return Some(picture.clone());
            }
        }
        self.latest().await
    }

    /// A picture as PNG.
    pub async fn png(&self, picture: Arc<Picture>, shown: Shown) -> Result<Bytes, ImageError> {
        let mut encoded = self.encoded.clone().lock_owned().await;
        let of = Arc::downgrade(&picture);
        let mut known = encoded.iter();
        if let Some(known) = known.find(|known| known.of.ptr_eq(&of) && known.shown == shown) {
            return Ok(known.png.clone());
        }
        let started = Instant::now();
        let farm = self.farm.clone();
        let encode = move || shown::encode(&picture.average, &farm.job().layers, shown);
        let png = tokio::task::spawn_blocking(encode).await;
        let png = png.map_err(|error| ImageError::Encode {
            field: "PNG",
            message: error.to_string(),
        })?;
        let png = Bytes::from(png?);
        let known = Encoded {
            of,
            shown,
            png: png.clone(),
        };
        encoded.insert(0, known);
        encoded.truncate(ENCODED);
        let took = started.elapsed();
        tokio::spawn(async move {
            sleep(took).await;
            drop(encoded);
        });
        Ok(png)
    }

    /// Drop pictures that nobody has looked at for a while.
    pub async fn forget(&self) {
        let mut shelf = self.shelf.lock().await;
        if shelf.asked.is_some_and(|asked| asked.elapsed() > FORGET) {
            *shelf = Shelf::default();
            drop(shelf);
            self.encoded.lock().await.clear();
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::farm::{JobSpec, Start, Target, Timing};
    use beamfarm_image::bundle::Bundle;
    use beamfarm_image::film::Film;
    use beamfarm_image::job::{EngineKind, JobSettings, ScheduleKind, Techniques};
    use beamfarm_image::merge::{Node, TreeSum};

    /// A job of 100 passes that continues with `passes` done after `before`.
    pub fn farm(passes: u64, target: Option<Target>, before: Duration) -> Arc<Farm> {
        let mut sum = TreeSum::new(2, 1).with_fence(0);
        for pass in 0..passes {
            let mut film = Film::new(2, 1);
            film.pixels.fill([1.0 + pass as f32 / 100.0; 3]);
            sum.insert(Node::leaf(pass, film)).unwrap();
        }
        let spec = JobSpec {
            bundle: Bundle::default(),
            settings: JobSettings {
                seed: 0,
                alpha: 0.5,
                schedule: ScheduleKind::Pass,
                budget: None,
                paths_per_pass: 1,
                reference_paths: 1,
                techniques: Techniques::default(),
                engine: EngineKind::default(),
            },
            width: 2,
            height: 1,
            layers: Vec::new(),
            first_pass: 0,
            passes: 100,
            audit_every: 0,
        };
        let start = Start {
            sum: Some(sum),
            target,
            before,
            ..Start::default()
        };
        Farm::new(spec, Timing::default(), start)
    }

    /// The image of a job that met its target holds fewer passes than there are.
    #[tokio::test]
    async fn the_last_picture_is_made_once() {
        let target = Target {
            error: 0.5,
            percentile: None,
        };
        let farm = farm(5, Some(target), Duration::ZERO);
        assert!(farm.end().is_some());
        assert_eq!(farm.progress().prefix, 5);
        let pictures = Pictures::new(farm);
        let first = pictures.latest().await.unwrap();
        assert_eq!(first.average.passes, 2);
        for _ in 0..3 {
            assert!(Arc::ptr_eq(&first, &pictures.latest().await.unwrap()));
        }
    }

    #[tokio::test]
    async fn the_end_is_looked_at_even_if_no_pass_came() {
        let farm = farm(3, None, Duration::ZERO);
        let pictures = Pictures::new(farm.clone());
        let first = pictures.latest().await.unwrap();
        assert!(Arc::ptr_eq(&first, &pictures.latest().await.unwrap()));
        farm.stop();
        let last = pictures.latest().await.unwrap();
        assert_eq!(last.average, first.average);
        assert!(Arc::ptr_eq(&last, &pictures.latest().await.unwrap()));
        assert_eq!(pictures.shelf.lock().await.pictures.len(), 1);
    }
}
