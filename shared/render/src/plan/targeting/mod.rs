//! Photon targeting: sends photons where the camera needs them.
//!
//! Before the passes, camera paths look for places from which they see light (`pilot`). Photons are aimed at discs
//! around these places (`discs`; Autodesk, US 8,773,434). Emission stays unbiased: a share of the photons starts as the
//! light emits them, and each is weighted by the density of the mixture of both. This is a pure function of the scene
//! and the job's seed, so every machine has the same targets.
//!
//! Places that the discs do not know of decide whether a light's photons are aimed, and which share is not. For each
//! path of light found there, rho, the mixture's density over that of plain emission, says how much a photon on it
//! weighs. The mean of 1 / rho is the second moment of those weights, 1 for plain emission. The share with the least
//! second moment is taken.
//!
//! Among many lights, those of which more is found start more photons (`choice`).

mod aimed;
mod choice;
mod discs;
mod pilot;

pub use aimed::own_directions;
pub(crate) use discs::Drawn;
pub use discs::{Disc, Discs, WIDE};

use crate::math::{Ray, Vec3};
use crate::plan::estimators::Estimators;
use crate::sampler::{Purpose, Sampler};
use crate::world::Scene;
use crate::world::light::{EmissionUniforms, Light, LightSelector, MANY_LIGHTS};
use crate::world::mask::{Ruled, Start, Unruled, VisibilityMask};
use beamfarm_image::job::Targeting;
use choice::Found;

/// A place from which a camera path saw a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewpoint {
    /// Where.
    pub point: Vec3,
    /// Unit direction to the light.
    pub towards: Vec3,
    /// Distance of the light, if it has a position.
    pub distance: f32,
    /// Normal of the light where it was seen.
    pub normal: Vec3,
    /// Roughly how much of the light comes by here.
    pub weight: f32,
    /// Found by an odd camera path.
    pub odd: bool,
}

/// The targets of a scene.
#[derive(Debug)]
pub struct Targets {
    /// By light.
    lights: Vec<Option<Aim>>,
    /// How many photons each light gets, if not by power.
    chosen: Option<LightSelector>,
    /// Photons that miss are dropped.
    rejects: bool,
    /// Camera paths hardly ever see a light.
    seldom: bool,
}

/// A light's targets.
#[derive(Debug)]
pub struct Aim {
    /// Share of photons that start as the light emits them.
    pub plain: f32,
    /// What the other photons are aimed at.
    pub discs: Discs,
    /// How many plain photons one photon is worth, averaged over places that the discs do not know of.
    pub(crate) gain: f32,
    /// Mean number of discs to look at for the density of a photon's start.
    pub(crate) work: f32,
    /// If photons that miss are dropped: photons started for each path.
    pub(crate) trials: u32,
}

/// Fewest places from which a light is seen that make discs worthwhile.
const MIN_PLACES: usize = 32;
/// Without a request, photons are aimed only if one is worth this many plain ones. Aimed photons cost several times as
/// much, because they go on where others are lost.
pub(crate) const MIN_GAIN: f64 = 8.0;
/// The largest share of photons that may be aimed.
const MAX_AIMED: f64 = 0.9;
/// If light is found at less than this share of the places where it was looked for, camera paths alone would be slow to
/// find it.
const SELDOM: f64 = 0.05;
/// Photons that measure hit rates.
const PROBES: u64 = 2048;
/// Most photons started for each path.
const MAX_TRIALS: f32 = 64.0;
/// By light, the places from which it is seen; and at how many places lights were looked for.
type Seen = (Vec<Vec<Viewpoint>>, u64);

/// What the pilots of one scene found, by seed and estimators, on which alone it depends.
#[derive(Default)]
pub(crate) struct Places(Vec<(u64, Estimators, Seen)>);

impl Places {
    fn of(&mut self, seed: u64, estimators: &Estimators, trace: impl FnOnce() -> Seen) -> &Seen {
        let known = self.0.iter().position(|(of, by, _)| *of == seed && by == estimators);
        let at = known.unwrap_or_else(|| {
            self.0.push((seed, estimators.clone(), trace()));
            self.0.len() - 1
        });
        &self.0[at].2
    }
}

/// Most lights that [`Targets::prepare`] reports one by one.
const MAX_TOLD: usize = 4;

impl Targets {
    /// Look for targets of the lights that photons start from. Also returns what to report. Deterministic.
    pub(crate) fn prepare(
        scene: &Scene,
        chosen: (&Estimators, &LightSelector),
        seed: u64,
        mode: Targeting,
        places: &mut Places,
    ) -> (Option<Self>, String) {
        if mode == Targeting::Off {
            return (None, "off".into());
        }
        match &scene.description().rules {
            None => Self::seen((scene, chosen), seed, mode, Unruled, places),
            Some(rules) => Self::seen((scene, chosen), seed, mode, Ruled(rules), places),
        }
    }

    fn seen(
        (scene, (estimators, emitters)): (&Scene, (&Estimators, &LightSelector)),
        seed: u64,
        mode: Targeting,
        mask: impl VisibilityMask,
        places: &mut Places,
    ) -> (Option<Self>, String) {
        let trace = || pilot::trace((scene, estimators, emitters), mask, seed);
        let (kept, tries) = places.of(seed, estimators, trace);
        let tries = *tries;
        let places: usize = kept.iter().map(Vec::len).sum();
        let mut lights = Vec::with_capacity(kept.len());
        let mut found = Vec::with_capacity(kept.len());
        let (mut aimed, mut plain) = (Vec::new(), Vec::new());
        for (number, places) in kept.iter().enumerate() {
            if scene.is_interrupted() {
                return (None, "interrupted".into());
            }
            let power = f64::from(emitters.pmf(number));
            if power == 0.0 {
                lights.push(None);
                found.push(Found::default());
                continue;
            }
            let light = &scene.lights()[number];
            let (aim, gain) = Aim::new(scene, light, places, mode);
            let moment = match (&aim, gain) {
                (Some(_), Some(gain)) => 1.0 / gain,
                _ => 1.0,
            };
            found.push(Found::new(power, places, moment));
            let told = match (&aim, gain) {
                (_, None) => format!("\"{}\" is seen from too few places", light.name),
                (None, Some(gain)) => format!(
                    "\"{}\" gains too little by aiming: a photon would be worth {gain:.1}",
                    light.name
                ),
                (Some(aim), Some(gain)) => {
                    let rates = aim.hit_rates(scene, number, seed, mask);
                    format!(
                        "\"{}\" at {} discs, {} of its photons stay plain: {} of these hit, {} of the aimed ones; \
                         a photon is worth {gain:.1}",
                        light.name,
                        aim.discs.len(),
                        percent(aim.plain),
                        percent(rates[0]),
                        percent(rates[1]),
                    )
                }
            };
            let aim = aim.map(|mut aim| {
                if mode == Targeting::Reject {
                    let rate = aim.hit_rates(scene, number, seed, mask)[0];
                    aim.trials = (1.0 / rate).clamp(1.0, MAX_TRIALS) as u32;
                }
                aim
            });
            if aim.is_some() {
                aimed.push(told);
            } else {
                plain.push(told);
            }
            lights.push(aim);
        }
        let (chosen, on_choice) = choice::choose(scene, &found, mode);
        let is_aimed = !aimed.is_empty();
        let mut told = match is_aimed {
            true => listed(aimed, ""),
            false => listed(std::mem::take(&mut plain), "no light"),
        };
        if !plain.is_empty() {
            told = format!("{told}; not {}", listed(plain, ""));
        }
        if let Some(on_choice) = on_choice {
            told = format!("{told}; {on_choice}");
        }
        if !is_aimed && chosen.is_none() {
            return (None, told);
        }
        let rejects = is_aimed && mode == Targeting::Reject;
        if rejects {
            told = format!("BIASED, photons that miss are dropped: {told}");
        }
        let targets = Self {
            lights,
            chosen,
            rejects,
            seldom: (places as f64) < SELDOM * tries as f64,
        };
        (Some(targets), told)
    }

    /// Whether photons find the light on surfaces far better than camera paths that go from surface to surface.
    pub(crate) fn outdo_paths(&self, mode: Targeting) -> bool {
        let is_asked = matches!(mode, Targeting::On | Targeting::Reject);
        is_asked || self.seldom || self.chosen.is_some() && self.lights.len() > MANY_LIGHTS
    }

    /// The lights that photons start from, if not chosen by power.
    #[inline]
    pub fn emitters(&self) -> Option<&LightSelector> {
        self.chosen.as_ref()
    }

    /// The lights whose photons are aimed, by index, with their targets.
    pub fn aims(&self) -> impl Iterator<Item = (usize, &Aim)> {
        let lights = self.lights.iter().enumerate();
        lights.filter_map(|(number, aim)| Some((number, aim.as_ref()?)))
    }

    /// A light's targets, if its photons are aimed.
    #[inline]
    pub fn of(&self, light: usize) -> Option<&Aim> {
        self.lights[light].as_ref()
    }

    /// Discs to look at for a photon's start, averaged over all photons.
    pub(crate) fn work(&self, emitters: &LightSelector) -> f32 {
        let lights = self.lights.iter().enumerate();
        let of_light = |(number, aim): (usize, &Option<Aim>)| Some(emitters.pmf(number) * aim.as_ref()?.work);
        lights.filter_map(of_light).sum()
    }

    /// How many plain photons one photon is worth, averaged over all lights.
    pub(crate) fn gain(&self, emitters: &LightSelector) -> f32 {
        let lights = self.lights.iter().enumerate();
        let of_light =
            |(number, aim): (usize, &Option<Aim>)| emitters.pmf(number) * aim.as_ref().map_or(1.0, |aim| aim.gain);
        lights.map(of_light).sum()
    }

    /// Whether photons start as with the other targets.
    pub(crate) fn are_like(&self, other: &Self) -> bool {
        let plain = |targets: &Self| -> Vec<Option<f32>> {
            let lights = targets.lights.iter();
            lights.map(|aim| aim.as_ref().map(|aim| aim.plain)).collect()
        };
        plain(self) == plain(other) && self.chosen.is_some() == other.chosen.is_some()
    }

    /// Whether photons that miss are dropped, which biases the picture.
    pub fn rejects(&self) -> bool {
        self.rejects
    }

    /// Number of discs along a ray up to a distance, for display.
    pub(crate) fn count(&self, ray: &Ray, length: f32) -> u32 {
        let aims = self.lights.iter().flatten();
        aims.map(|aim| aim.discs.count(ray, length)).sum()
    }
}

impl Aim {
    /// A light's targets, and what an aimed photon is worth in plain ones, if that can be told.
    fn new(scene: &Scene, light: &Light, places: &[Viewpoint], mode: Targeting) -> (Option<Self>, Option<f64>) {
        // Places of one path are close together, so the halves come from different paths.
        let half = |odd: bool| -> Vec<Viewpoint> {
            let is_in = |place: &&Viewpoint| place.odd == odd;
            places.iter().filter(is_in).copied().collect()
        };
        let (known, unknown) = (half(false), half(true));
        if known.len() < MIN_PLACES || unknown.is_empty() {
            return (None, None);
        }
        let discs = Discs::new(&known, scene.bounds());
        let unknown = &unknown[..unknown.len().min(discs::MOST)];
        let most = discs::heaviest(unknown);
        let ratios: Vec<(f64, f64)> = unknown
            .iter()
            .map(|place| {
                let ratio = light.aimed_over_plain(scene.bounds(), &discs, place);
                let ratio = if ratio.is_nan() { 0.0 } else { f64::from(ratio) };
                (f64::from(place.weight.min(most)), ratio)
            })
            .collect();
        let total: f64 = ratios.iter().map(|(weight, _)| weight).sum();
        let moment = |plain: f64| {
            let of_one = |(weight, ratio): &(f64, f64)| weight / (plain + (1.0 - plain) * ratio);
            ratios.iter().map(of_one).sum::<f64>() / total
        };
        let shares = (1..10).map(|i| 1.0 - MAX_AIMED + 0.1 * f64::from(i - 1));
        let best = shares.min_by(|a, b| moment(*a).total_cmp(&moment(*b)));
        let plain = best.unwrap_or(1.0);
        let gain = 1.0 / moment(plain);
        if mode == Targeting::Auto && gain < MIN_GAIN {
            return (None, Some(gain));
        }
        let looked_at = unknown
            .iter()
            .map(|place| discs.work(&light.ray_to(scene.bounds(), place)));
        let looked_at: u64 = looked_at.map(u64::from).sum();
        let aim = Self {
            plain: plain as f32,
            gain: gain as f32,
            work: looked_at as f32 / unknown.len() as f32,
            discs,
            trials: 1,
        };
        (Some(aim), Some(gain))
    }

    /// Shares of plain and of aimed photons that hit a disc before anything else.
    fn hit_rates(&self, scene: &Scene, light: usize, seed: u64, mask: impl VisibilityMask) -> [f32; 2] {
        [false, true].map(|is_aimed| {
            let mut hits = 0;
            for probe in (0..PROBES).take_while(|_| !scene.is_interrupted()) {
                let mut sampler = Sampler::new(seed, light as u64, Purpose::Probes, probe);
                let source = &scene.lights()[light];
                let uniforms = EmissionUniforms::draw(&mut sampler);
                let (objects, bounds) = (scene.objects(), scene.bounds());
                let emission = match is_aimed {
                    false => Some(source.sample_emission(objects, bounds, uniforms)),
                    true => {
                        let choice = sampler.next_1d();
                        let aimed = source.sample_aimed(objects, bounds, &self.discs, uniforms, choice);
                        aimed.map(|(start, _)| start)
                    }
                };
                hits += u32::from(emission.is_some_and(|emission| {
                    let (origin, _) = scene.start_of(light, &emission);
                    let ray = Ray {
                        origin,
                        dir: emission.dir,
                    };
                    self.is_hit(scene, light, &ray, mask)
                }));
            }
            hits as f32 / PROBES as f32
        })
    }

    /// Whether a photon of the light meets a disc before anything that stops it. Discs reach into the surfaces that
    /// they lie on, by their radius.
    pub(crate) fn is_hit(&self, scene: &Scene, light: usize, ray: &Ray, mask: impl VisibilityMask) -> bool {
        let mut nearest = f32::INFINITY;
        self.discs
            .along(ray, |disc, t, _| nearest = nearest.min(t - disc.radius));
        if nearest == f32::INFINITY {
            return false;
        }
        let hidden = mask.from(Start::Light(light));
        let is_passed = |object: u32| scene.passable[object as usize] || mask.hides(hidden, object);
        !scene
            .geometry
            .occluded(scene.objects(), ray, nearest.max(0.0), &is_passed)
    }
}

fn percent(share: f32) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn listed(mut told: Vec<String>, none: &str) -> String {
    let more = told.len().saturating_sub(MAX_TOLD);
    told.truncate(MAX_TOLD);
    if more > 0 {
        told.push(format!("{more} more"));
    }
    match told.is_empty() {
        true => none.into(),
        false => told.join("; "),
    }
}
