//! Work that is shared out among threads. What does that is long, and compiled anew for each function that it is given;
//! here it gets one by reference, or the shortest of its ways is taken.

use rayon::prelude::*;
use std::sync::OnceLock;

/// Do something for each number below `count`, of which threads take one at a time: for work of microseconds and more.
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(work);
}

/// What is made of each number below `count`, in their order; as [`each`].
pub fn map<T: Send + Sync>(count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let places: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
    each(count, &|i| {
        places[i].get_or_init(|| make(i));
    });
    places.into_iter().filter_map(OnceLock::into_inner).collect()
}

/// Many small things. `collect` would bring, beside this, what it takes where their number is not known.
pub fn collected<T: Send>(things: impl IndexedParallelIterator<Item = T>) -> Vec<T> {
    let mut all = Vec::new();
    things.collect_into_vec(&mut all);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_kept() {
        let expected: Vec<String> = (0..1000).map(|i| format!("{i}")).collect();
        assert_eq!(map(1000, |i| format!("{i}")), expected);
        assert_eq!(
            collected((0..1000usize).into_par_iter().map(|i| format!("{i}"))),
            expected
        );
        assert!(map(0, |i| i).is_empty());
    }
}
