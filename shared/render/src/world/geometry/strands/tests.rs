use super::*;
use crate::math::{PI, Ray, sin_cos};
use crate::sampler::{Purpose, Sampler};
use crate::warp;
use crate::world::geometry::{Geometry, Object, Placement, Shape, SurfaceHit};
use glam::{Affine3A, DVec3, Vec4Swizzles};
use std::sync::Arc;

fn object(strands: Strands, map: Affine3A) -> [Object; 1] {
    let placement = Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    };
    [Object::new(Shape::Strands {
        strands: Arc::new(strands),
        placement,
    })]
}

fn hit(geometry: &Geometry, objects: &[Object], ray: &Ray) -> Option<SurfaceHit> {
    geometry.intersect(objects, ray, f32::INFINITY, &|_| false)
}

/// Curves that wind through a cube of side 2, with radii from 0.02 to 0.1.
fn tangle(basis: Basis, curves: u32, seed: u64) -> Strands {
    let mut sampler = Sampler::new(seed, 0, Purpose::Test, 0);
    let mut points = Vec::new();
    let lengths: Vec<u32> = (0..curves).map(|i| 4 + i % 5).collect();
    for length in &lengths {
        let mut at = 2.0 * Vec3::from((sampler.next_2d(), sampler.next_1d())) - 1.0;
        for _ in 0..*length {
            points.push(at.extend(0.02 + 0.08 * sampler.next_1d()));
            at += 0.4 * warp::uniform_sphere(sampler.next_2d());
        }
    }
    Strands::new(basis, points, &lengths)
}

fn ray_through(sampler: &mut Sampler) -> Ray {
    let origin = 3.0 * warp::uniform_sphere(sampler.next_2d());
    let to = 1.6 * Vec3::from((sampler.next_2d(), sampler.next_1d())) - 0.8;
    Ray {
        origin,
        dir: (to - origin).normalize(),
    }
}

/// Reference by de Boor's and Catmull's rules from control points alone: a large number of balls on the piece, each
/// tested against a ray.
fn balls(strands: &Strands, each: usize) -> Vec<(DVec3, f64)> {
    let mut balls = Vec::new();
    for &first in &strands.first {
        let at = (first & !(BEGINS | ENDS)) as usize;
        let p = |i: usize| strands.points[i].as_dvec4();
        for k in 0..=each {
            let t = k as f64 / each as f64;
            let (t2, t3) = (t * t, t * t * t);
            let ball = match strands.basis {
                Basis::Balls => p(at),
                Basis::Linear => p(at) * (1.0 - t) + p(at + 1) * t,
                Basis::BSpline => {
                    let s = 1.0 - t;
                    let (before, after) = (3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0);
                    (p(at) * (s * s * s) + p(at + 1) * before + p(at + 2) * after + p(at + 3) * t3) / 6.0
                }
                Basis::CatmullRom => {
                    let before = p(if first & BEGINS == 0 { at - 1 } else { at });
                    let after = p(if first & ENDS == 0 { at + 2 } else { at + 1 });
                    let (b, c) = (p(at), p(at + 1));
                    let twice = b * 2.0
                        + (c - before) * t
                        + (before * 2.0 - b * 5.0 + c * 4.0 - after) * t2
                        + (b * 3.0 - before - c * 3.0 + after) * t3;
                    twice * 0.5
                }
            };
            balls.push((ball.truncate(), ball.w.max(0.0)));
        }
    }
    balls
}

/// Hits agree with thousands of balls along each curve, except for rays that graze it.
#[test]
fn hits_are_those_of_balls_along_the_curves() {
    for basis in [Basis::Balls, Basis::Linear, Basis::BSpline, Basis::CatmullRom] {
        let strands = tangle(basis, 5, 3);
        let each = if basis == Basis::Balls { 1 } else { 400 };
        let balls = balls(&strands, each);
        let objects = object(strands, Affine3A::IDENTITY);
        let geometry = Geometry::new(&objects);
        let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
        let (mut met, mut differing) = (0, 0);
        for _ in 0..1500 {
            let ray = ray_through(&mut sampler);
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3().normalize());
            let into = balls.iter().filter_map(|(center, radius)| {
                let to = *center - o;
                let h = radius * radius - to.reject_from_normalized(d).length_squared();
                (h >= 0.0).then(|| to.dot(d) - h.sqrt())
            });
            let expected = into.fold(f64::INFINITY, f64::min);
            let found = hit(&geometry, &objects, &ray);
            assert_eq!(
                found.is_some(),
                geometry.occluded(&objects, &ray, f32::INFINITY, &|_| false)
            );
            met += u32::from(found.is_some());
            let t = found.as_ref().map_or(f64::INFINITY, |hit| f64::from(hit.t));
            // Parts of cubic pieces deviate by at most a twentieth of a radius.
            let is_same = t == expected || (t - expected).abs() < 0.02;
            differing += u32::from(!is_same);
            if let Some(found) = found.filter(|_| is_same) {
                assert!((found.point - ray.at(found.t)).length() < 1e-5);
                assert!((found.ng.length() - 1.0).abs() < 1e-5 && found.ng.dot(ray.dir) < 0.0);
                let nearest = balls
                    .iter()
                    .map(|(center, radius)| (found.point.as_dvec3().distance(*center) - radius).abs());
                assert!(nearest.fold(f64::INFINITY, f64::min) < 6e-3, "{basis:?}");
            }
        }
        assert!(met > 80 && differing <= met / 40, "{basis:?}: {differing} of {met}");
    }
}

/// Rays aimed at joints of pieces and of parts never miss: the ball there is inside.
#[test]
fn no_ray_gets_through_a_joint() {
    for (basis, size) in [(Basis::Linear, 1.0), (Basis::BSpline, 1e-3), (Basis::CatmullRom, 1e3)] {
        let strands = tangle(basis, 40, 7);
        let joints: Vec<_> = balls(&strands, 8)
            .into_iter()
            .filter(|(_, radius)| *radius > 0.0)
            .collect();
        let map = Affine3A::from_scale(Vec3::splat(size)) * Affine3A::from_translation(Vec3::new(0.3, -5.0, 1.0));
        let objects = object(strands, map);
        let geometry = Geometry::new(&objects);
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let rays = std::env::var("BEAMFARM_LONG").map_or(60_000, |_| 1_000_000);
        for i in 0..rays {
            let (center, radius) = joints[i % joints.len()];
            let side = warp::uniform_sphere(sampler.next_2d());
            let to = center.as_vec3() + side * (0.9 * sampler.next_1d() * radius as f32);
            let origin = to + warp::uniform_sphere(sampler.next_2d()) * (2.5 + 8.0 * sampler.next_1d());
            let [origin, to] = [origin, to].map(|p| map.transform_point3(p));
            let ray = Ray {
                origin,
                dir: (to - origin).normalize(),
            };
            let way = origin.distance(to);
            let hit = hit(&geometry, &objects, &ray);
            assert!(hit.is_some_and(|hit| hit.t < way), "{basis:?} {ray:?} {way}");
            assert!(geometry.occluded(&objects, &ray, way, &|_| false));
        }
    }
}

/// From a hit on a straight hair, a ray outwards meets nothing and a ray inwards leaves without a hit, at any size,
/// also for a hair thinner than other surfaces' clearance.
#[test]
fn rays_leave_hairs() {
    for size in [1e-4f32, 1.0, 1e4] {
        for radius in [2e-5f32, 1e-2] {
            let points = (0..6).map(|i| Vec4::new(0.1 * i as f32, 1.0, 0.5, radius) * size);
            let strands = Strands::new(Basis::BSpline, points.collect(), &[6]);
            let objects = object(strands, Affine3A::IDENTITY);
            let geometry = Geometry::new(&objects);
            let mut sampler = Sampler::new(2, 0, Purpose::Test, 0);
            let mut met = 0;
            for _ in 0..3000 {
                let side = sampler.next_1d();
                let to = Vec3::new(0.25, 1.0 + radius * (2.0 * side - 1.0), 0.5) * size;
                let origin = Vec3::new(0.2, 0.3, 4.0) * size;
                let ray = Ray {
                    origin,
                    dir: (to - origin).normalize(),
                };
                let Some(found) = hit(&geometry, &objects, &ray) else {
                    continue;
                };
                met += 1;
                let dir = warp::uniform_sphere(sampler.next_2d());
                let next = found.spawn_ray(dir);
                let again = hit(&geometry, &objects, &next);
                assert!(again.is_none(), "size {size}, radius {radius}: {dir} {again:?}");
                assert!((found.curvature * radius * size - 0.5).abs() < 1e-3);
            }
            assert!(met > 2000, "{met}");
        }
    }
}

/// Tangents and UV on a helix, placed and stretched: along it and across it, as seen.
#[test]
fn uv_and_tangents_follow_the_curve() {
    let at = |turns: f32| {
        let (sin, cos) = sin_cos(2.0 * PI * turns);
        Vec3::new(cos, sin, turns)
    };
    let count = 48;
    let points = (0..count).map(|i| at(2.0 * i as f32 / (count - 1) as f32).extend(0.05));
    let strands = Strands::new(Basis::CatmullRom, points.collect(), &[count]);
    let map = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.5, 0.8, 1.1),
        glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7),
        Vec3::new(0.2, -0.1, 0.3),
    );
    let objects = object(strands, map);
    let geometry = Geometry::new(&objects);
    for i in 1..40 {
        let turns = 2.0 * i as f32 / 40.0;
        let center = at(turns);
        let out = center.with_z(0.0);
        let (sin, cos) = sin_cos(2.0 * PI * turns);
        let along = Vec3::new(-2.0 * PI * sin, 2.0 * PI * cos, 1.0).normalize();
        let across = along.cross(out);
        for side in [-0.8f32, 0.0, 0.6] {
            let from = map.transform_point3(center + out * 3.0 + across * (0.05 * side));
            let to = map.transform_point3(center + across * (0.05 * side));
            let ray = Ray {
                origin: from,
                dir: (to - from).normalize(),
            };
            let hit = hit(&geometry, &objects, &ray).expect("a hit");
            assert!((hit.at.uv.x - turns / 2.0).abs() < 2e-3, "{turns}: {}", hit.at.uv);
            assert!((hit.at.uv.y - 0.5 - 0.5 * side).abs() < 0.02, "{side}: {}", hit.at.uv);
            let [du, dv] = objects[0].shape.tangents(&hit);
            let expected = map.transform_vector3(along).normalize();
            assert!(du.normalize().dot(expected) > 0.999, "{du} {expected}");
            assert!(dv.dot(hit.ng).abs() < 1e-5 * dv.length());
        }
    }
}

/// Degenerate strands are not met, and nothing is NaN.
#[test]
fn poor_curves_do_no_harm() {
    let zero = Vec4::ZERO;
    let sets: [&[Vec4]; 4] = [
        &[zero; 4],
        &[Vec4::new(1.0, 0.0, 0.0, 0.0), zero, zero, Vec4::new(0.0, 0.0, 1.0, 0.0)],
        &[Vec4::W * 0.5; 5],
        &[
            Vec4::new(0.0, 0.0, 0.0, 1.0),
            Vec4::new(0.1, 0.0, 0.0, 0.1),
            zero,
            Vec4::new(0.0, 1e-30, 0.0, 1e-30),
        ],
    ];
    for points in sets {
        for basis in [Basis::Balls, Basis::Linear, Basis::BSpline, Basis::CatmullRom] {
            let strands = Strands::new(basis, points.to_vec(), &[points.len() as u32]);
            let objects = object(strands, Affine3A::IDENTITY);
            let geometry = Geometry::new(&objects);
            let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
            for _ in 0..500 {
                let origin = 2.0 * warp::uniform_sphere(sampler.next_2d());
                let to = points[(sampler.next_1d() * 4.0) as usize].xyz();
                let ray = Ray {
                    origin,
                    dir: (to - origin).normalize(),
                };
                if let Some(hit) = hit(&geometry, &objects, &ray) {
                    assert!(
                        hit.point.is_finite() && hit.ng.is_finite() && hit.at.uv.is_finite(),
                        "{hit:?}"
                    );
                    assert!(hit.curvature > 0.0 && hit.clearance > 0.0, "{hit:?}");
                }
            }
        }
    }
}
