//! Shapes: their placement, orientation, material, media and emission.

use super::kept::{Baked, Decoded, Kept, Normals, Pinned, Shared, linear_bits, map_bits};
use super::{Assets, Parts, Problem, asset_problem, check_reach, required, texture};
use crate::assets::mesh::RawMesh;
use crate::parse::{EmissionRecord, Fault, ShapeRecord, ShapeType, TextureRecord, TowardRecord};
use crate::transform;
use crate::values::Spanned;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::geometry::shape::Placement;
use beamfarm_render::world::geometry::{Boundary, Object, Shape, Strands, bounds};
use beamfarm_render::world::texture::graph::Space;
use glam::{DAffine3, DMat3, DVec3};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A shape in its own space.
pub(super) enum Form {
    Sphere,
    Disc,
    Cylinder,
    Mesh(Arc<Decoded>),
    Strands(Arc<Strands>),
}

/// Everything about a shape except its placement.
pub(super) struct Surface<'r> {
    pub(super) form: Form,
    pub(super) record: &'r ShapeRecord,
    /// The record's emission, or that of an .mtl material.
    pub(super) emission: Option<&'r Spanned<EmissionRecord>>,
    pub(super) material: u32,
    pub(super) boundary: Option<Boundary>,
}

/// A placed shape.
struct Made {
    shape: Shape,
    light: Option<u32>,
    space: Option<Arc<Space>>,
}

impl Parts<'_> {
    /// Add a shape's objects: one, or one per instance.
    pub fn add_shape(&mut self, record: &ShapeRecord, name: &str) -> Result<(), Problem> {
        let before = [self.objects.len(), self.lights.len()];
        match self.add_objects(record, name) {
            Err(Problem::NoArea(place)) => {
                self.objects.truncate(before[0]);
                self.lights.truncate(before[1]);
                self.notes
                    .push(Fault::new(place, format!("{NO_AREA}; the shape is left out")).into());
            }
            done => done?,
        }
        let objects = before[0]..self.objects.len();
        let lights = before[1]..self.lights.len();
        let emission = record.emission.as_ref().map(Spanned::get_ref);
        let group = emission.and_then(|emission| emission.group.as_deref());
        let visible = record.visible.as_ref();
        self.names.add(name, group.as_slice(), visible, objects, lights);
        Ok(())
    }

    fn add_objects(&mut self, record: &ShapeRecord, name: &str) -> Result<(), Problem> {
        if *record.kind.get_ref() == ShapeType::Instances {
            return self.add_instances(record, name);
        }
        if record.reads_mtl() {
            return self.add_by_mtl(record, name);
        }
        let surface = self.surface(record)?;
        self.add_surface(&surface, name)
    }

    /// Add a surface at its record's placement.
    pub(super) fn add_surface(&mut self, surface: &Surface<'_>, name: &str) -> Result<(), Problem> {
        let record = surface.record;
        let own = own_map(record)?;
        let map = self.to_render_space(own, place(record))?;
        let shape = match self.shared_instead(surface, &own) {
            Some(shared) => {
                let shape = put(&shared, &map).ok_or_else(|| no_area(record))?;
                check_shape_reach(&shape, place(record))?;
                shape
            }
            None => self.placed(surface, &map)?,
        };
        let space = self.space(surface, &map, &DAffine3::IDENTITY)?;
        let light = self.area_light(surface, &map, &shape, name, space.as_ref())?;
        let made = Made { shape, light, space };
        self.push(surface, made, name.to_string())
    }

    fn add_instances(&mut self, record: &ShapeRecord, name: &str) -> Result<(), Problem> {
        let inner = required(&record.shape, &record.kind, "shape")?.get_ref();
        let transforms = required(&record.transforms, &record.kind, "transforms")?;
        if let Some(emission) = &inner.emission {
            return Err(Fault::new(emission.span(), "instances cannot emit; list shapes of their own").into());
        }
        let surface = self.surface(inner)?;
        let own = own_map(inner)?;
        let shared = match &surface.form {
            Form::Mesh(decoded) => Some(self.shared(decoded, inner, &own)),
            _ => None,
        };
        for (i, steps) in transforms.get_ref().iter().enumerate() {
            let instance = transform::compose(steps.get_ref())?;
            let map = self.to_render_space(instance * own, steps.span())?;
            let shape = match &shared {
                Some(shared) => {
                    let shape = put(shared, &map).ok_or_else(|| no_area(inner))?;
                    check_shape_reach(&shape, steps.span())?;
                    shape
                }
                None => self.placed(&surface, &map)?,
            };
            let made = Made {
                shape,
                light: None,
                space: self.space(&surface, &map, &instance)?,
            };
            self.push(&surface, made, format!("{name}[{i}]"))?;
        }
        Ok(())
    }

    fn push(&mut self, surface: &Surface<'_>, made: Made, name: String) -> Result<(), Problem> {
        if self.objects.len() >= u32::MAX as usize {
            return Err(Fault::new(surface.record.kind.span(), "more than 2^32 objects").into());
        }
        self.objects.push(Object {
            name,
            shape: made.shape,
            material: surface.material,
            boundary: surface.boundary,
            light: made.light,
            priority: surface.record.priority.as_ref().map(|priority| *priority.get_ref()),
            space: made.space,
        });
        Ok(())
    }

    /// Resolve a record's names and load its mesh.
    fn surface<'r>(&mut self, record: &'r ShapeRecord) -> Result<Surface<'r>, Problem> {
        let material = match &record.material {
            Some(name) => self.materials.resolve(name)?,
            None => self.materials.default(record.emission.is_some()),
        };
        let is_read = self.materials.list[material as usize].has(BsdfFlags::READS_COLORS);
        let is_emitted = emits_colors(record, &mut self.assets);
        let form = match record.kind.get_ref() {
            ShapeType::Sphere => Form::Sphere,
            ShapeType::Disc => Form::Disc,
            ShapeType::Cylinder => Form::Cylinder,
            ShapeType::Rectangle => Form::Mesh(self.assets.kept.rectangle.clone()),
            ShapeType::Cube => Form::Mesh(self.assets.kept.cube.clone()),
            ShapeType::Mesh => {
                let file = required(&record.file, &record.kind, "file")?;
                let index = record.shape_index.as_ref().map_or(0, |index| *index.get_ref());
                let takes_colors = is_read || is_emitted;
                let mesh = self.assets.mesh(file, index, takes_colors)?;
                if takes_colors {
                    check_colors(&mesh.raw, is_read).map_err(|flaw| asset_problem(file, flaw))?;
                }
                Form::Mesh(match &record.toward {
                    Some(toward) => self.on_its_way(&mesh, toward, index)?,
                    None => mesh,
                })
            }
            ShapeType::Curves | ShapeType::Points => Form::Strands(self.strands(record, material)?),
            ShapeType::Instances => {
                let message = "expected the type of one shape";
                return Err(Fault::new(record.kind.span(), message).into());
            }
        };
        if (is_read || is_emitted) && *record.kind.get_ref() != ShapeType::Mesh {
            let place = match (&record.material, &record.emission) {
                (Some(material), _) if is_read => material.span(),
                (_, Some(emission)) => emission.span(),
                _ => record.kind.span(),
            };
            let message = "it takes the colours of vertices, which meshes from files alone have";
            return Err(Fault::new(place, message).into());
        }
        let material = self.closed_or_diffuse(record, &form, material);
        let material = match &form {
            Form::Strands(_) => self.materials.thin(material),
            _ => material,
        };
        let form = match (form, &record.displacement) {
            (Form::Mesh(mesh), Some(displacement)) => Form::Mesh(self.displaced(record, &mesh, displacement)?),
            (form, _) => form,
        };
        let boundary = self.boundary(record, material)?;
        let form = self.solid(record, form, material, boundary)?;
        Ok(Surface {
            form,
            record,
            emission: record.emission.as_ref(),
            material,
            boundary,
        })
    }

    /// A mesh interpolated between two.
    pub(super) fn on_its_way(
        &mut self,
        mesh: &Decoded,
        toward: &Spanned<TowardRecord>,
        index: u32,
    ) -> Result<Arc<Decoded>, Problem> {
        let TowardRecord { file, weight } = toward.get_ref();
        let other = self.assets.mesh(file, index, false)?;
        let between = mesh.raw.toward(&other.raw, weight.0);
        let between = between.map_err(|why| Fault::new(file.span(), format!("\"{}\": {why}", file.get_ref())))?;
        Ok(Arc::new(Decoded::new(between)))
    }

    /// A map to world space, turned into one to render space.
    fn to_render_space(&self, map: DAffine3, place: Range<usize>) -> Result<DAffine3, Fault> {
        let map = DAffine3::from_translation(-self.render_origin) * map;
        check_reach(map.translation.length(), place.clone())?;
        match transform::is_invertible(&map) {
            true => Ok(map),
            false => Err(Fault::new(
                place,
                "the shape's transform cannot be inverted: it makes the shape flat (for a \
                 rectangle or disc, leave the third factor of `scale` at 1), or it is too large \
                 or too small for single precision",
            )),
        }
    }

    /// When the camera moves: the shape's mesh for any placement, if that saves more time than it costs.
    fn shared_instead(&mut self, surface: &Surface<'_>, own: &DAffine3) -> Option<Arc<Shared>> {
        match &surface.form {
            // Emitting meshes are excluded: their light samples points on the mesh where it stands.
            Form::Mesh(decoded)
                if self.moving.has(surface.record.transform.as_ref())
                    && surface.emission.is_none()
                    && decoded.raw.triangles.len() > FEW_TRIANGLES =>
            {
                Some(self.shared(decoded, surface.record, own))
            }
            _ => None,
        }
    }

    /// A mesh for any placement. `own`: from its own space to the space in which its angles are measured.
    fn shared(&mut self, decoded: &Arc<Decoded>, record: &ShapeRecord, own: &DAffine3) -> Arc<Shared> {
        let (flip, normals) = (flips(record), normals(decoded, record));
        // Under similarities, angles equal those in its own space, so rotations may change.
        let own = match self.moving.has(record.transform.as_ref()) && is_similarity(&own.matrix3) {
            true => DAffine3::from_scale(DVec3::new(1.0, 1.0, own.matrix3.determinant().signum())),
            false => *own,
        };
        let angles = match normals {
            Normals::Smooth => linear_bits(&own.matrix3),
            Normals::OfFile | Normals::OfFaces => [0; 9],
        };
        let Kept { shared, clock, .. } = &mut *self.assets.kept;
        let key = (Pinned(decoded.clone()), flip, normals, angles);
        shared.get_or_make(clock, key, || Arc::new(shared_mesh(decoded, flip, normals, &own)))
    }

    /// The mesh baked to render space.
    pub(super) fn baked(&mut self, decoded: &Arc<Decoded>, record: &ShapeRecord, map: &DAffine3) -> Baked {
        let (flip, normals) = (flips(record), normals(decoded, record));
        let Kept { baked, clock, .. } = &mut *self.assets.kept;
        let key = (Pinned(decoded.clone()), map_bits(map), flip, normals);
        baked.get_or_make(clock, key, || {
            let raw = &decoded.raw;
            let mesh = match normals {
                Normals::OfFile => raw.to_mesh(map, flip, &raw.normals),
                Normals::OfFaces => raw.to_mesh(map, flip, &[]),
                Normals::Smooth => raw.to_mesh(map, flip, &raw.smooth_normals(map)),
            };
            Baked {
                mesh: Arc::new(mesh),
                area: Arc::default(),
            }
        })
    }

    /// The shape at its placement, as one object.
    fn placed(&mut self, surface: &Surface<'_>, map: &DAffine3) -> Result<Shape, Problem> {
        let flip = flips(surface.record);
        let shape = match &surface.form {
            Form::Sphere => Shape::Sphere {
                placement: placement(map),
                flip,
            },
            Form::Disc => Shape::Disc {
                placement: placement(map),
                flip,
            },
            Form::Cylinder => Shape::Cylinder {
                placement: placement(map),
                flip,
            },
            Form::Strands(strands) => Shape::Strands {
                strands: strands.clone(),
                placement: placement(map),
            },
            Form::Mesh(decoded) => {
                let Baked { mesh, .. } = self.baked(decoded, surface.record, map);
                if mesh.triangles.is_empty() {
                    return Err(no_area(surface.record));
                }
                Shape::Mesh {
                    mesh,
                    placement: Placement::IDENTITY,
                }
            }
        };
        check_shape_reach(&shape, place(surface.record))?;
        Ok(shape)
    }
}

/// Whether its emission depends on vertex colours. A faulty texture is reported where it is built.
pub(super) fn emits_colors(record: &ShapeRecord, assets: &mut Assets<'_>) -> bool {
    let emission = record.emission.as_ref().map(Spanned::get_ref);
    match emission.and_then(|emission| emission.radiance.as_ref()) {
        Some(radiance) if radiance.is_graph() => {
            texture::texture(radiance, assets).is_ok_and(|texture| texture.reads_colors())
        }
        Some(radiance) => matches!(radiance, TextureRecord::VertexColors(_)),
        None => false,
    }
}

/// Check that the mesh has the vertex colours asked for. `reflects`: they are reflectances, at most 1.
fn check_colors(mesh: &RawMesh, reflects: bool) -> Result<(), String> {
    if mesh.colors.is_empty() {
        return Err(
            "its vertices have no colours, which its material or emission takes (`attribute = \"color\"`); \
             expected `red`, `green` and `blue`, or `r`, `g` and `b`, of each vertex of a PLY file, or three \
             numbers after each position of an OBJ file"
                .to_owned(),
        );
    }
    let most = if reflects { 1.0 } else { f32::MAX };
    let is_wrong = |color: &Rgb| !color.to_array().iter().all(|x| (0.0..=most).contains(x));
    match mesh.colors.iter().position(is_wrong) {
        None => Ok(()),
        Some(i) => {
            let expected = if reflects {
                "numbers from 0 to 1"
            } else {
                "numbers that are not negative"
            };
            let color = mesh.colors[i];
            Err(format!(
                "vertex {i} (from zero) has the colour {color}; expected {expected}"
            ))
        }
    }
}

/// Meshes with at most this many triangles are always baked, which is as fast as a cache lookup.
const FEW_TRIANGLES: usize = 12;

fn shared_mesh(decoded: &Arc<Decoded>, flip: bool, normals: Normals, own: &DAffine3) -> Shared {
    let raw = &decoded.raw;
    let low = raw.positions.iter().fold(DVec3::INFINITY, |a, p| a.min(*p));
    let high = raw.positions.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p));
    let center = 0.5 * low + 0.5 * high;
    let radius = raw.positions.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
    let scale = if radius > 0.0 { 1.0 / radius } else { 1.0 };
    Shared {
        decoded: decoded.clone(),
        flip,
        smooth: match normals {
            Normals::Smooth => raw.smooth_normals(own),
            Normals::OfFile | Normals::OfFaces => Vec::new(),
        },
        normals,
        unit_from_raw: DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(-center),
        meshes: [OnceLock::new(), OnceLock::new()],
    }
}

/// The placed mesh; `None` if it has no area.
fn put(shared: &Shared, map: &DAffine3) -> Option<Shape> {
    let raw = &shared.decoded.raw;
    let [upright, mirrored] = &shared.meshes;
    let (slot, mirror) = match map.matrix3.determinant() < 0.0 {
        true => (mirrored, DVec3::new(-1.0, 1.0, 1.0)),
        false => (upright, DVec3::ONE),
    };
    let unit_from_raw = DAffine3::from_scale(mirror) * shared.unit_from_raw;
    let mesh = slot.get().cloned().unwrap_or_else(|| {
        let normals = match shared.normals {
            Normals::OfFile => &raw.normals,
            Normals::OfFaces | Normals::Smooth => &shared.smooth,
        };
        // Outside the lock: rayon might hand a thread that waits in there a task that needs the same lock.
        let mesh = Arc::new(raw.to_mesh(&unit_from_raw, shared.flip, normals));
        slot.get_or_init(|| mesh).clone()
    });
    let map = *map * unit_from_raw.inverse();
    if mesh.triangles.is_empty() || !transform::is_invertible(&map) {
        return None;
    }
    Some(Shape::Mesh {
        mesh,
        placement: placement(&map),
    })
}

/// Whether a map scales all lengths equally, up to rounding.
fn is_similarity(m: &DMat3) -> bool {
    let square = m.transpose() * *m;
    let scale = square.x_axis.x;
    let off = (square - DMat3::from_diagonal(DVec3::splat(scale))).to_cols_array();
    off.iter().all(|x| x.abs() <= 1e-9 * scale)
}

/// Refuse shapes that extend too far from the camera.
fn check_shape_reach(shape: &Shape, place: Range<usize>) -> Result<(), Fault> {
    let reach = match shape {
        Shape::Sphere { placement, .. }
        | Shape::Disc { placement, .. }
        | Shape::Cylinder { placement, .. }
        | Shape::Mesh { placement, .. }
            if *placement != Placement::IDENTITY =>
        {
            // In its own space it lies in the unit ball or the unit cylinder.
            let map = &placement.render_from_object;
            let m = &map.matrix3;
            let lengths = [map.translation, m.x_axis, m.y_axis, m.z_axis];
            lengths.iter().map(|v| glam::Vec3::from(*v).as_dvec3().length()).sum()
        }
        _ => {
            let (low, high) = bounds(shape);
            let farthest = low.abs().max(high.abs());
            farthest.as_dvec3().length()
        }
    };
    check_reach(reach, place)
}

pub(super) fn own_map(record: &ShapeRecord) -> Result<DAffine3, Fault> {
    let center = record.center.as_ref().map_or(DVec3::ZERO, |c| c.get_ref().0);
    let radius = record.radius.as_ref().map_or(1.0, |r| r.get_ref().0);
    let own = match record.kind.get_ref() {
        ShapeType::Cylinder => between(record, radius)?,
        ShapeType::Curves | ShapeType::Points => DAffine3::IDENTITY,
        _ => DAffine3::from_translation(center) * DAffine3::from_scale(DVec3::splat(radius)),
    };
    match &record.transform {
        Some(steps) => Ok(transform::compose(steps.get_ref())? * own),
        None => Ok(own),
    }
}

/// Maps the unit cylinder to the one from `p0` to `p1`, with azimuth 0 as in Mitsuba.
fn between(record: &ShapeRecord, radius: f64) -> Result<DAffine3, Fault> {
    let [p0, p1] = [&record.p0, &record.p1];
    let start = p0.as_ref().map_or(DVec3::ZERO, |p| p.get_ref().0);
    let end = p1.as_ref().map_or(DVec3::Z, |p| p.get_ref().0);
    let axis = end - start;
    let Some(n) = axis.try_normalize() else {
        let place = p1.as_ref().or(p0.as_ref()).map(Spanned::span);
        return Err(Fault::new(
            place.unwrap_or(record.kind.span()),
            "expected two different points as `p0` and `p1`",
        ));
    };
    let (x, y) = n.any_orthonormal_pair();
    Ok(DAffine3::from_cols(x * radius, y * radius, axis, start))
}

/// Where the file places the shape.
fn place(record: &ShapeRecord) -> Range<usize> {
    let transform = record.transform.as_ref().map(|t| t.span());
    let center = record.center.as_ref().map(|c| c.span());
    let radius = record.radius.as_ref().map(|r| r.span());
    let ends = record.p0.as_ref().or(record.p1.as_ref());
    transform
        .or(center)
        .or(ends.map(|p| p.span()))
        .or(radius)
        .unwrap_or(record.kind.span())
}

pub(super) fn flips(record: &ShapeRecord) -> bool {
    record.flip_normals.as_ref().is_some_and(|flip| *flip.get_ref())
}

/// A mesh's shading normals: the file's, or smooth ones where the record asks for them.
pub(super) fn normals(decoded: &Decoded, record: &ShapeRecord) -> Normals {
    let asked = |field: &Option<Spanned<bool>>| field.as_ref().is_some_and(|f| *f.get_ref());
    if asked(&record.face_normals) {
        Normals::OfFaces
    } else if asked(&record.smooth) && decoded.raw.normals.is_empty() {
        Normals::Smooth
    } else {
        Normals::OfFile
    }
}

pub(super) fn placement(map: &DAffine3) -> Placement {
    Placement {
        render_from_object: transform::single(map),
        object_from_render: transform::single(&map.inverse()),
    }
}

fn no_area(record: &ShapeRecord) -> Problem {
    match &record.file {
        Some(path) => Problem::NoArea(path.span()),
        None => Fault::new(place(record), NO_AREA).into(),
    }
}

const NO_AREA: &str = "no triangle of the mesh has an area that single precision can tell from 0";
