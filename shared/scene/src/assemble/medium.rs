//! Media and their names.

use super::density;
use super::glow;
use super::kept::{Kept, Pinned};
use super::{Assets, Problem, required, unknown_name};
use crate::parse::{AlbedoRecord, Fault, MediumKind, MediumRecord, PhaseRecord};
use crate::values::Spanned;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::light::VolumeEmission;
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{Heterogeneous, Homogeneous, Medium, MediumId};
use beamfarm_render::world::phase::Phase;
use glam::DVec3;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The scene's media, in name order.
pub struct Media {
    pub list: Vec<Medium>,
    /// Those that names resolve to now.
    names: BTreeMap<String, u16>,
    /// Names by medium, for messages.
    pub labels: Vec<String>,
    /// Those beneath surfaces, by material.
    beneath: BTreeMap<u32, u16>,
    /// By medium: corners of its box, render space; empty when it is unbounded.
    corners: Vec<Vec<DVec3>>,
    /// By medium: what it emits, and where that is written.
    pub emitted: Vec<Option<(VolumeEmission, Range<usize>)>>,
}

impl Media {
    pub fn new(
        records: &BTreeMap<Spanned<String>, MediumRecord>,
        render_origin: DVec3,
        assets: &mut Assets,
    ) -> Result<Self, Problem> {
        let mut media = Self {
            list: Vec::new(),
            names: BTreeMap::new(),
            labels: Vec::new(),
            beneath: BTreeMap::new(),
            corners: Vec::new(),
            emitted: Vec::new(),
        };
        media.enter(records, render_origin, assets)?;
        Ok(media)
    }

    /// Add media whose names replace all others until [`Self::leave`].
    pub fn enter(
        &mut self,
        records: &BTreeMap<Spanned<String>, MediumRecord>,
        render_origin: DVec3,
        assets: &mut Assets,
    ) -> Result<BTreeMap<String, u16>, Problem> {
        let mut names = BTreeMap::new();
        for (name, record) in records {
            let refuse = |message: &str| Err(Fault::new(name.span(), message).into());
            if name.get_ref() == "none" {
                return refuse("the name \"none\" stands for vacuum; choose another");
            }
            if self.list.len() == usize::from(u16::MAX) {
                return refuse("more than 65535 media");
            }
            let (medium, corners) = match record.kind.get_ref() {
                MediumKind::Homogeneous => (Medium::Homogeneous(homogeneous(record)?), Vec::new()),
                MediumKind::Heterogeneous => {
                    let (medium, corners) = heterogeneous(record, render_origin, assets)?;
                    (Medium::Heterogeneous(medium), corners)
                }
            };
            self.emitted
                .push(glow::emitted(record, &medium, render_origin, assets)?);
            names.insert(name.get_ref().clone(), self.list.len() as u16);
            self.list.push(medium);
            self.corners.push(corners);
            self.labels.push(name.get_ref().clone());
        }
        Ok(std::mem::replace(&mut self.names, names))
    }

    /// Restore the earlier names.
    pub fn leave(&mut self, names: BTreeMap<String, u16>) {
        self.names = names;
    }

    /// The medium beneath the surfaces of a material. `None`: there are too many media.
    pub fn beneath(&mut self, material: u32, label: &str, medium: Homogeneous) -> Option<u16> {
        if let Some(known) = self.beneath.get(&material) {
            return Some(*known);
        }
        let index = u16::try_from(self.list.len()).ok().filter(|index| *index < u16::MAX)?;
        self.list.push(Medium::Homogeneous(medium));
        self.emitted.push(None);
        self.corners.push(Vec::new());
        self.labels.push(format!("beneath {label}"));
        self.beneath.insert(material, index);
        Some(index)
    }

    /// Corners of a medium's box, render space.
    pub fn corners(&self, medium: MediumId) -> impl Iterator<Item = DVec3> {
        let corners = medium.and_then(|index| self.corners.get(usize::from(index)));
        corners.into_iter().flatten().copied()
    }

    /// The medium of that name; "none" is vacuum.
    pub fn resolve(&self, name: &Spanned<String>) -> Result<MediumId, Fault> {
        if name.get_ref() == "none" {
            return Ok(None);
        }
        match self.names.get(name.get_ref()) {
            Some(index) => Ok(Some(*index)),
            None => {
                let known = self.names.keys().map(String::as_str).chain(["none"]);
                Err(unknown_name("medium", name, known))
            }
        }
    }

    /// The medium of that name, or the default where no name is given.
    pub fn resolve_or(&self, name: Option<&Spanned<String>>, default: MediumId) -> Result<MediumId, Fault> {
        name.map_or(Ok(default), |name| self.resolve(name))
    }

    /// The name used in messages.
    pub fn name(&self, medium: MediumId) -> &str {
        medium.map_or("none", |index| &self.labels[usize::from(index)])
    }
}

fn homogeneous(record: &MediumRecord) -> Result<Homogeneous, Fault> {
    let [sigma_a, sigma_s] = coefficients(record, 1.0)?;
    Ok(Homogeneous {
        sigma_a,
        sigma_s,
        phase: phase(record),
    })
}

fn phase(record: &MediumRecord) -> Phase {
    match &record.phase {
        PhaseRecord::Isotropic => Phase::Isotropic,
        PhaseRecord::HenyeyGreenstein(g) => Phase::HenyeyGreenstein { g: g.f32() },
        PhaseRecord::Blend { weight, g } => Phase::blend(weight.f32(), g.map(|g| g as f32)),
    }
}

/// Absorption and scattering, times `scale`.
fn coefficients(record: &MediumRecord, scale: f64) -> Result<[Rgb; 2], Fault> {
    let (sigma_a, sigma_s) = match (&record.sigma_a, &record.sigma_s, &record.sigma_t, &record.albedo) {
        (Some(sigma_a), Some(sigma_s), None, None) => (sigma_a.get_ref().0, sigma_s.get_ref().0),
        (None, None, Some(sigma_t), Some(albedo)) => {
            let sigma_t = sigma_t.get_ref().0;
            let albedo = match (albedo.get_ref(), record.kind.get_ref()) {
                (AlbedoRecord::Color(color), _) => color.0,
                // A varying albedo multiplies the scattering afterwards.
                (_, MediumKind::Heterogeneous) => [1.0; 3],
                (_, MediumKind::Homogeneous) => {
                    let message = "an albedo that varies is one of a \"heterogeneous\" medium";
                    return Err(Fault::new(albedo.span(), message));
                }
            };
            let scattered = std::array::from_fn(|c| sigma_t[c] * albedo[c]);
            (std::array::from_fn(|c| sigma_t[c] - scattered[c]), scattered)
        }
        (None, None, None, None) if record.emission.is_some() => ([0.0; 3], [0.0; 3]),
        (sigma_a, sigma_s, sigma_t, albedo) => {
            let spans = [sigma_t, sigma_a, sigma_s].map(|f| f.as_ref().map(|f| f.span()));
            let first = spans.into_iter().flatten().next().or(albedo.as_ref().map(|f| f.span()));
            return Err(Fault::new(
                first.unwrap_or(record.kind.span()),
                "a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed",
            ));
        }
    };
    let single = |sigma: [f64; 3]| Rgb::from_array(sigma.map(|x| (x * scale) as f32));
    let (sigma_a, sigma_s) = (single(sigma_a), single(sigma_s));
    if !(sigma_a + sigma_s).is_finite() {
        return Err(Fault::new(
            record.kind.span(),
            "its extinction is too large for single precision",
        ));
    }
    Ok([sigma_a, sigma_s])
}

/// A heterogeneous medium and the corners of its box, render space.
fn heterogeneous(
    record: &MediumRecord,
    render_origin: DVec3,
    assets: &mut Assets,
) -> Result<(Heterogeneous, Vec<DVec3>), Problem> {
    let place = required(&record.density, &record.kind, "density")?;
    let density = density::bricks((place.get_ref(), place.span()), assets)?;
    let to_render = density::to_render(record, render_origin)?;
    let corners = density::corners(record, &density, &to_render, place.span())?;
    let scale = record.scale.as_ref().map_or(1.0, |scale| scale.get_ref().0);
    let estimator = match &record.transmittance {
        None => Estimator::DEFAULT,
        Some(given) => given.get_ref().0,
    };
    let Kept { media, clock, .. } = &mut *assets.kept;
    let pinned = Pinned(density.clone());
    let known = media.get_if(clock, &pinned, |_| true);
    let coefficients = coefficients(record, scale)?;
    let medium = Heterogeneous::new_like(
        known.as_ref(),
        coefficients,
        phase(record),
        estimator,
        density,
        to_render,
    );
    media.put(clock, pinned, medium.clone());
    let medium = match record.albedo.as_ref().map(|a| a.get_ref()) {
        Some(AlbedoRecord::File { file, grid }) => {
            let grid = grid.as_ref().map(|name| name.get_ref().as_str());
            medium.with_albedo(assets.albedo(file, grid)?)
        }
        Some(AlbedoRecord::Texture(texture)) => {
            let painted = density::painted(texture, medium.bricks(), assets)?;
            medium.with_albedo(Arc::new(painted))
        }
        Some(AlbedoRecord::Color(_)) | None => medium,
    };
    let densest = medium.bricks().max();
    if !(medium.sigma_t().max_element() * densest).is_finite() {
        let message = format!(
            "its extinction is too large for single precision where it is densest, at a density of {densest:.3e}"
        );
        return Err(Fault::new(record.kind.span(), message).into());
    }
    Ok((medium, corners))
}
