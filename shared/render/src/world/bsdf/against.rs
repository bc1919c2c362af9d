//! Boundaries between two refracting solids that touch without a gap.

use super::dispersion::LINE_D;
use super::principled::Interface;
use super::{BsdfFlags, Dispersion, Index, Material, MaterialDescription, MaterialKind};
use crate::math::Rgb;
use crate::world::texture::Texture;

impl Material {
    /// Index of refraction inside, by wavelength; for a blend, that of its first part that refracts. `None`: nothing
    /// refracts.
    pub fn index_inside(&self) -> Option<Index> {
        if let MaterialKind::Blend { parts, .. } = &self.kind {
            return parts.iter().find_map(Self::index_inside);
        }
        let eta = self.bounding_eta()?;
        Some(match &self.dispersion {
            Some(dispersion) => dispersion.inside.clone(),
            None => Index::Constant(f64::from(eta) * f64::from(self.index_outside)),
        })
    }

    /// The same surface with a substance of this index outside. Clear glass of that same index is no surface at all.
    pub fn against(&self, outside: &Index) -> Self {
        let mut description = MaterialDescription::from(self.clone());
        if let MaterialKind::Blend { parts, .. } = &mut description.kind {
            for part in parts.iter_mut() {
                *part = part.against(outside);
            }
            return description.into();
        }
        let (Some(_), Some(inside)) = (self.bounding_eta(), self.index_inside()) else {
            return description.into();
        };
        let is_same = is_same(&inside, outside);
        let between = Dispersion {
            inside,
            outside: outside.clone(),
        };
        let eta = if is_same { 1.0 } else { between.eta(LINE_D) };
        if is_same && self.is_clear() {
            return Self::new(MaterialKind::Null, true);
        }
        match &mut description.kind {
            MaterialKind::Dielectric { eta: own, .. } | MaterialKind::RoughDielectric { eta: own, .. } => *own = eta,
            MaterialKind::Principled { interface, .. } => *interface = Interface::Eta(eta),
            _ => {}
        }
        description.index_outside = outside.at(LINE_D) as f32;
        let is_even = [&between.inside, &between.outside].map(|index| matches!(index, Index::Constant(_)));
        description.dispersion = (is_even != [true; 2] && !is_same).then(|| Box::new(between));
        description.into()
    }

    /// Relative index of a boundary that refracts; `None` for every other surface.
    fn bounding_eta(&self) -> Option<f32> {
        let bends = self.has(BsdfFlags::BENDS) && self.has(BsdfFlags::BOUNDS_MEDIA);
        bends.then(|| self.eta_of_crossing(true, None))
    }

    /// A smooth or rough boundary that does not tint.
    fn is_clear(&self) -> bool {
        let is_white = |texture: &Texture| matches!(texture, Texture::Constant(Rgb::ONE));
        match &self.kind {
            // Nothing is reflected.
            MaterialKind::Dielectric { tint, .. } | MaterialKind::RoughDielectric { tint, .. } => {
                is_white(&tint.transmittance)
            }
            _ => false,
        }
    }
}

/// Whether two indices are equal, up to rounding.
fn is_same(one: &Index, other: &Index) -> bool {
    match (one, other) {
        (Index::Constant(one), Index::Constant(other)) => (one / other - 1.0).abs() < 1e-6,
        _ => one == other,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Tint;
    use super::*;

    fn glass(eta: f32) -> Material {
        Material::new(MaterialKind::Dielectric { eta, tint: Tint::NONE }, true)
    }

    fn eta(material: &Material) -> f32 {
        material.eta_of_crossing(true, None)
    }

    #[test]
    fn indices_are_those_of_both_sides() {
        let water = Index::Constant(1.33);
        assert!((eta(&glass(1.5).against(&water)) - 1.5 / 1.33).abs() < 1e-6);
        // Relative to water, it is the same glass.
        let mut in_water = MaterialDescription::from(glass(1.5 / 1.33));
        in_water.index_outside = 1.33;
        let Some(Index::Constant(inside)) = Material::from(in_water).index_inside() else {
            panic!("it has an index")
        };
        assert!((inside - 1.5).abs() < 1e-6);
        let bk7 = Index::preset("bk7").unwrap();
        let dispersing = glass(1.5).against(&bk7);
        let at = |nm: f64| dispersing.dispersion.as_ref().unwrap().eta(nm);
        assert!((at(486.1327) - (1.5 / bk7.at(486.1327)) as f32).abs() < 1e-6);
        assert!(dispersing.has(BsdfFlags::DISPERSES));
    }

    #[test]
    fn between_equals_there_is_nothing() {
        let same = glass(1.5).against(&glass(1.5).index_inside().unwrap());
        assert!(same.is_null());
        let parts = Box::new([glass(1.5), Material::new(MaterialKind::Null, true)]);
        let weight = Texture::Constant(Rgb::splat(0.5));
        let blend = Material::new(MaterialKind::Blend { parts, weight }, true);
        assert_eq!(blend.index_inside(), Some(Index::Constant(1.5)));
        let MaterialKind::Blend { parts, .. } = &blend.against(&Index::Constant(3.0)).kind else {
            panic!("it is one still")
        };
        assert_eq!(eta(&parts[0]), 0.5);
        assert!(parts[1].is_null());
    }
}
