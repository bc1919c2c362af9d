//! Walls near beams against the processor's, and the visibility of beams next to them.

use super::{dir, media, point, sampler, scatterings};
use crate::beams::{
    Beam, BeamEnds, Brought, FlatWalls, Gather, Hiding, Hull, Near, Pieces, Plane, Segment, Segments, WallShape, Walls,
    Way,
};
use crate::kernels::{GATHER_WALLED, PIECES, WALLS};
use crate::self_test::Tested;
use crate::testing::{same_layout, tested};
use crate::world::NO_WALLS;
use crate::world::geometry::tests::{Random, scenes};
use crate::world::geometry::{FlatGeometry, GeometryBuffers};
use crate::world::tests::scenes::{GREY, add_object, dielectric, diffuse, empty, even, sphere};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{self, CameraSegment, Vectors};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::cpu::beam::walls;
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::Sampler;
use beamfarm_render::world::Scene;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::Tint;
use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::medium::transmittance::StepFunctions;
use glam::{Affine3A, Quat};
use std::sync::Arc;

const KEY: u64 = 0x0bad_cafe_1234_5678;

#[test]
fn walls_lie_in_memory_as_kernels_have_them() {
    for program in [WALLS, GATHER_WALLED, PIECES] {
        same_layout!(
            &program,
            Plane {
                n,
                at,
                range,
                clear2,
                is_outer
            }
        );
    }
    for program in [WALLS, GATHER_WALLED] {
        same_layout!(
            &program,
            Hull {
                low,
                is_closed,
                high,
                spare
            }
        );
    }
    same_layout!(
        &WALLS,
        WallShape {
            x_axis,
            scale,
            y_axis,
            spare_y,
            z_axis,
            spare_z,
            translation,
            spare_translation,
            middle,
            spare_middle
        }
    );
    let source = WALLS.source(crate::kernels::Arithmetic::default());
    for (name, value) in [("NO_WALL", NO_WALLS), ("WALL_BITS", Beam::WALL_BITS)] {
        assert!(source.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
    }
    for (name, value) in [
        ("ENDS_NOWHERE", BeamEnds::NONE),
        ("ENDS_ON_SURFACE", BeamEnds::SURFACE),
        ("ENDS_ON_BOUNDARY", BeamEnds::BOUNDARY),
    ] {
        assert!(source.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
    }
}

/// A scene around a point in fog, with objects of stone, or of glass if their material is 1.
pub fn of(objects: Vec<Object>) -> Scene {
    let mut description = SceneDescription {
        objects,
        media: vec![Medium::Homogeneous(media()[0])],
        media_names: vec!["fog".to_owned()],
        world_medium: Some(0),
        materials: vec![even(diffuse(GREY)).into(), even(dielectric(1.5, Tint::NONE)).into()],
        ..empty()
    };
    description.camera.position = Vec3::new(0.9, 0.9, 0.9);
    Scene::new(description)
}

fn placed(map: Affine3A) -> Placement {
    Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    }
}

/// The mesh of a box, or of one side: the one at z = -1.
fn sides(count: usize) -> Arc<Mesh> {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2.0 - 1.0;
    let quads = [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ];
    let triangles = quads[..count]
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    Arc::new(Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: triangles.collect(),
        ..Mesh::default()
    })
}

/// A partition in the middle of a room, from wall to wall: in the plane x = 0.2.
fn partition() -> Shape {
    let turn = Quat::from_rotation_arc(Vec3::Z, Vec3::X);
    let map = Affine3A::from_rotation_translation(turn, Vec3::new(1.2, 0.0, 0.0));
    Shape::Mesh {
        mesh: sides(1),
        placement: placed(map),
    }
}

/// A room that contains these shapes.
fn room(shapes: impl IntoIterator<Item = (Shape, u32)>) -> Scene {
    let mut description = empty();
    let mesh = sides(6);
    let placement = Placement::IDENTITY;
    add_object(&mut description, Shape::Mesh { mesh, placement }, 0);
    for (shape, material) in shapes {
        add_object(&mut description, shape, material);
    }
    of(description.objects)
}

/// With a thin wall that reaches half way across, a ball, a tube, a disc, and a glass ball.
pub fn furnished() -> Scene {
    let at = |scale: f32, x: f32, y: f32, z: f32| {
        placed(Affine3A::from_translation(Vec3::new(x, y, z)) * Affine3A::from_scale(Vec3::splat(scale)))
    };
    let half = Affine3A::from_translation(Vec3::new(-1.0, -0.3, 0.9)) * Affine3A::from_scale(Vec3::new(0.8, 0.4, 1.0));
    room([
        (
            Shape::Mesh {
                mesh: sides(1),
                placement: placed(half),
            },
            0,
        ),
        (sphere(at(0.3, 0.4, 0.3, 0.2)), 0),
        (
            Shape::Cylinder {
                placement: at(0.2, -0.5, 0.4, -0.8),
                flip: false,
            },
            0,
        ),
        (
            Shape::Disc {
                placement: at(0.4, 0.3, -0.5, -0.3),
                flip: false,
            },
            0,
        ),
        (sphere(at(0.25, -0.3, -0.6, 0.4)), 1),
    ])
}

/// Uses kernels that are compiled once for all these scenes.
pub fn uploaded(tested: &Tested, scene: &Scene) -> GeometryBuffers {
    let class = |object: u32| u32::from(!scene.is_wall(object)) * NO_WALLS;
    let flat = FlatGeometry::new(scene.geometry(), &scene.description().objects, &class, u64::MAX).unwrap();
    let mut buffers = flat.upload(&tested.device, None).unwrap();
    assert!(buffers.needs.stack <= 64);
    buffers.needs.stack = 64;
    buffers
}

/// Paths of beams from wall to wall, where there are any, with kernels about `radius` wide.
fn beams(scene: &Scene, sampler: &mut Sampler, count: usize, radius: f32) -> Vec<(Beam, BeamEnds)> {
    let mut from: Option<(Vec3, Vec3)> = None;
    (0..count)
        .map(|_| {
            let (origin, normal) = match from.take().filter(|_| sampler.next_1d() < 0.7) {
                Some(place) => place,
                None => (point(sampler, 1.0), Vec3::ZERO),
            };
            let mut dir = dir(sampler);
            let starts_on = normal != Vec3::ZERO;
            if starts_on && sampler.next_1d() < 0.9 {
                dir *= normal.dot(dir).signum();
            }
            let hit = (scene.geometry()).intersect(&scene.description().objects, &Ray { origin, dir }, 3.0, &|_| false);
            let is = |sampler: &mut Sampler| match sampler.next_u32() % 8 {
                0 => BeamEnds::BOUNDARY,
                _ => BeamEnds::SURFACE,
            };
            let (length, end, end_is) = match hit {
                Some(hit) => {
                    from = Some((hit.point - dir * 1e-4, hit.ng * -hit.ng.dot(dir).signum()));
                    (hit.t, hit.ng, is(sampler))
                }
                None => (3.0 * sampler.next_1d(), Vec3::ZERO, BeamEnds::NONE),
            };
            let radius = radius * (0.2 + 1.6 * sampler.next_1d());
            let over = |sampler: &mut Sampler, is: u32| match is {
                BeamEnds::NONE => 0.0,
                _ => 2.0 * radius * sampler.next_1d(),
            };
            let start_is = if starts_on { is(sampler) } else { BeamEnds::NONE };
            let beam = Beam {
                origin: origin.to_array(),
                radius,
                dir: dir.to_array(),
                radius_slope: 0.2 * radius * (sampler.next_1d() - 0.3),
                power: [1.0, 0.5 + sampler.next_1d(), sampler.next_1d()],
                length,
                extent: [-over(sampler, start_is), length + over(sampler, end_is)],
                medium: 0,
                walls: 0,
            };
            let ends = BeamEnds {
                start: normal.to_array(),
                start_is,
                end: end.to_array(),
                end_is,
            };
            (beam, ends)
        })
        .collect()
}

/// What a processor finds near them.
fn on_processor(scene: &Scene, beams: &[(Beam, BeamEnds)]) -> Traced {
    let mut traced = Traced::default();
    for (beam, ends) in beams {
        let mut found = PhotonBeam {
            origin: beam.origin.into(),
            dir: beam.dir.into(),
            length: beam.length,
            extent: beam.extent,
            power: beam.power.into(),
            radius: beam.radius,
            radius_slope: beam.radius_slope,
            medium: beam.medium as u16,
            group: None,
            wave: None,
            steps: 0,
            walls: [0; 2],
        };
        let end = |normal: [f32; 3], is: u32| {
            (is != BeamEnds::NONE).then(|| walls::End {
                normal: normal.into(),
                bounds: is == BeamEnds::BOUNDARY,
            })
        };
        let ends = [end(ends.start, ends.start_is), end(ends.end, ends.end_is)];
        walls::find(scene, &mut found, ends, &mut traced.walls);
        traced.beams.push(found);
    }
    traced
}

fn packed(walls: [u32; 2]) -> u32 {
    walls[0] << Beam::WALL_BITS | (walls[1] - walls[0])
}

fn words(plane: &Plane) -> [u32; 8] {
    // Zeros of either sign are equal.
    let plane = Plane {
        n: plane.n.map(|x| x + 0.0),
        range: plane.range.map(|x| x + 0.0),
        ..*plane
    };
    bytemuck::cast(plane)
}

fn plane(of: &walls::Plane) -> Plane {
    Plane {
        n: of.n.to_array(),
        at: of.at,
        range: of.range,
        clear2: of.clear2,
        is_outer: of.is_outer.into(),
    }
}

/// Runs a function after the search for walls near beams, and reads the beams and their planes.
fn find<T>(
    tested: &Tested,
    scene: &Scene,
    beams: &[(Beam, BeamEnds)],
    then: impl FnOnce(&mut crate::device::Work, &Hiding) -> T,
) -> (Vec<Beam>, Vec<Plane>, T) {
    let device = &tested.device;
    let geometry = uploaded(tested, scene);
    let buffers = FlatWalls::new(scene).unwrap().upload(device).unwrap();
    let (beams, ends): (Vec<Beam>, Vec<BeamEnds>) = beams.iter().copied().unzip();
    let count = device.buffer("count of beams", &[beams.len() as u32]).unwrap();
    let beam_buffer = device.buffer("beams", &beams).unwrap();
    let ends = device.buffer("ends", &ends).unwrap();
    let near = Near {
        geometry: &geometry,
        walls: &buffers,
    };
    let walls = Walls::new(tested, &geometry, beams.len() as u32).unwrap();
    let mut work = device.work();
    walls.run(&mut work, &near, &count, [&beam_buffer, &ends]).unwrap();
    let hiding = Hiding {
        near,
        planes: walls.planes(),
        beams: &beam_buffer,
    };
    let result = then(&mut work, &hiding);
    work.submit().unwrap();
    let planes = device.read::<u32>(walls.count(), 1).unwrap()[0];
    (
        device.read(&beam_buffer, beams.len()).unwrap(),
        device.read(walls.planes(), planes as usize).unwrap(),
        result,
    )
}

#[test]
fn planes_near_beams_are_the_processors() {
    let Some(tested) = tested() else { return };
    let mut random = Random(8);
    let of_kinds = |scene: scenes::Scene| {
        let mut objects = scene.objects;
        for object in objects.iter_mut().skip(2).step_by(5) {
            object.material = 1;
        }
        (scene.name, of(objects))
    };
    let mut all = vec![
        ("furnished".to_owned(), furnished()),
        ("closed".to_owned(), room([(partition(), 0)])),
    ];
    all.extend(scenes::near(&mut random).map(of_kinds));
    let (mut crowds, mut outer, mut by_count) = (0, 0, [0; 14]);
    for (number, (name, scene)) in (0..).zip(&all) {
        let mut sampler = sampler(900 + number);
        let beams: Vec<_> = [0.01, 0.1, 0.4]
            .into_iter()
            .flat_map(|radius| beams(scene, &mut sampler, 130, radius))
            .collect();
        let expected = on_processor(scene, &beams);
        let (got, planes, ()) = find(tested, scene, &beams, |_, _| ());
        for ((expected_beam, got), given) in expected.beams.iter().zip(got).zip(&beams) {
            let [first, end] = expected_beam.walls.map(|i| i as usize);
            let of = |all: &[Plane]| all.get(first..end).map(<[Plane]>::to_vec);
            let found: Vec<Plane> = expected.walls[first..end].iter().map(plane).collect();
            assert_eq!(got.walls, packed(expected_beam.walls), "{name}: {given:?} {found:?}");
            let same = of(&planes).is_some_and(|got| got.iter().map(words).eq(found.iter().map(words)));
            assert!(same, "{name}: {given:?} {found:?} {:?}", of(&planes));
            by_count[end - first] += 1;
            crowds += found.iter().filter(|plane| plane.n == [0.0; 3]).count();
            outer += found.iter().filter(|plane| plane.is_outer == 1).count();
        }
        assert_eq!(planes.len(), expected.walls.len());
    }
    // Many beams have none, many a few, some the maximum.
    assert!(
        by_count[0] > 50 && by_count[2] > 50 && by_count[10..].iter().sum::<i32>() > 20,
        "{by_count:?}"
    );
    assert!(crowds > 20 && outer > 100, "{crowds} {outer}");
}

/// From random points; half reach the next wall, or beyond it.
fn segments(scene: &Scene, sampler: &mut Sampler, count: u32) -> Vec<Segment> {
    (0..count)
        .map(|i| {
            let (origin, dir) = (point(sampler, 1.0), dir(sampler));
            let hit = (scene.geometry()).intersect(&scene.description().objects, &Ray { origin, dir }, 3.0, &|_| false);
            Segment {
                origin: origin.to_array(),
                length: match hit {
                    Some(hit) if i % 3 > 0 => hit.t,
                    _ => 2.0 * sampler.next_1d(),
                },
                dir: dir.to_array(),
                medium: 0,
                pixel: i,
                ..Segment::default()
            }
        })
        .collect()
}

/// The results by rays and by tiles.
fn gathered(tested: &Tested, scene: &Scene, beams: &[(Beam, BeamEnds)], segments: &[Segment]) -> [Vec<Brought>; 2] {
    let device = &tested.device;
    let most = beams.len() as u32;
    let pieces = Pieces::new(tested, most).unwrap();
    let count = device.buffer("count of beams", &[most]).unwrap();
    let of = Segments {
        count: &device.buffer("count of segments", &[segments.len() as u32]).unwrap(),
        segments: &device.buffer("segments", segments).unwrap(),
        media: &device.buffer("media", &scatterings()).unwrap(),
        key: &device.buffer("key", &[KEY]).unwrap(),
        varying: None,
        light_group: None,
    };
    let (_, _, films) = find(tested, scene, beams, |work, hiding| {
        (pieces.run_by_walls(work, &count, hiding.beams, hiding.planes)).unwrap();
        let gather = Gather::by_walls(tested, hiding.near.geometry, most).unwrap();
        [Way::ByRay, Way::ByTile].map(|way| {
            let film = device.empty("gathered", 16 * segments.len() as u64).unwrap();
            (gather.run_by_walls(work, way, &of, (&pieces, *hiding), &film)).unwrap();
            film
        })
    });
    films.map(|film| device.read(&film, segments.len()).unwrap())
}

/// What a processor gathers along each segment alone, and the number of beams.
fn along(scene: Option<&Scene>, traced: &Traced, segments: &[Segment]) -> Vec<(Rgb, u64)> {
    let map = BeamMap::new(traced.clone());
    let (medium, steps) = (Medium::Homogeneous(media()[0]), StepFunctions::default());
    let gather = estimate::Gather {
        map: &map,
        medium: &medium,
        steps: &steps,
        scene,
        group: None,
        wave: None,
        key: KEY,
        vectors: Vectors::Baseline,
    };
    let of_segment = |segment: &Segment| {
        let ray = Ray {
            origin: segment.origin.into(),
            dir: segment.dir.into(),
        };
        let mut camera = CameraSegment::new(ray, segment.length, Rgb::ONE, 0);
        camera.pixel = segment.pixel as u16;
        let gathered = gather.along(&[camera]);
        (gathered.radiance[0], gathered.evaluations)
    };
    segments.iter().map(of_segment).collect()
}

#[test]
fn what_is_seen_beside_walls_is_what_the_processor_sees() {
    let Some(tested) = tested() else { return };
    let mut random = Random(9);
    let mixed = of(scenes::mixed(&mut random, 1.0).objects);
    let (mut hidden, mut seen) = (0, 0);
    for (number, scene) in [furnished(), mixed].iter().enumerate() {
        let mut sampler = sampler(950 + number as u64);
        let beams = beams(scene, &mut sampler, 200, 0.15);
        let segments = segments(scene, &mut sampler, 300);
        let traced = on_processor(scene, &beams);
        let [rays, tiles] = gathered(tested, scene, &beams, &segments);
        let differs = rays.iter().zip(&tiles).position(|(a, b)| a != b);
        assert_eq!(differs.map(|i| (i, rays[i], tiles[i])), None);
        let expected = along(Some(scene), &traced, &segments);
        for ((got, (radiance, count)), segment) in rays.iter().zip(&expected).zip(&segments) {
            let off = (Rgb::from_array(got.radiance) - *radiance).abs().max_element();
            assert_eq!(u64::from(got.count), *count, "{segment:?}");
            assert!(off <= 1e-5 * radiance.max_element(), "{got:?} {radiance} {segment:?}");
        }
        let all = along(None, &traced, &segments);
        hidden += all.iter().zip(&expected).map(|(all, seen)| all.1 - seen.1).sum::<u64>();
        seen += expected.iter().map(|(_, count)| count).sum::<u64>();
    }
    assert!(hidden > 150 && seen > hidden, "{hidden} of {seen} and that");
}

#[test]
fn no_light_gets_through_a_thin_wall() {
    let Some(tested) = tested() else { return };
    let scene = room([(partition(), 0)]);
    let mut sampler = sampler(970);
    // All on one side of the wall, with kernels that reach far beyond it.
    let mut all = beams(&scene, &mut sampler, 600, 0.4);
    all.retain_mut(|(beam, ends)| {
        for is in [&mut ends.start_is, &mut ends.end_is] {
            *is = (*is).min(BeamEnds::SURFACE);
        }
        let end = Vec3::from(beam.origin) + Vec3::from(beam.dir) * beam.length;
        beam.origin[0] < 0.2 && end.x < 0.2 + 1e-4
    });
    let behind: Vec<Segment> = segments(&scene, &mut sampler, 600)
        .into_iter()
        .filter(|segment| {
            let end = Vec3::from(segment.origin) + Vec3::from(segment.dir) * segment.length;
            segment.origin[0] > 0.2 && end.x > 0.2 + 1e-4
        })
        .collect();
    assert!(all.len() > 100 && behind.len() > 100, "{} {}", all.len(), behind.len());
    for films in gathered(tested, &scene, &all, &behind) {
        assert!(films.iter().all(|brought| *brought == Brought::default()));
    }
    // The result without the wall.
    let open = along(None, &on_processor(&scene, &all), &behind);
    let lit = open.iter().filter(|(_, count)| *count > 0).count();
    assert!(lit > behind.len() / 2, "{lit}");
}

#[test]
fn scenes_without_walls_have_none() {
    assert!(FlatWalls::new(&of(Vec::new())).is_none());
    let mut glass = furnished().description().objects.clone();
    glass.iter_mut().for_each(|object| object.material = 1);
    assert!(FlatWalls::new(&of(glass)).is_none());
    assert_eq!(FlatWalls::new(&furnished()).unwrap().hull.is_closed, 1);
}
