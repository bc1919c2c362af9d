//! Where aimed photons start, and their flux.

use super::{BALL, LAMP, POINT, Room, SKY, SPOT, SUN, WIDE_SUN};
use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::render::{is_long, plan_of};
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_render::math::{Frame, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::light::{EmissionSample, EmissionUniforms};

/// Makes the world a thousand times as large as the room, so that rays from its rim meet discs only roughly.
const FAR: &str = r#"
[[shapes]]
name = "very far away"
type = "sphere"
center = [0, -3000, 0]
radius = 0.4
material = "wall"
"#;

/// Flux by start and direction is that of plain emission, at a significance of 1e-3 for all tests of a light together.
#[test]
fn flux_is_that_of_the_light() {
    for (what, more) in [
        ("sky", SKY),
        ("sun", SUN),
        ("spot", SPOT),
        ("wide sun", WIDE_SUN),
        ("spot of a ball", BALL),
        ("point", POINT),
        ("lamp", LAMP),
        ("sky of a large world", &format!("{FAR}{SKY}")),
        ("sun of a large world", &format!("{FAR}{SUN}")),
    ] {
        let room = Room {
            targeting: "on",
            left_window: true,
            more,
        };
        let scene = room.scene();
        let plan = plan_of(&scene);
        let description = scene.description();
        let (objects, bounds) = (&description.objects, &description.bounds);
        let light = &description.lights[0];
        let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
        const BINS: usize = 65;
        let bin = |start: &EmissionSample| {
            let side = |x: f32, bit: usize| usize::from(x > 0.0) << bit;
            let line = start.origin + start.dir * bounds.radius - bounds.center;
            let d = start.dir;
            side(d.x, 0) + side(d.y, 1) + side(d.z, 2) + side(line.x, 3) + side(line.y, 4) + side(line.z, 5)
        };
        let mut means = [[MeanEstimate::new(); BINS]; 2];
        let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
        for _ in 0..200_000 {
            let plain = light.sample_emission(objects, bounds, EmissionUniforms::draw(&mut sampler));
            let u = EmissionUniforms::draw(&mut sampler);
            let mixed = light.sample_mixture(objects, bounds, aim, u, sampler.next_1d());
            for (means, start) in means.iter_mut().zip([Some(plain), mixed]) {
                let at = start.map(|start| (bin(&start), f64::from(start.power.x)));
                for (i, mean) in means.iter_mut().enumerate() {
                    mean.add(match at {
                        Some((_, power)) if i == BINS - 1 => power,
                        Some((bin, power)) if i == bin => power,
                        _ => 0.0,
                    });
                }
            }
        }
        let mut suite = Suite::new(1e-3);
        let [plain, mixed] = &means;
        for (i, (a, b)) in plain.iter().zip(mixed).enumerate() {
            suite.same_mean(format!("{what}, bin {i}"), a, b);
        }
        suite.finish();
        let power = f64::from(light.power(objects, bounds).x);
        let total = &mixed[BINS - 1];
        assert!(total.p_value(power) > 1e-4, "{what}: {} of {power}", total.mean());
    }
}

/// The number of a sampler's directions in caps around some of them, against the density integrated over even
/// directions there: discs seen edge-on make densities too narrow for quadrature over the sphere. Significance 1e-3.
fn caps_hold_what_their_density_says(
    what: &str,
    draw: impl Fn(&mut Sampler) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) {
    const CAPS: usize = 200;
    let mut sampler = Sampler::new(7, 1, Purpose::Test, 0);
    let caps: Vec<Vec3> = (0..)
        .find_map(|_| {
            let drawn: Vec<Vec3> = (0..CAPS * 4).filter_map(|_| draw(&mut sampler)).collect();
            (drawn.len() >= CAPS).then(|| drawn[..CAPS].to_vec())
        })
        .unwrap();
    let drawn: Vec<Option<Vec3>> = (0..200_000).map(|_| draw(&mut sampler)).collect();
    let mut suite = Suite::new(1e-3);
    let least = libm::cosf(0.05);
    let size = 2.0 * std::f64::consts::PI * (1.0 - f64::from(least));
    for cap in caps {
        let inside = |dir: &Option<Vec3>| f64::from(u8::from(dir.is_some_and(|d| d.dot(cap) >= least)));
        let counted: MeanEstimate = drawn.iter().map(inside).collect();
        let frame = Frame::from_normal(cap);
        let even = |_| frame.to_world(warp::uniform_cone(sampler.next_2d(), least));
        let integral: MeanEstimate = (0..20_000).map(even).map(|dir| size * f64::from(pdf(dir))).collect();
        suite.same_mean(format!("{what}, around {cap}"), &counted, &integral);
    }
    suite.finish();
}

/// Directions from lights with a position, and points across the sun's rays, follow the density that weights them. Each
/// test at a significance of 1e-3.
#[test]
fn starts_follow_their_density() {
    for (what, more) in [("spot", SPOT), ("ball", BALL), ("point", POINT), ("lamp", LAMP)] {
        // The spot and the lamp cover what the ball and the point have in common with them.
        if ["ball", "point"].contains(&what) && !is_long() {
            continue;
        }
        let scene = Room {
            targeting: "on",
            left_window: true,
            more,
        }
        .scene();
        let plan = plan_of(&scene);
        let description = scene.description();
        let (objects, bounds) = (&description.objects, &description.bounds);
        let light = &description.lights[0];
        let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
        // One point of the lamp or ball.
        let draw = |sampler: &mut Sampler| {
            let u = EmissionUniforms {
                position: Vec2::new(0.7, 0.53),
                primitive: 0.5,
                direction: sampler.next_2d(),
            };
            light.sample_mixture(objects, bounds, aim, u, sampler.next_1d())
        };
        let one = (0..)
            .find_map(|i| draw(&mut Sampler::new(1, 1, Purpose::Test, i)))
            .unwrap();
        let pdf = |dir: Vec3| light.mixture_pdf(bounds, aim, &EmissionSample { dir, ..one });
        caps_hold_what_their_density_says(what, |s| draw(s).map(|start| start.dir), pdf);
    }
    for (what, sun) in [("sun", SUN), ("wide sun", WIDE_SUN)] {
        points_follow_their_density(what, sun);
    }
}

/// Points across one direction of a sun.
fn points_follow_their_density(what: &str, sun: &str) {
    let scene = Room {
        targeting: "on",
        left_window: true,
        more: sun,
    }
    .scene();
    let plan = plan_of(&scene);
    let description = scene.description();
    let (objects, bounds) = (&description.objects, &description.bounds);
    let light = &description.lights[0];
    let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
    let draw = |sampler: &mut Sampler| {
        let u = EmissionUniforms {
            direction: Vec2::new(0.6, 0.27),
            ..EmissionUniforms::draw(sampler)
        };
        light.sample_mixture(objects, bounds, aim, u, sampler.next_1d())
    };
    let one = draw(&mut Sampler::new(1, 1, Purpose::Test, 0)).unwrap();
    let frame = beamfarm_render::math::Frame::from_normal(one.dir);
    let middle = bounds.center - one.dir * bounds.radius;
    let to_plane = |start: EmissionSample| frame.to_local(start.origin - middle).truncate();
    let pdf = |p: Vec2| {
        if p.length() > bounds.radius {
            return 0.0;
        }
        let origin = middle + frame.to_world(p.extend(0.0));
        // For a sun with an angular size this density includes that of the direction.
        let of_dir = if one.pdf_dir.is_finite() { one.pdf_dir } else { 1.0 };
        light.mixture_pdf(bounds, aim, &EmissionSample { origin, ..one }) / of_dir
    };
    let side = (-f64::from(bounds.radius), f64::from(bounds.radius));
    let domain = Rect { x: side, y: side };
    let result = Chi2::default().plane(domain, |s| draw(s).map(to_plane), pdf);
    assert!(result.p_value > 1e-3, "{what}: {result:?}");
}
