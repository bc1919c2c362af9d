//! The tree sum gives the same bits however passes arrive, and its error estimate is one.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, MAX_PASSES};
use beamfarm_image::layer::LayerCounts;
use beamfarm_image::merge::{Average, MAX_RADIANCE, MergeError, Node, REPLICATION, TreeSum, next_boundary};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// SplitMix64 (Steele et al. 2014): enough randomness for a test, addressed by a counter.
fn hash(seed: u64, counter: u64) -> u64 {
    let mut z = seed.wrapping_add((counter + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform in [0, 1).
fn uniform(seed: u64, counter: u64) -> f32 {
    (hash(seed, counter) >> 40) as f32 / (1u64 << 24) as f32
}

/// A film of 2 x 1 pixels whose values span many magnitudes, so that any other order of additions rounds differently.
fn pass_film(seed: u64, pass: u64) -> Film {
    let mut film = Film::new(2, 1);
    for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
        let u = hash(seed, 8 * pass + i as u64);
        let exponent = 127 + (u >> 32) % 12 - 6;
        *value = f32::from_bits((u as u32 & 0x807f_ffff) | (exponent as u32) << 23);
    }
    film
}

/// A block's node, from its passes alone.
fn block_node(seed: u64, block: Block) -> Node {
    if block.level == 0 {
        let leaf = Node::leaf(block.index, pass_film(seed, block.index));
        return leaf.with_radius_scale(1.0 / (block.index + 1) as f64);
    }
    let child = |side| Block {
        level: block.level - 1,
        index: 2 * block.index + side,
    };
    Node::join(block_node(seed, child(0)), block_node(seed, child(1))).unwrap()
}

/// The definition, one channel at a time: the tree over leaves 0..passes, those beyond it left out.
fn reference(leaves: &[f32], block: Block) -> Option<(f32, f32)> {
    let leaf = |i: u64| leaves.get(usize::try_from(i).ok()?).copied();
    if block.level == 0 {
        return Some((leaf(block.index)?, 0.0));
    }
    let child = |side| Block {
        level: block.level - 1,
        index: 2 * block.index + side,
    };
    let left = reference(leaves, child(0))?;
    let Some(right) = reference(leaves, child(1)) else {
        return Some(left);
    };
    // Neighbouring passes, and neighbouring replications where both are complete, or halves of one.
    let is_complete = block.passes().end <= leaves.len() as u64;
    let mut replication = REPLICATION;
    while 16 * replication <= block.start() {
        replication *= 2;
    }
    let differ = block.level == 1 || is_complete && (32..=2 * replication).contains(&block.len());
    let difference = match differ {
        true => (left.0 - right.0) * (left.0 - right.0),
        false => left.1 + right.1,
    };
    Some((left.0 + right.0, difference))
}

fn bits(film: &Film) -> Vec<u32> {
    film.pixels.iter().flatten().map(|v| v.to_bits()).collect()
}

fn assert_is_reference(average: &Average, seed: u64, passes: u64) {
    assert_eq!(average.passes, passes);
    let films: Vec<Film> = (0..passes).map(|pass| pass_film(seed, pass)).collect();
    let pairs = passes - passes % 2;
    for pixel in 0..2 {
        for c in 0..3 {
            let leaves: Vec<f32> = films.iter().map(|film| film.pixels[pixel][c]).collect();
            let (sum, difference) = reference(&leaves, Block { level: 40, index: 0 }).unwrap();
            let mean = (f64::from(sum) / passes as f64) as f32;
            assert_eq!(average.beauty.pixels[pixel][c].to_bits(), mean.to_bits());
            let error = average.standard_error.pixels[pixel][c];
            if pairs == 0 {
                assert_eq!(error, f32::INFINITY);
            } else {
                let variance = f64::from(difference) / (passes as f64 * pairs as f64);
                assert_eq!(error.to_bits(), (variance.sqrt() as f32).to_bits());
            }
        }
    }
}

/// Passes 0..passes as aligned blocks of random sizes, in random order.
fn random_blocks(passes: u64, seed: u64) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut stack = vec![Block { level: 10, index: 0 }];
    let mut counter = 0;
    while let Some(block) = stack.pop() {
        if block.start() >= passes {
            continue;
        }
        counter += 1;
        let whole = block.passes().end <= passes;
        if whole && (block.level == 0 || hash(seed, counter).is_multiple_of(3)) {
            blocks.push(block);
        } else {
            stack.extend([0, 1].map(|side| Block {
                level: block.level - 1,
                index: 2 * block.index + side,
            }));
        }
    }
    for i in (1..blocks.len()).rev() {
        blocks.swap(i, (hash(!seed, i as u64) % (i as u64 + 1)) as usize);
    }
    blocks
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(20), ..ProptestConfig::with_cases(300) })]

    #[test]
    fn any_split_and_order_gives_the_same_bits(passes in 1u64..=600, seed: u64) {
        let mut sum = TreeSum::new(2, 1);
        let mut arrived = vec![false; passes as usize];
        for block in random_blocks(passes, seed) {
            sum.insert(block_node(seed, block)).unwrap();
            for pass in block.passes() {
                arrived[pass as usize] = true;
            }
            let prefix = arrived.iter().take_while(|there| **there).count() as u64;
            prop_assert_eq!(sum.prefix(), prefix);
            for (pass, there) in arrived.iter().enumerate() {
                prop_assert_eq!(sum.contains(pass as u64), *there);
            }
            // The prefix is its binary decomposition, whatever lies beyond it.
            let in_prefix = sum.nodes().filter(|node| node.block.start() < prefix).count();
            prop_assert_eq!(in_prefix, prefix.count_ones() as usize);
        }
        assert_is_reference(&sum.average().unwrap(), seed, passes);

        // What is held is all there is: a sum made of it alone goes on to the same bits.
        let mut copy = TreeSum::new(2, 1);
        let mut nodes: Vec<Node> = sum.nodes().map(|node| Node::clone(node)).collect();
        nodes.reverse();
        for node in nodes {
            copy.insert(node).unwrap();
        }
        prop_assert_eq!(bits(&copy.average().unwrap().beauty), bits(&sum.average().unwrap().beauty));
    }

    #[test]
    fn shorter_prefixes_are_those_whose_nodes_are_held(passes in 1u64..=256, seed: u64) {
        let mut sum = TreeSum::new(2, 1);
        for pass in 0..passes {
            sum.insert(block_node(seed, Block::leaf(pass))).unwrap();
        }
        for n in 0..=passes + 1 {
            // The set bits of n are the highest ones of `passes`.
            let held = n > 0 && n <= passes && passes & (u64::MAX << n.trailing_zeros()) == n;
            match sum.average_of(n) {
                Some(average) => {
                    prop_assert!(held);
                    assert_is_reference(&average, seed, n);
                }
                None => prop_assert!(!held, "{} of {}", n, passes),
            }
        }
    }

    #[test]
    fn no_pass_is_counted_twice(passes in 1u64..=64, seed: u64, level in 0u32..6, index in 0u64..64) {
        let mut sum = TreeSum::new(2, 1);
        let blocks = random_blocks(passes, seed);
        let there = &blocks[..blocks.len().div_ceil(2)];
        for block in there {
            sum.insert(block_node(seed, *block)).unwrap();
        }
        let block = Block { level, index: index >> level };
        let first = block.passes().find(|pass| there.iter().any(|b| b.passes().contains(pass)));
        let before: Vec<_> = sum.nodes().cloned().collect();
        let result = sum.insert(block_node(seed, block));
        match first {
            Some(pass_index) => {
                prop_assert_eq!(result, Err(MergeError::Overlap { block, pass_index }));
                prop_assert_eq!(sum.nodes().cloned().collect::<Vec<_>>(), before);
            }
            None => prop_assert_eq!(result, Ok(())),
        }
    }
}

/// The block, or its parts, none of which is across a boundary.
fn cut(block: Block) -> Vec<Block> {
    if !TreeSum::is_across(block) {
        return vec![block];
    }
    let child = |side| Block {
        level: block.level - 1,
        index: 2 * block.index + side,
    };
    [0, 1].into_iter().flat_map(|side| cut(child(side))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(20), ..ProptestConfig::with_cases(200) })]

    #[test]
    fn every_boundary_can_be_looked_at_in_any_order(passes in 2u64..=256, seed: u64, late in 0u64..3) {
        let mut sum = TreeSum::new(2, 1).with_fence(0);
        let blocks: Vec<Block> = random_blocks(passes, seed).into_iter().flat_map(cut).collect();
        let mut looked = Vec::new();
        for (i, block) in blocks.into_iter().enumerate() {
            sum.insert(block_node(seed, block)).unwrap();
            // Whether someone looks at once or later must not matter.
            if hash(seed, i as u64) % 3 < late {
                continue;
            }
            while let Some(fence) = sum.fence().filter(|fence| *fence <= sum.prefix()) {
                assert_is_reference(&sum.average_of(fence).unwrap(), seed, fence);
                looked.push(fence);
                sum.lift_fence();
            }
            if sum.prefix() > 0 {
                assert_is_reference(&sum.average().unwrap(), seed, sum.prefix());
            }
        }
        while let Some(fence) = sum.fence().filter(|fence| *fence <= sum.prefix()) {
            assert_is_reference(&sum.average_of(fence).unwrap(), seed, fence);
            looked.push(fence);
            sum.lift_fence();
        }
        let all = (1..9).flat_map(|k| [1 << k, 3 << (k - 1)]);
        prop_assert_eq!(looked, all.filter(|b| *b <= passes).collect::<Vec<u64>>());
        // All that was kept apart is joined again.
        prop_assert_eq!(sum.nodes().count(), passes.count_ones() as usize);
        assert_is_reference(&sum.average().unwrap(), seed, passes);
    }

    #[test]
    fn what_was_taken_out_can_come_in_again(passes in 1u64..=64, seed: u64, level in 0u32..4, index in 0u64..64) {
        let mut sum = TreeSum::new(2, 1).with_fence(0);
        for pass in 0..passes {
            sum.insert(block_node(seed, Block::leaf(pass))).unwrap();
            while sum.fence().is_some_and(|fence| fence <= sum.prefix()) {
                sum.lift_fence();
            }
        }
        let block = Block { level, index: index >> level };
        let removed = sum.remove(block);
        prop_assert!(block.passes().all(|pass| !sum.contains(pass)));
        let gone: Vec<u64> = removed.iter().flat_map(Block::passes).collect();
        prop_assert_eq!(gone.len() as u64 + sum.passes(), passes);
        for pass in gone.into_iter().rev() {
            sum.insert(block_node(seed, Block::leaf(pass))).unwrap();
        }
        while let Some(fence) = sum.fence().filter(|fence| *fence <= passes) {
            assert_is_reference(&sum.average_of(fence).unwrap(), seed, fence);
            sum.lift_fence();
        }
        assert_is_reference(&sum.average().unwrap(), seed, passes);
    }

    #[test]
    fn sums_of_disjoint_ranges_make_one(cuts in proptest::collection::vec(1u64..100, 1..4), seed: u64) {
        let mut whole = TreeSum::new(2, 1);
        let mut start = 0;
        for length in cuts {
            let end = start + length;
            let mut part = TreeSum::new(2, 1).with_first_pass(start).with_fence(0);
            prop_assert_eq!(part.prefix(), start);
            for pass in (start..end).rev() {
                part.insert(block_node(seed, Block::leaf(pass))).unwrap();
            }
            prop_assert_eq!((part.prefix(), part.passes()), (end, length));
            prop_assert_eq!(part.average().is_some(), start == 0);
            for node in part.nodes() {
                whole.insert_shared(node.clone()).unwrap();
            }
            start = end;
        }
        assert_is_reference(&whole.average().unwrap(), seed, start);
    }
}

#[test]
fn boundaries_are_powers_of_two_and_those_between() {
    let mut boundaries = vec![next_boundary(0)];
    while boundaries.len() < 12 {
        boundaries.push(next_boundary(boundaries[boundaries.len() - 1] + 1));
    }
    assert_eq!(boundaries, [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96]);
    for passes in 0..1000 {
        let next = next_boundary(passes);
        assert!(next >= passes && next_boundary(next) == next);
        assert!((passes.max(2)..next).all(|p| next_boundary(p) == next));
    }
    for level in 1..8 {
        for index in 0..20 {
            let block = Block { level, index };
            let mut inside = block.passes().skip(1);
            let across = inside.any(|p| p >= 2 && next_boundary(p) == p);
            assert_eq!(TreeSum::is_across(block), across, "{block}");
            assert!(index < 2 || !across);
        }
    }
}

/// A block that reaches across the fence comes in whole, and only the boundaries within it are out of reach.
#[test]
fn a_block_across_the_fence_is_taken_as_it_is() {
    let mut sum = TreeSum::new(2, 1).with_fence(0);
    sum.insert(block_node(1, Block { level: 2, index: 0 })).unwrap();
    assert!(sum.average_of(2).is_none() && sum.average_of(3).is_none());
    assert_is_reference(&sum.average_of(4).unwrap(), 1, 4);
}

#[test]
fn percentiles_are_of_blocks() {
    // Ten blocks in a row: equal radiance, errors of 1 % to 10 %.
    let mut sum = TreeSum::new(80, 8);
    for pass in 0..2 {
        let mut film = Film::new(80, 8);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            let error = 0.01 * (1 + i % 80 / 8) as f32;
            *pixel = [1.0 + if pass == 0 { error } else { -error }; 3];
        }
        sum.insert(Node::leaf(pass, film)).unwrap();
    }
    let average = sum.average().unwrap();
    let errors = average.errors();
    for (percentile, expected) in [(1, 0.01), (10, 0.01), (11, 0.02), (50, 0.05), (95, 0.1), (100, 0.1)] {
        let error = errors.at(Some(percentile));
        assert!((error / expected - 1.0).abs() < 1e-4, "{percentile}: {error}");
    }
    let mean_square = (1..=10).map(|i| f64::from(i * i)).sum::<f64>() / 10.0;
    let error = errors.at(None);
    assert!((error / (0.01 * mean_square.sqrt()) - 1.0).abs() < 1e-4, "{error}");
    assert_eq!(error, average.relative_standard_error());
    for beyond in [0, 101] {
        assert_eq!(errors.at(Some(beyond)), f64::INFINITY);
    }
}

/// A sum of 1 x 1 images.
fn sum_of(passes: u64, value: impl Fn(u64) -> f32) -> TreeSum {
    let mut sum = TreeSum::new(1, 1);
    for pass in 0..passes {
        let mut film = Film::new(1, 1);
        film.pixels[0] = [value(pass); 3];
        sum.insert(Node::leaf(pass, film)).unwrap();
    }
    sum
}

#[test]
fn a_million_passes_of_one_value_average_to_it() {
    for value in [0.1, 1.0 / 3.0, 12345.678] {
        let sum = sum_of(1_000_000, |_| value);
        assert_eq!(sum.nodes().count(), 1_000_000u64.count_ones() as usize);
        let average = sum.average().unwrap();
        let mean = average.beauty.pixels[0][0];
        assert!(
            (mean - value).abs() <= 1e-6 * value.max(1.0) && (mean - value).abs() <= 1e-6,
            "{mean}"
        );
        assert_eq!(average.standard_error.pixels[0], [0.0; 3]);
    }
}

#[test]
fn a_large_value_with_noise_does_not_drift() {
    const PASSES: u64 = 1_000_000;
    let value = |pass| 10_000.0 + uniform(1, pass) - 0.5;
    let exact = (0..PASSES).map(|pass| f64::from(value(pass))).sum::<f64>() / PASSES as f64;
    let mean = f64::from(sum_of(PASSES, value).average().unwrap().beauty.pixels[0][0]);
    assert!((mean / exact - 1.0).abs() < 2e-7, "{mean} for {exact}");
    // A running sum is what this guards against.
    let running = (0..PASSES).fold(0.0f32, |sum, pass| sum + value(pass)) / PASSES as f32;
    assert!((f64::from(running) / exact - 1.0).abs() > 1e-4);
}

/// Noise whose variance grows as that of passes does, Var[i] ~ i^(1 - alpha) with alpha = 1/2. The estimate's mean over
/// pixels is compared with the variance known from the construction, in units of its own standard error; 6 tests, each
/// two-sided at 4.5 standard errors (p = 7e-6).
#[test]
fn standard_error_estimates_the_variance_of_the_mean() {
    const SIDE: u32 = 48;
    let amplitude = |pass: u64| ((pass + 1) as f64).sqrt().sqrt();
    for passes in [2, 3, 4, 7, 64, 65u64] {
        let mut sum = TreeSum::new(SIDE, SIDE);
        for pass in 0..passes {
            let mut film = Film::new(SIDE, SIDE);
            for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
                *value = 3.0 + amplitude(pass) as f32 * (uniform(pass, i as u64) - 0.5);
            }
            sum.insert(Node::leaf(pass, film)).unwrap();
        }
        // A uniform variable has the variance 1/12. An odd last pass is taken to vary as the others do.
        let variance = |pass: u64| amplitude(pass) * amplitude(pass) / 12.0;
        let n = passes as f64;
        let pairs = passes - passes % 2;
        let expected = (0..pairs).map(variance).sum::<f64>() / (n * pairs as f64);
        let truth = (0..passes).map(variance).sum::<f64>() / (n * n);
        assert!(
            expected <= truth * (1.0 + 1e-12) && expected >= truth * (1.0 - 0.5 / n),
            "{passes} passes"
        );

        let average = sum.average().unwrap();
        let squares: Vec<f64> = average
            .standard_error
            .pixels
            .iter()
            .flatten()
            .map(|s| f64::from(s * s))
            .collect();
        let count = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let spread = squares.iter().map(|s| (s - mean) * (s - mean)).sum::<f64>() / (count - 1.0);
        let z = (mean - expected) / (spread / count).sqrt();
        assert!(z.abs() < 4.5, "{passes} passes: z = {z}");
        // The mean itself lies within its error: root mean square z of the pixels is one.
        let beauty = average.beauty.pixels.iter().flatten();
        let actual = beauty
            .map(|v| (f64::from(*v) - 3.0) * (f64::from(*v) - 3.0))
            .sum::<f64>()
            / count;
        assert!(
            (actual / truth - 1.0).abs() < 4.5 * (2.0 / count).sqrt(),
            "{passes} passes: {}",
            actual / truth
        );

        let relative = average.relative_standard_error();
        assert!((relative - expected.sqrt() / 3.0).abs() < 0.05 * relative, "{relative}");
    }
}

#[test]
fn one_pass_and_a_black_picture_have_no_known_error() {
    let one = sum_of(1, |_| 0.5).average().unwrap();
    assert_eq!(one.standard_error.pixels[0], [f32::INFINITY; 3]);
    assert_eq!(one.relative_standard_error(), f64::INFINITY);
    assert_eq!(
        sum_of(4, |_| 0.0).average().unwrap().relative_standard_error(),
        f64::INFINITY
    );
    assert_eq!(sum_of(4, |_| 0.5).average().unwrap().relative_standard_error(), 0.0);
    assert_eq!(TreeSum::new(1, 1).average(), None);
}

#[test]
fn bad_values_are_counted_named_and_refused() {
    let mut sum = TreeSum::new(2, 2);
    sum.insert(Node::leaf(6, Film::new(2, 2))).unwrap();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0 * MAX_RADIANCE] {
        let mut film = Film::new(2, 2);
        film.pixels[1][2] = bad;
        film.pixels[3] = [bad; 3];
        let error = sum.insert(Node::leaf(7, film)).unwrap_err();
        let block = Block::leaf(7);
        let first = [1, 0];
        assert_eq!(error, MergeError::NonFinite { block, count: 4, first });
        assert!(error.to_string().starts_with("pass 7: 4 values are NaN"), "{error}");
        assert!(!sum.contains(7) && sum.contains(6));
    }
    let mut node = Node::join(Node::leaf(4, Film::new(2, 2)), Node::leaf(5, Film::new(2, 2))).unwrap();
    node.squared_difference.pixels[0][0] = -1.0;
    assert!(matches!(sum.insert(node), Err(MergeError::NonFinite { count: 1, .. })));
}

#[test]
fn the_brightest_passes_stay_finite() {
    let sum = sum_of(4, |pass| if pass % 2 == 0 { MAX_RADIANCE } else { -MAX_RADIANCE });
    let node = sum.nodes().next().unwrap();
    node.check(1, 1, LayerCounts::default()).unwrap();
    assert_eq!(node.squared_difference.pixels[0], [f32::MAX; 3]);
    let sum = sum_of(7, |_| MAX_RADIANCE);
    assert_eq!(sum.average().unwrap().beauty.pixels[0], [MAX_RADIANCE; 3]);
}

#[test]
fn other_shapes_are_refused() {
    let mut sum = TreeSum::new(3, 2);
    let error = sum.insert(Node::leaf(5, Film::new(2, 3))).unwrap_err();
    assert_eq!(error.to_string(), "pass 5: expected 3 x 2 pixels, found 2 x 3");
    let mut short = Film::new(3, 2);
    short.pixels.pop();
    assert!(matches!(sum.insert(Node::leaf(5, short)), Err(MergeError::Size { .. })));
    let beyond = sum.insert(Node::leaf(MAX_PASSES, Film::new(3, 2)));
    assert!(matches!(beyond, Err(MergeError::OutOfRange { .. })));
    let mut wide = Node::leaf(0, Film::new(3, 2));
    wide.block = Block { level: 99, index: 1 };
    assert!(matches!(sum.insert(wide), Err(MergeError::OutOfRange { .. })));
}

#[test]
fn only_siblings_join_and_in_their_order() {
    let leaf = |i| Node::leaf(i, Film::new(1, 1));
    assert!(Node::join(leaf(2), leaf(3)).is_ok());
    for (left, right) in [(3, 2), (1, 2), (0, 2), (2, 2)] {
        let (left, right) = (leaf(left), leaf(right));
        assert!(matches!(Node::join(left, right), Err(MergeError::NotSiblings { .. })));
    }
    let pair = Node::join(leaf(0), leaf(1)).unwrap();
    assert!(matches!(Node::join(pair, leaf(2)), Err(MergeError::NotSiblings { .. })));
    let mut last = leaf(0);
    last.block = Block { level: 53, index: 0 };
    let mut beyond = leaf(0);
    beyond.block = Block { level: 53, index: 1 };
    assert!(Node::join(last, beyond).is_err());
}
