//! A photon on a surface: what it leaves there, and how it goes on.

use super::{Photon, Photons, Tracer};
use crate::cpu::beam::edges::{Probe, SurfaceKernel};
use crate::cpu::beam::walls::End;
use crate::cpu::photon_map::{Arrival, SeenBy, SurfacePhoton};
use crate::math::{Rgb, Vec3, mean};
use crate::plan::estimators::PathEnds;
use crate::plan::weights::{DEEPER, FoundBy};
use crate::sampler::Sampler;
use crate::world::SurfaceInteraction;
use crate::world::bsdf::{BsdfFlags, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::LightHit;
use crate::world::mask::{Start, VisibilityMask};
use crate::world::texture::graph::Viewer;

impl<V: VisibilityMask> Tracer<'_, V> {
    /// Leave a surface photon where one is due, and go on in a sampled direction.
    pub(super) fn meet_surface(
        &self,
        photon: &mut Photon<V::Hidden>,
        hit: &mut SurfaceHit,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) {
        let dir = photon.ray.dir;
        hit.at.place.viewer = Viewer::Photon;
        let material = self.scene.material(hit);
        let Some(part) = material.met(&hit.at, || sampler.next_1d()) else {
            photon.ray = hit.spawn_ray(dir);
            photon.starts_on = Some(End::on(self.scene, hit));
            photon.medium = self.scene.medium_beyond(hit, dir, photon.medium);
            return;
        };
        if let Some(waves) = self
            .waves
            .as_ref()
            .filter(|_| photon.wave.is_none() && part.has(BsdfFlags::DISPERSES))
        {
            photon.wave = Some(waves.choose(sampler.next_1d()));
        }
        let SurfaceInteraction {
            mut bsdf,
            bump_shadowing,
            frame,
            wo,
            local_wo,
            ..
        } = self.scene.interaction(part, hit, dir, photon.wave);
        if let Some(lobes) = self.seen_by(photon, material) {
            self.leave_surface_photon(photon, hit, lobes, sampler, out);
        }
        let before = mean(photon.power);
        let mut u_lobe = sampler.next_1d();
        let mut is_narrow = part.follows(&bsdf);
        if !is_narrow && let Some((p, [narrow, wide])) = bsdf.narrow_and_wide(local_wo) {
            is_narrow = u_lobe < p;
            let q;
            (bsdf, q, u_lobe) = match is_narrow {
                true => (narrow, p, u_lobe / p),
                false => (wide, 1.0 - p, (u_lobe - p) / (1.0 - p)),
            };
            photon.power /= q;
        }
        let sample = bsdf.sample(local_wo, u_lobe, sampler.next_2d(), TransportMode::Flux);
        let Some(sample) = sample else {
            photon.power = Rgb::ZERO;
            return;
        };
        let is_followed = sample.delta || is_narrow;
        if !is_followed && !self.goes_on {
            photon.power = Rgb::ZERO;
            return;
        }
        let wi = frame.to_world(sample.wi).normalize();
        let weight = bsdf.weight_bumped(bump_shadowing.as_ref(), local_wo, &sample, TransportMode::Flux);
        photon.power *= weight * adjoint_factor(hit, wo, wi);
        if !photon.survives(before, sampler) {
            return;
        }
        let n = hit.ns;
        photon.footprint = if !sample.delta {
            let footprint = &photon.footprint;
            footprint.scattered(wi, sample.pdf, self.kernel_paths, !is_followed)
        } else if sample.transmitted {
            let eta = part.eta_of_crossing(hit.ng.dot(dir) > 0.0, photon.wave);
            photon.footprint.refracted(dir, wi, n, hit.curvature, eta)
        } else {
            photon.footprint.reflected(dir, n, hit.curvature)
        };
        if sample.transmitted {
            photon.medium = self.scene.medium_beyond(hit, wi, photon.medium);
        }
        photon.found_by = match is_followed || !self.mask.is_gathered(hit.object) {
            true if photon.is_pure => photon.caustic_by,
            true => FoundBy::Photons,
            // Seen from elsewhere, the bumped normal is another one: left to gather rays, which see it from one side
            // only. So are surfaces that camera paths go on from.
            false if bump_shadowing.is_some() || !self.plan.estimators.ends_paths(&bsdf) => FoundBy::Paths,
            false => {
                let photons = self.expected(photon, hit) * sample.pdf;
                FoundBy::Both(photons / wi.dot(hit.ng).abs())
            }
        };
        photon.arrival = match (photon.arrival, is_followed) {
            (Arrival::Direct | Arrival::Caustic, true) => Arrival::Caustic,
            (Arrival::Surface, true) if self.goes_on => Arrival::Caustic,
            (before, true) => before,
            (_, false) => Arrival::Surface,
        };
        photon.is_pure &= is_followed;
        photon.is_sharp &= sample.delta;
        photon.flown = 0.0;
        photon.ray = hit.spawn_ray(wi);
        photon.hidden = self.mask.from(Start::Photon(hit.object));
        photon.starts_on = Some(End::on(self.scene, hit));
    }

    /// By which lobes of a surface a landing photon is to be seen; none if it is not to be left. In a blend, camera
    /// paths choose the part that sees it.
    fn seen_by(&self, photon: &Photon<V::Hidden>, material: &Material) -> Option<SeenBy> {
        let by_wide = material.has(BsdfFlags::WIDE)
            && match photon.arrival {
                Arrival::Direct => false,
                Arrival::Caustic => self.brings_caustics(photon),
                Arrival::Scattered => true,
                Arrival::Surface => self.plan.estimators.ends() != PathEnds::Never,
            };
        // Where a rough lobe came before, camera paths look for the light from there.
        let by_followed = photon.arrival == Arrival::Caustic
            && photon.is_sharp
            && self.scene.lights()[photon.light].kind.is_unmet()
            && !material.has(BsdfFlags::THIN)
            && material.has(BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE);
        match (by_wide, by_followed) {
            (true, true) => Some(SeenBy::All),
            (true, false) => Some(SeenBy::Wide),
            (false, true) => Some(SeenBy::Followed),
            (false, false) => None,
        }
    }

    /// Leave a surface photon where a photon has landed.
    fn leave_surface_photon(
        &self,
        photon: &Photon<V::Hidden>,
        hit: &SurfaceHit,
        lobes: SeenBy,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) {
        let wi = -photon.ray.dir;
        let radii = &self.plan.radii;
        let radius = radii.surface(&photon.footprint, self.surface_footprint);
        let probe = Probe {
            scene: self.scene,
            hides: |object: u32| self.mask.hides(photon.hidden, object),
        };
        let widest = LOCAL * self.scene.extents[hit.object as usize];
        let radius = radius.min(widest) * self.surface_scale;
        let SurfaceKernel { radius, factor, walls } = probe.surface(hit, wi, radius, sampler);
        let of_object = self.mask.from(Start::Photon(hit.object));
        // Camera paths do not end after so short a flight: they go on.
        let is_near = photon.arrival != Arrival::Caustic && photon.flown < self.weights.least_flight;
        out.surface.push(SurfacePhoton {
            point: hit.point,
            ng: hit.ng,
            wi,
            power: photon.power * factor,
            radius,
            walls,
            arrival: photon.arrival,
            found_by: match self.mask.hides_light(of_object, photon.light) {
                true => FoundBy::PathsByRule,
                false if photon.found_by != FoundBy::Photons && is_near => FoundBy::Paths,
                false => photon.found_by,
            },
            lobes,
            group: photon.group,
            wave: photon.wave.map(|wave| wave.number),
            light_kind: self.mask.light_kind(photon.light),
        });
    }

    /// Expected photons of the light that this one brings to a surface, before the density of its next direction.
    fn expected(&self, photon: &Photon<V::Hidden>, hit: &SurfaceHit) -> f32 {
        if photon.arrival != Arrival::Direct {
            return DEEPER;
        }
        let wo = -photon.ray.dir;
        let at = LightHit {
            normal: photon.emitted_at.normal,
            primitive: photon.emitted_at.primitive,
            distance: photon.flown,
        };
        let density = self.scene.lights()[photon.light].photon_density(
            self.scene.objects(),
            self.scene.bounds(),
            hit.point,
            wo,
            at,
        );
        self.weights.in_kernel * density * wo.dot(hit.ng).abs()
    }
}

/// Largest kernel radius over the size of what the light lands on.
const LOCAL: f32 = 0.25;

/// Corrects a photon for interpolated normals, so that paths from lights and from the camera describe the same surface
/// (Veach 1997, section 5.3). Zero where shading and geometric normal disagree about the side.
fn adjoint_factor(hit: &SurfaceHit, wo: Vec3, wi: Vec3) -> f32 {
    let (wo_g, wo_s) = (wo.dot(hit.ng), wo.dot(hit.ns));
    let (wi_g, wi_s) = (wi.dot(hit.ng), wi.dot(hit.ns));
    if wo_g * wo_s <= 0.0 || wi_g * wi_s <= 0.0 {
        return 0.0;
    }
    ((wo_s * wi_g) / (wo_g * wi_s)).abs()
}
