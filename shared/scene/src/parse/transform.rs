//! Transforms.

use crate::values::*;
use schemars::JsonSchema;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// A transform: a list of steps, applied in order.
#[derive(Debug, JsonSchema)]
#[schemars(transparent)]
pub struct Steps(pub Vec<Spanned<StepRecord>>);

impl<'de> Deserialize<'de> for Steps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct StepsVisitor;
        impl<'de> Visitor<'de> for StepsVisitor {
            type Value = Steps;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of steps such as [{ scale = 2.0 }, { translate = [0, 1, 0] }]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Steps, A::Error> {
                let mut steps = Vec::new();
                while let Some(step) = seq.next_element()? {
                    steps.push(step);
                }
                Ok(Steps(steps))
            }
        }
        deserializer.deserialize_any(StepsVisitor)
    }
}

/// One step of a transform: exactly one of the fields.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("minProperties" = 1, "maxProperties" = 1))]
pub struct StepRecord {
    /// A factor, or one per axis.
    pub scale: Option<Factors>,
    /// Rotation around an axis through the origin.
    pub rotate: Option<RotateRecord>,
    /// Translation.
    pub translate: Option<Vector>,
    /// Matrix of four rows; the last is [0, 0, 0, 1].
    #[schemars(with = "Option<[[Number<Finite>; 4]; 4]>")]
    pub matrix: Option<Vec<Vec<Number<Finite>>>>,
    /// Moves the origin to `origin` and turns +z towards `target`.
    pub look_at: Option<LookAtRecord>,
}

/// A rotation, by the right-hand rule.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateRecord {
    /// Direction of the axis.
    pub axis: Vector,
    /// Angle, degrees.
    pub angle: Number<Finite>,
}

/// A position and a direction.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookAtRecord {
    /// Where the origin moves to.
    pub origin: Vector,
    /// A point on the new +z axis.
    pub target: Vector,
    /// A direction in the half plane of +y. Default: [0, 1, 0].
    pub up: Option<Vector>,
}
