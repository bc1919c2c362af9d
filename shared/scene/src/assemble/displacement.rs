//! Meshes displaced by heights.

use super::kept::{Decoded, Kept, Pinned, map_bits};
use super::shape::{Form, own_map};
use super::texture::{self, graph};
use super::{Parts, Problem};
use crate::assets::mesh::Unmoved;
use crate::parse::{DisplacementRecord, Fault, ShapeRecord};
use crate::values::{Finite, Number, Spanned};
use beamfarm_render::math::luminance;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use glam::DAffine3;
use std::sync::Arc;

/// The most triangles a mesh is cut into, unless the scene sets another limit.
const MOST_TRIANGLES: u32 = 4_000_000;
/// The largest limit that a scene may set.
const MOST_EVER: u32 = 64_000_000;

impl Parts<'_> {
    /// The mesh of a shape, cut and displaced.
    pub(super) fn displaced(
        &mut self,
        record: &ShapeRecord,
        mesh: &Arc<Decoded>,
        asked: &Spanned<DisplacementRecord>,
    ) -> Result<Arc<Decoded>, Problem> {
        let DisplacementRecord {
            height,
            midlevel,
            scale,
            edge,
            triangles,
        } = asked.get_ref();
        let most = triangles.unwrap_or(MOST_TRIANGLES);
        if most == 0 || most > MOST_EVER {
            let message = format!("`triangles`: expected a number from 1 to {MOST_EVER}");
            return Err(Fault::new(asked.span(), message).into());
        }
        let texture = match height.is_graph() {
            true => graph::texture(height, graph::bounds::<Finite>(), true, &mut self.assets)?,
            false => texture::texture(height, &mut self.assets)?,
        };
        if texture.reads_colors() {
            let message = "heights are not taken from the colours of vertices; expected an image, or one of `textures`";
            return Err(Fault::new(asked.span(), message).into());
        }
        if mesh.raw.uvs.is_empty() && texture.reads_uv() {
            let message = "the mesh has no UV by which its heights could be looked up";
            return Err(Fault::new(asked.span(), message).into());
        }
        let own = own_map(record)?;
        let map = DAffine3::from_translation(-self.render_origin) * own;
        let space = match texture.reads_place() {
            false => None,
            true => Some(self.space_for(record, &Form::Mesh(mesh.clone()), &map, &DAffine3::IDENTITY)?),
        };
        let number = |given: &Option<Number<Finite>>, default: f64| given.as_ref().map_or(default, |given| given.0);
        let (midlevel, scale, edge) = (number(midlevel, 0.0), number(scale, 1.0), edge.0);
        let place = space
            .as_ref()
            .map(|space| (space.own_from_world, space.bounds, space.world_from_render));
        let bits = [midlevel, scale, edge].map(f64::to_bits);
        let key = format!("{texture:?} {bits:?} {most} {:?} {place:?}", map_bits(&own));
        let Kept { displaced, clock, .. } = &mut *self.assets.kept;
        let (displaced, is_cut_short) = displaced.get_or_make(clock, (Pinned(mesh.clone()), key), || {
            let long = |a: glam::DVec3, b: glam::DVec3| own.transform_vector3(b - a).length() > edge;
            let (cut, cutting) = mesh.raw.subdivided(long, most as usize);
            let normal_map = map.matrix3.inverse().transpose();
            let height = |at: &Unmoved| {
                let mut point = TexturePoint::of_uv(at.uv.as_vec2());
                if let Some(space) = &space {
                    let n = (normal_map * at.normal).normalize_or_zero().as_vec3();
                    point.place = space.place(map.transform_point3(at.position).as_vec3(), n, n, n);
                }
                (f64::from(height_of(&texture, &point)) - midlevel) * scale
            };
            (
                Arc::new(Decoded::new(cut.displaced(height, &own))),
                cutting.is_cut_short,
            )
        });
        if displaced.raw.positions.iter().any(|p| !p.as_vec3().is_finite()) {
            return Err(Fault::new(
                asked.span(),
                "the heights move vertices out of what single precision holds",
            )
            .into());
        }
        if is_cut_short {
            let count = displaced.raw.triangles.len();
            let message = format!(
                "the mesh is cut into {count} triangles, of at most {most}, and edges are longer than {edge}; expected \
                 more `triangles`, or a longer `edge`"
            );
            self.notes.push(Fault::new(asked.span(), message).into());
        }
        Ok(displaced)
    }
}

fn height_of(texture: &Texture, at: &TexturePoint) -> f32 {
    luminance(texture.eval(at))
}
