//! Orders in which neighbours are alike.

use rayon::prelude::*;

/// Below this it is not worth the while to share the work out.
const MANY: usize = 4096;

/// Orders items so that every `part` of them, counted from the first, are near each other by their places: by halves, across where
/// they are widest. The parts in turn are ordered by parts of `finer(part)`, if there are any. Which items a part has
/// depends on nothing but places and `tie`, which no two have in common; their order within the last parts is any.
pub(super) fn arrange<T: Send, const N: usize>(
    items: &mut [T],
    part: usize,
    finer: fn(usize) -> Option<usize>,
    place: &(impl Fn(&T) -> [f32; N] + Sync),
    tie: &(impl Fn(&T) -> u64 + Sync),
) {
    let part = match items.len() <= part {
        false => part,
        true => match finer(items.len()) {
            Some(part) => part,
            None => return,
        },
    };
    let (mut min, mut max) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
    for item in &*items {
        for (k, x) in place(item).into_iter().enumerate() {
            (min[k], max[k]) = (min[k].min(x), max[k].max(x));
        }
    }
    let wider = |a: &usize, b: &usize| (max[*a] - min[*a]).total_cmp(&(max[*b] - min[*b]));
    let axis = (0..N).max_by(wider).unwrap_or(0);
    let middle = items.len().div_ceil(part).div_ceil(2) * part;
    items.select_nth_unstable_by(middle, |a, b| {
        let by_place = place(a)[axis].total_cmp(&place(b)[axis]);
        by_place.then_with(|| tie(a).cmp(&tie(b)))
    });
    let (low, high) = items.split_at_mut(middle);
    let mut halves = [low, high];
    let arrange = |half: &mut &mut [T]| arrange(half, part, finer, place, tie);
    match halves[0].len() > MANY {
        true => halves.par_iter_mut().for_each(arrange),
        false => halves.iter_mut().for_each(arrange),
    }
}
