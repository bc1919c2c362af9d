//! A scene under construction: its contents by name, in units of about the size of what is seen.

use super::assets::Asset;
use super::draw::{Draw, number, table, vector};
use super::material::{self, Lobes};
use super::medium::{self, Extent};
use glam::DVec3;
use toml::{Table, Value};

/// A scene under construction.
#[derive(Debug)]
pub struct Builder {
    /// The source of its numbers.
    pub draw: Draw,
    /// Scene units per unit of the builder.
    pub scale: f64,
    /// Which lobes surfaces may have.
    pub lobes: Lobes,
    /// Name of the world's medium, when there is one.
    pub world: Option<String>,
    /// Occupied balls: the objects of the scene, and the camera.
    pub taken: Vec<(DVec3, f64)>,
    pub(super) media: Table,
    pub(super) materials: Table,
    pub(super) shapes: Vec<Table>,
    pub(super) lights: Vec<Table>,
    pub(super) rules: Vec<Table>,
    pub(super) assets: Vec<Asset>,
}

/// Where a shape given in [-1, 1]^3 goes.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Half sides.
    pub half: DVec3,
    /// Axis and angle in degrees of a rotation.
    pub turn: (DVec3, f64),
    /// Where its centre goes.
    pub center: DVec3,
}

impl Builder {
    /// An empty scene.
    pub fn new(mut draw: Draw) -> Self {
        let scale = match draw.chance(0.5) {
            true => 1.0,
            false => draw.log_between(1e-3, 1e3),
        };
        let lobes = draw.pick(&[Lobes::Any, Lobes::Any, Lobes::Wide]);
        Self {
            draw,
            scale,
            lobes,
            world: None,
            taken: Vec::new(),
            media: Table::new(),
            materials: Table::new(),
            shapes: Vec::new(),
            lights: Vec::new(),
            rules: Vec::new(),
            assets: Vec::new(),
        }
    }

    /// A length in scene units.
    pub fn length(&self, x: f64) -> Value {
        number(x * self.scale)
    }

    /// A position in scene units.
    pub fn position(&self, p: DVec3) -> Value {
        vector(p * self.scale)
    }

    /// The transform steps of a pose.
    pub fn steps(&self, pose: &Pose) -> Value {
        let mut steps = vec![table([("scale", self.position(pose.half))]).into()];
        let (axis, angle) = pose.turn;
        if angle != 0.0 {
            let turn = table([("axis", vector(axis)), ("angle", number(angle))]);
            steps.push(table([("rotate", turn.into())]).into());
        }
        if pose.center != DVec3::ZERO {
            steps.push(table([("translate", self.position(pose.center))]).into());
        }
        Value::Array(steps)
    }

    /// The name of a new material.
    pub fn material(&mut self, material: Table) -> String {
        let kind = material["type"].as_str().unwrap_or("material");
        let name = format!("{kind}{}", self.materials.len());
        self.materials.insert(name.clone(), material.into());
        name
    }

    /// The name of a new opaque material.
    pub fn opaque(&mut self, bright: f64) -> String {
        let material = material::opaque(&mut self.draw, self.lobes, bright);
        self.material(material)
    }

    /// The name of the boundary material.
    pub fn null(&mut self) -> String {
        let null = table([("type", "null".into())]);
        self.materials.insert("null".into(), null.into());
        "null".into()
    }

    /// The name of a new medium for an object of this size, in units of the builder.
    pub fn medium(&mut self, across: f64, max_depth: f64, steps: Option<Value>) -> String {
        let name = format!("medium{}", self.media.len());
        let extent = Extent {
            across: across * self.scale,
            max_depth,
            steps,
        };
        let (medium, files) = medium::medium(&mut self.draw, &name, &extent);
        self.media.insert(name.clone(), medium.into());
        self.assets.extend(files);
        name
    }

    /// A new file's name.
    pub fn asset(&mut self, ending: &str, bytes: Vec<u8>) -> String {
        let name = format!("file{}.{ending}", self.assets.len());
        self.assets.push(Asset {
            name: name.clone(),
            bytes,
        });
        name
    }

    /// A place in a box for a ball of this radius, at some distance from all others.
    pub fn place(&mut self, low: DVec3, high: DVec3, radius: f64) -> Option<DVec3> {
        for _ in 0..30 {
            let p = self.draw.point(low, high);
            let is_free = |(c, r): &(DVec3, f64)| p.distance(*c) > r + radius + 0.03;
            if self.taken.iter().all(is_free) {
                self.taken.push((p, radius));
                return Some(p);
            }
        }
        None
    }
}
