//! The walls that cross kernels of surface photons.

use crate::beams::Near;
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::PHOTON_WALLS;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::geometry::GeometryBuffers;

/// Finds walls for freshly traced [`SurfacePhoton`](crate::photons::SurfacePhoton)s, in a scene with walls. Before
/// that, no wall hides anything from them.
pub struct PhotonWalls {
    threads: Sizing,
    find: Kernel,
}

impl PhotonWalls {
    /// In a scene with this geometry.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers) -> Result<Self> {
        let on = on.into();
        Ok(Self {
            threads: Sizing::new(on, "threads")?,
            find: geometry.kernel(&on, &PHOTON_WALLS, "find_crossing"),
        })
    }

    /// For photons whose number is `count`'s first word.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, near: &Near, count: &Buffer, photons: &Buffer) -> Result<()> {
        self.threads.run(work, count)?;
        let sizes = &self.threads.sizes;
        let geometry = near.geometry.in_order();
        let buffers = [
            &[sizes, photons][..],
            &geometry,
            &[&near.walls.shapes, &near.walls.hull],
        ]
        .concat();
        work.run(&self.find, &buffers, Groups::From(sizes))?;
        Ok(())
    }
}
