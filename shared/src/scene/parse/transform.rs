//! Transforms.

use crate::scene::values::*;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use toml::Spanned;

/// A transform: a list of steps, applied in order.
#[derive(Debug)]
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
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRecord {
    pub scale: Option<Factors>,
    pub rotate: Option<RotateRecord>,
    pub translate: Option<Vector>,
    pub matrix: Option<[[Number<Finite>; 4]; 4]>,
    pub look_at: Option<LookAtRecord>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotateRecord {
    pub axis: Vector,
    pub angle: Number<Finite>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookAtRecord {
    pub origin: Vector,
    pub target: Vector,
    pub up: Option<Vector>,
}
