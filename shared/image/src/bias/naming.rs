//! Which of many tiles have a bias, with few named falsely.

/// Largest expected share of falsely named tiles: a twentieth, with room for what is not known about the noise.
const FALSE_SHARE: f64 = 0.04;

/// The p-value of a tile from those of its channels: small if one channel has a bias, and no larger if all have the
/// same one (Simes 1986).
pub(super) fn joint_p_value<const N: usize>(mut p_values: [f64; N]) -> f64 {
    p_values.sort_by(f64::total_cmp);
    let ranked = p_values.iter().zip(1u32..);
    let scaled = ranked.map(|(p, rank)| p * N as f64 / f64::from(rank));
    scaled.fold(1.0, f64::min)
}

/// Which of these hypotheses of no bias to reject.
///
/// Takes the largest threshold that keeps the expected share of false rejections (Benjamini and Hochberg 1995). The
/// number of true hypotheses is estimated from p-values above that share (Storey, Taylor and Siegmund 2004); with so
/// low a limit, the share is kept even if all tiles have the same noise (Blanchard and Roquain 2009).
pub(super) fn are_named(p_values: &[f64]) -> Vec<bool> {
    let count = p_values.len() as f64;
    let above = p_values.iter().filter(|p| **p > FALSE_SHARE).count() as f64;
    let without = ((1.0 + above) / (1.0 - FALSE_SHARE)).min(count);
    let mut sorted = p_values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let kept = |(p, rank): &(&f64, u32)| **p * without <= FALSE_SHARE * f64::from(*rank);
    let threshold = sorted.iter().zip(1u32..).filter(kept).last();
    let is_named = |p: &f64| threshold.is_some_and(|(threshold, _)| p <= threshold);
    p_values.iter().map(is_named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn uniform(rng: &mut Pcg64Mcg) -> f64 {
        (rng.next_u64() >> 11) as f64 * (-53f64).exp2()
    }

    #[test]
    fn one_channel_is_enough_and_equal_ones_are_one() {
        assert_eq!(joint_p_value([0.01; 4]), 0.01);
        assert_eq!(joint_p_value([1.0, 0.01, 1.0, 1.0]), 0.04);
        assert_eq!(joint_p_value([1.0; 4]), 1.0);
    }

    /// Half of 20 hypotheses are false, with p-values about as small as the share, or none are.
    #[test]
    fn the_share_of_false_names_is_kept() {
        let mut rng = Pcg64Mcg::seed_from_u64(0);
        for biased in [0, 10] {
            let runs = 20_000u64;
            let shares = (0..runs).map(|_| {
                let p = |i: usize| {
                    let u = uniform(&mut rng);
                    if i < biased { u * u * u * u } else { u }
                };
                let named = are_named(&(0..20).map(p).collect::<Vec<_>>());
                let wrong = named[biased..].iter().filter(|n| **n).count();
                let all = named.iter().filter(|n| **n).count();
                wrong as f64 / all.max(1) as f64
            });
            let share = shares.sum::<f64>() / runs as f64;
            // Five standard errors of the share.
            let slack = 5.0 * (FALSE_SHARE / runs as f64).sqrt();
            assert!(share < FALSE_SHARE + slack, "{biased}: {share}");
            assert!(share > 0.5 * FALSE_SHARE, "{biased}: {share}");
        }
    }

    #[test]
    fn noise_that_all_share_names_no_more() {
        let runs = 20_000u64;
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let named = (0..runs).filter(|_| are_named(&[uniform(&mut rng); 16])[0]);
        let share = named.count() as f64 / runs as f64;
        assert!(share < FALSE_SHARE + 0.008, "{share}");
    }
}
