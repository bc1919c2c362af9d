//! Materials.

use super::ior::IorRecord;
use super::schema::{by_type, defaults};
use super::words::{TextureFilter, Wrap};
use super::{Fault, ImageFile, ScalarRecord, TextureRecord, UvSteps, given, only_takes};
use crate::values::*;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// A surface material.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = MaterialType::narrow)]
pub struct MaterialRecord {
    /// Kind of material.
    #[serde(rename = "type")]
    pub kind: Spanned<MaterialType>,
    /// Reflectance, 0 to 1. Default: 0.5 of diffuse bases, 1 of metals and mirrors.
    pub reflectance: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of light transmitted, equally in all directions, 0 to 1. Default: 0.5.
    pub transmittance: Option<Spanned<TextureRecord<Unit>>>,
    /// Whether both sides reflect. Default: only metals and mirrors.
    pub two_sided: Option<Spanned<bool>>,
    /// Index of refraction inside, a number or by wavelength. Default: 1.49 of plastics, 1.55 of hair; otherwise none.
    pub ior: Option<Spanned<IorRecord>>,
    /// Index of refraction outside, likewise. Default: 1.
    pub exterior_ior: Option<Spanned<IorRecord>>,
    /// Microfacet roughness, 0.001 to 1.
    pub alpha: Option<Spanned<ScalarRecord<Roughness>>>,
    /// Roughness along the tangent, 0.001 to 100, with `alpha_v` instead of `alpha`. Textures are in [0, 1].
    pub alpha_u: Option<Spanned<ScalarRecord<AnyRoughness>>>,
    /// Roughness across the tangent, likewise.
    pub alpha_v: Option<Spanned<ScalarRecord<AnyRoughness>>>,
    /// Real part of the index of refraction.
    pub eta: Option<Spanned<Color<NonNegative>>>,
    /// Imaginary part of the index of refraction.
    pub k: Option<Spanned<Color<NonNegative>>>,
    /// Both parts by wavelength: rows of nm, eta and k.
    pub nk: Option<Spanned<Vec<Vector>>>,
    /// Name of a metal, such as gold.
    pub preset: Option<Spanned<String>>,
    /// Microfacet distribution. Default: ggx.
    pub distribution: Option<Spanned<DistributionName>>,
    /// Factor on the interface's reflection, 0 to 1. Default: 1.
    pub specular_reflectance: Option<Spanned<TextureRecord<Unit>>>,
    /// Factor on the interface's transmission, 0 to 1. Default: 1.
    pub specular_transmittance: Option<Spanned<TextureRecord<Unit>>>,
    /// Shift colours by reflection within the coat. Default: false.
    pub nonlinear: Option<Spanned<bool>>,
    /// Colour of the base, 0 to 1. Default: 0.5.
    pub base_color: Option<Spanned<TextureRecord<Unit>>>,
    /// 0 for a dielectric to 1 for metal. Default: 0.
    pub metallic: Option<Spanned<ScalarRecord<Unit>>>,
    /// Roughness, 0 to 1; its square is alpha, but diffuse, velvet and sheen use it directly. Default: 0.5, 0 of
    /// diffuse.
    pub roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Anisotropy, 0 to 1: with r = sqrt(1 - 0.9 anisotropic), alpha is divided by r along the tangent and multiplied
    /// by r across it. Default: 0.
    pub anisotropic: Option<Spanned<ScalarRecord<Unit>>>,
    /// Anisotropy as in glTF, instead of `anisotropic`: alpha along the tangent is alpha + (1 - alpha) strength².
    pub anisotropy_strength: Option<Spanned<ScalarRecord<Unit>>>,
    /// Rotation of the tangent about the normal in turns, 0 to 1, counter-clockwise seen from outside. Default: 0.
    pub anisotropic_rotation: Option<Spanned<ScalarRecord<Unit>>>,
    /// Direction of the tangent. Default: u.
    pub tangent: Option<Spanned<TangentName>>,
    /// Reflectance at normal incidence divided by 0.08, 0 to 1, instead of `ior`. Default: 0.5.
    pub specular: Option<Spanned<ScalarRecord<Unit>>>,
    /// How far the reflection takes on the base's hue, 0 to 1. Default: 0.
    pub spec_tint: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the entering light that is transmitted as by rough glass, 0 to 1. Default: 0.
    pub spec_trans: Option<Spanned<ScalarRecord<Unit>>>,
    /// Reflection at grazing angles, as of cloth, 0 to 1. Default: 0.
    pub sheen: Option<Spanned<ScalarRecord<Unit>>>,
    /// How far the sheen takes on the base's hue, 0 to 1. Default: 0.
    pub sheen_tint: Option<Spanned<ScalarRecord<Unit>>>,
    /// Strength of a second reflection, 0 to 1. Default: 0.
    pub clearcoat: Option<Spanned<ScalarRecord<Unit>>>,
    /// Smoothness of the second reflection, 0 for rough to 1 for smooth. Default: 0.
    pub clearcoat_gloss: Option<Spanned<ScalarRecord<Unit>>>,
    /// How flat the diffuse base looks, 0 to 1. Default: 0.
    pub flatness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Roughness of the diffuse base, 0 to 1, instead of `flatness`. Default: 0.
    pub diffuse_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the surface covered by a layer of fine fibres, 0 to 1, instead of `sheen`. Default: 0.
    pub sheen_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Roughness of the fibres, 0 to 1. Default: 0.5.
    pub sheen_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Factor on the fibres' reflection, 0 to 1. Default: 1.
    pub sheen_color: Option<Spanned<TextureRecord<Unit>>>,
    /// Factor on the dielectric reflectance at normal incidence. Default: 1.
    pub specular_color: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of the surface with a clear coat, 0 to 1; what the coat reflects does not reach the layers below. Default:
    /// 0.
    pub coat_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Roughness of the clear coat, 0 to 1; its square is the coat's alpha. Default: 0.
    pub coat_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Index of refraction of the clear coat. Default: 1.5.
    pub coat_ior: Option<Spanned<Number<FilmIndex>>>,
    /// Give the coat the shape's normal, regardless of `bump` and `normal_map` below. Default: false.
    pub coat_levels: Option<Spanned<bool>>,
    /// Heights that tilt the coat's normal, instead of `bump` and `normal_map`.
    pub coat_bump: Option<Spanned<BumpRecord>>,
    /// Normal map of the coat, instead of the shape's normals, `bump` and `normal_map`.
    pub coat_normal_map: Option<Spanned<TextureRecord<Unit>>>,
    /// Thickness of a thin film over the reflection, micrometres; textures are in [0, 1]. Default: no film.
    pub thin_film_thickness: Option<Spanned<ScalarRecord<NonNegative>>>,
    /// Index of refraction of the thin film. Default: 1.4.
    pub thin_film_ior: Option<Spanned<Number<FilmIndex>>>,
    /// Share of the surface with a thin film, 0 to 1. Default: 1.
    pub thin_film_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the diffuse light that enters a medium beneath instead, 0 to 1. Default: 0.
    pub subsurface: Option<Spanned<ScalarRecord<Unit>>>,
    /// Reduced mean free path in that medium, 1 / (sigma_t (1 - g)), per channel, scene units.
    pub subsurface_radius: Option<Spanned<Color<Positive>>>,
    /// Mean cosine of that medium's scattering, between -1 and 1. Default: 0.
    pub subsurface_anisotropy: Option<Spanned<Number<MeanCosine>>>,
    /// Light scatters repeatedly among microfacets, and the base gets what they do not reflect; otherwise the energy of
    /// further bounces is lost. Default: true.
    pub multiple_scattering: Option<Spanned<bool>>,
    /// Of hair: the colour of many fibres together, 0 to 1.
    pub color: Option<Spanned<TextureRecord<Unit>>>,
    /// Of hair: the absorption coefficient per fibre radius. Default: by its melanin.
    pub absorption: Option<Spanned<Color<NonNegative>>>,
    /// Of hair: the amount of brown and black pigment. Default: 1.3, brown, where nothing else is said.
    pub eumelanin: Option<Spanned<Number<NonNegative>>>,
    /// Of hair: the amount of yellow and red pigment. Default: 0.
    pub pheomelanin: Option<Spanned<Number<NonNegative>>>,
    /// Of hair: roughness along the fibre, 0 to 1. Default: 0.3.
    pub beta_m: Option<Spanned<Number<Unit>>>,
    /// Of hair: roughness around the fibre, 0 to 1. Default: 0.3.
    pub beta_n: Option<Spanned<Number<Unit>>>,
    /// Of hair: tilt of the scales towards the tip, degrees. Default: 2.
    pub tilt: Option<Spanned<Number<Finite>>>,
    /// Of hair: how much smoother the first reflection is than the others, 0 to 1. Default: 0.
    pub coat: Option<Spanned<Number<Unit>>>,
    /// Names of the two materials of a blend.
    pub materials: Option<Spanned<[Spanned<String>; 2]>>,
    /// Share of the second material, 0 to 1: a number, or the luminance of a texture.
    pub weight: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of light that interacts with the surface, 0 to 1; the rest passes straight through. Default: 1.
    pub opacity: Option<Spanned<TextureRecord<Unit>>>,
    /// Heights that tilt the normal.
    pub bump: Option<Spanned<BumpRecord>>,
    /// Normal map that replaces the shape's normals.
    pub normal_map: Option<Spanned<TextureRecord<Unit>>>,
}

/// An image of heights, or a graph.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ image = \"file\", scale = 1.0 }")]
pub struct BumpRecord {
    /// Image of heights; its luminance counts.
    pub image: Option<ImageFile>,
    /// One of `textures`, instead of an image.
    pub texture: Option<Spanned<String>>,
    /// Which output of that texture. Default: the first.
    pub output: Option<Spanned<String>>,
    /// Take the numbers of a PNG as linear, not as sRGB.
    #[serde(default)]
    pub raw: bool,
    /// Interpolation of the image. Default: bilinear.
    #[serde(default)]
    pub filter: TextureFilter,
    /// Wrapping beyond the image's edges. Default: repeat.
    #[serde(default)]
    pub wrap: Wrap,
    /// Transform of (u, v) before the look-up.
    pub uv: Option<UvSteps>,
    /// Factor on the heights. Default: 1.
    pub scale: Option<Number<Finite>>,
    /// Weight of the resulting normal against the one below, 0 to 1. Default: 1.
    pub strength: Option<Spanned<Number<Unit>>>,
    /// The bump below this one.
    pub over: Option<Box<Spanned<BumpRecord>>>,
}

impl BumpRecord {
    /// This bump and those below it, the lowest last.
    pub fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |bump| bump.over.as_ref().map(|over| over.get_ref()))
    }
}

impl MaterialRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(
            self,
            reflectance,
            transmittance,
            two_sided,
            ior,
            exterior_ior,
            alpha,
            alpha_u,
            alpha_v,
            eta,
            k,
            nk,
            preset,
            distribution,
            specular_reflectance,
            specular_transmittance,
            nonlinear,
            base_color,
            metallic,
            roughness,
            anisotropic,
            anisotropy_strength,
            anisotropic_rotation,
            tangent,
            specular,
            spec_tint,
            spec_trans,
            sheen,
            sheen_tint,
            clearcoat,
            clearcoat_gloss,
            flatness,
            diffuse_roughness,
            sheen_weight,
            sheen_roughness,
            sheen_color,
            specular_color,
            coat_weight,
            coat_roughness,
            coat_ior,
            coat_levels,
            coat_bump,
            coat_normal_map,
            thin_film_thickness,
            thin_film_ior,
            thin_film_weight,
            subsurface,
            subsurface_radius,
            subsurface_anisotropy,
            multiple_scattering,
            color,
            absorption,
            eumelanin,
            pheomelanin,
            beta_m,
            beta_n,
            tilt,
            coat,
            materials,
            weight,
            opacity,
            bump,
            normal_map
        );
        only_takes(name, takes, self.kind.get_ref().common(), &given)
    }

    /// The files of its textures.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        self.images().map(|(image, _)| &image.file)
    }

    /// The files of its textures, and whether their numbers are taken as linear.
    pub fn images(&self) -> impl Iterator<Item = (&ImageFile, bool)> {
        let textures = [
            &self.reflectance,
            &self.transmittance,
            &self.specular_reflectance,
            &self.specular_transmittance,
            &self.base_color,
            &self.specular_color,
            &self.sheen_color,
            &self.color,
            &self.weight,
            &self.opacity,
        ];
        let colors = textures
            .into_iter()
            .flat_map(|field| field.iter().flat_map(|field| field.get_ref().images()));
        let numbers = [
            &self.metallic,
            &self.roughness,
            &self.anisotropic,
            &self.anisotropy_strength,
            &self.anisotropic_rotation,
            &self.specular,
            &self.spec_tint,
            &self.spec_trans,
            &self.sheen,
            &self.sheen_tint,
            &self.clearcoat,
            &self.clearcoat_gloss,
            &self.flatness,
            &self.diffuse_roughness,
            &self.sheen_weight,
            &self.sheen_roughness,
            &self.coat_weight,
            &self.coat_roughness,
            &self.thin_film_weight,
            &self.subsurface,
        ];
        let of_numbers = numbers
            .into_iter()
            .flat_map(|field| field.iter().flat_map(|field| field.get_ref().images()));
        let of_alpha = self.alpha.iter().flat_map(|alpha| alpha.get_ref().images());
        let of_both = [&self.alpha_u, &self.alpha_v];
        let of_both = (of_both.into_iter().flatten()).flat_map(|alpha| alpha.get_ref().images());
        let of_films = (self.thin_film_thickness.iter()).flat_map(|thickness| thickness.get_ref().images());
        let images = colors
            .chain(of_numbers)
            .chain(of_alpha)
            .chain(of_both)
            .chain(of_films)
            .map(|i| (&i.file, i.raw));
        let maps = [&self.normal_map, &self.coat_normal_map].into_iter().flatten();
        let normals = maps.flat_map(|map| map.get_ref().images());
        let bumps = [&self.bump, &self.coat_bump].into_iter().flatten();
        let bumps = bumps.flat_map(|bump| bump.get_ref().all());
        let bumps = bumps.filter_map(|bump| Some((bump.image.as_ref()?, bump.raw)));
        images.chain(normals.map(|image| (&image.file, true))).chain(bumps)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialType {
    /// Lambertian reflection.
    Diffuse,
    /// Lambertian reflection and transmission.
    Translucent,
    /// Upright fibres, as of velvet.
    Velvet,
    /// A layer of fine fibres.
    Sheen,
    /// Smooth glass or liquid.
    Dielectric,
    /// Smooth metal.
    Conductor,
    /// Reflects equally at all angles.
    Mirror,
    /// Rough metal.
    RoughConductor,
    /// Rough glass.
    RoughDielectric,
    /// A thin pane of glass.
    ThinDielectric,
    /// Smooth coat over a diffuse base.
    Plastic,
    /// Rough coat over a diffuse base.
    RoughPlastic,
    /// Burley's model.
    Principled,
    /// A hair or fibre.
    Hair,
    /// Two materials mixed by a weight.
    Blend,
    /// A boundary between media, without a surface.
    Null,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DistributionName {
    /// GGX, also called Trowbridge-Reitz.
    Ggx,
    /// Beckmann.
    Beckmann,
}

/// The direction along which an anisotropic surface is rougher.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TangentName {
    /// Along the surface's u.
    U,
    /// Around the object's x axis, through the centre of its bounding box.
    AroundX,
    /// Around its y axis.
    AroundY,
    /// Around its z axis.
    AroundZ,
}

impl MaterialType {
    /// The schema for each kind of material.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| [kind.common(), kind.takes().1].concat());
        defaults(schema, Self::defaults);
    }

    /// Numeric defaults that only this kind has, or that differ from other kinds.
    fn defaults(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Diffuse => &[("reflectance", 0.5), ("roughness", 0.0)],
            Self::Velvet | Self::Sheen => &[("reflectance", 0.5), ("roughness", 0.5)],
            Self::Translucent => &[("reflectance", 0.0)],
            Self::Plastic | Self::RoughPlastic => &[("reflectance", 0.5), ("ior", 1.49)],
            Self::Hair => &[("ior", 1.55)],
            Self::Mirror | Self::Conductor | Self::RoughConductor => &[("reflectance", 1.0)],
            _ => &[],
        }
    }

    /// Fields of every material except `null`.
    fn common(self) -> &'static [&'static str] {
        match self {
            Self::Null => &[],
            _ => &["opacity", "bump", "normal_map"],
        }
    }

    /// The name in scene files, and the fields it takes in addition to `type`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Diffuse => ("diffuse", &["reflectance", "roughness", "two_sided"]),
            Self::Translucent => ("translucent", &["reflectance", "transmittance"]),
            Self::Velvet => ("velvet", &["reflectance", "roughness", "two_sided"]),
            Self::Sheen => ("sheen", &["reflectance", "roughness", "two_sided"]),
            Self::Mirror => ("mirror", &["reflectance", "two_sided"]),
            Self::Dielectric => ("dielectric", SMOOTH_DIELECTRIC),
            Self::ThinDielectric => ("thin_dielectric", SMOOTH_DIELECTRIC),
            Self::RoughDielectric => (
                "rough_dielectric",
                &[
                    "ior",
                    "exterior_ior",
                    "alpha",
                    "alpha_u",
                    "alpha_v",
                    "anisotropic_rotation",
                    "tangent",
                    "distribution",
                    "specular_reflectance",
                    "specular_transmittance",
                    "multiple_scattering",
                ],
            ),
            Self::Conductor => ("conductor", &["eta", "k", "nk", "preset", "reflectance", "two_sided"]),
            Self::RoughConductor => (
                "rough_conductor",
                &[
                    "alpha",
                    "alpha_u",
                    "alpha_v",
                    "anisotropic_rotation",
                    "tangent",
                    "distribution",
                    "eta",
                    "k",
                    "nk",
                    "preset",
                    "reflectance",
                    "multiple_scattering",
                    "two_sided",
                ],
            ),
            Self::Plastic => (
                "plastic",
                &[
                    "reflectance",
                    "specular_reflectance",
                    "ior",
                    "exterior_ior",
                    "nonlinear",
                    "two_sided",
                ],
            ),
            Self::RoughPlastic => (
                "rough_plastic",
                &[
                    "reflectance",
                    "specular_reflectance",
                    "ior",
                    "exterior_ior",
                    "alpha",
                    "distribution",
                    "nonlinear",
                    "two_sided",
                ],
            ),
            Self::Principled => (
                "principled",
                &[
                    "base_color",
                    "metallic",
                    "roughness",
                    "anisotropic",
                    "anisotropy_strength",
                    "anisotropic_rotation",
                    "tangent",
                    "specular",
                    "ior",
                    "exterior_ior",
                    "spec_tint",
                    "spec_trans",
                    "sheen",
                    "sheen_tint",
                    "clearcoat",
                    "clearcoat_gloss",
                    "flatness",
                    "diffuse_roughness",
                    "sheen_weight",
                    "sheen_roughness",
                    "sheen_color",
                    "specular_color",
                    "coat_weight",
                    "coat_roughness",
                    "coat_ior",
                    "coat_levels",
                    "coat_bump",
                    "coat_normal_map",
                    "thin_film_thickness",
                    "thin_film_ior",
                    "thin_film_weight",
                    "subsurface",
                    "subsurface_radius",
                    "subsurface_anisotropy",
                    "multiple_scattering",
                    "two_sided",
                ],
            ),
            Self::Hair => (
                "hair",
                &[
                    "color",
                    "absorption",
                    "eumelanin",
                    "pheomelanin",
                    "beta_m",
                    "beta_n",
                    "tilt",
                    "coat",
                    "ior",
                    "exterior_ior",
                ],
            ),
            Self::Blend => ("blend", &["materials", "weight"]),
            Self::Null => ("null", &[]),
        }
    }
}

const SMOOTH_DIELECTRIC: &[&str] = &["ior", "exterior_ior", "specular_reflectance", "specular_transmittance"];
