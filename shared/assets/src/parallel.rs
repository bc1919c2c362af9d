//! Loops over many small things, on all threads. What shares a loop out is long, and compiled anew for each function
//! that it is given: here it gets one that goes through a share of things, by reference, so that there is one for a
//! type.

use rayon::prelude::*;
use std::ops::Range;

/// Things that one thread goes through at once.
const SHARE: usize = 1 << 12;

/// The first of the numbers below `count` for which something holds.
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

/// Change so many things at once, which are told the number of the first of them.
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
