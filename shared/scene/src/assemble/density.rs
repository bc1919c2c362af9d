//! Grids of media, and where they lie.

use super::kept::Kept;
use super::texture::graph;
use super::{Assets, Problem, check_reach};
use crate::parse::{BlobRecord, DensityRecord, Fault, MediumRecord, NamedRecord, TextureRecord};
use crate::transform;
use crate::values::{NonNegative, Spanned, Unit};
use beamfarm_render::world::medium::bricks::{Bricks, DensityError};
use beamfarm_render::world::medium::procedural::{self, Blob, Height, Noise, Recipe, RecipeError};
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::texture::graph::Program;
use glam::{DAffine3, DVec3};
use std::ops::Range;
use std::sync::Arc;

/// From the space of a medium's grids to render space.
pub(super) fn to_render(record: &MediumRecord, render_origin: DVec3) -> Result<DAffine3, Problem> {
    let to_world = match &record.transform {
        Some(steps) => transform::compose(steps.get_ref())?,
        None => DAffine3::IDENTITY,
    };
    Ok(DAffine3::from_translation(-render_origin) * to_world)
}

/// Corners of the box that one grid of a medium fills, render space.
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
    // The printed form of a recipe is unique, so that it serves as the key.
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

/// A recorded density that needs no file.
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

/// The graph that multiplies a density.
fn graph_of(
    texture: &Spanned<String>,
    output: Option<&Spanned<String>>,
    assets: &mut Assets<'_>,
) -> Result<Option<Arc<Program>>, Problem> {
    let named = TextureRecord::<NonNegative>::Named(NamedRecord {
        texture: texture.clone(),
        output: output.cloned(),
    });
    match graph::texture(&named, graph::bounds::<NonNegative>(), true, assets)? {
        Texture::Graph(program) if is_of_places(&program) => Ok(Some(program)),
        Texture::Graph(_) => Err(Fault::new(texture.span(), NO_PLACES).into()),
        _ => {
            let message = "it is the same everywhere; expected a graph of coordinates";
            Err(Fault::new(texture.span(), message).into())
        }
    }
}

const NO_PLACES: &str = "a density has no UV, no vertices and no side; expected a graph of \"object\", \"generated\" or \"world\" coordinates";

fn is_of_places(program: &Program) -> bool {
    let reads = program.reads();
    !(reads.uv || reads.colors || reads.view)
}

/// A graph's colours at a density's samples, by channel.
pub(super) fn painted(named: &NamedRecord, bricks: &Bricks, assets: &mut Assets<'_>) -> Result<Vec<Bricks>, Problem> {
    let place = named.texture.span();
    let record = TextureRecord::<Unit>::Named(named.clone());
    let texture = graph::texture(&record, graph::bounds::<Unit>(), false, assets)?;
    if matches!(&texture, Texture::Graph(program) if !is_of_places(program)) {
        return Err(Fault::new(place, NO_PLACES).into());
    }
    let painted = bricks.painted(|own, share| texture.eval(&procedural::point(own, share)).to_array());
    painted.map_err(|error| Fault::new(place, error.to_string()).into())
}

/// A recipe's error, at the field it concerns.
fn recipe_fault((record, place): (&DensityRecord, Range<usize>), error: &RecipeError) -> Fault {
    let span = match error {
        RecipeError::Corners { .. } => record.max.as_ref().map(|max| max.span()),
        RecipeError::Samples { .. } => record.voxel.as_ref().map(|voxel| voxel.span()),
        RecipeError::Noise { .. } => record.noise.as_ref().map(|n| n.get_ref().size.span()),
    };
    Fault::new(span.unwrap_or(place), error.to_string())
}

/// Samples along the longest side of a box when the scene gives no spacing.
const DEFAULT_SAMPLES: f64 = 64.0;
/// The most octaves of noise.
const MAX_OCTAVES: u32 = 12;
