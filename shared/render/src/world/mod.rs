//! A scene prepared for rays.

pub mod bsdf;
pub mod camera;
mod crossing;
mod description;
mod emitting;
pub mod filter;
pub(crate) mod fresnel;
pub mod geometry;
mod interaction;
pub mod interrupt;
mod lamps;
pub mod light;
pub mod mask;
pub mod medium;
mod moment;
pub mod nested;
pub mod panorama;
pub mod phase;
mod pick;
pub mod rules;
pub mod scalar;
mod selectors;
mod shadow;
pub mod spectrum;
pub mod texture;

use crate::math::{Ray, Rgb, Vec2, Vec3, sin_cos};
use crate::sampler::Sampler;
use crate::world::bsdf::{BsdfFlags, Material};
use crate::world::camera::Projection;
use crate::world::geometry::{Geometry, Object, Subset, SurfaceHit, bounds, clearance};
use crate::world::light::{
    EmissionSample, Environment, ImagePoint, Light, LightKind, LightSources, SceneBounds, SoftLine,
};
use crate::world::medium::{Medium, MediumId};
pub use crossing::StartMedium;
pub use description::{Motion, RenderDefaults, SceneDescription};
pub use interaction::SurfaceInteraction;
use nested::Meetings;
pub use pick::Seen;
pub use selectors::Selectors;
pub(crate) use selectors::lights_that_leave;

/// A scene prepared for rays: with acceleration structures, and the media around camera and lights.
#[derive(Debug)]
pub struct Scene {
    description: SceneDescription,
    pub(crate) geometry: Geometry,
    /// The lights among which each point chooses.
    pub(crate) selectors: Selectors,
    /// The same for points whose scattered rays go on and find some lights well enough to need no light sampling.
    pub(crate) aimed_at: Option<Selectors>,
    /// The lights in the form that the choice needs.
    pub(crate) light_sources: LightSources,
    /// Medium that camera rays start in.
    camera_medium: StartMedium,
    /// By light: medium that photons start in.
    pub(crate) light_media: Vec<StartMedium>,
    /// By light: the object that shadow rays to it ignore, because it cannot shadow itself.
    pub(crate) unshadowing: Vec<Option<u32>>,
    /// Indices of the environment lights.
    pub(crate) environments: Vec<usize>,
    /// By medium: indices of the lights that its emission consists of. Empty if no medium emits.
    emitting: Vec<Vec<u32>>,
    /// By object: whether rays may pass straight through it.
    pub(crate) passable: Vec<bool>,
    /// Objects that bound the kernels around them: nothing ever passes them.
    pub(crate) walls: Subset,
    /// The box around everything.
    pub(crate) hull: [Vec3; 2],
    /// Camera paths seem never to leave it.
    pub(crate) is_closed: bool,
    /// By object: the lowest and highest corner of its bounding box.
    pub(crate) boxes: Vec<(Vec3, Vec3)>,
    /// By object: diagonal of its box, scene units.
    pub(crate) extents: Vec<f32>,
    /// Whether shadow rays must inspect what they meet: boundaries of media, or surfaces that are not opaque.
    pub(crate) shadow_rays_walk: bool,
    /// Some surfaces are pure boundaries of media.
    pub(crate) has_boundaries: bool,
    /// There are boundaries of media.
    pub(crate) bounds_any: bool,
    /// Some surface refracts each wavelength by a different angle.
    pub(crate) disperses: bool,
    /// Objects that overlap or touch.
    pub(crate) meetings: Meetings,
    /// By medium: it contains no light, and light enters only diffusely through its boundary, so no light can be
    /// sampled inside.
    is_enclosed: Vec<bool>,
    /// By object: shadow rays inspect it before it blocks them.
    may_be_passed: Vec<bool>,
}

impl Scene {
    /// Builds the acceleration structures. Deterministic.
    pub fn new(description: SceneDescription) -> Self {
        Self::made(description, None, false)
    }

    /// The same scene as [`Self::new`] makes, given a similar one: data that depends only on shared parts is reused.
    pub fn new_like(previous: &Self, description: SceneDescription) -> Self {
        Self::made(description, Some(previous), false)
    }

    /// `is_apart`: lamps no longer need to be moved apart.
    fn made(description: SceneDescription, previous: Option<&Self>, is_apart: bool) -> Self {
        let (selectors, aimed_at) = (Selectors::of_all(&description), Selectors::aimed_at(&description));
        let material = |o: &Object| &description.materials[o.material as usize];
        let has_pattern = |o: &Object| {
            o.light
                .is_some_and(|light| description.lights[light as usize].has_pattern())
        };
        let objects = || description.objects.iter();
        let has = |any: BsdfFlags| move |o: &Object| material(o).has(any);
        let has_uv = objects().map(|o| has(BsdfFlags::VARIES)(o) || has_pattern(o));
        let known = |number: usize| {
            let (object, known) = (&description.objects[number], previous?.objects().get(number)?);
            object
                .shape
                .is_same(&known.shape)
                .then(|| previous?.boxes.get(number))
                .flatten()
        };
        let known: Vec<_> = (0..description.objects.len()).map(known).collect();
        let boxes: Vec<_> = (known.iter().zip(&description.objects))
            .map(|(known, object)| known.copied().unwrap_or_else(|| bounds(&object.shape)))
            .collect();
        let has_all_of = |previous: &&Self| {
            known.len() == previous.boxes.len()
                && known.iter().all(Option::is_some)
                && previous.description.has_frames == description.has_frames
        };
        let same = previous.filter(has_all_of);
        let geometry = match same {
            Some(previous) => previous.geometry.shared(),
            None => Geometry::in_boxes(&description.objects, &boxes, description.has_frames),
        };
        let geometry = geometry.with_uv(has_uv.collect());
        if !is_apart && let Some(moved) = lamps::moved_apart(&description, &geometry) {
            return Self::made(moved, previous, true);
        }
        let passable: Vec<bool> = objects().map(has(BsdfFlags::PASSABLE)).collect();
        let seen_by_all = |object: u32| match &description.rules {
            Some(rules) => rules.all_photons_see(object),
            None => true,
        };
        let walls = (0..).zip(objects());
        let walls = walls.map(|(number, o)| !has(BsdfFlags::TRANSMITS | BsdfFlags::THIN)(o) && seen_by_all(number));
        let has_boundaries = objects().any(has(BsdfFlags::NULL));
        let shadow_rays_walk = objects().any(|o| has(BsdfFlags::PASSABLE)(o) && !has(BsdfFlags::NULL)(o))
            || (has_boundaries && !description.media.is_empty());
        let unshadowing = |light: &Light| {
            let shape = |object: u32| &description.objects[object as usize].shape;
            let object = light.kind.object();
            object.filter(|object| shape(*object).never_shadows_itself(light.is_two_sided()))
        };
        let light_sources = LightSources::new(&description.lights, &description.objects, &description.bounds);
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let hull = (boxes.iter()).fold(nothing, |[low, high], of| [low.min(of.0), high.max(of.1)]);
        let mut scene = Self {
            selectors,
            aimed_at,
            light_sources,
            camera_medium: StartMedium::One(None),
            light_media: Vec::new(),
            unshadowing: description.lights.iter().map(unshadowing).collect(),
            environments: (0..description.lights.len())
                .filter(|&i| matches!(description.lights[i].kind, LightKind::Environment(_)))
                .collect(),
            is_enclosed: Vec::new(),
            emitting: Vec::new(),
            may_be_passed: passable.clone(),
            passable,
            walls: geometry.subset(walls.collect()),
            geometry,
            hull,
            is_closed: false,
            extents: boxes.iter().map(|(min, max)| (*max - *min).length()).collect(),
            boxes,
            shadow_rays_walk,
            has_boundaries,
            bounds_any: objects().any(|object| object.boundary.is_some()),
            disperses: objects().any(has(BsdfFlags::DISPERSES)),
            meetings: Meetings::default(),
            description,
        };
        scene.add_meetings(previous);
        scene.emitting = scene.find_emitting();
        scene.camera_medium = scene.find_camera_medium();
        scene.is_closed = scene.find_closed();
        scene.light_media = match same.filter(|previous| scene.has_media_of(previous)) {
            Some(previous) => previous.light_media.clone(),
            None => (0..scene.lights().len()).map(|i| scene.find_light_medium(i)).collect(),
        };
        scene.is_enclosed = scene.find_enclosed();
        scene
    }

    /// Finds overlapping objects, before anything else asks which medium is where.
    fn add_meetings(&mut self, previous: Option<&Self>) {
        self.meetings = self.find_meetings(previous);
        if self.meetings.is_empty() {
            return;
        }
        self.meetings.complete(&mut self.description);
        self.shadow_rays_walk = true;
        for (object, may_be_passed) in (0..).zip(&mut self.may_be_passed) {
            *may_be_passed |= self.meetings.has(object);
        }
    }

    /// Media enclosed by diffuse surfaces, without a light inside.
    fn find_enclosed(&self) -> Vec<bool> {
        let count = self.media().len();
        let is_diffuse = |object: u32| {
            let material = self.material_of(object);
            material.has(BsdfFlags::BOUNDS_MEDIA) && !material.has(BsdfFlags::BENDS | BsdfFlags::PASSABLE)
        };
        let mut found = vec![false; count];
        let boundaries = || {
            (0..)
                .zip(self.objects())
                .filter_map(|(i, object)| Some((i, object.boundary?)))
        };
        for (_, boundary) in boundaries().filter(|(object, _)| is_diffuse(*object)) {
            if let Some(inside) = boundary.interior {
                found[usize::from(inside)] = true;
            }
        }
        if !found.contains(&true) {
            return found;
        }
        let mut open = |medium: MediumId| {
            if let Some(medium) = medium {
                found[usize::from(medium)] = false;
            }
        };
        open(self.description.world_medium);
        for (object, boundary) in boundaries() {
            open(boundary.exterior);
            if !is_diffuse(object) {
                open(boundary.interior);
            }
        }
        let is_known = |start: &StartMedium| matches!(start, StartMedium::One(_));
        if !self.meetings.is_empty() || !self.light_media.iter().all(is_known) {
            return vec![false; count];
        }
        for start in &self.light_media {
            if let StartMedium::One(medium) = start {
                open(*medium);
            }
        }
        found
    }

    /// Whether test rays from a camera inside the hull all meet something.
    fn find_closed(&self) -> bool {
        const RAYS: u16 = 256;
        const GOLDEN_ANGLE: f32 = 2.399_963_2;
        let description = &self.description;
        let camera = &description.camera;
        if description.media.is_empty() || description.rules.is_some() || camera.projection == Projection::Orthographic
        {
            return false;
        }
        let [low, high] = self.hull;
        let place = camera.position;
        let is_inside = place.cmpgt(low + camera.aperture).all() && place.cmplt(high - camera.aperture).all();
        let meets_something = |number: u16| {
            // Along a spiral.
            let z = (f32::from(number) + 0.5) * (2.0 / f32::from(RAYS)) - 1.0;
            let (sin, cos) = sin_cos(GOLDEN_ANGLE * f32::from(number));
            let dir = ((1.0 - z * z).sqrt() * Vec2::new(cos, sin)).extend(z);
            self.first_hit(&Ray { origin: place, dir }, |_| false).is_some()
        };
        is_inside && (0..RAYS).all(meets_something)
    }

    /// Whether the lights of another scene with the same shapes are in the same media.
    fn has_media_of(&self, other: &Self) -> bool {
        let has_rules = |scene: &Self| scene.description.rules.is_some();
        let mut objects = self.objects().iter().zip(other.objects());
        let mut lights = self.lights().iter().zip(other.lights());
        // The data that determines the medium in which photons start.
        let start = |light: &Light| {
            let place = match &light.kind {
                LightKind::Point { position, .. } => Some((*position, 0.0, Vec3::ZERO)),
                LightKind::Spot(spot) => Some((spot.position, spot.radius, Vec3::ZERO)),
                LightKind::Projector(projector) => Some((projector.position, 0.0, Vec3::ZERO)),
                LightKind::Goniometric(lamp) => Some((lamp.position, 0.0, Vec3::ZERO)),
                LightKind::Laser(laser) => Some((laser.position, laser.reach(), laser.frame.n)),
                LightKind::Area { .. }
                | LightKind::Directional(_)
                | LightKind::Environment(_)
                | LightKind::Volume(_) => None,
            };
            (light.kind.object(), light.is_two_sided(), place)
        };
        !has_rules(self)
            && !has_rules(other)
            && self.meetings.is_empty()
            && other.meetings.is_empty()
            && self.description.world_medium == other.description.world_medium
            && self.bounds().radius == other.bounds().radius
            && self.lights().len() == other.lights().len()
            && objects.all(|(object, other)| object.boundary == other.boundary)
            && (0..self.boxes.len() as u32).all(|object| self.is_null(object) == other.is_null(object))
            && lights.all(|(light, other)| start(light) == start(other))
    }

    /// Whether both share the same hierarchies.
    pub fn shares_hierarchies_with(&self, other: &Self) -> bool {
        self.geometry.is_shared_with(&other.geometry)
    }

    /// The same picture with this many pixels, see [`Camera::resize`](camera::Camera::resize). Make plans afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.description.camera.resize(width, height);
    }

    /// Whether the rendered result is no longer wanted.
    #[inline]
    pub(crate) fn is_interrupted(&self) -> bool {
        self.description.interrupt.is_raised()
    }

    /// The description that the scene was built from.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The medium that camera rays start in.
    pub fn camera_medium(&self) -> StartMedium {
        self.camera_medium
    }

    /// By light: the medium that photons start in.
    pub fn light_media(&self) -> &[StartMedium] {
        &self.light_media
    }

    /// By object: diagonal of the box around it, scene units.
    pub fn extents(&self) -> &[f32] {
        &self.extents
    }

    /// The lights among which each point chooses.
    pub fn selectors(&self) -> &Selectors {
        &self.selectors
    }

    /// Whether all lights are sampled, so that none is left for rays alone to find.
    pub fn lights_are_all_sampled(&self) -> bool {
        self.aimed_at.is_none()
    }

    /// The same for points whose scattered rays go on and may find some lights well enough to need no light sampling.
    pub fn aimed_at(&self) -> &Selectors {
        self.aimed_at.as_ref().unwrap_or(&self.selectors)
    }

    /// The lights in the form that the choice needs.
    pub fn light_sources(&self) -> &LightSources {
        &self.light_sources
    }

    /// By light: the object that shadow rays to it ignore, because it cannot shadow itself.
    pub fn unshadowing(&self) -> &[Option<u32>] {
        &self.unshadowing
    }

    /// Whether shadow rays must inspect what they meet.
    pub fn shadow_rays_walk(&self) -> bool {
        self.shadow_rays_walk
    }

    /// The ray acceleration structures.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Whether an object bounds the kernels around it: nothing ever passes it.
    pub fn is_wall(&self, object: u32) -> bool {
        self.walls.has(object)
    }

    /// The lowest and highest corner of the scene's bounding box.
    pub fn hull(&self) -> [Vec3; 2] {
        self.hull
    }

    /// Whether camera paths seem never to leave that box.
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// The lowest and highest corner of an object's bounding box.
    pub fn box_of(&self, object: u32) -> [Vec3; 2] {
        let (low, high) = self.boxes[object as usize];
        [low, high]
    }

    pub(crate) fn objects(&self) -> &[Object] {
        &self.description.objects
    }
    pub(crate) fn lights(&self) -> &[Light] {
        &self.description.lights
    }
    pub(crate) fn media(&self) -> &[Medium] {
        &self.description.media
    }
    pub(crate) fn bounds(&self) -> &SceneBounds {
        &self.description.bounds
    }
    /// The material at a hit.
    pub fn material(&self, hit: &SurfaceHit) -> &Material {
        &self.description.materials[hit.material as usize]
    }
    /// An object's material.
    pub(crate) fn material_of(&self, object: u32) -> &Material {
        &self.description.materials[self.objects()[object as usize].material as usize]
    }
    /// Whether an object is at most the boundary of a medium.
    pub(crate) fn is_null(&self, object: u32) -> bool {
        self.material_of(object).is_null()
    }
    /// Whether the medium is the same on both sides of an object.
    pub(crate) fn bounds_nothing(&self, object: u32) -> bool {
        let boundary = self.objects()[object as usize].boundary;
        boundary.is_none_or(|b| b.interior == b.exterior)
    }
    /// Whether all light in a medium entered through diffuse surfaces, so that no light can be sampled inside.
    #[inline]
    pub(crate) fn is_enclosed(&self, medium: u16) -> bool {
        self.is_enclosed[usize::from(medium)]
    }
    /// Whether sampling this light accounts for all its direct light: rays may pass its surface without seeing it.
    pub fn only_sampled(&self, light: usize) -> bool {
        let object = self.lights()[light].kind.object();
        object.is_some_and(|object| self.passable[object as usize])
    }
    /// The same for paths that go on from where lights were sampled: they inspect pure lights, such as lamps, that they
    /// pass.
    pub fn only_sampled_by_paths(&self, light: usize) -> bool {
        let is_lamp = |object: u32| self.material_of(object).has(BsdfFlags::NULL);
        self.only_sampled(light) && !self.lights()[light].kind.object().is_some_and(is_lamp)
    }
    /// Distance by which to move a point on a light off its surface.
    pub(crate) fn clearance(&self, point: Vec3) -> f32 {
        clearance(point.abs().max_element() + self.bounds().radius)
    }

    /// Where a photon of a light starts, off the emitting surface; and the line along which it comes, if objects behind
    /// it may block it.
    #[inline]
    pub(crate) fn start_of(&self, light: usize, emission: &EmissionSample) -> (Vec3, Option<SoftLine>) {
        if let Some(ball) = self.lights()[light].soft_ball(self.objects()) {
            let line = ball.along(&Ray {
                origin: emission.origin,
                dir: emission.dir,
            });
            return (line.from_foot.at(line.dark(line.half_chord)), Some(line));
        }
        let origin = match emission.normal {
            Some(n) => emission.origin + n * self.clearance(emission.origin),
            None => emission.origin,
        };
        (origin, None)
    }

    /// Transmittance of a medium along a ray over a distance.
    #[inline]
    pub(crate) fn transmittance(&self, medium: MediumId, ray: &Ray, distance: f32, sampler: &mut Sampler) -> Rgb {
        match medium {
            Some(id) => self.media()[id as usize].transmittance(ray, distance, sampler),
            None => Rgb::ONE,
        }
    }

    /// Radiance emitted at a hit against the direction of its ray, which has come straight over `distance`.
    #[inline]
    pub fn emitted(&self, hit: &SurfaceHit, dir: Vec3, distance: f32) -> Rgb {
        let Some(light) = self.objects()[hit.object as usize].light else {
            return Rgb::ZERO;
        };
        let (light, cos) = (&self.lights()[light as usize], -hit.ng.dot(dir));
        match light.soft_ball(self.objects()) {
            Some(ball) if !ball.shines_to(cos, distance) => Rgb::ZERO,
            Some(_) | None => light.radiance_area(cos, &hit.at),
        }
    }

    /// The environment lights, and where the direction `dir` is in each.
    #[inline]
    pub(crate) fn each_environment(&self, dir: Vec3, mut with: impl FnMut(usize, &Environment, &ImagePoint)) {
        let mut last: Option<(&Environment, ImagePoint)> = None;
        for &light in &self.environments {
            if let LightKind::Environment(environment) = &self.lights()[light].kind {
                // Environments split from one image share their mapping.
                let place = match last {
                    Some((other, place)) if environment.has_places_of(other) => place,
                    _ => environment.place(dir),
                };
                last = Some((environment, place));
                with(light, environment, &place);
            }
        }
    }

    /// Radiance of one environment light from the direction `dir`.
    pub fn environment(&self, light: usize, dir: Vec3) -> Rgb {
        match &self.lights()[light].kind {
            LightKind::Environment(environment) => environment.radiance(dir),
            LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            | LightKind::Area { .. }
            | LightKind::Volume(_) => Rgb::ZERO,
        }
    }
}
