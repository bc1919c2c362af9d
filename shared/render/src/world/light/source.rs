//! Lights reduced to what matters for the choice among them.

use super::{Laser, Light, LightKind, SceneBounds, Spread};
use crate::math::{PI, Vec3, cos, mean, sin};
use crate::world::geometry::{Object, Shape, bounds};

/// The lights of a scene, reduced to what matters for the choice among them.
#[derive(Clone, Debug, Default)]
pub struct LightSources {
    /// By light number.
    pub sources: Vec<Source>,
}

/// With more lights than this, they are chosen by power alone.
pub const MAX_WEIGHED: usize = 32;

/// A light, reduced to what matters for the choice; its exact contribution is evaluated afterwards.
#[derive(Clone, Debug)]
pub enum Source {
    /// At finite distance.
    Near {
        /// Centre of the light.
        center: Vec3,
        /// Squared radius.
        softening: f32,
        /// Mean channel of its flux per steradian, W/sr.
        intensity: f32,
        /// Where it shines.
        region: Region,
    },
    /// Along a beam of parallel light.
    Beam(Laser),
    /// From infinitely far away.
    Far {
        /// Mean channel of the irradiance, W/m^2.
        irradiance: f32,
        /// The direction that it travels in, if there is one.
        direction: Option<Vec3>,
        /// The sine of the half angle of the cone around it.
        spread: f32,
    },
}

/// Where a light shines.
#[derive(Clone, Debug)]
pub enum Region {
    /// All around.
    Everywhere,
    /// Angles to the axis below a limit with a positive cosine.
    Cone {
        /// Its tip.
        apex: Vec3,
        /// Unit vector.
        axis: Vec3,
        /// Cosine of the half angle.
        cos: f32,
    },
    /// In front of four planes through the apex.
    Pyramid {
        /// Its tip.
        apex: Vec3,
        /// Inward normals.
        planes: [Vec3; 4],
    },
    /// In front of a plane.
    Before {
        /// A point on the plane.
        point: Vec3,
        /// Unit vector.
        normal: Vec3,
    },
}

impl LightSources {
    /// Prepares the lights.
    pub fn new(lights: &[Light], objects: &[Object], bounds: &SceneBounds) -> Self {
        let sources = lights.iter().map(|light| Source::new(light, objects, bounds));
        Self {
            sources: sources.collect(),
        }
    }
}

impl Source {
    fn new(light: &Light, objects: &[Object], scene: &SceneBounds) -> Self {
        let power = mean(light.power(objects, scene));
        match &light.kind {
            LightKind::Point { position, intensity } => Self::Near {
                center: *position,
                softening: 0.0,
                intensity: mean(*intensity),
                region: Region::Everywhere,
            },
            LightKind::Spot(spot) => {
                // Slightly wider than the cone: the extra directions are dark.
                let cos = cos(spot.cutoff * (1.0 + 1e-5)) * (1.0 - 1e-6);
                Self::Near {
                    center: spot.position,
                    softening: spot.radius * spot.radius,
                    intensity: mean(spot.intensity),
                    region: if cos > 0.0 {
                        Region::Cone {
                            // The cone around the ball.
                            apex: spot.position - spot.frame.n * (spot.radius / sin(spot.cutoff)),
                            axis: spot.frame.n,
                            cos,
                        }
                    } else {
                        Region::Everywhere
                    },
                }
            }
            LightKind::Projector(projector) => Self::Near {
                center: projector.position,
                softening: 0.0,
                intensity: projector.typical_intensity(),
                region: Region::Pyramid {
                    apex: projector.position,
                    planes: projector.planes(),
                },
            },
            LightKind::Goniometric(lamp) => {
                let widest = lamp.table.widest() * (1.0 + 1e-5);
                let cos = cos(widest) * (1.0 - 1e-6);
                let (solid_angle, region) = match cos > 0.02 {
                    true => {
                        let (apex, axis) = (lamp.position, lamp.axes[2]);
                        let half = sin(0.5 * widest);
                        (4.0 * PI * half * half, Region::Cone { apex, axis, cos })
                    }
                    false => (4.0 * PI, Region::Everywhere),
                };
                Self::Near {
                    center: lamp.position,
                    softening: 0.0,
                    intensity: power / solid_angle,
                    region,
                }
            }
            LightKind::Laser(laser) => Self::Beam(*laser),
            LightKind::Directional(sun) => Self::Far {
                irradiance: mean(sun.irradiance),
                direction: Some(sun.direction),
                spread: sin(sun.half_angle),
            },
            LightKind::Environment(environment) => Self::Far {
                irradiance: mean(environment.fluence()),
                direction: None,
                spread: 0.0,
            },
            LightKind::Volume(light) => {
                let (center, radius) = light.ball();
                Self::Near {
                    center,
                    softening: radius * radius,
                    intensity: power / (4.0 * PI),
                    region: Region::Everywhere,
                }
            }
            LightKind::Area { object, .. } => {
                let shape = &objects[*object as usize].shape;
                let (min, max) = bounds(shape);
                let half = 0.5 * (max - min);
                let radius = match shape {
                    Shape::Sphere { .. } => half.max_element(),
                    Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Mesh { .. } | Shape::Strands { .. } => {
                        half.length()
                    }
                };
                let center = 0.5 * (min + max);
                let cone = light.spread().map(Spread::cone);
                let (solid_angle, region) = match plane(shape) {
                    // All the light of a wide cone lies in a cone around the light, with its tip farther behind.
                    Some((_, axis)) if !light.is_two_sided() && cone.is_some_and(|[_, cos, _]| cos > 0.02) => {
                        let [tan, cos, share] = cone.unwrap_or_default();
                        let region = Region::Cone {
                            apex: center - axis * (radius / tan),
                            axis,
                            cos: cos * (1.0 - 1e-5),
                        };
                        (2.0 * PI * share, region)
                    }
                    Some((point, normal)) if !light.is_two_sided() => (2.0 * PI, Region::Before { point, normal }),
                    Some(_) | None => (4.0 * PI, Region::Everywhere),
                };
                Self::Near {
                    center,
                    softening: radius * radius,
                    intensity: power / solid_angle,
                    region,
                }
            }
        }
    }
}

/// A point and the normal of a flat shape.
fn plane(shape: &Shape) -> Option<(Vec3, Vec3)> {
    let at = shape.sample_area(glam::Vec2::splat(0.4), 0.4);
    match shape {
        Shape::Disc { .. } => Some((at.point, at.normal)),
        Shape::Mesh { mesh, .. } => (mesh.triangles.len() <= 2 && mesh.is_flat()).then_some((at.point, at.normal)),
        Shape::Sphere { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => None,
    }
}
