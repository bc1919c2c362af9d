//! A camera that no light reaches because it is inside something opaque. A room does not count: it has a lamp, a window
//! or an open side.

use crate::assets::mesh::meets;
use beamfarm_render::math::Vec3;
use beamfarm_render::world::bsdf::{BsdfFlags, Material};
use beamfarm_render::world::geometry::{Mesh, Object, Shape, bounds};
use beamfarm_render::world::light::{Light, LightKind};
use glam::DVec3;

/// Rays that must agree on what is inside. They avoid axes and diagonals, where edges often lie.
const RAYS: [DVec3; 5] = [
    DVec3::new(0.31, 0.87, 0.38),
    DVec3::new(-0.79, 0.21, 0.57),
    DVec3::new(0.13, -0.67, -0.73),
    DVec3::new(0.71, -0.11, -0.69),
    DVec3::new(-0.43, 0.29, -0.85),
];

/// The object, if any, that keeps all light from a camera at the origin of render space.
pub fn around_camera<'o>(objects: &'o [Object], materials: &[Material], lights: &[Light]) -> Option<&'o Object> {
    let is_opaque = |material: &Material| !material.has(BsdfFlags::TRANSMITS);
    let opaque = objects
        .iter()
        .filter(|object| is_opaque(&materials[object.material as usize]));
    let mut dark = opaque.filter(|object| object.light.is_none() && is_near(&object.shape));
    dark.find(|object| is_inside(&object.shape) && !lights.iter().any(|light| may_shine_in(light, object, objects)))
}

/// A necessary condition for being inside: the camera lies in the object's own box.
fn is_near(shape: &Shape) -> bool {
    match shape {
        Shape::Sphere { placement, .. } => placement.object_from_render.translation.length_squared() < 1.0,
        // In the mesh's own space, so that copies share the cached box.
        Shape::Mesh { mesh, placement } => {
            let at: Vec3 = placement.object_from_render.translation.into();
            let beyond = |side: fn(&Vec3, &Vec3) -> bool| mesh.positions.iter().any(|p| side(p, &at));
            beyond(|p, at| p.x < at.x)
                && beyond(|p, at| p.x > at.x)
                && beyond(|p, at| p.y < at.y)
                && beyond(|p, at| p.y > at.y)
                && beyond(|p, at| p.z < at.z)
                && beyond(|p, at| p.z > at.z)
        }
        Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => false,
    }
}

fn is_inside(shape: &Shape) -> bool {
    match shape {
        Shape::Sphere { .. } => true,
        Shape::Mesh { mesh, placement } => {
            let at: Vec3 = placement.object_from_render.translation.into();
            let odd = |ray: &DVec3| crossings(mesh, at.as_dvec3(), *ray) % 2 == 1;
            RAYS.iter().all(odd) && mesh.is_closed()
        }
        Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => false,
    }
}

/// How many triangles a ray crosses.
fn crossings(mesh: &Mesh, from: DVec3, along: DVec3) -> usize {
    let corners = |triangle: u32| mesh.corners(triangle).map(|p| p.as_dvec3() - from);
    let triangles = 0..mesh.triangles.len() as u32;
    triangles.filter(|triangle| meets(corners(*triangle), along)).count()
}

/// Whether a light, or part of it, may lie inside an object.
fn may_shine_in(light: &Light, object: &Object, objects: &[Object]) -> bool {
    let (low, high) = bounds(&object.shape);
    let meets = |from: Vec3, to: Vec3| from.cmple(high).all() && to.cmpge(low).all();
    match &light.kind {
        LightKind::Point { position, .. } => meets(*position, *position),
        LightKind::Spot(spot) => meets(spot.position - spot.radius, spot.position + spot.radius),
        LightKind::Projector(projector) => meets(projector.position, projector.position),
        LightKind::Goniometric(lamp) => meets(lamp.position, lamp.position),
        LightKind::Laser(laser) => meets(laser.position - laser.reach(), laser.position + laser.reach()),
        LightKind::Area { object, .. } => {
            let (from, to) = bounds(&objects[*object as usize].shape);
            meets(from, to)
        }
        LightKind::Volume(light) => {
            let (center, radius) = light.ball();
            meets(center - radius, center + radius)
        }
        LightKind::Directional(_) | LightKind::Environment(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use beamfarm_image::bundle::Bundle;

    fn notes(camera: &str, more: &str) -> Vec<String> {
        let text = format!(
            "image = {{ width = 8, height = 6 }}\n\
             camera = {{ origin = {camera}, target = [0, 0, -9], fov = 40 }}\n\
             [materials.glass]\ntype = \"dielectric\"\nior = 1.5\n\
             [materials.leaf]\ntype = \"diffuse\"\nopacity = 0.5\n\
             [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n{more}"
        );
        let mut bundle = Bundle {
            scene: "room.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("room.toml".into(), text.into());
        crate::load(&bundle).unwrap().notes
    }

    #[test]
    fn a_camera_in_something_opaque_is_told_of() {
        for shape in ["sphere", "cube"] {
            let shape = format!("[[shapes]]\nname = \"stone\"\ntype = \"{shape}\"\n");
            let said = notes("[0.1, 0.2, 0.3]", &shape);
            let is_said =
                matches!(&said[..], [only] if only.starts_with("room.toml:2: ") && only.contains("\"stone\""));
            assert!(is_said, "{said:?}");
            assert!(notes("[0, 0, 1.1]", &shape).is_empty());
            assert!(notes("[0.1, 0.2, 0.3]", &(shape.clone() + "material = \"glass\"")).is_empty());
            assert!(notes("[0.1, 0.2, 0.3]", &(shape.clone() + "material = \"leaf\"")).is_empty());
            // Near a corner of the sphere's box, so outside the sphere.
            let is_sphere = shape.contains("sphere");
            assert_eq!(notes("[0.7, 0.7, 0.7]", &shape).is_empty(), is_sphere, "{shape}");
            let copies = "[[shapes]]\nname = \"row\"\ntype = \"instances\"\nshape = { type = \"cube\" }\n\
                          transforms = [[{ translate = [5, 0, 0] }], [{ scale = 2 }]]\n";
            let said = notes("[0, 0.2, 1.3]", copies);
            assert!(said.len() == 1 && said[0].contains("row[1]"), "{said:?}");
        }
    }

    #[test]
    fn a_room_is_not() {
        let room = "[[shapes]]\ntype = \"cube\"\ntransform = [{ scale = 3 }]\n";
        let lamp = "[[lights]]\ntype = \"point\"\nposition = [0, 2, 0]\npower = 1\n";
        let panel = "[[shapes]]\ntype = \"rectangle\"\nemission = { radiance = 1 }\n";
        assert_eq!(notes("[0.1, 0.2, 0.3]", room).len(), 1);
        assert!(notes("[0.1, 0.2, 0.3]", &format!("{room}{lamp}")).is_empty());
        assert!(notes("[0.1, 0.2, 0.3]", &format!("{room}{panel}")).is_empty());
        assert!(notes("[0.1, 0.2, 0.3]", &format!("{room}flip_normals = true\n{lamp}")).is_empty());
        let glowing = format!("{room}emission = {{ radiance = 1 }}\nflip_normals = true\n");
        assert!(notes("[0.1, 0.2, 0.3]", &glowing).is_empty());
        // What the camera does not see does not enclose it.
        let unseen = format!("{room}visible = [\"reflected\", \"shadow\"]\n");
        assert!(
            notes("[0.1, 0.2, 0.3]", &unseen)
                .iter()
                .all(|note| !note.contains("inside of"))
        );
    }
}
