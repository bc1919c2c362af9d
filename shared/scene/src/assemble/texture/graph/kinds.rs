//! Compiles each kind of node to the renderer's programs.

use super::black_bodies::black_bodies;
use super::node::Node;
use super::{Compiler, Problem};
use crate::parse::{Fault, Type, Unset};
use crate::transform;
use crate::values::Spanned;
use beamfarm_render::math::{PI, Rgb};
use beamfarm_render::world::texture::graph::color::{self, Blend};
use beamfarm_render::world::texture::graph::maths::{Interpolation, Operation, VectorOperation};
use beamfarm_render::world::texture::graph::noise::NoiseKind;
use beamfarm_render::world::texture::graph::patterns::{GradientKind, Rows, WaveKind, WaveProfile};
use beamfarm_render::world::texture::graph::table::{Between, Entry, Table};
use beamfarm_render::world::texture::graph::voronoi::{CellHash, Feature, Metric};
use beamfarm_render::world::texture::graph::{MappingKind, Op, RotationKind, Slot, Viewer, VoronoiOutput};
use glam::{Affine3A, DAffine3, DMat3, DVec3};

/// The meaning of a word.
fn meaning<T: Copy>(all: &[(&str, T)], word: &str) -> T {
    let found = all.iter().find(|(name, _)| *name == word);
    // Words were already checked against the kind's, which are these.
    found.unwrap_or(&all[0]).1
}

impl Compiler<'_, '_> {
    /// An input as a value of its own type, or of the wanted one.
    fn input(&mut self, node: Node<'_>, name: &str, wanted: Option<Type>) -> Result<Slot, Problem> {
        let input = node.kind.inputs.iter().find(|input| input.name == name);
        let Some(input) = input else {
            return Ok(self.constant(0.0));
        };
        let wanted = wanted.unwrap_or(input.of);
        match (node.record.field(name), input.unset) {
            (Some(value), _) => self.value(value.get_ref(), value.span(), wanted),
            (None, Unset::Number(x)) => Ok(self.constant(x)),
            (None, Unset::Vector(v)) => Ok(self.builder.constant(v.into())),
            (None, Unset::Generated) => Ok(self.builder.add(Op::Generated, &[])),
            (None, Unset::Never) => {
                let message = format!("a {:?} node needs `{name}`", node.kind.name);
                Err(Fault::new(node.record.node.span(), message).into())
            }
        }
    }

    fn inputs(&mut self, node: Node<'_>, count: usize) -> Result<Vec<Slot>, Problem> {
        let names = node.kind.inputs.iter().take(count);
        names.map(|input| self.input(node, input.name, None)).collect()
    }

    fn all(&mut self, node: Node<'_>, op: Op) -> Result<Slot, Problem> {
        let inputs = self.inputs(node, node.kind.inputs.len())?;
        Ok(self.builder.add(op, &inputs))
    }

    fn radians(&mut self, degrees: Slot) -> Slot {
        let by = self.constant(PI / 180.0);
        self.builder
            .add(Op::VectorMath(VectorOperation::Multiply), &[degrees, by, by, by])
    }

    fn mixed(&mut self, factor: Slot, a: Slot, b: Slot) -> Slot {
        self.builder.add(Op::MixVector { clamp_factor: false }, &[factor, a, b])
    }

    fn component(&mut self, of: Slot, number: u8) -> Slot {
        self.builder.add(Op::Component(number), &[of])
    }

    fn table(&mut self, table: Table) -> u16 {
        let tables = &mut self.builder.parts.tables;
        tables.push(table);
        (tables.len() - 1) as u16
    }

    /// A curve of the node, or the straight line from (0, 0) to (1, 1).
    fn curve(&mut self, node: Node<'_>, name: &str) -> Result<u16, Problem> {
        let points = match node.rows(name, 2..3)? {
            None => vec![[0.0, 0.0], [1.0, 1.0]],
            Some(rows) => rows.into_iter().map(|row| [row[0], row[1]]).collect(),
        };
        // It has at least one row.
        Ok(match Table::curve(points) {
            Some(curve) => self.table(curve),
            None => 0,
        })
    }

    /// A node's value at an output, or at its default one.
    #[expect(clippy::too_many_lines, reason = "one short arm a kind")]
    pub(super) fn node(&mut self, node: Node<'_>, asked: Option<&Spanned<String>>) -> Result<(Slot, Type), Problem> {
        let output = node.output(asked)?;
        let mut of = meaning(node.kind.outputs, output);
        let is_color = output == "color";
        let slot = match node.kind.name {
            "coordinates" => {
                let op = match node.word("of")? {
                    "uv" => Op::Uv,
                    "object" => Op::Own,
                    "world" => Op::World,
                    "normal" => Op::OwnNormal,
                    "camera" => {
                        let world = self.builder.add(Op::World, &[]);
                        let matrices = &mut self.builder.parts.matrices;
                        matrices.push(self.assets.camera_from_world);
                        let number = (matrices.len() - 1) as u16;
                        return Ok((self.builder.add(Op::Transform(number), &[world]), of));
                    }
                    _ => Op::Generated,
                };
                self.builder.add(op, &[])
            }
            "geometry" => {
                let op = match output {
                    "normal" => Op::Normal,
                    "true_normal" => Op::TrueNormal,
                    "incoming" => Op::Incoming,
                    "backfacing" => Op::Backfacing,
                    _ => Op::World,
                };
                self.builder.add(op, &[])
            }
            "object_info" => {
                let op = match output {
                    "index" => Op::Index,
                    "random" => Op::Random,
                    _ => Op::Location,
                };
                self.builder.add(op, &[])
            }
            "light_path" => {
                let viewer = match output {
                    "is_shadow" => Viewer::Shadow,
                    "is_photon" => Viewer::Photon,
                    _ => Viewer::Camera,
                };
                self.builder.add(Op::Viewer(viewer), &[])
            }
            "mapping" => {
                let kinds = [
                    ("point", MappingKind::Point),
                    ("texture", MappingKind::Texture),
                    ("vector", MappingKind::Vector),
                    ("normal", MappingKind::Normal),
                ];
                let kind = meaning(&kinds, node.word("type")?);
                let mut inputs = self.inputs(node, 4)?;
                inputs[2] = self.radians(inputs[2]);
                self.builder.add(Op::Mapping(kind), &inputs)
            }
            "transform" => {
                let at = self.input(node, "vector", None)?;
                let matrices = &mut self.builder.parts.matrices;
                matrices.push(matrix(node)?);
                let number = (matrices.len() - 1) as u16;
                self.builder.add(Op::Transform(number), &[at])
            }
            "noise" => {
                let kinds = [
                    ("fbm", NoiseKind::Fbm),
                    ("multifractal", NoiseKind::Multifractal),
                    ("hybrid_multifractal", NoiseKind::HybridMultifractal),
                    ("ridged_multifractal", NoiseKind::RidgedMultifractal),
                    ("hetero_terrain", NoiseKind::HeteroTerrain),
                ];
                let op = Op::Noise {
                    dimensions: dimensions(node)?,
                    kind: meaning(&kinds, node.word("type")?),
                    normalize: node.flag("normalize")?,
                    color: is_color,
                };
                self.all(node, op)?
            }
            "voronoi" => self.voronoi(node, output)?,
            "gradient" => {
                let kinds = [
                    ("linear", GradientKind::Linear),
                    ("quadratic", GradientKind::Quadratic),
                    ("easing", GradientKind::Easing),
                    ("diagonal", GradientKind::Diagonal),
                    ("spherical", GradientKind::Spherical),
                    ("quadratic_sphere", GradientKind::QuadraticSphere),
                    ("radial", GradientKind::Radial),
                ];
                self.all(node, Op::Gradient(meaning(&kinds, node.word("type")?)))?
            }
            "magic" => {
                let depth = node.count("depth")? as u8;
                let color = self.all(node, Op::Magic { depth })?;
                if is_color {
                    color
                } else {
                    self.builder.add(Op::Mean, &[color])
                }
            }
            "wave" => self.wave(node)?,
            "brick" => {
                let inputs = self.inputs(node, 7)?;
                let rows = &mut self.builder.parts.rows;
                rows.push(Rows {
                    offset: node.number("offset")?,
                    offset_frequency: node.count("offset_frequency")?,
                    squash: node.number("squash")?,
                    squash_frequency: node.count("squash_frequency")?,
                });
                let number = (rows.len() - 1) as u16;
                let parts = self.builder.add(Op::Bricks(number), &inputs);
                let mortar = self.component(parts, 1);
                if is_color {
                    let tint = self.component(parts, 0);
                    let [first, second, between] = self.named_inputs(node, ["color1", "color2", "mortar"])?;
                    let brick = self.mixed(tint, first, second);
                    self.mixed(mortar, brick, between)
                } else {
                    mortar
                }
            }
            "checker" => {
                let inputs = self.inputs(node, 2)?;
                let is_first = self.builder.add(Op::Checker, &inputs);
                if is_color {
                    let [first, second] = self.named_inputs(node, ["color1", "color2"])?;
                    self.mixed(is_first, second, first)
                } else {
                    is_first
                }
            }
            "white_noise" => {
                let op = Op::WhiteNoise {
                    dimensions: dimensions(node)?,
                    color: is_color,
                };
                self.all(node, op)?
            }
            "ramp" => {
                let number = self.ramp(node)?;
                let op = if is_color {
                    Op::Table(number)
                } else {
                    Op::TableAlpha(number)
                };
                self.all(node, op)?
            }
            "rgb_curves" => {
                let combined = self.curve(node, "combined")?;
                let each = ["red", "green", "blue"].map(|name| self.curve(node, name));
                let [red, green, blue] = each;
                let color = self.input(node, "color", None)?;
                let first = self.builder.add(Op::Curves([combined; 3]), &[color]);
                let made = self.builder.add(Op::Curves([red?, green?, blue?]), &[first]);
                let factor = self.input(node, "factor", None)?;
                self.mixed(factor, color, made)
            }
            "vector_curves" => {
                let [x, y, z] = ["x", "y", "z"].map(|name| self.curve(node, name));
                let vector = self.input(node, "vector", None)?;
                let made = self.builder.add(Op::Curves([x?, y?, z?]), &[vector]);
                let factor = self.input(node, "factor", None)?;
                self.mixed(factor, vector, made)
            }
            "float_curve" => {
                let curve = self.curve(node, "curve")?;
                let value = self.input(node, "value", None)?;
                let made = self.builder.add(Op::Table(curve), &[value]);
                let factor = self.input(node, "factor", None)?;
                self.mixed(factor, value, made)
            }
            "mix" => {
                let (slot, made) = self.mix(node)?;
                of = made;
                slot
            }
            "math" => {
                let operation = meaning(Operation::ALL, node.word("operation")?);
                let clamp = node.flag("clamp")?;
                self.all(node, Op::Math(operation, clamp))?
            }
            "vector_math" => {
                let operation = meaning(VectorOperation::ALL, node.word("operation")?);
                let made = self.all(node, Op::VectorMath(operation))?;
                // A number is one at any output.
                let is_number = matches!(
                    operation,
                    VectorOperation::DotProduct | VectorOperation::Distance | VectorOperation::Length
                );
                match (is_number, output) {
                    (true, "value") | (false, "vector") => made,
                    _ => self.constant(0.0),
                }
            }
            "map_range" => {
                let kinds = [
                    ("linear", Interpolation::Linear),
                    ("stepped", Interpolation::Stepped),
                    ("smoothstep", Interpolation::Smooth),
                    ("smootherstep", Interpolation::Smoother),
                ];
                of = match node.word("data")? {
                    "vector" => Type::Vector,
                    _ => Type::Float,
                };
                let op = Op::MapRange(meaning(&kinds, node.word("interpolation")?), node.flag("clamp")?);
                let names = ["value", "from_min", "from_max", "to_min", "to_max", "steps"];
                let inputs: Result<Vec<Slot>, _> =
                    names.into_iter().map(|name| self.input(node, name, Some(of))).collect();
                self.builder.add(op, &inputs?)
            }
            "clamp" => {
                let sorted = node.word("type")? == "range";
                self.all(node, Op::Clamp { sorted })?
            }
            "separate" => {
                let mode = node.word("mode")?;
                let from = if mode == "xyz" { Type::Vector } else { Type::Color };
                let value = self.input(node, "value", Some(from))?;
                let parts = self.builder.add(Op::ToSpace(space(mode)), &[value]);
                let number = match output {
                    "x" => 0,
                    "y" => 1,
                    _ => 2,
                };
                self.component(parts, number)
            }
            "combine" => {
                let mode = node.word("mode")?;
                let parts = self.all(node, Op::Combine)?;
                of = if mode == "xyz" { Type::Vector } else { Type::Color };
                self.builder.add(Op::FromSpace(space(mode)), &[parts])
            }
            "hue_saturation" => self.all(node, Op::HueSaturation)?,
            "bright_contrast" => self.all(node, Op::BrightContrast)?,
            "gamma" => self.all(node, Op::Gamma)?,
            "invert" => self.all(node, Op::Invert)?,
            "luminance" => self.all(node, Op::Luminance)?,
            "blackbody" => {
                let number = black_bodies().map(|table| self.table(table));
                // The table of black bodies is never empty.
                self.all(node, Op::Table(number.unwrap_or(0)))?
            }
            "fresnel" => self.all(node, Op::Fresnel)?,
            "layer_weight" => {
                let op = match output {
                    "fresnel" => Op::LayerFresnel,
                    _ => Op::LayerFacing,
                };
                self.all(node, op)?
            }
            "vector_rotate" => {
                let kinds = [
                    ("axis_angle", RotationKind::AxisAngle),
                    ("x", RotationKind::X),
                    ("y", RotationKind::Y),
                    ("z", RotationKind::Z),
                    ("euler_xyz", RotationKind::Euler),
                ];
                let op = Op::Rotate {
                    kind: meaning(&kinds, node.word("type")?),
                    invert: node.flag("invert")?,
                };
                let mut inputs = self.inputs(node, 5)?;
                inputs[3] = self.radians(inputs[3]);
                inputs[4] = self.radians(inputs[4]);
                self.builder.add(op, &inputs)
            }
            other => {
                let message = format!("nodes of the kind {other:?} are not known");
                return Err(Fault::new(node.record.node.span(), message).into());
            }
        };
        Ok((slot, of))
    }

    fn named_inputs<const N: usize>(&mut self, node: Node<'_>, names: [&str; N]) -> Result<[Slot; N], Problem> {
        let mut slots = [self.constant(0.0); N];
        for (slot, name) in slots.iter_mut().zip(names) {
            *slot = self.input(node, name, None)?;
        }
        Ok(slots)
    }

    fn voronoi(&mut self, node: Node<'_>, output: &str) -> Result<Slot, Problem> {
        let features = [
            ("f1", Feature::F1),
            ("f2", Feature::F2),
            ("smooth_f1", Feature::SmoothF1),
            ("distance_to_edge", Feature::DistanceToEdge),
            ("n_sphere_radius", Feature::NSphereRadius),
        ];
        let metrics = [
            ("euclidean", Metric::Euclidean),
            ("manhattan", Metric::Manhattan),
            ("chebychev", Metric::Chebychev),
            ("minkowski", Metric::Minkowski),
        ];
        let feature = meaning(&features, node.word("feature")?);
        let has_radius = feature == Feature::NSphereRadius;
        let told = match output {
            "radius" if has_radius => VoronoiOutput::Distance,
            "distance" if !has_radius => VoronoiOutput::Distance,
            "color" => VoronoiOutput::Color,
            "position" => VoronoiOutput::Position,
            "w" => VoronoiOutput::W,
            // Outputs that this feature does not provide.
            _ => return Ok(self.constant(0.0)),
        };
        let op = Op::Voronoi {
            dimensions: dimensions(node)?,
            feature,
            metric: meaning(&metrics, node.word("metric")?),
            normalize: node.flag("normalize")?,
            hash: meaning(
                &[("lookup3", CellHash::Lookup3), ("pcg", CellHash::Pcg)],
                node.word("hash")?,
            ),
            output: told,
        };
        self.all(node, op)
    }

    fn wave(&mut self, node: Node<'_>) -> Result<Slot, Problem> {
        let is_rings = node.word("type")? == "rings";
        let direction = node.word("direction")?;
        let kind = match (is_rings, direction) {
            (false, "x") => WaveKind::Bands([1, 0, 0]),
            (false, "y") => WaveKind::Bands([0, 1, 0]),
            (false, "z") => WaveKind::Bands([0, 0, 1]),
            (false, "diagonal") => WaveKind::Bands([1, 1, 1]),
            (true, "x") => WaveKind::Rings([0, 1, 1]),
            (true, "y") => WaveKind::Rings([1, 0, 1]),
            (true, "z") => WaveKind::Rings([1, 1, 0]),
            (true, "spherical") => WaveKind::Rings([1, 1, 1]),
            (_, word) => {
                let said = node.record.field("direction");
                let place = said.map_or_else(|| node.record.node.span(), Spanned::span);
                let expected = if is_rings { "spherical" } else { "diagonal" };
                let message = format!("{word:?} is no direction of these waves; expected x, y, z or {expected}");
                return Err(Fault::new(place, message).into());
            }
        };
        let profiles = [
            ("sine", WaveProfile::Sine),
            ("saw", WaveProfile::Saw),
            ("triangle", WaveProfile::Triangle),
        ];
        let profile = meaning(&profiles, node.word("profile")?);
        self.all(node, Op::Wave(kind, profile))
    }

    fn ramp(&mut self, node: Node<'_>) -> Result<u16, Problem> {
        let between = match node.word("interpolation")? {
            "constant" => Between::Constant,
            "ease" => Between::Ease,
            _ => Between::Linear,
        };
        let rows = node.rows("stops", 4..6)?.unwrap_or_default();
        let entries = rows.iter().map(|row| Entry {
            at: row[0],
            color: Rgb::new(row[1], row[2], row[3]),
            alpha: row.get(4).copied().unwrap_or(1.0),
        });
        let ramp = Table::ramp(entries.collect(), between).ok_or_else(|| {
            let message = "a \"ramp\" node needs `stops`: rows of a position and a colour";
            Fault::new(node.record.node.span(), message)
        })?;
        Ok(self.table(ramp))
    }

    fn mix(&mut self, node: Node<'_>) -> Result<(Slot, Type), Problem> {
        let clamp_factor = node.flag("clamp_factor")?;
        let (of, by) = match node.word("data")? {
            "float" => (Type::Float, Type::Float),
            "vector" => (Type::Vector, Type::Vector),
            _ => (Type::Color, Type::Float),
        };
        let factor = self.input(node, "factor", Some(by))?;
        let a = self.input(node, "a", Some(of))?;
        let b = self.input(node, "b", Some(of))?;
        let op = match of {
            Type::Color => Op::Blend {
                blend: meaning(Blend::ALL, node.word("blend")?),
                clamp_factor,
                clamp_result: node.flag("clamp_result")?,
            },
            Type::Float | Type::Vector => Op::MixVector { clamp_factor },
        };
        Ok((self.builder.add(op, &[factor, a, b]), of))
    }
}

fn dimensions(node: Node<'_>) -> Result<u8, Fault> {
    Ok(meaning(
        &[("3d", 3), ("1d", 1), ("2d", 2), ("4d", 4)],
        node.word("dimensions")?,
    ))
}

fn space(mode: &str) -> color::Space {
    match mode {
        "hsv" => color::Space::Hsv,
        "hsl" => color::Space::Hsl,
        _ => color::Space::Rgb,
    }
}

fn matrix(node: Node<'_>) -> Result<Affine3A, Fault> {
    let rows = node.rows("matrix", 4..5)?;
    match rows.as_deref() {
        Some([x, y, z]) => Ok(affine([x, y, z])),
        Some([x, y, z, w]) if w[..] == [0.0, 0.0, 0.0, 1.0] => Ok(affine([x, y, z])),
        _ => {
            let message = "a \"transform\" node needs `matrix`: three rows of four numbers, or four, the last \
                           [0, 0, 0, 1]";
            Err(Fault::new(node.record.node.span(), message))
        }
    }
}

fn affine(rows: [&Vec<f32>; 3]) -> Affine3A {
    let at = |row: usize, column: usize| f64::from(rows[row][column]);
    let column = |i: usize| DVec3::new(at(0, i), at(1, i), at(2, i));
    let map = DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    };
    transform::single(&map)
}
