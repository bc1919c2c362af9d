//! Layers that a pass renders besides the beauty, on request.

use crate::film::Film;
use std::fmt;
use std::str::FromStr;

/// Most layers of a job, and most characters of a light group's name.
pub const MAX_LAYERS: usize = 256;
const MAX_NAME: usize = 64;
/// Prefix of the names of light groups' layers.
pub const LIGHT: &str = "light_";

/// A layer: one more image of every pass, averaged like the beauty.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// Share of the pixel that surfaces and media cover: one minus the share of environment light that gets through
    /// straight. Glass covers.
    Alpha,
    /// Distance of the first surface along the camera's axis, scene units; if there is none, infinite or what the scene
    /// says. Boundaries of media are not surfaces, here and for the next two layers.
    Depth,
    /// Unit shading normal of the first surface in world space; 0 if there is none.
    Normal,
    /// Approximate reflectance of the first surface: the share of uniform light that it reflects and lets through; 0 if
    /// there is none.
    Albedo,
    /// Radiance of visible lights, and of surfaces lit straight by lights.
    Direct,
    /// All other radiance of surfaces, from light that met a surface or a medium before.
    Surface,
    /// Radiance that media scatter towards the camera path.
    Volume,
    /// All radiance that comes from one group of lights.
    Light(LightGroup),
    /// How the visible point moves in the image, in pixels per frame, to the right and up: the first surface, or what
    /// is infinitely far away. What lenses, mirrors and media show is ignored.
    Motion,
    /// Number of photon beams that contribute to the pixel.
    BeamDensity,
    /// Number of photon targets before the first surface, or on it.
    Targets,
    /// The radiance of passes of odd index, black in those of even index; [`denoise`](crate::denoise) uses it to tell
    /// noise from picture. Like every layer's, its mean is over all passes: about half of the beauty.
    Odd,
    /// Which objects cover the pixel: a [`Matte`](crate::matte::Matte), not a film. Mattes come last in a job.
    Objects,
    /// Which materials cover the pixel: a matte, too.
    Materials,
}

/// What a matte distinguishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatteKind {
    /// Objects.
    Objects,
    /// Materials.
    Materials,
}

impl MatteKind {
    /// The name by which viewers know the matte, by the Cryptomatte convention.
    pub fn name(self) -> &'static str {
        match self {
            Self::Objects => "CryptoObject",
            Self::Materials => "CryptoMaterial",
        }
    }
}

/// The number of a job's layers, of both kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LayerCounts {
    /// Images of numbers, which come first.
    pub films: usize,
    /// Mattes.
    pub mattes: usize,
}

impl LayerCounts {
    /// The counts for these layers.
    pub fn of(layers: &[Layer]) -> Self {
        let mattes = layers.iter().filter(|layer| layer.matte().is_some()).count();
        Self {
            films: layers.len() - mattes,
            mattes,
        }
    }

    /// The counts for layers of these names.
    pub fn of_names(names: &[String]) -> Self {
        let layers: Vec<Layer> = names.iter().filter_map(|name| name.parse().ok()).collect();
        Self {
            films: names.len() - Self::of(&layers).mattes,
            ..Self::of(&layers)
        }
    }
}

impl From<usize> for LayerCounts {
    /// This many films, and no mattes.
    fn from(films: usize) -> Self {
        Self { films, mattes: 0 }
    }
}

impl fmt::Display for LayerCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} layers", self.films)?;
        match self.mattes {
            0 => Ok(()),
            mattes => write!(f, " and {mattes} mattes"),
        }
    }
}

/// Name of a group of lights: 1 to 64 letters, digits, and `_`, `-`, `+`, `#`, `:`, `[`, `]`, `(`, `)` or space.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LightGroup(String);

impl LightGroup {
    /// The group that a scene gives this name. Characters that a channel's name cannot hold become `_`; names are cut
    /// to 64 characters.
    pub fn named(name: &str) -> Self {
        let character = |c: char| if is_plain(c) { c } else { '_' };
        let name: String = name.chars().take(MAX_NAME).map(character).collect();
        Self(if name.is_empty() { "_".into() } else { name })
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

fn is_plain(c: char) -> bool {
    c.is_ascii_alphanumeric() || "_-+#:[]() ".contains(c)
}

/// Text that names no layer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no layer `{0}`")]
pub struct LayerError(String);

impl Layer {
    /// The kind of [`Matte`](crate::matte::Matte), if it is one.
    pub fn matte(&self) -> Option<MatteKind> {
        match self {
            Self::Objects => Some(MatteKind::Objects),
            Self::Materials => Some(MatteKind::Materials),
            _ => None,
        }
    }

    /// Names of a block's channels, without the layer's own. There are as many as the layer uses of a pixel's values.
    pub fn channels(&self) -> &'static [&'static str] {
        match self {
            Self::Alpha => &["A"],
            Self::Objects | Self::Materials => &[],
            // No sum may hold infinities, so distances are summed only where there is one, along with their number.
            Self::Depth => &["Z", "coverage"],
            Self::Motion => &["u", "v"],
            Self::BeamDensity | Self::Targets => &["Y"],
            Self::Normal => &["X", "Y", "Z"],
            _ => &["R", "G", "B"],
        }
    }
}

impl Layer {
    /// Prefix of the layer's channels in a final image.
    pub fn prefix(&self) -> String {
        match (self, self.matte()) {
            // Where viewers and compositors expect it.
            (Self::Alpha, _) => "A".into(),
            (_, Some(kind)) => kind.name().into(),
            _ => format!("{self}."),
        }
    }

    /// The layer's channels in a final image, full names with values, from the layer's mean. `empty_depth`: the value
    /// where there is nothing.
    pub fn in_image(&self, mean: &Film, empty_depth: f32) -> Vec<(String, Vec<f32>)> {
        let values = |value: &dyn Fn(&[f32; 3]) -> f32| mean.pixels.iter().map(value).collect();
        match self {
            Self::Alpha => vec![(self.prefix(), values(&|pixel| pixel[0].clamp(0.0, 1.0)))],
            Self::Depth => vec![(
                format!("{}Z", self.prefix()),
                values(&|pixel| distance(pixel).unwrap_or(empty_depth)),
            )],
            _ => {
                let channels = self.channels().iter().enumerate();
                channels
                    .map(|(c, name)| (format!("{}{name}", self.prefix()), values(&|pixel| pixel[c])))
                    .collect()
            }
        }
    }
}

/// The mean distance over the covered share of a pixel, if any is covered.
pub fn distance([z, coverage, _]: &[f32; 3]) -> Option<f32> {
    (*coverage > 0.0).then(|| z / coverage)
}

/// The names of all layers except those of light groups.
const NAMES: [(Layer, &str); 13] = [
    (Layer::Alpha, "alpha"),
    (Layer::Depth, "depth"),
    (Layer::Normal, "normal"),
    (Layer::Albedo, "albedo"),
    (Layer::Direct, "direct"),
    (Layer::Surface, "surface"),
    (Layer::Volume, "volume"),
    (Layer::Motion, "motion"),
    (Layer::BeamDensity, "beam_density"),
    (Layer::Targets, "targets"),
    (Layer::Odd, "odd"),
    (Layer::Objects, "crypto_object"),
    (Layer::Materials, "crypto_material"),
];

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Light(group) => write!(f, "{LIGHT}{}", group.0),
            _ => {
                let known = NAMES.iter().find(|(layer, _)| layer == self);
                f.write_str(known.map_or("", |(_, name)| name))
            }
        }
    }
}

impl FromStr for Layer {
    type Err = LayerError;

    fn from_str(name: &str) -> Result<Self, LayerError> {
        if let Some((layer, _)) = NAMES.iter().find(|(_, known)| *known == name) {
            return Ok(layer.clone());
        }
        match name.strip_prefix(LIGHT) {
            Some(group) if LightGroup::named(group).0 == group => Ok(Self::Light(LightGroup(group.into()))),
            _ => Err(LayerError(name.chars().take(MAX_NAME).collect())),
        }
    }
}

/// The layers of these names, without duplicates, mattes last.
pub fn parse_all<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> Result<Vec<Layer>, LayerError> {
    let count = names.len();
    if count > MAX_LAYERS {
        return Err(LayerError(format!("{count} layers, more than {MAX_LAYERS}")));
    }
    let mut layers = Vec::with_capacity(count);
    for name in names {
        let layer: Layer = name.parse()?;
        if layers.contains(&layer) {
            return Err(LayerError(format!("{layer}, a second time")));
        }
        if layer.matte().is_none() && layers.iter().any(|before| before.matte().is_some()) {
            return Err(LayerError(format!("{layer}, after a matte")));
        }
        layers.push(layer);
    }
    Ok(layers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_share_that_has_one() {
        let mut mean = Film::new(3, 1);
        mean.pixels = vec![[0.0; 3], [1.5, 0.25, 0.0], [3.0, 1.0, 0.0]];
        for empty in [f32::INFINITY, 1e10] {
            let channels = Layer::Depth.in_image(&mean, empty);
            assert_eq!(channels, [("depth.Z".to_string(), vec![empty, 6.0, 3.0])]);
        }
        mean.pixels = vec![[-0.1, 0.0, 0.0], [0.5, 0.0, 0.0], [1.01, 0.0, 0.0]];
        let channels = Layer::Alpha.in_image(&mean, 1e10);
        assert_eq!(channels, [("A".to_string(), vec![0.0, 0.5, 1.0])]);
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        let layers = [
            Layer::Alpha,
            Layer::Depth,
            Layer::Normal,
            Layer::Albedo,
            Layer::Direct,
            Layer::Surface,
            Layer::Volume,
            Layer::Motion,
            Layer::BeamDensity,
            Layer::Targets,
            Layer::Odd,
            Layer::Light(LightGroup::named("key light")),
            Layer::Light(LightGroup::named("")),
            Layer::Light(LightGroup::named("a.b/ü")),
            Layer::Objects,
            Layer::Materials,
        ];
        let names = layers.each_ref().map(Layer::to_string);
        assert_eq!(names[13], "light_a_b__");
        assert!(names.iter().all(|name| !name.is_empty()));
        let read = parse_all(names.iter().map(String::as_str)).unwrap();
        assert_eq!(read, layers);
        for bad in ["", "beauty", "Depth", "light_", "light_a.b"] {
            assert!(bad.parse::<Layer>().is_err(), "{bad}");
        }
        let long = format!("light_{}", "x".repeat(MAX_NAME + 1));
        assert!(long.parse::<Layer>().is_err());
        assert!(parse_all(["depth", "depth"].into_iter()).is_err());
        assert!(parse_all(["crypto_object", "depth"].into_iter()).is_err());
        let counts = LayerCounts::of(&layers);
        assert_eq!(counts.to_string(), "14 layers and 2 mattes");
    }
}
