//! Object visibility rules: which objects a ray passes through as if they were not there, and which lights it does not see.
//!
//! A rule speaks of the rays of one type that start at one thing. The straight piece of a light path between two
//! scatterings is one ray, whichever end it is found from, through boundaries of media and whatever is passed by chance:
//!
//! | piece of a light path, in the notation of `transport`           | type                      | starts at           |
//! | --------------------------------------------------------------- | ------------------------- | ------------------- |
//! | up to E                                                         | camera                    | the camera          |
//! | up to S, when the path goes on to E over such surfaces only     | reflected or refracted    | S                   |
//! | L x, x being the first other surface from E                     | shadow                    | x                   |
//! | all others: what photons bring                                  | photon                    | where light comes from |
//!
//! S is specular, or a lobe of low roughness that camera paths follow. What lies between a light and a rough S is seen in it, or not, by
//! its reflected and refracted rules; but a light that its shadow rules exclude does not light it.
//!
//! A shadow rule that names a light among what rays start at speaks of the shadow rays to that light, wherever they start.
//! Such light is sampled only: a ray that may meet several lights cannot obey the rules of each.
//!
//! So direct light is found by shadow rules alone, and what photons bring by photon rules alone: gather rays, too, obey
//! the photon rules of the surfaces that they find. A gather ray knows those only when it is there. So it passes what the
//! photons of most surfaces pass (`gather`), and finds the light of surfaces whose photons pass just that; the light of all
//! others is left to photons. Weights still sum to one.
//!
//! Gloss (rough metal, rough glass, and the specular lobe of rough coats and principled surfaces) with reflected or
//! refracted rules of its own finds the light of other surfaces by gather rays alone, which then obey those rules. The
//! diffuse lobe beneath it is looked at apart.
//!
//! What photons start in a medium belongs to the object that the medium fills, or to the world. An object that is passed
//! through changes no medium.

use crate::light::{LightKind, LightSelector};
use crate::medium::MediumId;
use crate::plan::Scene;
use schemars::JsonSchema;
use serde::Deserialize;

/// Types of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RayType {
    /// From the camera.
    Camera,
    /// Seen in a mirror or on glass.
    Reflected,
    /// Seen through glass.
    Refracted,
    /// From a surface to a light.
    Shadow,
    /// From a light, a surface or a medium, with the light that it sends on.
    Photon,
}

impl RayType {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Camera,
        Self::Reflected,
        Self::Refracted,
        Self::Shadow,
        Self::Photon,
    ];
}

/// What a ray does not see: a row of bits, one for each class of objects and lights that rules do not tell apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HiddenSet {
    /// Where the row begins; 0 for nothing.
    pub(crate) row: u32,
    /// Its first word, which is all that most scenes have.
    pub(crate) first: u32,
}

/// Rules, resolved. At least one of them has an effect.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// By object, then by light: its class.
    pub(crate) class: Vec<u32>,
    /// Where the lights begin in `class`.
    pub(crate) objects: usize,
    /// The rows of all sets.
    pub(crate) rows: Vec<u32>,
    /// For rays from the camera.
    pub(crate) camera: HiddenSet,
    /// By object.
    pub(crate) of_object: Vec<ObjectSets>,
    /// By light, for its photons.
    pub(crate) of_light: Vec<HiddenSet>,
    /// By light, for shadow rays to it, beside what those do not see where they start.
    pub(crate) shadow_of_light: Vec<HiddenSet>,
    /// By medium, for photons scattered there; also the lights whose photons leave nothing there.
    pub(crate) of_medium: Vec<HiddenSet>,
    /// By medium and light: nothing comes there straight from the light.
    pub(crate) unlit: Vec<bool>,
    /// What gather rays pass; where paths obey, also the lights that no photon comes from.
    pub(crate) gather: HiddenSet,
    /// By light: its kind, below [`MANY_KINDS`]; and by kind, the class.
    pub(crate) light_kinds: (Vec<u8>, Vec<u32>),
    /// Number of rules, for `explain`.
    pub(crate) rules: usize,
    /// Some rule changes where photons go or what they leave.
    pub touches_photons: bool,
    /// Photons see the same wherever they come from, what gather rays pass: camera paths can go on as photons came.
    pub(crate) paths_obey: bool,
    /// Which rules those may be: where their lists are in the scene file.
    pub(crate) photon_places: Vec<std::ops::Range<usize>>,
}

/// Surface photons know so many kinds of lights that rules tell apart. With more, gather rays from surfaces that some
/// light's photons leave nothing on look for no light of other surfaces.
pub(crate) const MANY_KINDS: usize = 256;

/// What the rays that start at an object do not see.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ObjectSets {
    pub reflected: HiddenSet,
    pub refracted: HiddenSet,
    pub shadow: HiddenSet,
    pub photon: HiddenSet,
    /// Gather rays find the light that it sends on.
    pub is_gathered: bool,
    /// Gather rays from it look for light of other surfaces.
    pub gathers: bool,
    /// Its gather rays pass what its shadow rays pass.
    pub one_ray: bool,
    /// It has gloss whose gather rays obey `reflected` and `refracted`.
    pub is_glossy: bool,
}

impl ObjectSets {
    /// What is not seen in it, or through it.
    pub(crate) fn seen(&self, transmitted: bool) -> HiddenSet {
        match transmitted {
            true => self.refracted,
            false => self.reflected,
        }
    }

    /// Whether rules have a say in the light that comes to it straight from lights.
    pub(crate) fn decides_direct_light(&self) -> bool {
        self.shadow != HiddenSet::default() || self.is_glossy
    }
}

impl Rules {
    #[inline]
    fn holds(&self, set: HiddenSet, thing: usize) -> bool {
        self.holds_class(set, self.class[thing])
    }

    #[inline]
    fn holds_class(&self, set: HiddenSet, class: u32) -> bool {
        let word = match class {
            0..32 => set.first,
            _ => self.rows[set.row as usize + (class >> 5) as usize],
        };
        word >> (class & 31) & 1 == 1
    }

    /// Whether an object is passed through.
    #[inline]
    pub(crate) fn hides(&self, set: HiddenSet, object: u32) -> bool {
        self.holds(set, object as usize)
    }

    /// Whether a light is one that is not seen.
    #[inline]
    pub(crate) fn hides_light(&self, set: HiddenSet, light: usize) -> bool {
        self.holds(set, self.objects + light)
    }

    /// Whether shadow rays to a light obey rules of its own.
    #[inline]
    pub(crate) fn links_shadows(&self, light: usize) -> bool {
        self.shadow_of_light[light] != HiddenSet::default()
    }

    /// Bytes of the resolved sets.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.class)
            + size_of_val(&*self.rows)
            + size_of_val(&*self.of_object)
            + size_of_val(&*self.of_light)
            + size_of_val(&*self.shadow_of_light)
            + size_of_val(&*self.of_medium)
            + size_of_val(&*self.unlit)
            + size_of_val(&*self.light_kinds.0)
            + size_of_val(&*self.light_kinds.1)
    }
}

/// Where a ray starts, and as which type.
#[derive(Clone, Copy, Debug)]
pub enum Start {
    /// At the camera.
    Camera,
    /// Reflected by an object.
    Reflected(u32),
    /// Refracted by an object.
    Refracted(u32),
    /// From an object to a light: what the object's rays do not see.
    Shadow(u32),
    /// From any object to a light: what the light's rays do not see.
    ShadowOf(usize),
    /// A photon from an object.
    Photon(u32),
    /// A photon from a light.
    Light(usize),
    /// A photon scattered in a medium.
    Medium(u16),
    /// A gather ray.
    Gather,
}

/// What rays see. Tracers are compiled once for scenes without rules, where nothing of this is left, and once for
/// scenes with rules.
pub trait Sight: Copy + Send + Sync {
    /// What a ray does not see.
    type Hidden: Copy + Send + Sync;
    /// Whether there are rules.
    const RULED: bool;
    /// What a ray does not see.
    fn from(self, start: Start) -> Self::Hidden;
    /// Whether an object is passed through.
    fn hides(self, hidden: Self::Hidden, object: u32) -> bool;
    /// Whether a light is not seen.
    fn hides_light(self, hidden: Self::Hidden, light: usize) -> bool;
    /// Whether shadow rays to a light obey rules of its own.
    fn links_shadows(self, light: usize) -> bool;
    /// The kind of a light: of those that rules do not tell apart.
    fn light_kind(self, light: usize) -> u8;
    /// Whether lights of a kind are not seen.
    fn hides_kind(self, hidden: Self::Hidden, kind: u8) -> bool;
    /// Whether photons that come straight from a light leave nothing in a medium.
    fn unlit(self, medium: u16, light: usize) -> bool;
    /// Whether gather rays find the light that an object sends on.
    fn is_gathered(self, object: u32) -> bool;
    /// Whether gather rays from an object look for light of other surfaces.
    fn gathers(self, object: u32) -> bool;
    /// Whether an object's gather rays pass what its shadow rays pass.
    fn one_ray(self, object: u32) -> bool;
    /// Whether an object has gloss whose gather rays are reflected or refracted ones.
    fn is_glossy(self, object: u32) -> bool;
    /// The lights that an object is lit by.
    fn selector(self, scene: &Scene, object: u32) -> &LightSelector;
    /// The lights whose photons may leave something.
    fn emitters(self, scene: &Scene) -> &LightSelector;

    /// Whether an area light is passed through: no ray meets it by chance.
    #[inline]
    fn hides_shape_of(self, scene: &Scene, hidden: Self::Hidden, light: usize) -> bool {
        Self::RULED
            && match scene.lights()[light].kind {
                LightKind::Area { object, .. } => self.hides(hidden, object),
                _ => false,
            }
    }
}

/// Every ray sees everything.
#[derive(Clone, Copy, Debug)]
pub struct Unruled;

impl Sight for Unruled {
    type Hidden = ();
    const RULED: bool = false;
    #[inline(always)]
    fn from(self, _: Start) {}
    #[inline(always)]
    fn hides(self, (): (), _: u32) -> bool {
        false
    }
    #[inline(always)]
    fn hides_light(self, (): (), _: usize) -> bool {
        false
    }
    #[inline(always)]
    fn links_shadows(self, _: usize) -> bool {
        false
    }
    #[inline(always)]
    fn light_kind(self, _: usize) -> u8 {
        0
    }
    #[inline(always)]
    fn hides_kind(self, (): (), _: u8) -> bool {
        false
    }
    #[inline(always)]
    fn unlit(self, _: u16, _: usize) -> bool {
        false
    }
    #[inline(always)]
    fn is_gathered(self, _: u32) -> bool {
        true
    }
    #[inline(always)]
    fn gathers(self, _: u32) -> bool {
        true
    }
    #[inline(always)]
    fn one_ray(self, _: u32) -> bool {
        true
    }
    #[inline(always)]
    fn is_glossy(self, _: u32) -> bool {
        false
    }
    #[inline(always)]
    fn selector(self, scene: &Scene, _: u32) -> &LightSelector {
        &scene.selector
    }
    #[inline(always)]
    fn emitters(self, scene: &Scene) -> &LightSelector {
        &scene.selector
    }
}

/// Rays see what rules leave them.
#[derive(Clone, Copy, Debug)]
pub struct Ruled<'a>(pub &'a Rules);

impl Sight for Ruled<'_> {
    type Hidden = HiddenSet;
    const RULED: bool = true;
    #[inline]
    fn from(self, start: Start) -> HiddenSet {
        let of = |object: u32| &self.0.of_object[object as usize];
        match start {
            Start::Camera => self.0.camera,
            Start::Reflected(object) => of(object).reflected,
            Start::Refracted(object) => of(object).refracted,
            Start::Shadow(object) => of(object).shadow,
            Start::ShadowOf(light) => self.0.shadow_of_light[light],
            Start::Photon(object) => of(object).photon,
            Start::Light(light) => self.0.of_light[light],
            Start::Medium(medium) => self.0.of_medium[usize::from(medium)],
            Start::Gather => self.0.gather,
        }
    }
    #[inline]
    fn hides(self, hidden: HiddenSet, object: u32) -> bool {
        self.0.hides(hidden, object)
    }
    #[inline]
    fn hides_light(self, hidden: HiddenSet, light: usize) -> bool {
        self.0.hides_light(hidden, light)
    }
    #[inline]
    fn links_shadows(self, light: usize) -> bool {
        self.0.links_shadows(light)
    }
    #[inline]
    fn light_kind(self, light: usize) -> u8 {
        self.0.light_kinds.0[light]
    }
    #[inline]
    fn hides_kind(self, hidden: HiddenSet, kind: u8) -> bool {
        match self.0.light_kinds.1.get(usize::from(kind)) {
            Some(class) => self.0.holds_class(hidden, *class),
            None => false,
        }
    }
    #[inline]
    fn unlit(self, medium: u16, light: usize) -> bool {
        self.0.unlit[usize::from(medium) * self.0.of_light.len() + light]
    }
    #[inline]
    fn is_gathered(self, object: u32) -> bool {
        self.0.of_object[object as usize].is_gathered
    }
    #[inline]
    fn gathers(self, object: u32) -> bool {
        self.0.of_object[object as usize].gathers
    }
    #[inline]
    fn one_ray(self, object: u32) -> bool {
        self.0.of_object[object as usize].one_ray
    }
    #[inline]
    fn is_glossy(self, object: u32) -> bool {
        self.0.of_object[object as usize].is_glossy
    }
    #[inline]
    fn selector(self, scene: &Scene, object: u32) -> &LightSelector {
        let shadow = self.0.of_object[object as usize].shadow;
        scene.selectors.get(&shadow.row).unwrap_or(&scene.selector)
    }
    #[inline]
    fn emitters(self, scene: &Scene) -> &LightSelector {
        scene.emitters.as_ref().unwrap_or(&scene.selector)
    }
}

impl Scene {
    /// The medium that is left of `medium_at` when some objects are not seen.
    pub(crate) fn medium_seen(
        &self,
        point: crate::math::Vec3,
        hidden: Option<HiddenSet>,
    ) -> MediumId {
        match (&self.description().rules, hidden) {
            (Some(rules), Some(set)) => {
                self.medium_without(point, |object| rules.hides(set, object))
            }
            _ => self.medium_at(point),
        }
    }
}
