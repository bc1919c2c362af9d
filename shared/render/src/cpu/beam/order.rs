//! Orders that put similar things next to each other.

/// Below this many, sharing the work among threads is not worthwhile.
const MANY: usize = 4096;

/// A position, and a direction scaled by how much it counts.
pub(super) type SortKey = [f32; 6];

struct Spot {
    place: SortKey,
    index: u32,
}

/// Sorts places into consecutive parts whose members are near each other, by halving at the widest axis. `finer`: the
/// size of the parts that a part of a given size is divided into, if it is divided further. Which places share a part
/// depends only on the places. Within the smallest parts, indices ascend.
pub(super) fn order(places: impl Iterator<Item = SortKey>, finer: fn(usize) -> Option<usize>) -> Vec<u32> {
    let spot = |(index, place)| Spot { place, index };
    let mut spots: Vec<Spot> = (0..).zip(places).map(spot).collect();
    let all = spots.len();
    divide(&mut spots, all, finer);
    spots.into_iter().map(|spot| spot.index).collect()
}

fn divide(spots: &mut [Spot], part: usize, finer: fn(usize) -> Option<usize>) {
    let part = match spots.len() <= part {
        false => part,
        true => match finer(spots.len()) {
            Some(part) => part,
            None => return spots.sort_unstable_by_key(|spot| spot.index),
        },
    };
    let (mut min, mut max) = ([f32::INFINITY; 6], [f32::NEG_INFINITY; 6]);
    for spot in &*spots {
        for k in 0..6 {
            min[k] = min[k].min(spot.place[k]);
            max[k] = max[k].max(spot.place[k]);
        }
    }
    let wider = |a: &usize, b: &usize| (max[*a] - min[*a]).total_cmp(&(max[*b] - min[*b]));
    let axis = (0..6).max_by(wider).unwrap_or(0);
    let middle = spots.len().div_ceil(part).div_ceil(2) * part;
    spots.select_nth_unstable_by(middle, |a, b| {
        let by_place = a.place[axis].total_cmp(&b.place[axis]);
        by_place.then(a.index.cmp(&b.index))
    });
    let (low, high) = spots.split_at_mut(middle);
    match low.len() > MANY {
        true => {
            rayon::join(|| divide(low, part, finer), || divide(high, part, finer));
        }
        false => {
            divide(low, part, finer);
            divide(high, part, finer);
        }
    }
}
