//! Discrete distributions as tables of running sums.

/// A choice from a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The entry.
    pub index: usize,
    /// Its probability, positive.
    pub pmf: f32,
    /// The remainder of the uniform number: uniform in [0, 1) again, minus the bits that the choice used.
    pub u: f32,
}

/// Running sums of the weights over their total: entry i is the probability of an index up to and including i.
/// Weights are not negative and sum to something positive.
pub(crate) fn running_sums(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let mut sums: Vec<f32> = weights
        .iter()
        .map(|w| {
            sum += w;
            (sum / total) as f32
        })
        .collect();
    // Trailing entries of weight zero share the last sum, so that rounding never makes one of them possible.
    let last = weights.iter().rposition(|&w| w > 0.0).unwrap_or(0);
    sums[last..].fill(1.0);
    sums
}

/// Probability of an entry.
#[inline]
pub(crate) fn pmf(sums: &[f32], index: usize) -> f32 {
    let below = if index == 0 { 0.0 } else { sums[index - 1] };
    sums[index] - below
}

/// Chooses an entry with its probability. `u` in [0, 1).
#[inline]
pub(crate) fn choose(sums: &[f32], u: f32) -> Choice {
    let index = sums.partition_point(|&sum| sum <= u).min(sums.len() - 1);
    let below = if index == 0 { 0.0 } else { sums[index - 1] };
    let pmf = sums[index] - below;
    Choice {
        index,
        pmf,
        u: ((u - below) / pmf).clamp(0.0, BELOW_ONE),
    }
}

/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_of_weight_zero_are_never_chosen() {
        let sums = running_sums(&[0.0, 1.0, 0.0, 3.0, 0.0]);
        assert_eq!(pmf(&sums, 0), 0.0);
        assert_eq!(pmf(&sums, 1), 0.25);
        assert_eq!(pmf(&sums, 2), 0.0);
        assert_eq!(pmf(&sums, 3), 0.75);
        assert_eq!(pmf(&sums, 4), 0.0);
        for (u, index, rest) in [
            (0.0, 1, 0.0),
            (0.125, 1, 0.5),
            (0.25, 3, 0.0),
            (0.625, 3, 0.5),
            (BELOW_ONE, 3, BELOW_ONE),
        ] {
            let choice = choose(&sums, u);
            assert_eq!(choice.index, index);
            assert_eq!(choice.pmf, pmf(&sums, index));
            assert!((choice.u - rest).abs() < 1e-6 && choice.u < 1.0);
        }
    }
}
