//! Radiance from infinitely far away.
//!
//! The orientation is that of Mitsuba 3's `envmap` with an identity `to_world`. The pole +y is the image's first row.
//! The column coordinate is u = atan2(x, -z) / 2 pi: the image's left and right edges meet at -z, +x is a quarter of
//! the way to the right, +z half, -x three quarters. Columns are sampled at pixel centres (i + 1/2) / width and repeat;
//! rows are at j / (height - 1), so that the first and the last lie on the poles. Interpolation is bilinear.

use super::cdf;
use crate::math::{PI, Rgb, Vec2, Vec3, atan2, mean, sin_cos};
use crate::warp;
use crate::world::texture::Image;
use glam::Mat3;
use std::sync::Arc;

/// Radiance from infinitely far away, by direction.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Lat-long image, or `None` for a constant.
    image: Option<Arc<Image>>,
    /// Factor on the image, or the constant, W/(m^2 sr).
    scale: Rgb,
    /// Columns: the axes of the image's space in render space (a rotation, possibly mirrored).
    render_from_env: Mat3,
    /// Distribution of the image's brightness; `None` for constants and black images, which are sampled uniformly.
    table: Option<Arc<Table>>,
    /// Integral of the radiance over all directions, W/m^2.
    fluence: Rgb,
    /// See [`Self::unevenness`].
    unevenness: f32,
}

/// An environment given by an image.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentMap<'a> {
    /// Lat-long image.
    pub image: &'a Arc<Image>,
    /// Factor on the image, W/(m^2 sr).
    pub scale: Rgb,
    /// The axes of the image's space in render space.
    pub axes: [Vec3; 3],
    /// Running sums for drawing the rows of cells between pixels.
    pub rows: &'a [f32],
    /// Running sums over the cells of each row, one row after another.
    pub cells: &'a [f32],
    /// Solid angle of a cell, by row; sr.
    pub solid_angles: &'a [f32],
}

/// A direction and its density.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit direction towards the environment, render space.
    pub dir: Vec3,
    /// Density per solid angle, positive.
    pub pdf: f32,
}

/// A density that is constant per solid angle within each cell between four neighbouring pixels, proportional to the
/// integral over the cell of the interpolated radiance's mean channel. It vanishes only where the radiance does.
#[derive(Clone, Debug)]
struct Table {
    /// Cells per row; a cell lies between the centres of columns i and i + 1.
    columns: usize,
    /// Running sums over rows.
    rows: Vec<f32>,
    /// Running sums over the columns of each row.
    cells: Vec<f32>,
    /// Solid angle of a cell, per row.
    solid_angles: Vec<f32>,
}

/// Up to this ratio of the brightest direction to the mean, chance hits sample an environment well enough.
pub(crate) const MOST_UNEVEN: f32 = 16.0;
/// Up to this ratio of the brightest direction to the mean, scattering directions alone sample an environment best:
/// light sampling costs an extra ray, and is worse where nothing blocks the light.
const EVEN: f32 = 2.0;
/// Least share of the total at which the even part of an environment becomes a separate light.
const LEAST_EVEN: f64 = 0.05;

/// Least density, relative to the mean, of cells that are not black, so that single-precision sums never lose them next
/// to a sun.
const FLOOR: f64 = 1.0 / 32.0;

impl Environment {
    /// `image`: lat-long radiance, not negative (see the module for its orientation); `None`: uniform. `scale`: factor
    /// on it, or the constant itself, W/(m^2 sr). `render_from_env`: orientation of the image's space; its columns are
    /// orthonormal.
    pub fn new(image: Option<Arc<Image>>, scale: Rgb, render_from_env: Mat3) -> Self {
        let (table, fluence) = match &image {
            Some(image) => Table::new(image, scale),
            None => (None, scale * (4.0 * PI)),
        };
        Self {
            unevenness: unevenness(image.as_deref(), scale, fluence),
            image,
            scale,
            render_from_env,
            table: table.map(Arc::new),
            fluence,
        }
    }

    /// Splits an image into one or two environments whose sum it is. Where a sun is much brighter than the sky: the
    /// sky, including a sky-bright share of the sun, which paths meet by chance; and the rest of the sun, which needs
    /// light sampling.
    pub fn sky_and_suns(image: &Arc<Image>, scale: Rgb, render_from_env: Mat3) -> Vec<Self> {
        let new = |image| Self::new(Some(image), scale, render_from_env);
        let all = new(image.clone());
        if all.unevenness() <= MOST_UNEVEN {
            return vec![all];
        }
        let Some(most) = radiance_of_sky(image, scale) else {
            return vec![all];
        };
        let part = |part: fn(Rgb, Rgb) -> Rgb| {
            let of_sky = |p: Rgb| p * (most / mean(p * scale)).min(1.0);
            let pixels = image.pixels.iter().map(|p| match mean(*p * scale) > most {
                true => part(*p, of_sky(*p)),
                false => part(*p, *p),
            });
            let pixels = pixels.collect();
            let [width, height] = [image.width, image.height];
            new(Arc::new(Image {
                width,
                height,
                pixels,
                alpha: Vec::new(),
            }))
        };
        vec![part(|_, sky| sky), part(|all, sky| all - sky)]
    }

    /// The radiance, if it is uniform; W/(m^2 sr).
    pub fn constant(&self) -> Option<Rgb> {
        self.image.is_none().then_some(self.scale)
    }

    /// Its image and sampling tables, if it is an image that is not black.
    pub fn map(&self) -> Option<EnvironmentMap<'_>> {
        let (Some(image), Some(table)) = (&self.image, &self.table) else {
            return None;
        };
        let axes = self.render_from_env;
        Some(EnvironmentMap {
            image,
            scale: self.scale,
            axes: [axes.x_axis, axes.y_axis, axes.z_axis],
            rows: &table.rows,
            cells: &table.cells,
            solid_angles: &table.solid_angles,
        })
    }

    /// Integral of the radiance over all directions, W/m^2.
    pub fn fluence(&self) -> Rgb {
        self.fluence
    }

    /// Radiance that arrives from `dir` (unit, towards the environment), W/(m^2 sr).
    pub fn radiance(&self, dir: Vec3) -> Rgb {
        self.radiance_at(&self.place(dir))
    }

    /// The image position of a direction (unit, towards the environment), for [`Self::radiance_at`] and
    /// [`Self::pdf_at`].
    #[inline]
    pub fn place(&self, dir: Vec3) -> ImagePoint {
        let dir = || self.env_from_render(dir);
        ImagePoint(
            (self.image.as_ref())
                .map(|image| Lattice::of(image.width, image.height, dir()))
                .unwrap_or_default(),
        )
    }

    /// Whether directions have the same image positions in another environment.
    #[inline]
    pub fn has_places_of(&self, other: &Self) -> bool {
        let size = |environment: &Self| environment.image.as_ref().map(|image| [image.width, image.height]);
        size(self) == size(other) && self.render_from_env == other.render_from_env
    }

    /// [`Self::radiance`] at a known position.
    #[inline]
    pub fn radiance_at(&self, ImagePoint(at): &ImagePoint) -> Rgb {
        let Some(image) = &self.image else {
            return self.scale;
        };
        let pixel = |x: usize, y: usize| image.pixels[y * image.width as usize + x];
        let next = (at.column + 1) % image.width as usize;
        let below = (at.row + 1).min(image.height as usize - 1);
        let upper = pixel(at.column, at.row).lerp(pixel(next, at.row), at.across);
        let lower = pixel(at.column, below).lerp(pixel(next, below), at.across);
        upper.lerp(lower, at.down) * self.scale
    }

    /// Draws a direction, roughly in proportion to the radiance.
    pub fn sample(&self, u: Vec2) -> EnvironmentSample {
        match &self.table {
            Some(table) => {
                let (dir, pdf) = table.sample(u);
                EnvironmentSample {
                    dir: self.render_from_env * dir,
                    pdf,
                }
            }
            None => EnvironmentSample {
                dir: warp::uniform_sphere(u),
                pdf: warp::uniform_sphere_pdf(),
            },
        }
    }

    /// Density per solid angle of [`Self::sample`].
    pub fn pdf(&self, dir: Vec3) -> f32 {
        match &self.table {
            Some(_) => self.pdf_at(&self.place(dir)),
            None => warp::uniform_sphere_pdf(),
        }
    }

    /// [`Self::pdf`] at a known position.
    #[inline]
    pub fn pdf_at(&self, ImagePoint(at): &ImagePoint) -> f32 {
        match &self.table {
            Some(table) => table.pdf(at),
            None => warp::uniform_sphere_pdf(),
        }
    }

    /// Whether some directions are brighter than others.
    pub fn is_uneven(&self) -> bool {
        self.table.is_some()
    }

    /// Radiance of the brightest direction over the mean of all, at least 1: by the mean channel.
    pub fn unevenness(&self) -> f32 {
        self.unevenness
    }

    /// Whether no direction is much brighter than the mean.
    pub fn is_even(&self) -> bool {
        self.unevenness() <= EVEN
    }

    fn env_from_render(&self, dir: Vec3) -> Vec3 {
        self.render_from_env.transpose() * dir
    }
}

fn unevenness(image: Option<&Image>, scale: Rgb, fluence: Rgb) -> f32 {
    let total = mean(fluence);
    match image {
        Some(image) if total > 0.0 => {
            let pixels = image.pixels.iter().map(|p| mean(*p * scale));
            pixels.fold(0.0, f32::max) * (4.0 * PI) / total
        }
        _ => 1.0,
    }
}

/// The most radiance that a direction of an image's even part may have, mean channel, W/(m^2 sr); none if the even part
/// is negligible.
fn radiance_of_sky(image: &Image, scale: Rgb) -> Option<f32> {
    let rows = image.pixels.chunks_exact(image.width as usize).enumerate();
    let rows = rows.map(|(row, pixels)| {
        let theta = std::f64::consts::PI * (row as f64 + 0.5) / f64::from(image.height);
        (libm::sin(theta), pixels)
    });
    let weights: f64 = rows.clone().map(|(sin, row)| sin * row.len() as f64).sum();
    let mean_below = |most: f64| {
        let of = |row: &[Rgb]| -> f64 {
            let values = row.iter().map(|p| f64::from(mean(*p * scale)));
            values.map(|v| v.min(most)).sum()
        };
        rows.clone().map(|(sin, row)| sin * of(row)).sum::<f64>() / weights
    };
    let all = mean_below(f64::INFINITY);
    let mut below = all;
    loop {
        // Half of the allowed value, because the mean falls with it.
        let most = 0.5 * f64::from(MOST_UNEVEN) * below;
        below = mean_below(most);
        if below < LEAST_EVEN * all {
            return None;
        }
        if most <= 0.9 * f64::from(MOST_UNEVEN) * below {
            return Some(most as f32);
        }
    }
}

/// A direction's position among the pixels of an environment's image; arbitrary without an image.
#[derive(Clone, Copy, Debug)]
pub struct ImagePoint(Lattice);

/// Where a direction falls among the pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Lattice {
    /// Pixel column to the left.
    column: usize,
    /// Pixel row above.
    row: usize,
    /// From that column to the next, in [0, 1].
    across: f32,
    /// From that row to the next, in [0, 1].
    down: f32,
}

impl Lattice {
    fn of(width: u32, height: u32, dir: Vec3) -> Self {
        let sin_theta = Vec2::new(dir.x, dir.z).length();
        let theta = atan2(sin_theta, dir.y);
        let phi = atan2(dir.x, -dir.z);
        let x = phi * (0.5 / PI) * width as f32 - 0.5;
        let y = (theta * (1.0 / PI)).clamp(0.0, 1.0) * (height - 1) as f32;
        let column = x.floor();
        let row = y.floor().min((height.max(2) - 2) as f32);
        Self {
            column: (column as i64).rem_euclid(i64::from(width)) as usize,
            row: row as usize,
            across: x - column,
            down: y - row,
        }
    }
}

impl Table {
    /// The table, unless the image is black, and the integral of the scaled radiance.
    fn new(image: &Image, scale: Rgb) -> (Option<Self>, Rgb) {
        let (columns, height) = (image.width as usize, image.height as usize);
        let bands = (height - 1).max(1);
        let step = std::f64::consts::PI / bands as f64;
        let azimuth = 2.0 * std::f64::consts::PI / columns as f64;
        let mut weights = Vec::with_capacity(columns * bands);
        let mut solid_angles = Vec::with_capacity(bands);
        let mut fluence = glam::DVec3::ZERO;
        for row in 0..bands {
            let above = &image.pixels[row * columns..][..columns];
            let below = &image.pixels[(row + 1).min(height - 1) * columns..][..columns];
            let band = Band::new(row as f64 * step, (row + 1) as f64 * step);
            solid_angles.push(azimuth * (band.above + band.below));
            for column in 0..columns {
                let next = (column + 1) % columns;
                let upper = (above[column] + above[next]) * scale;
                let lower = (below[column] + below[next]) * scale;
                let flux = (upper.as_dvec3() * band.above + lower.as_dvec3() * band.below) * 0.5 * azimuth;
                fluence += flux;
                weights.push((flux.x + flux.y + flux.z) / 3.0);
            }
        }
        let total: f64 = weights.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return (None, fluence.as_vec3());
        }
        let least = FLOOR * total / (4.0 * std::f64::consts::PI);
        for (row, solid_angle) in weights.chunks_exact_mut(columns).zip(&solid_angles) {
            for weight in row.iter_mut().filter(|w| **w > 0.0) {
                *weight = weight.max(least * solid_angle);
            }
        }
        let table = Self {
            columns,
            rows: cdf::running_sums(
                &weights
                    .chunks_exact(columns)
                    .map(|row| row.iter().sum())
                    .collect::<Vec<f64>>(),
            ),
            cells: weights
                .chunks_exact(columns)
                .flat_map(|row| {
                    if row.iter().any(|&w| w > 0.0) {
                        cdf::running_sums(row)
                    } else {
                        vec![0.0; columns]
                    }
                })
                .collect(),
            solid_angles: solid_angles.iter().map(|&s| s as f32).collect(),
        };
        (Some(table), fluence.as_vec3())
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.cells[row * self.columns..][..self.columns]
    }

    fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let row = cdf::choose(&self.rows, u.y);
        let column = cdf::choose(self.row(row.index), u.x);
        let pdf = row.pmf * column.pmf / self.solid_angles[row.index];

        // Uniform per solid angle is uniform in 1 - |cos theta|, measured from the nearer pole for precision.
        let step = PI / self.rows.len() as f32;
        let south = 2 * row.index >= self.rows.len();
        let (pole_row, along) = if south {
            (self.rows.len() - 1 - row.index, 1.0 - row.u)
        } else {
            (row.index, row.u)
        };
        let (half_sin, _) = sin_cos(0.5 * step * pole_row as f32);
        let height = self.solid_angles[row.index] * (self.columns as f32 * (0.5 / PI));
        let one_minus_cos = 2.0 * half_sin * half_sin + along * height;
        let sin_theta = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let cos_theta = if south {
            one_minus_cos - 1.0
        } else {
            1.0 - one_minus_cos
        };
        let turns = (column.index as f32 + 0.5 + column.u) / self.columns as f32;
        let (sin_phi, cos_phi) = sin_cos(2.0 * PI * turns);
        let dir = Vec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta);
        (dir.normalize(), pdf)
    }

    fn pdf(&self, at: &Lattice) -> f32 {
        let row_pmf = cdf::pmf(&self.rows, at.row);
        row_pmf * cdf::pmf(self.row(at.row), at.column) / self.solid_angles[at.row]
    }
}

/// Integrals of the two hat functions of a row of cells between polar angles, times sin theta.
struct Band {
    above: f64,
    below: f64,
}

impl Band {
    fn new(from: f64, to: f64) -> Self {
        let width = to - from;
        let below = (libm::sin(to) - libm::sin(from)) / width - libm::cos(to);
        let both = 2.0 * libm::sin(0.5 * (from + to)) * libm::sin(0.5 * width);
        Self {
            above: both - below,
            below,
        }
    }
}
