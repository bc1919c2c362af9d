//! How photons start: from which light, aimed or not, and what they carry at first.

use super::{Photon, Photons, Tracer};
use crate::cpu::beam::walls::End;
use crate::cpu::photon_map::Arrival;
use crate::math::Ray;
use crate::plan::footprint::{Footprint, spread};
use crate::plan::targeting::{Aim, Targets};
use crate::plan::weights::FoundBy;
use crate::sampler::Sampler;
use crate::world::light::{EmissionSample, EmissionUniforms, LightChoice, LightPoint};
use crate::world::mask::{Start, VisibilityMask};

impl<V: VisibilityMask> Tracer<'_, V> {
    /// Follow a path's photon; where photons that miss are dropped, as many as hit of several.
    pub(super) fn trace(&self, sampler: &mut Sampler, leaves_beams: bool, out: &mut Photons) {
        let targets = self.plan.targets.as_deref();
        let Some(choice) = self.plan.emitters().sample(sampler.next_1d()) else {
            return;
        };
        let aim = targets.and_then(|targets| targets.of(choice.light));
        match aim {
            Some(aim) if targets.is_some_and(Targets::rejects) => {
                for _ in 0..aim.trials {
                    let emission = self.emit(choice.light, None, sampler);
                    let Some(photon) = self.start(choice, emission, aim.trials, leaves_beams, sampler) else {
                        continue;
                    };
                    if aim.is_hit(self.scene, choice.light, &photon.ray, self.mask) {
                        self.follow(photon, sampler, out);
                    }
                }
            }
            aim => {
                let emission = self.emit(choice.light, aim, sampler);
                if let Some(photon) = self.start(choice, emission, 1, leaves_beams, sampler) {
                    self.follow(photon, sampler, out);
                }
            }
        }
    }

    /// How a photon of a light starts: as the light emits it or, given an aim, sometimes through the aim.
    fn emit(&self, light: usize, aim: Option<&Aim>, sampler: &mut Sampler) -> Option<EmissionSample> {
        let light = &self.scene.lights()[light];
        let (objects, bounds) = (self.scene.objects(), self.scene.bounds());
        let uniforms = EmissionUniforms::draw(sampler);
        match aim {
            None => Some(light.sample_emission(objects, bounds, uniforms)),
            Some(aim) => light.sample_mixture(objects, bounds, aim, uniforms, sampler.next_1d()),
        }
    }

    /// A photon on its way from a light. `trials`: photons started for each path.
    fn start(
        &self,
        choice: LightChoice,
        emission: Option<EmissionSample>,
        trials: u32,
        leaves_beams: bool,
        sampler: &mut Sampler,
    ) -> Option<Photon<V::Hidden>> {
        let emission = emission?;
        let paths = self.kernel_paths * choice.pmf * trials as f32;
        let radius = (1.0 / (std::f32::consts::PI * emission.pdf_pos * paths)).sqrt();
        let (mut origin, soft) = self.scene.start_of(choice.light, &emission);
        let hidden = self.mask.from(Start::Light(choice.light));
        let mut power = emission.power / (self.paths * choice.pmf * trials as f32);
        if let Some(line) = &soft {
            let hides = |object| self.mask.hides(hidden, object);
            let (start, way) = self.scene.start_softly(choice.light, line, hides, sampler)?;
            origin = start;
            power *= way;
        }
        let medium = self.scene.medium_of_light(choice.light, origin);
        if self.scene.volume_light(choice.light).is_some()
            && !self.scene.emitting(medium).contains(&(choice.light as u32))
        {
            // The grid around an emissive medium reaches beyond the medium.
            return None;
        }
        let emitted_at = LightPoint {
            normal: emission.normal.unwrap_or(-emission.dir),
            primitive: emission.primitive,
        };
        let caustic_by = match self.weights.in_caustic[choice.light] {
            0.0 => FoundBy::Photons,
            in_caustic => {
                let light = &self.scene.lights()[choice.light];
                let (objects, bounds) = (self.scene.objects(), self.scene.bounds());
                FoundBy::Both(in_caustic * light.emitted_density(objects, bounds, emission.dir, emitted_at))
            }
        };
        Some(Photon {
            ray: Ray {
                origin,
                dir: emission.dir,
            },
            hidden,
            power,
            wave: None,
            medium,
            footprint: Footprint::new(emission.dir, radius, spread(emission.pdf_dir, paths)),
            starts_on: emission
                .normal
                .filter(|_| soft.is_none())
                .map(|normal| End { normal, bounds: false }),
            arrival: Arrival::Direct,
            found_by: FoundBy::Photons,
            caustic_by,
            flown: 0.0,
            emitted_at,
            is_pure: true,
            is_sharp: true,
            light: choice.light,
            group: self.plan.layers.group(choice.light),
            depth: 0,
            worth: 1.0,
            leaves_beams,
        })
    }
}
