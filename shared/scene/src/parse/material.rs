//! Materials.

use super::ior::IorRecord;
use super::schema::{by_type, defaults};
use super::words::{TextureFilter, Wrap};
use super::{Fault, ImageFile, ScalarRecord, TextureRecord, UvSteps, given, only_takes};
use crate::values::*;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;

/// What surfaces are made of.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = MaterialType::narrow)]
pub struct MaterialRecord {
    /// Kind of material.
    #[serde(rename = "type")]
    pub kind: Spanned<MaterialType>,
    /// Reflectance, 0 to 1. Default: 0.5 of diffuse bases, 1 of metals and mirrors.
    pub reflectance: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of light that is let through to all directions alike, 0 to 1. Default: 0.5.
    pub transmittance: Option<Spanned<TextureRecord<Unit>>>,
    /// Reflects on both sides. Default: only metals and mirrors.
    pub two_sided: Option<Spanned<bool>>,
    /// Index of refraction inside, a number or by wavelength. Default: 1.49 of plastics, 1.55 of hair; of others none.
    pub ior: Option<Spanned<IorRecord>>,
    /// Index of refraction outside, likewise. Default: 1.
    pub exterior_ior: Option<Spanned<IorRecord>>,
    /// Roughness of microfacets, 0.001 to 1.
    pub alpha: Option<Spanned<ScalarRecord<Roughness>>>,
    /// Roughness along the tangent, 0.001 to 100, in place of `alpha`, with `alpha_v`. Textures are in [0, 1].
    pub alpha_u: Option<Spanned<ScalarRecord<AnyRoughness>>>,
    /// Roughness across the tangent, likewise.
    pub alpha_v: Option<Spanned<ScalarRecord<AnyRoughness>>>,
    /// Real part of the index of refraction.
    pub eta: Option<Spanned<Color<NonNegative>>>,
    /// Imaginary part of the index of refraction.
    pub k: Option<Spanned<Color<NonNegative>>>,
    /// Both parts by wavelength: rows of nm, eta and k.
    pub nk: Option<Spanned<Vec<Vector>>>,
    /// A metal by name, such as gold.
    pub preset: Option<Spanned<String>>,
    /// Distribution of microfacets. Default: ggx.
    pub distribution: Option<Spanned<DistributionName>>,
    /// Factor on what the interface reflects, 0 to 1. Default: 1.
    pub specular_reflectance: Option<Spanned<TextureRecord<Unit>>>,
    /// Factor on what the interface lets through, 0 to 1. Default: 1.
    pub specular_transmittance: Option<Spanned<TextureRecord<Unit>>>,
    /// Colours shift by reflection within the coat. Default: false.
    pub nonlinear: Option<Spanned<bool>>,
    /// Colour of the base, 0 to 1. Default: 0.5.
    pub base_color: Option<Spanned<TextureRecord<Unit>>>,
    /// From dielectric, 0, to metal, 1. Default: 0.
    pub metallic: Option<Spanned<ScalarRecord<Unit>>>,
    /// 0 to 1; its square is alpha. Of diffuse, velvet and sheen as it is. Default: 0.5, 0 of diffuse.
    pub roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// How much rougher microfacets are along the tangent than across it, 0 to 1: alpha is divided by the root of
    /// 1 - 0.9 times this, and multiplied with it. Default: 0.
    pub anisotropic: Option<Spanned<ScalarRecord<Unit>>>,
    /// The same as glTF has it, in place of `anisotropic`: alpha is so far on the way to 1 along the tangent, squared.
    pub anisotropy_strength: Option<Spanned<ScalarRecord<Unit>>>,
    /// Turns of the tangent about the normal, 0 to 1, counter-clockwise seen from outside. Default: 0.
    pub anisotropic_rotation: Option<Spanned<ScalarRecord<Unit>>>,
    /// What the tangent is along. Default: u.
    pub tangent: Option<Spanned<TangentName>>,
    /// Reflectance at normal incidence over 0.08, 0 to 1, in place of `ior`. Default: 0.5.
    pub specular: Option<Spanned<ScalarRecord<Unit>>>,
    /// How far the reflection takes on the hue of the base, 0 to 1. Default: 0.
    pub spec_tint: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the light that enters which goes through as through rough glass, 0 to 1. Default: 0.
    pub spec_trans: Option<Spanned<ScalarRecord<Unit>>>,
    /// Light at grazing angles, as of cloth, 0 to 1. Default: 0.
    pub sheen: Option<Spanned<ScalarRecord<Unit>>>,
    /// How far the sheen takes on the hue of the base, 0 to 1. Default: 0.
    pub sheen_tint: Option<Spanned<ScalarRecord<Unit>>>,
    /// Strength of a second reflection, 0 to 1. Default: 0.
    pub clearcoat: Option<Spanned<ScalarRecord<Unit>>>,
    /// Of the second reflection, from rough, 0, to smooth, 1. Default: 0.
    pub clearcoat_gloss: Option<Spanned<ScalarRecord<Unit>>>,
    /// How flat the diffuse base looks, 0 to 1. Default: 0.
    pub flatness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Roughness of the diffuse base, 0 to 1, in place of `flatness`. Default: 0.
    pub diffuse_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the surface with a layer of fine fibres over all, 0 to 1, in place of `sheen`. Default: 0.
    pub sheen_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Of these fibres, 0 to 1. Default: 0.5.
    pub sheen_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Factor on what these fibres send back, 0 to 1. Default: 1.
    pub sheen_color: Option<Spanned<TextureRecord<Unit>>>,
    /// Factor on what the dielectric share reflects at normal incidence. Default: 1.
    pub specular_color: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of the surface with a clear coat, which what it reflects does not pass, 0 to 1. Default: 0.
    pub coat_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Of the clear coat, 0 to 1; its square is the coat's alpha. Default: 0.
    pub coat_roughness: Option<Spanned<ScalarRecord<Unit>>>,
    /// Index of refraction of the clear coat. Default: 1.5.
    pub coat_ior: Option<Spanned<Number<FilmIndex>>>,
    /// The coat's normal is that of the shape, whatever `bump` and `normal_map` make of what lies below. Default:
    /// false.
    pub coat_levels: Option<Spanned<bool>>,
    /// Heights that tilt the normal of the coat, in place of `bump` and `normal_map`.
    pub coat_bump: Option<Spanned<BumpRecord>>,
    /// Normals of the coat, in place of those of the shape, of `bump` and `normal_map`.
    pub coat_normal_map: Option<Spanned<TextureRecord<Unit>>>,
    /// Thickness of a film over the reflection, micrometres; of a texture from 0 to 1. Default: no film.
    pub thin_film_thickness: Option<Spanned<ScalarRecord<NonNegative>>>,
    /// Index of refraction of the film. Default: 1.4.
    pub thin_film_ior: Option<Spanned<Number<FilmIndex>>>,
    /// Share of the surface with a film, 0 to 1. Default: 1.
    pub thin_film_weight: Option<Spanned<ScalarRecord<Unit>>>,
    /// Share of the light that would be scattered diffusely which sinks into a medium beneath, 0 to 1. Default: 0.
    pub subsurface: Option<Spanned<ScalarRecord<Unit>>>,
    /// How far light gets in that medium, per channel: the mean free path 1 / (sigma_t (1 - g)), scene units.
    pub subsurface_radius: Option<Spanned<Color<Positive>>>,
    /// Mean cosine of its scattering, between -1 and 1. Default: 0.
    pub subsurface_anisotropy: Option<Spanned<Number<MeanCosine>>>,
    /// Light is scattered among microfacets as often as it takes, and the base beneath gets what these do not reflect;
    /// otherwise what one bounce does not send back is lost. Default: true.
    pub multiple_scattering: Option<Spanned<bool>>,
    /// Of hair: the colour of much of it, 0 to 1.
    pub color: Option<Spanned<TextureRecord<Unit>>>,
    /// Of hair: its coefficient of absorption, one over radii. Default: by its melanin.
    pub absorption: Option<Spanned<Color<NonNegative>>>,
    /// Of hair: how much brown and black pigment it has. Default: 1.3, brown, where nothing else is said.
    pub eumelanin: Option<Spanned<Number<NonNegative>>>,
    /// Of hair: how much yellow and red pigment it has. Default: 0.
    pub pheomelanin: Option<Spanned<Number<NonNegative>>>,
    /// Of hair: roughness along it, 0 to 1. Default: 0.3.
    pub beta_m: Option<Spanned<Number<Unit>>>,
    /// Of hair: roughness around it, 0 to 1. Default: 0.3.
    pub beta_n: Option<Spanned<Number<Unit>>>,
    /// Of hair: by how many degrees its scales are raised towards its tip. Default: 2.
    pub tilt: Option<Spanned<Number<Finite>>>,
    /// Of hair: how much smoother than the rest its first reflection is, 0 to 1. Default: 0.
    pub coat: Option<Spanned<Number<Unit>>>,
    /// Names of the two materials that a blend is made of.
    pub materials: Option<Spanned<[Spanned<String>; 2]>>,
    /// Share of the second, 0 to 1: a number, or the luminance of a texture.
    pub weight: Option<Spanned<TextureRecord<Unit>>>,
    /// Share of the light that meets the surface, 0 to 1; the rest passes straight through. Default: 1.
    pub opacity: Option<Spanned<TextureRecord<Unit>>>,
    /// Heights that tilt the normal.
    pub bump: Option<Spanned<BumpRecord>>,
    /// Normals in place of those of the shape.
    pub normal_map: Option<Spanned<TextureRecord<Unit>>>,
}

/// An image of heights, or a graph.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ image = \"file\", scale = 1.0 }")]
pub struct BumpRecord {
    /// Its luminance counts.
    pub image: Option<ImageFile>,
    /// One of `textures`, in place of an image.
    pub texture: Option<Spanned<String>>,
    /// Which of that texture's outputs. Default: the first.
    pub output: Option<Spanned<String>>,
    /// Take the numbers of a PNG as they are, not as sRGB.
    #[serde(default)]
    pub raw: bool,
    /// How it is interpolated. Default: bilinear.
    #[serde(default)]
    pub filter: TextureFilter,
    /// How it goes on beyond its edges. Default: repeat.
    #[serde(default)]
    pub wrap: Wrap,
    /// Steps that (u, v) go through before the look-up.
    pub uv: Option<UvSteps>,
    /// Factor on the heights. Default: 1.
    pub scale: Option<Number<Finite>>,
    /// What the normal that it makes is blended with the one below by, from 0 to 1. Default: 1.
    pub strength: Option<Spanned<Number<Unit>>>,
    /// The bump that it lies on.
    pub over: Option<Box<Spanned<BumpRecord>>>,
}

impl BumpRecord {
    /// It and those that it lies on, the lowest last.
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

    /// The files of its textures, and whether their numbers are taken as they are.
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
    /// Lambertian.
    Diffuse,
    /// Lambertian on both sides: reflects and lets through.
    Translucent,
    /// Fibres that stand on end.
    Velvet,
    /// A layer of fine fibres.
    Sheen,
    /// Smooth glass or liquid.
    Dielectric,
    /// Smooth metal.
    Conductor,
    /// Reflects alike at all angles.
    Mirror,
    /// Metal of microfacets.
    RoughConductor,
    /// Glass of microfacets.
    RoughDielectric,
    /// A pane.
    ThinDielectric,
    /// Smooth coat over a diffuse base.
    Plastic,
    /// Rough coat over a diffuse base.
    RoughPlastic,
    /// Burley's model.
    Principled,
    /// A fibre.
    Hair,
    /// Two materials, mixed by a weight.
    Blend,
    /// Nothing but the boundary of a medium.
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

/// What the tangent is along that microfacets are rougher along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TangentName {
    /// The surface's u.
    U,
    /// Circles around the object's x axis, through the middle of the box around it.
    AroundX,
    /// Around its y axis.
    AroundY,
    /// Around its z axis.
    AroundZ,
}

impl MaterialType {
    /// The schema of each kind of material.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| [kind.common(), kind.takes().1].concat());
        defaults(schema, Self::defaults);
    }

    /// Numbers that other kinds have not, or have others of, where the file does not say.
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

    /// Fields that every material takes, but `null`.
    fn common(self) -> &'static [&'static str] {
        match self {
            Self::Null => &[],
            _ => &["opacity", "bump", "normal_map"],
        }
    }

    /// As the scene file writes it, and the fields that it takes beside `type`.
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
