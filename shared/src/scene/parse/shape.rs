//! Shapes.

use super::transform::Steps;
use super::{Fault, given, only_takes};
use crate::scene::values::*;
use serde::Deserialize;
use toml::Spanned;

/// Fields of all kinds of shapes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeRecord {
    pub name: Option<String>,
    #[serde(rename = "type")]
    pub kind: Spanned<ShapeType>,
    pub center: Option<Spanned<Vector>>,
    pub p0: Option<Spanned<Vector>>,
    pub p1: Option<Spanned<Vector>>,
    pub radius: Option<Spanned<Number<Positive>>>,
    pub file: Option<Spanned<String>>,
    pub face_normals: Option<Spanned<bool>>,
    pub flip_normals: Option<Spanned<bool>>,
    pub material: Option<Spanned<String>>,
    pub interior: Option<Spanned<String>>,
    pub exterior: Option<Spanned<String>>,
    /// False: light that goes through keeps its medium.
    pub boundary: Option<Spanned<bool>>,
    pub emission: Option<Spanned<EmissionRecord>>,
    pub transform: Option<Spanned<Steps>>,
    pub shape: Option<Spanned<Box<ShapeRecord>>>,
    pub transforms: Option<Spanned<Vec<Spanned<Steps>>>>,
}

impl ShapeRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let common = match self.kind.get_ref() {
            ShapeType::Instances => &[],
            _ => ShapeType::SURFACE,
        };
        #[rustfmt::skip]
        let given = given!(self, center, p0, p1, radius, file, face_normals, flip_normals, material, interior, exterior,
            boundary, emission, transform, shape, transforms);
        only_takes(name, takes, common, &given)?;
        match &self.shape {
            Some(shape) if shape.get_ref().kind.get_ref() == &ShapeType::Instances => {
                Err(Fault::new(
                    shape.get_ref().kind.span(),
                    "instances of instances are not supported; expected the type of one shape",
                ))
            }
            Some(shape) => shape.get_ref().check(),
            None => Ok(()),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeType {
    Sphere,
    Rectangle,
    Cube,
    Disc,
    Cylinder,
    Mesh,
    Instances,
}

impl ShapeType {
    /// Fields that every shape takes, but `instances`, whose shape has its own.
    pub const SURFACE: &[&str] = &[
        "material",
        "interior",
        "exterior",
        "boundary",
        "emission",
        "transform",
        "flip_normals",
    ];

    /// As the scene file writes it, and the fields of this kind alone.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Sphere => ("sphere", &["center", "radius"]),
            Self::Rectangle => ("rectangle", &[]),
            Self::Cube => ("cube", &[]),
            Self::Disc => ("disc", &[]),
            Self::Cylinder => ("cylinder", &["p0", "p1", "radius"]),
            Self::Mesh => ("mesh", &["file", "face_normals"]),
            Self::Instances => ("instances", &["shape", "transforms"]),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmissionRecord {
    pub radiance: Option<Color<NonNegative>>,
    pub power: Option<Color<NonNegative>>,
    pub group: Option<String>,
}
