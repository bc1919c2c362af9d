//! Shapes.

use super::schema::by_type;
use super::texture::TextureRecord;
use super::transform::Steps;
use super::words::RayType;
use super::{Fault, given, only_takes};
use crate::values::*;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// A surface.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = ShapeType::narrow)]
pub struct ShapeRecord {
    /// Name for messages, and for the layer of an emitting shape.
    pub name: Option<String>,
    /// Kind of shape.
    #[serde(rename = "type")]
    pub kind: Spanned<ShapeType>,
    /// Centre of the sphere. Default: [0, 0, 0].
    pub center: Option<Spanned<Vector>>,
    /// One end of the axis. Default: [0, 0, 0].
    pub p0: Option<Spanned<Vector>>,
    /// The other end of the axis. Default: [0, 0, 1].
    pub p1: Option<Spanned<Vector>>,
    /// Radius, scene units. Default: 1. For curves and points: used where the file has none.
    pub radius: Option<Spanned<Number<Positive>>>,
    /// .ply, .obj or Mitsuba's .serialized; curves and points: .ply or .txt. Relative to the scene file.
    pub file: Option<Spanned<String>>,
    /// Rows [x, y, z, radius] instead of a file: points, or the control points of one curve.
    pub points: Option<Spanned<Vec<[Number<Finite>; 4]>>>,
    /// Interpolation between the control points of curves. Default: b_spline.
    pub basis: Option<Spanned<BasisName>>,
    /// Another mesh with the same triangles, towards which this one is interpolated.
    pub toward: Option<Spanned<TowardRecord>>,
    /// Heights that displace the surface.
    pub displacement: Option<Spanned<DisplacementRecord>>,
    /// Which mesh of a .serialized file, from zero. Default: 0.
    pub shape_index: Option<Spanned<u32>>,
    /// Ignore the file's normals. Default: false.
    pub face_normals: Option<Spanned<bool>>,
    /// Compute smooth normals if the file has none. Default: false.
    pub smooth: Option<Spanned<bool>>,
    /// Swap outside and inside. Default: false.
    pub flip_normals: Option<Spanned<bool>>,
    /// Name of a material. Default: grey; black for emitting shapes.
    pub material: Option<Spanned<String>>,
    /// Read the materials that an .obj file names from its .mtl files. Default: false, with a note if it has any.
    pub mtl: Option<Spanned<bool>>,
    /// Medium inside. Default: none.
    pub interior: Option<Spanned<String>>,
    /// Medium outside. Default: the world's.
    pub exterior: Option<Spanned<String>>,
    /// False: transmitted light stays in its medium. Default: true.
    pub boundary: Option<Spanned<bool>>,
    /// Where shapes overlap or touch, the highest priority counts. Default: 0; among equals, a shape without a medium
    /// inside, else the higher index of refraction; media without a surface add up.
    pub priority: Option<Spanned<i32>>,
    /// Allow an open shape to bound a medium: each crossing decides. Default: false.
    pub open: Option<Spanned<bool>>,
    /// Light emitted on the outside.
    pub emission: Option<Spanned<EmissionRecord>>,
    /// Placement in the world.
    pub transform: Option<Spanned<Steps>>,
    /// The space that graphs of its material read. Default: from its transform and bounding box.
    pub space: Option<Spanned<SpaceRecord>>,
    /// The shape to copy.
    pub shape: Option<Spanned<Box<ShapeRecord>>>,
    /// One transform per copy.
    pub transforms: Option<Spanned<Vec<Spanned<Steps>>>>,
    /// Ray types that see the shape. Default: all.
    pub visible: Option<Spanned<Vec<RayType>>>,
}

/// The space of a shape's points, for the coordinates that graphs read.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpaceRecord {
    /// From world space to the object's own space: four rows of four numbers. Default: the inverse of `transform`.
    pub matrix: Option<Vec<Vec<Number<Finite>>>>,
    /// Lowest and highest corner in the object's own space, which define "generated" coordinates. Default: the shape's.
    #[serde(rename = "box")]
    pub bounds: Option<[Vector; 2]>,
    /// The object's random number, 0 to 1.
    pub random: Option<Number<Unit>>,
    /// The object's index. Default: 0.
    pub index: Option<Number<Finite>>,
    /// The object's location. Default: the origin of its own space.
    pub location: Option<Vector>,
}

impl ShapeRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let common = match self.kind.get_ref() {
            ShapeType::Instances => &[],
            kind => kind.common(),
        };
        #[rustfmt::skip]
        let given = given!(self, center, p0, p1, radius, file, points, basis, toward, displacement, shape_index, face_normals, smooth, mtl, flip_normals, material, interior,
            exterior, boundary, priority, open, emission, transform, space, shape, transforms);
        only_takes(name, takes, common, &given)?;
        if let (Some(faces), Some(smooth)) = (&self.face_normals, &self.smooth)
            && *faces.get_ref()
            && *smooth.get_ref()
        {
            let message = "normals are those of faces (`face_normals`) or smooth (`smooth`): one of the two";
            return Err(Fault::new(smooth.span(), message));
        }
        self.check_mtl()?;
        match &self.shape {
            Some(shape) if shape.get_ref().kind.get_ref() == &ShapeType::Instances => Err(Fault::new(
                shape.get_ref().kind.span(),
                "instances of instances are not supported; expected the type of one shape",
            )),
            Some(shape) => match &shape.get_ref().visible {
                Some(visible) => Err(Fault::new(
                    visible.span(),
                    "this field belongs to the instances, not to their shape",
                )),
                None => match &shape.get_ref().mtl {
                    Some(mtl) if *mtl.get_ref() => {
                        let message = "instances are of one material; expected `material` in place of `mtl`";
                        Err(Fault::new(mtl.span(), message))
                    }
                    _ => shape.get_ref().check(),
                },
            },
            None => Ok(()),
        }
    }

    /// Whether it takes its materials from .mtl files.
    pub fn reads_mtl(&self) -> bool {
        self.mtl.as_ref().is_some_and(|mtl| *mtl.get_ref())
    }

    fn check_mtl(&self) -> Result<(), Fault> {
        let Some(mtl) = self.mtl.as_ref().filter(|mtl| *mtl.get_ref()) else {
            return Ok(());
        };
        if let Some(displacement) = &self.displacement {
            let message = "what is displaced is of one material; expected no `mtl` beside it";
            return Err(Fault::new(displacement.span(), message));
        }
        let name = self.file.as_ref().map_or("", |file| file.get_ref());
        if !name.to_ascii_lowercase().ends_with(".obj") {
            return Err(Fault::new(
                mtl.span(),
                "materials by .mtl files are those of .obj files alone",
            ));
        }
        match &self.emission {
            Some(emission) => {
                let message = "with `mtl` a shape emits what its materials do (`Ke`); expected no `emission` beside it";
                Err(Fault::new(emission.span(), message))
            }
            None => Ok(()),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShapeType {
    /// A sphere by centre and radius.
    Sphere,
    /// The square [-1, 1] x [-1, 1] in the xy plane, normal +z.
    Rectangle,
    /// The cube [-1, 1] along each axis.
    Cube,
    /// A disc of radius 1 in the xy plane, normal +z.
    Disc,
    /// A cylinder from p0 to p1, open at both ends.
    Cylinder,
    /// A mesh from a file.
    Mesh,
    /// Thin curves such as hair, swept by a ball of varying radius.
    Curves,
    /// A set of balls.
    Points,
    /// Copies of one shape.
    Instances,
}

/// Interpolation between the control points of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BasisName {
    /// Straight segments.
    Linear,
    /// A uniform cubic B-spline, which does not reach its outer points.
    BSpline,
    /// A cubic through all control points.
    CatmullRom,
}

impl ShapeType {
    /// The schema for each kind of shape.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| {
            let common = match kind {
                Self::Instances => &[],
                kind => kind.common(),
            };
            [&["name", "visible"], common, kind.takes().1].concat()
        });
    }

    /// Fields of every shape except `instances`, whose inner shape has its own.
    pub const SURFACE: &[&str] = &[
        "material",
        "interior",
        "exterior",
        "boundary",
        "priority",
        "open",
        "emission",
        "transform",
        "flip_normals",
        "space",
    ];

    /// The fields of [`Self::SURFACE`] that this kind takes: curves and points have no inside and do not emit.
    fn common(self) -> &'static [&'static str] {
        match self {
            Self::Curves | Self::Points => &["material", "transform", "space"],
            _ => Self::SURFACE,
        }
    }

    /// The name in scene files, and the fields of this kind alone.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Sphere => ("sphere", &["center", "radius"]),
            Self::Rectangle => ("rectangle", &["displacement"]),
            Self::Cube => ("cube", &["displacement"]),
            Self::Disc => ("disc", &[]),
            Self::Cylinder => ("cylinder", &["p0", "p1", "radius"]),
            Self::Mesh => (
                "mesh",
                &[
                    "file",
                    "toward",
                    "displacement",
                    "shape_index",
                    "face_normals",
                    "smooth",
                    "mtl",
                ],
            ),
            Self::Curves => ("curves", &["file", "points", "basis", "radius"]),
            Self::Points => ("points", &["file", "points", "radius"]),
            Self::Instances => ("instances", &["shape", "transforms"]),
        }
    }
}

/// Displaces a mesh's vertices along its normals, once its triangles are small enough.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DisplacementRecord {
    /// Height at the vertices: the luminance of an image or of one of `textures`, or one number.
    pub height: TextureRecord<Finite>,
    /// Height that displaces nothing. Default: 0.
    pub midlevel: Option<Number<Finite>>,
    /// Factor on the heights, which are lengths in the mesh's own space. Default: 1.
    pub scale: Option<Number<Finite>>,
    /// Triangle edges are halved until none is longer than this, scene units.
    pub edge: Number<Positive>,
    /// The most triangles to cut it into. Default: 4,000,000, with a note if these do not suffice.
    #[schemars(range(min = 1, max = 64_000_000))]
    pub triangles: Option<u32>,
}

/// How far a mesh is interpolated towards another one.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TowardRecord {
    /// .ply, .obj or Mitsuba's .serialized, relative to the scene file.
    pub file: Spanned<String>,
    /// 0 for this mesh to 1 for the other.
    pub weight: Number<Unit>,
}

/// Either radiance or power. If the radiance is a texture, `scale` multiplies it.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmissionRecord {
    /// W/(m^2 sr), or a texture of it.
    pub radiance: Option<TextureRecord<NonNegative>>,
    /// Emit on both sides.
    #[serde(default)]
    pub two_sided: bool,
    /// Factor on a texture. Default: 1.
    pub scale: Option<Spanned<Color<NonNegative>>>,
    /// W, from the whole surface.
    pub power: Option<Color<NonNegative>>,
    /// Full angle of the emission cone around the surface's normals, degrees; the power stays the same. Default: 180,
    /// the whole hemisphere.
    pub spread: Option<Spanned<Number<ConeAngle>>>,
    /// Soft falloff of a sphere with a `null` material, as of Blender's lamps: at a distance d from its centre,
    /// 1 / (d² + radius²) of its intensity arrives. Default: false.
    pub soft_falloff: Option<Spanned<bool>>,
    /// Lights of one group share a layer. Default: the shape's name.
    pub group: Option<String>,
}
