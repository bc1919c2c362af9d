//! Subsurface scattering in a medium below a surface: against closed forms and the path tracer.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, reference_images, scene};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::world::Scene;

/// A ball of this material in even light of radiance 1.
fn ball(material: &str, more: &str) -> Scene {
    scene(&format!(
        r#"
[image]
width = 8
height = 8
[render]
passes = 64
[camera]
origin = [0, 0, 6]
target = [0, 0, 0]
projection = "orthographic"
view_width = 1
[materials.skin]
type = "principled"
specular = 0
{material}
[[shapes]]
type = "sphere"
material = "skin"
[[lights]]
type = "environment"
radiance = 1
{more}
"#
    ))
}

fn path_traced(scene: &Scene) -> Blocks {
    let settings = ReferenceSettings {
        seed: 7,
        max_depth: None,
    };
    Blocks::new(reference_images(scene, settings, 40, 64), 8)
}

/// Without absorption all light comes out again, however small the share reflected at once; and a ball of many mean
/// free paths has the requested colour, with and without textures.
#[test]
fn even_light_comes_back_in_the_colour_that_was_asked_for() {
    let mut suite = Suite::new(1e-2);
    for (name, material, expected) in [
        (
            "white",
            "base_color = 1\nsubsurface = 1\nsubsurface_radius = [0.5, 0.2, 0.1]",
            [1.0; 3],
        ),
        (
            "coloured",
            "base_color = [0.8, 0.5, 0.2]\nsubsurface = 1\nsubsurface_radius = 0.01",
            [0.8, 0.5, 0.2],
        ),
        (
            "forwards",
            "base_color = [0.8, 0.5, 0.2]\nsubsurface = 1\nsubsurface_radius = 0.01\nsubsurface_anisotropy = 0.7",
            [0.8, 0.5, 0.2],
        ),
        (
            "another medium",
            "base_color = { checkerboard = [[0.6, 0.5, 0.2], [0.6, 0.5, 0.2]] }\nsubsurface = 0.4\n\
             subsurface_radius = [0.02, 0.01, 0.01]",
            [0.6, 0.5, 0.2],
        ),
    ] {
        let ball = ball(material, "");
        assert!(ball.description().notes.is_empty(), "{:?}", ball.description().notes);
        for (by, found) in [("passes", blocks(&ball, 8)), ("paths", path_traced(&ball))] {
            for (channel, expected) in expected.into_iter().enumerate() {
                let mean = &found.blocks[0][channel];
                // Burley's diffuse lobe reflects slightly more at once than Lambert's, and the formula for the medium
                // is off by up to 0.01.
                let off = if name == "white" { 1e-4 } else { 0.012 };
                suite.mean_within(format!("{name}, {by}, {channel}"), mean, expected, off);
                assert!(mean.std_error() < 0.05 * expected, "{name}, {by}: {}", mean.std_error());
            }
        }
    }
    suite.finish();
}

/// Under a lamp, below a coat, and with a lamp inside: as the path tracer renders it.
#[test]
fn passes_are_the_path_tracer() {
    let skin = "base_color = [0.8, 0.5, 0.3]\nroughness = 0.3\nsubsurface = 0.8\nsubsurface_radius = [0.2, 0.1, 0.05]";
    let lamp = |position: &str| format!("[[lights]]\ntype = \"point\"\nposition = {position}\npower = 20");
    let mut suite = Suite::new(1e-2);
    for (name, more) in [("outside", lamp("[2, 1, 2]")), ("inside", lamp("[0.2, 0.1, 0.6]"))] {
        let ball = ball(&skin.replace("roughness", "clearcoat = 0.5\nroughness"), &more);
        let (found, expected) = (blocks(&ball, 8), path_traced(&ball));
        for channel in 0..3 {
            let [found, expected] = [&found, &expected].map(|blocks| &blocks.blocks[0][channel]);
            suite.same_mean(format!("{name}, {channel}"), found, expected);
            assert!(
                found.std_error() < 0.12 * expected.mean(),
                "{name}: {}",
                found.std_error()
            );
        }
    }
    suite.finish();
}
