//! Turns records into the scene that is rendered: names are resolved, numbers become single precision, and everything
//! moves so that the camera stands at the origin.

mod ahead;
mod anisotropy;
mod blend;
mod bounds;
mod coincident;
mod density;
mod displacement;
mod emission;
mod enclosed;
mod extents;
mod glow;
mod gltf;
mod ior;
mod kept;
mod light;
mod material;
mod materials;
mod medium;
mod mtl;
mod photometric;
mod principled;
mod relief;
mod rules;
mod shape;
mod sky;
mod solid;
mod space;
mod strands;
#[cfg(test)]
mod tests;
mod texture;
mod unmapped;
mod view;

use super::assets::image::{self, Encoding, Picture};
use super::assets::{Flaw, mesh::RawMesh, strands::RawStrands, volume};
use super::parse::{Eye, Fault, ImageFile, RenderRecord, SceneRecord, Snapshot, Steps, TextureRecord};
use super::transform;
use crate::files::{Content, Source};
use crate::values::{Finite, Spanned};
use beamfarm_image::bundle;
use beamfarm_image::job::{MAX_PASSES, Techniques};
use beamfarm_image::view::View;
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::geometry::Strands;
use beamfarm_render::world::geometry::strands::Basis;
use beamfarm_render::world::interrupt::Interrupt;
use beamfarm_render::world::medium::MediumId;
use beamfarm_render::world::medium::bricks::{Bricks, RawDensity};
use beamfarm_render::world::texture::Image;
use beamfarm_render::world::{RenderDefaults, SceneDescription};
pub use extents::{Extent, Extents};
use glam::{Affine3A, DVec3};
use kept::{Decoded, ImageKey, MeshKey};
pub use kept::{Kept, Purpose};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Why a scene cannot be built.
#[derive(Debug)]
pub enum Problem {
    /// A fault in the scene file.
    Scene(Fault),
    /// A fault in an asset.
    Asset {
        /// Its path, as the scene file writes it.
        file: String,
        /// What is wrong with it.
        flaw: Flaw,
    },
    /// The mesh file named here has no area; its shape can be left out.
    NoArea(Range<usize>),
}

impl From<Fault> for Problem {
    fn from(fault: Fault) -> Self {
        Self::Scene(fault)
    }
}

/// A scene, and the notes on it.
pub struct Assembled {
    pub description: SceneDescription,
    /// What is ignored or interpreted differently.
    pub notes: Vec<Problem>,
    /// Where rules that photons obey are written.
    pub photon_places: Vec<Range<usize>>,
    /// Where things are.
    pub extents: Extents,
    /// World position of the origin of render space.
    pub render_origin: DVec3,
}

/// Which point is the origin of render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Space {
    /// The camera.
    AtCamera,
    /// A world point, where the camera stands at another moment of the same exposure.
    Of(DVec3),
    /// Also a world point. Meshes are made independent of their placement, since all may move.
    Sketched(DVec3),
}

/// Assemble the scene of a snapshot from its files and what is kept of other scenes.
pub fn assemble(snapshot: &Snapshot, source: Source<'_>, kept: &mut Kept, space: Space) -> Result<Assembled, Problem> {
    let record = &snapshot.record;
    let mut assets = Assets::new(source, kept, record);
    let eye = assets.eye(record)?;
    let render_origin = match space {
        Space::AtCamera => eye.origin.0,
        Space::Of(origin) | Space::Sketched(origin) => origin,
    };
    let eye_point = eye.origin.0 - render_origin;
    assets.camera_from_world = view::camera_from_world(&eye);
    assets.images_ahead(record);
    let media = medium::Media::new(&record.media, render_origin, &mut assets)?;
    let world_medium = media.resolve_or(record.world.medium.as_ref(), None)?;
    let materials = materials::Materials::new(&record.materials, &mut assets)?;
    let mut camera = view::camera(&record.image, record.camera.get_ref(), &eye)?;
    camera.position = eye_point.as_vec3();
    let camera_medium = match &record.camera.get_ref().medium {
        Some(name) => Some(media.resolve(name)?),
        None => None,
    };
    let mut parts = Parts {
        render_origin,
        moving: match space {
            Space::Sketched(_) => Moving::Everything,
            // Each frame has its own render space.
            _ if snapshot.moves_in(&record.camera.span()) || assets.camera_plays(record) => Moving::Everything,
            _ => Moving::Places(&snapshot.moving),
        },
        world_medium,
        materials,
        assets,
        objects: Vec::new(),
        lights: Vec::new(),
        names: rules::Names::default(),
        notes: Vec::new(),
        // Distant lights must cover all space that scatters them.
        points: media.corners(world_medium).chain([eye_point]).collect(),
        media,
    };
    parts.add_lights(&record.lights)?;
    parts.meshes_ahead(&record.shapes);
    for (i, shape) in record.shapes.iter().enumerate() {
        let name = shape.name.clone().unwrap_or_else(|| format!("shapes[{i}]"));
        parts.add_shape(shape, &name)?;
    }
    for file in &record.gltf {
        parts.add_gltf(file)?;
    }
    parts.add_volume_lights()?;
    let of_mtl = mtl::note(&record.shapes, &mut parts.assets).map(|message| Fault::new(0..0, message).into());
    let rules::Resolved {
        rules,
        notes: of_rules,
        photon_places,
    } = rules::resolve(record, &parts)?;
    let mut notes = std::mem::take(&mut parts.notes);
    notes.extend(of_mtl);
    let of_files = std::mem::take(&mut parts.assets.notes).into_iter();
    notes.extend(of_files.map(|(file, note)| Problem::Asset {
        file,
        flaw: note.into(),
    }));
    notes.extend(of_rules.into_iter().map(Problem::Scene));
    let extents = Extents::new(render_origin, &parts.media);
    let outside = extents.outside(record, &parts.objects).into_iter();
    notes.extend(outside.map(Problem::Scene));
    notes.extend(strands::note(&parts).map(|message| Fault::new(0..0, message).into()));
    let unmapped = [unmapped::note(&parts), unmapped::note_of_tangents(&parts)];
    notes.extend((unmapped.into_iter().flatten()).map(|message| Fault::new(0..0, message).into()));
    let doubled = coincident::note(&parts.objects, &parts.materials.list, rules.as_ref());
    notes.extend(doubled.map(|message| Fault::new(0..0, message).into()));
    if parts.lights.is_empty() {
        notes.push(Fault::new(0..0, "there are no lights: the picture will be black").into());
    } else if rules.is_none()
        && camera.projection != Projection::Orthographic
        && let Some(object) = enclosed::around_camera(&parts.objects, &parts.materials.list, &parts.lights)
    {
        let message = format!(
            "it stands (`origin`) inside of {:?}, which lets no light through, and no light is in there: the picture will be black",
            object.name
        );
        notes.push(Fault::new(record.camera.span(), message).into());
    }
    let description = SceneDescription {
        camera,
        camera_medium,
        world_medium,
        bounds: bounds::around(&parts.objects, &parts.points),
        objects: parts.objects,
        materials: parts.materials.list,
        material_names: parts.materials.labels,
        media: parts.media.list,
        media_names: parts.media.labels,
        lights: parts.lights,
        defaults: defaults(&record.render)?,
        rules,
        notes: Vec::new(),
        photon_rules: Vec::new(),
        motion: None,
        has_frames: snapshot.clock.is_given(),
        interrupt: Interrupt::default(),
    };
    Ok(Assembled {
        description,
        notes,
        photon_places,
        extents,
        render_origin,
    })
}

/// What changes its place in render space in the next scene of the same kind.
enum Moving<'a> {
    Everything,
    /// What stands at these spans of the file.
    Places(&'a [Range<usize>]),
}

impl Moving<'_> {
    /// Whether a shape with this transform moves.
    fn has(&self, transform: Option<&Spanned<Steps>>) -> bool {
        match self {
            Self::Everything => true,
            Self::Places(places) => transform.is_some_and(|steps| {
                let around = steps.span();
                let mut places = places.iter();
                places.any(|place| around.start <= place.start && place.end <= around.end)
            }),
        }
    }
}

/// Where the scene's camera is, as given by the scene or by a glTF file.
pub fn eye(record: &SceneRecord, source: Source<'_>) -> Result<Eye, Problem> {
    Assets::new(source, &mut Kept::default(), record).eye(record)
}

/// The scene under construction.
struct Parts<'a> {
    /// World position of the origin of render space: the camera's, unless it moves.
    render_origin: DVec3,
    moving: Moving<'a>,
    world_medium: MediumId,
    media: medium::Media,
    materials: materials::Materials,
    assets: Assets<'a>,
    objects: Vec<beamfarm_render::world::geometry::Object>,
    lights: Vec<beamfarm_render::world::light::Light>,
    names: rules::Names,
    /// What is ignored or interpreted differently.
    notes: Vec<Problem>,
    /// The camera, lights with a position, and corners of what fills the world, render space.
    points: Vec<DVec3>,
}

/// Refuse a thing that extends too far from the camera. `reach`: how far it extends.
fn check_reach(reach: f64, place: Range<usize>) -> Result<(), Fault> {
    match reach < transform::LARGEST {
        true => Ok(()),
        false => Err(Fault::new(
            place,
            format!(
                "it reaches {reach:.3e} scene units from the camera; expected less than {:e}",
                transform::LARGEST
            ),
        )),
    }
}

/// The scene's files, each decoded once.
struct Assets<'a> {
    source: Source<'a>,
    kept: &'a mut Kept,
    /// Time of glTF animations, when the scene has frames.
    seconds: Option<f64>,
    /// Meshes and images embedded in other files, by key.
    meshes: BTreeMap<String, Arc<Decoded>>,
    images: BTreeMap<String, Arc<Image>>,
    /// The scene's textures by name.
    textures: BTreeMap<&'a str, &'a TextureRecord<Finite>>,
    /// To camera coordinates: x right, y up, z backwards.
    camera_from_world: Affine3A,
    /// Notes on files: the file and the text.
    notes: Vec<(String, String)>,
}

impl<'a> Assets<'a> {
    fn new(source: Source<'a>, kept: &'a mut Kept, record: &'a SceneRecord) -> Self {
        let named = record.textures.iter();
        Self {
            source,
            kept,
            seconds: record.seconds,
            camera_from_world: Affine3A::IDENTITY,
            textures: named
                .map(|(name, texture)| (name.get_ref().as_str(), texture.get_ref()))
                .collect(),
            meshes: BTreeMap::new(),
            images: BTreeMap::new(),
            notes: Vec::new(),
        }
    }

    /// An image for emitted light if it `shines`: then pixels that are not numbers become black, which is noted.
    fn image(&mut self, file: &ImageFile, encoding: Encoding, shines: bool) -> Result<Arc<Image>, Problem> {
        let key = bundle::key(file.file.get_ref());
        // Embedded images are already decoded as they are meant.
        if let Some(image) = self.images.get(&key) {
            return Ok(image.clone());
        }
        let (source, Kept { images, clock, .. }) = (self.source, &mut *self.kept);
        let picture = images.get_or(clock, key_of_image(source, file, encoding), || {
            read_image(source, file, encoding)
        })?;
        picture.notes.iter().for_each(|note| self.note(file, note.clone()));
        match &picture.bad {
            Some(bad) if shines => {
                self.note(file, bad.to_string());
                Ok(picture.image.clone())
            }
            _ => picture.sound().map_err(|flaw| asset_problem(&file.file, flaw)),
        }
    }

    /// Add a note on a file, once.
    fn note(&mut self, file: &ImageFile, note: String) {
        let note = (file.file.get_ref().clone(), note);
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    fn density(&mut self, path: &Spanned<String>, grid: Option<&str>) -> Result<Arc<Bricks>, Problem> {
        let (source, Kept { densities, clock, .. }) = (self.source, &mut *self.kept);
        densities.get_or(clock, key_of_grid(source, path, grid), || {
            decoded(source, path, |name, bytes| {
                let raw = volume::read(name, bytes, grid)?;
                let bricks = Bricks::new(&raw).map_err(|e| e.to_string())?;
                Ok(bricks)
            })
        })
    }

    fn albedo(&mut self, path: &Spanned<String>, grid: Option<&str>) -> Result<Arc<Vec<Bricks>>, Problem> {
        let (source, Kept { albedos, clock, .. }) = (self.source, &mut *self.kept);
        albedos.get_or(clock, key_of_grid(source, path, grid), || {
            decoded(source, path, |name, bytes| {
                let bricks = |raw: &RawDensity| {
                    let bricks = Bricks::new(raw).map_err(|e| e.to_string())?;
                    match bricks.max() {
                        ..=1.0 => Ok(bricks),
                        max => Err(format!("a sample is {max}; expected albedos from 0 to 1")),
                    }
                };
                let raw = volume::read_albedo(name, bytes, grid)?;
                Ok(raw.iter().map(bricks).collect::<Result<_, _>>()?)
            })
        })
    }

    /// `index`: which mesh of a file that has several. `colored`: with vertex colours.
    fn mesh(&mut self, path: &Spanned<String>, index: u32, colored: bool) -> Result<Arc<Decoded>, Problem> {
        let key = bundle::key(path.get_ref());
        if let Some(mesh) = self.meshes.get(&key) {
            return Ok(mesh.clone());
        }
        let (source, Kept { meshes, clock, .. }) = (self.source, &mut *self.kept);
        meshes.get_or(clock, key_of_mesh(source, path, index, colored), || {
            read_mesh(source, path, index, colored)
        })
    }
}

impl Assets<'_> {
    /// Curves or points from a file. `radius`: for points without one.
    fn strands(&mut self, path: &Spanned<String>, basis: Basis, radius: Option<f32>) -> Result<Arc<Strands>, Problem> {
        let (source, Kept { strands, clock, .. }) = (self.source, &mut *self.kept);
        let content = source.content(&bundle::key(path.get_ref()));
        let key = (content, ending(path), basis, radius.map(f32::to_bits));
        strands.get_or(clock, key, || {
            decoded(source, path, |name, bytes| {
                RawStrands::read(name, bytes, radius)?.to_strands(basis)
            })
        })
    }
}

/// The file's extension, which selects the decoder together with its bytes.
fn ending(path: &Spanned<String>) -> String {
    let name = path.get_ref();
    name.rsplit_once('.').map_or("", |(_, ending)| ending).to_owned()
}

fn key_of_mesh(source: Source<'_>, path: &Spanned<String>, index: u32, colored: bool) -> MeshKey {
    (
        source.content(&bundle::key(path.get_ref())),
        ending(path),
        index,
        colored,
    )
}

fn read_mesh(source: Source<'_>, path: &Spanned<String>, index: u32, colored: bool) -> Result<Arc<Decoded>, Problem> {
    decoded(source, path, |name, bytes| {
        RawMesh::read_nth(name, bytes, index, colored).map(Decoded::new)
    })
}

fn key_of_image(source: Source<'_>, file: &ImageFile, encoding: Encoding) -> ImageKey {
    let content = source.content(&bundle::key(file.file.get_ref()));
    (content, encoding, file.layer.clone())
}

fn read_image(source: Source<'_>, file: &ImageFile, encoding: Encoding) -> Result<Arc<Picture>, Problem> {
    decoded(source, &file.file, |_, bytes| {
        image::read_picture(bytes, encoding, file.layer.as_deref())
    })
}

fn key_of_grid(source: Source<'_>, path: &Spanned<String>, grid: Option<&str>) -> (Content, String, Option<String>) {
    let content = source.content(&bundle::key(path.get_ref()));
    (content, ending(path), grid.map(str::to_owned))
}

fn decoded<T>(
    source: Source<'_>,
    path: &Spanned<String>,
    read: impl Fn(&str, &[u8]) -> Result<T, Flaw>,
) -> Result<Arc<T>, Problem> {
    let name = path.get_ref();
    let bytes = source
        .bytes(&bundle::key(name))
        .ok_or_else(|| Fault::new(path.span(), format!("the bundle lacks the file \"{name}\"")))?;
    Ok(Arc::new(read(name, bytes).map_err(|flaw| asset_problem(path, flaw))?))
}

fn asset_problem(path: &Spanned<String>, flaw: impl Into<Flaw>) -> Problem {
    Problem::Asset {
        file: path.get_ref().clone(),
        flaw: flaw.into(),
    }
}

/// The value of a field that this kind of thing requires; `kind`: where its type is written.
fn required<'r, T, K>(field: &'r Option<T>, kind: &Spanned<K>, name: &str) -> Result<&'r T, Fault> {
    let missing = || Fault::new(kind.span(), format!("with this type the field `{name}` is required"));
    field.as_ref().ok_or_else(missing)
}

fn unknown_name<'n>(what: &str, name: &Spanned<String>, known: impl Iterator<Item = &'n str>) -> Fault {
    let known: Vec<String> = known.map(|n| format!("\"{n}\"")).collect();
    let known = match known.len() {
        0 => "the scene defines none".to_string(),
        1..=12 => format!("the scene defines {}", known.join(", ")),
        n => format!("the scene defines {n} others"),
    };
    Fault::new(
        name.span(),
        format!("there is no {what} \"{}\"; {known}", name.get_ref()),
    )
}

/// The job settings of a scene file.
pub fn defaults(record: &RenderRecord) -> Result<RenderDefaults, Fault> {
    let standard = RenderDefaults::default();
    let passes = match &record.passes {
        Some(passes) => count(passes, MAX_PASSES)?,
        None => standard.passes,
    };
    let paths_per_pass = match &record.paths {
        Some(paths) => Some(count(paths, u32::MAX)?),
        None => standard.paths_per_pass,
    };
    Ok(RenderDefaults {
        passes,
        paths_per_pass,
        alpha: record.alpha.map_or(standard.alpha, |alpha| alpha.0),
        schedule: record.schedule.map_or(standard.schedule, Into::into),
        seed: record.seed.unwrap_or(standard.seed),
        view: View {
            transform: record.view.map_or(standard.view.transform, Into::into),
            exposure: record.exposure.map_or(standard.view.exposure, |stops| stops.f32()),
            white_balance: record.white_balance.map_or(standard.view.white_balance, |t| t.f32()),
        },
        empty_depth: record.empty_depth.map(|depth| depth.f32()),
        radius: record.radius.map(|radius| radius.f32()),
        targeting: record.targeting.map_or(standard.targeting, Into::into),
        techniques: Techniques {
            media: record.media.map(Into::into),
            surfaces: record.surfaces.map(Into::into),
            caustics: record.caustics.map(Into::into),
            aimed: None,
        },
        engine: record.engine.map_or(standard.engine, Into::into),
    })
}

fn count<T>(given: &Spanned<T>, most: T) -> Result<T, Fault>
where
    T: Copy + PartialOrd + From<u8> + std::fmt::Display,
{
    match *given.get_ref() {
        n if n >= T::from(1) && n <= most => Ok(n),
        n => Err(Fault::new(
            given.span(),
            format!("expected a whole number from 1 to {most}, found {n}"),
        )),
    }
}
