//! Object visibility rules. Names become objects and lights, those that no rule tells apart become classes, and what a
//! ray does not see becomes a bit row over classes.

mod notes;
mod sets;

use super::{Parts, unknown_name};
use crate::parse::{self, Fault, SceneRecord};
use crate::values::Spanned;
use beamfarm_render::world::bsdf::Material;
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::rules::{RayType, Rules};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Ranges of object numbers and of light numbers.
type Run = [Range<usize>; 2];

/// What names refer to, collected while objects and lights are made.
#[derive(Default)]
pub struct Names {
    /// Ranges of objects and lights by name.
    runs: BTreeMap<String, Vec<Run>>,
    /// Shapes and lights that say which rays see them.
    visible: Vec<(Spanned<Vec<RayType>>, Run)>,
}

impl Names {
    /// Record objects and lights under a name and its groups.
    pub fn add(
        &mut self,
        name: &str,
        groups: &[&str],
        visible: Option<&Spanned<Vec<parse::RayType>>>,
        objects: Range<usize>,
        lights: Range<usize>,
    ) {
        let run = [objects, lights];
        for name in groups.iter().chain([&name]) {
            let runs = self.runs.entry((*name).to_owned()).or_default();
            if runs.last() != Some(&run) {
                runs.push(run.clone());
            }
        }
        if let Some(visible) = visible {
            let rays = visible.get_ref().iter().map(|ray| (*ray).into()).collect();
            self.visible.push((Spanned::new(visible.span(), rays), run));
        }
    }
}

/// The listed things, or all but those.
#[derive(Default)]
struct Listed {
    listed: BTreeSet<u32>,
    inverted: bool,
}

impl Listed {
    fn has(&self, thing: u32) -> bool {
        self.listed.contains(&thing) != self.inverted
    }

    /// Whether it includes everything in `others`.
    fn covers(&self, others: &Self) -> bool {
        match (self.inverted, others.inverted) {
            (false, false) => others.listed.is_subset(&self.listed),
            (true, false) => others.listed.is_disjoint(&self.listed),
            (true, true) => self.listed.is_subset(&others.listed),
            (false, true) => false,
        }
    }
}

/// One rule.
struct Clause {
    starts: Listed,
    rays: Vec<RayType>,
    list: Listed,
    includes: bool,
    /// Where the rule is written. `ray_places` is empty when the rule is a shape's or light's own `visible`.
    place: Range<usize>,
    ray_places: Vec<Range<usize>>,
}

/// The rules of a scene.
#[derive(Default)]
pub struct Resolved {
    /// None when no rule has an effect.
    pub rules: Option<Rules>,
    /// Rules without effect.
    pub notes: Vec<Fault>,
    /// Where rules that photons obey are written.
    pub photon_places: Vec<Range<usize>>,
}

pub fn resolve(record: &SceneRecord, parts: &Parts<'_>) -> Result<Resolved, Fault> {
    let resolver = Resolver::new(record, parts)?;
    let clauses = resolver.clauses()?;
    if clauses.is_empty() {
        return Ok(Resolved::default());
    }
    let rules = resolver.rules(&clauses)?;
    let photon_places = match &rules {
        Some(rules) if rules.touches_photons => resolver.photon_places(&clauses)?,
        _ => Vec::new(),
    };
    Ok(Resolved {
        rules,
        notes: resolver.notes(&clauses),
        photon_places,
    })
}

struct Resolver<'a> {
    record: &'a SceneRecord,
    parts: &'a Parts<'a>,
    /// Things are numbered objects first, then lights up to `things`; beyond these come things that only start rays.
    objects: usize,
    things: usize,
    groups: BTreeMap<&'a str, BTreeSet<u32>>,
}

impl<'a> Resolver<'a> {
    fn new(record: &'a SceneRecord, parts: &'a Parts<'a>) -> Result<Self, Fault> {
        let objects = parts.objects.len();
        let mut resolver = Self {
            record,
            parts,
            objects,
            things: objects + parts.lights.len(),
            groups: BTreeMap::new(),
        };
        for (name, members) in &record.groups {
            let taken = match name.get_ref().as_str() {
                "all" | "camera" | "world" => Some("a rule's own word".to_string()),
                name if parts.names.runs.contains_key(name) => {
                    Some("the name of a shape, or of a light or its group".to_string())
                }
                _ => None,
            };
            if let Some(taken) = taken {
                return Err(Fault::new(
                    name.span(),
                    format!("\"{}\" is {taken}; choose another name", name.get_ref()),
                ));
            }
            let mut things = BTreeSet::new();
            for member in members.get_ref() {
                things.extend(resolver.named(member)?);
            }
            resolver.groups.insert(name.get_ref(), things);
        }
        Ok(resolver)
    }

    fn camera(&self) -> u32 {
        self.things as u32
    }
    fn world(&self) -> u32 {
        self.things as u32 + 1
    }

    fn run(&self, [objects, lights]: &Run) -> impl Iterator<Item = u32> {
        let first_light = self.objects;
        let lights = lights.clone().map(move |light| first_light + light);
        objects.clone().chain(lights).map(|thing| thing as u32)
    }

    /// What a name refers to: a group, shapes and lights, or one instance.
    fn named(&self, name: &Spanned<String>) -> Result<Vec<u32>, Fault> {
        if let Some(group) = self.groups.get(&**name.get_ref()) {
            return Ok(group.iter().copied().collect());
        }
        if let Some(runs) = self.parts.names.runs.get(name.get_ref()) {
            return Ok(runs.iter().flat_map(|run| self.run(run)).collect());
        }
        let objects = self.parts.objects.iter();
        let is_it = |(_, object): &(usize, &Object)| object.name == *name.get_ref();
        let one = objects.enumerate().find(is_it);
        if let Some((number, _)) = one {
            return Ok(vec![number as u32]);
        }
        let known = self.parts.names.runs.keys().map(String::as_str);
        let known = known.chain(self.groups.keys().copied());
        Err(unknown_name("shape, light or group", name, known))
    }

    fn list(&self, names: &[Spanned<String>]) -> Result<Listed, Fault> {
        let mut list = Listed::default();
        for name in names {
            match &**name.get_ref() {
                "all" => list.inverted = true,
                _ => list.listed.extend(self.named(name)?),
            }
        }
        if list.inverted {
            list.listed.clear();
        }
        Ok(list)
    }

    fn starts(&self, on: Option<&[Spanned<String>]>, except: &[Spanned<String>]) -> Result<Listed, Fault> {
        let numbers = |names: &[Spanned<String>]| {
            let mut numbers = BTreeSet::new();
            let mut all = false;
            for name in names {
                match &**name.get_ref() {
                    "all" => all = true,
                    "camera" => _ = numbers.insert(self.camera()),
                    "world" => _ = numbers.insert(self.world()),
                    _ => numbers.extend(self.named(name)?),
                }
            }
            Ok::<_, Fault>((all, numbers))
        };
        let (all, on) = match on {
            Some(names) => numbers(names)?,
            None => (true, BTreeSet::new()),
        };
        let (everything, except) = numbers(except)?;
        Ok(match (everything, all) {
            (true, _) => Listed::default(),
            (false, true) => Listed {
                listed: except,
                inverted: true,
            },
            (false, false) => Listed {
                listed: on.difference(&except).copied().collect(),
                inverted: false,
            },
        })
    }

    fn clauses(&self) -> Result<Vec<Clause>, Fault> {
        let mut clauses = Vec::new();
        for rule in &self.record.rules {
            let includes = rule.include.is_some();
            let Some(names) = rule.include.as_ref().or(rule.exclude.as_ref()) else {
                continue;
            };
            let on = rule.on.as_ref().map(|names| names.get_ref().as_slice());
            let except = rule.except.as_ref();
            let except = except.map_or(&[][..], |names| names.get_ref());
            let rays = rule.rays.get_ref();
            clauses.push(Clause {
                starts: self.starts(on, except)?,
                rays: rays.iter().map(|ray| (*ray.get_ref()).into()).collect(),
                list: self.list(names.get_ref())?,
                includes,
                place: names.span(),
                ray_places: rays.iter().map(Spanned::span).collect(),
            });
        }
        for (visible, run) in &self.parts.names.visible {
            let sees = |ray: &RayType| !visible.get_ref().contains(ray);
            clauses.push(Clause {
                starts: Listed {
                    listed: BTreeSet::new(),
                    inverted: true,
                },
                rays: RayType::ALL.into_iter().filter(sees).collect(),
                list: Listed {
                    listed: self.run(run).collect(),
                    inverted: false,
                },
                includes: false,
                place: visible.span(),
                ray_places: Vec::new(),
            });
        }
        Ok(clauses)
    }

    /// The light with this thing number, if it is not an object.
    fn light(&self, thing: u32) -> Option<&LightKind> {
        let light = (thing as usize).checked_sub(self.objects)?;
        self.parts.lights.get(light).map(|light| &light.kind)
    }

    fn material(&self, object: usize) -> &Material {
        &self.parts.materials.list[self.parts.objects[object].material as usize]
    }

    fn name(&self, thing: u32) -> &str {
        let thing = thing as usize;
        match self.parts.objects.get(thing) {
            Some(object) => &object.name,
            None => {
                let light = self.parts.lights.get(thing - self.objects);
                light.map_or("", |light| &light.name)
            }
        }
    }
}

fn name_of(ray: RayType) -> &'static str {
    match ray {
        RayType::Camera => "camera",
        RayType::Reflected => "reflected",
        RayType::Refracted => "refracted",
        RayType::Shadow => "shadow",
        RayType::Photon => "photon",
    }
}
