//! What photons bring to points on surfaces.

use super::PhotonMap;
use crate::device::{Buffer, Groups, Kernel, Kind, Work};
use crate::error::Result;
use crate::kernels::PHOTONS;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::geometry::GeometryBuffers;

/// The most photons in a part of the hierarchy: see `kernels/photons.wgsl`.
const PART: u32 = 1 << 14;

/// What is asked, in buffers.
#[derive(Clone, Copy)]
pub struct PhotonRequests<'a> {
    /// How many, in its first word.
    pub count: &'a Buffer,
    /// [`PhotonRequest`](super::PhotonRequest)s.
    pub requests: &'a Buffer,
    /// By request: the [`Material`](crate::world::materials::Material) that it is of, where it says so.
    pub surfaces: &'a Buffer,
    /// Two words and then, where light has wavelengths, what `kernels/waves.wgsl` says.
    pub key: &'a Buffer,
    /// Numbers of their coats.
    pub texels: &'a Buffer,
    /// Vectors of three floats, 16 bytes apart, the last four of which are left alone.
    pub radiance: &'a Buffer,
    /// Where groups of lights have layers: the number of the one whose photons count, from 1 on, or 0.
    pub light_group: Option<&'a Buffer>,
}

/// The density estimate over surface photons, for as many requests as are counted on the device.
pub struct PhotonEstimate {
    threads: Sizing,
    kernel: Kernel,
    /// From which part of the hierarchy to before which, dispatch by dispatch.
    ranges: Vec<Buffer>,
}

impl PhotonEstimate {
    /// For any number of requests, and so many photons at most, in a scene's geometry.
    ///
    /// # Errors
    /// The device's.
    pub fn new<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers, most_photons: u32) -> Result<Self> {
        let on = on.into();
        let at_once = match on.device.listed().kind {
            Kind::Software => 1,
            _ => u32::MAX,
        };
        Self::with_parts(on, geometry, most_photons, at_once)
    }

    /// With so many parts of the hierarchy a dispatch, at most.
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

    /// Add what the photons of a map bring to each request's vector of the radiance, one after another in their order.
    ///
    /// # Errors
    /// The device's.
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
