//! Paths start as the renderer's camera rays.

use super::{fog, furnace, plan};
use crate::device::Groups;
use crate::kernels::PATH_START;
use crate::pass::constants::{PassConstants, Slots};
use crate::pass::paths::{Found, Named, Path};
use crate::testing::tested;
use crate::twin;
use crate::world::FlatWorld;
use beamfarm_render::math::{Ray, Vec2};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::filter::PixelFilter;

/// Where a pixel's ray crosses the lens, if tiles visit its parts in turn: the tile's part and the block's.
fn on_lens(plan: &RenderPlan, pass_index: u64, [x, y]: [u32; 2], u: Vec2) -> Vec2 {
    if !plan.beams {
        return u;
    }
    let tile = u64::from(y / 32 * 32) << 32 | u64::from(x / 32 * 32);
    let mut cells = Sampler::even(plan.settings.seed, pass_index, Purpose::Lens, tile);
    let part = |cells: &mut Sampler| (cells.next_2d() * 4.0).floor();
    let of_tile = part(&mut cells) * 0.25;
    // Blocks of 4 x 4 along a Z curve.
    let bits = |place: u32| (0..3).map(move |bit| (place >> bit & 1) << (2 * bit)).sum::<u32>();
    let block = bits(x % 32 / 4) + 2 * bits(y % 32 / 4);
    let corner = (0..=block).map(|_| part(&mut cells)).last().unwrap_or_default();
    of_tile + corner * 0.0625 + u * 0.0625
}

fn ray(scene: &Scene, plan: &RenderPlan, pass_index: u64, [x, y]: [u32; 2]) -> Ray {
    let camera = &scene.description().camera;
    let chunk = u64::from(y) * u64::from(camera.width) + u64::from(x);
    let seed = plan.settings.seed;
    let mut sampler = Sampler::even(seed, pass_index, Purpose::Camera, chunk);
    let own = sampler.next_2d();
    let within = match camera.filter.spreads() {
        true => Sampler::even(seed, pass_index, Purpose::Film, 0).next_2d(),
        false => own,
    };
    let lens = on_lens(plan, pass_index, [x, y], sampler.next_2d());
    twin::camera::ray(camera, camera.sample(x, y, within), lens)
}

/// With a lens, with and without fog and a filter; all slots within the picture.
#[test]
fn paths_start_with_the_rays_of_the_camera() {
    let Some(tested) = tested() else { return };
    let device = &tested.device;
    let spreads = PixelFilter::Gaussian { stddev: 0.5 };
    for (in_fog, filter, projection) in [
        (true, PixelFilter::Box, Projection::Perspective),
        (false, spreads, Projection::Perspective),
        (true, spreads, Projection::Orthographic),
    ] {
        let mut description = furnace(0.5);
        description.camera.projection = projection;
        (description.camera.width, description.camera.height) = (45, 35);
        description.camera.aperture = 0.2;
        description.camera.filter = filter;
        if in_fog {
            description.world_medium = fog(&mut description, 0.1, 0.0);
        }
        let scene = Scene::new(description);
        let (plan, pass_index) = (plan(&scene, 9), 21);
        assert_eq!(plan.beams, in_fog);
        let world = FlatWorld::new(&scene, u64::MAX).unwrap().upload(device).unwrap();
        let slots = Slots {
            first: 64,
            count: 5 * 6 * 64 - 64,
            columns: 6,
            branches: 0,
        };
        let constants = PassConstants::new(&scene, &plan, pass_index, slots);
        let constants = device.buffer("plan", &[constants]).unwrap();
        let each = |bytes: usize| device.empty("paths", (bytes * slots.count as usize) as u64).unwrap();
        let [paths, samplers, found, on_way] = [size_of::<Path>(), 40, size_of::<Found>(), 4].map(each);
        let named = Named::of_world(&world).with(&[
            ("constants", &constants),
            ("paths", &paths),
            ("samplers", &samplers),
            ("found", &found),
            ("on_way", &on_way),
        ]);
        let mut work = device.work();
        let kernel = tested.kernel(&PATH_START, "start");
        named.run(&mut work, &kernel, Groups::Count(slots.count / 64)).unwrap();
        work.submit().unwrap();
        let mut seen = 0;
        for path in device.read::<Path>(&paths, slots.count as usize).unwrap() {
            if path.x >= 45 || path.y >= 35 {
                assert_eq!(path.phase, 0);
                continue;
            }
            let expected = ray(&scene, &plan, pass_index, [path.x, path.y]);
            let bits = |v: [f32; 3]| v.map(f32::to_bits);
            assert_eq!(
                bits(path.origin),
                bits(expected.origin.to_array()),
                "{} {}",
                path.x,
                path.y
            );
            assert_eq!(bits(path.dir), bits(expected.dir.to_array()), "{} {}", path.x, path.y);
            assert_eq!((path.phase, path.beta), (1, [1.0; 3]));
            seen += 1;
        }
        assert_eq!(seen, 45 * 35 - 64);
    }
}
