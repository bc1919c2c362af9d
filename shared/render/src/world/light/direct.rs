//! Light towards a point, and the density with which it is sampled.

use super::{DirectSample, Light, LightHit, LightKind, LightPoint, Pattern, SceneBounds, SoftBall};
use crate::math::{Frame, PI, Rgb, Vec2, Vec3};
use crate::sampler::Sampler;
use crate::warp;
use crate::world::geometry::rectangle::{Rectangle, SphericalRectangle};
use crate::world::geometry::{Object, Shape, SurfacePoint};
use std::sync::Arc;

impl Light {
    /// Draws the numbers for [`Self::sample_direct`]: a place on the light, and its primitive or the depth in a ball.
    #[inline]
    pub fn draw_direct(&self, objects: &[Object], sampler: &mut Sampler) -> (Vec2, f32) {
        let (has_places, has_more) = match &self.kind {
            LightKind::Point { .. } | LightKind::Projector(_) | LightKind::Goniometric(_) | LightKind::Laser(_) => {
                (false, false)
            }
            LightKind::Spot(spot) => (spot.radius > 0.0, spot.radius > 0.0),
            LightKind::Directional(sun) => (!sun.is_parallel(), false),
            LightKind::Area { object, .. } => (true, matches!(objects[*object as usize].shape, Shape::Mesh { .. })),
            LightKind::Environment(_) => (true, false),
            LightKind::Volume(_) => (true, true),
        };
        (sampler.next_2d_if(has_places), sampler.next_1d_if(has_more))
    }

    /// Draws a direction towards the light from a point, with numbers from [`Self::draw_direct`]. `None`: nothing
    /// arrives from the sampled place.
    pub fn sample_direct(&self, objects: &[Object], from: Vec3, u: Vec2, u_primitive: f32) -> Option<DirectSample> {
        match &self.kind {
            LightKind::Point { position, intensity } => from_point(*position - from, *intensity),
            LightKind::Spot(spot) => spot.towards(from, u, u_primitive),
            LightKind::Projector(projector) => {
                let intensity = projector.intensity(from - projector.position);
                from_point(projector.position - from, intensity).filter(|_| intensity != Rgb::ZERO)
            }
            LightKind::Goniometric(lamp) => {
                let intensity = lamp.intensity(from - lamp.position);
                from_point(lamp.position - from, intensity).filter(|_| intensity != Rgb::ZERO)
            }
            LightKind::Laser(laser) => laser.towards(from),
            LightKind::Directional(sun) => {
                let direction = sun.sample(u);
                Some(DirectSample {
                    wi: -direction,
                    normal: direction,
                    primitive: 0,
                    distance: f32::INFINITY,
                    weight: sun.fluence(),
                    pdf: sun.pdf(),
                    unmet: true,
                })
            }
            LightKind::Area {
                object,
                radiance,
                pattern,
                spread,
                ..
            } => {
                let shape = &objects[*object as usize].shape;
                let drawn = match self.view(shape, pattern, from) {
                    View::Cone(cone) => cone.sample(from, u),
                    View::Soft(cone) => {
                        let wi = cone.direction(u);
                        let distance = cone.distance / cone.axis.dot(wi);
                        let at = SurfacePoint {
                            point: from + wi * distance,
                            normal: -wi,
                            pdf_area: 0.0,
                            primitive: 0,
                            weights: Vec2::ZERO,
                        };
                        Towards {
                            wi,
                            distance,
                            pdf: cone.pdf(),
                            at,
                        }
                    }
                    View::Rectangle(rectangle, seen) => {
                        let on = rectangle.sample(&seen, u);
                        let at = SurfacePoint {
                            point: on.point,
                            normal: on.normal,
                            pdf_area: 0.0,
                            primitive: on.triangle,
                            weights: on.weights,
                        };
                        let towards = Towards::new(from, at);
                        let is_lit = self.facing(-towards.wi.dot(at.normal)) > 0.0;
                        let pdf = is_lit.then_some(1.0 / seen.solid_angle)?;
                        Towards { pdf, ..towards }
                    }
                    View::Area => {
                        let at = match pattern {
                            None => shape.sample_area(u, u_primitive),
                            Some(pattern) => pattern.sample(shape, u, u_primitive),
                        };
                        let towards = Towards::new(from, at);
                        let cos = self.facing(-towards.wi.dot(at.normal));
                        let pdf = per_solid_angle(at.pdf_area, cos, towards.distance)?;
                        Towards { pdf, ..towards }
                    }
                };
                let Towards { wi, distance, pdf, at } = drawn;
                let radiance = match pattern {
                    None => *radiance,
                    Some(pattern) => pattern.radiance_of(shape, &at),
                };
                let radiance = match spread {
                    None => radiance,
                    Some(spread) => match spread.share(self.facing(-wi.dot(at.normal))) {
                        0.0 => return None,
                        share => radiance * share,
                    },
                };
                Some(DirectSample {
                    wi,
                    normal: at.normal,
                    primitive: at.primitive,
                    distance,
                    weight: radiance / pdf,
                    pdf,
                    unmet: self.is_around(objects, from),
                })
            }
            LightKind::Environment(environment) => {
                let towards = environment.sample(u);
                Some(DirectSample {
                    wi: towards.dir,
                    normal: -towards.dir,
                    primitive: 0,
                    distance: f32::INFINITY,
                    weight: environment.radiance(towards.dir) / towards.pdf,
                    pdf: towards.pdf,
                    unmet: false,
                })
            }
            LightKind::Volume(light) => light.towards(from, u, u_primitive),
        }
    }

    /// Density per solid angle with which [`Self::sample_direct`] chooses `wi`, for a ray that met the light by chance.
    /// `hit` says where; it is `None` for a ray that left the scene or passes through an emitting medium. Zero for
    /// lights that no ray meets.
    pub fn pdf_direct(&self, objects: &[Object], from: Vec3, wi: Vec3, hit: Option<LightHit>) -> f32 {
        match (&self.kind, hit) {
            (LightKind::Area { object, pattern, .. }, Some(hit)) => {
                let shape = &objects[*object as usize].shape;
                let cos = self.facing(-wi.dot(hit.normal));
                match self.view(shape, pattern, from) {
                    View::Cone(cone) | View::Soft(cone) => cone.pdf(),
                    View::Rectangle(_, seen) if cos > 0.0 => 1.0 / seen.solid_angle,
                    View::Rectangle(..) => 0.0,
                    View::Area => {
                        per_solid_angle(pdf_area(shape, pattern, hit.normal, hit.primitive), cos, hit.distance)
                            .unwrap_or(0.0)
                    }
                }
            }
            (LightKind::Environment(environment), None) => environment.pdf(wi),
            (LightKind::Volume(light), _) => light.pdf_towards(from, wi),
            (LightKind::Area { .. } | LightKind::Environment(_), _)
            | (
                LightKind::Point { .. }
                | LightKind::Spot(_)
                | LightKind::Projector(_)
                | LightKind::Goniometric(_)
                | LightKind::Laser(_)
                | LightKind::Directional(_),
                _,
            ) => 0.0,
        }
    }
}

impl Light {
    /// How an area light is seen from a point. A ball that emits on both sides may show its inside through its outside.
    #[inline]
    fn view<'a>(&self, shape: &'a Shape, pattern: &Option<Arc<Pattern>>, from: Vec3) -> View<'a> {
        if let Some(mesh) = shape.mesh() {
            let rectangle = mesh.rectangle().filter(|_| pattern.is_none());
            return match rectangle.and_then(|rectangle| Some((rectangle, rectangle.seen_from(from)?))) {
                Some((rectangle, seen)) => View::Rectangle(rectangle, seen),
                None => View::Area,
            };
        }
        if let LightKind::Area { soft: true, .. } = self.kind {
            let cone = SoftBall::of(shape).and_then(|ball| Cone::around_soft(ball.center, ball.radius, from));
            return cone.map_or(View::Area, View::Soft);
        }
        let cone = match self.is_two_sided() {
            false => Cone::around(shape, from),
            true => None,
        };
        cone.map_or(View::Area, View::Cone)
    }

    /// Cosine to an area light's normal, on a side that emits.
    #[inline]
    fn facing(&self, cos: f32) -> f32 {
        if self.is_two_sided() { cos.abs() } else { cos }
    }

    /// Density of emitted photons per area across `wi` at a point, over the density with which [`Self::sample_direct`]
    /// chooses that light from there: the ratio for MIS between the two. `at`: where the light is met.
    pub fn photon_density(&self, objects: &[Object], bounds: &SceneBounds, from: Vec3, wi: Vec3, at: LightHit) -> f32 {
        let distance2 = at.distance * at.distance;
        match &self.kind {
            LightKind::Point { .. } => 0.25 / (PI * distance2),
            LightKind::Spot(spot) => spot.photon_density(from, wi, at.distance),
            LightKind::Projector(projector) => projector.pdf(-wi) / distance2,
            LightKind::Goniometric(lamp) => lamp.pdf(-wi) / distance2,
            LightKind::Laser(laser) => laser.density_at(from),
            LightKind::Directional(_) | LightKind::Environment(_) => 1.0 / bounds.disc_area(),
            LightKind::Volume(light) => light.photon_density(from, wi),
            LightKind::Area { object, pattern, .. } => {
                let shape = &objects[*object as usize].shape;
                let direct = self.pdf_direct(objects, from, wi, Some(at));
                let cos = self.facing(-wi.dot(at.normal));
                pdf_area(shape, pattern, at.normal, at.primitive) / (self.projected_solid_angle(cos) * direct)
            }
        }
    }
}

impl Light {
    /// Density of emitted photons per area across their direction and solid angle. It stays the same along specular
    /// paths. `on`: where on an area light. Zero for light that is parallel or comes from a point.
    pub fn emitted_density(&self, objects: &[Object], bounds: &SceneBounds, dir: Vec3, on: LightPoint) -> f32 {
        match &self.kind {
            LightKind::Area { object, pattern, .. } => {
                let shape = &objects[*object as usize].shape;
                let cos = self.facing(dir.dot(on.normal));
                pdf_area(shape, pattern, on.normal, on.primitive) / self.projected_solid_angle(cos)
            }
            LightKind::Environment(environment) => environment.pdf(-dir) / bounds.disc_area(),
            LightKind::Spot(spot) if spot.radius > 0.0 => spot.pdf(dir) / spot.area(),
            LightKind::Directional(sun) if !sun.is_parallel() => sun.pdf() / bounds.disc_area(),
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            // Caustics of such lights are left to photons.
            | LightKind::Volume(_) => 0.0,
        }
    }
}

/// Light of a point source at `offset`.
pub(super) fn from_point(offset: Vec3, intensity: Rgb) -> Option<DirectSample> {
    let distance = offset.length();
    (distance > 0.0).then(|| DirectSample {
        wi: offset / distance,
        normal: -offset / distance,
        primitive: 0,
        distance,
        weight: intensity / distance / distance,
        pdf: 1.0,
        unmet: true,
    })
}

/// Density per area with which a point of an emitting shape is drawn.
#[inline]
fn pdf_area(shape: &Shape, pattern: &Option<Arc<Pattern>>, normal: Vec3, primitive: u32) -> f32 {
    match pattern {
        None => shape.pdf_area(normal),
        Some(pattern) => pattern.pdf_area(shape, normal, primitive),
    }
}

/// How points of an area light are drawn.
enum View<'a> {
    /// Uniformly in the cone of a ball.
    Cone(Cone),
    /// Uniformly in the cone of the disc that represents a lamp with soft falloff.
    Soft(Cone),
    /// Uniformly in the solid angle.
    Rectangle(&'a Rectangle, SphericalRectangle),
    /// As for photon emission.
    Area,
}

/// A point of an emitting surface, seen from another point.
struct Towards {
    wi: Vec3,
    distance: f32,
    /// Per solid angle.
    pdf: f32,
    at: SurfacePoint,
}

impl Towards {
    /// Before its density is known.
    fn new(from: Vec3, at: SurfacePoint) -> Self {
        let offset = at.point - from;
        let distance = offset.length();
        Self {
            wi: offset / distance,
            distance,
            pdf: 0.0,
            at,
        }
    }
}

/// Converts a density per area to one per solid angle; `None` on the side that does not emit, and on overflow.
fn per_solid_angle(pdf_area: f32, cos: f32, distance: f32) -> Option<f32> {
    let pdf = pdf_area * distance * distance / cos;
    (cos > 0.0 && pdf > 0.0 && pdf.is_finite()).then_some(pdf)
}

/// The cone that a sphere fills, seen from outside.
pub(super) struct Cone {
    /// Unit direction to the centre.
    axis: Vec3,
    /// Distance of the centre.
    distance: f32,
    radius: f32,
    /// sin^2 of the half angle, which stays precise for small cones.
    sin2: f32,
    /// 1 - cos of the half angle.
    one_minus_cos: f32,
}

impl Cone {
    /// `None` unless the shape is a sphere under a similar map that emits outwards, with `from` outside of it.
    fn around(shape: &Shape, from: Vec3) -> Option<Self> {
        let Shape::Sphere { placement, flip: false } = shape else {
            return None;
        };
        let radius = placement.uniform_scale()?;
        Self::around_ball(Vec3::from(placement.render_from_object.translation), radius, from)
    }

    /// The cone of a disc through the ball's centre that faces the point; `None` from the centre.
    pub(super) fn around_soft(center: Vec3, radius: f32, from: Vec3) -> Option<Self> {
        let offset = center - from;
        let distance = offset.length();
        if distance <= 0.0 {
            return None;
        }
        let ratio = radius / distance;
        let sin2 = match ratio < 1.0 {
            true => ratio * ratio / (1.0 + ratio * ratio),
            false => 1.0 / (1.0 + 1.0 / (ratio * ratio)),
        };
        Some(Self {
            axis: offset / distance,
            distance,
            radius,
            sin2,
            one_minus_cos: sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt()),
        })
    }

    /// `None` from within the ball.
    pub(super) fn around_ball(center: Vec3, radius: f32, from: Vec3) -> Option<Self> {
        let offset = center - from;
        let distance = offset.length();
        if distance <= radius {
            return None;
        }
        let ratio = radius / distance;
        let sin2 = ratio * ratio;
        Some(Self {
            axis: offset / distance,
            distance,
            radius,
            sin2,
            one_minus_cos: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        })
    }

    pub(super) fn pdf(&self) -> f32 {
        1.0 / (2.0 * PI * self.one_minus_cos)
    }

    /// The sphere's normal where a ray meets it.
    fn normal(&self, wi: Vec3, distance: f32) -> Vec3 {
        (wi * distance - self.axis * self.distance) / self.radius
    }

    /// A direction uniform in the cone.
    pub(super) fn direction(&self, u: Vec2) -> Vec3 {
        Frame::from_normal(self.axis).to_world(warp::uniform_cap(u, self.one_minus_cos))
    }

    /// A direction uniform in the cone from a point, and where it meets the sphere.
    fn sample(&self, from: Vec3, u: Vec2) -> Towards {
        let one_minus_cos = u.x * self.one_minus_cos;
        let cos = 1.0 - one_minus_cos;
        let sin2 = one_minus_cos * (2.0 - one_minus_cos);
        // The nearer root of t^2 - 2 d cos t + d^2 - r^2 = 0: the product of both over the farther one.
        let half_chord = self.radius * (1.0 - sin2 / self.sin2).max(0.0).sqrt();
        let product = (self.distance - self.radius) * (self.distance + self.radius);
        let distance = product / (self.distance * cos + half_chord);
        let wi = self.direction(u);
        Towards {
            wi,
            distance,
            pdf: self.pdf(),
            at: SurfacePoint {
                point: from + wi * distance,
                normal: self.normal(wi, distance),
                pdf_area: 0.0,
                primitive: 0,
                weights: Vec2::ZERO,
            },
        }
    }
}
