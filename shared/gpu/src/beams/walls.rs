//! The surroundings of each beam, as planes in front of walls: see [`beamfarm_render::cpu::beam::walls`].

use crate::device::{Buffer, Device, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::WALLS;
use crate::scan::Scan;
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::world::geometry::GeometryBuffers;
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::Shape;
use bytemuck::{Pod, Zeroable};

/// Most planes of a beam: ten, and three of crowds.
const MOST_PLANES: u64 = 13;

/// A plane in which a wall near a beam lies, or behind which it lies; the beam is in front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Plane {
    /// Unit normal, towards the beam; zero if no plane separates walls from the beam.
    pub n: [f32; 3],
    /// Dot product of the normal and any point of the plane.
    pub at: f32,
    /// Range along the beam in which the kernel reaches behind the plane.
    pub range: [f32; 2],
    /// For a crowd: squared distance from the beam's line within which there is no wall; otherwise zero.
    pub clear2: f32,
    /// 1 if all of a closed scene lies in front of it, else 0.
    pub is_outer: u32,
}

/// Object data that the search for walls needs in addition to that for rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WallShape {
    /// Column of the map from object space to render space.
    pub x_axis: [f32; 3],
    /// Largest stretch of the inverse map.
    pub scale: f32,
    /// Column of the map.
    pub y_axis: [f32; 3],
    /// Padding.
    pub spare_y: u32,
    /// Column of the map.
    pub z_axis: [f32; 3],
    /// Padding.
    pub spare_z: u32,
    /// Column of the map.
    pub translation: [f32; 3],
    /// Padding.
    pub spare_translation: u32,
    /// Centre of its box, render space.
    pub middle: [f32; 3],
    /// Padding.
    pub spare_middle: u32,
}

/// The scene's bounding box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hull {
    /// Its lowest corner.
    pub low: [f32; 3],
    /// 1 if camera paths seem never to leave it, else 0.
    pub is_closed: u32,
    /// Its highest corner.
    pub high: [f32; 3],
    /// Padding.
    pub spare: u32,
}

/// The wall data of a scene beyond that for rays, for which walls are objects without
/// [`NO_WALLS`](crate::world::NO_WALLS).
#[derive(Debug)]
pub struct FlatWalls {
    /// By object number.
    pub shapes: Vec<WallShape>,
    /// Bounding box of the scene.
    pub hull: Hull,
}

impl FlatWalls {
    /// The walls of a scene, if it has any.
    #[must_use]
    pub fn new(scene: &Scene) -> Option<Self> {
        let objects = &scene.description().objects;
        if !(0..objects.len() as u32).any(|object| scene.is_wall(object)) {
            return None;
        }
        let shape = |(number, shape): (u32, &Shape)| {
            let (Shape::Mesh { placement, .. }
            | Shape::Sphere { placement, .. }
            | Shape::Disc { placement, .. }
            | Shape::Cylinder { placement, .. }
            | Shape::Strands { placement, .. }) = shape;
            let map = &placement.render_from_object;
            let [low, high] = scene.box_of(number);
            WallShape {
                x_axis: map.matrix3.x_axis.to_array(),
                scale: placement.most_stretched(),
                y_axis: map.matrix3.y_axis.to_array(),
                z_axis: map.matrix3.z_axis.to_array(),
                translation: map.translation.to_array(),
                middle: (0.5 * (low + high)).to_array(),
                ..WallShape::default()
            }
        };
        let [low, high] = scene.hull();
        Some(Self {
            shapes: (0..)
                .zip(objects.iter().map(|object| &object.shape))
                .map(shape)
                .collect(),
            hull: Hull {
                low: low.to_array(),
                is_closed: scene.is_closed().into(),
                high: high.to_array(),
                spare: 0,
            },
        })
    }

    /// Uploads them to a device.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device) -> Result<WallBuffers> {
        Ok(WallBuffers {
            shapes: device.buffer("walls", &self.shapes)?,
            hull: device.buffer("box around the scene", &[self.hull])?,
        })
    }
}

/// Walls on a device.
pub struct WallBuffers {
    /// Binding 50.
    pub shapes: Buffer,
    /// Binding 51.
    pub hull: Buffer,
}

/// Finds the walls near beams, which are counted on the device.
pub struct Walls {
    threads: Sizing,
    count: Kernel,
    write: Kernel,
    scan: Scan,
    counts: Buffer,
    planes: Buffer,
}

impl Walls {
    /// For at most this many beams, in a scene with this geometry. There is room for all planes in any case.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, geometry: &GeometryBuffers, most_beams: u32) -> Result<Self> {
        let on = on.into();
        let most = u64::from(most_beams);
        Ok(Self {
            threads: Sizing::new(on, "threads")?,
            count: geometry.kernel(&on, &WALLS, "count_planes"),
            write: geometry.kernel(&on, &WALLS, "write_planes"),
            scan: Scan::new(on, most_beams)?,
            counts: on.empty("planes of beams", 4 * most)?,
            planes: on.empty("planes near beams", size_of::<Plane>() as u64 * MOST_PLANES * most)?,
        })
    }

    /// Finds the planes of [`Beam`](super::Beam)s, counted in a word, each with its [`BeamEnds`](super::BeamEnds), and
    /// stores each beam's range of planes in it.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, of: &Near, count: &Buffer, [beams, ends]: [&Buffer; 2]) -> Result<()> {
        self.threads.run(work, count)?;
        let sizes = &self.threads.sizes;
        let (counts, groups) = (&self.counts, Groups::From(sizes));
        let Near { geometry, walls } = of;
        let geometry = geometry.in_order();
        let buffers = [&[sizes, beams, ends, counts][..], &geometry, &[&walls.shapes]].concat();
        work.run(&self.count, &buffers, groups)?;
        self.scan.run(work, count, counts)?;
        let buffers = [
            &[sizes, beams, ends, counts, &self.planes][..],
            &geometry,
            &[&walls.shapes, &walls.hull],
        ]
        .concat();
        work.run(&self.write, &buffers, groups)?;
        Ok(())
    }

    /// The number of planes, in its first word.
    #[must_use]
    pub fn count(&self) -> &Buffer {
        self.scan.total()
    }

    /// All [`Plane`]s; those of a beam are in the processor's order.
    #[must_use]
    pub fn planes(&self) -> &Buffer {
        &self.planes
    }
}

/// The possible walls near beams, in buffers.
#[derive(Clone, Copy)]
pub struct Near<'a> {
    /// The geometry for rays.
    pub geometry: &'a GeometryBuffers,
    /// Its wall data.
    pub walls: &'a WallBuffers,
}
