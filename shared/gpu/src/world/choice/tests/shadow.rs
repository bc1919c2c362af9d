//! Occlusion of light.

use super::segment::{Query, SCATTERED, run};
use super::*;
use crate::world::VACUUM;
use crate::world::tests::scenes::{GREY, add_medium, add_object, diffuse, even};
use beamfarm_render::math::Ray;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::geometry::{Boundary, Mesh, Placement, Shape};
use beamfarm_render::world::medium::{Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use glam::Affine3A;
use std::sync::Arc;

pub fn ball(middle: Vec3, radius: f32) -> Shape {
    let map = Affine3A::from_scale_rotation_translation(Vec3::splat(radius), glam::Quat::IDENTITY, middle);
    Shape::Sphere {
        placement: Placement {
            render_from_object: map,
            object_from_render: map.inverse(),
        },
        flip: false,
    }
}

fn cube(half: f32) -> Shape {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * (2.0 * half) - half;
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    let mesh = Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: triangles.collect(),
        ..Mesh::default()
    };
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    }
}

/// Nested media, some of them vacuum, a few objects among them, and a lamp outside everything.
fn shells() -> SceneDescription {
    let mut scene = empty();
    scene.materials.push(even(diffuse(GREY)).into());
    scene.materials.push(even(MaterialKind::Null).into());
    scene.bounds.radius = 10.0;
    let mut around = add_medium(&mut scene, "0", fog(Rgb::new(0.01, 0.02, 0.0)));
    scene.world_medium = around;
    let shapes = [
        ball(Vec3::ZERO, 6.0),
        cube(3.0),
        ball(Vec3::ZERO, 2.5),
        cube(1.4),
        ball(Vec3::new(0.1, 0.0, 0.0), 1.2),
    ];
    for (number, shape) in (1u8..).zip(shapes) {
        let inside = match number {
            3 => None,
            n => add_medium(&mut scene, "more", fog(Rgb::new(0.05, 0.1, 0.15) * f32::from(n))),
        };
        let object = add_object(&mut scene, shape, 1) as usize;
        scene.objects[object].boundary = Some(Boundary {
            interior: inside,
            exterior: around,
        });
        around = inside;
    }
    for (middle, radius) in [
        (Vec3::new(0.0, 7.0, 0.0), 0.3),
        (Vec3::new(5.0, 0.5, 0.0), 0.5),
        (Vec3::new(0.2, 0.3, 0.1), 0.25),
    ] {
        add_object(&mut scene, ball(middle, radius), 0);
    }
    let corners = vec![
        Vec3::new(-2.0, 9.0, -2.0),
        Vec3::new(2.0, 9.0, -2.0),
        Vec3::new(2.0, 9.0, 2.0),
        Vec3::new(-2.0, 9.0, 2.0),
    ];
    add_lamp(&mut scene, corners, vec![[0, 1, 2], [0, 2, 3]], false);
    scene
}

fn fog(sigma_s: Rgb) -> Medium {
    Medium::Homogeneous(Homogeneous {
        sigma_a: sigma_s * 0.5,
        sigma_s,
        phase: Phase::Isotropic,
    })
}

fn number(medium: Option<u16>) -> u32 {
    medium.map_or(VACUUM, u32::from)
}

/// Number of boundaries that a ray crosses.
fn crossed(scene: &Scene, ray: &Ray, distance: f32) -> usize {
    let objects = &scene.description().objects;
    let is_other = |object: u32| objects[object as usize].material != 1;
    let (mut ray, mut left, mut count) = (*ray, distance, 0);
    while let Some(hit) = scene.geometry().intersect(objects, &ray, left, &is_other) {
        (ray, left, count) = (hit.spawn_ray(ray.dir), left - hit.t, count + 1);
    }
    count
}

#[test]
fn shadow_rays_see_through_boundaries_as_the_renderers_do() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(shells());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let mut chance = Chance::new(12);
    let media: Vec<_> = (0..4000)
        .map(|i| {
            let origin = chance.direction() * (7.0 * chance.unit());
            let dir = match i % 3 {
                0 => (Vec3::new(4.0 * chance.unit() - 2.0, 9.0, 4.0 * chance.unit() - 2.0) - origin).normalize(),
                _ => chance.direction(),
            };
            let distance = match i % 3 {
                0 => (9.0 - origin.y) / dir.y,
                1 => f32::INFINITY,
                _ => 8.0 * chance.unit(),
            };
            let medium = scene.medium_at(origin);
            let query = Query {
                origin: origin.to_array(),
                dir: dir.to_array(),
                medium: number(medium),
                u_light: -1.0,
                t: distance,
                light: if i % 2 == 0 { 0 } else { NONE },
                ..Query::zeroed()
            };
            (query, medium)
        })
        .collect();
    let queries: Vec<Query> = media.iter().map(|(query, _)| *query).collect();
    let geometry = world.upload(&tested.device).unwrap().geometry;
    let kernel = geometry.kernel(tested, &SCATTERED, "main");
    let got: Vec<[f32; 4]> = run(&kernel, &scene, &queries, true);
    let mut counts = [0; 16];
    let mut blocked = 0;
    for ((query, medium), got) in media.iter().zip(&got) {
        let ray = Ray {
            origin: query.origin.into(),
            dir: query.dir.into(),
        };
        let light = (query.light == 0).then_some(scene.unshadowing()[0]).flatten();
        let mut sampler = Sampler::new(0, 0, Purpose::Test, 0);
        let own = scene.unoccluded(ray, (query.t, query.t), *medium, light, |_| false, &mut sampler);
        match own {
            None => blocked += 1,
            Some(_) => counts[crossed(&scene, &ray, query.t).min(15)] += 1,
        }
        let expected = own.unwrap_or(Rgb::ZERO).to_array();
        assert_eq!(
            got[..3].iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            expected.map(f32::to_bits),
            "{query:?}"
        );
    }
    assert!(blocked > 200, "{blocked}");
    assert!(counts[..6].iter().all(|count| *count > 50), "{counts:?}");
}
