//! The bias that is printed: passes whose bias is known tile by tile, and scenes whose radii are far too large.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use beamfarm_shared::bias::{BIAS_EXPONENTS, Bias, Finding};
use beamfarm_shared::film::Film;
use beamfarm_shared::merge::{Node, TreeSum};
use beamfarm_shared::radius::radius_scale;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const TILES: usize = 32;

/// How the passes of a made job vary.
#[derive(Clone, Copy, Debug)]
struct Made {
    alpha: f64,
    passes: usize,
    /// p: the bias of a pass is b R^p.
    exponent: f64,
    /// Share of the first pass's variance that goes as 1 / R.
    kernel: f64,
    /// One pass in so many has all the noise.
    rarity: f64,
}

fn uniform(rng: &mut Pcg64Mcg) -> f64 {
    (rng.next_u64() >> 11) as f64 * (-53f64).exp2()
}

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let radius = (-2.0 * libm::log1p(-uniform(rng))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(rng))
}

impl Made {
    fn scales(&self) -> Vec<f64> {
        let pass = |n: usize| radius_scale((n + 1) as f64, self.alpha);
        (0..self.passes).map(pass).collect()
    }

    /// Variance of a pass.
    fn variance(&self, scale: f64) -> f64 {
        1e-4 * (1.0 - self.kernel + self.kernel / scale)
    }

    /// Least standard error that an estimate of the average's bias can have if the exponent and the noise are known, and
    /// the standard error of the average.
    fn standard_errors(&self) -> (f64, f64) {
        let scales = self.scales();
        let n = scales.len() as f64;
        let powers: Vec<f64> = scales
            .iter()
            .map(|r| libm::pow(*r, self.exponent))
            .collect();
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            let passes = scales.iter().zip(&powers);
            passes.map(|(r, g)| f(1.0 / self.variance(*r), *g)).sum()
        };
        let mean = sum(&|w, g| w * g) / sum(&|w, _| w);
        let spread = sum(&|w, g| w * (g - mean) * (g - mean));
        let variance: f64 = scales.iter().map(|r| self.variance(*r)).sum();
        (
            powers.iter().sum::<f64>() / n / spread.sqrt(),
            variance.sqrt() / n,
        )
    }

    /// A job whose tiles' averages have these biases.
    fn job(&self, biases: &[f64], rng: &mut Pcg64Mcg) -> Bias {
        let scales = self.scales();
        let power = |scale: f64| libm::pow(scale, self.exponent);
        let mean_power = scales.iter().map(|r| power(*r)).sum::<f64>() / scales.len() as f64;
        let mut sum = TreeSum::new(32 * biases.len() as u32, 1);
        for (pass, scale) in scales.iter().enumerate() {
            let mut film = Film::new(32 * biases.len() as u32, 1);
            for (tile, bias) in film.pixels.chunks_mut(32).zip(biases) {
                let noise = match uniform(rng) * self.rarity < 1.0 {
                    true => normal(rng) * self.rarity.sqrt(),
                    false => 0.0,
                };
                let noise = noise * self.variance(*scale).sqrt();
                let value = 1.0 + noise + bias * power(*scale) / mean_power;
                tile.fill([value as f32; 3]);
            }
            let leaf = Node::leaf(pass as u64, film).with_radius_scale(*scale);
            sum.insert(leaf).unwrap();
        }
        sum.average().unwrap().bias.unwrap()
    }
}

#[test]
fn explore() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    for alpha in [0.5, 2.0 / 3.0] {
        for passes in [16, 64, 256] {
            for exponent in BIAS_EXPONENTS {
                for kernel in [0.0, 1.0] {
                    for rarity in [1.0, 20.0] {
                        let made = Made {
                            alpha,
                            passes,
                            exponent,
                            kernel,
                            rarity,
                        };
                        let (se, sem) = made.standard_errors();
                        // by delta: named; share of false
                        let mut hit = [(0, 0); 5];
                        let mut sem_hit = (0, 0);
                        let (mut fdp, mut jobs) = (0.0, 0.0);
                        let mut nullnamed = 0;
                        let mut nulls = 0;
                        let (mut est, mut ne) = (0.0, 0.0);
                        let mut cover = (0, 0);
                        for _ in 0..60 {
                            let mut biases = [0.0; TILES];
                            for i in 0..TILES / 2 {
                                let d = 2.0 * libm::exp(uniform(&mut rng) * libm::log(5.0));
                                biases[i] = if i % 2 == 0 { d * se } else { -d * se };
                            }
                            let bias = made.job(&biases, &mut rng);
                            let mut f = 0;
                            let mut n = 0;
                            for (t, b) in bias.tiles.iter().zip(biases) {
                                let named = t.finding == Finding::Biased;
                                n += named as usize;
                                if b == 0.0 {
                                    nulls += 1;
                                    if named {
                                        f += 1;
                                        nullnamed += 1;
                                    }
                                } else {
                                    let d = b.abs() / se;
                                    let k = if d < 3.0 {
                                        0
                                    } else if d < 4.0 {
                                        1
                                    } else if d < 6.0 {
                                        2
                                    } else if d < 8.0 {
                                        3
                                    } else {
                                        4
                                    };
                                    hit[k].0 += named as i32;
                                    hit[k].1 += 1;
                                    if b.abs() > 2.0 * sem {
                                        sem_hit.0 += named as i32;
                                        sem_hit.1 += 1;
                                    }
                                    if named {
                                        est += t.mean().bias / b;
                                        ne += 1.0;
                                        cover.1 += 1;
                                        if (t.mean().bias - b).abs() < 2.0 * t.mean().standard_error
                                        {
                                            cover.0 += 1;
                                        }
                                    }
                                }
                            }
                            fdp += if n > 0 { f as f64 / n as f64 } else { 0.0 };
                            jobs += 1.0;
                        }
                        let tot: i32 = hit.iter().map(|h| h.0).sum();
                        let all: i32 = hit.iter().map(|h| h.1).sum();
                        println!(
                            "al {alpha:.2} N {passes:4} p {exponent} k {kernel} rare {rarity:2}: se/sem {:.2} power {:.2} by delta {} fdp {:.3} nullrate {:.3} est {:.2} cover {:.2}",
                            se / sem,
                            tot as f64 / all as f64,
                            hit.iter()
                                .map(|h| format!("{:.2}", h.0 as f64 / h.1 as f64))
                                .collect::<Vec<_>>()
                                .join(" "),
                            fdp / jobs,
                            nullnamed as f64 / nulls as f64,
                            est / ne,
                            cover.0 as f64 / cover.1 as f64
                        );
                    }
                }
            }
        }
    }
}
