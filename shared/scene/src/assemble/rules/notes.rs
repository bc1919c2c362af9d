//! Notes on rules without effect.

use super::{Clause, Listed, Resolver, name_of};
use crate::parse::Fault;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::rules::RayType;

impl Resolver<'_> {
    /// Whether rays of a type start at a thing and can have an effect.
    fn start(&self, start: u32, ray: RayType) -> bool {
        let scatters = |medium: Option<u16>| medium.is_some_and(|id| self.parts.media.list[usize::from(id)].scatters());
        if start == self.camera() {
            return ray == RayType::Camera;
        }
        if start == self.world() {
            return ray == RayType::Photon && scatters(self.parts.world_medium);
        }
        let Some(object) = self.parts.objects.get(start as usize) else {
            return ray == RayType::Photon;
        };
        let material = self.material(start as usize);
        let refracts = material.has(BsdfFlags::REFRACTS);
        match ray {
            RayType::Camera => false,
            RayType::Reflected => !material.is_null() && material.has(BsdfFlags::DELTA | BsdfFlags::ROUGH),
            RayType::Refracted => refracts,
            RayType::Shadow => !material.is_specular(),
            RayType::Photon => !material.is_null() || scatters(object.boundary.and_then(|boundary| boundary.interior)),
        }
    }

    /// Whether the rule names a light, so that shadow rays to it obey the rule wherever they start.
    fn names_a_light(&self, clause: &Clause) -> bool {
        let Listed { listed, inverted } = &clause.starts;
        !inverted && listed.iter().any(|start| self.light(*start).is_some())
    }

    /// Whether photons are stored on a thing or in it.
    fn keeps_photons(&self, start: u32) -> bool {
        if start == self.world() {
            return self.start(start, RayType::Photon);
        }
        let Some(object) = self.parts.objects.get(start as usize) else {
            return false;
        };
        let interior = object.boundary.and_then(|boundary| boundary.interior);
        let fog = interior.map(|id| &self.parts.media.list[usize::from(id)]);
        !self.material(start as usize).is_specular() || fog.is_some_and(|fog| fog.scatters())
    }

    /// Rules without effect.
    pub fn notes(&self, clauses: &[Clause]) -> Vec<Fault> {
        let mut notes = Vec::new();
        for (number, clause) in clauses.iter().enumerate() {
            if !clause.list.inverted && clause.list.listed.is_empty() {
                if !clause.ray_places.is_empty() {
                    let message = "nothing is listed: this rule has no effect";
                    notes.push(Fault::new(clause.place.clone(), message));
                }
                continue;
            }
            let before = &clauses[..number];
            for (ray, place) in clause.rays.iter().zip(&clause.ray_places) {
                if let Some(message) = self.without_effect(clause, before, *ray) {
                    notes.push(Fault::new(place.clone(), message));
                }
            }
        }
        notes
    }

    fn without_effect(&self, clause: &Clause, before: &[Clause], ray: RayType) -> Option<String> {
        let starts = 0..self.things as u32 + 2;
        let mut starts = starts.filter(|start| clause.starts.has(*start));
        let name = name_of(ray);
        let only_lights =
            !clause.list.inverted && (clause.list.listed.iter()).all(|thing| *thing as usize >= self.objects);
        let links_shadows = ray == RayType::Shadow && self.names_a_light(clause) && !only_lights;
        if !starts.any(|start| self.start(start, ray)) && !links_shadows {
            let message = format!("no {name} rays start there: no effect on them");
            return Some(match ray {
                RayType::Camera => format!("{message}; they start at the \"camera\""),
                _ => message,
            });
        }
        if ray == RayType::Photon && only_lights {
            let mut starts = (0..self.things as u32 + 2).filter(|s| clause.starts.has(*s));
            if !starts.any(|start| self.keeps_photons(start)) {
                return Some("photons leave nothing there, whatever light they come from: no effect on them".into());
            }
        }
        let meets = |thing: &u32| matches!(self.light(*thing), Some(LightKind::Environment(_)));
        match ray {
            RayType::Camera | RayType::Reflected | RayType::Refracted
                if only_lights && !clause.list.listed.iter().any(meets) =>
            {
                return Some(format!(
                    "{name} rays meet shapes and the environment, but no light of another kind: no effect on them"
                ));
            }
            _ => {}
        }
        let says_so = |other: &Clause| {
            other.includes == clause.includes
                && other.rays.contains(&ray)
                && other.list.covers(&clause.list)
                && (!clause.includes || clause.list.covers(&other.list))
                && other.starts.covers(&clause.starts)
                && (!links_shadows || !other.starts.inverted || other.starts.listed.is_empty())
        };
        let again = before.iter().any(says_so);
        again.then(|| format!("an earlier rule says the same of {name} rays"))
    }
}
