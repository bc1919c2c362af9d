//! Environments given by a graph over directions, baked once.

use super::kept::Kept;
use super::{Parts, Problem, texture};
use crate::parse::{Fault, LightRecord};
use beamfarm_render::math::{PI, Rgb, Vec3, sin_cos};
use beamfarm_render::world::texture::graph::Place;
use beamfarm_render::world::texture::{Image, Texture, TexturePoint};
use rayon::prelude::*;
use std::sync::Arc;

/// Resolution of the baked image: columns and rows.
const DIRECTIONS: [u32; 2] = [2048, 1025];

impl Parts<'_> {
    /// A graph evaluated over all directions, as a latitude-longitude image.
    pub(super) fn around(&mut self, record: &LightRecord) -> Result<Arc<Image>, Problem> {
        let Some(place) = &record.texture else {
            return Err(Fault::new(record.kind.span(), "expected `texture`").into());
        };
        let graph = texture::radiance(place.get_ref(), &mut self.assets)?;
        if graph.reads_uv() || graph.reads_colors() {
            let message = "directions have no UV and no vertices; expected a graph of \"generated\" coordinates";
            return Err(Fault::new(place.span(), message).into());
        }
        let Kept { skies, clock, .. } = &mut *self.assets.kept;
        // The printed form of a graph is unique, so that it serves as the key.
        Ok(skies.get_or_make(clock, format!("{graph:?}"), || Arc::new(sky(&graph))))
    }
}

fn sky(graph: &Texture) -> Image {
    let [width, height] = DIRECTIONS;
    let row = |y: u32| {
        let (sin_theta, cos_theta) = sin_cos(y as f32 / (height - 1) as f32 * PI);
        let pixel = |x: u32| {
            let (sin_phi, cos_phi) = sin_cos((x as f32 + 0.5) / width as f32 * 2.0 * PI);
            let dir = Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
            let place = Place {
                world: dir,
                own: dir,
                generated: dir,
                normal: -dir,
                wo: -dir,
                ..Place::NOWHERE
            };
            graph.eval(&TexturePoint {
                place,
                ..TexturePoint::default()
            })
        };
        (0..width).map(pixel).collect::<Vec<Rgb>>()
    };
    let rows: Vec<Vec<Rgb>> = (0..height).into_par_iter().map(row).collect();
    Image {
        width,
        height,
        pixels: rows.concat(),
        alpha: Vec::new(),
    }
}
