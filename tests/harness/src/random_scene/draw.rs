//! Numbers for scenes, drawn from a seed and short enough to read.

use beamfarm_render::sampler::{Purpose, Sampler};
use glam::DVec3;
use std::f64::consts::TAU;
use toml::Value;

/// A stream of random numbers.
#[derive(Debug)]
pub struct Draw(Sampler);

impl Draw {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Sampler::new(seed, 0, Purpose::Test, 0))
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0.next_1d().into()
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// In [low, high), log-uniform.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.between(libm::log(low), libm::log(high)))
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// One of them.
    pub fn pick<T: Copy>(&mut self, among: &[T]) -> T {
        among[(self.unit() * among.len() as f64) as usize]
    }

    /// Each of three channels between the bounds; often all three are equal.
    pub fn channels(&mut self, low: f64, high: f64) -> [f64; 3] {
        match self.chance(0.4) {
            true => [self.between(low, high); 3],
            false => std::array::from_fn(|_| self.between(low, high)),
        }
    }

    /// On the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = libm::sincos(self.between(0.0, TAU));
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    /// In a box.
    pub fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        DVec3::new(
            self.between(low.x, high.x),
            self.between(low.y, high.y),
            self.between(low.z, high.z),
        )
    }
}

/// A number to four digits. The same number always gets the same digits, so that what touches still touches.
pub fn number(x: f64) -> Value {
    Value::Float(format!("{x:.3e}").parse().unwrap_or(x))
}

/// A vector.
pub fn vector(v: DVec3) -> Value {
    Value::Array(v.to_array().map(number).to_vec())
}

/// A colour; a single number for grey.
pub fn colour(channels: [f64; 3]) -> Value {
    match channels {
        [r, g, b] if r == g && g == b => number(r),
        _ => Value::Array(channels.map(number).to_vec()),
    }
}

/// A table of these entries.
pub fn table<const N: usize>(entries: [(&str, Value); N]) -> toml::Table {
    entries
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect()
}
