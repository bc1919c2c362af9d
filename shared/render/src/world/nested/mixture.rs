//! Surfaces between meeting solids, and sums of media.

use super::{MOST_ADDED, MediaSet, Meetings, Outcome};
use crate::math::{Rgb, mean};
use crate::world::description::SceneDescription;
use crate::world::medium::{Homogeneous, Medium};
use crate::world::phase::Phase;
use std::collections::BTreeSet;

/// Most sums of media.
const MOST_SUMS: usize = 1000;
/// Shares of phase functions closer than this count as equal.
const SAME_SHARE: f32 = 1e-3;

impl Meetings {
    /// Adds to a description the materials between objects, and the sums of its media.
    pub(in crate::world) fn complete(&mut self, description: &mut SceneDescription) {
        if self.is_empty() {
            return;
        }
        self.add_materials(description);
        let sets = self.sets(description);
        let is_rough = |set: &MediaSet| !self.add_sum(*set, description);
        let rough: Vec<MediaSet> = sets.into_iter().filter(is_rough).collect();
        self.doubt(&rough, description);
    }

    /// The surfaces of solids towards those that give way to them.
    fn add_materials(&mut self, description: &mut SceneDescription) {
        let ranks: Vec<u32> = self.members.iter().map(|member| member.rank).collect();
        let objects: Vec<u32> = self.members.iter().map(|member| member.object).collect();
        let material = |number: usize, description: &SceneDescription| {
            let object = &description.objects[objects[number] as usize];
            object.material
        };
        let mut made = std::collections::BTreeMap::new();
        for number in 0..self.members.len() {
            let member = &mut self.members[number];
            for partner in member.partners.iter_mut().filter(|_| !member.is_null) {
                let other = partner.member as usize;
                if ranks[other] > member.rank {
                    continue;
                }
                let pair = [number, other].map(|number| material(number, description));
                partner.material = *made.entry(pair).or_insert_with(|| {
                    let [own, outside] = pair.map(|material| &description.materials[material as usize]);
                    let between = match outside.index_inside() {
                        Some(index) => own.against(&index),
                        None => own.clone(),
                    };
                    let added = description.materials.len() as u32;
                    description.materials.push(between);
                    if let Some(name) = description.material_names.get(&pair[0]).cloned() {
                        description.material_names.insert(added, name);
                    }
                    added
                });
            }
        }
    }

    /// Sets of two or more media whose members all meet each other and add up.
    fn sets(&self, description: &SceneDescription) -> BTreeSet<MediaSet> {
        let medium = |number: u32| {
            let object = &description.objects[self.members[number as usize].object as usize];
            object.boundary.and_then(|boundary| boundary.interior)
        };
        let adds = |one: u32, other: u32| {
            let member = &self.members[one as usize];
            let meets = member.partners.iter().any(|partner| partner.member == other);
            member.is_null && meets && member.rank == self.members[other as usize].rank
        };
        let mut sets = BTreeSet::new();
        let mut cliques: Vec<Vec<u32>> = (0..self.members.len() as u32).map(|number| vec![number]).collect();
        while let Some(clique) = cliques.pop() {
            if sets.len() >= MOST_SUMS {
                break;
            }
            if clique.len() > 1 {
                sets.extend(set(clique.iter().filter_map(|number| medium(*number))));
            }
            if clique.len() < MOST_ADDED {
                let partners = self.members[clique[0] as usize]
                    .partners
                    .iter()
                    .map(|partner| partner.member);
                let more = partners.filter(|next| clique.iter().all(|number| number < next && adds(*number, *next)));
                cliques.extend(more.map(|next| [&clique[..], &[next]].concat()));
            }
        }
        sets
    }

    /// Returns whether the sum's phase function is exact.
    fn add_sum(&mut self, set: MediaSet, description: &mut SceneDescription) -> bool {
        let media: Vec<Homogeneous> = parts(&set, description).collect();
        let number = description.media.len();
        let Some(number) = u16::try_from(number).ok().filter(|number| *number < u16::MAX) else {
            return false;
        };
        let (sum, is_exact) = sum(&media);
        description.media.push(Medium::Homogeneous(sum));
        let numbers = set.iter().filter(|id| **id != u16::MAX);
        let names: Vec<&str> = numbers
            .filter_map(|id| description.media_names.get(usize::from(*id)))
            .map(String::as_str)
            .collect();
        let name = names.join(" + ");
        if description.media_names.len() + 1 == description.media.len() {
            description.media_names.push(name);
        }
        // For rules it counts as the first of them.
        if let Some(rules) = &mut description.rules {
            let (first, lights) = (usize::from(set[0]), rules.of_light.len());
            rules.of_medium.push(rules.of_medium[first]);
            rules.unlit.extend_from_within(first * lights..(first + 1) * lights);
        }
        self.sums.insert(set, number);
        is_exact
    }

    /// Marks the meetings whose sum has an inexact phase function.
    fn doubt(&mut self, rough: &[MediaSet], description: &SceneDescription) {
        for met in &mut self.met {
            if let Outcome::AddUp { is_exact } = &mut met.outcome {
                let media = met.pair.map(|object| {
                    let boundary = description.objects[object as usize].boundary;
                    boundary.and_then(|boundary| boundary.interior)
                });
                let has_both = |set: &MediaSet| {
                    let asked = |id: &&u16| media.contains(&Some(**id));
                    set.iter().filter(asked).count() > 1 && media.iter().flatten().all(|id| set.contains(id))
                };
                *is_exact = !rough.iter().any(has_both);
            }
        }
    }

    /// The medium that is the sum of several; if that sum does not exist, the first of them.
    pub(super) fn sum_of(&self, media: impl Iterator<Item = u16> + Clone) -> Option<u16> {
        let first = media.clone().next();
        let summed = set(media).and_then(|set| self.sums.get(&set)).copied();
        summed.or(first)
    }
}

/// Sums of media, and their parts.
impl Meetings {
    pub(in crate::world) fn sums(&self) -> impl Iterator<Item = (u16, impl Iterator<Item = u16>)> {
        let parts = |set: &MediaSet| set.iter().copied().filter(|id| *id != u16::MAX).collect::<Vec<_>>();
        self.sums.iter().map(move |(set, sum)| (*sum, parts(set).into_iter()))
    }
}

/// Several media, in order; `None` for a single one.
fn set(media: impl Iterator<Item = u16>) -> Option<MediaSet> {
    let mut set = [u16::MAX; MOST_ADDED];
    let mut count = 0;
    for (place, medium) in set.iter_mut().zip(media) {
        *place = medium;
        count += 1;
    }
    set.sort_unstable();
    (count > 1).then_some(set)
}

fn parts<'a>(set: &'a MediaSet, description: &'a SceneDescription) -> impl Iterator<Item = Homogeneous> + 'a {
    let media = set.iter().filter_map(|id| description.media.get(usize::from(*id)));
    media.filter_map(|medium| match medium {
        Medium::Homogeneous(medium) => Some(*medium),
        Medium::Heterogeneous(_) => None,
    })
}

/// A medium with the summed scattering and absorption. Its phase function has two lobes; the flag says whether they
/// equal the mean of the parts' phase functions, weighted by scattering, in all colours.
fn sum(media: &[Homogeneous]) -> (Homogeneous, bool) {
    let of = |part: fn(&Homogeneous) -> Rgb| media.iter().map(part).sum::<Rgb>();
    let (sigma_a, sigma_s) = (of(|medium| medium.sigma_a), of(|medium| medium.sigma_s));
    // Scattering by mean cosine.
    let mut lobes: Vec<(f32, Rgb)> = Vec::new();
    for medium in media.iter().filter(|medium| medium.scatters()) {
        let (weight, g) = match medium.phase {
            Phase::Isotropic => (0.0, [0.0; 2]),
            Phase::HenyeyGreenstein { g } => (0.0, [g; 2]),
            Phase::Blend { weight, g } => (weight, g),
        };
        for (share, g) in [1.0 - weight, weight]
            .into_iter()
            .zip(g)
            .filter(|(share, _)| *share > 0.0)
        {
            match lobes.iter_mut().find(|lobe| lobe.0 == g) {
                Some(lobe) => lobe.1 += medium.sigma_s * share,
                None => lobes.push((g, medium.sigma_s * share)),
            }
        }
    }
    lobes.sort_by(|one, other| one.0.total_cmp(&other.0));
    let is_pair = lobes.len() <= 2;
    let middle = weighted(&lobes).map_or(0.0, |(g, _)| g);
    let split = match is_pair {
        true => lobes.len().min(1),
        false => lobes.partition_point(|lobe| lobe.0 <= middle),
    };
    let (low, high) = lobes.split_at(split);
    let phase = match (weighted(low), weighted(high)) {
        (Some((g, a)), Some((other, b))) => Phase::blend(mean(b) / mean(a + b), [g, other]),
        (Some((g, _)), None) | (None, Some((g, _))) => Phase::blend(0.0, [g; 2]),
        (None, None) => Phase::Isotropic,
    };
    let is_grey = weighted(high).is_none_or(|(_, high)| {
        let shares = (0..3).filter(|c| sigma_s[*c] > 0.0).map(|c| high[c] / sigma_s[c]);
        let (least, most) = shares.fold((1.0_f32, 0.0_f32), |(least, most), share| {
            (least.min(share), most.max(share))
        });
        most - least < SAME_SHARE
    });
    let sum = Homogeneous {
        sigma_a,
        sigma_s,
        phase,
    };
    (sum, is_pair && (is_grey || lobes.len() < 2))
}

/// The mean of lobes, and their total scattering.
fn weighted(lobes: &[(f32, Rgb)]) -> Option<(f32, Rgb)> {
    let all: Rgb = lobes.iter().map(|lobe| lobe.1).sum();
    let g = match lobes {
        [] => return None,
        [(g, _)] => *g,
        _ => lobes.iter().map(|lobe| lobe.0 * mean(lobe.1)).sum::<f32>() / mean(all),
    };
    Some((g, all))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fog(sigma_s: [f32; 3], phase: Phase) -> Homogeneous {
        Homogeneous {
            sigma_a: Rgb::splat(0.5),
            sigma_s: sigma_s.into(),
            phase,
        }
    }

    #[test]
    fn sums_scatter_as_both_do() {
        let forward = Phase::HenyeyGreenstein { g: 0.8 };
        let media = [fog([1.0; 3], Phase::Isotropic), fog([3.0; 3], forward)];
        let (both, is_exact) = sum(&media);
        assert!(is_exact);
        assert_eq!((both.sigma_a, both.sigma_s), (Rgb::splat(1.0), Rgb::splat(4.0)));
        for cos in [-1.0, -0.3, 0.0, 0.6, 1.0] {
            let expected = 0.25 * media[0].phase.eval(cos) + 0.75 * media[1].phase.eval(cos);
            assert!((both.phase.eval(cos) / expected - 1.0).abs() < 1e-5);
        }
        // Duplicates and pure absorbers change nothing.
        let dark = fog([0.0; 3], Phase::Isotropic);
        let (twice, is_exact) = sum(&[media[1], media[1], dark]);
        assert!(is_exact && twice.phase == forward && twice.sigma_s == Rgb::splat(6.0));
    }

    #[test]
    fn what_two_lobes_cannot_be_is_told() {
        let of = |g: f32| Phase::HenyeyGreenstein { g };
        let (blue, is_exact) = sum(&[fog([0.0, 0.0, 1.0], of(0.5)), fog([1.0; 3], of(-0.5))]);
        assert!(!is_exact);
        assert!((blue.phase.mean_cosine() + 0.25).abs() < 1e-6);
        let (three, is_exact) = sum(&[0.9, 0.1, -0.4].map(|g| fog([1.0; 3], of(g))));
        assert!(!is_exact);
        assert!((three.phase.mean_cosine() - 0.2).abs() < 1e-6);
    }
}
