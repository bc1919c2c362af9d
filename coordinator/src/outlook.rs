//! What to expect of a scene, from a look of a few milliseconds before rendering starts.

use crate::sketch::{GLANCE, Sketch};
use beamfarm_image::job::JobSettings;
use beamfarm_render::cpu::probe::{Followed, follow_photons, optical_depths};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::nested::{Meeting, Met, Outcome, Reason};
use beamfarm_render::world::{Scene, SceneDescription};

/// Optical depth of a medium, or rays per photon path, beyond which a render takes for ever.
const ENDLESS: f32 = 1000.0;
/// Pixels and photon paths of a picture that must show some light, if there is any.
const FEWEST_PIXELS: usize = 1000;
const SECOND_LOOK: (u32, u32) = (128, 4_000);
/// Rays along each side of the picture that find what the camera sees first.
const SIDE: u16 = 64;

/// The most pairs of shapes that are named.
const MOST_TOLD: usize = 5;

/// What is known of a scene before its first pass.
pub struct Outlook {
    /// For display.
    pub notes: Vec<String>,
    /// A coarse picture. `None`: the scene cannot be rendered.
    pub sketch: Option<Sketch>,
}

impl Outlook {
    pub fn new(description: &SceneDescription, settings: JobSettings) -> Self {
        let mut scene = Scene::new(description.clone());
        let mut notes = misplaced(&scene);
        notes.extend(meeting(&scene));
        let followed = follow_photons(&scene, &RenderPlan::provisional(&scene, settings));
        let thick = thick(&scene, &followed);
        let lost = lost(&scene, &followed, settings);
        let sketch = Sketch::new(&mut scene, settings, GLANCE);
        // Already reported: a scene without lights, a camera inside an opaque object. Opaque fog and photons that meet
        // nothing make the picture black as well.
        let is_told =
            !thick.is_empty() || lost.is_some() || description.notes.iter().any(|note| note.contains("will be black"));
        let has_seen = |sketch: &Sketch| sketch.pixels() >= FEWEST_PIXELS && sketch.is_black();
        if !is_told && sketch.as_ref().is_some_and(has_seen) {
            notes.extend(dark(&mut scene, settings));
        }
        notes.extend(thick.into_iter().chain(lost));
        Self { notes, sketch }
    }
}

fn misplaced(scene: &Scene) -> Vec<String> {
    // A single boundary can only lie in the world's medium.
    let boundaries = scene.description().objects.iter().filter(|o| o.boundary.is_some());
    let misplaced = match boundaries.count() > 1 {
        true => scene.misplaced(),
        false => Vec::new(),
    };
    let note = |name: &String| {
        format!(
            "shape {name:?} lies in another medium than its `exterior` says (the world's where none is given): light that \
             leaves it goes on as if it were in that. Expected the medium around it, or `boundary = false`"
        )
    };
    misplaced.iter().map(note).collect()
}

/// Glass, liquids and media that overlap.
fn meeting(scene: &Scene) -> Vec<String> {
    let name = |object: u32| &scene.description().objects[object as usize].name;
    let note = |met: &Met| {
        let [one, other] = met.pair;
        let meet = match met.meeting {
            Meeting::Crossing => "reach into each other",
            Meeting::Touching => "touch",
            Meeting::Within => "are in one place",
        };
        let shapes = format!("shapes {:?} and {:?} {meet}", name(one), name(other));
        Some(match met.outcome {
            Outcome::GivesWay { to, reason } => {
                let gives_way = if to == one { other } else { one };
                let why = match reason {
                    // The scene states it.
                    Reason::Priority => return None,
                    Reason::Medium => "which has a medium inside",
                    Reason::Index => "whose index of refraction is lower",
                    Reason::Order => "which comes later",
                };
                format!(
                    "{shapes}: {:?}, {why}, gives way to {:?}. A `priority` for one of them confirms or reverses that",
                    name(gives_way),
                    name(to)
                )
            }
            Outcome::AddUp { is_exact: true } => return None,
            Outcome::AddUp { is_exact: false } => format!(
                "{shapes}: their media add up, but for the phase function, which is only close to that of both: it has \
                 two lobes, the same in all colours"
            ),
            Outcome::Unsummed => format!(
                "{shapes}: media whose density varies do not add up: where they overlap, light meets the one it \
                 entered last. Expected a gap, or a `priority` for one of them: the lower one gives way"
            ),
            Outcome::Unresolved => format!(
                "{shapes}: one of them is inside out, or lets light pass by chance: where they overlap, light meets \
                 the one it entered last. What is behind looks wrong. Expected a gap between them, a thousandth of \
                 their size"
            ),
        })
    };
    let mut notes: Vec<String> = scene.meeting_solids().iter().filter_map(note).collect();
    let more = notes.len().saturating_sub(MOST_TOLD);
    notes.truncate(MOST_TOLD);
    if more > 0 {
        notes.push(format!("{more} more pairs of shapes overlap like this"));
    }
    if scene.meets_too_many() {
        notes.push(
            "there are too many shapes of glass or media to look at all pairs: where others overlap, light meets the \
             one it entered last"
                .into(),
        );
    }
    notes
}

/// Media that light hardly gets through.
fn thick(scene: &Scene, followed: &Followed) -> Vec<String> {
    let SceneDescription { media, media_names, .. } = scene.description();
    let depths = optical_depths(scene);
    let field = |id: usize| {
        let scattering = media[id].sigma_s().max_element();
        let field = match 2.0 * scattering >= media[id].sigma_t().max_element() {
            true => "sigma_s",
            false => "sigma_a",
        };
        format!("media.{}.{field}", media_names[id])
    };
    let hint = "Is that per scene unit, and not per millimetre or metre?";
    let deep = (0..media.len()).filter(|id| depths[*id] > ENDLESS);
    let mut notes: Vec<String> = deep
        .map(|id| {
            format!(
                "`{}`: the medium's optical depth is {:.0} from one side of what it fills to the other. Light hardly gets \
                 into it, and what does takes very long to render. {hint}",
                field(id),
                depths[id]
            )
        })
        .collect();
    let scatterings = followed.rays as f32 / followed.paths.max(1) as f32 - 1.0;
    if notes.is_empty() && scatterings > ENDLESS {
        let scatters = (0..media.len()).filter(|id| media[*id].scatters());
        let least = scatters.min_by(|a, b| Medium::free_path(&media[*a]).total_cmp(&media[*b].free_path()));
        notes.extend(least.map(|id| {
            format!(
                "`{}`: a photon path scatters {scatterings:.0} times on average, {:.3} scene units apart, so a pass \
                 takes very long. {hint}",
                field(id),
                media[id].free_path()
            )
        }));
    }
    notes
}

/// A note on a picture that is black at the first look and at a second one.
fn dark(scene: &mut Scene, settings: JobSettings) -> Option<String> {
    let again = JobSettings {
        seed: settings.seed.wrapping_add(1),
        ..settings
    };
    let sketch = Sketch::once(scene, again, SECOND_LOOK)?;
    if !sketch.is_black() {
        return None;
    }
    let place = |i: u16| (f32::from(i) + 0.5) / f32::from(SIDE);
    let places = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (place(x), place(y))));
    let mut met = vec![0_u32; scene.description().objects.len()];
    for (x, y) in places {
        if let Some(seen) = scene.seen_at(x, y) {
            met[seen.object as usize] += 1;
        }
    }
    let rays = u32::from(SIDE) * u32::from(SIDE);
    let most = (0..met.len()).max_by_key(|object| met[*object]);
    Some(match most.filter(|object| met[*object] > 0) {
        None => format!(
            "the camera sees nothing: none of {rays} rays meets a shape or a light. See `camera.origin` and \
             `camera.target`, and whether units are those of the shapes"
        ),
        Some(object) => format!(
            "the picture may stay black: none of {} camera paths found light. What they meet first is mostly {:?} ({} of \
             {rays} rays). Is `camera.origin` outside of the room that has the lights, or are these behind something?",
            sketch.pixels(),
            scene.description().objects[object].name,
            met[object]
        ),
    })
}

/// A note if photons meet nothing, both with a plan without targeting and with the real plan.
fn lost(scene: &Scene, provisional: &Followed, settings: JobSettings) -> Option<String> {
    if !provisional.is_lost() {
        return None;
    }
    let followed = follow_photons(scene, &RenderPlan::new(scene, settings));
    followed.is_lost().then(|| {
        format!(
            "none of {} photon paths meets anything: what they should light stays dark. Do `lights` shine to \
             where shapes and media are, by `position`, `target` or `direction`?",
            followed.paths
        )
    })
}
