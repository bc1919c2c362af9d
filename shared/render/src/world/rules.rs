//! Object visibility rules: which objects a ray passes through as if they were not there, and which lights it does not
//! see.
//!
//! A rule speaks of the rays of one type that start at one thing. The straight piece of a light path between two
//! scatterings is one ray, whichever end it is found from, through boundaries of media and whatever is passed by
//! chance:
//!
//! | piece of a light path, in the notation of `transport`           | type                      | starts at           |
//! | --------------------------------------------------------------- | ------------------------- | ------------------- |
//! | up to E                                                         | camera                    | the camera          |
//! | up to S, when the path goes on to E over such surfaces only     | reflected or refracted    | S                   |
//! | L x, x being the first other surface from E                     | shadow                    | x                   |
//! | all others: what photons bring                                  | photon                    | where light comes from |
//!
//! S is specular, or a lobe of low roughness that camera paths follow. What lies between a light and a rough S is seen
//! in it, or not, by its reflected and refracted rules; but a light that its shadow rules exclude does not light it.
//!
//! A shadow rule that names a light among what rays start at speaks of the shadow rays to that light, wherever they
//! start. Such light is sampled only: a ray that may meet several lights cannot obey the rules of each.
//!
//! So direct light is found by shadow rules alone, and what photons bring by photon rules alone: gather rays, too, obey
//! the photon rules of the surfaces that they find. A gather ray knows those only when it is there. So it passes what
//! the photons of most surfaces pass (`gather`), and finds the light of surfaces whose photons pass just that; the
//! light of all others is left to photons. Weights still sum to one.
//!
//! Gloss (rough metal, rough glass, and the specular lobe of rough coats and principled surfaces) with reflected or
//! refracted rules of its own finds the light of other surfaces by gather rays alone, which then obey those rules. The
//! diffuse lobe beneath it is looked at apart.
//!
//! What photons start in a medium belongs to the object that the medium fills, or to the world. An object that is
//! passed through changes no medium.

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
    pub row: u32,
    /// Its first word, which is all that most scenes have.
    pub first: u32,
}

/// Rules, resolved. At least one of them has an effect.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// By object, then by light: its class.
    pub class: Vec<u32>,
    /// Where the lights begin in `class`.
    pub objects: usize,
    /// The rows of all sets.
    pub rows: Vec<u32>,
    /// For rays from the camera.
    pub camera: HiddenSet,
    /// By object.
    pub of_object: Vec<ObjectSets>,
    /// By light, for its photons.
    pub of_light: Vec<HiddenSet>,
    /// By light, for shadow rays to it, beside what those do not see where they start.
    pub shadow_of_light: Vec<HiddenSet>,
    /// By medium, for photons scattered there; also the lights whose photons leave nothing there.
    pub of_medium: Vec<HiddenSet>,
    /// By medium and light: nothing comes there straight from the light.
    pub unlit: Vec<bool>,
    /// What gather rays pass; where paths obey, also the lights that no photon comes from.
    pub gather: HiddenSet,
    /// By light: its kind, below [`MANY_KINDS`]; and by kind, the class.
    pub light_kinds: (Vec<u8>, Vec<u32>),
    /// Number of rules, for `explain`.
    pub rules: usize,
    /// Some rule changes where photons go or what they leave.
    pub touches_photons: bool,
    /// Photons see the same wherever they come from, what gather rays pass: camera paths can go on as photons came.
    pub paths_obey: bool,
}

/// Surface photons know so many kinds of lights that rules tell apart. With more, gather rays from surfaces that some
/// light's photons leave nothing on look for no light of other surfaces.
pub const MANY_KINDS: usize = 256;

/// What the rays that start at an object do not see.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObjectSets {
    /// Those that it reflects.
    pub reflected: HiddenSet,
    /// Those that it refracts.
    pub refracted: HiddenSet,
    /// Those to lights.
    pub shadow: HiddenSet,
    /// Photons.
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
    pub fn seen(&self, transmitted: bool) -> HiddenSet {
        match transmitted {
            true => self.refracted,
            false => self.reflected,
        }
    }

    /// Whether rules have a say in the light that comes to it straight from lights.
    pub fn decides_direct_light(&self) -> bool {
        self.shadow != HiddenSet::default() || self.is_glossy
    }
}

impl Rules {
    #[inline]
    fn holds(&self, set: HiddenSet, thing: usize) -> bool {
        self.holds_class(set, self.class[thing])
    }

    /// Whether things of a class are passed through, or not seen.
    #[inline]
    pub fn holds_class(&self, set: HiddenSet, class: u32) -> bool {
        let word = match class {
            0..32 => set.first,
            _ => self.rows[set.row as usize + (class >> 5) as usize],
        };
        word >> (class & 31) & 1 == 1
    }

    /// Whether an object is passed through.
    #[inline]
    pub fn hides(&self, set: HiddenSet, object: u32) -> bool {
        self.holds(set, object as usize)
    }

    /// Whether a light is one that is not seen.
    #[inline]
    pub fn hides_light(&self, set: HiddenSet, light: usize) -> bool {
        self.holds(set, self.objects + light)
    }

    /// Whether shadow rays to a light obey rules of its own.
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
