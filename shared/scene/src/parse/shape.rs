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
    /// For messages, and for the layer of a shape that emits.
    pub name: Option<String>,
    /// Kind of shape.
    #[serde(rename = "type")]
    pub kind: Spanned<ShapeType>,
    /// Middle of the sphere. Default: [0, 0, 0].
    pub center: Option<Spanned<Vector>>,
    /// One end of the axis. Default: [0, 0, 0].
    pub p0: Option<Spanned<Vector>>,
    /// The other end of the axis. Default: [0, 0, 1].
    pub p1: Option<Spanned<Vector>>,
    /// Scene units. Default: 1. Of curves and points: where the file has none.
    pub radius: Option<Spanned<Number<Positive>>>,
    /// .ply, .obj or Mitsuba's .serialized, of curves and points .ply or .txt, relative to the scene file.
    pub file: Option<Spanned<String>>,
    /// Rows [x, y, z, radius] in place of a file: points, or the control points of one curve.
    pub points: Option<Spanned<Vec<[Number<Finite>; 4]>>>,
    /// What lies between the control points of curves. Default: b_spline.
    pub basis: Option<Spanned<BasisName>>,
    /// Another mesh with the same triangles, that this one is on its way to.
    pub toward: Option<Spanned<TowardRecord>>,
    /// Heights that its surface is moved by.
    pub displacement: Option<Spanned<DisplacementRecord>>,
    /// Which mesh of a .serialized file, from zero. Default: 0.
    pub shape_index: Option<Spanned<u32>>,
    /// Ignore the normals of the file. Default: false.
    pub face_normals: Option<Spanned<bool>>,
    /// Make normals where the file has none. Default: false.
    pub smooth: Option<Spanned<bool>>,
    /// Turn the outside in. Default: false.
    pub flip_normals: Option<Spanned<bool>>,
    /// Name of a material. Default: grey; black for shapes that emit.
    pub material: Option<Spanned<String>>,
    /// Take the materials that an .obj file names from its .mtl files. Default: false, with a note if it has any.
    pub mtl: Option<Spanned<bool>>,
    /// Medium inside. Default: none.
    pub interior: Option<Spanned<String>>,
    /// Medium outside. Default: the world's.
    pub exterior: Option<Spanned<String>>,
    /// False: light that goes through keeps its medium. Default: true.
    pub boundary: Option<Spanned<bool>>,
    /// Of shapes that reach into each other or touch: the highest is what is there. Default: 0; of equals, what has no
    /// medium inside, else the higher index of refraction; media without a surface add up.
    pub priority: Option<Spanned<i32>>,
    /// The shape may be open and bound a medium all the same: each crossing decides. Default: false.
    pub open: Option<Spanned<bool>>,
    /// Light that it emits, on its outside.
    pub emission: Option<Spanned<EmissionRecord>>,
    /// Where it stands.
    pub transform: Option<Spanned<Steps>>,
    /// What graphs of its material are told of it. Default: by its transform and its own box.
    pub space: Option<Spanned<SpaceRecord>>,
    /// The shape that is copied.
    pub shape: Option<Spanned<Box<ShapeRecord>>>,
    /// One transform for each copy.
    pub transforms: Option<Spanned<Vec<Spanned<Steps>>>>,
    /// Types of rays that see it. Default: all.
    pub visible: Option<Spanned<Vec<RayType>>>,
}

/// Where a shape's points are, for the coordinates that graphs read.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpaceRecord {
    /// From the world to the object's own coordinates: four rows of four numbers. Default: the inverse of `transform`.
    pub matrix: Option<Vec<Vec<Number<Finite>>>>,
    /// Lowest and highest corner in its own coordinates, from which "generated" ones are. Default: of the shape.
    #[serde(rename = "box")]
    pub bounds: Option<[Vector; 2]>,
    /// Its own random number, 0 to 1.
    pub random: Option<Number<Unit>>,
    /// Its number. Default: 0.
    pub index: Option<Number<Finite>>,
    /// Where it is, for graphs that ask. Default: the origin of its own coordinates.
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

    /// Whether its materials are those of .mtl files.
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
    /// By centre and radius.
    Sphere,
    /// [-1, 1] x [-1, 1] in the xy plane, normal +z.
    Rectangle,
    /// [-1, 1] along each axis.
    Cube,
    /// Radius 1 in the xy plane, normal +z.
    Disc,
    /// From p0 to p1, open at both ends.
    Cylinder,
    /// From a file.
    Mesh,
    /// Thin ones, as hair is: swept by a ball whose radius changes on the way.
    Curves,
    /// Many balls.
    Points,
    /// Copies of one shape.
    Instances,
}

/// What lies between the control points of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BasisName {
    /// Straight pieces.
    Linear,
    /// A uniform cubic B-spline, which begins and ends beside its outer points.
    BSpline,
    /// A cubic through all of them.
    CatmullRom,
}

impl ShapeType {
    /// The schema of each kind of shape.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| {
            let common = match kind {
                Self::Instances => &[],
                kind => kind.common(),
            };
            [&["name", "visible"], common, kind.takes().1].concat()
        });
    }

    /// Fields that every shape takes, but `instances`, whose shape has its own.
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

    /// Those of a kind of them: curves and points have no inside, and do not emit.
    fn common(self) -> &'static [&'static str] {
        match self {
            Self::Curves | Self::Points => &["material", "transform", "space"],
            _ => Self::SURFACE,
        }
    }

    /// As the scene file writes it, and the fields of this kind alone.
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

/// Heights that the vertices of a mesh are moved by along its normals, once its triangles are small enough.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DisplacementRecord {
    /// What is looked up at the vertices: its luminance counts, or one number. An image, or one of `textures`.
    pub height: TextureRecord<Finite>,
    /// Height that moves nothing. Default: 0.
    pub midlevel: Option<Number<Finite>>,
    /// Factor on the heights, which are lengths of the mesh's own space. Default: 1.
    pub scale: Option<Number<Finite>>,
    /// Edges of triangles are halved until none is longer, scene units.
    pub edge: Number<Positive>,
    /// Triangles that it may be cut into. Default: 4,000,000, with a note where these do not do.
    #[schemars(range(min = 1, max = 64_000_000))]
    pub triangles: Option<u32>,
}

/// How far a mesh is on its way to another one.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TowardRecord {
    /// .ply, .obj or Mitsuba's .serialized, relative to the scene file.
    pub file: Spanned<String>,
    /// 0: not yet, 1: there.
    pub weight: Number<Unit>,
}

/// Either radiance or power. Where radiance is a texture, `scale` multiplies it.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmissionRecord {
    /// W/(m^2 sr), or a texture of it.
    pub radiance: Option<TextureRecord<NonNegative>>,
    /// Emit on both sides.
    #[serde(default)]
    pub two_sided: bool,
    /// What a texture is multiplied by. Default: 1.
    pub scale: Option<Spanned<Color<NonNegative>>>,
    /// W, of the whole surface.
    pub power: Option<Color<NonNegative>>,
    /// Full angle of the cone around its normals that it emits into, degrees; its power stays. Default: 180, all of the
    /// hemisphere.
    pub spread: Option<Spanned<Number<ConeAngle>>>,
    /// Of a sphere of a material of type `null`: whether it shines as Blender's lamps with soft falloff, so that at a
    /// distance d from its middle 1 / (d² + radius²) of its intensity arrives. Default: false.
    pub soft_falloff: Option<Spanned<bool>>,
    /// Lights of one group share a layer. Default: the shape's name.
    pub group: Option<String>,
}
