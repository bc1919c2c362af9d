//! A hierarchy over photon kernels.

use super::SurfacePhoton;
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::hierarchy::{Bounds, Hierarchy, Level};
use crate::kernels::PHOTON_MAP;
use crate::self_test::Together;
use crate::sizes::Sizing;

/// Lays out photons, which are counted on the device, for searching.
pub struct PhotonMap {
    threads: Sizing,
    surround: Kernel,
    place: Kernel,
    pub(super) hierarchy: Hierarchy,
    pub(super) boxes: Buffer,
    photons: Buffer,
    levels: Buffer,
}

impl PhotonMap {
    /// For at most this many photons.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most: u32) -> Result<Self> {
        let on = on.into();
        let hierarchy = Hierarchy::new(on, most)?;
        let levels: Vec<Level> = hierarchy.levels().collect();
        let top = Level {
            here: levels.len() as u32 - 1,
            below: 0,
        };
        let each = |name, bytes: usize| on.empty(name, bytes as u64 * u64::from(most));
        Ok(Self {
            threads: Sizing::new(on, "threads")?,
            surround: on.kernel(&PHOTON_MAP, "surround"),
            place: on.kernel(&PHOTON_MAP, "place"),
            boxes: each("boxes of photons", size_of::<Bounds>())?,
            photons: each("photons in order", size_of::<SurfacePhoton>())?,
            levels: on.device.buffer("levels of photons", &[&[top], &levels[..]].concat())?,
            hierarchy,
        })
    }

    /// Lays out [`SurfacePhoton`]s; `count`'s first word is their number, at most that of the map. Replaces the
    /// previous photons.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, photons: &Buffer) -> Result<()> {
        self.threads.run(work, count)?;
        let sizes = &self.threads.sizes;
        let groups = Groups::From(sizes);
        work.run(&self.surround, &[sizes, photons, &self.boxes], groups)?;
        self.hierarchy.run(work, count, &self.boxes)?;
        let buffers = [sizes, photons, self.hierarchy.order(), &self.photons];
        work.run(&self.place, &buffers, groups)?;
        Ok(())
    }

    /// All [`SurfacePhoton`]s, with neighbours close together.
    #[must_use]
    pub fn photons(&self) -> &Buffer {
        &self.photons
    }

    /// In binding order, from 40: the number of photons, the photons, boxes around every four and so on (see
    /// [`Hierarchy`]), and the levels of these: two words, the first the number of the last level, and then each
    /// [`Level`].
    #[must_use]
    pub fn in_order(&self) -> [&Buffer; 4] {
        [&self.threads.sizes, &self.photons, self.hierarchy.nodes(), &self.levels]
    }
}
