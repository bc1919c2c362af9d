//! Media: coefficients, densities from recipes and from files.

use crate::files::bad_scenes::{VIEW, error_of, refused};
use beamfarm_scene::read_bundle;

#[test]
fn media_are_checked() {
    refused(
        r#"
[media.fog] | type = "homogeneous" | sigma_a = -0.1 | sigma_s = 1
    5: media.fog.sigma_a: expected a number that is not negative, found -0.1
[media.fog] | type = "homogeneous" | sigma_a = [0.1, -0.1, 0.1] | sigma_s = 1
    5: media.fog.sigma_a[1]: expected a number that is not negative, found -0.1
[media.fog] | type = "homogeneous" | sigma_a = nan | sigma_s = 1
    5: media.fog.sigma_a: expected a number that is not negative, found NaN
[media.fog] | type = "homogeneous" | sigma_a = 3e38 | sigma_s = 3e38
    4: media.fog.type: its extinction is too large for single precision
[media.fog] | type = "homogeneous" | sigma_a = 0.1 | albedo = 1
    5: media.fog.sigma_a: a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed
[media.fog] | type = "homogeneous" | sigma_s = 0.1
    5: media.fog.sigma_s: a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1.5
    6: media.fog.albedo: expected a number from 0 to 1, found 1.5
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = { type = "hg", g = 0.999999999 }
    7: media.fog.phase.g: expected a number between -1 and 1, both excluded, found 0.999999999
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = "rayleigh"
    7: media.fog.phase: expected "isotropic", { type = "hg", g = mean cosine } or { type = "blend", weight = share of the second, phases = [first, second] }, found "rayleigh"
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = { type = "hg" }
    7: media.fog.phase: expected "isotropic", { type = "hg", g = mean cosine } or { type = "blend", weight = share of the second, phases = [first, second] }
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = { type = "blend", weight = 0.5, phases = ["isotropic"] }
    7: media.fog.phase: expected "isotropic", { type = "hg", g = mean cosine } or { type = "blend", weight = share of the second, phases = [first, second] }
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = { type = "blend", weight = 1.5, phases = ["isotropic", "isotropic"] }
    7: media.fog.phase.weight: expected a number from 0 to 1, found 1.5
[media.fog] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1 | phase = { type = "blend", weight = 0, phases = [{ type = "blend", weight = 0, phases = ["isotropic", "isotropic"] }, "isotropic"] }
    7: media.fog.phase: a blend of blends is not supported
[media.fog] | type = "grid"
    4: media.fog.type: unknown variant `grid`, expected `homogeneous` or `heterogeneous`
[media.none] | type = "homogeneous" | sigma_t = 0.1 | albedo = 1
    3: media.none: the name "none" stands for vacuum; choose another
"#,
    );
}

#[test]
fn what_media_emit_is_checked() {
    refused(
        r#"
[media.fire] | type = "homogeneous" | emission = -1
    5: media.fire.emission: expected a number that is not negative, found -1.0
[media.fire] | type = "homogeneous" | emission = [1, 2]
    5: media.fire.emission: expected one number, or three in brackets, found 2 numbers
[media.fire] | type = "homogeneous" | emission = nan
    5: media.fire.emission: expected a number that is not negative, found NaN
[media.fire] | type = "homogeneous" | emission = "hot"
    5: media.fire.emission: invalid type: string "hot", expected a number that is not negative, or three of them in brackets, or { color = ..., scale = ..., field = ..., temperature = ..., kelvin = ... }
[media.fire] | type = "homogeneous" | emission = { colour = 1 }
    5: media.fire.emission.colour: unknown field `colour`; did you mean `color`?
[media.fire] | type = "homogeneous" | emission = { color = -1 }
    5: media.fire.emission.color: expected a number that is not negative, found -1.0
[media.fire] | type = "homogeneous" | emission = { field = "flame" }
    5: media.fire.emission.field: expected "density", { file = "volume" } or a recipe like those of densities, found "flame"
[media.fire] | type = "homogeneous" | emission = { field = "density" }
    5: media.fire.emission.field: a "homogeneous" medium has no density that varies; expected { file = "volume" } or a recipe
[media.fire] | type = "homogeneous" | emission = { field = { min = [0, 0, 0] } }
    5: media.fire.emission.field.min: the box of a density takes both corners, `min` and `max`
[media.fire] | type = "homogeneous" | emission = { field = { file = "a.vdb", voxel = 1 } }
    5: media.fire.emission.field.voxel: a density takes only `grid` beside `file`; `min`, `max` and the rest describe one without a file
[media.fire] | type = "homogeneous" | emission = { kelvin = 3 }
    5: media.fire.emission.kelvin: it multiplies the temperature, and there is none
[media.fire] | type = "homogeneous" | emission = { temperature = -3 }
    5: media.fire.emission.temperature: expected a number that is not negative, found -3.0
[media.fire] | type = "homogeneous" | emission = { temperature = 1e12 }
    5: media.fire.emission: where it emits most that is too large for single precision
[media.fire] | type = "homogeneous" | emission = 1 | transform = [{ scale = 2 }]
    6: media.fire.transform: it places grids, and this medium has none
[media.fire] | type = "homogeneous" | emission = 1 | [world] | medium = "fire"
    5: media.fire.emission: the world's medium has no end, and would be bright without end; expected an emission with a grid (`field`, or as `temperature`), or a shape that has the medium inside
[media.fire] | type = "homogeneous" | emission = 1 | [materials.n] | type = "null" | [[shapes]] | type = "cube" | name = "box" | material = "n" | interior = "fire" | flip_normals = true
    5: media.fire.emission: "box", which has the medium inside, is inside out: it is all around, and would be bright without end
"#,
    );
}

/// A heterogeneous medium of four lines, so that what a test adds starts on the seventh.
#[track_caller]
fn refused_in_cloud(cases: &str) {
    let cloud = r#"[media.fog] | type = "heterogeneous" | sigma_a = 0 | sigma_s = 1 | "#;
    let case = |line: &str| match line.starts_with("  ") || line.is_empty() {
        true => line.to_string(),
        false => format!("{cloud}{line}"),
    };
    refused(&cases.lines().map(case).collect::<Vec<_>>().join("\n"));
}

#[test]
fn densities_belong_to_heterogeneous_media() {
    refused(
        r#"
[media.fog] | type = "homogeneous" | sigma_a = 0 | sigma_s = 1 | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.density: "homogeneous" does not take this field; expected one of transform, sigma_a, sigma_s, sigma_t, albedo, phase, emission
[media.fog] | type = "homogeneous" | sigma_a = 0 | sigma_s = 1 | transmittance = "ratio_tracking"
    7: media.fog.transmittance: "homogeneous" does not take this field; expected one of transform, sigma_a, sigma_s, sigma_t, albedo, phase, emission
[media.fog] | type = "heterogeneous" | sigma_a = 0 | sigma_s = 1
    4: media.fog.type: with this type the field `density` is required
[media.fog] | type = "heterogeneous" | density = { min = [0, 0, 0], max = [1, 1, 1] }
    4: media.fog.type: a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed
"#,
    );
}

#[test]
fn albedos_of_files_are_checked() {
    refused(
        r#"
[media.fog] | type = "homogeneous" | sigma_t = 1 | albedo = { file = "a.vol" }
    6: media.fog.albedo: an albedo that varies is one of a "heterogeneous" medium
[media.fog] | type = "heterogeneous" | sigma_t = 1 | albedo = {} | density = { min = [0, 0, 0], max = [1, 1, 1] }
    6: media.fog.albedo: expected `file`, and `grid` beside it, or `texture`, and `output` beside it
[media.fog] | type = "heterogeneous" | sigma_t = 1 | albedo = { file = "a.vol" } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    6: media.fog.albedo.file: the bundle lacks the file "a.vol"
[media.fog] | type = "heterogeneous" | sigma_t = 1 | albedo = "a.vol" | density = { min = [0, 0, 0], max = [1, 1, 1] }
    6: media.fog.albedo: invalid type: string "a.vol", expected a number from 0 to 1, or three of them in brackets, or { file = "volume" }, or { texture = "NAME" }
[textures.a] | node = "coordinates" | of = "uv" | [media.fog] | type = "heterogeneous" | sigma_t = 1 | albedo = { texture = "a" } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    9: media.fog.albedo.texture: a density has no UV, no vertices and no side; expected a graph of "object", "generated" or "world" coordinates
"#,
    );
    let text = format!(
        "{VIEW}[media.fog]\ntype = \"heterogeneous\"\nsigma_t = 1\nalbedo = {{ file = \"a.vol\" }}
        density = {{ min = [0, 0, 0], max = [1, 1, 1] }}"
    );
    for (channels, value, expected) in [
        (3, 1.5f32, "a.vol: a sample is 1.5; expected albedos from 0 to 1"),
        (1, f32::NAN, "a.vol: its sample at [0, 0, 0] is not finite"),
        (2, 0.5, "a.vol: the grid has 2 channels; expected 1 or 3"),
    ] {
        let mut bytes = b"VOL\x03".to_vec();
        for int in [1, 1, 1, 1, channels] {
            bytes.extend(i32::to_le_bytes(int));
        }
        bytes.extend([0; 24]);
        for _ in 0..channels {
            bytes.extend(value.to_le_bytes());
        }
        assert_eq!(error_of(&text, &[("a.vol", bytes)]).to_string(), expected);
    }
}

#[test]
fn heterogeneous_media_are_checked() {
    refused_in_cloud(
        r#"
scale = -1 | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.scale: expected a number that is not negative, found -1.0
scael = 1 | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.scael: unknown field `scael`; did you mean `scale`?
scale = 3e38 | density = { min = [0, 0, 0], max = [1, 1, 1], blobs = [{ center = [0, 0, 0], radius = 1, density = 3 }] }
    4: media.fog.type: its extinction is too large for single precision where it is densest, at a density of 3.000e0
sigma_t = 1 | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.sigma_t: a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed
transmittance = "ratio" | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance: expected "ratio_tracking", "residual_ratio_tracking" or { free_flights = number from 1 to 65535 }, found "ratio"
transmittance = "free_flights" | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance: expected "ratio_tracking", "residual_ratio_tracking" or { free_flights = number from 1 to 65535 }, found "free_flights"
transmittance = 4 | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance: invalid type: integer `4`, expected "ratio_tracking", "residual_ratio_tracking" or { free_flights = number from 1 to 65535 }
transmittance = { free_flights = 0 } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance: expected 1 to 65535 free flights, found 0
transmittance = { free_flights = 70000 } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance: expected 1 to 65535 free flights, found 70000
transmittance = { free_flights = 1.5 } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance.free_flights: invalid type: floating point `1.5`, expected a whole number
transmittance = { free_flight = 1 } | density = { min = [0, 0, 0], max = [1, 1, 1] }
    7: media.fog.transmittance.free_flight: unknown field `free_flight`; did you mean `free_flights`?
density = { min = [0, 0, 0], max = [1, 1, 1] } | transform = [{ scale = [1, 0, 1] }]
    8: media.fog.transform: the density's transform cannot be inverted: it makes the density flat, or its samples are too far apart or too close together for single precision
density = { min = [0, 0, 0], max = [1, 1, 1] } | transform = [{ scale = 1e-30 }]
    8: media.fog.transform: the density's transform cannot be inverted: it makes the density flat, or its samples are too far apart or too close together for single precision
density = { min = [0, 0, 0], max = [1, 1, 1] } | transform = [{ scale = 1e30 }, { scale = 1e30 }]
    8: media.fog.transform: it reaches 1.732e60 scene units from the camera; expected less than 1e15
density = { min = [0, 0, 0], max = [1, 1, 1] } | transform = [{ translate = [0, 1e16, 0] }]
    8: media.fog.transform: it reaches 1.000e16 scene units from the camera; expected less than 1e15
density = { min = [0, 0, 0], max = [1, 1, 1] } | transform = [ | { rotat = 1 }, | ]
    9: media.fog.transform[0].rotat: unknown field `rotat`; did you mean `rotate`?
density = { min = [0, 0, 0], max = [1, 1, 1e18] }
    7: media.fog.density: it reaches 1.000e18 scene units from the camera; expected less than 1e15
"#,
    );
}

#[test]
fn recipes_are_checked() {
    refused_in_cloud(
        r#"
density = {}
    7: media.fog.density: a density is given by `file`, or by `min` and `max`, the corners of its box, and what makes it vary within: `height`, `blobs`, `noise`, `texture`
[media.fog.density] | noise = { size = 1 }
    7: media.fog.density: a density is given by `file`, or by `min` and `max`, the corners of its box, and what makes it vary within: `height`, `blobs`, `noise`, `texture`
[media.fog.density] | min = [0, 0, 0]
    8: media.fog.density.min: the box of a density takes both corners, `min` and `max`
[media.fog.density] | max = [0, 0, 0]
    8: media.fog.density.max: the box of a density takes both corners, `min` and `max`
[media.fog.density] | min = [0, 0, 0] | max = [1, -1, 1]
    9: media.fog.density.max: expected more than `min`, [0, 0, 0], on every axis, found [1, -1, 1]
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 0]
    9: media.fog.density.max: expected more than `min`, [0, 0, 0], on every axis, found [1, 1, 0]
[media.fog.density] | min = [0, 0, 0] | max = 1
    9: media.fog.density.max: invalid type: integer `1`, expected three numbers [x, y, z]
[media.fog.density] | file = "a.vdb" | min = [0, 0, 0] | max = [1, 1, 1]
    9: media.fog.density.min: a density takes only `grid` beside `file`; `min`, `max` and the rest describe one without a file
[media.fog.density] | file = "a.vdb" | noise = { size = 1 }
    9: media.fog.density.noise: a density takes only `grid` beside `file`; `min`, `max` and the rest describe one without a file
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | grid = "density"
    10: media.fog.density.grid: it names one of the grids of a `file`, and this density has none
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | voxel = 0
    10: media.fog.density.voxel: expected a number above 0, found 0.0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | voxel = 0.001
    10: media.fog.density.voxel: 1.000e3 x 1.000e3 x 1.000e3 samples at a distance of 0.001; expected at most 1048576 along an axis and, in bricks of 8 x 8 x 8, 268435456 in all
[media.fog.density] | min = [0, 0, 0] | max = [2e7, 1, 1] | voxel = 1
    10: media.fog.density.voxel: 2.000e7 x 1.000e0 x 1.000e0 samples at a distance of 1; expected at most 1048576 along an axis and, in bricks of 8 x 8 x 8, 268435456 in all
[media.fog.density] | min = [0, 0, 0] | max = [1e6, 3e2, 1] | voxel = 1
    10: media.fog.density.voxel: 1.000e6 x 3.000e2 x 1.000e0 samples at a distance of 1; expected at most 1048576 along an axis and, in bricks of 8 x 8 x 8, 268435456 in all
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | vocsel = 0.5
    10: media.fog.density.vocsel: unknown field `vocsel`; did you mean `voxel`?
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | height = {}
    10: media.fog.density.height: missing field `scale`
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | height = { scale = 0 }
    10: media.fog.density.height.scale: expected a number above 0, found 0.0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | height = { scale = 1, top = 2 }
    10: media.fog.density.height.top: unknown field `top`, expected `base` or `scale`
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | blobs = [ | { center = [0, 0, 0], radius = 1 }, | { center = [0, 0, 0] }, | ]
    12: media.fog.density.blobs[1]: missing field `radius`
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | [[media.fog.density.blobs]] | center = [0, 0, 0] | radius = 1 | density = -1
    13: media.fog.density.blobs[0].density: expected a number that is not negative, found -1.0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | blobs = [{ centre = [0, 0, 0], radius = 1 }]
    10: media.fog.density.blobs[0].centre: unknown field `centre`; did you mean `center`?
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | blobs = { center = [0, 0, 0], radius = 1 }
    10: media.fog.density.blobs: invalid type: map, expected a sequence
density = { min = [0, 0, 0], max = [1, 1, 1], blobs = [{ center = [0, 0, 0], radius = 9, density = 3e38 }, { center = [0, 0, 0], radius = 9, density = 3e38 }] }
    7: media.fog.density: somewhere it is too large for single precision
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = {}
    10: media.fog.density.noise: missing field `size`
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, octave = 4 }
    10: media.fog.density.noise.octave: unknown field `octave`; did you mean `octaves`?
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, octaves = 0 }
    10: media.fog.density.noise.octaves: expected 1 to 12 octaves, found 0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, octaves = 99 }
    10: media.fog.density.noise.octaves: expected 1 to 12 octaves, found 99
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, octaves = -1 }
    10: media.fog.density.noise.octaves: invalid value: integer `-1`, expected a whole number
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, gain = 2 }
    10: media.fog.density.noise.gain: expected a number from 0 to 1, found 2.0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, contrast = -1 }
    10: media.fog.density.noise.contrast: expected a number that is not negative, found -1.0
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 1, seed = 0.5 }
    10: media.fog.density.noise.seed: invalid type: floating point `0.5`, expected a whole number
[media.fog.density] | min = [0, -10, 0] | max = [1, 1, 1] | noise = { size = 1e-4 }
    10: media.fog.density.noise.size: expected at least 1.600e-4, for 4 octaves in a box that reaches as far as this one, found 0.0001
[media.fog.density] | min = [0, 0, 0] | max = [1, 1, 1] | noise = { size = 0 }
    10: media.fog.density.noise.size: expected a number above 0, found 0.0
"#,
    );
}

fn volume(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/data/volumes");
    std::fs::read(format!("{folder}/{name}")).expect("a volume")
}

/// A scene with a cloud; line 7 is `density`.
fn cloud(density: &str) -> String {
    format!("{VIEW}[media.fog]\ntype = \"heterogeneous\"\nsigma_a = 0\nsigma_s = 1\ndensity = {{ {density} }}")
}

/// Faults of a volume file are errors of that file.
#[test]
fn bad_volumes_are_named() {
    let mut vol = volume("grid.vol");
    vol[48..52].copy_from_slice(&f32::INFINITY.to_le_bytes());
    vol[60..64].copy_from_slice(&f32::NAN.to_le_bytes());
    let cut = |name: &str, bytes: usize| volume(name)[..bytes].to_vec();
    for (name, grid, bytes, expected) in [
        (
            "a.vdb",
            "fuel",
            volume("several.vdb"),
            "it has no grid \"fuel\". Its grids: \"wind\" of type Tree_vec3s_5_4_3, \"heat[0]\" of type Tree_float_5_4_3",
        ),
        (
            "a.vdb",
            "level set",
            volume("unusable.vdb"),
            "the grid \"level set\": it is a level set, distances from a surface; expected a fog volume, densities",
        ),
        (
            "a.vol",
            "density",
            volume("grid.vol"),
            "a .vol file's grid has no name; expected no grid `density`",
        ),
        (
            "a.raw",
            "",
            volume("grid.vol"),
            "unsupported kind of volume file; expected .vdb or .vol",
        ),
        (
            "a.vdb",
            "",
            cut("blosc.vdb", 9000),
            "the end of the grid \"density\" should be at byte 19556, but the file has 9000 bytes",
        ),
        (
            "a.vdb",
            "",
            cut("blosc.vdb", 30),
            "the file ends within the file's header: 36 bytes expected at byte 21, 9 left",
        ),
        (
            "a.vdb",
            "",
            Vec::new(),
            "the file ends within the file's header: 8 bytes expected at byte 0, 0 left",
        ),
        (
            "a.vol",
            "",
            cut("grid.vol", 300),
            "a grid of 10 x 5 x 3 samples takes 600 bytes; 252 follow the header",
        ),
        (
            "a.vol",
            "",
            cut("grid.vol", 20),
            "the file ends within the header: 4 bytes expected at byte 20, 0 left",
        ),
        (
            "a.vol",
            "",
            volume("blosc.vdb"),
            "not a Mitsuba volume: it does not begin with \"VOL\"",
        ),
        ("a.vdb", "", volume("stream.vdb"), "it was written as a stream"),
        ("a.vol", "", vol, "its sample at [0, 0, 0] is not finite"),
    ] {
        let grid = match grid {
            "" => String::new(),
            grid => format!(", grid = \"{grid}\""),
        };
        let text = cloud(&format!("file = \"{name}\"{grid}"));
        let error = error_of(&text, &[(name, bytes)]).to_string();
        assert!(error.starts_with(&format!("{name}: {expected}")), "{error}\n{expected}");
    }
}

/// A missing volume file is an error of the line that names it.
#[test]
fn missing_volumes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text = cloud("file = \"none.vdb\"");
    std::fs::write(&path, &text).unwrap();
    let error = read_bundle(&path).unwrap_err();
    assert_eq!((error.file.as_path(), error.line), (path.as_path(), Some(7)));
    let reason = "media.fog.density.file: the file \"none.vdb\": No such file";
    assert!(error.message.starts_with(reason), "{error}");
    let error = error_of(&text, &[]).to_string();
    assert_eq!(
        error,
        "scene.toml:7: media.fog.density.file: the bundle lacks the file \"none.vdb\""
    );
}
