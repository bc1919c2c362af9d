//! Media and their names.

use super::glow;
use super::kept::{Kept, Pinned};
use super::texture::graph;
use super::{Assets, Problem, check_reach, required, unknown_name};
use crate::parse::{
    AlbedoRecord, BlobRecord, DensityRecord, Fault, MediumKind, MediumRecord, NamedRecord, PhaseRecord, TextureRecord,
};
use crate::transform;
use crate::values::{NonNegative, Spanned};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::light::VolumeEmission;
use beamfarm_render::world::medium::bricks::{Bricks, DensityError};
use beamfarm_render::world::medium::procedural::{Blob, Height, Noise, Recipe, RecipeError};
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{Heterogeneous, Homogeneous, Medium, MediumId};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::texture::graph::{Program, Reads};
use glam::{DAffine3, DVec3};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The scene's media, in the order of their names.
pub struct Media {
    pub list: Vec<Medium>,
    /// Those that can be named now.
    names: BTreeMap<String, u16>,
    /// By medium, for messages.
    pub labels: Vec<String>,
    /// Those beneath surfaces, by material.
    beneath: BTreeMap<u32, u16>,
    /// By medium: corners of the box that it fills, render space; none when it has no bounds.
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

    /// Add media whose names are the only ones until [`Self::leave`].
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

    /// Back to the names that held before.
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

    /// Corners of the box that a medium fills, render space.
    pub fn corners(&self, medium: MediumId) -> impl Iterator<Item = DVec3> {
        let corners = medium.and_then(|index| self.corners.get(usize::from(index)));
        corners.into_iter().flatten().copied()
    }

    /// A medium's grid of densities.
    pub fn density(medium: &Medium) -> Option<&Arc<Bricks>> {
        match medium {
            Medium::Homogeneous(_) => None,
            Medium::Heterogeneous(medium) => Some(medium.shared_bricks()),
        }
    }

    /// The medium of a name; "none" is vacuum.
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

    /// The medium of a name, or another where there is no name.
    pub fn resolve_or(&self, name: Option<&Spanned<String>>, default: MediumId) -> Result<MediumId, Fault> {
        name.map_or(Ok(default), |name| self.resolve(name))
    }

    /// For messages.
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
                // The file's are factors on the scattering.
                (AlbedoRecord::File { .. }, MediumKind::Heterogeneous) => [1.0; 3],
                (AlbedoRecord::File { .. }, MediumKind::Homogeneous) => {
                    let message = "an albedo from a file is one of a \"heterogeneous\" medium";
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
    let density = bricks((place.get_ref(), place.span()), assets)?;
    let to_render = to_render(record, render_origin)?;
    let corners = corners(record, &density, &to_render, place.span())?;
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
        _ => medium,
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

/// From the own space of a medium's grids to render space.
pub(super) fn to_render(record: &MediumRecord, render_origin: DVec3) -> Result<DAffine3, Problem> {
    let to_world = match &record.transform {
        Some(steps) => transform::compose(steps.get_ref())?,
        None => DAffine3::IDENTITY,
    };
    Ok(DAffine3::from_translation(-render_origin) * to_world)
}

/// Corners of the box that a grid of a medium fills, render space.
pub(super) fn corners(
    record: &MediumRecord,
    grid: &Bricks,
    to_render: &DAffine3,
    place: Range<usize>,
) -> Result<Vec<DVec3>, Fault> {
    let from_samples = *to_render * grid.to_object();
    let [low, high] = grid.domain().map(|p| p.as_dvec3());
    let corners: Vec<DVec3> = (0..8)
        .map(|i| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64))
        .map(|side| from_samples.transform_point3(low + (high - low) * side))
        .collect();
    let reach = corners.iter().map(|p| p.length()).fold(0.0, f64::max);
    let placed_by = record.transform.as_ref().map_or(place, |t| t.span());
    check_reach(reach, placed_by.clone())?;
    if !transform::is_invertible(&from_samples) {
        let message = "the density's transform cannot be inverted: it makes the density flat, or its samples are too far \
            apart or too close together for single precision";
        return Err(Fault::new(placed_by, message));
    }
    Ok(corners)
}

/// The samples that a record describes.
pub(super) fn bricks(
    (place, span): (&DensityRecord, Range<usize>),
    assets: &mut Assets<'_>,
) -> Result<Arc<Bricks>, Problem> {
    if let Some(path) = &place.file {
        let grid = place.grid.as_ref();
        return assets.density(path, grid.map(|name| name.get_ref().as_str()));
    }
    let recipe = recipe((place, span.clone()), assets)?;
    let Kept { recipes, clock, .. } = &mut *assets.kept;
    // What is printed of a number tells it from all others.
    recipes.get_or(clock, format!("{recipe:?}"), || {
        let raw = recipe
            .sample()
            .map_err(|error| recipe_fault((place, span.clone()), &error))?;
        let bricks = Bricks::new(&raw).map_err(|error| {
            let message = match error {
                DensityError::NotFinite(_) => "somewhere it is too large for single precision".to_string(),
                error => error.to_string(),
            };
            Fault::new(span.clone(), message)
        })?;
        Ok::<_, Problem>(Arc::new(bricks))
    })
}

/// The density that a record describes without a file.
fn recipe((record, place): (&DensityRecord, Range<usize>), assets: &mut Assets<'_>) -> Result<Recipe, Problem> {
    let (min, max) = match (&record.min, &record.max) {
        (Some(min), Some(max)) => (min, max),
        (Some(one), None) | (None, Some(one)) => {
            let message = "the box of a density takes both corners, `min` and `max`";
            return Err(Fault::new(one.span(), message).into());
        }
        (None, None) => {
            let message = "a density is given by `file`, or by `min` and `max`, the corners of its box, and what makes it \
                vary within: `height`, `blobs`, `noise`, `texture`";
            return Err(Fault::new(place, message).into());
        }
    };
    let corners = [min.get_ref().0, max.get_ref().0];
    let voxel = match &record.voxel {
        Some(voxel) => voxel.get_ref().0,
        None => (corners[1] - corners[0]).max_element() / DEFAULT_SAMPLES,
    };
    let noise = match &record.noise {
        None => None,
        Some(noise) => {
            let noise = noise.get_ref();
            let octaves = noise.octaves.as_ref();
            if let Some(octaves) = octaves
                && !(1..=MAX_OCTAVES).contains(octaves.get_ref())
            {
                let message = format!("expected 1 to {MAX_OCTAVES} octaves, found {}", octaves.get_ref());
                return Err(Fault::new(octaves.span(), message).into());
            }
            Some(Noise {
                size: noise.size.get_ref().0,
                octaves: octaves.map_or(4, |octaves| *octaves.get_ref()),
                gain: noise.gain.map_or(0.5, |gain| gain.0),
                contrast: noise.contrast.map_or(1.0, |contrast| contrast.0),
                seed: noise.seed.unwrap_or(0),
            })
        }
    };
    let graph = match &record.texture {
        Some(texture) => graph_of(texture, record.output.as_ref(), assets)?,
        None => None,
    };
    Ok(Recipe {
        corners,
        voxel,
        height: record.height.as_ref().map(|height| Height {
            base: height.get_ref().base.map_or(0.0, |base| base.0),
            scale: height.get_ref().scale.0,
        }),
        blobs: record.blobs.as_ref().map_or(Vec::new(), |blobs| {
            let blob = |b: &BlobRecord| Blob {
                center: b.center.0,
                radius: b.radius.0,
                density: b.density.map_or(1.0, |density| density.0),
            };
            blobs.get_ref().iter().map(blob).collect()
        }),
        noise,
        graph,
    })
}

/// The graph that a density is multiplied by.
fn graph_of(
    texture: &Spanned<String>,
    output: Option<&Spanned<String>>,
    assets: &mut Assets<'_>,
) -> Result<Option<Arc<Program>>, Problem> {
    let named = TextureRecord::<NonNegative>::Named(NamedRecord {
        texture: texture.clone(),
        output: output.cloned(),
    });
    let refuse = |message: &str| Err(Fault::new(texture.span(), message).into());
    match graph::texture(&named, graph::bounds::<NonNegative>(), true, assets)? {
        Texture::Graph(program) => match program.reads() {
            Reads {
                uv: false,
                colors: false,
                view: false,
                ..
            } => Ok(Some(program)),
            _ => refuse(
                "a density has no UV, no vertices and no side; expected a graph of \"object\", \"generated\" or \"world\" coordinates",
            ),
        },
        _ => refuse("it is the same everywhere; expected a graph of coordinates"),
    }
}

/// A recipe's error at the field that it is about.
fn recipe_fault((record, place): (&DensityRecord, Range<usize>), error: &RecipeError) -> Fault {
    let span = match error {
        RecipeError::Corners { .. } => record.max.as_ref().map(|max| max.span()),
        RecipeError::Samples { .. } => record.voxel.as_ref().map(|voxel| voxel.span()),
        RecipeError::Noise { .. } => record.noise.as_ref().map(|n| n.get_ref().size.span()),
    };
    Fault::new(span.unwrap_or(place), error.to_string())
}

/// Samples along the longest side of a box whose scene does not say how far they are apart.
const DEFAULT_SAMPLES: f64 = 64.0;
/// Octaves of noise, at most.
const MAX_OCTAVES: u32 = 12;
