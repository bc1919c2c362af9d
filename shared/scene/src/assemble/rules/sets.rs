//! What rays do not see, class by class.

use super::{Clause, Listed, Resolver, name_of};
use crate::parse::Fault;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::rules::{HiddenSet, MANY_KINDS, ObjectSets, RayType, Rules};
use std::collections::BTreeMap;
use std::ops::Range;

/// A partition of things into classes that no list splits.
struct Partition {
    class: Vec<u32>,
    /// One member of each class.
    members: Vec<u32>,
}

impl Partition {
    fn new<'s>(count: usize, lists: impl Iterator<Item = &'s Listed>) -> Self {
        let mut class = vec![0; count];
        let mut fresh = 1u32;
        for list in lists {
            // Listed members leave their class.
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

/// Bit rows, each stored once.
struct Rows {
    words: usize,
    all: Vec<u32>,
    known: BTreeMap<Vec<u32>, u32>,
}

impl Rows {
    fn set(&mut self, row: Vec<u32>) -> HiddenSet {
        let at = self.all.len() as u32;
        let first = row[0];
        let set = *self.known.entry(row.clone()).or_insert(at);
        if set == at {
            self.all.extend(row);
        }
        HiddenSet { row: set, first }
    }

    fn row(&self, set: HiddenSet) -> &[u32] {
        &self.all[set.row as usize..][..self.words]
    }

    fn masked(&self, set: HiddenSet, mask: &[u32]) -> Vec<u32> {
        let both = self.row(set).iter().zip(mask).map(|(a, b)| a & b);
        both.collect()
    }
}

impl Resolver<'_> {
    /// Whether an include list restricts which objects, and which lights, are seen.
    fn restricts(&self, list: &Listed, ray: RayType) -> [bool; 2] {
        if list.inverted {
            return [false; 2];
        }
        let to_lights = matches!(ray, RayType::Shadow | RayType::Photon);
        let is_object = |thing: &u32| match self.parts.objects.get(*thing as usize) {
            // To shadow rays and photons, an emitting shape is a light.
            Some(object) => !to_lights || object.light.is_none(),
            None => false,
        };
        let is_light = |thing: &u32| match self.light(*thing) {
            Some(LightKind::Area { .. }) => to_lights,
            Some(_) => true,
            None => false,
        };
        [list.listed.iter().any(is_object), list.listed.iter().any(is_light)]
    }

    /// Which classes rays of a type do not see under these rules.
    fn hidden(&self, clauses: &[&Clause], ray: RayType, things: &Partition) -> Result<Vec<u32>, Fault> {
        let mut row = vec![0; things.members.len().div_ceil(32)];
        let clauses = clauses.iter().filter(|clause| clause.rays.contains(&ray));
        let (includes, excludes): (Vec<&Clause>, Vec<&Clause>) = clauses.copied().partition(|clause| clause.includes);
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

    /// Classes of objects and lights that no rule tells apart.
    fn classes(&self, clauses: &[Clause]) -> Partition {
        let lights = Listed {
            listed: (self.objects as u32..self.things as u32).collect(),
            inverted: false,
        };
        let lists = clauses.iter().map(|clause| &clause.list);
        Partition::new(self.things, lists.chain([&lights]))
    }

    pub fn rules(&self, clauses: &[Clause]) -> Result<Option<Rules>, Fault> {
        let things = self.classes(clauses);
        let starts = clauses.iter().map(|clause| &clause.starts);
        let starts = Partition::new(self.things + 2, starts);
        let words = things.members.len().div_ceil(32).max(1);
        let mut rows = Rows {
            words,
            all: Vec::new(),
            known: BTreeMap::new(),
        };
        let nothing = rows.set(vec![0; words]);
        // Indexed by class of start and ray type.
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
        // An inverted list of starts concerns where shadow rays start, not the lights they go to.
        let mut of_named = Vec::new();
        for &start in &starts.members {
            let names_it = |clause: &&Clause| !clause.starts.inverted && clause.starts.has(start);
            let here: Vec<&Clause> = clauses.iter().filter(names_it).collect();
            let mut row = self.hidden(&here, RayType::Shadow, &things)?;
            row.resize(words, 0);
            of_named.push(rows.set(row));
        }
        let lights = self.objects..self.things;
        let shadow_of_light = lights.map(|light| of_named[starts.class[light] as usize]);
        let shadow_of_light: Vec<_> = shadow_of_light.collect();
        let of_light = (self.objects..self.things).map(|light| set(light as u32, RayType::Photon));
        let (of_object, of_light): (Vec<_>, Vec<_>) = (of_object.collect(), of_light.collect());
        let camera = set(self.camera(), RayType::Camera);
        let of_medium = self.of_media(clauses, &set)?;
        let is_nothing = |set: &HiddenSet| *set == nothing;
        let touches_photons = !of_object.iter().all(|sets| is_nothing(&sets.photon))
            || !of_light.iter().chain(&of_medium).all(is_nothing);
        let has_effect = touches_photons
            || camera != nothing
            || !shadow_of_light.iter().all(is_nothing)
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
            shadow_of_light,
            of_medium,
            unlit: Vec::new(),
            light_kinds: self.light_kinds(&things),
            gather: nothing,
            paths_obey: false,
            rules: clauses.len(),
            touches_photons,
        };
        self.balance(&mut rules, &mut rows, &things);
        rules.rows = rows.all;
        rules.unlit = self.unlit(&rules);
        Ok(Some(rules))
    }

    /// Where rules that hide something from photons are written.
    pub fn photon_places(&self, clauses: &[Clause]) -> Result<Vec<Range<usize>>, Fault> {
        let things = self.classes(clauses);
        let mut places = Vec::new();
        for clause in clauses {
            let hidden = self.hidden(&[clause], RayType::Photon, &things)?;
            if hidden.iter().any(|word| *word != 0) {
                places.push(clause.place.clone());
            }
        }
        Ok(places)
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

    /// What photons scattered in a medium do not see: the same as photons from the objects that it fills.
    fn of_media(&self, clauses: &[Clause], set: &impl Fn(u32, RayType) -> HiddenSet) -> Result<Vec<HiddenSet>, Fault> {
        let media = self.parts.media.list.iter().enumerate();
        let of_medium = |(number, medium): (usize, &beamfarm_render::world::medium::Medium)| {
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
                    clause.rays.contains(&RayType::Photon) && clause.starts.has(owners[0]) != clause.starts.has(*other)
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

    /// Which lights gather rays find, and which photons find: see `beamfarm_render::world::rules`.
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
        // The first of equally frequent ones.
        let most = tally.iter().rev().max_by_key(|(_, count)| **count);
        let common = most.map_or_else(|| vec![0; rows.words], |(row, _)| row.clone());
        let is_passed = |class: usize| common[class / 32] >> (class % 32) & 1 == 1;
        let everything = vec![!0; rows.words];
        let mut whole = rules.of_object.iter().enumerate();
        let whole = whole.find(|(number, _)| !is_passed(things.class[*number] as usize));
        let whole = whole.map_or_else(|| common.clone(), |(_, sets)| rows.masked(sets.photon, &everything));
        let is_hidden = |light: usize| {
            let class = things.class[self.objects + light] as usize;
            whole[class / 32] >> (class % 32) & 1 == 1
        };
        let mut objects_obey = rules.of_object.iter().enumerate();
        let mut lights_obey = rules.of_light.iter().enumerate();
        rules.paths_obey = objects_obey.all(|(number, sets)| {
            is_passed(things.class[number] as usize) || rows.masked(sets.photon, &everything) == whole
        }) && lights_obey
            .all(|(light, set)| is_hidden(light) || rows.masked(*set, &objects) == common)
            && (rules.of_medium.iter()).all(|set| rows.masked(*set, &everything) == whole)
            && objects.iter().zip(&whole).zip(&common).all(|((o, w), c)| o & w == *c);
        rules.gather = rows.set(match rules.paths_obey {
            true => whole.clone(),
            false => common.clone(),
        });
        let none = |row: Vec<u32>| row.iter().all(|word| *word == 0);
        let paths_obey = rules.paths_obey;
        for (number, sets) in rules.of_object.iter_mut().enumerate() {
            let class = things.class[number] as usize;
            let is_passed = common[class / 32] >> (class % 32) & 1 == 1;
            sets.is_gathered = !is_passed && rows.masked(sets.photon, &objects) == common;
            let knows_lights = rules.light_kinds.1.len() < MANY_KINDS;
            sets.gathers = !is_passed && (knows_lights || none(rows.masked(sets.photon, &lights)));
            sets.one_ray = rows.masked(sets.shadow, &objects) == common;
            // Gather rays from its rough lobe produce the visible reflection.
            let has_gloss = self.material(number).has(BsdfFlags::ROUGH);
            let differs = |set: HiddenSet| {
                let is_like_others = paths_obey && rows.masked(set, &everything) == whole;
                set.row != 0 && !is_like_others
            };
            sets.is_glossy = has_gloss && (differs(sets.reflected) || differs(sets.refracted));
        }
    }

    /// Each light's class number, and the class for each number.
    fn light_kinds(&self, things: &Partition) -> (Vec<u8>, Vec<u32>) {
        let mut classes = Vec::new();
        let kind = |class: &u32| {
            let known = classes.iter().position(|known| known == class);
            let kind = known.unwrap_or_else(|| {
                classes.push(*class);
                classes.len() - 1
            });
            u8::try_from(kind).unwrap_or(u8::MAX)
        };
        let kinds = things.class[self.objects..].iter().map(kind).collect();
        classes.truncate(MANY_KINDS);
        (kinds, classes)
    }

    fn unlit(&self, rules: &Rules) -> Vec<bool> {
        let world = self.parts.world_medium.map(usize::from);
        let mut unlit = Vec::new();
        for (medium, &set) in rules.of_medium.iter().enumerate() {
            let owners: Vec<usize> = self.filled_by(medium).collect();
            for (light, &photons) in rules.of_light.iter().enumerate() {
                // Photons that pass through the object unseen do not enter its medium.
                let passes = |owner: &usize| rules.hides(photons, *owner as u32);
                let is_passed = world != Some(medium) && !owners.is_empty() && owners.iter().all(passes);
                unlit.push(is_passed || rules.hides_light(set, light));
            }
        }
        unlit
    }
}
