//! Large numbers of items with the same box. A tree builder that pairs neighbours finds no nearest ones among them: it
//! takes quadratic time, and the tree gets as deep as there are items.

use super::item::Item;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::{Boundable, aabb::Aabb};
use std::collections::{BTreeMap, BTreeSet};

/// Least number of items with one box that form a crowd.
const CROWD: usize = 1 << 10;

fn bits(thing: &impl Boundable) -> [u32; 6] {
    let Aabb { min, max } = thing.aabb();
    [min.x, min.y, min.z, max.x, max.y, max.z].map(f32::to_bits)
}

/// For each crowd, the ascending numbers of its items.
pub(super) fn crowds(things: &[impl Boundable]) -> Vec<Vec<u32>> {
    // Usually there are none, which counting by part of the bits shows quickly.
    let place = |bits: [u32; 6]| {
        let mixed = bits
            .iter()
            .fold(0u64, |sum, x| (sum ^ u64::from(*x)).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        (mixed >> 48) as usize
    };
    if things.len() < CROWD {
        return Vec::new();
    }
    let mut counts = vec![0u32; 1 << 16];
    for thing in things {
        counts[place(bits(thing))] += 1;
    }
    if counts.iter().all(|count| (*count as usize) < CROWD) {
        return Vec::new();
    }
    let mut by_box: BTreeMap<[u32; 6], Vec<u32>> = BTreeMap::new();
    for (number, thing) in (0..).zip(things) {
        let bits = bits(thing);
        if counts[place(bits)] as usize >= CROWD {
            by_box.entry(bits).or_default().push(number);
        }
    }
    by_box.into_values().filter(|crowd| crowd.len() >= CROWD).collect()
}

/// The items without repeated triangles in crowds (same object, same corners): rays hit the first.
pub(super) fn without_repeats(items: Vec<Item>) -> Vec<Item> {
    let mut is_repeat = Vec::new();
    for crowd in crowds(&items) {
        is_repeat.resize(items.len(), false);
        let mut known = BTreeSet::new();
        for number in crowd {
            if let Item::Triangle(id, corners) = &items[number as usize] {
                let corners = corners.map(|corner| corner.to_array().map(f32::to_bits));
                is_repeat[number as usize] = !known.insert((id.object, corners));
            }
        }
    }
    if is_repeat.is_empty() {
        return items;
    }
    let kept = items.into_iter().zip(is_repeat).filter(|(_, is_repeat)| !is_repeat);
    kept.map(|(item, _)| item).collect()
}

/// The tree that `build` makes when each crowd counts as one item; crowds are then halved recursively.
pub(super) fn apart<T: Boundable>(things: &[T], build: impl Fn(&[Aabb]) -> Bvh2) -> Option<Bvh2> {
    let crowds = crowds(things);
    if crowds.is_empty() {
        return None;
    }
    let mut is_in_crowd = vec![false; things.len()];
    crowds
        .iter()
        .flatten()
        .for_each(|number| is_in_crowd[*number as usize] = true);
    let alone = (0..things.len() as u32).filter(|number| !is_in_crowd[*number as usize]);
    let groups: Vec<Vec<u32>> = alone.map(|number| vec![number]).chain(crowds).collect();
    let boxes: Vec<Aabb> = groups.iter().map(|group| things[group[0] as usize].aabb()).collect();
    let mut tree = build(&boxes);
    let of_leaf = std::mem::take(&mut tree.primitive_indices);
    let mut waiting: Vec<(usize, &[u32])> = Vec::new();
    for (index, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.is_leaf()) {
        waiting.push((index, &groups[of_leaf[node.first_index as usize] as usize]));
    }
    while let Some((index, group)) = waiting.pop() {
        let bounds = *tree.nodes[index].aabb();
        if let [number] = group {
            tree.nodes[index] = Bvh2Node::new(bounds, 1, tree.primitive_indices.len() as u32);
            tree.primitive_indices.push(*number);
            continue;
        }
        let first = tree.nodes.len();
        tree.nodes[index] = Bvh2Node::new(bounds, 0, first as u32);
        tree.nodes.extend([Bvh2Node::new(bounds, 1, 0); 2]);
        let (low, high) = group.split_at(group.len() / 2);
        waiting.extend([(first, low), (first + 1, high)]);
    }
    Some(tree)
}
