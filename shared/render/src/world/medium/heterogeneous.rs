//! A medium whose density varies in space.

use super::Flight;
use super::bricks::Bricks;
use super::majorant::{MajorantGrid, Spans};
use super::transmittance::{Estimator, Events, Step, StepFunctions};
use crate::math::{Ray, Rgb, Vec3};
use crate::sampler::Sampler;
use crate::world::phase::Phase;
use glam::{Affine3A, DAffine3, DVec3};
use std::sync::Arc;

/// A stored transmittance function serves many lookups: where residual tracking would sample the density less often
/// than this along a ray, it samples more often.
const FEW_EVENTS: f32 = 3.0;
/// But at most this many times as often.
const MOST_OFTEN: f32 = 64.0;

/// A heterogeneous medium: RGB coefficients times a scalar density.
#[derive(Clone, Debug)]
pub struct Heterogeneous {
    /// Absorption at density 1, RGB, per scene unit.
    pub sigma_a: Rgb,
    /// Scattering at density 1, RGB, per scene unit; a factor on `albedo`, if that varies.
    pub sigma_s: Rgb,
    /// Phase function.
    pub phase: Phase,
    /// How transmittance is estimated.
    pub estimator: Estimator,
    /// The samples, shared by media of one file.
    bricks: Arc<Bricks>,
    majorants: Arc<MajorantGrid>,
    /// Mean free path at the highest density, in sample spacings, which the bounds are built for.
    samples_free: f32,
    /// Render space to sample space.
    to_samples: Affine3A,
    /// The share of `sigma_s` that scatters, by place; the rest absorbs.
    albedo: Option<Albedo>,
}

/// An albedo that varies.
#[derive(Clone, Debug)]
pub struct Albedo {
    /// One for all channels, or one for each.
    channels: Arc<Vec<Bricks>>,
    /// Sample space of the density to that of the albedo.
    from_density: Affine3A,
}

impl Albedo {
    /// One grid for all channels, or one for each.
    pub fn channels(&self) -> &[Bricks] {
        &self.channels
    }

    /// Sample space of the density to that of the albedo.
    pub fn from_density(&self) -> &Affine3A {
        &self.from_density
    }

    /// By channel, at several positions in the density's sample space.
    #[inline]
    pub fn at<const N: usize>(&self, positions: &[[f32; N]; 3]) -> [[f32; N]; 3] {
        let mut points = [[0.0; N]; 3];
        for l in 0..N {
            let p = Vec3::new(positions[0][l], positions[1][l], positions[2][l]);
            let p = self.from_density.transform_point3(p);
            for c in 0..3 {
                points[c][l] = p[c];
            }
        }
        match &self.channels[..] {
            [red, green, blue] => [red, green, blue].map(|c| c.densities(&points)),
            [grey, ..] => [grey.densities(&points); 3],
            [] => [[1.0; N]; 3],
        }
    }
}

/// A ray through the density, in sample space. Distances are those of render space.
pub struct Track<'a> {
    medium: &'a Heterogeneous,
    origin: Vec3,
    dir: Vec3,
    /// The part of the ray inside the medium's box.
    pub range: [f32; 2],
}

impl Track<'_> {
    /// Density at a distance.
    #[inline(always)]
    pub fn density(&self, distance: f32) -> f32 {
        let position = self.origin + self.dir * distance;
        self.medium.bricks.density(position)
    }

    /// Albedo at a distance, if it varies.
    #[inline]
    fn albedo(&self, distance: f32) -> Rgb {
        match &self.medium.albedo {
            None => Rgb::ONE,
            Some(albedo) => {
                let position = self.origin + self.dir * distance;
                let at = albedo.at(&position.to_array().map(|x| [x]));
                Rgb::from(at.map(|[x]| x))
            }
        }
    }

    /// Stretches with bounds of the density.
    pub fn spans(&self) -> Spans<'_> {
        let majorants = &self.medium.majorants;
        majorants.spans(self.origin, self.dir, self.range)
    }
}

impl Heterogeneous {
    /// `to_render`: from the density's object space to render space; it must be invertible.
    pub fn new(
        [sigma_a, sigma_s]: [Rgb; 2],
        phase: Phase,
        estimator: Estimator,
        bricks: Arc<Bricks>,
        to_render: DAffine3,
    ) -> Self {
        Self::new_like(None, [sigma_a, sigma_s], phase, estimator, bricks, to_render)
    }

    /// The same medium, given another one: if both have the same density and mean free path, the bounds are shared.
    pub fn new_like(
        other: Option<&Self>,
        [sigma_a, sigma_s]: [Rgb; 2],
        phase: Phase,
        estimator: Estimator,
        bricks: Arc<Bricks>,
        to_render: DAffine3,
    ) -> Self {
        let from_samples = to_render * bricks.to_object();
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let spacing = axes.map(|axis| from_samples.transform_vector3(axis).length());
        let densest = (sigma_a + sigma_s).max_element() * bricks.max();
        let free_path = 1.0 / (densest * spacing.into_iter().fold(0.0, f64::max) as f32);
        let other = other.filter(|other| Arc::ptr_eq(&other.bricks, &bricks) && other.samples_free == free_path);
        let majorants = match other {
            Some(other) => other.majorants.clone(),
            None => Arc::new(MajorantGrid::new(&bricks, free_path)),
        };
        Self {
            sigma_a,
            sigma_s,
            phase,
            estimator,
            bricks,
            majorants,
            samples_free: free_path,
            to_samples: from_samples.inverse().as_affine3a(),
            albedo: None,
        }
    }

    /// The same with `sigma_s` as the total extinction of light that may scatter, and the share of it that does: one
    /// grid for all channels or three, in the density's object space.
    pub fn with_albedo(self, channels: Arc<Vec<Bricks>>) -> Self {
        let from_density = channels.first().map_or(DAffine3::IDENTITY, |bricks| {
            bricks.to_object().inverse() * self.bricks.to_object()
        });
        Self {
            albedo: Some(Albedo {
                channels,
                from_density: from_density.as_affine3a(),
            }),
            ..self
        }
    }

    /// The albedo, if it varies.
    pub fn albedo(&self) -> Option<&Albedo> {
        self.albedo.as_ref()
    }

    /// Extinction at density 1, RGB, per scene unit.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }

    /// The samples.
    pub fn bricks(&self) -> &Bricks {
        &self.bricks
    }

    /// The samples, for sharing.
    pub fn shared_bricks(&self) -> &Arc<Bricks> {
        &self.bricks
    }

    /// Bounds of the density.
    pub fn majorants(&self) -> &MajorantGrid {
        &self.majorants
    }

    /// Render space to the samples' space.
    pub fn to_samples(&self) -> &Affine3A {
        &self.to_samples
    }

    /// Density at a point of render space.
    pub fn density(&self, point: Vec3) -> f32 {
        let position = self.to_samples.transform_point3(point);
        self.bricks.density(position)
    }

    /// The part of a ray inside the medium's box, up to `length`, which may be infinite.
    pub fn track(&self, ray: &Ray, length: f32) -> Option<Track<'_>> {
        let origin = self.to_samples.transform_point3(ray.origin);
        let dir = self.to_samples.transform_vector3(ray.dir);
        let range = self.majorants.clip(origin, dir, length)?;
        Some(Track {
            medium: self,
            origin,
            dir,
            range,
        })
    }

    /// One estimate of the transmittance over `length`.
    pub fn transmittance(&self, ray: &Ray, length: f32, sampler: &mut Sampler) -> Rgb {
        let Some(track) = self.track(ray, length) else {
            return Rgb::ONE;
        };
        let mut last = Step::NONE;
        self.walk_with(&track, 1.0, sampler, |_, step| last = step);
        last.transmittance(self.sigma_t())
    }

    fn walk_with(&self, track: &Track, often: f32, sampler: &mut Sampler, step: impl FnMut(f32, Step)) {
        let density = |t| track.density(t);
        let (sigma_t, spans) = (self.sigma_t(), track.spans());
        self.estimator.walk(spans, density, sigma_t, often, sampler, step);
    }

    /// One estimate of the transmittance at all distances along a track, stored in `steps` under the returned number.
    pub fn walk(&self, track: &Track, sampler: &mut Sampler, steps: &mut StepFunctions) -> u32 {
        let number = steps.begin();
        let often = self.often(track);
        self.walk_with(track, often, sampler, |t, step| steps.push(t, step));
        number
    }

    /// Factor by which residual tracking samples the density of a stored track more often than necessary.
    pub fn often(&self, track: &Track) -> f32 {
        let length = track.range[1] - track.range[0];
        let expected = length * self.majorants.deviation() * self.sigma_t().max_element();
        (FEW_EVENTS / expected).clamp(1.0, MOST_OFTEN)
    }

    /// Samples where a photon of flux `power` scatters along a track: delta tracking at the rate of the largest
    /// channel. All channels together decide between a real and a null collision, in proportion to the flux left in
    /// each, and the photon is weighted by that probability (Kutz et al. 2017, *Spectral and decomposition tracking for
    /// rendering heterogeneous volumes*, history-aware).
    pub fn sample_flight(&self, track: &Track, power: Rgb, sampler: &mut Sampler) -> Flight {
        let sigma_t = self.sigma_t();
        let top = sigma_t.max_element();
        let mut events = Events::new(sampler);
        let mut weight = Rgb::ONE;
        let mut scattered = None;
        for span in track.spans() {
            let rate = span.density.majorant * top;
            let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
                let rho = track.density(t);
                if rho <= 0.0 {
                    return true;
                }
                let collides = (sigma_t * (rho / rate)).min(Rgb::ONE);
                let flux = power * weight;
                let real = (flux * collides).element_sum() / flux.element_sum();
                if sampler.next_1d() < real {
                    weight *= self.sigma_s * (rho / (rate * real));
                    if self.albedo.is_some() {
                        weight *= track.albedo(t);
                    }
                    scattered = Some(t);
                    return false;
                }
                weight *= (Rgb::ONE - collides) / (1.0 - real);
                true
            });
            if !goes_on {
                break;
            }
        }
        match scattered {
            Some(distance) => Flight::Scattered { distance, weight },
            None => Flight::Passed { weight },
        }
    }
}
