//! From records to the scene that is rendered: names resolved, numbers in single precision, everything moved so that
//! the camera stands at the origin.

mod bounds;
mod extents;
mod gltf;
mod light;
mod material;
mod medium;
mod rules;
mod shape;
mod texture;
mod view;

use super::assets::image::{self, Encoding};
use super::assets::{Flaw, mesh::RawMesh, volume};
use super::parse::{Fault, RenderRecord, SceneRecord};
use super::transform;
use crate::values::Spanned;
use beamfarm_image::bundle::{self, Bundle};
use beamfarm_image::job::{Finders, MAX_PASSES};
use beamfarm_render::medium::MediumId;
use beamfarm_render::medium::bricks::{Bricks, RawDensity};
use beamfarm_render::texture::Image;
use beamfarm_render::world::{RenderDefaults, SceneDescription};
pub use extents::{Extent, Extents};
use glam::DVec3;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Why a scene cannot be built.
#[derive(Debug)]
pub enum Problem {
    /// At a place of the scene file.
    Scene(Fault),
    /// In an asset.
    Asset {
        /// Its path, as the scene file writes it.
        file: String,
        /// What is wrong with it.
        flaw: Flaw,
    },
}

impl From<Fault> for Problem {
    fn from(fault: Fault) -> Self {
        Self::Scene(fault)
    }
}

/// A scene, and what there is to say about it.
pub struct Assembled {
    pub description: SceneDescription,
    /// What has no effect.
    pub notes: Vec<Fault>,
    /// Where rules are written that photons obey.
    pub photon_places: Vec<Range<usize>>,
    /// Where things are.
    pub extents: Extents,
}

/// Assemble the scene of a record, with the assets of a bundle.
pub fn assemble(record: &SceneRecord, bundle: &Bundle) -> Result<Assembled, Problem> {
    let mut assets = Assets::new(bundle);
    let eye = gltf::eye(record, bundle)?;
    let render_origin = eye.origin.0;
    let media = medium::Media::new(&record.media, render_origin, &mut assets)?;
    let world_medium = media.resolve_or(record.world.medium.as_ref(), None)?;
    let materials = material::Materials::new(&record.materials, &mut assets)?;
    let camera = view::camera(&record.image, record.camera.get_ref(), &eye)?;
    let camera_medium = match &record.camera.get_ref().medium {
        Some(name) => Some(media.resolve(name)?),
        None => None,
    };
    let mut parts = Parts {
        render_origin,
        world_medium,
        materials,
        assets,
        objects: Vec::new(),
        lights: Vec::new(),
        names: rules::Names::default(),
        // Light from far away has to be sent to all of the space that scatters it.
        points: media.corners(world_medium).chain([DVec3::ZERO]).collect(),
        media,
    };
    parts.add_lights(&record.lights)?;
    for (i, shape) in record.shapes.iter().enumerate() {
        let name = shape.name.clone().unwrap_or_else(|| format!("shapes[{i}]"));
        parts.add_shape(shape, &name)?;
    }
    for file in &record.gltf {
        parts.add_gltf(file)?;
    }
    let rules::Resolved {
        rules,
        mut notes,
        photon_places,
    } = rules::resolve(record, &parts)?;
    let extents = Extents::new(render_origin, &parts.media);
    notes.extend(extents.outside(record, &parts.objects));
    if parts.lights.is_empty() {
        notes.push(Fault::new(0..0, "there are no lights: the picture will be black"));
    }
    let description = SceneDescription {
        camera,
        camera_medium,
        world_medium,
        bounds: bounds::around(&parts.objects, &parts.points),
        objects: parts.objects,
        materials: parts.materials.list,
        media: parts.media.list,
        lights: parts.lights,
        defaults: defaults(&record.render)?,
        rules,
        notes: Vec::new(),
        photon_rules: Vec::new(),
    };
    Ok(Assembled {
        description,
        notes,
        photon_places,
        extents,
    })
}

/// What is being built.
struct Parts<'a> {
    /// World position of the camera: the origin of render space.
    render_origin: DVec3,
    world_medium: MediumId,
    media: medium::Media,
    materials: material::Materials,
    assets: Assets<'a>,
    objects: Vec<beamfarm_render::geometry::Object>,
    lights: Vec<beamfarm_render::light::Light>,
    names: rules::Names,
    /// The camera, the lights that stand somewhere, and the corners of what fills the world, render space.
    points: Vec<DVec3>,
}

/// `reach`: how far from the camera a thing extends.
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

/// The bundle's files, each decoded once.
struct Assets<'a> {
    bundle: &'a Bundle,
    images: BTreeMap<(String, Encoding), Arc<Image>>,
    meshes: BTreeMap<String, Arc<RawMesh>>,
    /// By file and grid.
    densities: BTreeMap<(String, Option<String>), Arc<Bricks>>,
    /// Likewise; one channel or three.
    albedos: BTreeMap<(String, Option<String>), Arc<Vec<Bricks>>>,
}

impl<'a> Assets<'a> {
    fn new(bundle: &'a Bundle) -> Self {
        Self {
            bundle,
            images: BTreeMap::new(),
            meshes: BTreeMap::new(),
            densities: BTreeMap::new(),
            albedos: BTreeMap::new(),
        }
    }

    fn image(&mut self, path: &Spanned<String>, encoding: Encoding) -> Result<Arc<Image>, Problem> {
        let key = (bundle::key(path.get_ref()), encoding);
        load(&mut self.images, key, self.bundle, path, |_, bytes| {
            image::read(bytes, encoding)
        })
    }

    fn density(&mut self, path: &Spanned<String>, grid: Option<&str>) -> Result<Arc<Bricks>, Problem> {
        let key = (bundle::key(path.get_ref()), grid.map(str::to_owned));
        load(&mut self.densities, key, self.bundle, path, |name, bytes| {
            let raw = volume::read(name, bytes, grid)?;
            let bricks = Bricks::new(&raw).map_err(|e| e.to_string())?;
            Ok(bricks)
        })
    }

    fn albedo(&mut self, path: &Spanned<String>, grid: Option<&str>) -> Result<Arc<Vec<Bricks>>, Problem> {
        let key = (path.get_ref().clone(), grid.map(str::to_owned));
        load(&mut self.albedos, key, self.bundle, path, |name, bytes| {
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
    }

    fn mesh(&mut self, path: &Spanned<String>) -> Result<Arc<RawMesh>, Problem> {
        let key = bundle::key(path.get_ref());
        load(&mut self.meshes, key, self.bundle, path, RawMesh::read)
    }
}

fn load<K: Ord, T>(
    loaded: &mut BTreeMap<K, Arc<T>>,
    key: K,
    bundle: &Bundle,
    path: &Spanned<String>,
    read: impl Fn(&str, &[u8]) -> Result<T, Flaw>,
) -> Result<Arc<T>, Problem> {
    if let Some(asset) = loaded.get(&key) {
        return Ok(asset.clone());
    }
    let name = path.get_ref();
    let bytes = bundle
        .files
        .get(&bundle::key(name))
        .ok_or_else(|| Fault::new(path.span(), format!("the bundle lacks the file \"{name}\"")))?;
    let asset = Arc::new(read(name, bytes).map_err(|flaw| asset_problem(path, flaw))?);
    loaded.insert(key, asset.clone());
    Ok(asset)
}

fn asset_problem(path: &Spanned<String>, flaw: impl Into<Flaw>) -> Problem {
    Problem::Asset {
        file: path.get_ref().clone(),
        flaw: flaw.into(),
    }
}

/// The value of a field that this kind of thing cannot do without; `kind`: where its type is written.
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

fn defaults(record: &RenderRecord) -> Result<RenderDefaults, Fault> {
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
        exposure: record.exposure.map_or(standard.exposure, |stops| stops.f32()),
        radius: record.radius.map(|radius| radius.f32()),
        targeting: record.targeting.map_or(standard.targeting, Into::into),
        finders: Finders {
            media: record.media.map(Into::into),
            surfaces: record.surfaces.map(Into::into),
            caustics: record.caustics.map(Into::into),
        },
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
