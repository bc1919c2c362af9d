//! A path on its way from the camera, and when it ends.

use crate::math::{Ray, Rgb, Vec3};
use crate::plan::aov::{Part, Recorder};
use crate::sampler::Sampler;
use crate::world::medium::MediumId;
use crate::world::rules::HiddenSet;
use crate::world::spectrum::Wave;

/// Roulette starts at this many scatterings. From then on, paths survive with this factor times their throughput.
/// Variance times time, relative to a depth of 4 and a factor of 1: 0.76 to 0.95 on seven scenes.
const ROULETTE_DEPTH: u32 = 2;
const ROULETTE_FACTOR: f32 = 2.0;
/// From this many scatterings on, a path goes on with a probability of at most [`MAX_SURVIVAL`], so that trapped light
/// (total internal reflection in a clear sphere, say) ends as well. Late and mild, because each survival makes the path
/// heavier.
const TRAPPED_DEPTH: u32 = 1024;
const MAX_SURVIVAL: f32 = 0.999;

/// A path on its way from the camera.
pub(super) struct Path<'a> {
    pub(super) ray: Ray,
    pub(super) medium: MediumId,
    /// What the ray does not see.
    pub(super) hidden: HiddenSet,
    /// The path came from the camera only over specular surfaces and lobes that passes follow.
    pub(super) is_seen: bool,
    /// The part that light counts for which the path meets now.
    pub(super) part: Part,
    /// Throughput from the film.
    pub(super) beta: Rgb,
    /// Set once it has met a dispersive surface. The throughput does not contain its weight.
    pub(super) wave: Option<Wave>,
    /// How refraction has compressed radiance so far: this factor on the throughput comes and goes along the path.
    pub(super) compression: f32,
    /// Scatterings so far.
    pub(super) depth: u32,
    /// The vertex where the direction was drawn. None if the light that the path meets can be found in no other way.
    pub(super) drawn_at: Option<DrawnAt>,
    pub(super) radiance: Rgb,
    pub(super) record: Recorder<'a>,
}

/// A vertex at which lights were sampled as well.
pub(super) struct DrawnAt {
    /// Rules decide which light comes straight from lights: it is only sampled.
    pub(super) is_ruled: bool,
    /// Lights that rules keep off this vertex.
    pub(super) unlit: HiddenSet,
    /// The camera sees this vertex: shadow rays from here obey the rules of lights.
    pub(super) is_seen: bool,
    pub(super) point: Vec3,
    /// Density of the drawn direction per solid angle.
    pub(super) pdf: f32,
    /// From the vertex to the start of the path's ray, which may have passed boundaries since.
    pub(super) distance: f32,
    /// The normal of a surface that is lit from this side only.
    pub(super) facing: Option<Vec3>,
}

impl Path<'_> {
    /// Adds radiance at the film that comes from a light.
    pub(super) fn add(&mut self, light: usize, radiance: Rgb) {
        let radiance = self.wave.map_or(radiance, |wave| radiance * wave.weight);
        self.radiance += radiance;
        self.record.add(self.part, light, radiance);
    }

    /// Russian roulette after a scattering: the path goes on with a probability in proportion to its throughput. A
    /// survivor's throughput is as large as where roulette begins.
    pub(super) fn survives(&mut self, sampler: &mut Sampler) -> bool {
        self.depth = self.depth.saturating_add(1);
        if self.depth < ROULETTE_DEPTH {
            return true;
        }
        let mut q = ROULETTE_FACTOR * self.beta.max_element() / self.compression;
        if self.depth >= TRAPPED_DEPTH {
            q = q.min(MAX_SURVIVAL);
        }
        if q >= 1.0 {
            return true;
        }
        self.beta /= q;
        sampler.next_1d() < q
    }
}

impl Part {
    /// The part that the light counts for after one more scattering.
    pub(super) fn further(self) -> Self {
        match self {
            Self::Direct => Self::Surface,
            part => part,
        }
    }
}
