//! Ground truth: an unbiased volumetric path tracer for the scenes that the beams render.
//!
//! Paths start at the camera. Distances in media are sampled (by delta tracking where the density varies, Woodcock et
//! al. 1965), so the transmittance along the path is never evaluated. At every vertex that is not specular, lights are
//! sampled as well, with an unbiased estimate of the transmittance towards them. The two ways of finding light are
//! balanced by their densities of direction at the vertex (Veach 1997, section 9.2). The weights sum to one for every
//! path, whatever lies between the vertex and the light, so boundaries of media, cut-outs and random distances do not
//! matter. In colour, a distance is drawn for one channel in proportion to the throughput and weighted by the density
//! of all channels, which bounds the throughput's sum.
//!
//! It shares the scene with the beams (geometry, materials, lights, media), but no estimator: no photons, no kernels.
//!
//! It obeys all object visibility rules except those of photons, which it does not have: see
//! [`touches_photons`](crate::world::rules::Rules::touches_photons).
//!
//! On request it also gives those layers of a pass that hold radiance: see [`SampleLayers`].
//!
//! It cannot find point, spot, laser and directional lights by way of specular surfaces: the probability is zero, and
//! their light is missing from the picture. It finds caustics of small lights only by chance.

mod path;
mod tracer;
mod vertex;

use crate::parallel;
use crate::plan::aov::{LayerPlan, NoSuchGroup, Parts, Recorder};
use crate::sampler::{Purpose, Sampler};
use crate::world::Scene;
use crate::world::light::LightSelector;
use beamfarm_image::film::Film;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_image::layer::Layer;
use tracer::PathTracer;

/// One sample of every pixel.
#[derive(Clone, Debug)]
pub struct SampleImage {
    /// Radiance.
    pub film: Film,
    /// The requested layers, in their order.
    pub layers: Vec<Film>,
}

/// Layers of samples: those layers of a pass that hold radiance. Light is [`Layer::Direct`] if the camera meets it by
/// way of specular surfaces and narrow lobes alone, or if it comes straight from a light to the first surface that is
/// neither. It is [`Layer::Volume`] if a medium comes before any such surface, and otherwise [`Layer::Surface`].
#[derive(Clone, Debug, Default)]
pub struct SampleLayers(LayerPlan);

impl SampleImage {
    /// The sample of a moment for which there is no scene: all pixels are NaN.
    fn failed(scene: &Scene, layers: usize) -> Self {
        let camera = &scene.description().camera;
        let mut film = Film::new(camera.width, camera.height);
        film.pixels.fill([f32::NAN; 3]);
        Self {
            layers: vec![film.clone(); layers],
            film,
        }
    }
}

/// A layer that samples do not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleLayersError {
    /// No light belongs to the layer's group.
    #[error(transparent)]
    NoSuchGroup(#[from] NoSuchGroup),
    /// The layer holds no radiance.
    #[error("the path tracer has no layer `{0}`: only direct, surface, volume and those of lights")]
    NotRadiance(Layer),
}

impl SampleLayers {
    /// These layers, in this order.
    pub fn new(scene: &Scene, layers: &[Layer]) -> Result<Self, SampleLayersError> {
        use Layer::{Direct, Light, Surface, Volume};
        match layers
            .iter()
            .find(|layer| !matches!(layer, Direct | Surface | Volume | Light(_)))
        {
            Some(layer) => Err(SampleLayersError::NotRadiance(layer.clone())),
            None => Ok(Self(LayerPlan::new(scene, layers)?)),
        }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.layers.len()
    }
}

/// One radiance sample of every pixel, on the current rayon pool, with the scene's pixel filter and lens. A pure
/// function of the scene, the settings and the sample's index; the bits do not depend on the pool.
///
/// `goes_on` is called before every row of pixels. If it returns false, there is no sample.
pub fn render_sample(
    scene: &Scene,
    settings: &ReferenceSettings,
    sample_index: u64,
    goes_on: impl Fn() -> bool + Sync,
) -> Option<Film> {
    let none = SampleLayers::default();
    let image = render_sample_with_layers(scene, settings, &none, sample_index, goes_on);
    image.map(|image| image.film)
}

/// As [`render_sample`], with layers. The beauty's bits do not depend on them.
pub fn render_sample_with_layers(
    scene: &Scene,
    settings: &ReferenceSettings,
    layers: &SampleLayers,
    sample_index: u64,
    goes_on: impl Fn() -> bool + Sync,
) -> Option<SampleImage> {
    let Ok(moment) = scene.moment(settings.seed, sample_index) else {
        return Some(SampleImage::failed(scene, layers.count()));
    };
    let scene = moment.as_ref().unwrap_or(scene);
    let camera = &scene.description().camera;
    let even = even_selector(scene);
    let tracer = PathTracer {
        scene,
        selector: even.as_ref().unwrap_or(&scene.selectors.all),
        max_depth: settings.max_depth.unwrap_or(u32::MAX),
    };
    let (width, height) = (camera.width as usize, camera.height as usize);
    let plan = &layers.0;
    // Where all samples lie in their pixels, if the filter spreads them over several pixels.
    let offset =
        (camera.filter.spreads()).then(|| Sampler::even(settings.seed, sample_index, Purpose::Film, 1).next_2d());
    let row = |y: usize| {
        if !goes_on() {
            return None;
        }
        let mut pixels = vec![[0.0; 3]; width];
        let mut values = vec![pixels.clone(); layers.count()];
        for (x, pixel) in pixels.iter_mut().enumerate() {
            let chunk = (y * width + x) as u64;
            let mut sampler = Sampler::even(settings.seed, sample_index, Purpose::Reference, chunk);
            let own = sampler.next_2d();
            let image = camera.sample(x as u32, y as u32, offset.unwrap_or(own));
            if !camera.sees(image) {
                continue;
            }
            let ray = camera.ray(image, sampler.next_2d());
            let mut parts = (layers.count() > 0).then(|| Parts::new(plan.groups()));
            let record = Recorder::new(plan, parts.as_mut());
            *pixel = tracer.radiance(ray, record, &mut sampler).to_array();
            if let Some(parts) = parts {
                for (number, (values, layer)) in values.iter_mut().zip(&plan.layers).enumerate() {
                    values[x] = parts.value(layer, plan.group_of_layer(number));
                }
            }
        }
        Some((pixels, values))
    };
    let rows: Option<Vec<_>> = parallel::map(height, row).into_iter().collect();
    let mut film = Film::new(camera.width, camera.height);
    let mut films = vec![film.clone(); layers.count()];
    for (y, (pixels, values)) in rows?.into_iter().enumerate() {
        let rows = [(&mut film, pixels)].into_iter();
        for (film, pixels) in rows.chain(films.iter_mut().zip(values)) {
            film.pixels[y * width..][..width].copy_from_slice(&pixels);
        }
    }
    if let Some(offset) = offset {
        camera.filter.reconstruct(films.iter_mut().chain([&mut film]), offset);
    }
    Some(SampleImage { film, layers: films })
}

/// A light's least share of the choices, relative to equal shares.
const MIN_SHARE: f32 = 0.1;

/// Where the power of some lights dwarfs that of others (the sky, or a lamp that shines elsewhere): half of the choices
/// by power and half evenly, so that nearby lights are found as well.
fn even_selector(scene: &Scene) -> Option<LightSelector> {
    let shares = (0..scene.lights().len()).map(|light| scene.selectors.all.pmf(light));
    let shares: Vec<f32> = shares.collect();
    let alike = 1.0 / shares.iter().filter(|share| **share > 0.0).count() as f32;
    let is_dim = |share: &f32| *share > 0.0 && *share < MIN_SHARE * alike;
    let even = |share: &f32| match *share > 0.0 {
        true => f64::from(0.5 * (share + alike)),
        false => 0.0,
    };
    shares.iter().any(is_dim).then(|| {
        let weights: Vec<f64> = shares.iter().map(even).collect();
        LightSelector::of_weights(&weights)
    })
}
