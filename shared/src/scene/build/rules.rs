//! Object visibility rules: names become things, things that no rule tells apart become classes, and what a ray does not
//! see a row of bits over the classes.

use super::{Parts, unknown_name};
use crate::bsdf::{Material, MaterialKind};
use crate::geometry::Object;
use crate::light::LightKind;
use crate::rules::{HiddenSet, ObjectSets, RayType, Rules};
use crate::scene::parse::{Fault, SceneRecord};
use crate::scene::values::Spanned;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Numbers of objects, and of lights.
type Run = [Range<usize>; 2];

/// What names stand for, gathered while objects and lights are made.
#[derive(Default)]
pub struct Names {
    /// By name: runs of objects, and of lights.
    runs: BTreeMap<String, Vec<Run>>,
    /// Of shapes and lights that say which rays see them.
    visible: Vec<(Spanned<Vec<RayType>>, Run)>,
}

impl Names {
    /// Objects and lights of this name, and of these groups.
    pub fn add(
        &mut self,
        name: &str,
        groups: &[&str],
        visible: Option<&Spanned<Vec<RayType>>>,
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
            self.visible.push((visible.clone(), run));
        }
    }
}

/// Some of the things, or all but some.
#[derive(Default)]
struct Listed {
    listed: BTreeSet<u32>,
    inverted: bool,
}

impl Listed {
    fn has(&self, thing: u32) -> bool {
        self.listed.contains(&thing) != self.inverted
    }

    /// Whether these are all of some others, and perhaps more.
    fn covers(&self, others: &Self) -> bool {
        match (self.inverted, others.inverted) {
            (false, false) => others.listed.is_subset(&self.listed),
            (true, false) => others.listed.is_disjoint(&self.listed),
            (true, true) => self.listed.is_subset(&others.listed),
            (false, true) => false,
        }
    }
}

/// What one rule says.
struct Clause {
    starts: Listed,
    rays: Vec<RayType>,
    list: Listed,
    includes: bool,
    /// Where it is written; where its ray types are, unless it is a shape's or light's own.
    place: Range<usize>,
    ray_places: Vec<Range<usize>>,
}

/// The rules of a scene, unless they have no effect; and what of them has none.
pub fn resolve(
    record: &SceneRecord,
    parts: &Parts<'_>,
) -> Result<(Option<Rules>, Vec<Fault>), Fault> {
    let resolver = Resolver::new(record, parts)?;
    let clauses = resolver.clauses()?;
    if clauses.is_empty() {
        return Ok((None, Vec::new()));
    }
    let rules = resolver.rules(&clauses)?;
    let notes = resolver.notes(&clauses);
    Ok((rules, notes))
}

struct Resolver<'a> {
    record: &'a SceneRecord,
    parts: &'a Parts<'a>,
    /// Objects, then lights; beyond them, what only rays start at.
    objects: usize,
    things: usize,
    groups: BTreeMap<&'a str, BTreeSet<u32>>,
}

/// Classes of numbers that no list tells apart.
struct Partition {
    class: Vec<u32>,
    /// By class: one of its members.
    members: Vec<u32>,
}

impl Partition {
    fn new<'s>(count: usize, lists: impl Iterator<Item = &'s Listed>) -> Self {
        let mut class = vec![0; count];
        let mut fresh = 1u32;
        for list in lists {
            // What is listed leaves its class.
            let mut moved = BTreeMap::new();
            for &number in &list.listed {
                let class = &mut class[number as usize];
                *class = *moved.entry(*class).or_insert_with(|| {
                    fresh += 1;
                    fresh - 1
                });
            }
        }
        let mut members = Vec::new();
        let mut numbers = BTreeMap::new();
        for (number, class) in class.iter_mut().enumerate() {
            *class = *numbers.entry(*class).or_insert_with(|| {
                members.push(number as u32);
                members.len() as u32 - 1
            });
        }
        Self { class, members }
    }
}

/// Rows of bits, each kept once.
struct Rows {
    words: usize,
    all: Vec<u32>,
    known: BTreeMap<Vec<u32>, u32>,
}

impl Rows {
    fn set(&mut self, row: Vec<u32>) -> HiddenSet {
        let at = self.all.len() as u32;
        let set = *self.known.entry(row.clone()).or_insert(at);
        if set == at {
            self.all.extend(row);
        }
        HiddenSet(set)
    }

    fn row(&self, set: HiddenSet) -> &[u32] {
        &self.all[set.0 as usize..][..self.words]
    }

    fn masked(&self, set: HiddenSet, mask: &[u32]) -> Vec<u32> {
        let both = self.row(set).iter().zip(mask).map(|(a, b)| a & b);
        both.collect()
    }
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

    /// The things of a name: of a group, of shapes and lights, of one instance.
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
        // Emitting shapes may name groups of lights as well.
        let lights = self.parts.lights.iter().enumerate();
        let in_group = lights.filter(|(_, light)| light.group.as_str() == name.get_ref());
        let in_group: Vec<u32> = in_group
            .flat_map(|(number, light)| {
                let object = match light.kind {
                    LightKind::Area { object, .. } => Some(object),
                    _ => None,
                };
                object.into_iter().chain([(self.objects + number) as u32])
            })
            .collect();
        if !in_group.is_empty() {
            return Ok(in_group);
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

    fn starts(
        &self,
        on: Option<&[Spanned<String>]>,
        except: &[Spanned<String>],
    ) -> Result<Listed, Fault> {
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
                rays: rays.iter().map(|ray| *ray.get_ref()).collect(),
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

    /// The light that a thing is, if it is no object.
    fn light(&self, thing: u32) -> Option<&LightKind> {
        let light = (thing as usize).checked_sub(self.objects)?;
        self.parts.lights.get(light).map(|light| &light.kind)
    }

    fn material(&self, object: usize) -> &Material {
        &self.parts.materials.list[self.parts.objects[object].material as usize]
    }

    /// Whether an include list says which objects, and which lights, are seen.
    fn restricts(&self, list: &Listed, ray: RayType) -> [bool; 2] {
        if list.inverted {
            return [false; 2];
        }
        let to_lights = matches!(ray, RayType::Shadow | RayType::Photon);
        let is_object = |thing: &u32| match self.parts.objects.get(*thing as usize) {
            // Seen from where light is looked for, a shape that emits is a light.
            Some(object) => !to_lights || object.light.is_none(),
            None => false,
        };
        let is_light = |thing: &u32| match self.light(*thing) {
            Some(LightKind::Area { .. }) => to_lights,
            Some(_) => true,
            None => false,
        };
        [
            list.listed.iter().any(is_object),
            list.listed.iter().any(is_light),
        ]
    }

    /// Which classes rays of a type do not see under these rules.
    fn hidden(
        &self,
        clauses: &[&Clause],
        ray: RayType,
        things: &Partition,
    ) -> Result<Vec<u32>, Fault> {
        let mut row = vec![0; things.members.len().div_ceil(32)];
        let clauses = clauses.iter().filter(|clause| clause.rays.contains(&ray));
        let (includes, excludes): (Vec<&Clause>, Vec<&Clause>) =
            clauses.copied().partition(|clause| clause.includes);
        let restricts = |kind: usize| {
            let of = |clause: &&Clause| self.restricts(&clause.list, ray)[kind];
            includes.iter().any(of)
        };
        let restricted = [restricts(0), restricts(1)];
        for (class, &thing) in things.members.iter().enumerate() {
            let lists = |clause: &&&Clause| clause.list.has(thing);
            let excluded = excludes.iter().find(lists);
            let included = includes.iter().find(lists);
            if let (Some(excluded), Some(included)) = (excluded, included)
                && !included.list.inverted
            {
                let place = if excluded.place.start > included.place.start {
                    &excluded.place
                } else {
                    &included.place
                };
                return Err(Fault::new(
                    place.clone(),
                    format!(
                        "one rule includes \"{}\", another excludes it, for the same {} rays",
                        self.name(thing),
                        name_of(ray),
                    ),
                ));
            }
            let kind = usize::from(thing as usize >= self.objects);
            if excluded.is_some() || (restricted[kind] && included.is_none()) {
                row[class / 32] |= 1 << (class % 32);
            }
        }
        Ok(row)
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

    fn rules(&self, clauses: &[Clause]) -> Result<Option<Rules>, Fault> {
        let lights = Listed {
            listed: (self.objects as u32..self.things as u32).collect(),
            inverted: false,
        };
        let lists = clauses.iter().map(|clause| &clause.list);
        let things = Partition::new(self.things, lists.chain([&lights]));
        let starts = clauses.iter().map(|clause| &clause.starts);
        let starts = Partition::new(self.things + 2, starts);
        let words = things.members.len().div_ceil(32).max(1);
        let mut rows = Rows {
            words,
            all: Vec::new(),
            known: BTreeMap::new(),
        };
        let nothing = rows.set(vec![0; words]);
        // By class of starts and type of ray.
        let mut sets = Vec::new();
        for &start in &starts.members {
            let here = clauses.iter().filter(|clause| clause.starts.has(start));
            let here: Vec<&Clause> = here.collect();
            for ray in RayType::ALL {
                let mut row = self.hidden(&here, ray, &things)?;
                row.resize(words, 0);
                sets.push(rows.set(row));
            }
        }
        let set = |start: u32, ray: RayType| {
            let class = starts.class[start as usize] as usize;
            sets[class * RayType::ALL.len() + ray as usize]
        };
        let of_object = (0..self.objects as u32).map(|object| ObjectSets {
            reflected: set(object, RayType::Reflected),
            refracted: set(object, RayType::Refracted),
            shadow: set(object, RayType::Shadow),
            photon: set(object, RayType::Photon),
            ..ObjectSets::default()
        });
        let of_light = (self.objects..self.things).map(|light| set(light as u32, RayType::Photon));
        let (of_object, of_light): (Vec<_>, Vec<_>) = (of_object.collect(), of_light.collect());
        let camera = set(self.camera(), RayType::Camera);
        let of_medium = self.of_media(clauses, &set)?;
        let is_nothing = |set: &HiddenSet| *set == nothing;
        let touches_photons = !of_object.iter().all(|sets| is_nothing(&sets.photon))
            || !of_light.iter().chain(&of_medium).all(is_nothing);
        let has_effect = touches_photons
            || camera != nothing
            || of_object.iter().any(|sets| {
                let others = [sets.reflected, sets.refracted, sets.shadow];
                !others.iter().all(is_nothing)
            });
        if !has_effect {
            return Ok(None);
        }
        let mut rules = Rules {
            class: things.class.clone(),
            objects: self.objects,
            rows: Vec::new(),
            camera,
            of_object,
            of_light,
            of_medium,
            unlit: Vec::new(),
            gather: nothing,
            rules: clauses.len(),
            touches_photons,
        };
        self.balance(&mut rules, &mut rows, &things);
        rules.rows = rows.all;
        rules.unlit = self.unlit(&rules);
        Ok(Some(rules))
    }

    /// Objects that a medium fills.
    fn filled_by(&self, medium: usize) -> impl Iterator<Item = usize> {
        let objects = self.parts.objects.iter().enumerate();
        let is_filled = move |object: &Object| {
            let interior = object.boundary.and_then(|boundary| boundary.interior);
            interior.map(usize::from) == Some(medium)
        };
        objects.filter_map(move |(i, object)| is_filled(object).then_some(i))
    }

    /// What photons scattered in media do not see: what those of the objects do that the media fill.
    fn of_media(
        &self,
        clauses: &[Clause],
        set: &impl Fn(u32, RayType) -> HiddenSet,
    ) -> Result<Vec<HiddenSet>, Fault> {
        let media = self.parts.media.list.iter().enumerate();
        let of_medium = |(number, medium): (usize, &crate::medium::Medium)| {
            let mut owners: Vec<u32> = self.filled_by(number).map(|i| i as u32).collect();
            if owners.is_empty() || self.parts.world_medium.map(usize::from) == Some(number) {
                owners.push(self.world());
            }
            let first = set(owners[0], RayType::Photon);
            let other = |owner: &&u32| set(**owner, RayType::Photon) != first;
            if medium.scatters()
                && let Some(other) = owners.iter().find(other)
            {
                let name = |owner: u32| match owner == self.world() {
                    true => "the world".to_string(),
                    false => format!("\"{}\"", self.name(owner)),
                };
                let tells_apart = |clause: &&Clause| {
                    clause.rays.contains(&RayType::Photon)
                        && clause.starts.has(owners[0]) != clause.starts.has(*other)
                };
                let clause = clauses.iter().find(tells_apart);
                return Err(Fault {
                    span: clause.map(|clause| clause.place.clone()),
                    message: format!(
                        "photons in the medium \"{}\" cannot obey the rules of both {} and {}, which it fills; give \
                         each a medium of its own",
                        self.parts.media.name(u16::try_from(number).ok()),
                        name(owners[0]),
                        name(*other),
                    ),
                });
            }
            Ok(first)
        };
        media.map(of_medium).collect()
    }

    /// Which light gather rays find, and which photons: see `crate::rules`.
    fn balance(&self, rules: &mut Rules, rows: &mut Rows, things: &Partition) {
        let mut objects = vec![0; rows.words];
        for (class, &thing) in things.members.iter().enumerate() {
            if (thing as usize) < self.objects {
                objects[class / 32] |= 1 << (class % 32);
            }
        }
        let lights: Vec<u32> = objects.iter().map(|word| !word).collect();
        let mut tally: BTreeMap<Vec<u32>, usize> = BTreeMap::new();
        for (number, sets) in rules.of_object.iter().enumerate() {
            if !self.material(number).is_specular() {
                *tally.entry(rows.masked(sets.photon, &objects)).or_default() += 1;
            }
        }
        // Of those as frequent, the first.
        let most = tally.iter().rev().max_by_key(|(_, count)| **count);
        let common = most.map_or_else(|| vec![0; rows.words], |(row, _)| row.clone());
        rules.gather = rows.set(common.clone());
        let none = |row: Vec<u32>| row.iter().all(|word| *word == 0);
        for (number, sets) in rules.of_object.iter_mut().enumerate() {
            let class = things.class[number] as usize;
            let is_passed = common[class / 32] >> (class % 32) & 1 == 1;
            sets.is_gathered = !is_passed && rows.masked(sets.photon, &objects) == common;
            sets.gathers = !is_passed && none(rows.masked(sets.photon, &lights));
            sets.one_ray = rows.masked(sets.shadow, &objects) == common;
            let is_gloss = is_gloss(self.material(number));
            sets.is_glossy = is_gloss && (sets.reflected.0 != 0 || sets.refracted.0 != 0);
        }
    }

    fn unlit(&self, rules: &Rules) -> Vec<bool> {
        let world = self.parts.world_medium.map(usize::from);
        let mut unlit = Vec::new();
        for (medium, &set) in rules.of_medium.iter().enumerate() {
            let owners: Vec<usize> = self.filled_by(medium).collect();
            for (light, &photons) in rules.of_light.iter().enumerate() {
                // Photons that pass the object do not enter what fills it.
                let passes = |owner: &usize| rules.hides(photons, *owner as u32);
                let is_passed =
                    world != Some(medium) && !owners.is_empty() && owners.iter().all(passes);
                unlit.push(is_passed || rules.hides_light(set, light));
            }
        }
        unlit
    }

    /// Whether rays of a type start at a thing, to any effect.
    fn start(&self, start: u32, ray: RayType) -> bool {
        let scatters = |medium: Option<u16>| {
            medium.is_some_and(|id| self.parts.media.list[usize::from(id)].scatters())
        };
        if start == self.camera() {
            return ray == RayType::Camera;
        }
        if start == self.world() {
            return ray == RayType::Photon && scatters(self.parts.world_medium);
        }
        let Some(object) = self.parts.objects.get(start as usize) else {
            return ray == RayType::Photon;
        };
        let material = self.material(start as usize);
        let refracts = matches!(
            material.kind,
            MaterialKind::Dielectric { .. }
                | MaterialKind::ThinDielectric { .. }
                | MaterialKind::RoughDielectric { .. }
        );
        match ray {
            RayType::Camera => false,
            RayType::Reflected => {
                !material.is_null() && (material.has_delta() || is_gloss(material))
            }
            RayType::Refracted => refracts,
            RayType::Shadow => !material.is_specular(),
            RayType::Photon => {
                !material.is_null()
                    || scatters(object.boundary.and_then(|boundary| boundary.interior))
            }
        }
    }

    /// Whether photons leave anything on a thing or in it.
    fn keeps_photons(&self, start: u32) -> bool {
        if start == self.world() {
            return self.start(start, RayType::Photon);
        }
        let Some(object) = self.parts.objects.get(start as usize) else {
            return false;
        };
        let interior = object.boundary.and_then(|boundary| boundary.interior);
        let fog = interior.map(|id| &self.parts.media.list[usize::from(id)]);
        !self.material(start as usize).is_specular() || fog.is_some_and(|fog| fog.scatters())
    }

    /// What has no effect.
    fn notes(&self, clauses: &[Clause]) -> Vec<Fault> {
        let mut notes = Vec::new();
        for (number, clause) in clauses.iter().enumerate() {
            if !clause.list.inverted && clause.list.listed.is_empty() {
                if !clause.ray_places.is_empty() {
                    let message = "nothing is listed: this rule has no effect";
                    notes.push(Fault::new(clause.place.clone(), message));
                }
                continue;
            }
            let before = &clauses[..number];
            for (ray, place) in clause.rays.iter().zip(&clause.ray_places) {
                if let Some(message) = self.without_effect(clause, before, *ray) {
                    notes.push(Fault::new(place.clone(), message));
                }
            }
        }
        notes
    }

    fn without_effect(&self, clause: &Clause, before: &[Clause], ray: RayType) -> Option<String> {
        let starts = 0..self.things as u32 + 2;
        let mut starts = starts.filter(|start| clause.starts.has(*start));
        let name = name_of(ray);
        if !starts.any(|start| self.start(start, ray)) {
            let message = format!("no {name} rays start there: no effect on them");
            return Some(match ray {
                RayType::Camera => format!("{message}; they start at the \"camera\""),
                _ => message,
            });
        }
        let only_lights = !clause.list.inverted
            && (clause.list.listed.iter()).all(|thing| *thing as usize >= self.objects);
        if ray == RayType::Photon && only_lights {
            let mut starts = (0..self.things as u32 + 2).filter(|s| clause.starts.has(*s));
            if !starts.any(|start| self.keeps_photons(start)) {
                return Some(
                    "photons leave nothing there, whatever light they come from: no effect on them"
                        .into(),
                );
            }
        }
        let meets = |thing: &u32| matches!(self.light(*thing), Some(LightKind::Environment(_)));
        match ray {
            RayType::Camera | RayType::Reflected | RayType::Refracted
                if only_lights && !clause.list.listed.iter().any(meets) =>
            {
                return Some(format!(
                    "{name} rays meet shapes and the environment, but no light of another kind: no effect on them"
                ));
            }
            _ => {}
        }
        let says_so = |other: &Clause| {
            other.includes == clause.includes
                && other.rays.contains(&ray)
                && other.list.covers(&clause.list)
                && (!clause.includes || clause.list.covers(&other.list))
                && other.starts.covers(&clause.starts)
        };
        let again = before.iter().any(says_so);
        again.then(|| format!("an earlier rule says the same of {name} rays"))
    }
}

/// Rough, and nothing else: gather rays from it are what is seen in it.
fn is_gloss(material: &Material) -> bool {
    !material.is_specular()
        && matches!(
            material.kind,
            MaterialKind::RoughConductor { .. } | MaterialKind::RoughDielectric { .. }
        )
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
