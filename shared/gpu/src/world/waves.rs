//! Light of single wavelengths: refraction at dispersive surfaces for the wavelengths of a pass.

use super::reason::{Of, Reason, Why};
use super::used::{used, with_parts};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::bsdf::{self, Dispersion};
use beamfarm_render::world::{Scene, SceneDescription};

/// Most wavelengths per pass.
pub const MOST_WAVES: usize = 8;
/// Most pairs of dispersive substances.
pub const MOST_ROWS: usize = 16;

/// By row and wavelength: the index of refraction inside over the one outside.
pub type Etas = [[f32; MOST_WAVES]; MOST_ROWS];

/// The wavelengths of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waves {
    /// Their number; 0 in scenes without dispersion.
    pub count: u32,
    /// Factor on light of each wavelength, linear sRGB.
    pub weights: [[f32; 3]; MOST_WAVES],
    /// Refraction at surfaces: one [`row`](super::materials::MaterialRecord::bits) per pair of substances.
    pub etas: Etas,
}

impl Waves {
    /// The wavelengths of a plan's pass.
    #[must_use]
    pub fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self {
        let mut waves = Self::default();
        let Some(set) = plan.wave_set(pass_index) else {
            return waves;
        };
        let rows = rows(used(scene.description()));
        for (number, wave) in set.iter().take(MOST_WAVES).enumerate() {
            waves.count += 1;
            waves.weights[number] = wave.weight.to_array();
            for (etas, row) in waves.etas.iter_mut().zip(&rows) {
                etas[number] = row.eta(f64::from(wave.nm));
            }
        }
        waves
    }

    /// The data after the key of chords, for kernels that search for beams and photons: see `kernels/waves.wgsl`.
    #[must_use]
    pub fn words(&self) -> Vec<[u32; 2]> {
        let weights = &self.weights[..self.count as usize];
        let of_wave = |[red, green, blue]: [f32; 3]| [[red.to_bits(), green.to_bits()], [blue.to_bits(), 0]];
        let head = if self.count > 0 { Some([self.count, 0]) } else { None };
        let weights = weights.iter().copied().flat_map(of_wave);
        head.into_iter().chain(weights).collect()
    }
}

/// All dispersive pairs, each once, in the order of materials and their parts.
pub(super) fn rows<'a>(materials: impl Iterator<Item = &'a bsdf::Material>) -> Vec<&'a Dispersion> {
    let mut rows: Vec<&Dispersion> = Vec::new();
    for material in materials {
        with_parts(material, 0, &mut |material, _| {
            if let Some(dispersion) = material.dispersion.as_deref()
                && !rows.contains(&dispersion)
            {
                rows.push(dispersion);
            }
        });
    }
    rows
}

/// The reason why devices cannot render a scene: too many pairs.
pub(super) fn reasons(description: &SceneDescription) -> Option<Reason> {
    let (count, most) = (rows(used(description)).len() as u64, MOST_ROWS as u64);
    (count > most).then_some(Reason {
        of: Of::Scene,
        field: "pairs of substances that split light",
        why: Why::Many { count, most },
    })
}
