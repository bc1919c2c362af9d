//! Visibility masks: what rays of each type see. Tracers are compiled once for scenes without rules and once for scenes
//! with them ([`crate::world::rules`]).

use crate::world::light::LightSelector;
use crate::world::rules::{HiddenSet, Rules};
use crate::world::{Scene, Selectors};

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

/// Which objects and lights a ray sees, by its type and where it starts. Tracers are compiled once for scenes without
/// rules, where nothing of this is left, and once for scenes with rules.
pub trait VisibilityMask: Copy + Send + Sync {
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
    fn selector(self, of: &Selectors, object: u32) -> &LightSelector;
    /// The lights whose photons may leave something.
    fn emitters(self, of: &Selectors) -> &LightSelector;

    /// Whether an area light is passed through: no ray meets it by chance.
    #[inline]
    fn hides_shape_of(self, scene: &Scene, hidden: Self::Hidden, light: usize) -> bool {
        let object = scene.lights()[light].kind.object();
        Self::RULED && object.is_some_and(|object| self.hides(hidden, object))
    }
}

/// Every ray sees everything.
#[derive(Clone, Copy, Debug)]
pub struct Unruled;

impl VisibilityMask for Unruled {
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
    fn selector(self, of: &Selectors, _: u32) -> &LightSelector {
        &of.all
    }
    #[inline(always)]
    fn emitters(self, of: &Selectors) -> &LightSelector {
        &of.all
    }
}

/// Rays see what rules leave them.
#[derive(Clone, Copy, Debug)]
pub struct Ruled<'a>(pub &'a Rules);

impl VisibilityMask for Ruled<'_> {
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
    fn selector(self, of: &Selectors, object: u32) -> &LightSelector {
        let shadow = self.0.of_object[object as usize].shadow;
        of.seen.get(&shadow.row).unwrap_or(&of.all)
    }
    #[inline]
    fn emitters(self, of: &Selectors) -> &LightSelector {
        of.emitters.as_ref().unwrap_or(&of.all)
    }
}
