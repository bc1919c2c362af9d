//! Pictures of the job so far, for pages. They are made away from the threads that serve others, at a bounded rate, and
//! only when somebody asks.

use crate::farm::Farm;
use crate::web::heat;
use beamfarm_proto::bytes::Bytes;
use beamfarm_shared::error::ImageError;
use beamfarm_shared::merge::Average;
use beamfarm_shared::png::encode_png;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep};
use tracing::warn;

/// Least time between two averages.
const PAUSE: Duration = Duration::from_secs(1);
/// Averaging takes at most one part in so many of the time: workers' deliveries wait for it.
const SHARE: u32 = 20;
/// Pictures nobody asked for in this time are given up.
const FORGET: Duration = Duration::from_secs(30);
/// Encoded pictures that are kept: those that several people look at, and those that a slider just left.
const ENCODED: usize = 8;

/// The average of a prefix of passes.
pub(crate) struct Picture {
    pub average: Average,
    /// Its relative standard error; infinite for one pass.
    pub error: f64,
}

/// What to show of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum View {
    /// The radiance, brighter by so many hundredths of a stop.
    Beauty { centistops: i32 },
    /// Where the error is.
    Error,
}

#[derive(Default)]
struct Shelf {
    /// The newest first; the one before it stays for those who are about to ask for it.
    pictures: Vec<Arc<Picture>>,
    due: Option<Instant>,
    asked: Option<Instant>,
}

/// The pictures of a farm.
pub(crate) struct Pictures {
    farm: Arc<Farm>,
    shelf: Mutex<Shelf>,
    /// Held while one is encoded, and as long again: a slider takes half a core at most.
    encoded: Arc<Mutex<Vec<(u64, View, Bytes)>>>,
}

impl Pictures {
    pub fn new(farm: Arc<Farm>) -> Self {
        Self {
            farm,
            shelf: Mutex::default(),
            encoded: Arc::default(),
        }
    }

    /// The picture of the complete passes, or the last one if that is not old.
    pub async fn latest(&self) -> Option<Arc<Picture>> {
        let mut shelf = self.shelf.lock().await;
        let now = Instant::now();
        shelf.asked = Some(now);
        let newest = shelf.pictures.first().cloned();
        let known = newest.as_ref().map_or(0, |picture| picture.average.passes);
        let is_due = shelf.due.is_none_or(|due| now >= due) || self.farm.end().is_some();
        if !is_due || self.farm.progress().prefix == known {
            return newest;
        }
        let farm = self.farm.clone();
        let average = move || {
            let average = farm.average()?;
            let error = average.relative_standard_error();
            Some(Arc::new(Picture { average, error }))
        };
        let made = tokio::task::spawn_blocking(average).await;
        let took = now.elapsed();
        shelf.due = Some(now + PAUSE.max(took * SHARE));
        match made {
            Ok(Some(picture)) => {
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

    /// The picture of so many passes if it is at hand, else the latest.
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
    pub async fn png(&self, picture: Arc<Picture>, view: View) -> Result<Bytes, ImageError> {
        let mut encoded = self.encoded.clone().lock_owned().await;
        let passes = picture.average.passes;
        let mut known = encoded.iter();
        if let Some((.., png)) = known.find(|known| known.0 == passes && known.1 == view) {
            return Ok(png.clone());
        }
        let started = Instant::now();
        let encode = move || match view {
            View::Beauty { centistops } => {
                encode_png(&picture.average.beauty, centistops as f32 / 100.0)
            }
            View::Error => heat::encode(&picture.average),
        };
        let png = tokio::task::spawn_blocking(encode).await;
        let png = png.map_err(|error| ImageError::Encode {
            field: "PNG",
            message: error.to_string(),
        })?;
        let png = Bytes::from(png?);
        encoded.insert(0, (passes, view, png.clone()));
        encoded.truncate(ENCODED);
        let took = started.elapsed();
        tokio::spawn(async move {
            sleep(took).await;
            drop(encoded);
        });
        Ok(png)
    }

    /// Give up what nobody looked at for a while.
    pub async fn forget(&self) {
        let mut shelf = self.shelf.lock().await;
        if shelf.asked.is_some_and(|asked| asked.elapsed() > FORGET) {
            *shelf = Shelf::default();
            drop(shelf);
            self.encoded.lock().await.clear();
        }
    }
}
