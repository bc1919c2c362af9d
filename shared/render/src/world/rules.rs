//! Object visibility rules: which objects a ray passes through as if they were absent, and which lights it does not
//! see.
//!
//! A rule concerns the rays of one type that start at one object, light or the camera. The straight piece of a light
//! path between two scattering events is one ray, whichever end it is found from, through boundaries of media and
//! objects passed by chance:
//!
//! | piece of a light path, in the notation of `transport`           | type                      | starts at           |
//! | --------------------------------------------------------------- | ------------------------- | ------------------- |
//! | up to E                                                         | camera                    | the camera          |
//! | up to S, when the path goes on to E over such surfaces only     | reflected or refracted    | S                   |
//! | L x, x being the first other surface from E                     | shadow                    | x                   |
//! | all others: what photons bring                                  | photon                    | where light comes from |
//!
//! S is specular, or a lobe of low roughness that camera paths follow. Reflected and refracted rules decide what a
//! rough S shows of the region between it and a light; but a light excluded by its shadow rules does not illuminate it.
//!
//! A shadow rule may name a light as the start: it then concerns the shadow rays to that light, wherever they start.
//! Such a light is sampled only, as a ray that may meet several lights cannot obey the rules of each.
//!
//! So shadow rules alone govern direct light, and photon rules alone govern what photons bring. Gather rays too obey
//! the photon rules of the surfaces that they find, but a gather ray knows those only on arrival. So it passes the
//! objects that the photons of most surfaces pass (`gather`), and finds the light of surfaces whose photons pass
//! exactly those; the light of all others is left to photons. Weights still sum to one.
//!
//! Gloss (rough metal, rough glass, and the specular lobe of rough coats and principled surfaces) with its own
//! reflected or refracted rules finds the light of other surfaces by gather rays alone, which then obey those rules.
//! The diffuse lobe beneath it is treated separately.
//!
//! Photons that start in a medium belong to the object that the medium fills, or to the world. Passing through a hidden
//! object changes no medium.

/// Types of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RayType {
    /// From the camera.
    Camera,
    /// Seen in a mirror or on glass.
    Reflected,
    /// Seen through glass.
    Refracted,
    /// From a surface to a light.
    Shadow,
    /// From a light, a surface or a medium, with the light that it emits or scatters.
    Photon,
}

impl RayType {
    /// All types.
    pub const ALL: [Self; 5] = [
        Self::Camera,
        Self::Reflected,
        Self::Refracted,
        Self::Shadow,
        Self::Photon,
    ];
}

/// A set of hidden objects and lights: a row of bits, one per class that rules treat alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HiddenSet {
    /// Offset of the row; 0 for the empty set.
    pub row: u32,
    /// The row's first word, which is all that most scenes need.
    pub first: u32,
}

/// Resolved rules, at least one of which has an effect.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// By object, then by light: its class.
    pub class: Vec<u32>,
    /// Offset of the lights in `class`.
    pub objects: usize,
    /// The rows of all sets.
    pub rows: Vec<u32>,
    /// For rays from the camera.
    pub camera: HiddenSet,
    /// By object.
    pub of_object: Vec<ObjectSets>,
    /// By light, for its photons.
    pub of_light: Vec<HiddenSet>,
    /// By light, for shadow rays to it, in addition to what is hidden where they start.
    pub shadow_of_light: Vec<HiddenSet>,
    /// By medium, for photons scattered there; also the lights whose photons are not stored there.
    pub of_medium: Vec<HiddenSet>,
    /// By medium and light: no light comes there straight from the light.
    pub unlit: Vec<bool>,
    /// For gather rays; where paths obey, also the lights that emit no photons.
    pub gather: HiddenSet,
    /// By light: its kind, below [`MANY_KINDS`]; and by kind, the class.
    pub light_kinds: (Vec<u8>, Vec<u32>),
    /// Number of rules, for `explain`.
    pub rules: usize,
    /// Some rule changes where photons go or are stored.
    pub touches_photons: bool,
    /// Photons see the same objects wherever they come from, namely those that gather rays see, so that camera paths
    /// can follow them.
    pub paths_obey: bool,
}

/// Number of light kinds that surface photons can distinguish. With more, gather rays do not look for light from other
/// surfaces if they start where some light's photons are not stored.
pub const MANY_KINDS: usize = 256;

/// What the rays that start at an object do not see.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObjectSets {
    /// For rays that it reflects.
    pub reflected: HiddenSet,
    /// For rays that it refracts.
    pub refracted: HiddenSet,
    /// For shadow rays.
    pub shadow: HiddenSet,
    /// For photons.
    pub photon: HiddenSet,
    /// Gather rays find the light that it scatters.
    pub is_gathered: bool,
    /// Gather rays from it look for light from other surfaces.
    pub gathers: bool,
    /// Its gather rays pass the same objects as its shadow rays.
    pub one_ray: bool,
    /// It has gloss whose gather rays obey `reflected` and `refracted`.
    pub is_glossy: bool,
}

impl ObjectSets {
    /// The set hidden in its reflections, or through it.
    pub fn seen(&self, transmitted: bool) -> HiddenSet {
        match transmitted {
            true => self.refracted,
            false => self.reflected,
        }
    }

    /// Whether rules affect the direct light that reaches it.
    pub fn decides_direct_light(&self) -> bool {
        self.shadow != HiddenSet::default() || self.is_glossy
    }
}

impl Rules {
    #[inline]
    fn holds(&self, set: HiddenSet, thing: usize) -> bool {
        self.holds_class(set, self.class[thing])
    }

    /// Whether a class is hidden.
    #[inline]
    pub fn holds_class(&self, set: HiddenSet, class: u32) -> bool {
        let word = match class {
            0..32 => set.first,
            _ => self.rows[set.row as usize + (class >> 5) as usize],
        };
        word >> (class & 31) & 1 == 1
    }

    /// Whether rays pass through an object.
    #[inline]
    pub fn hides(&self, set: HiddenSet, object: u32) -> bool {
        self.holds(set, object as usize)
    }

    /// Whether a light is hidden.
    #[inline]
    pub fn hides_light(&self, set: HiddenSet, light: usize) -> bool {
        self.holds(set, self.objects + light)
    }

    /// Whether shadow rays to a light obey the light's own rules.
    #[inline]
    pub fn links_shadows(&self, light: usize) -> bool {
        self.shadow_of_light[light] != HiddenSet::default()
    }

    /// Whether all rays see a light.
    pub fn all_see_light(&self, light: usize) -> bool {
        let of_objects = self.of_object.iter().flat_map(|sets| {
            let ObjectSets {
                reflected,
                refracted,
                shadow,
                photon,
                ..
            } = *sets;
            [reflected, refracted, shadow, photon]
        });
        let mut sets = of_objects.chain([self.camera, self.gather]);
        let lights = self.of_light.len();
        !self.links_shadows(light)
            && !sets.any(|set| self.hides_light(set, light))
            && !self.unlit.iter().skip(light).step_by(lights).any(|unlit| *unlit)
    }

    /// Whether no photon passes through an object.
    pub fn all_photons_see(&self, object: u32) -> bool {
        let sets = (self.of_object.iter().map(|sets| sets.photon))
            .chain(self.of_light.iter().copied())
            .chain(self.of_medium.iter().copied());
        !sets.chain([self.gather]).any(|set| self.hides(set, object))
    }

    /// Bytes of the resolved sets.
    pub fn bytes(&self) -> usize {
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
