//! Points that rays meet, and rays that start there.

use super::*;
use crate::device::Kernel;
use crate::kernels::{Needs, RAYS, SAMPLER, SURFACE, TEXELS, TEXTURE};
use crate::self_test::Tested;
use crate::testing::{EACH, same};
use crate::world::geometry::tests::{self as rays, Random};
use crate::world::shapes::{PlacedShape, Vertex};
use beamfarm_render::math::{Ray, Vec2};
use beamfarm_render::world::bsdf::{Bsdf, MaterialDescription};
use beamfarm_render::world::geometry::{Mesh, Object, Shape};
use beamfarm_render::world::texture::{Texture, TextureFilter, Wrap};
use glam::Affine2;
use std::sync::{Arc, OnceLock};

const SURFACE_TEST: Program = Program {
    name: "surface_test",
    texts: &[
        ARITHMETIC,
        GROUPS,
        WIDE,
        MATH,
        SAMPLER,
        WARP,
        VECTORS,
        TEXELS,
        BSDF,
        PHASE,
        MEDIUM,
        CAMERA,
        TEXTURE,
        EMISSION,
        WORLD,
        RAYS,
        SURFACE,
        include_str!("../../kernels/surface_test.wgsl"),
        EACH,
    ],
};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Asked {
    pub origin: [f32; 3],
    pub around: u32,
    pub dir: [f32; 3],
    pub ignored: u32,
    pub wi: [f32; 3],
    pub distance: f32,
}

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SurfacePoint {
    pub point: [f32; 3],
    pub object: u32,
    pub ng: [f32; 3],
    triangle: u32,
    ns: [f32; 3],
    curvature: f32,
    uv: [f32; 2],
    t: f32,
    clearance: f32,
}

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Answer {
    pub at: SurfacePoint,
    pub spawned: [f32; 3],
    beyond: u32,
    origin: [f32; 3],
    distance: f32,
    dir: [f32; 3],
    kind: u32,
    local_wo: [f32; 3],
    two_sided: u32,
    tangent: [f32; 3],
    padding: u32,
    reflectance: [f32; 3],
    padding_2: u32,
}

/// The renderer's answer.
fn expected(scene: &Scene, asked: &Asked) -> Answer {
    let ray = Ray {
        origin: asked.origin.into(),
        dir: asked.dir.into(),
    };
    let mut answer = Answer {
        at: SurfacePoint {
            t: f32::INFINITY,
            object: NONE,
            ..SurfacePoint::default()
        },
        ..Answer::default()
    };
    let Some(mut hit) = scene.first_hit(&ray, |object| object == asked.ignored) else {
        return answer;
    };
    answer.at = SurfacePoint {
        point: hit.point.to_array(),
        object: hit.object,
        ng: hit.ng.to_array(),
        triangle: hit.primitive,
        ns: hit.ns.to_array(),
        curvature: hit.curvature,
        uv: hit.at.uv.to_array(),
        t: hit.t,
        clearance: hit.clearance,
    };
    let wi = asked.wi.into();
    answer.spawned = hit.spawn_ray(wi).origin.to_array();
    let (aimed, distance) = hit.ray_to(wi, asked.distance);
    answer.origin = aimed.origin.to_array();
    answer.dir = aimed.dir.to_array();
    answer.distance = distance;
    let around = (asked.around != VACUUM).then_some(asked.around as u16);
    answer.beyond = medium(scene.medium_beyond(&hit, wi, around));
    let material = scene.material(&hit);
    let interaction = scene.interaction(material, &mut hit, ray.dir, None);
    (answer.kind, answer.two_sided, answer.reflectance) = match interaction.bsdf {
        Bsdf::Black => (0, 1, [0.0; 3]),
        Bsdf::Diffuse { reflectance, two_sided } => (1, two_sided.into(), reflectance.to_array()),
        Bsdf::Dielectric(b) => (2, 1, b.reflectance.to_array()),
        Bsdf::ThinDielectric(b) => (3, 1, b.reflectance.to_array()),
        Bsdf::Conductor {
            reflectance, two_sided, ..
        } => (4, two_sided.into(), reflectance.to_array()),
        Bsdf::Mirror { reflectance, two_sided } => (5, two_sided.into(), reflectance.to_array()),
        Bsdf::Null => (6, 1, [0.0; 3]),
        other => panic!("{other:?}"),
    };
    answer.local_wo = interaction.local_wo.to_array();
    answer.tangent = interaction.frame.s.to_array();
    answer
}

/// A world on a device, for queries.
pub struct OnDevice {
    tested: &'static Tested,
    buffers: WorldBuffers,
    kernel: Kernel,
}

impl OnDevice {
    pub fn new(tested: &'static Tested, world: &FlatWorld) -> Self {
        let buffers = world.upload(&tested.device).unwrap();
        // Compiled once for all tests, with room for any scene.
        static KERNEL: OnceLock<Kernel> = OnceLock::new();
        let compiled = || {
            let needs = Needs {
                stack: 256,
                ..Needs::ALL
            };
            tested.kernel_for(&SURFACE_TEST, "main", needs)
        };
        let kernel = KERNEL.get_or_init(compiled).clone();
        Self {
            tested,
            buffers,
            kernel,
        }
    }

    pub fn answers(&self, asked: &[Asked]) -> Vec<Answer> {
        let (device, buffers) = (&self.tested.device, &self.buffers);
        let input = device.buffer("asked", asked).unwrap();
        let bytes = asked.len() * size_of::<Answer>();
        let output = device.empty("answers", bytes as u64).unwrap();
        let given = [
            &[&input, &output],
            &buffers.geometry.in_order()[..],
            &[&buffers.surfaces, &buffers.materials],
            &buffers.shapes.in_order(),
            &buffers.textures.in_order(),
        ];
        let mut work = device.work();
        let groups = Groups::Count(asked.len().div_ceil(64) as u32);
        work.run(&self.kernel, &given.concat(), groups).unwrap();
        work.submit().unwrap();
        device.read(&output, asked.len()).unwrap()
    }
}

impl Answer {
    /// The fields that are no floats.
    fn numbers(&self) -> [u32; 5] {
        [self.at.object, self.at.triangle, self.beyond, self.kind, self.two_sided]
    }

    fn is_as(&self, other: &Self) -> bool {
        let [own, other_own] = [self, other].map(|answer| bytemuck::cast_slice(std::slice::from_ref(answer)));
        self.numbers() == other.numbers() && same(own, other_own)
    }
}

/// Both agree. Returns their answers.
fn compare(name: &str, tested: &'static Tested, world: &FlatWorld, scene: &Scene, asked: &[Asked]) -> Vec<Answer> {
    let found = OnDevice::new(tested, world).answers(asked);
    let pairs = asked.iter().zip(&found);
    let pairs = pairs.map(|(asked, found)| (asked, found, expected(scene, asked)));
    let mut wrong = pairs.filter(|(_, found, expected)| !found.is_as(expected));
    if let Some((asked, found, expected)) = wrong.next() {
        let more = wrong.count();
        panic!("{name}: {asked:#?}: {found:#?}, expected {expected:#?}; and {more} more");
    }
    found
}

fn asked(random: &mut Random, origin: [f32; 3], dir: [f32; 3], media: &[u32], objects: u32) -> Asked {
    let far = 3.0 * random.unit();
    let any = random.bits() % objects.max(1);
    Asked {
        origin,
        around: random.of(media),
        dir,
        ignored: random.of(&[NONE, NONE, any]),
        wi: random.direction().to_array(),
        distance: random.of(&[0.0, 1e-6, far, far, 1e30, f32::INFINITY]),
    }
}

/// The same objects, whose meshes in turn, from the first on, have random normals and texture coordinates, normals
/// only, texture coordinates only, or neither.
fn with_normals(random: &mut Random, first: usize, objects: &[Object]) -> Vec<Object> {
    let mut made: Vec<(Arc<Mesh>, Arc<Mesh>)> = Vec::new();
    let mut dressed = |mesh: &Arc<Mesh>| {
        if let Some((_, known)) = made.iter().find(|(of, _)| Arc::ptr_eq(of, mesh)) {
            return known.clone();
        }
        let normal = |position: &Vec3| match random.bits() % 64 {
            0 => Vec3::ZERO,
            1 => Vec3::X,
            _ => (position.normalize_or_zero() + 0.5 * random.point()) * (0.5 + random.unit()),
        };
        let normals: Vec<Vec3> = mesh.positions.iter().map(normal).collect();
        let uv = |_: &Vec3| Vec2::new(4.0 * random.unit() - 2.0, random.unit());
        let uvs: Vec<Vec2> = mesh.positions.iter().map(uv).collect();
        let which = first + made.len();
        let with = Arc::new(Mesh {
            positions: mesh.positions.clone(),
            normals: if which % 4 < 2 { normals } else { Vec::new() },
            uvs: if which.is_multiple_of(2) { uvs } else { Vec::new() },
            triangles: mesh.triangles.clone(),
            ..Mesh::default()
        });
        made.push((mesh.clone(), with.clone()));
        with
    };
    let object = |object: &Object| {
        let mut object = object.clone();
        if let Shape::Mesh { mesh, .. } = &mut object.shape {
            *mesh = dressed(mesh);
        }
        object
    };
    objects.iter().map(object).collect()
}

/// A scene of these objects, with materials in turn.
fn of_objects(objects: Vec<Object>, textures: [Texture; 3]) -> SceneDescription {
    let mut scene = empty();
    let [first, second, third] = textures;
    scene.materials = vec![
        MaterialDescription::new(diffuse(first), false).into(),
        even(diffuse(second)).into(),
        even(MaterialKind::Mirror { reflectance: third }).into(),
    ];
    scene.objects = objects;
    for (number, object) in (0..).zip(&mut scene.objects) {
        object.material = number % 3;
    }
    scene
}

/// A texture that is black in a quarter.
fn some_black() -> Texture {
    Texture::Image {
        image: image(),
        filter: TextureFilter::Nearest,
        wrap: Wrap::Mirror,
        image_from_uv: Affine2::from_scale(Vec2::new(1.5, 2.0)),
    }
}

#[test]
fn points_are_those_of_the_renderer() {
    let Some(tested) = tested() else { return };
    let mut random = Random(21);
    let [mut met, mut with_uv, mut black] = [0; 3];
    for (number, scene) in rays::scenes::all(&mut random).into_iter().enumerate() {
        let name = scene.name.clone();
        let asked: Vec<Asked> = rays::rays(&scene, &mut random, 3000)
            .iter()
            .map(|ray| asked(&mut random, ray.origin, ray.dir, &[VACUUM], scene.objects.len() as u32))
            .collect();
        let objects = with_normals(&mut random, number, &scene.objects);
        let materials = [GREY, some_black(), squares()];
        let scene = Scene::new(of_objects(objects, materials));
        let world = FlatWorld::new(&scene, u64::MAX).unwrap();
        let found = compare(&name, tested, &world, &scene, &asked);
        met += found.iter().filter(|answer| answer.at.object != NONE).count();
        // Absent if nothing uses it.
        assert!(
            found
                .iter()
                .all(|answer| answer.at.uv == [0.0; 2] || answer.at.object % 3 != 0)
        );
        with_uv += found.iter().filter(|answer| answer.at.uv != [0.0; 2]).count();
        black += found
            .iter()
            .filter(|answer| answer.at.object % 3 == 1 && answer.kind == 0)
            .count();
    }
    assert!(met > 6000 && with_uv > 2000 && black > 20, "{met} {with_uv} {black}");
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Shape {
    let mesh = Mesh {
        positions,
        triangles,
        ..Mesh::default()
    };
    Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    }
}

fn cuboid(low: [f32; 3], high: [f32; 3]) -> Shape {
    let corner = |i: usize| {
        let side = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
        Vec3::new(side(0), side(1), side(2))
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    mesh((0..8).map(corner).collect(), triangles.collect())
}

/// At z = 2; facing up or down.
fn sheet(faces_up: bool) -> Shape {
    let corners = [[1.5, -1.0], [2.5, -1.0], [2.5, 1.0], [1.5, 1.0]];
    let triangles = match faces_up {
        true => vec![[0, 1, 2], [0, 2, 3]],
        false => vec![[2, 1, 0], [3, 2, 0]],
    };
    mesh(corners.map(|[x, y]| Vec3::new(x, y, 2.0)).to_vec(), triangles)
}

fn placed_at(at: Vec3, size: f32) -> Placement {
    Placement {
        render_from_object: Affine3A::from_scale(Vec3::splat(size)) * Affine3A::from_translation(at / size),
        object_from_render: Affine3A::from_scale(Vec3::splat(1.0 / size)) * Affine3A::from_translation(-at),
    }
}

/// A room, with boxes of fog that fill it to its walls, touch, and are nested; coincident spheres, and a stack of
/// sheets.
fn among_boundaries() -> SceneDescription {
    let mut scene = empty();
    let media = ["haze", "mist", "smoke"].map(|name| {
        let fog = fog(Phase::Isotropic);
        add_medium(&mut scene, name, medium::Medium::Homogeneous(fog))
    });
    scene.world_medium = media[0];
    scene.materials = vec![
        even(diffuse(GREY)).into(),
        even(MaterialKind::Null).into(),
        even(dielectric(1.5, Tint::NONE)).into(),
    ];
    let [wall, null, glass] = [0, 1, 2];
    let mut add = |shape: Shape, material: u32, sides: Option<[MediumId; 2]>| {
        let object = add_object(&mut scene, shape, material) as usize;
        scene.objects[object].boundary = sides.map(|[interior, exterior]| Boundary { interior, exterior });
    };
    let [haze, mist, smoke] = media;
    add(cuboid([-3.0; 3], [3.0; 3]), wall, None);
    add(cuboid([-3.0; 3], [-1.0, 1.0, 3.0]), null, Some([mist, haze]));
    add(cuboid([-1.0, -3.0, -3.0], [1.0, 1.0, 3.0]), null, Some([smoke, None]));
    add(cuboid([-1.0, -3.0, -1.0], [0.0, 0.0, 1.0]), null, Some([haze, smoke]));
    let ball = Shape::Sphere {
        placement: placed_at(Vec3::new(-2.0, -1.0, 0.0), 0.5),
        flip: false,
    };
    add(ball, glass, Some([None, mist]));
    for sides in [[mist, haze], [smoke, mist], [haze, smoke]] {
        let placement = placed_at(Vec3::new(2.0, -2.0, -2.0), 0.75);
        add(sphere(placement), null, Some(sides));
    }
    for (number, sides) in (0..).zip([[mist, haze], [smoke, mist], [None, smoke], [haze, None], [mist, smoke]]) {
        add(sheet(number % 3 == 0), null, Some(sides));
    }
    add(sheet(true), null, None);
    let disc = Shape::Disc {
        placement: placed_at(Vec3::new(2.0, 0.0, 2.0), 0.4),
        flip: true,
    };
    add(disc, wall, Some([smoke, haze]));
    scene
}

/// On the surfaces of that scene.
fn place_on_boundaries(random: &mut Random) -> Vec3 {
    let mut inside = |low: f32, high: f32| low + (high - low) * random.unit();
    let [x, y, z] = [inside(-3.0, 3.0), inside(-3.0, 1.0), inside(-3.0, 3.0)];
    match random.bits() % 8 {
        0 => Vec3::new(-1.0, y, z),
        1 => Vec3::new(x, -3.0, z),
        2 => Vec3::new(-1.0, -3.0, z),
        3 => Vec3::new(-3.0, y, z),
        4 => Vec3::new(2.0, -2.0, -2.0) + 0.75 * random.direction(),
        5 => Vec3::new(-2.0, -1.0, 0.0) + 0.5 * random.direction(),
        6 => Vec3::new(1.5 + random.unit(), 2.0 * random.unit() - 1.0, 2.0),
        _ => Vec3::new(1.0, y, z),
    }
}

#[test]
fn media_beyond_surfaces_at_one_place_are_those_of_the_renderer() {
    let Some(tested) = tested() else { return };
    let mut random = Random(22);
    let scene = Scene::new(among_boundaries());
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let count = world.surfaces.len() as u32;
    let asked: Vec<Asked> = (0..10_000)
        .map(|i| {
            let to = place_on_boundaries(&mut random);
            let from = match i % 4 {
                0 => to + random.of(&[Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z]),
                _ => 3.0 * random.point(),
            };
            let dir = (to - from).normalize_or(Vec3::X).to_array();
            let mut asked = asked(&mut random, from.to_array(), dir, &[VACUUM, 0, 1, 2], count);
            if i % 2 == 0 {
                asked.wi = dir;
            }
            asked
        })
        .collect();
    let found = compare("boundaries", tested, &world, &scene, &asked);
    // All media, including some other than those of the surface that was met; walls come before boundaries that
    // coincide with them.
    let mut beyond = [0; 3];
    let mut others = 0;
    for (asked, found) in asked.iter().zip(found).filter(|(_, found)| found.at.object != NONE) {
        let surface = world.surfaces[found.at.object as usize];
        let ahead = Vec3::from(found.at.ng).dot(asked.wi.into());
        let own = if ahead < 0.0 {
            surface.interior
        } else {
            surface.exterior
        };
        others += usize::from(found.beyond != if own == NONE { asked.around } else { own });
        *beyond.get_mut(found.beyond as usize).unwrap_or(&mut 0) += 1;
    }
    assert!(
        others > 500 && beyond.iter().all(|count| *count > 500),
        "{others} {beyond:?}"
    );
}

/// Along tangents from a file, to both sides, with and without a placement; along UV where there are none.
#[test]
fn normal_maps_go_along_given_tangents() {
    let Some(tested) = tested() else { return };
    let mut random = Random(23);
    let mut scene = empty();
    let map = MaterialDescription {
        normal_perturbation: Some(bsdf::NormalPerturbation::NormalMap(picture())),
        ..even(diffuse(GREY))
    };
    scene.materials = vec![map.into()];
    let placements = [
        Placement::IDENTITY,
        placed_at(Vec3::new(3.0, 0.5, -1.0), 0.7),
        placed_at(Vec3::new(-3.0, 0.0, 1.0), 1.3),
    ];
    for placement in placements {
        let Shape::Mesh { mesh: plain, .. } = cuboid([-1.0; 3], [1.0; 3]) else {
            unreachable!()
        };
        let normal = |position: &Vec3| position.normalize() + 0.2 * random.point();
        let normals: Vec<Vec3> = plain.positions.iter().map(normal).collect();
        let uvs = plain
            .positions
            .iter()
            .map(|_| Vec2::new(4.0 * random.unit() - 2.0, random.unit()));
        let uvs = uvs.collect();
        let tangents = (0..8).map(|i| match i {
            0..5 => random.direction().extend(random.of(&[1.0, -1.0])),
            _ => glam::Vec4::W,
        });
        let mesh = Mesh {
            given_tangents: tangents.collect(),
            normals,
            uvs,
            positions: plain.positions.clone(),
            triangles: plain.triangles.clone(),
            ..Mesh::default()
        };
        let mesh = Arc::new(mesh);
        add_object(&mut scene, Shape::Mesh { mesh, placement }, 0);
    }
    let scene = Scene::new(scene);
    let world = FlatWorld::new(&scene, u64::MAX).unwrap();
    let places = placements.map(|placement| placement.render_from_object.translation);
    let asked: Vec<Asked> = (0..10_000)
        .map(|i| {
            let to = Vec3::from(places[i % 3]) + 0.8 * random.point();
            let from = to + 6.0 * random.direction();
            let dir = (to - from).normalize().to_array();
            asked(&mut random, from.to_array(), dir, &[VACUUM], 3)
        })
        .collect();
    let found = compare("tangents", tested, &world, &scene, &asked);
    let turned =
        |answer: &&Answer| answer.at.object != NONE && Vec3::from(answer.tangent).dot(answer.at.ns.into()).abs() > 1e-3;
    assert!(found.iter().filter(turned).count() > 5000);
}

#[test]
fn structs_of_surfaces_are_the_same_in_kernels() {
    same_layout!(
        &SURFACE_TEST,
        PlacedShape {
            x_axis,
            bits,
            y_axis,
            first_triangle,
            z_axis,
            scale,
            translation,
            first_color,
            first_tangent
        }
    );
    same_layout!(&SURFACE_TEST, Vertex { position, u, normal, v });
    same_layout!(
        &SURFACE_TEST,
        SurfacePoint {
            point,
            object,
            ng,
            triangle,
            ns,
            curvature,
            uv,
            t,
            clearance
        }
    );
    same_layout!(
        &SURFACE_TEST,
        Asked {
            origin,
            around,
            dir,
            ignored,
            wi,
            distance
        }
    );
    let source = SURFACE_TEST.source(crate::kernels::Arithmetic::default());
    for (name, value) in [("NULL_BOUNDARIES", NULL_BOUNDARIES), ("VISIBLE", VISIBLE)] {
        assert!(source.contains(&format!("const {name}: u32 = {value}u;")), "{name}");
    }
}
