//! What the page is told of the scene: its camera, what has handles, and what a click has hit.

use super::Bench;
use crate::live::messages::{Camera, ToPage};
use beamfarm_render::world::camera::Projection;
use beamfarm_scene::desk::{self, Thing};
use glam::DVec3;

/// Where handles of lights without a position are drawn, to be turned there: the distance from the camera as a fraction
/// of its target's, and the height above the target as a fraction of half the picture's width there.
const SKY: [f64; 2] = [1.0, 0.22];
/// Pages treat parallel rays as starting this far behind the camera, as a multiple of the radius of scene and image.
const FAR_BEHIND: f64 = 1e5;

impl Bench {
    /// The scene for the page.
    pub fn scene(&self, seq: u64) -> ToPage {
        let title = self.args.scene.file_stem().unwrap_or_default();
        let name = self.file.file_name().unwrap_or_default();
        ToPage::Scene {
            revision: self.number.0,
            seq,
            title: title.to_string_lossy().into_owned(),
            file: name.to_string_lossy().into_owned(),
            dirty: self.is_dirty(),
            undo: !self.undo.is_empty(),
            redo: !self.redo.is_empty(),
            camera: self.camera(),
            things: self.things(),
            fields: desk::fields(&self.text),
        }
    }

    /// The answer to a click.
    pub fn picked(&mut self, x: f64, y: f64) -> ToPage {
        let seen = self.seen_at(x, y);
        let object = seen.map(|seen| seen.object as usize);
        let ids = desk::object_ids(&self.text);
        let objects = &self.description.objects;
        let world = |point: [f32; 3]| std::array::from_fn(|i| f64::from(point[i]) + self.origin[i]);
        ToPage::Picked {
            thing: object.and_then(|object| ids.get(object).cloned()),
            name: object.and_then(|object| Some(objects.get(object)?.name.clone())),
            point: seen.map(|seen| world(seen.point)),
            distance: seen.map(|seen| f64::from(seen.depth)),
            material: object.and_then(|object| desk::material_of(&self.text, object)),
        }
    }

    fn camera(&self) -> Camera {
        let camera = &self.description.camera;
        let eye = desk::eye(&self.meant).ok();
        let forward = camera.frame.n;
        let origin: [f64; 3] = std::array::from_fn(|i| f64::from(camera.position[i]) + self.origin[i]);
        let target = std::array::from_fn(|i| origin[i] + f64::from(forward[i]));
        // The page assumes that rays meet in one point; parallel ones meet very far behind.
        let back = match camera.projection {
            Projection::Perspective | Projection::Panoramic(_) => 0.0,
            Projection::Orthographic => FAR_BEHIND * f64::from(self.description.bounds.radius + camera.half_width),
        };
        let on_plane = |size: f32| match camera.projection {
            Projection::Perspective | Projection::Panoramic(_) => f64::from(size),
            Projection::Orthographic => f64::from(size) / back,
        };
        let fov = eye.and_then(|eye| eye.fov);
        let fixed = match (eye, camera.projection) {
            (None, _) => Some("the scene's camera cannot be found"),
            (_, Projection::Orthographic) => Some("an orthographic camera is moved in the scene's text"),
            (_, Projection::Panoramic(_)) => Some("a panoramic camera is moved in the scene's text"),
            _ => None,
        };
        let sense = camera.frame.s.cross(camera.frame.t).dot(camera.frame.n);
        Camera {
            origin: std::array::from_fn(|i| eye.map_or(origin, |eye| eye.origin)[i] - back * f64::from(forward[i])),
            target: eye.map_or(target, |eye| eye.target),
            up: eye.map_or([0.0, 1.0, 0.0], |eye| eye.up),
            fov: fov.map_or(40.0, |(fov, _)| fov),
            fov_axis: fov.map_or("x", |(_, axis)| axis),
            tan_x: on_plane(camera.half_width),
            width: camera.width,
            height: camera.height,
            shift: [on_plane(camera.shift.x), on_plane(camera.shift.y)],
            // Left-handed, unless the image is mirrored.
            flip_x: sense > 0.0,
            aperture: f64::from(camera.aperture),
            focus_distance: f64::from(camera.focus_distance),
            fixed: fixed.map(str::to_owned),
        }
    }

    /// Everything that has handles. Light from infinitely far away gets a handle in the picture, to be turned there.
    fn things(&self) -> Vec<Thing> {
        let mut things = desk::things(&self.text, &self.description, self.origin);
        let Ok(eye) = desk::eye(&self.meant) else {
            return things;
        };
        let [origin, target] = [eye.origin, eye.target].map(DVec3::from);
        let up = self.description.camera.frame.t.as_dvec3();
        let distance = (target - origin).length();
        let half_width = f64::from(self.description.camera.half_width);
        let half_width = match self.description.camera.projection {
            // The page cannot locate points in panoramic pictures.
            Projection::Panoramic(_) => return Vec::new(),
            Projection::Perspective => distance * half_width,
            Projection::Orthographic => half_width,
        };
        let place = origin + (target - origin) * SKY[0] + up * (half_width * SKY[1]);
        for thing in things.iter_mut().filter(|thing| thing.kind == "directional") {
            thing.at = Some(place.to_array());
        }
        things
    }
}
