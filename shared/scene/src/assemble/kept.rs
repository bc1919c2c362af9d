//! What is kept from one scene for the next: everything that takes time proportional to a file's bytes, keyed by its
//! inputs. A hit equals what would be made again.

use crate::assets::gltf::Choice;
use crate::assets::image::{Encoding, Picture};
use crate::assets::mesh::{Opening, RawMesh};
use crate::files::Content;
use crate::parse::Channel;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::{Distribution, RoughCoat};
use beamfarm_render::world::geometry::strands::Basis;
use beamfarm_render::world::geometry::{Mesh, Strands};
use beamfarm_render::world::light::Environment;
use beamfarm_render::world::medium::Heterogeneous;
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::texture::Image;
use glam::{DAffine3, DMat3, DVec3, Mat3};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// What this many scenes of a kind in a row did not use is dropped.
const SCENES: u64 = 3;

/// Kinds of scenes. Each ages only its own things: scenes that move about do not age what is kept for those at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Passes that are accumulated.
    Exact,
    /// An interactive preview.
    Sketch,
}

/// When a thing was used last, by purpose.
type Used = [u64; 2];

/// Cached things, by what they are made from.
#[derive(Clone)]
pub struct Shelf<K, V>(BTreeMap<K, (Used, V)>);

impl<K, V> Default for Shelf<K, V> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<K: Ord, V: Clone> Shelf<K, V> {
    /// The cached thing, or one made now. Failures are not cached.
    pub fn get_or<E>(&mut self, clock: &Clock, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        if let Some((used, thing)) = self.0.get_mut(&key) {
            clock.mark(used);
            return Ok(thing.clone());
        }
        let thing = make()?;
        let mut used = [0; 2];
        clock.mark(&mut used);
        self.0.insert(key, (used, thing.clone()));
        Ok(thing)
    }

    /// [`Self::get_or`] for what cannot fail.
    pub fn get_or_make(&mut self, clock: &Clock, key: K, make: impl FnOnce() -> V) -> V {
        let made: Result<V, std::convert::Infallible> = self.get_or(clock, key, || Ok(make()));
        match made {
            Ok(thing) => thing,
            Err(never) => match never {},
        }
    }

    /// The cached thing, if it is still valid.
    pub fn get_if(&mut self, clock: &Clock, key: &K, is_right: impl FnOnce(&V) -> bool) -> Option<V> {
        let (used, thing) = self.0.get_mut(key).filter(|(_, thing)| is_right(thing))?;
        clock.mark(used);
        Some(thing.clone())
    }

    /// Whether it is cached.
    pub fn has(&self, key: &K) -> bool {
        self.0.contains_key(key)
    }

    /// Store a thing, replacing an older one.
    pub fn put(&mut self, clock: &Clock, key: K, thing: V) {
        let mut used = [0; 2];
        clock.mark(&mut used);
        self.0.insert(key, (used, thing));
    }

    fn tidy(&mut self, clock: &Clock) {
        self.0.retain(|_, (used, _)| clock.is_recent(used));
    }
}

/// Counts scenes, by purpose.
#[derive(Clone)]
pub struct Clock {
    purpose: Purpose,
    /// Numbers of the current scene, from one.
    scenes: Used,
}

impl Clock {
    fn mark(&self, used: &mut Used) {
        let purpose = self.purpose as usize;
        used[purpose] = self.scenes[purpose];
    }

    fn is_recent(&self, used: &Used) -> bool {
        (0..2).any(|purpose| used[purpose] > 0 && used[purpose] + SCENES > self.scenes[purpose])
    }
}

/// A mesh as its file gives it, and what has been found out about it.
pub struct Decoded {
    pub raw: RawMesh,
    solid: OnceLock<Result<Bounds, Opening>>,
}

impl Decoded {
    pub fn new(raw: RawMesh) -> Self {
        Self {
            raw,
            solid: OnceLock::new(),
        }
    }

    /// The solid that it bounds, or why it does not separate an inside from an outside.
    pub fn solid(&self) -> &Result<Bounds, Opening> {
        if let Some(solid) = self.solid.get() {
            return solid;
        }
        // Outside the lock: rayon might hand a thread that waits in there a task that needs the same lock.
        let solid = self.raw.solid().map(|solid| Bounds {
            mended: solid.mended.map(|mesh| Arc::new(Self::new(mesh))),
            doubled: solid.doubled,
            turned: solid.turned,
            cut: solid.cut,
            crossing: solid.crossing,
        });
        self.solid.get_or_init(|| solid)
    }
}

/// The boundary of the solid that a mesh is meant to be: see [`Solid`](crate::assets::mesh::Solid).
pub struct Bounds {
    pub mended: Option<Arc<Decoded>>,
    pub doubled: usize,
    pub turned: usize,
    pub cut: usize,
    pub crossing: Option<DVec3>,
}

impl Bounds {
    /// Whether all its faces already point outwards, or all are reversed.
    pub fn is_turned_as_one(&self, mesh: &Decoded) -> bool {
        self.turned == 0 || self.turned == mesh.raw.triangles.len()
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let counts = [
            (
                self.doubled,
                "face",
                "is there twice and left out",
                "are there twice and left out",
            ),
            (
                self.cut,
                "edge",
                "that meets shorter ones is cut",
                "that meet shorter ones are cut",
            ),
            (
                self.turned,
                "face",
                "that looks inwards is turned",
                "that look inwards are turned",
            ),
        ];
        let found = counts.iter().filter(|(count, ..)| *count > 0);
        let said = found.map(|(count, what, one, many)| match count {
            1 => format!("1 {what} {one}"),
            _ => format!("{count} {what}s {many}"),
        });
        f.write_str(&said.collect::<Vec<_>>().join(", "))
    }
}

/// Which shading normals a mesh has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Normals {
    /// The file's normals, if it has any.
    OfFile,
    /// No shading normals.
    OfFaces,
    /// Smooth normals, under a map.
    Smooth,
}

/// A thing kept alive so that its address identifies it.
pub struct Pinned<T>(pub Arc<T>);

impl<T> Clone for Pinned<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Pinned<T> {
    fn address(&self) -> usize {
        Arc::as_ptr(&self.0) as usize
    }
}

impl<T> PartialEq for Pinned<T> {
    fn eq(&self, other: &Self) -> bool {
        self.address() == other.address()
    }
}

impl<T> Eq for Pinned<T> {}

impl<T> PartialOrd for Pinned<T> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Pinned<T> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.address().cmp(&other.address())
    }
}

/// Bits of an affine map, and of its linear part.
pub type MapBits = [u64; 12];
pub type LinearBits = [u64; 9];

pub fn map_bits(map: &DAffine3) -> MapBits {
    map.to_cols_array().map(f64::to_bits)
}

pub fn linear_bits(map: &DMat3) -> LinearBits {
    map.to_cols_array().map(f64::to_bits)
}

/// A mesh in render space.
#[derive(Clone)]
pub struct Baked {
    pub mesh: Arc<Mesh>,
    /// Its area in double precision, computed on first use.
    pub area: Arc<OnceLock<f64>>,
}

/// A mesh for any placement, and its mirror image for placements that mirror. Both lie in the unit ball, where single
/// precision is finest.
pub struct Shared {
    pub decoded: Arc<Decoded>,
    pub flip: bool,
    /// Smooth normals in its own space; empty when the file's are used.
    pub smooth: Vec<DVec3>,
    pub normals: Normals,
    pub unit_from_raw: DAffine3,
    /// As it is, and mirrored.
    pub meshes: [OnceLock<Arc<Mesh>>; 2],
}

/// The contents of a glTF file.
pub struct KeptPiece {
    pub text: String,
    pub meshes: BTreeMap<String, Arc<Decoded>>,
    pub images: BTreeMap<String, Arc<Image>>,
    /// What is ignored or interpreted differently.
    pub notes: Vec<String>,
    /// The files next to it that were read, by key.
    pub beside: Vec<(String, Content)>,
    /// Whether it changes with time.
    pub moves: bool,
}

/// Meshes by the material name in their file.
pub type MaterialParts = Vec<(Option<String>, Arc<Decoded>)>;
/// A file's content, its extension, the index of the mesh, and whether vertex colours are read.
pub type MeshKey = (Content, String, u32, bool);
/// A file's content, what its numbers mean, and its layer.
pub type ImageKey = (Content, Encoding, Option<String>);
/// An emitting image, the bits of its scale, and those of its rotation.
type ImageLight = (Pinned<Image>, [u32; 3], [u32; 9]);
/// Where a glTF file is placed, and its time, if it moves.
pub type PlaceBits = (MapBits, Option<u64>);
/// A glTF file's path and content, and what is taken from it.
type PieceKey = (String, Content, Choice);

/// Everything that is kept. A clone shares the things.
#[derive(Clone)]
pub struct Kept {
    pub clock: Clock,
    pub images: Shelf<ImageKey, Arc<Picture>>,
    /// Images whose pixels all lie within a range, by the range's description.
    pub in_range: Shelf<(Pinned<Image>, &'static str), ()>,
    /// One channel of an image, as grey.
    pub channels: Shelf<(Pinned<Image>, Channel), Arc<Image>>,
    /// The sky and suns.
    pub environments: Shelf<ImageLight, Vec<Environment>>,
    pub meshes: Shelf<MeshKey, Arc<Decoded>>,
    /// Displaced meshes, by all the settings that shape them.
    pub displaced: Shelf<(Pinned<Decoded>, String), (Arc<Decoded>, bool)>,
    /// By the file's content and extension, the curve's basis, and the radius of points that have none.
    pub strands: Shelf<(Content, String, Basis, Option<u32>), Arc<Strands>>,
    /// By the file's content, extension and grid.
    pub densities: Shelf<(Content, String, Option<String>), Arc<Bricks>>,
    /// The same key; one channel or three.
    pub albedos: Shelf<(Content, String, Option<String>), Arc<Vec<Bricks>>>,
    /// By all the numbers of a recipe.
    pub recipes: Shelf<String, Arc<Bricks>>,
    /// Graphs over directions baked to images, by their printed form.
    pub skies: Shelf<String, Arc<Image>>,
    /// The last medium made with a density.
    pub media: Shelf<Pinned<Bricks>, Heterogeneous>,
    pub coats: Shelf<(bool, [u32; 2], bool), RoughCoat>,
    pub baked: Shelf<(Pinned<Decoded>, MapBits, bool, Normals), Baked>,
    pub shared: Shelf<(Pinned<Decoded>, bool, Normals, LinearBits), Arc<Shared>>,
    /// Parts of meshes by material, with their normals.
    pub parts: Shelf<(Pinned<Decoded>, Option<LinearBits>), Arc<MaterialParts>>,
    /// Images times a factor.
    pub tinted: Shelf<(Pinned<Image>, [u64; 3]), Arc<Image>>,
    /// With where and when the file was placed.
    pub pieces: Shelf<PieceKey, (PlaceBits, Arc<KeptPiece>)>,
    /// By the file's content, the camera's name, and where and when the file is placed.
    pub cameras: Shelf<(Content, Option<String>, PlaceBits), String>,
    pub rectangle: Arc<Decoded>,
    pub cube: Arc<Decoded>,
}

impl Default for Kept {
    fn default() -> Self {
        Self {
            clock: Clock {
                purpose: Purpose::Exact,
                scenes: [0; 2],
            },
            images: Shelf::default(),
            in_range: Shelf::default(),
            channels: Shelf::default(),
            environments: Shelf::default(),
            meshes: Shelf::default(),
            displaced: Shelf::default(),
            strands: Shelf::default(),
            densities: Shelf::default(),
            albedos: Shelf::default(),
            recipes: Shelf::default(),
            skies: Shelf::default(),
            media: Shelf::default(),
            coats: Shelf::default(),
            baked: Shelf::default(),
            shared: Shelf::default(),
            parts: Shelf::default(),
            tinted: Shelf::default(),
            pieces: Shelf::default(),
            cameras: Shelf::default(),
            rectangle: Arc::new(Decoded::new(RawMesh::rectangle())),
            cube: Arc::new(Decoded::new(RawMesh::cube())),
        }
    }
}

impl Kept {
    /// Begin another scene.
    pub fn begin(&mut self, purpose: Purpose) {
        self.clock.purpose = purpose;
        self.clock.scenes[purpose as usize] += 1;
    }

    /// The scene failed: it says nothing about what is still needed.
    pub fn forget(&mut self) {
        self.clock.scenes[self.clock.purpose as usize] -= 1;
    }

    /// The scene is made: drop what the last few scenes did not use.
    pub fn tidy(&mut self) {
        let clock = &self.clock;
        self.images.tidy(clock);
        self.in_range.tidy(clock);
        self.channels.tidy(clock);
        self.environments.tidy(clock);
        self.meshes.tidy(clock);
        self.displaced.tidy(clock);
        self.strands.tidy(clock);
        self.densities.tidy(clock);
        self.albedos.tidy(clock);
        self.recipes.tidy(clock);
        self.skies.tidy(clock);
        self.media.tidy(clock);
        self.coats.tidy(clock);
        self.baked.tidy(clock);
        self.shared.tidy(clock);
        self.parts.tidy(clock);
        self.tinted.tidy(clock);
        self.pieces.tidy(clock);
        self.cameras.tidy(clock);
    }

    pub fn coat(&mut self, distribution: Distribution, alpha: f32, eta: f32, nonlinear: bool) -> RoughCoat {
        let key = (
            distribution == Distribution::Ggx,
            [alpha, eta].map(f32::to_bits),
            nonlinear,
        );
        let make = || RoughCoat::new(distribution, alpha, eta, nonlinear);
        self.coats.get_or_make(&self.clock, key, make)
    }

    /// An image's light from infinitely far away, unless it is `too_bright`.
    pub fn environment<E>(
        &mut self,
        image: &Arc<Image>,
        scale: Rgb,
        render_from_env: Mat3,
        too_bright: impl FnOnce() -> E,
    ) -> Result<Vec<Environment>, E> {
        let bits = render_from_env.to_cols_array().map(f32::to_bits);
        let key = (Pinned(image.clone()), scale.to_array().map(f32::to_bits), bits);
        self.environments.get_or(&self.clock, key, || {
            let brightest = image.pixels.iter().fold(Rgb::ZERO, |a, b| a.max(*b)) * scale;
            match brightest.is_finite() {
                true => Ok(Environment::sky_and_suns(image, scale, render_from_env)),
                false => Err(too_bright()),
            }
        })
    }
}
