//! Numbers and colours of a scene file, checked while reading so that errors know their line.

use beamfarm_image::view::white;
use beamfarm_render::math::Rgb;
use glam::DVec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range as Span;

/// A value and its place in the file. (The one of `toml` has no JSON Schema.)
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(transparent)]
pub struct Spanned<T>(toml::Spanned<T>);

impl<T> Spanned<T> {
    /// A value with a given place.
    pub fn new(span: Span<usize>, value: T) -> Self {
        Self(toml::Spanned::new(span, value))
    }

    /// Byte range in the file.
    pub fn span(&self) -> Span<usize> {
        self.0.span()
    }

    /// The value.
    pub fn get_ref(&self) -> &T {
        self.0.get_ref()
    }
}

impl<T: JsonSchema> JsonSchema for Spanned<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }
    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// A range of numbers.
pub trait Range {
    /// Text for messages: "expected ...".
    const EXPECTED: &'static str;
    /// Whether the finite number `x` is allowed.
    fn holds(x: f32) -> bool;
    /// The range as a JSON Schema.
    fn schema() -> Schema;
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $expected:literal, $test:expr, $bounds:tt;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;
        impl Range for $name {
            const EXPECTED: &'static str = $expected;
            fn holds(x: f32) -> bool {
                let test: fn(f32) -> bool = $test;
                test(x)
            }
            fn schema() -> Schema {
                let mut schema = json_schema!($bounds);
                schema.insert("type".into(), "number".into());
                schema
            }
        }
    )*};
}

ranges! {
    /// Any finite number.
    Finite: "a finite number", |_| true, {};
    /// Not negative.
    NonNegative: "a number that is not negative", |x| x >= 0.0, { "minimum": 0 };
    /// Above zero.
    Positive: "a number above 0", |x| x > 0.0, { "exclusiveMinimum": 0 };
    /// Reflectance or albedo.
    Unit: "a number from 0 to 1", |x| (0.0..=1.0).contains(&x), { "minimum": 0, "maximum": 1 };
    /// The progressive trade-off of variance against bias.
    OpenUnit: "a number between 0 and 1, both excluded", |x| x > 0.0 && x < 1.0, { "exclusiveMinimum": 0, "exclusiveMaximum": 1 };
    /// Mean cosine of a phase function.
    MeanCosine: "a number between -1 and 1, both excluded", |x| x > -1.0 && x < 1.0, { "exclusiveMinimum": -1, "exclusiveMaximum": 1 };
    /// Roughness of microfacets.
    Roughness: "a roughness from 0.001 to 1 (for less, take the smooth material)", |x| (1e-3..=1.0).contains(&x), { "minimum": 0.001, "maximum": 1 };
    /// Index of refraction of a layer over a surface.
    FilmIndex: "an index of refraction from 1 to 5", |x| (1.0..=5.0).contains(&x), { "minimum": 1, "maximum": 5 };
    /// Roughness of microfacets in one of two directions.
    AnyRoughness: "a roughness from 0.001 to 100 (for less, take the smooth material)", |x| (1e-3..=100.0).contains(&x), { "minimum": 0.001, "maximum": 100 };
    /// Radius or standard deviation of a reconstruction filter, pixels.
    FilterSize: "a number of pixels from 0.01 to 100", |x| (0.01..=100.0).contains(&x), { "minimum": 0.01, "maximum": 100 };
    /// Temperature of light.
    Kelvin: "a temperature from 1000 to 25000 kelvin", |x| white::RANGE.contains(&x), { "minimum": 1000, "maximum": 25000 };
    /// Fields of view and cone angles, degrees.
    Degrees: "an angle in degrees between 0 and 180, both excluded", |x| x > 0.0 && x < 180.0, { "exclusiveMinimum": 0, "exclusiveMaximum": 180 };
    /// A camera's field of view, up to a full circle.
    FieldOfView: "an angle in degrees above 0, to 360", |x| x > 0.0 && x <= 360.0, { "exclusiveMinimum": 0, "maximum": 360 };
    /// The cone into which a surface emits.
    ConeAngle: "an angle in degrees from 1 to 180", |x| (1.0..=180.0).contains(&x), { "minimum": 1, "maximum": 180 };
    /// The angle that a light at infinity subtends.
    AngleFromZero: "an angle in degrees from 0 to below 180", |x| (0.0..180.0).contains(&x), { "minimum": 0, "exclusiveMaximum": 180 };
}

/// A number within a range, even after rounding to single precision.
#[derive(Clone, Copy, Debug)]
pub struct Number<R>(pub f64, PhantomData<R>);

impl<R> Number<R> {
    /// In single precision, as pixels use it.
    pub fn f32(&self) -> f32 {
        self.0 as f32
    }
}

fn checked<R: Range, E: Error>(x: f64) -> Result<f64, E> {
    let single = x as f32;
    if !x.is_finite() || (single.is_finite() && !R::holds(single)) {
        Err(E::custom(format_args!("expected {}, found {x:?}", R::EXPECTED)))
    } else if !single.is_finite() {
        Err(E::custom(format_args!("{x:?} is too large for single precision")))
    } else {
        Ok(x)
    }
}

impl<'de, R: Range> Deserialize<'de> for Number<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberVisitor<R>(PhantomData<R>);
        impl<R: Range> Visitor<'_> for NumberVisitor<R> {
            type Value = Number<R>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(R::EXPECTED)
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                checked::<R, E>(x).map(|x| Number(x, PhantomData))
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.visit_f64(x as f64)
            }
        }
        deserializer.deserialize_any(NumberVisitor(PhantomData))
    }
}

/// A point, direction or factor per axis: three finite numbers.
#[derive(Clone, Copy, Debug)]
pub struct Vector(pub DVec3);

impl<'de> Deserialize<'de> for Vector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct VectorVisitor;
        impl<'de> Visitor<'de> for VectorVisitor {
            type Value = Vector;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("three numbers [x, y, z]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                numbers::<3, Finite, A>(seq, "three numbers [x, y, z]").map(|v| Vector(v.into()))
            }
        }
        deserializer.deserialize_any(VectorVisitor)
    }
}

/// Two finite numbers.
#[derive(Clone, Copy, Debug)]
pub struct Pair(pub [f64; 2]);

impl<'de> Deserialize<'de> for Pair {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PairVisitor;
        impl<'de> Visitor<'de> for PairVisitor {
            type Value = Pair;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("two numbers [x, y]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                numbers::<2, Finite, A>(seq, "two numbers [x, y]").map(Pair)
            }
        }
        deserializer.deserialize_any(PairVisitor)
    }
}

fn numbers<'de, const N: usize, R: Range, A: SeqAccess<'de>>(mut seq: A, expected: &str) -> Result<[f64; N], A::Error> {
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        match seq.next_element::<Number<R>>()? {
            Some(x) => *value = x.0,
            None => {
                return Err(A::Error::custom(format_args!("expected {expected}, found {i} numbers")));
            }
        }
    }
    let mut count = values.len();
    while seq.next_element::<serde::de::IgnoredAny>()?.is_some() {
        count += 1;
    }
    if count > values.len() {
        return Err(A::Error::custom(format_args!(
            "expected {expected}, found {count} numbers"
        )));
    }
    Ok(values)
}

/// A factor per axis, or one for all three.
#[derive(Clone, Copy, Debug)]
pub struct Factors(pub DVec3);

impl<'de> Deserialize<'de> for Factors {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Color::<Finite>::deserialize(deserializer).map(|c| Self(c.0.into()))
    }
}

/// A linear RGB colour, or one number for a grey; every channel within a range.
#[derive(Clone, Copy, Debug)]
pub struct Color<R>(pub [f64; 3], PhantomData<R>);

impl<R> Color<R> {
    /// In single precision, as pixels use it.
    pub fn rgb(&self) -> Rgb {
        Rgb::from_array(self.0.map(|x| x as f32))
    }

    /// The same of each channel over a size: of power over an area, or over a solid angle.
    pub fn over(&self, size: f64) -> Rgb {
        Rgb::from_array(self.0.map(|x| (x / size) as f32))
    }
}

impl<'de, R: Range> Deserialize<'de> for Color<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ColorVisitor(PhantomData))
    }
}

/// Reads a [`Color`].
pub struct ColorVisitor<R>(pub PhantomData<R>);

impl<'de, R: Range> Visitor<'de> for ColorVisitor<R> {
    type Value = Color<R>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, or three of them in brackets", R::EXPECTED)
    }
    fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
        let x = checked::<R, E>(x)?;
        Ok(Color([x; 3], PhantomData))
    }
    fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
        self.visit_f64(x as f64)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        let values = numbers::<3, R, A>(seq, "one number, or three in brackets")?;
        Ok(Color(values, PhantomData))
    }
}

macro_rules! inline_schema {
    ($([$($bounds:tt)*] $type:ty: $schema:expr;)*) => {$(
        impl<$($bounds)*> JsonSchema for $type {
            fn inline_schema() -> bool {
                true
            }
            fn schema_name() -> Cow<'static, str> {
                stringify!($type).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                $schema
            }
        }
    )*};
}

inline_schema! {
    [R: Range] Number<R>: R::schema();
    [] Vector: several(3, Finite::schema());
    [] Pair: several(2, Finite::schema());
    [] Factors: json_schema!({ "anyOf": [Finite::schema(), several(3, Finite::schema())] });
    [R: Range] Color<R>: json_schema!({ "anyOf": [R::schema(), several(3, R::schema())] });
}

fn several(count: u32, of: Schema) -> Schema {
    json_schema!({ "type": "array", "items": of, "minItems": count, "maxItems": count })
}
