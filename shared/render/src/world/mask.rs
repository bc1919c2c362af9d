//! Visibility masks: what rays of each type see. Tracers are compiled once for scenes without rules and once for scenes
//! with rules ([`crate::world::rules`]).

use crate::world::light::LightSelector;
use crate::world::rules::{HiddenSet, Rules};
use crate::world::{Scene, Selectors};

/// Origin and type of a ray.
#[derive(Clone, Copy, Debug)]
pub enum Start {
    /// At the camera.
    Camera,
    /// Reflected by an object.
    Reflected(u32),
    /// Refracted by an object.
    Refracted(u32),
    /// From an object to a light: what the object's shadow rays do not see.
    Shadow(u32),
    /// From any object to a light: what shadow rays to that light do not see.
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

/// Which objects and lights a ray sees, by its type and origin. Tracers are compiled once for scenes without rules,
/// where all of this vanishes, and once for scenes with rules.
pub trait VisibilityMask: Copy + Send + Sync {
    /// A set of hidden objects and lights.
    type Hidden: Copy + Send + Sync;
    /// Whether there are rules.
    const RULED: bool;
    /// The set hidden from a ray.
    fn from(self, start: Start) -> Self::Hidden;
    /// Whether rays pass through an object.
    fn hides(self, hidden: Self::Hidden, object: u32) -> bool;
    /// Whether a light is hidden.
    fn hides_light(self, hidden: Self::Hidden, light: usize) -> bool;
    /// Whether shadow rays to a light obey the light's own rules.
    fn links_shadows(self, light: usize) -> bool;
    /// A light's kind; rules treat all lights of a kind alike.
    fn light_kind(self, light: usize) -> u8;
    /// Whether lights of a kind are hidden.
    fn hides_kind(self, hidden: Self::Hidden, kind: u8) -> bool;
    /// Whether photons straight from a light are not stored in a medium.
    fn unlit(self, medium: u16, light: usize) -> bool;
    /// Whether gather rays find the light that an object scatters.
    fn is_gathered(self, object: u32) -> bool;
    /// Whether gather rays from an object look for light from other surfaces.
    fn gathers(self, object: u32) -> bool;
    /// Whether an object's gather rays pass the same objects as its shadow rays.
    fn one_ray(self, object: u32) -> bool;
    /// Whether an object has gloss whose gather rays count as reflected or refracted.
    fn is_glossy(self, object: u32) -> bool;
    /// The lights that may illuminate an object.
    fn selector(self, of: &Selectors, object: u32) -> &LightSelector;
    /// The lights whose photons may be stored anywhere.
    fn emitters(self, of: &Selectors) -> &LightSelector;

    /// Whether rays pass through an area light, so that none meets it by chance.
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

/// Rays see what the rules allow.
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
