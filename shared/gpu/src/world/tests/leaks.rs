//! Rays that start on a closed surface stay on their side of it.

use super::surface::{Asked, OnDevice};
use super::*;
use crate::testing::tested;
use crate::world::geometry::tests::{Random, scenes};

/// Light in a rough glass ball, which continues from each surface inside or outside, sometimes along the surface.
#[test]
fn no_ray_leaks_from_a_closed_mesh() {
    const RAYS: usize = 1000;
    const TURNS: usize = 10;
    let Some(tested) = tested() else { return };
    let mut random = Random(41);
    for is_placed in [false, true] {
        let mut scene = empty();
        scene.materials = vec![even(dielectric(1.5, Tint::NONE)).into()];
        scene.objects = scenes::closed(&mut random, is_placed).objects;
        let world = FlatWorld::new(&Scene::new(scene), u64::MAX).unwrap();
        let device = OnDevice::new(tested, &world);
        let start = |random: &mut Random| (0.3 * random.point(), random.direction(), true);
        let mut rays: Vec<_> = (0..RAYS).map(|_| start(&mut random)).collect();
        let ask = |(origin, dir, _): &(Vec3, Vec3, bool), wi: Vec3| Asked {
            origin: origin.to_array(),
            around: VACUUM,
            dir: dir.to_array(),
            ignored: NONE,
            wi: wi.to_array(),
            distance: f32::INFINITY,
        };
        let [mut inside, mut outside] = [0; 2];
        let mut leaks = Vec::new();
        for _ in 0..TURNS {
            let asked: Vec<Asked> = rays.iter().map(|ray| ask(ray, Vec3::X)).collect();
            let met = device.answers(&asked);
            let turned = rays.iter().zip(&met).map(|(ray, met)| {
                let along = Frame::from_normal(Vec3::from(met.at.ng).try_normalize().unwrap_or(Vec3::Z));
                let any = random.direction();
                let steepness = random.of(&[1.0, 1.0, 1e-2, 1e-4]);
                ask(ray, along.to_world(any.with_z(any.z * steepness).normalize()))
            });
            let asked: Vec<Asked> = turned.collect();
            let met = device.answers(&asked);
            for ((ray, met), asked) in rays.iter_mut().zip(&met).zip(&asked) {
                let (_, dir, is_inside) = *ray;
                let meets_inside = (met.at.object != NONE).then(|| Vec3::from(met.at.ng).dot(dir) > 0.0);
                let is_right = if is_inside {
                    meets_inside == Some(true)
                } else {
                    meets_inside != Some(true)
                };
                if !is_right {
                    leaks.push(format!("{ray:?}: {:?}", met.at));
                }
                *[&mut outside, &mut inside][usize::from(is_inside)] += 1;
                let wi = Vec3::from(asked.wi);
                *ray = match is_right && met.at.object != NONE {
                    true => (met.spawned.into(), wi, Vec3::from(met.at.ng).dot(wi) < 0.0),
                    false => start(&mut random),
                };
            }
        }
        assert!(leaks.is_empty(), "{}: {:#?}", leaks.len(), &leaks[..leaks.len().min(3)]);
        assert!(
            inside > RAYS * TURNS / 2 && outside > RAYS * TURNS / 8,
            "{inside} {outside}"
        );
    }
}
