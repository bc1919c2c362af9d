//! A scene in the kernels' layout: buffers made from the renderer's own world.

pub mod aims;
pub mod camera;
pub mod choice;
pub mod geometry;
pub mod lights;
pub mod materials;
pub mod media;
pub mod reason;
pub(crate) mod rules;
pub mod shapes;
pub mod textures;
mod used;
mod volumes;
pub mod waves;

use crate::device::{Buffer, Device, Kind};
use crate::error;
use crate::kernels::Needs;
use aims::{AimBuffers, FlatAims};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::{self, BsdfFlags};
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::medium::MediumId;
use beamfarm_render::world::nested::Met;
use bytemuck::{Pod, Zeroable};
use camera::Camera;
use choice::{ChoiceBuffers, LightChoices};
use geometry::{FlatGeometry, GeometryBuffers};
use lights::{Emitter, Light, Lights};
use materials::FlatMaterials;
use media::Medium;
use reason::{Of, Reason, Why};
use rules::FlatRules;
use shapes::{FlatShapes, ShapeBuffers};
use textures::TextureBuffers;

/// Stands for no light, and for a boundary that changes no medium.
pub const NONE: u32 = u32::MAX;
/// Stands for vacuum.
pub const VACUUM: u32 = u32::MAX - 1;
/// The class of pure boundaries of media.
pub const NULL_BOUNDARIES: u32 = 1;
/// The class of all other objects.
pub const VISIBLE: u32 = 2;
/// The class of objects that do not bound kernels: light may pass them, or photons pass them by rule.
pub const NO_WALLS: u32 = 4;
/// The class of those among them with the same medium on both sides.
pub const CLEAR: u32 = 8;

/// The class of objects that rays may go straight through.
pub const PASSABLE: u32 = 16;
/// The class of all other objects.
pub const OPAQUE: u32 = 32;
/// The class of objects that light may pass.
pub const TRANSMITTING: u32 = 64;

/// An object's material, light, and media on its sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Surface {
    /// Number of its material.
    pub material: u32,
    /// Number of its light, or [`NONE`].
    pub light: u32,
    /// Number of the medium on the side that the geometric normal points away from, [`VACUUM`], or [`NONE`]: the
    /// surrounding one.
    pub interior: u32,
    /// The same for the other side.
    pub exterior: u32,
    /// What rays that it reflects do not see, as class bits of objects and lights.
    pub reflected: u32,
    /// The same for rays that it refracts.
    pub refracted: u32,
    /// The same for shadow rays.
    pub shadow: u32,
    /// The lights that illuminate it at a path's first vertex: the number of their running sums.
    pub lit_by: u32,
    /// 1: shadow rays and surface rays see the same; 2: path rays that start at it find light of other surfaces; 4:
    /// path rays that reach it find its light; 8: rules for reflected and refracted rays govern its gloss.
    pub bits: u32,
    /// What photons that it scatters do not see, as class bits, and the lights whose photons do not light it.
    pub photon: u32,
}

/// A whole scene.
#[derive(Debug)]
pub struct FlatWorld {
    /// The camera.
    pub camera: Camera,
    /// The geometry for rays. Pure boundaries are in class [`NULL_BOUNDARIES`], all else in [`VISIBLE`]; objects that
    /// are no walls are in [`NO_WALLS`], and also in [`CLEAR`] if they bound no medium.
    pub geometry: FlatGeometry,
    /// Data of points that rays meet.
    pub shapes: FlatShapes,
    /// By object number.
    pub surfaces: Vec<Surface>,
    /// By number, as are lights and media.
    pub materials: FlatMaterials,
    /// Lights.
    pub lights: Vec<Light>,
    /// Triangles of emitting surfaces.
    pub emitters: Vec<Emitter>,
    /// Data for choosing lights.
    pub choices: LightChoices,
    /// Media.
    pub media: Vec<Medium>,
    /// Words of varying densities; by medium their offset or 0: see `kernels/volumes.wgsl`.
    pub volumes: Vec<u32>,
    /// Number of the medium outside of every object, or [`VACUUM`].
    pub world_medium: u32,
    /// Photon targets of a plan.
    pub aims: FlatAims,
    /// Whether light groups have layers in a plan.
    pub light_groups: bool,
}

impl FlatWorld {
    /// Lays out a scene for a device whose largest buffer has this many bytes.
    ///
    /// # Errors
    /// All reasons why it does not fit.
    pub fn new(scene: &Scene, largest: u64) -> Result<Self, Vec<Reason>> {
        let description = scene.description();
        let mut reasons = rules::reasons(scene);
        let rules = FlatRules::new(scene);
        let (_, lit_by) = rules::selectors(scene);
        meetings(scene, &mut reasons);
        let camera = camera::flatten(scene, &mut reasons);
        reasons.extend(materials::reasons(description));
        reasons.extend(waves::reasons(description));
        let media = media::flatten(description);
        let volumes = volumes::flatten(&description.media, &media::used(description), largest, &mut reasons);
        let Lights {
            lights,
            emitters,
            tables,
        } = lights::flatten(scene, choice::sums(scene), &mut reasons);
        for (field, bytes) in [
            ("triangles that emit", size_of_val(&*emitters)),
            ("tables of lights", size_of_val(&*tables)),
        ] {
            let bytes = bytes as u64;
            if bytes > largest {
                reasons.push(Reason {
                    of: Of::Scene,
                    field,
                    why: Why::Large { bytes, most: largest },
                });
            }
        }
        let objects = &description.objects;
        let class = |object: u32| {
            let is_passed = (description.rules.as_ref()).is_some_and(|rules| !rules.all_photons_see(object));
            let of_rules = rules.of_object(object).class;
            classes(&description.materials, &objects[object as usize], is_passed) | of_rules
        };
        reasons.extend(shapes::reasons(objects, largest));
        reasons.extend(textures::reasons(
            materials::all_looked_up(description),
            &description.lights,
            [shapes::colors(objects), shapes::tangents(objects)],
            largest,
        ));
        let geometry = match FlatGeometry::new(scene.geometry(), objects, &class, largest) {
            Ok(geometry) if reasons.is_empty() => geometry,
            Ok(_) => return Err(reasons),
            Err(more) => {
                reasons.extend(more);
                return Err(reasons);
            }
        };
        let surface = |((number, object), lit_by): ((u32, &Object), &u32)| {
            let own = rules.of_object(number);
            Surface {
                material: object.material,
                light: object.light.unwrap_or(NONE),
                interior: object.boundary.map_or(NONE, |b| medium(b.interior)),
                exterior: object.boundary.map_or(NONE, |b| medium(b.exterior)),
                reflected: own.reflected,
                refracted: own.refracted,
                shadow: own.shadow,
                lit_by: *lit_by,
                bits: own.bits(),
                photon: own.photon,
            }
        };
        let mut shapes = FlatShapes::new(scene);
        let mut materials = FlatMaterials::new(description);
        if materials.textures.reads_colors() {
            shapes.add_colors(objects, &mut materials.textures.texels);
        }
        shapes.add_tangents(objects, &mut materials.textures.texels);
        Ok(Self {
            camera,
            geometry,
            shapes,
            materials,
            surfaces: (0..).zip(objects).zip(&lit_by).map(surface).collect(),
            choices: LightChoices::new(scene, &rules, &lights, tables),
            lights,
            emitters,
            media,
            volumes,
            world_medium: medium(description.world_medium),
            aims: FlatAims::default(),
            light_groups: false,
        })
    }

    /// Adds the requirements of a plan of the scene.
    #[must_use]
    pub fn planned_by(mut self, scene: &Scene, plan: &RenderPlan) -> Self {
        self.aims = FlatAims::new(scene, plan, &mut self.geometry);
        self.light_groups = plan.layers.groups() > 0;
        self
    }
}

/// A scene on a device, as `kernels/world.wgsl` reads it. Each kernel gets the buffers that it uses.
pub struct WorldBuffers {
    /// Bindings 20 to 24.
    pub geometry: GeometryBuffers,
    /// Binding 25.
    pub surfaces: Buffer,
    /// Binding 26.
    pub materials: Buffer,
    /// Binding 27.
    pub lights: Buffer,
    /// Binding 28.
    pub emitters: Buffer,
    /// Binding 29.
    pub media: Buffer,
    /// Binding 55: a placeholder if no density varies.
    pub volumes: Buffer,
    /// Binding 30.
    pub camera: Buffer,
    /// Bindings 31 to 33.
    pub choices: ChoiceBuffers,
    /// Bindings 35 to 37.
    pub shapes: ShapeBuffers,
    /// Bindings 38 and 39.
    pub textures: TextureBuffers,
    /// Bindings 60 and 61, if photons are aimed.
    pub aims: Option<AimBuffers>,
    /// The needs of the kernel that starts photons; other kernels with rays use those of the geometry.
    pub needs_of_starts: Needs,
}

impl WorldBuffers {
    /// All buffers with their names in kernels.
    pub(crate) fn named(&self) -> impl Iterator<Item = (&'static str, &Buffer)> {
        let WorldBuffers {
            geometry,
            surfaces,
            materials,
            lights,
            emitters,
            media,
            volumes,
            camera,
            choices,
            shapes,
            textures,
            aims,
            needs_of_starts: _,
        } = self;
        let aims = (aims.iter()).flat_map(|all| [("aims", &all.aims), ("aim_discs", &all.discs)]);
        let [nodes, fours, turned_nodes, sliver_trees, objects] = geometry.in_order();
        [
            ("nodes", nodes),
            ("fours", fours),
            ("turned_nodes", turned_nodes),
            ("sliver_trees", sliver_trees),
            ("objects", objects),
            ("surfaces", surfaces),
            ("materials", materials),
            ("lights", lights),
            ("emitters", emitters),
            ("media", media),
            ("volumes", volumes),
            ("camera", camera),
            ("light_sources", &choices.sources),
            ("light_tables", &choices.tables),
            ("lighting", &choices.lighting),
            ("placed_shapes", &shapes.shapes),
            ("vertices", &shapes.vertices),
            ("mesh_triangles", &shapes.triangles),
            ("textures", &textures.textures),
            ("texels", &textures.texels),
        ]
        .into_iter()
        .chain(aims)
    }
}

impl WorldBuffers {
    /// Makes kernels' stacks at least this deep, so that existing kernels serve more scenes.
    pub(crate) fn with_stacks_of(&mut self, [rays, starts]: [Needs; 2]) {
        for (needs, other) in [(&mut self.geometry.needs, rays), (&mut self.needs_of_starts, starts)] {
            needs.stack = needs.stack.max(other.stack);
        }
    }
}

impl FlatWorld {
    /// Bytes on a device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let own = size_of_val(&*self.surfaces)
            + size_of_val(&*self.materials.records)
            + size_of_val(&*self.lights)
            + size_of_val(&*self.emitters)
            + size_of_val(&*self.media)
            + size_of_val(&*self.volumes);
        let shapes = size_of_val(&*self.shapes.shapes)
            + size_of_val(&*self.shapes.vertices)
            + size_of_val(&*self.shapes.triangles);
        let textures = size_of_val(&*self.materials.textures.textures) + size_of_val(&*self.materials.textures.texels);
        let choices = size_of_val(&*self.choices.sources) + size_of_val(&*self.choices.tables);
        let aims = size_of_val(&*self.aims.aims) + size_of_val(&*self.aims.discs);
        self.geometry.sizes.bytes() + (own + shapes + textures + choices + aims) as u64
    }

    /// Whether some medium's density varies.
    #[must_use]
    pub fn varies(&self) -> bool {
        self.volumes.len() > self.media.len()
    }

    /// Uploads it to a device.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device) -> error::Result<WorldBuffers> {
        self.revise(device, None)
    }

    /// The same, given another scene there: equal data is not uploaded again.
    ///
    /// # Errors
    /// Device errors.
    pub fn revise(&self, device: &Device, there: Option<(&Self, &WorldBuffers)>) -> error::Result<WorldBuffers> {
        let mut geometry = self
            .geometry
            .upload(device, there.map(|(flat, on)| (&flat.geometry, &on.geometry)))?;
        macro_rules! known {
            ($list:ident) => {
                there.map(|(flat, on)| (&flat.$list[..], &on.$list))
            };
        }
        let needs = &mut geometry.needs;
        needs.surfaces = self.materials.needs();
        if device.listed().kind == Kind::Software {
            // Compilers are slow: few kernels have to serve all scenes.
            needs.surfaces = materials::class_of_needs(needs.surfaces);
            needs.stack = needs.stack.max(Needs::ALL.stack);
        }
        geometry.needs.varies = self.varies();
        geometry.needs.disperses = !self.materials.rows.is_empty();
        geometry.needs.light_groups = self.light_groups;
        Ok(WorldBuffers {
            needs_of_starts: self.aims.needs(geometry.needs),
            aims: self.aims.upload(device)?,
            geometry,
            surfaces: list(device, "surfaces", &self.surfaces, known!(surfaces))?,
            materials: list(
                device,
                "materials",
                &self.materials.records,
                there.map(|(flat, on)| (&flat.materials.records[..], &on.materials)),
            )?,
            lights: list(device, "lights", &self.lights, known!(lights))?,
            emitters: list(device, "triangles that emit", &self.emitters, known!(emitters))?,
            media: list(device, "media", &self.media, known!(media))?,
            volumes: match self.varies() {
                true => list(device, "densities", &self.volumes, known!(volumes))?,
                false => device.buffer("densities", &[0_u32])?,
            },
            camera: device.buffer("camera", &[self.camera])?,
            choices: self
                .choices
                .upload(device, there.map(|(flat, on)| (&flat.choices, &on.choices)))?,
            shapes: self
                .shapes
                .upload(device, there.map(|(flat, on)| (&flat.shapes, &on.shapes)))?,
            textures: self
                .materials
                .textures
                .upload(device, there.map(|(flat, on)| (&flat.materials.textures, &on.textures)))?,
        })
    }
}

/// The classes of an object, without those of rules. `is_passed`: some photons pass it by rule.
fn classes(materials: &[bsdf::Material], object: &Object, is_passed: bool) -> u32 {
    let material = &materials[object.material as usize];
    let transmits = material.has(BsdfFlags::TRANSMITS);
    let bounds_nothing = object.boundary.is_none_or(|b| b.interior == b.exterior);
    let all = [
        (NULL_BOUNDARIES, material.is_null()),
        (VISIBLE, !material.is_null()),
        (NO_WALLS, transmits || is_passed),
        (CLEAR, transmits && bounds_nothing),
        (PASSABLE, material.has(BsdfFlags::PASSABLE)),
        (OPAQUE, !material.has(BsdfFlags::PASSABLE)),
        (TRANSMITTING, transmits),
    ];
    all.into_iter().filter(|(_, is)| *is).map(|(class, _)| class).sum()
}

/// A list as a buffer, with an unused element if it is empty. `there`: another list and its buffer, which is reused if
/// both lists are equal.
fn list<T: Pod>(device: &Device, name: &str, all: &[T], there: Option<(&[T], &Buffer)>) -> error::Result<Buffer> {
    let bytes = bytemuck::cast_slice::<T, u8>;
    if let Some((_, buffer)) = there.filter(|(other, _)| bytes(other) == bytes(all)) {
        return Ok(buffer.clone());
    }
    match all {
        [] => device.buffer(name, &[T::zeroed()]),
        all => device.buffer(name, all),
    }
}

fn medium(id: MediumId) -> u32 {
    id.map_or(VACUUM, u32::from)
}

/// Reasons from objects that overlap or touch.
fn meetings(scene: &Scene, reasons: &mut Vec<Reason>) {
    let name = |object: u32| scene.description().objects[object as usize].name.clone();
    for Met {
        pair: [first, second],
        meeting: _,
        outcome: _,
    } in scene.meeting_solids()
    {
        reasons.push(Reason {
            of: Of::Object(name(*first)),
            field: "shape",
            why: Why::Meets { other: name(*second) },
        });
    }
    if scene.meets_too_many() {
        reasons.push(Reason {
            of: Of::Scene,
            field: "shapes",
            why: Why::Missing("way to tell what is where so many reach into each other"),
        });
    }
}

#[cfg(test)]
pub(crate) mod tests;
