//! Contributions of photons at points on surfaces.

use super::PhotonMap;
use crate::device::{Buffer, Groups, Kernel, Kind, Work};
use crate::error::Result;
use crate::kernels::PHOTONS;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::geometry::GeometryBuffers;

/// Most photons in a part of the hierarchy: see `kernels/photons.wgsl`.
const PART: u32 = 1 << 14;

/// Requests, in buffers.
#[derive(Clone, Copy)]
pub struct PhotonRequests<'a> {
    /// The number of requests, in its first word.
    pub count: &'a Buffer,
    /// [`PhotonRequest`](super::PhotonRequest)s.
    pub requests: &'a Buffer,
    /// By request: the [`Material`](crate::world::materials::Material) at its point, for requests that use it.
    pub surfaces: &'a Buffer,
    /// Two words, followed by the wavelength data of `kernels/waves.wgsl` if light has wavelengths.
    pub key: &'a Buffer,
    /// Tables of rough coats.
    pub texels: &'a Buffer,
    /// Vectors of three floats with a stride of 16 bytes, the last four of which are left alone.
    pub radiance: &'a Buffer,
    /// If light groups have layers: the group whose photons count, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}

/// The density estimate over surface photons, for requests that are counted on the device.
pub struct PhotonEstimate {
    threads: Sizing,
    kernel: Kernel,
    /// Range of the hierarchy for each dispatch.
    ranges: Vec<Buffer>,
}

impl PhotonEstimate {
    /// For any number of requests and at most this many photons, in a scene's geometry.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers, most_photons: u32) -> Result<Self> {
        let on = on.into();
        let at_once = match on.device.listed().kind {
            Kind::Software => 1,
            _ => u32::MAX,
        };
        Self::with_parts(on, geometry, most_photons, at_once)
    }

    /// With at most this many parts of the hierarchy per dispatch.
    pub(super) fn with_parts(
        on: Together,
        geometry: &GeometryBuffers,
        most_photons: u32,
        at_once: u32,
    ) -> Result<Self> {
        let parts = most_photons.div_ceil(PART).max(1);
        let at_once = at_once.min(parts);
        let range = |first| on.device.buffer("parts of photons", &[first, first + at_once]);
        Ok(Self {
            ranges: (0..parts).step_by(at_once as usize).map(range).collect::<Result<_>>()?,
            threads: Sizing::new(on, "threads")?,
            kernel: geometry.kernel(&on, &PHOTONS, "estimate"),
        })
    }

    /// Adds the contribution of a map's photons, in their order, to the radiance vector of each request.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, of: &PhotonRequests, map: &PhotonMap, geometry: &GeometryBuffers) -> Result<()> {
        self.threads.run(work, of.count)?;
        let sizes = &self.threads.sizes;
        let names: Vec<&str> = self.kernel.ready()?.buffer_names().collect();
        let key = names.contains(&"key").then_some(of.key);
        let texels = names.contains(&"texels").then_some(of.texels);
        for range in &self.ranges {
            let own = [sizes, of.requests, range, of.radiance, of.surfaces];
            let buffers = [
                &own[..],
                key.as_slice(),
                of.light_group.as_slice(),
                &geometry.in_order(),
                texels.as_slice(),
                &map.in_order(),
            ]
            .concat();
            work.run(&self.kernel, &buffers, Groups::From(sizes))?;
        }
        Ok(())
    }
}
