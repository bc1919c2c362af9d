//! A set of passes as disjoint half-open ranges.

use std::collections::BTreeMap;
use std::ops::Range;

/// Passes, held as the fewest ranges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Ranges {
    /// End by start. Disjoint, not adjacent, none empty.
    ends: BTreeMap<u64, u64>,
}

impl From<Range<u64>> for Ranges {
    fn from(range: Range<u64>) -> Self {
        let mut ranges = Self::default();
        ranges.insert(range);
        ranges
    }
}

impl Ranges {
    /// Add passes. Those already in the set stay.
    pub fn insert(&mut self, range: Range<u64>) {
        if range.is_empty() {
            return;
        }
        let Range { mut start, mut end } = range;
        // From the right: every range that touches.
        while let Some((&s, &e)) = self.ends.range(..=end).next_back() {
            if e < start {
                break;
            }
            start = start.min(s);
            end = end.max(e);
            self.ends.remove(&s);
        }
        self.ends.insert(start, end);
    }

    /// Remove passes. Those not in the set are ignored.
    pub fn remove(&mut self, range: Range<u64>) {
        if range.is_empty() {
            return;
        }
        while let Some((&s, &e)) = self.ends.range(..range.end).next_back() {
            if e <= range.start {
                break;
            }
            self.ends.remove(&s);
            if s < range.start {
                self.ends.insert(s, range.start);
            }
            if e > range.end {
                self.ends.insert(range.end, e);
            }
        }
    }

    /// Whether all of these passes are in the set.
    pub fn contains(&self, range: &Range<u64>) -> bool {
        let before = self.ends.range(..=range.start).next_back();
        before.is_some_and(|(_, end)| *end >= range.end)
    }

    /// The ranges, ascending.
    pub fn iter(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        self.ends.iter().map(|(start, end)| *start..*end)
    }

    /// Number of passes.
    pub fn count(&self) -> u64 {
        self.iter().map(|range| range.end - range.start).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use std::collections::BTreeSet;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(20), ..ProptestConfig::default() })]
        #[test]
        fn they_are_what_a_set_of_numbers_is(
            steps in prop::collection::vec((any::<bool>(), 0..40u64, 0..12u64), 0..60),
        ) {
            let mut ranges = Ranges::default();
            let mut set = BTreeSet::new();
            for (insert, start, length) in steps {
                let range = start..start + length;
                if insert {
                    ranges.insert(range.clone());
                    set.extend(range);
                } else {
                    ranges.remove(range.clone());
                    set.retain(|i| !range.contains(i));
                }
                prop_assert_eq!(ranges.iter().flatten().collect::<BTreeSet<_>>(), set.clone());
                prop_assert_eq!(ranges.count(), set.len() as u64);
                let ends: Vec<_> = ranges.iter().collect();
                prop_assert!(ends.windows(2).all(|w| w[0].end < w[1].start));
                for (a, b) in [(0, 3), (5, 6), (start, start + 4)] {
                    prop_assert_eq!(ranges.contains(&(a..b)), (a..b).all(|i| set.contains(&i)));
                }
            }
        }
    }
}
