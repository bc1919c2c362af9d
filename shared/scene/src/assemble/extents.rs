//! Where things lie in the world.

use super::medium::Media;
use crate::parse::{Fault, SceneRecord};
use beamfarm_render::world::geometry::{Object, bounds};
use glam::DVec3;

/// The bounding box of an object or volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Extent {
    /// Its name in the scene file, with its kind.
    pub name: String,
    /// Its least and greatest corners, world space.
    pub corners: [[f64; 3]; 2],
}

/// The boxes of volumes, and what it takes to find those of objects.
pub struct Extents {
    /// World position of the origin of render space.
    origin: DVec3,
    /// Medium number, name and box, render space.
    volumes: Vec<(u16, String, [DVec3; 2])>,
}

/// The bounding box of points.
fn around(points: impl Iterator<Item = DVec3>) -> Option<[DVec3; 2]> {
    points
        .map(|point| [point, point])
        .reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])
}

fn of_object(object: &Object) -> [DVec3; 2] {
    let (low, high) = bounds(&object.shape);
    [low.as_dvec3(), high.as_dvec3()]
}

impl Extents {
    pub(super) fn new(origin: DVec3, media: &Media) -> Self {
        let volumes = (0..media.list.len() as u16).filter_map(|index| {
            let name = media.name(Some(index)).to_owned();
            Some((index, name, around(media.corners(Some(index)))?))
        });
        Self {
            origin,
            volumes: volumes.collect(),
        }
    }

    /// Volumes that lie wholly outside the objects that contain them, and so are invisible.
    pub(super) fn outside(&self, record: &SceneRecord, objects: &[Object]) -> Vec<Fault> {
        let outside = self.volumes.iter().filter_map(|(index, name, [low, high])| {
            let holds = |object: &&Object| object.boundary.is_some_and(|it| it.interior == Some(*index));
            let holders = objects.iter().filter(holds).map(of_object);
            let [from, to] = around(holders.flatten())?;
            let apart = low.cmpgt(to).any() || from.cmpgt(*high).any();
            let place = record.media.keys().find(|key| key.get_ref() == name)?.span();
            let volume = self.words([*low, *high]);
            let around = self.words([from, to]);
            let message =
                format!("it fills {volume}, and lies outside of the shapes that hold it, which fill {around}");
            apart.then(|| Fault::new(place, message))
        });
        outside.collect()
    }

    fn words(&self, [low, high]: [DVec3; 2]) -> String {
        let (low, high) = (low + self.origin, high + self.origin);
        format!(
            "[{:.4}, {:.4}, {:.4}] to [{:.4}, {:.4}, {:.4}]",
            low.x, low.y, low.z, high.x, high.y, high.z
        )
    }

    /// The boxes of all objects, of all volumes, and of the whole scene.
    pub fn list(&self, objects: &[Object]) -> Vec<Extent> {
        let shapes = objects.iter().map(|object| (object.name.clone(), of_object(object)));
        let volumes = self.volumes.iter();
        let volumes = volumes.map(|(_, name, corners)| (format!("volume of medium {name:?}"), *corners));
        let mut all: Vec<(String, [DVec3; 2])> = shapes.chain(volumes).collect();
        let whole = around(all.iter().flat_map(|(_, corners)| *corners));
        all.extend(whole.map(|corners| ("all of them".to_owned(), corners)));
        let to_world = |corners: [DVec3; 2]| corners.map(|corner| (corner + self.origin).to_array());
        let extent = |(name, corners)| Extent {
            name,
            corners: to_world(corners),
        };
        all.into_iter().map(extent).collect()
    }
}
