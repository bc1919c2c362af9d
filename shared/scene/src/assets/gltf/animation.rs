//! Animations of a glTF file: its nodes at a given time.

use super::Beside;
use super::accessor::Buffers;
use super::open::Opened;
use crate::assets::Flaw;
use crate::time::{Curve, Interpolation, Parts};
use gltf::Document;
use gltf::animation::{Channel, Interpolation as Kind, Property};
use gltf::json::scene::UnitQuaternion;
use std::collections::BTreeSet;

/// A file at a given time.
pub struct Moment<'b> {
    pub opened: Opened<'b>,
    /// Animations without effect, since earlier ones move the same things.
    pub hidden: Vec<String>,
}

impl<'b> Moment<'b> {
    /// Nodes and weights after `seconds` of animation. Values are held before the first key and after the last. All
    /// animations play at once; if two move the same thing, the first counts.
    pub fn new(opened: Opened<'b>, beside: &Beside<'b>, seconds: f64) -> Result<Self, Flaw> {
        let document = &opened.document;
        let buffers = Buffers::new(document, opened.blob, beside)?;
        let mut root = document.as_json().clone();
        let mut taken = BTreeSet::new();
        let mut hidden = Vec::new();
        for animation in document.animations() {
            let name = match animation.name() {
                Some(name) => format!("{name:?}"),
                None => format!("number {}", animation.index()),
            };
            let mut plays = false;
            for channel in animation.channels() {
                let node = channel.target().node().index();
                if !taken.insert((node, channel.target().property() as u8)) {
                    continue;
                }
                plays = true;
                let track = Track::new(&channel, &buffers);
                let track = track.map_err(|flaw| {
                    let number = channel.index();
                    format!("channel {number} of the animation {name}: {}", flaw.message)
                })?;
                let values: Vec<f32> = track.at(seconds).into_iter().map(|x| x as f32).collect();
                let moved = &mut root.nodes[node];
                // Animated nodes use translation, rotation and scale; a matrix is ignored.
                moved.matrix = None;
                match (channel.target().property(), &values[..]) {
                    (Property::Translation, [x, y, z]) => moved.translation = Some([*x, *y, *z]),
                    (Property::Scale, [x, y, z]) => moved.scale = Some([*x, *y, *z]),
                    (Property::Rotation, [x, y, z, w]) => moved.rotation = Some(UnitQuaternion([*x, *y, *z, *w])),
                    _ => moved.weights = Some(values),
                }
            }
            if !plays && animation.channels().next().is_some() {
                hidden.push(name);
            }
        }
        let document = Document::from_json(root).map_err(|e| format!("not a usable glTF file: {e}"))?;
        Ok(Self {
            opened: Opened { document, ..opened },
            hidden,
        })
    }
}

/// The times of the first and last key of all animations, seconds. `None`: nothing moves.
pub fn span(document: &Document, buffers: &Buffers<'_>) -> Result<Option<[f64; 2]>, Flaw> {
    let mut span: Option<[f64; 2]> = None;
    for channel in document.animations().flat_map(|animation| animation.channels()) {
        for [time] in buffers.numbers(&channel.sampler().input(), "times of keys")? {
            let [first, last] = span.unwrap_or([time; 2]);
            span = Some([first.min(time), last.max(time)]);
        }
    }
    Ok(span.filter(|times| times.iter().all(|time| time.is_finite())))
}

/// A channel's values over time.
enum Track {
    Curve(Curve),
    Spline(Spline),
}

impl Track {
    fn new(channel: &Channel<'_>, buffers: &Buffers<'_>) -> Result<Self, Flaw> {
        let sampler = channel.sampler();
        let times = buffers.numbers(&sampler.input(), "times of keys")?;
        let times: Vec<f64> = times.into_iter().map(|[time]| time).collect();
        if times.is_empty() || !times.is_sorted_by(|a, b| a < b) || times.iter().any(|time| !time.is_finite()) {
            return Err("the times of its keys are not in order".into());
        }
        let output = sampler.output();
        let what = "values of keys";
        let property = channel.target().property();
        let numbers: Vec<f64> = match property {
            Property::Translation | Property::Scale => buffers.numbers::<3>(&output, what)?.concat(),
            Property::Rotation => buffers.numbers::<4>(&output, what)?.concat(),
            Property::MorphTargetWeights => buffers.numbers::<1>(&output, what)?.concat(),
        };
        let kind = sampler.interpolation();
        let keys = if kind == Kind::CubicSpline { 3 } else { 1 } * times.len();
        let width = numbers.len() / keys;
        let expected = match property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::MorphTargetWeights => width.max(1),
        };
        if width != expected || numbers.len() != keys * width {
            let (count, keys) = (numbers.len(), times.len());
            return Err(format!("it has {keys} keys, and {count} numbers for them").into());
        }
        if numbers.iter().any(|x| !x.is_finite()) {
            return Err("a value is no number".into());
        }
        let mut values: Vec<Vec<f64>> = numbers.chunks(width).map(<[f64]>::to_vec).collect();
        let is_turn = property == Property::Rotation;
        let interpolation = match kind {
            Kind::Linear => Interpolation::Linear,
            Kind::Step => Interpolation::Step,
            Kind::CubicSpline => return Ok(Self::Spline(Spline { times, values, is_turn })),
        };
        if is_turn {
            values.iter_mut().try_for_each(|q| normalize(q))?;
        }
        let turns = if is_turn { vec![0] } else { Vec::new() };
        Ok(Self::Curve(Curve::new(times, Parts { values, turns }, interpolation)))
    }

    fn at(&self, seconds: f64) -> Vec<f64> {
        match self {
            Self::Curve(curve) => curve.at(seconds),
            Self::Spline(spline) => spline.at(seconds),
        }
    }
}

fn normalize(q: &mut [f64]) -> Result<(), Flaw> {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length == 0.0 {
        return Err("a rotation is no quaternion of length 1".into());
    }
    q.iter_mut().for_each(|x| *x /= length);
    Ok(())
}

/// Cubic Hermite splines: each key has an incoming slope, a value and an outgoing slope (glTF 2.0, appendix C).
struct Spline {
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
    is_turn: bool,
}

impl Spline {
    fn at(&self, seconds: f64) -> Vec<f64> {
        let last = self.times.len() - 1;
        let later = self.times.partition_point(|time| *time <= seconds);
        let mut found = match later {
            0 => self.values[1].clone(),
            _ if later > last => self.values[3 * last + 1].clone(),
            _ => {
                let k = later - 1;
                let span = self.times[k + 1] - self.times[k];
                let u = (seconds - self.times[k]) / span;
                let [from, out, in_, to] = [3 * k + 1, 3 * k + 2, 3 * k + 3, 3 * k + 4].map(|i| &self.values[i]);
                let v = 1.0 - u;
                let hermite = |i: usize| {
                    from[i] * (1.0 + 2.0 * u) * v * v
                        + out[i] * span * u * v * v
                        + to[i] * u * u * (3.0 - 2.0 * u)
                        + in_[i] * span * u * u * (u - 1.0)
                };
                (0..from.len()).map(hermite).collect()
            }
        };
        if self.is_turn && normalize(&mut found).is_err() {
            // Halfway between opposites any rotation will do.
            found = vec![0.0, 0.0, 0.0, 1.0];
        }
        found
    }
}
