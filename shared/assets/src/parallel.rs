//! Parallel loops over many small things. The splitting code is long and compiled for every function passed to it. Here
//! it receives one function per type, by reference, that processes a whole share, so that it is compiled once per type.

use rayon::prelude::*;
use std::ops::Range;

/// Things per share.
const SHARE: usize = 1 << 12;

/// The first number below `count` for which `holds` is true.
pub fn first(count: usize, holds: impl Fn(usize) -> bool + Sync) -> Option<usize> {
    first_within(count, &|mut share| share.find(|i| holds(*i)))
}

fn first_within(count: usize, find: &(dyn Fn(Range<usize>) -> Option<usize> + Sync)) -> Option<usize> {
    let shares = (0..count.div_ceil(SHARE)).into_par_iter();
    shares.find_map_first(|share| find(share * SHARE..count.min((share + 1) * SHARE)))
}

/// Change each thing.
pub fn change<T: Send>(things: &mut [T], change: impl Fn(&mut T) + Sync) {
    change_shares(things, SHARE, &|_, share| share.iter_mut().for_each(&change));
}

/// Change `share` things at a time; `change` also gets the number of the first.
pub fn change_shares<T: Send>(things: &mut [T], share: usize, change: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let shares = things.par_chunks_mut(share.max(1)).enumerate();
    shares.for_each(|(i, things)| change(i * share, things));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_is_found() {
        for at in [0, 5, SHARE - 1, SHARE, 3 * SHARE + 7] {
            assert_eq!(first(4 * SHARE, |i| i >= at), Some(at));
            assert_eq!(first(at, |i| i >= at), None);
        }
    }

    #[test]
    fn all_are_changed_once() {
        let mut things: Vec<usize> = (0..2 * SHARE + 3).collect();
        change(&mut things, |thing| *thing += 1);
        change_shares(&mut things, 100, &|first, things| {
            for (i, thing) in (first..).zip(things) {
                assert_eq!(*thing, i + 1);
                *thing += 1;
            }
        });
        assert!(things.iter().enumerate().all(|(i, thing)| *thing == i + 2));
    }
}
