//! Tests of pictures that scenes name.

use crate::load::load;
use beamfarm_image::bundle::Bundle;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::light::LightKind;
use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};
use std::collections::BTreeMap;
use std::io::Cursor;

/// A 2 x 3 image: each channel's name and its pixels, row by row.
fn exr(channels: &[(&str, [f32; 6])]) -> Vec<u8> {
    let channel = |(name, values): &(&str, [f32; 6])| AnyChannel::new(*name, FlatSamples::F32(values.to_vec()));
    let channels = AnyChannels::sort(channels.iter().map(channel).collect());
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_channels((2, 3), channels);
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn scene(text: &str, picture: &[u8]) -> Result<SceneDescription, String> {
    let head = "image = { width = 1, height = 1 }\ncamera = { origin = [0, 0, 4], target = [0, 0, 0], fov = 40 }\n";
    let files = [
        ("scene.toml".to_owned(), format!("{head}{text}").into_bytes()),
        ("a.exr".to_owned(), picture.to_vec()),
    ];
    let bundle = Bundle {
        scene: "scene.toml".into(),
        files: BTreeMap::from(files),
    };
    load(&bundle).map_err(|error| error.to_string())
}

const SKY: &str = "[[lights]]\ntype = \"environment\"\n";
const SCREEN: &str = "[[shapes]]\ntype = \"rectangle\"\n";
const PROJECTOR: &str = "[[lights]]\ntype = \"projector\"\nposition = [0, 0, 2]\ntarget = [0, 0, 0]\nintensity = 1\n";

/// Bad pixels are black in emitted light, and errors elsewhere.
#[test]
fn bad_pixels_of_light_are_dark_and_noted() {
    for bad in [-3.6e-7, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let picture = exr(&[("R", [1.0, 1.0, 1.0, bad, bad, 1.0]), ("G", [1.0; 6]), ("B", [1.0; 6])]);
        for text in [
            format!("{SKY}image = \"a.exr\"\n"),
            format!("{SCREEN}emission = {{ radiance = {{ image = \"a.exr\" }} }}\n"),
            format!("{PROJECTOR}image = \"a.exr\"\n"),
        ] {
            let description = scene(&text, &picture).unwrap();
            let notes: Vec<_> = description
                .notes
                .iter()
                .filter(|note| note.contains("count as 0"))
                .collect();
            assert_eq!(notes.len(), 1, "{:?}", description.notes);
            let said = "a.exr: 2 pixels have numbers that are negative, infinite or NaN, which count as 0: the pixel in \
                        column 1, row 1";
            assert!(notes[0].starts_with(said), "{notes:?}");
        }
        let text = format!(
            "{SKY}radiance = 1\n[materials.m]\ntype = \"diffuse\"\nreflectance = {{ image = \"a.exr\" }}\n\
             {SCREEN}material = \"m\"\n"
        );
        let error = scene(&text, &picture).unwrap_err();
        assert!(error.starts_with("a.exr: the pixel in column 1, row 1"), "{error}");
    }
    let sound = exr(&[("Y", [1.0; 6])]);
    let description = scene(&format!("{SKY}image = \"a.exr\"\n"), &sound).unwrap();
    assert!(!description.notes.iter().any(|note| note.contains("a.exr")));
}

/// The picture that a projector throws.
fn thrown(fields: &str, picture: &[u8]) -> Result<(Rgb, Vec<String>), String> {
    let description = scene(&format!("{PROJECTOR}{fields}\n"), picture)?;
    match &description.lights[0].kind {
        LightKind::Projector(projector) => Ok((projector.image.pixels[0], description.notes)),
        _ => Err("no projector".into()),
    }
}

#[test]
fn layers_are_taken_by_name_wherever_images_are() {
    let even = |name, value| (name, [value; 6]);
    let of = ["View.A.", "View.Combined."].map(|prefix| ["R", "G", "B"].map(|channel| format!("{prefix}{channel}")));
    let channels: Vec<_> = of[0].iter().map(|name| even(name.as_str(), 0.25)).collect();
    let combined = of[1].iter().map(|name| even(name.as_str(), 0.5));
    let picture = exr(&channels.into_iter().chain(combined).collect::<Vec<_>>());

    let (pixel, notes) = thrown("image = \"a.exr\"", &picture).unwrap();
    assert_eq!(pixel, Rgb::splat(0.5));
    assert!(
        notes
            .iter()
            .any(|note| note.contains("a.exr: it has 2 layers with colours")),
        "{notes:?}"
    );
    let named = "{ file = \"a.exr\", layer = \"View.A\" }";
    let (pixel, notes) = thrown(&format!("image = {named}"), &picture).unwrap();
    assert_eq!(pixel, Rgb::splat(0.25));
    assert!(!notes.iter().any(|note| note.contains("layers with colours")));
    let (pixel, _) = thrown("image = { file = \"a.exr\" }", &picture).unwrap();
    assert_eq!(pixel, Rgb::splat(0.5));

    let material = |fields: &str| {
        format!("{SKY}radiance = 1\n[materials.m]\ntype = \"principled\"\n{fields}\n{SCREEN}material = \"m\"\n")
    };
    for text in [
        format!("{SKY}image = {named}\n"),
        format!("{SCREEN}emission = {{ radiance = {{ image = {named} }} }}\n"),
        material(&format!("base_color = {{ image = {named}, wrap = \"clamp\" }}")),
        material(&format!("roughness = {{ image = {named}, channel = \"g\" }}")),
        material(&format!("bump = {{ image = {named} }}")),
        material(&format!("normal_map = {{ image = {named} }}")),
    ] {
        scene(&text, &picture).unwrap_or_else(|error| panic!("{text}: {error}"));
        let error = scene(&text.replace("View.A", "B"), &picture).unwrap_err();
        let said = "a.exr: there is no layer \"B\"; there are \"View.A\", \"View.Combined\"";
        assert_eq!(error, said, "{text}");
    }
    let error = thrown("image = { file = \"a.exr\", part = 1 }", &picture).unwrap_err();
    assert!(error.contains("unknown field `part`"), "{error}");
    let error = thrown("image = 3", &picture).unwrap_err();
    assert!(error.contains("expected the path of an image, or { file"), "{error}");
}

/// Numbered files are found within the table too, and on shapes images are not meshes.
#[test]
fn tables_of_images_have_files_of_frames() {
    let picture = exr(&[("Y", [0.5; 6])]);
    for image in ["\"[#]_#.exr\"", "{ file = \"[#]_#.exr\" }"] {
        let text = format!(
            "image = {{ width = 1, height = 1 }}\ncamera = {{ origin = [0, 0, 4], target = [0, 0, 0], fov = 40 }}\n\
             animation = {{ frame = 7.25, shutter = [0, 0.5] }}\n\
             {SCREEN}emission = {{ radiance = {{ image = {image} }} }}\n"
        );
        let files = [
            ("scene.toml".to_owned(), text.into_bytes()),
            ("#_7.exr".to_owned(), picture.clone()),
            ("#_8.exr".to_owned(), picture.clone()),
        ];
        let bundle = Bundle {
            scene: "scene.toml".into(),
            files: BTreeMap::from(files),
        };
        load(&bundle).unwrap_or_else(|error| panic!("{image}: {error}"));
    }
}
