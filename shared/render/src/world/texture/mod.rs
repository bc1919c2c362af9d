//! Values over a surface: a constant, an image, a checkerboard, vertex colours, or a node graph.

pub mod graph;

use crate::math::{Rgb, Vec2, luminance};
use glam::Affine2;
use graph::{Place, Program};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// An RGB value per surface point.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image over the unit square of UV. v runs upwards: the first row is v = 1.
    Image {
        /// Its pixels.
        image: Arc<Image>,
        /// Interpolation between pixels.
        filter: TextureFilter,
        /// Continuation outside the unit square.
        wrap: Wrap,
        /// Applied to the surface's coordinates first; usually the identity.
        image_from_uv: Affine2,
    },
    /// Squares with sides of 1/2.
    Checkerboard {
        /// The first where both coordinates are in the lower or both in the upper halves of their unit intervals.
        colors: [Rgb; 2],
        /// Applied to the surface's coordinates first.
        squares_from_uv: Affine2,
    },
    /// The interpolated colours of a mesh's vertices, times another texture, if any.
    VertexColors(Option<Arc<Texture>>),
    /// A compiled node graph.
    Graph(Arc<Program>),
}

/// The inputs of a texture lookup: data of a surface point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexturePoint {
    /// Texture coordinates.
    pub uv: Vec2,
    /// Interpolated vertex colour, if the mesh has one.
    pub color: Rgb,
    /// Inputs of graphs, if the surface has one.
    pub place: Place,
}

impl TexturePoint {
    /// A point with texture coordinates only.
    pub const fn of_uv(uv: Vec2) -> Self {
        Self {
            uv,
            color: Rgb::ZERO,
            place: Place::NOWHERE,
        }
    }
}

/// Interpolation of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFilter {
    /// Linearly between the centres of pixels.
    #[default]
    Bilinear,
    /// None.
    Nearest,
}

/// Continuation of an image beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeated.
    #[default]
    Repeat,
    /// Mirrored at each edge.
    Mirror,
    /// With the pixels at its edge.
    Clamp,
}

/// Linear RGB pixels, row by row from the top left.
#[derive(Clone)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<Rgb>,
    /// Opacity of the pixels, in [0, 1]; empty if all are 1.
    pub alpha: Vec<f32>,
}

/// Prints small images in full, and a fingerprint of large ones.
impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.pixels.len() <= 16 {
            let Self {
                width,
                height,
                pixels,
                alpha,
            } = self;
            return write!(f, "Image({width} x {height}, {pixels:?}, {alpha:?})");
        }
        let mut hasher = DefaultHasher::new();
        let bits = |pixel: &Rgb| pixel.to_array().map(f32::to_bits);
        self.pixels.iter().for_each(|pixel| bits(pixel).hash(&mut hasher));
        self.alpha.iter().for_each(|alpha| alpha.to_bits().hash(&mut hasher));
        write!(f, "Image({} x {}, {:016x})", self.width, self.height, hasher.finish())
    }
}

impl Texture {
    /// The value at a point. Finite colours and pixels give finite values for any finite coordinates.
    #[inline]
    pub fn eval(&self, at: &TexturePoint) -> Rgb {
        let uv = at.uv;
        match self {
            Self::Constant(c) => *c,
            Self::Image {
                image,
                filter,
                wrap,
                image_from_uv,
            } => image.eval(transform(image_from_uv, uv), *filter, *wrap),
            Self::Checkerboard {
                colors,
                squares_from_uv,
            } => {
                let uv = transform(squares_from_uv, uv);
                let upper = |t: f32| t - t.floor() > 0.5;
                colors[usize::from(upper(uv.x) != upper(uv.y))]
            }
            Self::VertexColors(None) => at.color,
            Self::VertexColors(Some(times)) => at.color * times.eval(at),
            Self::Graph(program) => program.eval(at),
        }
    }
}

impl Texture {
    /// Whether it varies with texture coordinates.
    pub fn reads_uv(&self) -> bool {
        match self {
            Self::Constant(_) | Self::VertexColors(None) => false,
            Self::Image { .. } | Self::Checkerboard { .. } => true,
            Self::VertexColors(Some(times)) => times.reads_uv(),
            Self::Graph(program) => program.reads().uv,
        }
    }

    /// Whether it reads vertex colours.
    pub fn reads_colors(&self) -> bool {
        match self {
            Self::VertexColors(_) => true,
            Self::Graph(program) => program.reads().colors,
            Self::Constant(_) | Self::Image { .. } | Self::Checkerboard { .. } => false,
        }
    }

    /// Whether it is a graph that reads more of a point than UV and vertex colours.
    pub fn reads_place(&self) -> bool {
        matches!(self, Self::Graph(program) if program.reads().place)
    }

    /// Whether any of its parts has a value above zero.
    pub fn may_be_positive(&self) -> bool {
        let is_positive = |value: &Rgb| value.max_element() > 0.0;
        match self {
            Self::Constant(value) => is_positive(value),
            Self::Image { image, .. } => image.pixels.iter().any(is_positive),
            Self::Checkerboard { colors, .. } => colors.iter().any(is_positive),
            Self::VertexColors(times) => times.as_ref().is_none_or(|times| times.may_be_positive()),
            Self::Graph(program) => program.range()[1] > 0.0,
        }
    }

    /// The least and the largest value of the first channel.
    pub fn range_of_red(&self) -> [f32; 2] {
        let over = |values: &mut dyn Iterator<Item = Rgb>| {
            let start = [f32::INFINITY, f32::NEG_INFINITY];
            values.fold(start, |[low, high], value| [low.min(value.x), high.max(value.x)])
        };
        match self {
            Self::Constant(value) => [value.x; 2],
            Self::Image { image, .. } => over(&mut image.pixels.iter().copied()),
            Self::Checkerboard { colors, .. } => over(&mut colors.iter().copied()),
            Self::VertexColors(_) => [0.0, 1.0],
            Self::Graph(program) => program.range(),
        }
    }

    /// The least and the largest value of any channel.
    pub fn range(&self) -> [f32; 2] {
        let over = |values: &[Rgb]| {
            values
                .iter()
                .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| {
                    [low.min(value.min_element()), high.max(value.max_element())]
                })
        };
        match self {
            Self::Constant(value) => over(&[*value]),
            Self::Image { image, .. } => over(&image.pixels),
            Self::Checkerboard { colors, .. } => over(colors),
            Self::VertexColors(_) => [f32::NEG_INFINITY, f32::INFINITY],
            Self::Graph(program) => program.range(),
        }
    }

    /// Derivatives of the luminance by u and v. Zero for checkerboards and images without interpolation, which only
    /// have steps; and for graphs, whose slopes come from lookups next to the point.
    pub fn gradient(&self, uv: Vec2) -> Vec2 {
        match self {
            Self::Image {
                image,
                filter: TextureFilter::Bilinear,
                wrap,
                image_from_uv,
            } => {
                let by_image = image.gradient(transform(image_from_uv, uv), *wrap);
                image_from_uv.matrix2.transpose() * by_image
            }
            Self::Image {
                filter: TextureFilter::Nearest,
                ..
            }
            | Self::Constant(_)
            | Self::Checkerboard { .. }
            | Self::VertexColors(_)
            | Self::Graph(_) => Vec2::ZERO,
        }
    }
}

/// From here on single precision has no fractions.
const NO_FRACTIONS: Vec2 = Vec2::splat(8_388_608.0);

fn transform(map: &Affine2, uv: Vec2) -> Vec2 {
    let uv = map.transform_point2(uv);
    // Avoids overflow of the value and of the difference of two.
    uv.max(-NO_FRACTIONS).min(NO_FRACTIONS)
}

impl Image {
    /// The value at `uv`, with pixel centres at (i + 1/2) / width, v upwards. Far from the unit square, precision is
    /// limited to what single precision leaves.
    #[inline]
    pub fn eval(&self, uv: Vec2, filter: TextureFilter, wrap: Wrap) -> Rgb {
        // Rows count from the top, v from the bottom.
        let (x, y) = match wrap {
            Wrap::Repeat => (fraction(uv.x), 1.0 - fraction(uv.y)),
            Wrap::Mirror => (mirrored(uv.x), 1.0 - mirrored(uv.y)),
            Wrap::Clamp => (uv.x.clamp(0.0, 1.0), 1.0 - uv.y.clamp(0.0, 1.0)),
        };
        let repeats = wrap == Wrap::Repeat;
        match filter {
            TextureFilter::Bilinear => {
                self.bilinear(neighbours(x, self.width, repeats), neighbours(y, self.height, repeats))
            }
            TextureFilter::Nearest => {
                let nearest = |t: f32, n: u32| ((t * n as f32) as usize).min(n as usize - 1);
                self.pixels[nearest(y, self.height) * self.width as usize + nearest(x, self.width)]
            }
        }
    }

    fn gradient(&self, uv: Vec2, wrap: Wrap) -> Vec2 {
        let ((x, to_right), (y, upwards)) = match wrap {
            Wrap::Repeat => ((fraction(uv.x), 1.0), (fraction(uv.y), 1.0)),
            Wrap::Mirror => {
                let sign = |t: f32| if fraction(0.5 * t) > 0.5 { -1.0 } else { 1.0 };
                ((mirrored(uv.x), sign(uv.x)), (mirrored(uv.y), sign(uv.y)))
            }
            Wrap::Clamp => ((uv.x.clamp(0.0, 1.0), 1.0), (uv.y.clamp(0.0, 1.0), 1.0)),
        };
        let repeats = wrap == Wrap::Repeat;
        let x = neighbours(x, self.width, repeats);
        let y = neighbours(1.0 - y, self.height, repeats);
        let at = |x: usize, y: usize| luminance(self.pixels[y * self.width as usize + x]);
        let (a, b) = (at(x.first, y.first), at(x.second, y.first));
        let (c, d) = (at(x.first, y.second), at(x.second, y.second));
        let by_column = (b - a) * (1.0 - y.fraction) + (d - c) * y.fraction;
        let by_row = (c - a) * (1.0 - x.fraction) + (d - b) * x.fraction;
        Vec2::new(
            by_column * to_right * self.width as f32,
            -by_row * upwards * self.height as f32,
        )
    }

    #[inline]
    fn bilinear(&self, x: Neighbours, y: Neighbours) -> Rgb {
        let row0 = y.first * self.width as usize;
        let row1 = y.second * self.width as usize;
        let mix = |a: usize, b: usize, t: f32| self.pixels[a] * (1.0 - t) + self.pixels[b] * t;
        let top = mix(row0 + x.first, row0 + x.second, x.fraction);
        let bottom = mix(row1 + x.first, row1 + x.second, x.fraction);
        top * (1.0 - y.fraction) + bottom * y.fraction
    }
}

/// In [0, 1]: rounding may reach 1.
#[inline]
fn fraction(t: f32) -> f32 {
    t - t.floor()
}

/// The triangle wave that is t on [0, 1].
#[inline]
fn mirrored(t: f32) -> f32 {
    let within = 2.0 * fraction(0.5 * t);
    if within > 1.0 { 2.0 - within } else { within }
}

/// Two pixels of a row whose centres enclose a coordinate, and its relative position between them.
struct Neighbours {
    first: usize,
    second: usize,
    fraction: f32,
}

/// The neighbours of `t`, in [0, 1], in a row of `n`. Beyond the ends the neighbour is the opposite pixel, or the same
/// one.
#[inline]
fn neighbours(t: f32, n: u32, repeats: bool) -> Neighbours {
    // In [-1/2, n - 1/2].
    let x = t * n as f32 - 0.5;
    let floor = x.floor();
    let last = n as usize - 1;
    let (first, second) = if floor < 0.0 {
        (if repeats { last } else { 0 }, 0)
    } else {
        let first = (floor as usize).min(last);
        let beyond = if repeats { 0 } else { last };
        (first, if first == last { beyond } else { first + 1 })
    };
    Neighbours {
        first,
        second,
        fraction: x - floor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::PI;

    /// 3 x 2 pixels, numbered row by row from the top left.
    fn image() -> Image {
        Image {
            alpha: Vec::new(),
            width: 3,
            height: 2,
            pixels: (0..6).map(|i| Rgb::splat(i as f32)).collect(),
        }
    }

    fn bilinear(image: &Image, u: f32, v: f32) -> f32 {
        let uv = Vec2::new(u, v);
        image.eval(uv, TextureFilter::Bilinear, Wrap::Repeat).x
    }

    #[test]
    fn pixel_centres_give_the_pixels_and_v_runs_upwards() {
        let image = image();
        for y in 0..2 {
            for x in 0..3 {
                let uv = Vec2::new((x as f32 + 0.5) / 3.0, 1.0 - (y as f32 + 0.5) / 2.0);
                for shift in [Vec2::ZERO, Vec2::new(-2.0, 5.0), Vec2::new(7.0, -1.0)] {
                    let value = bilinear(&image, uv.x + shift.x, uv.y + shift.y);
                    assert!((value - (3 * y + x) as f32).abs() < 1e-5, "{x} {y}: {value}");
                }
            }
        }
    }

    #[test]
    fn between_centres_it_is_linear_and_wraps() {
        let image = image();
        let value = |u, v| bilinear(&image, u, v);
        assert!((value(1.0 / 3.0, 0.75) - 0.5).abs() < 1e-6);
        assert!((value(0.0, 0.75) - 1.0).abs() < 1e-6, "pixels 2 and 0");
        assert!((value(0.5, 0.5) - 2.5).abs() < 1e-6, "pixels 1 and 4");
        assert!((value(0.5, 0.0) - 2.5).abs() < 1e-6, "pixels 4 and 1");
    }

    #[test]
    fn gradients_are_those_of_the_values() {
        let coarse = image();
        let step = 1e-3;
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for image_from_uv in [
                Affine2::IDENTITY,
                Affine2::from_scale_angle_translation(Vec2::new(1.5, -0.75), 0.6, Vec2::new(0.2, 0.1)),
            ] {
                let texture = Texture::Image {
                    image: Arc::new(coarse.clone()),
                    filter: TextureFilter::Bilinear,
                    wrap,
                    image_from_uv,
                };
                let mut compared = 0;
                for (u, v) in POINTS {
                    let uv = Vec2::new(u, v);
                    let slope = |axis: Vec2, d: f32| {
                        let value = |t: f32| texture.eval(&TexturePoint::of_uv(uv + axis * t)).x;
                        (value(d) - value(0.0)) / d
                    };
                    let gradient = texture.gradient(uv);
                    for (axis, part) in [(Vec2::X, gradient.x), (Vec2::Y, gradient.y)] {
                        let (below, above) = (slope(axis, -step), slope(axis, step));
                        // Skips edges between pixels, where the value jumps.
                        if (below - above).abs() < 0.05 {
                            assert!((part - above).abs() < 0.05, "{wrap:?} {uv}: {part} {above}");
                            compared += 1;
                        }
                    }
                }
                assert!(compared > 14);
            }
        }
    }

    #[test]
    fn any_finite_coordinate_is_finite() {
        let single = Image {
            alpha: Vec::new(),
            width: 1,
            height: 1,
            pixels: vec![Rgb::ONE],
        };
        let values = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1e-30,
            -1e-30,
            -1e-8,
            0.999_999_94,
            1e7,
            -1e9,
            f32::MAX,
            f32::MIN,
        ];
        for u in values {
            for v in values {
                for filter in [TextureFilter::Bilinear, TextureFilter::Nearest] {
                    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                        for image_from_uv in [
                            Affine2::IDENTITY,
                            Affine2::from_cols_array(&[1e30, -1e30, 1e30, 1e30, 1e30, 0.0]),
                        ] {
                            let texture = |image: &Image| Texture::Image {
                                image: Arc::new(image.clone()),
                                filter,
                                wrap,
                                image_from_uv,
                            };
                            let value = texture(&image()).eval(&TexturePoint::of_uv(Vec2::new(u, v))).x;
                            assert!((0.0..=5.0).contains(&value));
                            assert_eq!(texture(&single).eval(&TexturePoint::of_uv(Vec2::new(u, v))), Rgb::ONE);
                        }
                    }
                }
            }
        }
    }

    /// Positions at which [`MITSUBA`] was evaluated.
    const POINTS: [(f32, f32); 10] = [
        (0.1, 0.1),
        (0.5, 0.2),
        (0.9, 0.9),
        (0.05, 0.6),
        (-0.2, 0.3),
        (1.1, 1.3),
        (-1.4, -0.6),
        (2.3, -1.2),
        (0.5, 0.55),
        (0.33, 0.45),
    ];

    /// Mitsuba 3.9.1's `bitmap` at [`POINTS`]: `raw`, with the pixels of [`image`] over 8, lower row first, since its v
    /// runs down the rows.
    #[rustfmt::skip]
    const MITSUBA: [(TextureFilter, Wrap, [f32; 10]); 6] = [
        (TextureFilter::Bilinear, Wrap::Repeat,
            [0.3125, 0.4625, 0.3125, 0.2, 0.575, 0.3875, 0.425, 0.0875, 0.275, 0.28625]),
        (TextureFilter::Bilinear, Wrap::Mirror,
            [0.375, 0.5, 0.25, 0.1125, 0.35, 0.2875, 0.275, 0.05, 0.275, 0.28625]),
        (TextureFilter::Bilinear, Wrap::Clamp,
            [0.375, 0.5, 0.25, 0.1125, 0.3375, 0.25, 0.375, 0.625, 0.275, 0.28625]),
        (TextureFilter::Nearest, Wrap::Repeat,
            [0.375, 0.5, 0.25, 0.0, 0.625, 0.375, 0.5, 0.0, 0.125, 0.375]),
        (TextureFilter::Nearest, Wrap::Mirror,
            [0.375, 0.5, 0.25, 0.0, 0.375, 0.25, 0.125, 0.0, 0.125, 0.375]),
        (TextureFilter::Nearest, Wrap::Clamp,
            [0.375, 0.5, 0.25, 0.0, 0.375, 0.25, 0.375, 0.625, 0.125, 0.375]),
    ];

    /// The same, repeated and bilinear, with `to_uv` = [`turned`].
    #[rustfmt::skip]
    const MITSUBA_TURNED: [f32; 10] = [0.366058, 0.277692, 0.344518, 0.375842, 0.404279, 0.387597, 0.296539, 0.236444,
        0.081178, 0.349366];

    /// Mitsuba 3.9.1's `checkerboard` of 0.25 and 0.75, plain and [`turned`].
    const MITSUBA_SQUARES: [[f32; 10]; 2] = [
        [0.25, 0.25, 0.25, 0.75, 0.75, 0.25, 0.75, 0.75, 0.75, 0.25],
        [0.25, 0.25, 0.75, 0.25, 0.75, 0.25, 0.25, 0.75, 0.75, 0.25],
    ];

    /// Scaled by (2, 3), rotated by 30 degrees, moved by (0.3, -0.2).
    fn turned() -> Affine2 {
        Affine2::from_scale_angle_translation(Vec2::ONE, PI / 6.0, Vec2::new(0.3, -0.2))
            * Affine2::from_scale(Vec2::new(2.0, 3.0))
    }

    #[test]
    fn look_ups_agree_with_mitsuba() {
        let (filter, wrap) = Default::default();
        let turned_row = (filter, wrap, turned(), MITSUBA_TURNED);
        let rows = MITSUBA.map(|(filter, wrap, values)| (filter, wrap, Affine2::IDENTITY, values));
        for (filter, wrap, image_from_uv, values) in rows.into_iter().chain([turned_row]) {
            let texture = Texture::Image {
                image: Arc::new(image()),
                filter,
                wrap,
                image_from_uv,
            };
            for ((u, v), expected) in POINTS.into_iter().zip(values) {
                let value = texture.eval(&TexturePoint::of_uv(Vec2::new(u, v))).x / 8.0;
                assert!(
                    (value - expected).abs() < 2e-6,
                    "{filter:?} {wrap:?} at {u} {v}: {value}, not {expected}"
                );
            }
        }
        for (map, values) in [Affine2::IDENTITY, turned()].into_iter().zip(MITSUBA_SQUARES) {
            let texture = Texture::Checkerboard {
                colors: [Rgb::splat(0.25), Rgb::splat(0.75)],
                squares_from_uv: map,
            };
            for ((u, v), expected) in POINTS.into_iter().zip(values) {
                assert_eq!(
                    texture.eval(&TexturePoint::of_uv(Vec2::new(u, v))).x,
                    expected,
                    "{u} {v}"
                );
            }
        }
    }
}
