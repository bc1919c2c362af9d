use super::*;
use crate::math::Vec2;
use crate::sampler::{Purpose, Sampler};

fn point(sampler: &mut Sampler) -> TexturePoint {
    let mut any = || Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d()) * 8.0 - 4.0;
    let (own, world, normal, wo) = (any(), any(), any().normalize_or(Vec3::Z), any().normalize_or(Vec3::X));
    TexturePoint {
        uv: Vec2::new(own.y, world.x),
        color: own.abs().fract(),
        place: Place {
            world,
            own,
            generated: own * 0.125 + 0.5,
            normal,
            wo,
            random: own.x.abs().fract(),
            index: 3.0,
            is_behind: normal.dot(wo) < 0.0,
            ..Place::default()
        },
    }
}

/// The builder shares values, folds constants and assigns registers without changing the result.
#[test]
fn programs_are_what_their_steps_are() {
    let mut builder = Builder::default();
    let two = builder.constant(Vec3::splat(2.0));
    let half = builder.constant(Vec3::splat(0.5));
    let one = builder.add(Op::Math(Operation::Multiply, false), &[two, half, half]);
    assert_eq!(builder.known(one), Some(Vec3::ONE));
    let own = builder.add(Op::Own, &[]);
    assert_eq!(builder.add(Op::Own, &[]), own);
    let mut sum = own;
    let mut kept = Vec::new();
    for i in 0..40 {
        let by = builder.constant(Vec3::splat(i as f32));
        let moved = builder.add(Op::VectorMath(VectorOperation::Add), &[own, by, by, one]);
        kept.push(builder.add(Op::VectorMath(VectorOperation::Sine), &[moved, moved, moved, one]));
    }
    for value in kept.into_iter().rev() {
        sum = builder.add(Op::VectorMath(VectorOperation::Add), &[sum, value, value, one]);
    }
    let program = builder.finish(sum, [f32::NEG_INFINITY, f32::INFINITY]).unwrap();
    assert!(
        program.registers > FEW && program.registers < 50,
        "{}",
        program.registers
    );
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    for _ in 0..20 {
        let at = point(&mut sampler);
        let mut expected = at.place.own;
        for i in (0..40).rev() {
            expected += (at.place.own + i as f32).map(crate::math::sin);
        }
        assert_eq!(program.eval(&at), expected);
    }
    assert_eq!(
        program.reads(),
        Reads {
            place: true,
            ..Reads::default()
        }
    );
}

#[test]
fn programs_of_too_many_values_at_once_are_refused() {
    let mut builder = Builder::default();
    let own = builder.add(Op::Own, &[]);
    let one = builder.constant(Vec3::ONE);
    let all: Vec<Slot> = (0..300)
        .map(|i| {
            let by = builder.constant(Vec3::splat(i as f32));
            builder.add(Op::VectorMath(VectorOperation::Add), &[own, by, by, one])
        })
        .collect();
    let sum = (all.into_iter().rev()).fold(own, |sum, value| {
        builder.add(Op::VectorMath(VectorOperation::Add), &[sum, value, value, one])
    });
    assert_eq!(builder.finish(sum, [0.0, 1.0]).unwrap_err(), TooComplex);
}

/// A program's stated range holds, and no input moves a channel out of its bounds.
#[test]
fn values_stay_within_their_ranges() {
    let random_operation = |sampler: &mut Sampler| {
        let all = Operation::ALL;
        all[(sampler.next_1d() * all.len() as f32) as usize % all.len()].1
    };
    let mut narrow = 0;
    for seed in 0..300 {
        let mut sampler = Sampler::new(seed, 0, Purpose::Test, 1);
        let mut builder = Builder::default();
        let vector = builder.add(Op::Own, &[]);
        let w = builder.add(Op::Random, &[]);
        let number = |sampler: &mut Sampler| Vec3::splat(sampler.next_1d() * 6.0 - 2.0);
        let mut values = vec![w];
        for _ in 0..6 {
            let pick = |builder: &mut Builder, sampler: &mut Sampler| match sampler.next_1d() < 0.4 {
                true => builder.constant(number(sampler)),
                false => values[(sampler.next_1d() * values.len() as f32) as usize % values.len()],
            };
            let inputs: Vec<Slot> = (0..9).map(|_| pick(&mut builder, &mut sampler)).collect();
            let op = match (sampler.next_1d() * 9.0) as u32 {
                0 => Op::Noise {
                    dimensions: 3,
                    kind: NoiseKind::Fbm,
                    normalize: true,
                    color: false,
                },
                1 => Op::Voronoi {
                    dimensions: 2,
                    feature: Feature::F1,
                    metric: Metric::Euclidean,
                    normalize: true,
                    hash: CellHash::Lookup3,
                    output: VoronoiOutput::Color,
                },
                2 => Op::Blend {
                    blend: Blend::Mix,
                    clamp_factor: true,
                    clamp_result: false,
                },
                3 => Op::MapRange(Interpolation::Smooth, true),
                4 => Op::Clamp { sorted: false },
                5 => Op::Invert,
                6 => Op::Wave(WaveKind::Rings([1, 1, 0]), WaveProfile::Saw),
                _ => Op::Math(random_operation(&mut sampler), false),
            };
            let mut inputs = inputs;
            if matches!(op, Op::Noise { .. } | Op::Voronoi { .. } | Op::Wave(..)) {
                inputs[0] = vector;
            }
            let value = builder.add(op, &inputs);
            values.push(value);
        }
        let result = values[values.len() - 1];
        let program = builder.finish(result, [-10.0, 10.0]).unwrap();
        let [low, high] = program.range();
        assert!((-10.0..=10.0).contains(&low) && (low..=10.0).contains(&high));
        narrow += usize::from(high - low < 15.0);
        for _ in 0..200 {
            let value = program.eval(&point(&mut sampler));
            let slack = 1e-4;
            assert!(
                value.min_element() >= low - slack && value.max_element() <= high + slack,
                "{seed}: {value} is not within {low} and {high}"
            );
        }
    }
    assert!(narrow > 80, "{narrow}");
}

/// Huge, tiny and infinite inputs never give NaN.
#[test]
fn no_input_makes_what_is_no_number() {
    let extremes = [
        0.0,
        -0.0,
        1e-38,
        1e30,
        -1e30,
        f32::MAX,
        f32::MIN,
        123_456.7,
        f32::INFINITY,
    ];
    for dimensions in 1..=4 {
        for x in extremes {
            for y in extremes {
                let ops = [
                    Op::Noise {
                        dimensions,
                        kind: NoiseKind::HybridMultifractal,
                        normalize: false,
                        color: true,
                    },
                    Op::Voronoi {
                        dimensions,
                        feature: Feature::SmoothF1,
                        metric: Metric::Minkowski,
                        normalize: true,
                        hash: CellHash::Pcg,
                        output: VoronoiOutput::Color,
                    },
                    Op::Voronoi {
                        dimensions,
                        feature: Feature::NSphereRadius,
                        metric: Metric::Euclidean,
                        normalize: false,
                        hash: CellHash::Pcg,
                        output: VoronoiOutput::Distance,
                    },
                    Op::Magic { depth: 10 },
                    Op::Wave(WaveKind::Bands([1, 1, 1]), WaveProfile::Sine),
                    Op::WhiteNoise {
                        dimensions,
                        color: true,
                    },
                ];
                for op in ops {
                    let mut builder = Builder::default();
                    let own = builder.add(Op::Own, &[]);
                    let factor = builder.constant(Vec3::splat(y));
                    let inputs = [own, factor, factor, factor, factor, factor, factor, factor, factor];
                    let result = builder.add(op, &inputs);
                    let program = builder.finish(result, [0.0, 1.0]).unwrap();
                    let at = TexturePoint {
                        place: Place {
                            own: Vec3::new(x, y, -x),
                            ..Place::default()
                        },
                        ..TexturePoint::default()
                    };
                    let value = program.eval(&at);
                    assert!(value.cmpge(Vec3::ZERO).all() && value.cmple(Vec3::ONE).all(), "{op:?}");
                }
            }
        }
    }
}

#[test]
fn mappings_and_their_inverses_agree() {
    let mut sampler = Sampler::new(4, 0, Purpose::Test, 0);
    let mut any = || Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d()) * 3.0 + 0.2;
    for _ in 0..100 {
        let (v, location, rotation, scale) = (any(), any(), any(), any());
        let there = mapped(MappingKind::Point, v, location, rotation, scale);
        let back = mapped(MappingKind::Texture, there, location, rotation, scale);
        assert!((back - v).abs().max_element() < 1e-4, "{v} {back}");
    }
}

#[test]
fn a_space_tells_where_points_are() {
    let space = Space {
        world_from_render: Vec3::new(1.0, 0.0, 0.0),
        own_from_world: Affine3A::from_scale(Vec3::splat(0.5)),
        bounds: [Vec3::ZERO, Vec3::new(2.0, 4.0, 0.0)],
        random: 0.25,
        index: 7.0,
        location: Vec3::ZERO,
        step: 1e-3,
    };
    let place = space.place(Vec3::new(1.0, 2.0, 3.0), Vec3::Z, Vec3::Z, -Vec3::Z);
    assert_eq!(place.world, Vec3::new(2.0, 2.0, 3.0));
    assert_eq!(place.own, Vec3::new(1.0, 1.0, 1.5));
    assert_eq!(place.generated, Vec3::new(0.5, 0.25, 0.5));
    assert!(place.is_behind && place.normal == -Vec3::Z);
    let moved = space.moved(&place, Vec3::X);
    let again = space.place(Vec3::new(2.0, 2.0, 3.0), Vec3::Z, Vec3::Z, -Vec3::Z);
    assert_eq!(moved, again);
}
