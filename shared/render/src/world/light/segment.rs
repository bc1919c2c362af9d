//! Chooses a light and a point of a ray segment where its light scatters, for single scattering.
//!
//! Light from a source at distance D from the line falls off as 1 / d^2 = 1 / (D^2 + s^2), with s the position along
//! the line from the foot of the perpendicular. Points uniform in the angle under which the source sees the segment
//! follow that (Kulla & Fajardo 2012, equiangular sampling). Let psi be the angle by which light is turned towards the
//! ray's origin, with tan(psi / 2) = (s + d) / D. Drawing psi in proportion to Poisson's kernel (1 - g^2) / (1 + g^2 -
//! 2 g cos psi), whose integral is atan((1 + g) / (1 - g) tan(psi / 2)), also follows a forward-peaked phase function.

use super::LightSelector;
use super::source::{LightSources, MAX_WEIGHED, Region, Source};
use crate::math::{PI, Ray, Rgb, Vec3, atan2, exp_neg, ln_1p, mean, one_minus_exp_neg, tan};
use crate::world::phase::Phase;

/// Share of choices made by power alone: the estimate of a light's contribution may be far off.
const BLIND: f32 = 0.1;

/// A segment of a ray in a homogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct FogSegment {
    /// The segment starts at the ray's origin.
    pub ray: Ray,
    /// Its length, finite.
    pub length: f32,
    /// Extinction by channel, per scene unit, positive; channels that do not scatter take the least value of the
    /// others.
    pub sigma_t: Rgb,
    /// The medium's phase function.
    pub phase: Phase,
    /// Mean cosine of its phase function.
    pub g: f32,
}

/// A chosen light and point.
#[derive(Clone, Copy, Debug)]
pub struct SegmentSample {
    /// Index into the scene's lights.
    pub light: usize,
    /// Distance along the ray.
    pub t: f32,
    /// Density of the distance, times the probability of the light.
    pub pdf: f32,
    /// Squared distance to the light, at least its squared radius; infinite for infinitely distant lights.
    pub distance2: f32,
    /// Square of the light's radius.
    pub radius2: f32,
    /// The starting point of the light, if one was drawn.
    pub start: Option<Vec3>,
}

/// A segment as seen by one light.
#[derive(Clone, Copy, Debug)]
struct LitSegment {
    /// The lit part of the segment.
    range: [f32; 2],
    importance: f32,
    near: Option<NearView>,
}

#[derive(Clone, Copy, Debug)]
struct NearView {
    /// Distance along the ray of the point nearest to the light.
    foot: f32,
    /// Squared radius of the light, or a tiny value that keeps results finite.
    softening: f32,
    /// Distance of the light from the line.
    height: f32,
    /// (1 + g) / (1 - g).
    k: f32,
    /// k tan(psi / 2) at the start of the range, and the angle from there to the end.
    tan_start: f32,
    angle: f32,
    /// Probability of drawing the distance by transmittance.
    by_depth: f32,
}

impl LightSources {
    /// Chooses a light and a point. `None`: the chosen light does not illuminate the segment. `skips`: lights that are
    /// off. `start`: draws the starting point of the chosen light, if needed.
    pub fn sample(
        &self,
        segment: &FogSegment,
        selector: &LightSelector,
        u_light: f32,
        u: f32,
        skips: impl Fn(usize) -> bool,
        start: impl FnOnce(usize) -> Option<Vec3>,
    ) -> Option<SegmentSample> {
        let (light, pmf, view) = if self.sources.len() <= MAX_WEIGHED {
            let mut views = [None; MAX_WEIGHED];
            let (mut total, mut power) = (0.0, 0.0);
            for (light, source) in self.sources.iter().enumerate() {
                if !skips(light)
                    && let Some(view) = source.view(segment)
                {
                    total += view.importance;
                    power += selector.pmf(light);
                    views[light] = Some(view);
                }
            }
            let mut left = u_light;
            let mut chosen = None;
            for (light, view) in views.into_iter().enumerate() {
                let Some(view) = view else { continue };
                let mut pmf = view.importance / total;
                if power > 0.0 {
                    pmf = (1.0 - BLIND) * pmf + BLIND * (selector.pmf(light) / power);
                }
                chosen = Some((light, pmf, view));
                left -= pmf;
                if left < 0.0 {
                    break;
                }
            }
            chosen?
        } else {
            let choice = selector.sample(u_light)?;
            if skips(choice.light) {
                return None;
            }
            (choice.light, choice.pmf, self.sources[choice.light].view(segment)?)
        };
        let start = start(light);
        let view = match start {
            None => view,
            Some(start) => self.sources[light].at(start).view(segment)?,
        };
        let (t, pdf) = view.sample(segment.sigma_t, u);
        let near = view.near.map(|near| {
            let s = t - near.foot;
            (s * s + near.height * near.height, near.softening)
        });
        let (distance2, radius2) = near.unwrap_or((f32::INFINITY, 0.0));
        (pdf > 0.0).then_some(SegmentSample {
            light,
            t,
            pdf: pdf * pmf,
            distance2,
            radius2,
            start,
        })
    }
}

impl Source {
    /// A ball spot, with all its light from one point.
    fn at(&self, start: Vec3) -> Self {
        let mut moved = self.clone();
        if let Self::Near {
            center,
            softening,
            region,
            ..
        } = &mut moved
        {
            (*center, *softening) = (start, 0.0);
            if let Region::Cone { apex, .. } = region {
                *apex = start;
            }
        }
        moved
    }

    /// The segment as seen by this light, if it illuminates it.
    fn view(&self, segment: &FogSegment) -> Option<LitSegment> {
        let FogSegment { ray, length, .. } = *segment;
        let sigma_t = segment.sigma_t.min_element();
        match self {
            Self::Far {
                irradiance, direction, ..
            } => {
                let phase = match direction {
                    Some(direction) => segment.phase.eval(-direction.dot(ray.dir)),
                    None => 0.25 / PI,
                };
                let seen = one_minus_exp_neg(sigma_t * length) / sigma_t;
                Some(LitSegment {
                    range: [0.0, length],
                    importance: (irradiance * phase * seen).max(f32::MIN_POSITIVE),
                    near: None,
                })
            }
            Self::Beam(laser) => {
                let range = laser.clip(&ray, length)?;
                let phase = segment.phase.eval(-laser.frame.n.dot(ray.dir));
                let seen = one_minus_exp_neg(sigma_t * (range[1] - range[0])) / sigma_t;
                let importance = mean(laser.mean_irradiance()) * phase * seen * exp_neg(-sigma_t * range[0]);
                Some(LitSegment {
                    range,
                    // Never zero where there is light.
                    importance: importance.max(f32::MIN_POSITIVE),
                    near: None,
                })
            }
            Self::Near {
                center,
                softening,
                intensity,
                region,
            } => {
                let range = region.clip(&ray, length)?;
                let offset = *center - ray.origin;
                let foot = offset.dot(ray.dir);
                let across2 = (offset - ray.dir * foot).length_squared();
                let [s0, s1] = [range[0] - foot, range[1] - foot];
                // Rounding of the points keeps lines this far from point lights.
                let least = 1e-12 * (s0 * s0 + s1 * s1) + f32::MIN_POSITIVE;
                let softening = softening.max(least);
                let height = (across2 + softening).sqrt();
                let k = (1.0 + segment.g) / (1.0 - segment.g);
                let (a, b) = (k * tan_half(s0, height), k * tan_half(s1, height));
                let angle = atan2(b - a, 1.0 + a * b);
                // Along the segment to the origin. How much of the light's way lies in the medium is unknown.
                let way = foot.clamp(range[0], range[1]);
                let depth = sigma_t * (range[1] - range[0]);
                let importance = intensity * angle / height * (0.5 / PI) * exp_neg(-sigma_t * way);
                Some(LitSegment {
                    range,
                    // Never zero where there is light.
                    importance: importance.max(f32::MIN_POSITIVE),
                    near: Some(NearView {
                        foot,
                        softening,
                        height,
                        k,
                        tan_start: a,
                        angle,
                        by_depth: ((depth - 2.0) * 0.125).clamp(0.0, 0.5),
                    }),
                })
            }
        }
    }
}

fn is_grey(sigma_t: Rgb) -> bool {
    sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z
}

/// tan(psi / 2) = (s + d) / D, without cancellation.
#[inline]
fn tan_half(s: f32, height: f32) -> f32 {
    let d = (s * s + height * height).sqrt();
    if s > 0.0 { (s + d) / height } else { height / (d - s) }
}

impl LitSegment {
    fn sample(&self, sigma_t: Rgb, u: f32) -> (f32, f32) {
        let [start, end] = self.range;
        let exponential = |u: f32| {
            // For one of the channels.
            let (sigma_t, u) = match is_grey(sigma_t) {
                true => (sigma_t.x, u),
                false => {
                    let channel = ((3.0 * u) as usize).min(2);
                    (sigma_t[channel], (3.0 * u - channel as f32).clamp(0.0, 1.0))
                }
            };
            start - ln_1p(-u * one_minus_exp_neg(sigma_t * (end - start))) / sigma_t
        };
        let t = match &self.near {
            None => exponential(u),
            Some(near) if u < near.by_depth => exponential(u / near.by_depth),
            Some(near) => {
                let u = (u - near.by_depth) / (1.0 - near.by_depth);
                let more = tan(u * near.angle);
                let left = 1.0 - near.tan_start * more;
                // Rounding moved it beyond a right angle.
                let tangent = if left > 0.0 {
                    (near.tan_start + more) / (left * near.k)
                } else {
                    f32::INFINITY
                };
                near.foot + 0.5 * near.height * (tangent - 1.0 / tangent)
            }
        };
        // Also for NaN.
        let t = if t > start { t.min(end) } else { start };
        (t, self.pdf(sigma_t, t))
    }

    fn pdf(&self, sigma_t: Rgb, t: f32) -> f32 {
        let [start, end] = self.range;
        let of_channel = |sigma_t: f32| {
            let stopped = one_minus_exp_neg(sigma_t * (end - start));
            sigma_t * exp_neg(-sigma_t * (t - start)) / stopped
        };
        let exponential = || match is_grey(sigma_t) {
            true => of_channel(sigma_t.x),
            false => sigma_t.to_array().map(of_channel).iter().sum::<f32>() / 3.0,
        };
        match &self.near {
            None => exponential(),
            Some(near) => {
                let s = t - near.foot;
                let d = (s * s + near.height * near.height).sqrt();
                let tangent = tan_half(s, near.height);
                let scaled = near.k * tangent;
                // Two factors, as the square may overflow.
                let by_angle = if tangent > 1.0 {
                    near.k / tangent / (1.0 / (tangent * tangent) + near.k * near.k)
                } else {
                    scaled / (1.0 + scaled * scaled)
                } / (d * near.angle);
                if near.by_depth > 0.0 {
                    near.by_depth * exponential() + (1.0 - near.by_depth) * by_angle
                } else {
                    by_angle
                }
            }
        }
    }
}

impl Region {
    /// The part of a segment inside the region.
    fn clip(&self, ray: &Ray, length: f32) -> Option<[f32; 2]> {
        let range = match self {
            Self::Everywhere => [0.0, length],
            Self::Before { point, normal } => {
                let (height, slope) = ((ray.origin - *point).dot(*normal), ray.dir.dot(*normal));
                let crossing = (-height / slope).clamp(0.0, length);
                match (height > 0.0, slope > 0.0) {
                    (true, true) => [0.0, length],
                    (true, false) if slope == 0.0 => [0.0, length],
                    (true, false) => [0.0, crossing],
                    (false, true) => [crossing, length],
                    (false, false) => return None,
                }
            }
            Self::Pyramid { apex, planes } => {
                let offset = ray.origin - *apex;
                let mut range = [0.0, length];
                for plane in planes {
                    let (height, slope) = (offset.dot(*plane), ray.dir.dot(*plane));
                    let crossing = -height / slope;
                    if slope > 0.0 {
                        range[0] = range[0].max(crossing);
                    } else if slope < 0.0 {
                        range[1] = range[1].min(crossing);
                    } else if height <= 0.0 {
                        return None;
                    }
                }
                range
            }
            Self::Cone { apex, axis, cos } => {
                // (dot(x, axis))^2 = cos^2 |x|^2 with x = offset + t dir.
                let offset = ray.origin - *apex;
                let (along, slope) = (offset.dot(*axis), ray.dir.dot(*axis));
                let cos2 = cos * cos;
                let a = slope * slope - cos2;
                let b = along * slope - cos2 * offset.dot(ray.dir);
                let c = along * along - cos2 * offset.length_squared();
                let root = (b * b - a * c).max(0.0).sqrt();
                let q = if b >= 0.0 { -b - root } else { -b + root };
                let [t0, t1] = [q / a, c / q].map(|t| if t.is_nan() { 0.0 } else { t.clamp(0.0, length) });
                let (t0, t1) = (t0.min(t1), t0.max(t1));
                // A convex cone and a line share one interval: one of the three between these points.
                let inside = |t: f32| {
                    let x = offset + ray.dir * t;
                    let along = x.dot(*axis);
                    along > 0.0 && along * along >= cos2 * x.length_squared()
                };
                let parts = [[0.0, t0], [t0, t1], [t1, length]];
                *parts.iter().find(|[from, to]| from < to && inside(0.5 * (from + to)))?
            }
        };
        (range[0] < range[1]).then_some(range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part in front of all four planes, checked at points along lines.
    #[test]
    fn segments_are_clipped_by_pyramids() {
        let apex = Vec3::new(0.2, -0.3, 0.1);
        let planes = [
            Vec3::new(1.0, 0.0, 0.3),
            Vec3::new(-1.0, 0.0, 0.5),
            Vec3::new(0.0, 1.0, -0.1),
            Vec3::new(0.0, -1.0, 0.4),
        ];
        let region = Region::Pyramid { apex, planes };
        let mut met = 0;
        for line in 0..300 {
            let mut sampler = crate::sampler::Sampler::new(1, 0, crate::sampler::Purpose::Test, line);
            let ray = Ray {
                origin: 2.0 * crate::warp::uniform_sphere(sampler.next_2d()),
                dir: crate::warp::uniform_sphere(sampler.next_2d()),
            };
            let range = region.clip(&ray, 3.0);
            met += usize::from(range.is_some());
            for i in 0..100 {
                let t = 0.03 * (i as f32 + 0.5);
                let from = ray.origin + ray.dir * t - apex;
                let depth = planes
                    .iter()
                    .map(|plane| from.dot(*plane))
                    .fold(f32::INFINITY, f32::min);
                let is_in = range.is_some_and(|[start, end]| (start..=end).contains(&t));
                assert!(
                    is_in == (depth > 0.0) || depth.abs() < 1e-5,
                    "{line} {t} {depth} {range:?}"
                );
            }
        }
        assert!((10..290).contains(&met), "{met}");
    }

    /// Distances follow their density in fog of any depth: the mean of one over the density is the segment's length,
    /// and samples lie where the transmittance says.
    #[test]
    fn no_fog_is_too_thin_to_sample() {
        const STRATA: u32 = 1000;
        for depth in [1e-30f32, 1e-9, 2e-8, 1e-6, 1e-3, 1.0, 30.0] {
            let length = 1e-2;
            let segment = FogSegment {
                ray: Ray {
                    origin: Vec3::ZERO,
                    dir: Vec3::X,
                },
                length,
                sigma_t: Rgb::splat(depth / length),
                phase: Phase::Isotropic,
                g: 0.0,
            };
            let far = Source::Far {
                irradiance: 1.0,
                direction: None,
                spread: 0.0,
            };
            let view = far.view(&segment).expect("it shines everywhere");
            assert!(view.importance > 0.0);
            let (mut sum, mut mean) = (0.0, 0.0);
            for i in 0..STRATA {
                let (t, pdf) = view.sample(segment.sigma_t, (i as f32 + 0.5) / STRATA as f32);
                assert!(pdf.is_finite() && pdf > 0.0 && (0.0..=length).contains(&t));
                sum += f64::from(1.0 / pdf) / f64::from(STRATA);
                mean += f64::from(t / length) / f64::from(STRATA);
            }
            let (x, sum) = (f64::from(depth), sum / f64::from(length));
            // Where the midpoint rule cannot resolve e^30, the mean distance still can.
            assert!(x > 1.0 || (sum - 1.0).abs() < 1e-3, "{depth}: {sum}");
            let expected = match x < 1e-3 {
                true => 0.5 - x / 12.0,
                false => 1.0 / x - 1.0 / libm::expm1(x),
            };
            assert!((mean - expected).abs() < 1e-3, "{depth}: {mean}, {expected}");
        }
    }
}
