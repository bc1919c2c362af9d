//! How much of a scene the camera sees: a room's kernels suit the room, however large the building is.

use crate::math::{Ray, Vec3};
use crate::world::Scene;

/// Rays along each side of the image.
pub(super) const SIDE: usize = 48;
/// Fewer rays, for a quick plan.
pub(super) const FEW: usize = 16;
/// Share of the points to leave out at either end of each axis: rays to the horizon say nothing about what is near.
const OUTLIERS: f32 = 0.25;
/// Factor from the span of the remaining points to the span of [`MEANT`] of all points, if they were spread evenly.
const NARROWED: f32 = MEANT / (1.0 - 2.0 * OUTLIERS);
const MEANT: f32 = 0.9;
/// If one in this many rays meets something, only those rays count.
const ENOUGH: usize = 8;

/// A part of the scene is small if its radius is below this share of the scene's.
const SMALL: f32 = 0.25;
/// For a small part: the radius that counts, over the radius of what the camera sees first. Scenes that the camera sees
/// as a whole have a ratio of about two.
const AROUND: f32 = 2.0;

/// For a camera that sees but a small part of the scene: the middle of that part, and the radius that base radii are
/// fractions of. `side`: rays along each side of the image.
pub(super) fn of_part_seen(scene: &Scene, side: usize) -> Option<(Vec3, f32)> {
    let (middle, seen) = seen(scene, side);
    (seen < SMALL * scene.bounds().radius).then_some((middle, AROUND * seen))
}

/// Middle and radius of what the camera sees first, scene units. The radius is half the diagonal of a box. Along each
/// axis, the box spans nine tenths of the points, estimated from the middle half as if they were spread evenly. If
/// hardly anything is met, points where rays leave the scene's bounds count as well. What is black does not count. A
/// function of the scene alone.
fn seen(scene: &Scene, side: usize) -> (Vec3, f32) {
    let camera = &scene.description().camera;
    let rules = scene.description().rules.as_ref();
    let is_passed = |object: u32| scene.passable[object as usize] || rules.is_some_and(|r| r.hides(r.camera, object));
    let (mut met, mut left) = (Vec::new(), Vec::new());
    for ray in camera.rays_over_image(side) {
        let hit = scene.meets(&ray, f32::INFINITY, &is_passed);
        match hit {
            Some(hit) if !scene.material(&hit).is_black_at(&hit.at) => met.push(hit.point),
            Some(_) => {}
            None => left.extend(out_of_bounds(scene, &ray)),
        }
    }
    if met.len() < side * side / ENOUGH {
        met.append(&mut left);
    }
    let mut middle = scene.bounds().center;
    let size = [0, 1, 2].map(|axis| {
        let mut values: Vec<f32> = met.iter().map(|point| point[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        middle[axis] = values.get(values.len() / 2).copied().unwrap_or(middle[axis]);
        let span = |outliers: f32| {
            let skipped = (values.len() as f32 * outliers) as usize;
            match values.get(skipped..values.len() - skipped) {
                Some([first, .., last]) => last - first,
                _ => f32::INFINITY,
            }
        };
        // Points at both ends only, as on two walls, are not spread evenly.
        (span(OUTLIERS) * NARROWED).min(span(0.5 * (1.0 - MEANT)))
    });
    (middle, 0.5 * Vec3::from(size).length())
}

/// Where a ray leaves the scene's bounds, if it meets them.
fn out_of_bounds(scene: &Scene, ray: &Ray) -> Option<Vec3> {
    let bounds = scene.bounds();
    let from = ray.origin - bounds.center;
    let middle = -from.dot(ray.dir);
    let off = from + ray.dir * middle;
    let half = bounds.radius * bounds.radius - off.length_squared();
    let t = middle + half.max(0.0).sqrt();
    (half > 0.0 && t > 0.0).then(|| ray.at(t))
}
