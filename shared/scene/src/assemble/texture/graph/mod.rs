//! Node graphs, compiled to the renderer's programs.

mod black_bodies;
mod kinds;
mod node;

pub(in crate::assemble) use black_bodies::black_body_colors;

use super::super::{Assets, Problem};
use crate::parse::{Fault, ImageTextureRecord, NamedRecord, NodeValue, TextureRecord, Type};
use crate::values::{Finite, Range};
use beamfarm_render::math::Vec3;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::texture::graph::maths::VectorOperation;
use beamfarm_render::world::texture::graph::{Builder, Op, Slot};
use node::Node;
use std::collections::BTreeMap;
use std::ops::Range as Span;
use std::sync::Arc;

/// The bounds of colours of a range; well below the largest float, so that sums stay finite.
pub(in crate::assemble) fn bounds<R: Range>() -> [f32; 2] {
    const LARGEST: f32 = 1e18;
    let low = if R::holds(-1.0) { -LARGEST } else { 0.0 };
    let high = if R::holds(2.0) { LARGEST } else { 1.0 };
    [low, high]
}

/// A graph as a texture, each channel clamped to `bounds`; `as_number`: its value as a number.
pub(in crate::assemble) fn texture<R: Range>(
    record: &TextureRecord<R>,
    bounds: [f32; 2],
    as_number: bool,
    assets: &mut Assets<'_>,
) -> Result<Texture, Problem> {
    let place = record.place();
    let mut compiler = Compiler {
        builder: Builder::default(),
        assets,
        open: Vec::new(),
        made: BTreeMap::new(),
    };
    let (slot, of) = compiler.texture(record)?;
    let wanted = if as_number { Type::Float } else { Type::Color };
    let result = compiler.converted(slot, of, wanted);
    let [low, high] = bounds;
    if let Some(known) = compiler.builder.known(result) {
        return Ok(Texture::Constant(known.clamp(Vec3::splat(low), Vec3::splat(high))));
    }
    match compiler.builder.finish(result, bounds) {
        Ok(program) => Ok(Texture::Graph(Arc::new(program))),
        Err(_) => {
            let message = "the graph needs more than 256 values at once; expected one of fewer nodes";
            Err(Fault::new(place.unwrap_or(0..0), message).into())
        }
    }
}

struct Compiler<'c, 'a> {
    builder: Builder,
    assets: &'c mut Assets<'a>,
    /// Names of the textures being compiled, outermost first.
    open: Vec<String>,
    /// What has been compiled, by name and output.
    made: BTreeMap<(String, Option<String>), (Slot, Type)>,
}

impl Compiler<'_, '_> {
    fn constant(&mut self, x: f32) -> Slot {
        self.builder.constant(Vec3::splat(x))
    }

    fn converted(&mut self, slot: Slot, from: Type, to: Type) -> Slot {
        match (from, to) {
            (Type::Color, Type::Float) => self.builder.add(Op::Luminance, &[slot]),
            (Type::Vector, Type::Float) => self.builder.add(Op::Mean, &[slot]),
            _ => slot,
        }
    }

    fn texture<R: Range>(&mut self, record: &TextureRecord<R>) -> Result<(Slot, Type), Problem> {
        match record {
            TextureRecord::Color(color) => Ok((self.builder.constant(color.rgb()), Type::Color)),
            TextureRecord::Node(record) => self.node(Node::of(record)?, None),
            TextureRecord::Named(named) => self.named(named),
            TextureRecord::Image(image) => self.image(image),
            TextureRecord::VertexColors(image) => {
                let colors = self.builder.add(Op::VertexColor, &[]);
                let Some(image) = image else {
                    return Ok((colors, Type::Color));
                };
                let (image, _) = self.image(image)?;
                let one = self.constant(1.0);
                let product = Op::VectorMath(VectorOperation::Multiply);
                Ok((self.builder.add(product, &[colors, image, one, one]), Type::Color))
            }
            TextureRecord::Checkerboard { colors, uv } => {
                let texture = Texture::Checkerboard {
                    colors: [colors[0].rgb(), colors[1].rgb()],
                    squares_from_uv: super::from_uv(uv.as_ref())?,
                };
                let uv = self.builder.add(Op::Uv, &[]);
                Ok((self.looked_up(texture, uv), Type::Color))
            }
        }
    }

    fn looked_up(&mut self, texture: Texture, at: Slot) -> Slot {
        let textures = &mut self.builder.parts.textures;
        textures.push(texture);
        let number = (textures.len() - 1) as u16;
        self.builder.add(Op::Texture(number), &[at])
    }

    fn image(&mut self, record: &ImageTextureRecord) -> Result<(Slot, Type), Problem> {
        let at = match &record.vector {
            None => self.builder.add(Op::Uv, &[]),
            Some(value) => self.value(value.get_ref(), value.span(), Type::Vector)?,
        };
        let plain = ImageTextureRecord {
            vector: None,
            ..record.clone()
        };
        let texture = super::image::<Finite>(&plain, self.assets)?;
        let of = match record.channel {
            Some(_) => Type::Float,
            None => Type::Color,
        };
        Ok((self.looked_up(texture, at), of))
    }

    fn named(&mut self, named: &NamedRecord) -> Result<(Slot, Type), Problem> {
        let name = named.texture.get_ref();
        let output = named.output.as_ref();
        let key = (name.clone(), output.map(|output| output.get_ref().clone()));
        if let Some(made) = self.made.get(&key) {
            return Ok(*made);
        }
        let record = self.assets.textures.get(name.as_str()).copied().ok_or_else(|| {
            let message = format!("there is no texture {name:?} in `textures`");
            Fault::new(named.texture.span(), message)
        })?;
        if self.open.contains(name) {
            let message = format!("the texture {name:?} is made from itself");
            return Err(Fault::new(named.texture.span(), message).into());
        }
        self.open.push(name.clone());
        let made = match record {
            TextureRecord::Node(record) => self.node(Node::of(record)?, output)?,
            TextureRecord::Named(inner) => {
                let inner = NamedRecord {
                    output: named.output.clone().or(inner.output.clone()),
                    ..inner.clone()
                };
                self.named(&inner)?
            }
            record => match output {
                Some(output) => {
                    let message = format!("the texture {name:?} is no node, and has no outputs");
                    return Err(Fault::new(output.span(), message).into());
                }
                None => self.texture(record)?,
            },
        };
        self.open.pop();
        self.made.insert(key, made);
        Ok(made)
    }

    /// A field's value, converted to a type.
    fn value(&mut self, value: &NodeValue, place: Span<usize>, wanted: Type) -> Result<Slot, Problem> {
        let expected = || {
            let expected = match wanted {
                Type::Float => "expected a number or a texture",
                Type::Vector | Type::Color => "expected a number, three of them in brackets, or a texture",
            };
            Problem::from(Fault::new(place.clone(), expected))
        };
        match value {
            NodeValue::Number(x) => Ok(self.constant(*x as f32)),
            NodeValue::Texture(record) => {
                let (slot, of) = self.texture(record)?;
                Ok(self.converted(slot, of, wanted))
            }
            NodeValue::List(list) if wanted != Type::Float => {
                let number = |value: &NodeValue| match value {
                    NodeValue::Number(x) => Some(*x as f32),
                    _ => None,
                };
                let numbers: Option<Vec<f32>> = list.iter().map(number).collect();
                match numbers.as_deref() {
                    Some(&[x, y, z]) => Ok(self.builder.constant(Vec3::new(x, y, z))),
                    _ => Err(expected()),
                }
            }
            NodeValue::List(_) | NodeValue::Flag(_) | NodeValue::Word(_) => Err(expected()),
        }
    }
}

#[cfg(test)]
mod tests;
