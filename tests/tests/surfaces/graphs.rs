//! Textures as graphs: reflected, emitted, transmitted, as heights and as densities; against formulas, against
//! checkerboards, and with the path tracer.

use super::vertex_colors::check;
use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, reference_images, scene};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::math::{Ray, Vec2, Vec3, cos};
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::Bsdf;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::texture::TexturePoint;

/// The square [-1, 1]^2 in the xy plane under an even sky of 1, seen from above.
fn square(what: &str) -> Scene {
    scene(&format!(
        r#"
[image]
width = 8
height = 8
[render]
passes = 200
[camera]
origin = [0, 0, 1]
target = [0, 0, 0]
projection = "orthographic"
view_width = 2
[textures.across]
node = "separate"
value = {{ node = "coordinates", of = "object" }}
mode = "xyz"
[textures.up]
node = "separate"
value = {{ node = "coordinates", of = "generated" }}
mode = "xyz"
output = "y"
# (x + 1) / 2, (y + 1) / 4 and 1/4, as the colours of vertices are.
[textures.both]
node = "combine"
x = {{ node = "map_range", value = {{ texture = "across" }}, from_min = -1 }}
y = {{ node = "math", operation = "multiply", a = {{ texture = "up" }}, b = 0.5 }}
z = 0.25
[[lights]]
type = "environment"
radiance = 1.0
[[shapes]]
type = "rectangle"
{what}
"#
    ))
}

/// By passes and by the path tracer; in a blend; emitted.
#[test]
fn a_square_reflects_and_emits_what_its_graph_says() {
    let mut suite = Suite::new(1e-2);
    let plain = "[materials.colored]\ntype = \"diffuse\"\nreflectance = { texture = \"both\" }\n";
    let own = square(&format!("material = \"colored\"\n{plain}"));
    check("diffuse", &blocks(&own, 4), [1.0; 3], &mut suite);
    let settings = ReferenceSettings {
        seed: 2,
        max_depth: None,
    };
    let reference = Blocks::new(reference_images(&own, settings, 40, 8), 4);
    check("reference", &reference, [1.0; 3], &mut suite);
    let blend = format!(
        "material = \"half\"\n[materials.half]\ntype = \"blend\"\nmaterials = [\"black\", \"colored\"]\n\
         weight = {{ node = \"math\", a = 0.2, b = {{ node = \"coordinates\", of = \"uv\", output = \"vector\" }}, \
         operation = \"multiply_add\", c = 0.5 }}\n\
         [materials.black]\ntype = \"diffuse\"\nreflectance = 0\n{plain}"
    );
    // A weight that grows with (u + v) / 3.
    let found = blocks(&square(&blend), 4);
    for (i, block) in found.blocks.iter().enumerate() {
        let (u, v) = ([0.25, 0.75][i % 2], [0.75, 0.25][i / 2]);
        // Blue is 1/4 everywhere, so its mean is that of the weight.
        let expected = 0.25 * (0.5 + 0.2 * (u + v) / 3.0);
        suite.mean_within(format!("blend, {i}"), &block[2], expected, 1e-5);
    }
    let glowing = square("emission = { radiance = { texture = \"both\" }, scale = [2, 3, 4] }");
    assert_eq!(glowing.description().lights.len(), 2);
    check("emission", &blocks(&glowing, 4), [2.0, 3.0, 4.0], &mut suite);
    let holey = "material = \"m\"\n[materials.m]\ntype = \"diffuse\"\nreflectance = 0\n\
                 opacity = { node = \"math\", operation = \"subtract\", a = 1, b = { texture = \"up\" } }\n";
    let found = blocks(&square(holey), 4);
    for (i, block) in found.blocks.iter().enumerate() {
        // The sky is seen through it.
        let expected = [0.75, 0.25][i / 2];
        suite.mean_within(format!("opacity, {i}"), &block[1], expected, 1e-5);
    }
    suite.finish();
}

/// A graph of squares is a checkerboard; the normal of a wave of heights is known.
#[test]
fn squares_and_waves_are_where_they_should_be() {
    let room = |floor: &str| {
        format!(
            r#"
image = {{ width = 24, height = 24 }}
camera = {{ origin = [0, 2, 3], target = [0, 0, 0], fov = 40 }}
[textures.squares]
node = "checker"
vector = {{ node = "coordinates", of = "uv" }}
scale = 8
# As in Blender, the square at the origin is of the second colour.
color1 = 0.1
color2 = [0.2, 0.5, 0.8]
[textures.wave]
node = "math"
operation = "sine"
a = {{ node = "math", operation = "multiply", a = {{ node = "separate", mode = "xyz", value = {{ node = "coordinates", of = "uv" }} }}, b = 12.566370614359172 }}
[[lights]]
type = "point"
position = [1, 2, 1]
power = 60
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
material = "m"
[materials.m]
type = "diffuse"
{floor}
"#
        )
    };
    let [graph, squares] = [
        "reflectance = { texture = \"squares\" }",
        "reflectance = { checkerboard = [[0.2, 0.5, 0.8], 0.1], uv = [{ scale = 4 }] }",
    ]
    .map(|floor| scene(&room(floor)));
    let reflectance = |scene: &Scene, uv: Vec2| match scene.description().materials[0].bsdf(&TexturePoint::of_uv(uv)) {
        Bsdf::Diffuse { reflectance, .. } => reflectance,
        other => panic!("{other:?}"),
    };
    for i in 0..10_000 {
        let uv = Vec2::new(i as f32 * 0.754_877_7, i as f32 * 0.569_840_3) * 1e-3;
        // Not on a line.
        if ((uv * 8.0).fract() - 0.5).abs().max_element() < 0.499 {
            assert_eq!(reflectance(&graph, uv), reflectance(&squares, uv), "{uv}");
        }
    }
    // Light along the normal of a wave of heights, whose slope is known. Blended with what is below by its strength,
    // and on another wave.
    let wave = "texture = \"wave\", scale = 0.05";
    let blend = |n: Vec3, below: Vec3, strength: f32| (n * strength + below * (1.0 - strength)).normalize();
    for (bump, [strength, below]) in [
        (format!("{{ {wave} }}"), [1.0, 0.0]),
        (format!("{{ {wave}, strength = 0.25 }}"), [0.25, 0.0]),
        (
            format!("{{ {wave}, strength = 0.25, over = {{ {wave}, strength = 0.5 }} }}"),
            [0.25, 0.5],
        ),
    ] {
        let bumpy = scene(&room(&format!("reflectance = 0.5\nbump = {bump}")));
        let mut checked = 0;
        for i in 0..200 {
            let x = -0.99 + 0.01 * i as f32;
            let ray = Ray {
                origin: Vec3::new(x, 1.0, 0.3) - bumpy.description().camera.position - Vec3::new(0.0, 2.0, 3.0),
                dir: Vec3::new(0.0, -1.0, 0.0),
            };
            let Some(mut hit) = bumpy.first_hit(&ray, |_| false) else {
                continue;
            };
            let material = bumpy.material(&hit);
            let _ = bumpy.interaction(material, &mut hit, ray.dir, None);
            // u = (x + 1) / 2; the slope of the height along x is 0.05 * 4 pi cos(4 pi u) / 2.
            let u = 0.5 * (x + 1.0);
            let slope = 0.05 * 2.0 * std::f32::consts::PI * cos(4.0 * std::f32::consts::PI * u);
            let lower = blend(Vec3::new(-slope, 1.0, 0.0).normalize(), Vec3::Y, below);
            // With a normal n and heights h over dp/du and dp/dv: n - grad h, its part across n.
            let across = Vec3::new(lower.y, -lower.x, 0.0);
            // A move by 1 in x is a move by lower.y along the direction across the normal.
            let upper = (lower - across * (slope / lower.y)).normalize();
            let expected = blend(upper, lower, strength);
            assert!((hit.ns - expected).length() < 2e-3, "{bump} {x}: {} {expected}", hit.ns);
            checked += 1;
        }
        assert!(checked > 190, "{checked}");
    }
}

/// A density from a graph is that graph at its samples, and linear between them.
#[test]
fn densities_are_what_their_graph_says() {
    let scene = scene(
        r#"
image = { width = 8, height = 8 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }
[textures.ramp]
node = "separate"
mode = "xyz"
value = { node = "coordinates", of = "object" }
[media.smoke]
type = "heterogeneous"
sigma_a = 0.5
sigma_s = 0.5
density = { texture = "ramp", min = [0, -1, -1], max = [2, 1, 1], voxel = 0.1 }
[materials.null]
type = "null"
[[shapes]]
type = "cube"
material = "null"
interior = "smoke"
transform = [{ translate = [1, 0, 0] }]
[[lights]]
type = "point"
position = [0, 3, 0]
power = 1
"#,
    );
    let Medium::Heterogeneous(smoke) = &scene.description().media[0] else {
        panic!("a grid");
    };
    // Linear from 0.05 to 1.95 at the outer samples, whose values extend to the border.
    assert!((smoke.bricks().max() - 1.95).abs() < 1e-5, "{}", smoke.bricks().max());
    let mut sampler = beamfarm_render::sampler::Sampler::new(1, 0, beamfarm_render::sampler::Purpose::Test, 0);
    let origin = Vec3::new(1.0, 0.2, -1.0) - Vec3::new(0.0, 0.0, 5.0);
    let ray = Ray { origin, dir: Vec3::Z };
    let mean = (0..2000)
        .map(|_| f64::from(smoke.transmittance(&ray, 2.0, &mut sampler).x))
        .sum::<f64>()
        / 2000.0;
    // At x = 1 the density is 1 all the way.
    assert!((mean - libm::exp(-2.0)).abs() < 4.0 * 0.35 / 2000f64.sqrt(), "{mean}");
}
