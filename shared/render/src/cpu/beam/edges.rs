//! Kernels at edges, corners and creases.
//!
//! A kernel that reaches over the edge of a surface, or out of a medium, would lose that part of its photon's flux. So
//! displacements are drawn from the kernel until one lands where a look-up would find the photon. The mean number of
//! draws is one over the share of the kernel that lands there. Multiplying the photon's power by the number of draws
//! keeps all of its flux without an integral (Booth 2007, unbiased Monte Carlo estimation of the reciprocal of an
//! integral).
//!
//! Walls end a kernel (`walls`). Glass does not: look-ups are made on both of its sides, and find the photon.

use super::walls;
use crate::cpu::kernel;
use crate::cpu::photon_map::{Crossing, MAX_PLANE_DISTANCE, MIN_NORMAL_COSINE};
use crate::math::{Frame, PI, Ray, Vec3, sin_cos};
use crate::sampler::Sampler;
use crate::world::Scene;
use crate::world::bsdf::{BsdfFlags, Material};
use crate::world::geometry::{Boundary, SurfaceHit};

/// If this many displacements all miss the surface, the kernel counts as missing it altogether, and is narrowed.
const TRIALS_OF_RADIUS: u32 = 64;
/// Most trials in one count; hardly ever reached.
const MOST_TRIALS: u32 = 4096;
/// Counts of trials to average.
const COUNTS: u32 = 4;
/// Beams that graze a surface more than this are displaced along it as if they did not.
const LEAST_COSINE: f32 = 0.25;
/// Most halvings of a kernel's radius.
const MOST_HALVINGS: u32 = 8;

/// An unbiased estimate of one over the probability that a trial succeeds: the mean of several counts of trials until a
/// success. None if that is out of reach.
fn reciprocal(mut succeeds: impl FnMut() -> bool) -> Option<f32> {
    let mut trials = 0;
    for _ in 0..COUNTS {
        trials += (1..=MOST_TRIALS).find(|_| succeeds())?;
    }
    Some(trials as f32 / COUNTS as f32)
}

/// What a photon's rays see.
pub(super) struct Probe<'a, F> {
    pub scene: &'a Scene,
    /// Objects that the scene's rules hide.
    pub hides: F,
}

/// The kernel of a surface photon.
pub(super) struct SurfaceKernel {
    pub radius: f32,
    /// Factor on the photon's power.
    pub factor: f32,
    pub walls: Crossing,
}

impl<F: Fn(u32) -> bool> Probe<'_, F> {
    /// The kernel of a surface photon, of at most `radius`. `side`: a direction on the side of the surface that the
    /// photon came from.
    pub(super) fn surface(&self, hit: &SurfaceHit, side: Vec3, radius: f32, sampler: &mut Sampler) -> SurfaceKernel {
        let n = hit.ng * hit.ng.dot(side).signum();
        let (radius, factor) = self.on_surface(hit, n, radius, sampler);
        SurfaceKernel {
            radius,
            factor,
            walls: walls::crossing(self.scene, hit.point, n, radius, height(hit, radius)),
        }
    }

    /// The kernel's radius, and the factor on the photon's power.
    fn on_surface(&self, hit: &SurfaceHit, n: Vec3, radius: f32, sampler: &mut Sampler) -> (f32, f32) {
        let frame = Frame::from_normal(n);
        let mut is_on = |radius: f32| {
            let u = sampler.next_2d();
            let r = radius * kernel::sample_disc(u.x);
            let (sin, cos) = sin_cos(2.0 * PI * u.y);
            let offset = frame.s * (r * cos) + frame.t * (r * sin);
            self.is_on_surface(hit, n, offset, radius)
        };
        if is_on(radius) {
            return (radius, 1.0);
        }
        // The radius is chosen by separate trials: if the counted trials chose it, the count would come out too small.
        let mut narrower = radius;
        for _ in 0..MOST_HALVINGS {
            if (0..TRIALS_OF_RADIUS).any(|_| is_on(narrower)) {
                break;
            }
            narrower *= 0.5;
        }
        // Let p be the share of the kernel that lands on the surface. Photons whose first trial hit, a share p of all,
        // bring p * p of the flux. The other 1 - p get here, and each has 1 + p times its flux left to bring.
        let first = match narrower == radius {
            true => return (radius, 1.0 + reciprocal(|| is_on(radius)).unwrap_or(0.0)),
            false if is_on(radius) => 2.0,
            false => 1.0,
        };
        (narrower, first * reciprocal(|| is_on(narrower)).unwrap_or(1.0))
    }

    /// Factor on a beam's power for the part of its kernel that lies outside the medium where it starts. `normal`: of
    /// the surface that it starts on.
    pub(super) fn beam(&self, ray: &Ray, normal: Option<Vec3>, radius: f32, sampler: &mut Sampler) -> f32 {
        let frame = Frame::from_normal(ray.dir);
        let mut is_in = || {
            let (u, v) = (sampler.next_2d(), sampler.next_2d());
            let r = radius * kernel::sample_line(u, v.x);
            let (sin, cos) = sin_cos(PI * v.y);
            let across = frame.s * (r * cos) + frame.t * (r * sin);
            let (from, offset) = match normal {
                None => (ray.origin, across),
                Some(n) => {
                    // Above the point where the displaced beam would start.
                    let n = n * n.dot(ray.dir).signum();
                    let along = across.dot(n) / n.dot(ray.dir).max(LEAST_COSINE);
                    let offset = across - ray.dir * along;
                    let height = MAX_PLANE_DISTANCE * radius;
                    (ray.origin + n * height, offset - n * offset.dot(n))
                }
            };
            self.is_clear(from, offset)
        };
        if is_in() {
            return 1.0;
        }
        1.0 + reciprocal(is_in).unwrap_or(0.0)
    }

    /// Whether the point at an offset along a surface's tangent plane lies over a similar surface, with nothing in
    /// between. The hit's own uncertainty is not counted against it, on a ground much larger than the kernel.
    fn is_on_surface(&self, hit: &SurfaceHit, n: Vec3, offset: Vec3, radius: f32) -> bool {
        let height = height(hit, radius);
        let start = hit.point + n * height;
        let down = Ray {
            origin: start + offset,
            dir: -n,
        };
        // No look-up is made on clear glass or hair.
        let is_passed = |object: u32| {
            let material = self.scene.material_of(object);
            material.is_specular() && material.has(BsdfFlags::TRANSMITS)
                || material.has(BsdfFlags::THIN)
                || (self.hides)(object)
        };
        let hit = self.scene.meets(&down, 2.0 * height, &is_passed);
        let covers = |hit: SurfaceHit| {
            let off = ((hit.t - height).abs() - hit.clearance).max(0.0);
            hit.ng.dot(n).abs() >= MIN_NORMAL_COSINE && offset.length_squared() + off * off < radius * radius
        };
        hit.is_some_and(covers) && !walls::stand_between(self.scene, start, offset)
    }

    /// Whether only glass within one medium stands between a point and another.
    fn is_clear(&self, from: Vec3, offset: Vec3) -> bool {
        let scene = self.scene;
        let mut left = offset.length();
        let mut ray = Ray {
            origin: from,
            dir: offset / left,
        };
        let passes = |material: &Material, boundary: Option<Boundary>| {
            material.has(BsdfFlags::TRANSMITS | BsdfFlags::THIN) && boundary.is_none_or(|of| of.interior == of.exterior)
        };
        let is_passed = |object: u32| {
            let of = &scene.objects()[object as usize];
            (self.hides)(object) || !scene.meetings.has(object) && passes(scene.material_of(object), of.boundary)
        };
        if scene.meetings.is_empty() {
            return left <= 0.0 || !(scene.geometry).occluded(scene.objects(), &ray, left, &is_passed);
        }
        while left > 0.0
            && let Some(hit) = scene.meets(&ray, left, &is_passed)
        {
            if !passes(scene.material(&hit), hit.boundary) {
                return false;
            }
            left -= hit.t + hit.clearance;
            ray = hit.spawn_ray(ray.dir);
        }
        true
    }
}

/// Height above the surface from which a kernel looks for obstacles.
fn height(hit: &SurfaceHit, radius: f32) -> f32 {
    MAX_PLANE_DISTANCE * radius + hit.clearance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::photon_map::{Arrival, SeenBy, SurfacePhoton, SurfacePhotonMap};
    use crate::math::{Frame, Rgb, Vec2};
    use crate::plan::weights::FoundBy;
    use crate::sampler::Purpose;
    use crate::world::bsdf::{Material, MaterialKind, Tint};
    use crate::world::camera::{Camera, Projection};
    use crate::world::filter::PixelFilter;
    use crate::world::geometry::{Mesh, Object, Placement, Shape};
    use crate::world::interrupt::Interrupt;
    use crate::world::light::SceneBounds;
    use crate::world::texture::Texture;
    use crate::world::{RenderDefaults, SceneDescription};
    use glam::Affine3A;
    use std::sync::Arc;

    /// A mesh, transformed by a map.
    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]], map: Affine3A) -> Shape {
        Shape::Mesh {
            mesh: Arc::new(Mesh {
                positions: positions.iter().map(|p| map.transform_point3((*p).into())).collect(),
                triangles: triangles.to_vec(),
                ..Mesh::default()
            }),
            placement: Placement::IDENTITY,
        }
    }

    /// The square of side 2 in the xy plane.
    fn square(map: Affine3A) -> Shape {
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        mesh(&corners, &[[0, 1, 2], [0, 2, 3]], map)
    }

    fn cube() -> Shape {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
        let corners: [[f32; 3]; 8] = std::array::from_fn(corner);
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        mesh(&corners, &triangles, Affine3A::IDENTITY)
    }

    /// A scene of these shapes: the first diffuse, the second of this material (0: diffuse, 1: a pane of
    /// glass).
    fn scene(shapes: Vec<Shape>, second: u32) -> Scene {
        let of_kind = |kind| Material::new(kind, true);
        let white = || Texture::Constant(Rgb::ONE);
        let pane = MaterialKind::ThinDielectric {
            eta: 1.5,
            tint: Tint {
                reflectance: white(),
                transmittance: white(),
            },
        };
        let object = |(shape, material)| Object {
            material,
            ..Object::new(shape)
        };
        Scene::new(SceneDescription {
            camera: Camera {
                projection: Projection::Perspective,
                position: Vec3::ZERO,
                frame: Frame::from_normal(Vec3::Z),
                half_width: 0.3,
                shift: Vec2::ZERO,
                aperture: 0.0,
                focus_distance: 1.0,
                width: 1,
                height: 1,
                filter: PixelFilter::Box,
            },
            camera_medium: None,
            world_medium: None,
            objects: shapes.into_iter().zip([0, second]).map(object).collect(),
            material_names: Default::default(),
            media_names: Vec::new(),
            materials: vec![of_kind(MaterialKind::Diffuse { reflectance: white() }), of_kind(pane)],
            media: Vec::new(),
            lights: Vec::new(),
            bounds: SceneBounds {
                center: Vec3::ZERO,
                radius: 2.0,
            },
            defaults: RenderDefaults::default(),
            rules: None,
            notes: Vec::new(),
            photon_rules: Vec::new(),
            motion: None,
            has_frames: false,
            interrupt: Interrupt::default(),
        })
    }

    /// All of a photon's flux is found on the surface: flat and bent ones, at edges, with kernels of all sizes.
    #[test]
    fn no_flux_is_lost_and_none_is_made() {
        let placed = |map: Affine3A| Placement {
            render_from_object: map,
            object_from_render: map.inverse(),
        };
        let sphere = Shape::Sphere {
            placement: Placement::IDENTITY,
            flip: false,
        };
        let tube = Shape::Cylinder {
            placement: placed(
                Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.0)) * Affine3A::from_scale(Vec3::new(0.3, 0.3, 2.0)),
            ),
            flip: false,
        };
        let upright = Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let scenes = [
            ("sphere", vec![sphere]),
            ("tube", vec![tube]),
            ("square", vec![square(Affine3A::IDENTITY)]),
            ("cube", vec![cube()]),
            (
                "pane that stands on a plate",
                vec![square(Affine3A::IDENTITY), square(upright)],
            ),
            (
                "wall that stands on a plate",
                vec![square(Affine3A::IDENTITY), square(upright)],
            ),
            (
                "short wall that stands on a plate",
                vec![
                    square(Affine3A::IDENTITY),
                    square(upright * Affine3A::from_scale(Vec3::new(1.0, 0.3, 1.0))),
                ],
            ),
        ];
        for (name, shapes) in scenes {
            let scene = scene(shapes, u32::from(name.starts_with("pane")));
            let probe = Probe {
                scene: &scene,
                hides: |_: u32| false,
            };
            let on = |u: Vec2, primitive: f32| {
                let point = scene.objects()[0].shape.sample_area(u, primitive);
                let ray = Ray {
                    origin: point.point + point.normal * 0.01,
                    dir: -point.normal,
                };
                let hit = scene.first_hit(&ray, |object| object > 0);
                (hit.expect("the surface"), point)
            };
            for radius in [0.1, 0.5, 4.0] {
                let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
                let (mut sum, mut squares) = (0.0, 0.0);
                let count = 3000;
                for _ in 0..count {
                    let (hit, at) = on(sampler.next_2d(), sampler.next_1d());
                    let SurfaceKernel { radius, factor, walls } = probe.surface(&hit, at.normal, radius, &mut sampler);
                    let map = SurfacePhotonMap::new(vec![SurfacePhoton {
                        point: hit.point,
                        ng: hit.ng,
                        wi: at.normal,
                        power: Rgb::splat(factor),
                        radius,
                        walls,
                        arrival: Arrival::Caustic,
                        found_by: FoundBy::Photons,
                        lobes: SeenBy::Wide,
                        group: None,
                        wave: None,
                        light_kind: 0,
                    }]);
                    let mut flux = 0.0;
                    for _ in 0..400 {
                        let (x, seen) = on(sampler.next_2d(), sampler.next_1d());
                        map.gather(x.point, x.ng, |photon, kernel| {
                            if !photon.is_hidden_from(&scene, x.point) {
                                flux += f64::from(photon.power.x * kernel / seen.pdf_area) / 400.0;
                            }
                        });
                    }
                    sum += flux;
                    squares += flux * flux;
                }
                let n = f64::from(count);
                let error = ((squares / n - sum * sum / (n * n)) / n).sqrt();
                let z = (sum / n - 1.0) / error;
                // Twenty-one tests at a significance of 1e-3 together.
                assert!(z.abs() < 4.07, "{name}, radius {radius}: {} +- {error}", sum / n);
            }
        }
    }
}
