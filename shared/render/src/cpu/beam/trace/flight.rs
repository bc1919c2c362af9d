//! A photon's flight through a medium, and the beam that it leaves.

use super::{Photon, Photons, Tracer};
use crate::cpu::beam::PhotonBeam;
use crate::cpu::beam::edges::Probe;
use crate::cpu::beam::walls::{self, End};
use crate::cpu::photon_map::Arrival;
use crate::math::{Ray, Rgb, exp_neg, mean};
use crate::plan::footprint::Footprint;
use crate::plan::kernel::WidestBeams;
use crate::plan::weights::FoundBy;
use crate::sampler::Sampler;
use crate::world::geometry::SurfaceHit;
use crate::world::light::SceneBounds;
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::{Flight, Medium, MediumSegment};

impl<V: VisibilityMask> Tracer<'_, V> {
    /// Fly through a medium to the next surface, leaving a beam. Returns whether the photon was scattered on the way.
    pub(super) fn fly(
        &self,
        photon: &mut Photon<V::Hidden>,
        id: u16,
        hit: Option<&SurfaceHit>,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) -> bool {
        let medium = &self.scene.media()[id as usize];
        let length = hit.map_or(f32::INFINITY, |h| h.t);
        let serves_all = self.plan.estimators.is_by_beams(id);
        let counts = match photon.arrival {
            // In a homogeneous medium, camera paths sample light straight from its source.
            Arrival::Direct => serves_all && !matches!(medium, Medium::Homogeneous(_)),
            Arrival::Surface => serves_all,
            Arrival::Caustic => serves_all || self.brings_caustics(photon) && !self.scene.is_enclosed(id),
            Arrival::Scattered => serves_all || !self.scene.is_enclosed(id),
        };
        let of_medium = self.mask.from(Start::Medium(id));
        let is_unlit = self.mask.hides_light(of_medium, photon.light);
        if photon.leaves_beams && medium.scatters() && counts && !is_unlit {
            let (steps, beams, near) = match photon.footprint.is_smooth() {
                true => (&mut out.smooth_steps, &mut out.smooth_beams, &mut out.smooth_walls),
                false => (&mut out.steps, &mut out.beams, &mut out.walls),
            };
            let (segment, _) = medium.segment(&photon.ray, length, sampler, steps);
            if let Some(segment) = segment {
                let (mut beam, ends) = self.beam(photon, id, segment, hit, sampler);
                // In other media, camera paths go on from their vertices and may gather beams anywhere.
                let view = self.plan.view.as_ref().filter(|_| serves_all);
                let is_seen = view.is_none_or(|view| view.meets(beam.ends(), beam.max_radius()));
                if is_seen {
                    walls::find(self.scene, &mut beam, ends, near);
                    beams.push(beam);
                }
            }
        }
        let before = mean(photon.power);
        match medium.sample_flight(&photon.ray, length, photon.power, sampler) {
            Flight::Passed { weight } => {
                photon.power *= weight;
                false
            }
            Flight::Scattered { distance, weight } => {
                photon.power *= weight;
                let worth = self.far_worth(photon, id, distance);
                if !serves_all && !self.goes_on {
                    photon.power = Rgb::ZERO;
                } else if photon.survives(before / worth, sampler) {
                    let old = photon.ray.dir;
                    let dir = medium.phase().sample(old, sampler.next_2d());
                    let pdf = medium.phase().pdf(old.dot(dir));
                    photon.footprint = photon
                        .footprint
                        .advanced(distance)
                        .scattered(dir, pdf, self.kernel_paths, true);
                    photon.ray = Ray {
                        origin: photon.ray.at(distance),
                        dir,
                    };
                    photon.hidden = of_medium;
                    photon.starts_on = None;
                    photon.arrival = match serves_all {
                        true => Arrival::Scattered,
                        false => Arrival::Surface,
                    };
                    // Camera paths find what other media send on.
                    photon.found_by = match serves_all {
                        true => FoundBy::Photons,
                        false => FoundBy::Paths,
                    };
                    photon.flown = 0.0;
                    photon.is_pure = false;
                    photon.is_sharp = false;
                }
                true
            }
        }
    }

    /// Factor on the survival probability of a photon scattered at this distance: what it is worth there, over the
    /// least that it has been worth so far.
    fn far_worth(&self, photon: &mut Photon<V::Hidden>, id: u16, distance: f32) -> f32 {
        let Medium::Homogeneous(medium) = &self.scene.media()[usize::from(id)] else {
            return 1.0;
        };
        let SceneBounds { center, radius } = *self.scene.bounds();
        let beyond = photon.ray.at(distance).distance(center) - radius;
        if beyond <= 0.0 || beyond.is_nan() {
            return 1.0;
        }
        let worth = exp_neg(-FAR_DECAY * medium.least_sigma_t() * beyond).max(LEAST_WORTH);
        let share = (worth / photon.worth).min(1.0);
        photon.worth = photon.worth.min(worth);
        share
    }

    /// The beam of a photon that flies to `hit`, over the part of its way that can be seen, and what it starts and ends
    /// on.
    fn beam(
        &self,
        photon: &Photon<V::Hidden>,
        id: u16,
        segment: MediumSegment,
        hit: Option<&SurfaceHit>,
        sampler: &mut Sampler,
    ) -> (PhotonBeam, [Option<End>; 2]) {
        let [start, length] = segment.range;
        let WidestBeams { sharp, smooth } = self.plan.widest_beams[usize::from(id)];
        let widest = match photon.footprint.is_smooth() {
            true => smooth,
            false => sharp,
        };
        let scaled = |footprint: Footprint| self.plan.radii.beam(&footprint).min(widest) * self.radius_scale;
        let radius = scaled(photon.footprint);
        let radius_end = scaled(photon.footprint.advanced(length));
        let slope = (radius_end - radius) / length;
        let beyond =
            |end: Option<End>, radius: f32| end.map_or(0.0, |e| overhang(photon.ray.dir.dot(e.normal), radius, slope));
        let ends_on = hit.filter(|h| length == h.t).map(|h| End::on(self.scene, h));
        let starts_on = photon.starts_on.filter(|_| start == 0.0);
        let before = if start == 0.0 {
            beyond(starts_on, radius)
        } else {
            // Where it enters the medium's box, its whole width does.
            start.min(BOX_MARGIN * radius)
        };
        // Other kernels are narrow.
        let factor = match start == 0.0 && photon.footprint.is_smooth() {
            true => {
                let probe = Probe {
                    scene: self.scene,
                    hides: |object: u32| self.mask.hides(photon.hidden, object),
                };
                probe.beam(&photon.ray, starts_on.map(|end| end.normal), radius, sampler)
            }
            false => 1.0,
        };
        let beam = PhotonBeam {
            origin: photon.ray.origin,
            dir: photon.ray.dir,
            length,
            extent: [start - before, length + beyond(ends_on, radius_end)],
            power: photon.power * (factor * self.paths / self.beam_paths),
            radius,
            radius_slope: slope,
            medium: id,
            group: photon.group,
            wave: photon.wave.map(|wave| wave.number),
            steps: segment.steps,
            walls: [0; 2],
        };
        (beam, [starts_on, ends_on])
    }
}

/// How far beyond a surface some of a beam's width reaches, for a beam of `radius` that meets the surface at `cos`.
/// Bounded for grazing angles, and so that the cone keeps half of its radius.
fn overhang(cos: f32, radius: f32, slope: f32) -> f32 {
    let cos = cos.abs().max(0.05);
    let length = radius * (1.0 - cos * cos).max(0.0).sqrt() / cos;
    let limit = if slope == 0.0 {
        f32::INFINITY
    } else {
        0.5 * radius / slope.abs()
    };
    length.min(MAX_OVERHANG * radius).min(limit)
}

/// A photon scattered beyond the scene's bounds, in endless fog, is worth e to the minus this times its optical
/// distance from the bounds: it is seen from there, or comes back, through all of that fog.
const FAR_DECAY: f32 = 0.5;
/// The least worth: being far makes no photon heavier than one over this.
const LEAST_WORTH: f32 = 1.0 / 64.0;

/// How far a beam reaches out of the box that a heterogeneous medium fills, in radii.
const BOX_MARGIN: f32 = 2.0;
/// Longest overhang, in radii: grazing beams must not reach far behind thin walls.
const MAX_OVERHANG: f32 = 4.0;
