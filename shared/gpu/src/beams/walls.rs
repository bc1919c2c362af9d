//! What stands near each beam, as planes that walls are behind: see [`beamfarm_render::cpu::beam::walls`].

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

/// The most planes of a beam: ten, and three of crowds.
const MOST_PLANES: u64 = 13;

/// A plane that a wall near a beam lies in or behind; the beam is before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Plane {
    /// Unit normal, towards the beam; zero where no plane tells what is behind walls.
    pub n: [f32; 3],
    /// Product of the normal and any point of the plane.
    pub at: f32,
    /// Where along the beam the kernel reaches behind it.
    pub range: [f32; 2],
    /// Of a crowd: square of the distance from the beam's line within which no wall is; else zero.
    pub clear2: f32,
    /// 1 where all of a closed scene is before it, else 0.
    pub is_outer: u32,
}

/// What the search for walls needs to know of an object, and rays do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WallShape {
    /// Of the map from its own space to render space, by columns.
    pub x_axis: [f32; 3],
    /// By how much the way back makes anything longer at most.
    pub scale: f32,
    /// Of the map.
    pub y_axis: [f32; 3],
    /// Nothing.
    pub spare_y: u32,
    /// Of the map.
    pub z_axis: [f32; 3],
    /// Nothing.
    pub spare_z: u32,
    /// Of the map.
    pub translation: [f32; 3],
    /// Nothing.
    pub spare_translation: u32,
    /// The middle of its box, render space.
    pub middle: [f32; 3],
    /// Nothing.
    pub spare_middle: u32,
}

/// The box around everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hull {
    /// Its lowest corner.
    pub low: [f32; 3],
    /// 1 where camera paths seem never to leave it, else 0.
    pub is_closed: u32,
    /// Its highest corner.
    pub high: [f32; 3],
    /// Nothing.
    pub spare: u32,
}

/// The walls of a scene, as far as rays do not know them: those see walls by
/// [`NO_WALLS`](crate::world::NO_WALLS).
#[derive(Debug)]
pub struct FlatWalls {
    /// By an object's number.
    pub shapes: Vec<WallShape>,
    /// Around them and all else.
    pub hull: Hull,
}

impl FlatWalls {
    /// Those of a scene, if it has any.
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

    /// Bring them to a device.
    ///
    /// # Errors
    /// The device's.
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

/// Finds the walls near beams, as many as are counted on the device.
pub struct Walls {
    threads: Sizing,
    count: Kernel,
    write: Kernel,
    scan: Scan,
    counts: Buffer,
    planes: Buffer,
}

impl Walls {
    /// For so many beams at most, in a scene of this geometry. Whatever stands near them, their planes have room.
    ///
    /// # Errors
    /// The device's.
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

    /// Find the planes of [`Beam`](super::Beam)s, as many as are counted in a word, each with its
    /// [`BeamEnds`](super::BeamEnds), and tell the beams which are theirs.
    ///
    /// # Errors
    /// The device's.
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

    /// How many planes there are, in its first word.
    #[must_use]
    pub fn count(&self) -> &Buffer {
        self.scan.total()
    }

    /// All [`Plane`]s, those of a beam in the processor's order.
    #[must_use]
    pub fn planes(&self) -> &Buffer {
        &self.planes
    }
}

/// What may stand near beams, in buffers.
#[derive(Clone, Copy)]
pub struct Near<'a> {
    /// What rays meet.
    pub geometry: &'a GeometryBuffers,
    /// Which of it are walls.
    pub walls: &'a WallBuffers,
}
