use super::*;
use crate::device::Groups;
use crate::kernels::{ARITHMETIC, Arithmetic, GROUPS, RAYS, VECTORS, WIDE};
use crate::testing::{same_layout, tested};
use beamfarm_render::math::{Ray, Vec2, Vec3};
use beamfarm_render::sampler::mix64;
use beamfarm_render::warp;
use beamfarm_render::world::geometry::{Mesh, Placement};
use std::sync::Arc;

pub mod scenes;
use scenes::Scene;

const RAYS_TEST: Program = Program {
    name: "rays_test",
    texts: &[
        ARITHMETIC,
        GROUPS,
        VECTORS,
        WIDE,
        RAYS,
        include_str!("../../kernels/rays_test.wgsl"),
    ],
};

/// Random numbers, always the same.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u32 {
        self.0 = mix64(self.0.wrapping_add(0x9e37_79b9_7f4a_7c15));
        (self.0 >> 32) as u32
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    /// In the cube from -1 to 1.
    pub fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        warp::uniform_sphere(Vec2::new(self.unit(), self.unit()))
    }

    pub fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.bits() as usize % list.len()]
    }
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TestRay {
    pub origin: [f32; 3],
    t_max: f32,
    pub dir: [f32; 3],
    /// Class bits of objects to pass through; from bit 8 on, the number of another such object, plus one.
    ignored: u32,
}

impl TestRay {
    fn new(origin: Vec3, dir: Vec3, t_max: f32) -> Self {
        Self {
            origin: origin.to_array(),
            t_max,
            dir: dir.to_array(),
            ignored: 0,
        }
    }

    fn ignores(&self, object: u32) -> bool {
        class(object) & self.ignored & 255 != 0 || object + 1 == self.ignored >> 8
    }

    fn ray(&self) -> Ray {
        Ray {
            origin: self.origin.into(),
            dir: self.dir.into(),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Hit {
    t: f32,
    object: u32,
    triangle: u32,
    padding: u32,
    uv: [f32; 2],
}

/// The device's hits, and whether there is any.
fn on_device(tested: &Tested, flat: &FlatGeometry, rays: &[TestRay]) -> (Vec<Hit>, Vec<u32>) {
    let device = &tested.device;
    let geometry = flat.upload(device, None).unwrap();
    let input = device.buffer("rays", rays).unwrap();
    let hits = device.empty("hits", (rays.len() * size_of::<Hit>()) as u64).unwrap();
    let blocked = device.empty("blocked", 4 * rays.len() as u64).unwrap();
    let mut work = device.work();
    for (entry, output) in [("closest", &hits), ("any_at_all", &blocked)] {
        let kernel = geometry.kernel(tested, &RAYS_TEST, entry);
        let buffers = [&[&input, output][..], &geometry.in_order()].concat();
        work.run(&kernel, &buffers, Groups::Count(rays.len().div_ceil(64) as u32))
            .unwrap();
    }
    work.submit().unwrap();
    (
        device.read(&hits, rays.len()).unwrap(),
        device.read(&blocked, rays.len()).unwrap(),
    )
}

/// Classes of objects in tests.
fn class(object: u32) -> u32 {
    1 << (object % 3)
}

fn flat(scene: &Scene, geometry: &Geometry) -> FlatGeometry {
    FlatGeometry::new(geometry, &scene.objects, &class, u64::MAX).unwrap()
}

/// Device and processor find the same hits. Returns how many rays meet each object.
fn compare(tested: &Tested, scene: &Scene, rays: &[TestRay]) -> Vec<usize> {
    let geometry = Geometry::new(&scene.objects);
    let (hits, blocked) = on_device(tested, &flat(scene, &geometry), rays);
    let mut met = vec![0; scene.objects.len()];
    let mut wrong = Vec::new();
    for ((ray, got), blocked) in rays.iter().zip(&hits).zip(blocked) {
        let ignore = |object: u32| ray.ignores(object);
        let hit = geometry.intersect(&scene.objects, &ray.ray(), ray.t_max, &ignore);
        let any = geometry.occluded(&scene.objects, &ray.ray(), ray.t_max, &ignore);
        let expected = match &hit {
            None => (ray.t_max.to_bits(), NOTHING, 0),
            Some(hit) => (hit.t.to_bits(), hit.object, hit.primitive),
        };
        let mut is_same = (got.t.to_bits(), got.object, got.triangle) == expected && any == (blocked != 0);
        if let Some(hit) = &hit {
            met[hit.object as usize] += 1;
            if scene.objects[hit.object as usize].shape.mesh().is_some() {
                is_same &= got.uv.map(f32::to_bits) == hit.at.uv.to_array().map(f32::to_bits);
            }
        }
        if !is_same {
            wrong.push(format!("{ray:?}: {got:?} {blocked}, expected {hit:?} {any}"));
        }
    }
    let shown: Vec<&String> = wrong.iter().take(3).collect();
    let (name, count) = (&scene.name, rays.len());
    assert!(
        wrong.is_empty(),
        "{name}: {} of {count} differ: {shown:#?}",
        wrong.len()
    );
    met
}

/// Rays from a box slightly larger than the scene, in random directions, along axes and towards targets.
pub fn rays(scene: &Scene, random: &mut Random, count: usize) -> Vec<TestRay> {
    let scale = scene.scale;
    let ray = |i: usize| {
        let origin = random.point() * 1.5 * scale;
        let dir = match i % 4 {
            0 => random.direction(),
            1 => random.of(&[Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z]),
            _ => (random.of(&scene.targets) - origin).normalize_or(Vec3::X),
        };
        let (origin, dir) = match i % 16 {
            3 => (random.of(&scene.targets), dir),
            7 => (random.of(&scene.targets) - dir * scale, dir),
            // From far away, where boxes are only a few roundings wide.
            11 => (
                random.of(&scene.targets) - dir * scale * random.of(&[1e2, 1e4, 1e6]),
                dir,
            ),
            // Almost along an axis.
            15 => {
                let aside = random.point() * random.of(&[1e-6, 1e-9, 1e-11, 1e-13, 1e-20]);
                (origin, Vec3::AXES[i / 16 % 3] + aside)
            }
            _ => (origin, dir),
        };
        let t_max = match i % 3 {
            0 => f32::INFINITY,
            _ if i % 16 == 11 => f32::INFINITY,
            _ => 4.0 * random.unit() * scale,
        };
        TestRay {
            ignored: match i % 5 {
                0 => random.bits() & 7,
                1 => (random.bits() % (scene.objects.len() as u32 + 1)) << 8,
                _ => 0,
            },
            ..TestRay::new(origin, dir, t_max)
        }
    };
    (0..count).map(ray).collect()
}

#[test]
fn rays_meet_what_they_meet_on_a_processor() {
    let Some(tested) = tested() else { return };
    let mut random = Random(1);
    let mut count = 0;
    for scene in scenes::all(&mut random) {
        let rays = rays(&scene, &mut random, 15_000);
        let met = compare(tested, &scene, &rays);
        count += met.iter().sum::<usize>();
        let has_any = |object: &Object| object.shape.mesh().is_none_or(|mesh| !mesh.triangles.is_empty());
        let unmet = (met.iter().zip(&scene.objects)).filter(|(met, object)| **met == 0 && has_any(object));
        assert!(10 * unmet.count() <= met.len(), "{}: {met:?}", scene.name);
    }
    assert!(count > 30_000, "{count}");
}

/// At tiny and huge scales: products of coordinates overflow, are denormal, or vanish.
#[test]
fn rays_meet_the_same_at_any_scale() {
    let Some(tested) = tested() else { return };
    let mut random = Random(2);
    for exponent in [-21i32, -12, -6, 6, 12, 19] {
        let scene = scenes::mixed(&mut random, libm::exp10f(exponent as f32));
        let rays = rays(&scene, &mut random, 5000);
        let met = compare(tested, &scene, &rays);
        let sum: usize = met.iter().sum();
        assert!(sum > 500 || exponent.abs() > 12, "1e{exponent}: {met:?}");
    }
}

/// On a grid with integer coordinates: along faces, edges and diagonals, and through corners.
#[test]
fn rays_along_faces_and_edges_meet_the_same() {
    let Some(tested) = tested() else { return };
    let mut random = Random(3);
    for placed in [false, true] {
        let scene = scenes::cubes(placed);
        let mut point = |size: u32| {
            let mut whole = || (random.bits() % (2 * size + 1)) as f32 - size as f32;
            Vec3::new(whole(), whole(), whole()) * 0.5
        };
        let ray = |i: usize| {
            let (origin, to) = (point(8), point(4));
            let dir = if i.is_multiple_of(4) {
                Vec3::AXES[i / 4 % 3]
            } else {
                to - origin
            };
            TestRay::new(origin, if dir == Vec3::ZERO { Vec3::NEG_X } else { dir }, f32::INFINITY)
        };
        let rays: Vec<TestRay> = (0..40_000).map(ray).collect();
        let met = compare(tested, &scene, &rays);
        assert!(met.iter().sum::<usize>() > 10_000, "{met:?}");
    }
}

/// From inside a closed mesh to its vertices and edges, no ray escapes.
#[test]
fn nothing_escapes_from_a_closed_mesh() {
    let Some(tested) = tested() else { return };
    let mut random = Random(4);
    for placed in [false, true] {
        let scene = scenes::closed(&mut random, placed);
        let geometry = Geometry::new(&scene.objects);
        let ray = |_| {
            let origin = random.point() * 0.3;
            let edge = random.of(&scene.edges);
            let to = match random.bits() % 4 {
                0 => edge[0],
                1 => edge[0].midpoint(edge[1]),
                _ => edge[0].lerp(edge[1], random.unit()),
            };
            TestRay::new(origin, to - origin, f32::INFINITY)
        };
        let rays: Vec<TestRay> = (0..60_000).map(ray).collect();
        let (hits, blocked) = on_device(tested, &flat(&scene, &geometry), &rays);
        let escaped = hits.iter().filter(|hit| hit.object == NOTHING).count();
        assert_eq!((escaped, blocked.iter().filter(|any| **any == 0).count()), (0, 0));
        // Aimed at a point on the surface: few pass along its edge.
        assert!(hits.iter().filter(|hit| hit.t > 1.001).count() < 600);
        assert_eq!(compare(tested, &scene, &rays[..10_000]), [10_000]);
    }
}

/// From invalid positions or in invalid directions, a search ends and returns something that exists.
#[test]
fn rays_that_are_none_end() {
    let Some(tested) = tested() else { return };
    let mut random = Random(8);
    let scene = scenes::mixed(&mut random, 1.0);
    let geometry = Geometry::new(&scene.objects);
    let wrong = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 0.0, 1.0];
    let ray = |_| {
        let mut vector = || Vec3::new(random.of(&wrong), random.of(&wrong), random.of(&wrong));
        TestRay::new(vector(), vector(), random.of(&wrong))
    };
    let rays: Vec<TestRay> = (0..5000).map(ray).collect();
    let flat = flat(&scene, &geometry);
    let (hits, blocked) = on_device(tested, &flat, &rays);
    let is_there = |hit: &&Hit| (hit.object as usize) < scene.objects.len() || hit.object == NOTHING;
    assert_eq!(hits.iter().filter(is_there).count(), rays.len());
    assert!(blocked.iter().all(|any| *any < 2));
    // Nothing is met beyond the end of a ray, or at zero distance.
    let met = hits.iter().zip(&rays).filter(|(hit, _)| hit.object != NOTHING);
    assert!(met.clone().count() > 0);
    assert!(met.clone().all(|(hit, ray)| hit.t > 0.0 && hit.t < ray.t_max));
}

/// The fallback of edge functions, against 64-bit floats.
#[test]
fn differences_of_products_are_those_of_64_bits() {
    let Some(tested) = tested() else { return };
    let mut random = Random(5);
    let edges = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        f32::MAX,
        f32::INFINITY,
        f32::NAN,
        3.0,
        1e-23,
    ];
    let mut operands = Vec::new();
    for i in 0..600_000 {
        let exponents = [0, 127, 95, 200, 64][i % 5];
        let spread = random.of(&[1, 3, 8, 24, 60]);
        let mut number = || {
            let exponent = (exponents + random.bits() % spread).min(254);
            f32::from_bits(random.bits() & 0x807f_ffff | exponent << 23)
        };
        let [a, b] = [number(), number()];
        let near = |x: f32, by: u32| f32::from_bits(x.to_bits().wrapping_add(by % 3).wrapping_sub(1));
        operands.push(match i % 8 {
            // The same product, or nearly so.
            0 => [a, b, b, a],
            1 => [a, b, near(a, random.bits()), near(b, random.bits())],
            2 => [a, b, 2.0 * a, near(0.5 * b, random.bits())],
            3 => [
                random.of(&edges),
                random.of(&edges),
                random.of(&edges),
                random.of(&edges),
            ],
            4 => [a, random.of(&edges), b, random.of(&edges)],
            5 => {
                let few = |x: f32| f32::from_bits(x.to_bits() & 0xffff_0000);
                [few(a), few(b), few(number()), few(number())]
            }
            _ => [a, b, number(), number()],
        });
    }
    let device = &tested.device;
    let kernel = tested.kernel(&RAYS_TEST, "products");
    let input = device.buffer("operands", &operands).unwrap();
    let output = device.empty("differences", 4 * operands.len() as u64).unwrap();
    let mut work = device.work();
    let groups = Groups::Count(operands.len().div_ceil(64) as u32);
    work.run(&kernel, &[&input, &output], groups).unwrap();
    work.submit().unwrap();
    let results: Vec<f32> = device.read(&output, operands.len()).unwrap();
    let mut kinds = [0; 4];
    for (of, got) in operands.iter().zip(results) {
        let [a, b, c, d] = of.map(f64::from);
        let exact = (a * b - c * d) as f32;
        assert!(
            got.to_bits() == exact.to_bits() || got.is_nan() && exact.is_nan(),
            "{of:?}: {got:e}, expected {exact:e}"
        );
        let kind = [
            exact == 0.0,
            exact.is_subnormal(),
            exact.is_infinite(),
            exact.is_normal(),
        ];
        kinds
            .iter_mut()
            .zip(kind)
            .for_each(|(count, is)| *count += usize::from(is));
    }
    assert!(kinds.iter().all(|count| *count > 5000), "{kinds:?}");
}

#[test]
fn structs_are_the_same_in_kernels() {
    same_layout!(&RAYS_TEST, Node { bounds, children });
    same_layout!(
        &RAYS_TEST,
        Four {
            corners,
            objects,
            triangles
        }
    );
    same_layout!(&RAYS_TEST, TurnedNode { axes, bounds, children });
    same_layout!(&RAYS_TEST, SliverTree { center, radius, root });
    same_layout!(
        &RAYS_TEST,
        ObjectShape {
            x_axis,
            shape,
            y_axis,
            root,
            z_axis,
            classes,
            translation
        }
    );
    same_layout!(
        &RAYS_TEST,
        TestRay {
            origin,
            t_max,
            dir,
            ignored
        }
    );
    same_layout!(
        &RAYS_TEST,
        Hit {
            t,
            object,
            triangle,
            uv
        }
    );
    let source = RAYS_TEST.source(Arithmetic::default());
    // Kinds of children and shapes.
    for (name, value) in [
        ("FOUR", OF_FOUR),
        ("OBJECT", OF_OBJECT),
        ("SLIVERS", OF_SLIVERS),
        ("LEAF", LEAF),
        ("NOTHING", NOTHING),
    ] {
        assert!(source.contains(&format!("const {name}: u32 = {value:#x}u;")), "{name}");
    }
}

#[test]
fn sizes_are_told_before_anything_is_made() {
    let mut random = Random(6);
    for scene in scenes::all(&mut random) {
        let geometry = Geometry::new(&scene.objects);
        let sizes = Sizes::of(&geometry.hierarchies());
        let flat = flat(&scene, &geometry);
        assert_eq!(sizes, flat.sizes, "{}", scene.name);
        let bytes = size_of_val(&*flat.nodes)
            + size_of_val(&*flat.fours)
            + size_of_val(&*flat.turned_nodes)
            + size_of_val(&*flat.sliver_trees)
            + size_of_val(&*flat.objects);
        assert_eq!(sizes.bytes(), bytes as u64, "{}", scene.name);
        assert!(u64::from(sizes.stack_entries()) >= sizes.stack, "{}", scene.name);
        // No path from the root is longer than the stack allows.
        let waiting = scenes::longest_wait(&flat);
        assert!(waiting <= sizes.stack, "{}: {waiting} of {}", scene.name, sizes.stack);
    }
}

#[test]
fn what_does_not_fit_is_named_all_at_once() {
    let mut random = Random(7);
    let scene = scenes::mixed(&mut random, 1.0);
    let geometry = Geometry::new(&scene.objects);
    let sizes = Sizes::of(&geometry.hierarchies());
    let reasons = FlatGeometry::new(&geometry, &scene.objects, &class, 1000).unwrap_err();
    let texts: Vec<String> = reasons.iter().map(Reason::to_string).collect();
    let text = |what: &str, bytes: u64| {
        format!("{what}: it takes a buffer of {bytes} bytes, and the device's largest has 1000")
    };
    let expected = [
        text("boxes", 112 * sizes.nodes),
        text("triangles", 176 * sizes.fours),
        text("objects", 64 * sizes.objects),
    ];
    assert_eq!(texts, expected);
    let scene = scenes::deep(180);
    let geometry = Geometry::new(&scene.objects);
    let entries = Sizes::of(&geometry.hierarchies()).stack;
    let reasons = FlatGeometry::new(&geometry, &scene.objects, &class, u64::MAX).unwrap_err();
    let texts: Vec<String> = reasons.iter().map(Reason::to_string).collect();
    let expected = format!(
        "object \"object 1\": mesh: its hierarchy is so deep that rays need {entries} entries on their stack, and 256 are \
         the most"
    );
    assert_eq!(texts, [expected]);
}
