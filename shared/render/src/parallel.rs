//! Work shared out among threads. The code that does this is long, and is compiled anew for each function that it is
//! given; so it gets one by reference here, or the shortest variant is taken.

use rayon::prelude::*;
use std::sync::OnceLock;

/// Call `work` for each number below `count`. Threads take one at a time: for work of microseconds and more.
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(work);
}

/// What `make` returns for each number below `count`, in order. Shared out as by [`each`].
pub fn map<T: Send + Sync>(count: usize, make: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let places: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
    each(count, &|i| {
        places[i].get_or_init(|| make(i));
    });
    places.into_iter().filter_map(OnceLock::into_inner).collect()
}

/// Collects many small things in order. `collect` would also compile the code for iterators of unknown length.
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
