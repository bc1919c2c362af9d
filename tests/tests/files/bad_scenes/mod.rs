//! Scenes that cannot be rendered are refused with the file, the line, the field, and what was expected.

mod camera;
mod hostile;
mod media;
mod rules;
mod strands;
mod textures;

use beamfarm_image::bundle::Bundle;
use beamfarm_scene::SceneError;
use beamfarm_scene::read_bundle;

/// Two lines, so that what a test adds starts on the third.
const VIEW: &str = "image = { width = 8, height = 8 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }
";

fn error_of(text: &str, assets: &[(&str, Vec<u8>)]) -> SceneError {
    let mut files: std::collections::BTreeMap<_, _> = assets
        .iter()
        .map(|(name, bytes)| (name.to_string(), bytes.clone()))
        .collect();
    files.insert("scene.toml".to_string(), text.as_bytes().to_vec());
    let scene = "scene.toml".to_string();
    match beamfarm_scene::load(&Bundle { scene, files }) {
        Ok(_) => panic!("accepted:\n{text}"),
        Err(error) => error,
    }
}

/// Pairs of lines: what follows the view, with | for line ends, and indented the line and message of its error.
#[track_caller]
fn refused(cases: &str) {
    let lines: Vec<&str> = cases.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    for case in lines.chunks(2) {
        let text = format!("{VIEW}{}", case[0].replace(" | ", "\n"));
        let expected = format!("scene.toml:{}", case[1]);
        assert_eq!(error_of(&text, &[]).to_string(), expected, "\n{text}");
    }
}

#[test]
fn shapes_are_checked() {
    refused(
        r#"
[[shapes]] | type = "sphere" | radus = 1
    5: shapes[0].radus: unknown field `radus`; did you mean `radius`?
[[shapes]] | type = "sphere" | radius = "big"
    5: shapes[0].radius: invalid type: string "big", expected a number above 0
[[shapes]] | name = "ball" | type = "sphere" | radius = -1
    6: shapes["ball"].radius: expected a number above 0, found -1.0
[[shapes]] | type = "sphere" | radius = nan
    5: shapes[0].radius: expected a number above 0, found NaN
[[shapes]] | type = "sphere" | radius = 1e-60
    5: shapes[0].radius: expected a number above 0, found 1e-60
[[shapes]] | type = "sphere" | center = [0, 1]
    5: shapes[0].center: expected three numbers [x, y, z], found 2 numbers
[[shapes]] | type = "sphere" | center = [0, 1, 2, 3]
    5: shapes[0].center: expected three numbers [x, y, z], found 4 numbers
[[shapes]] | type = "sphere" | center = [ |     0, |     1, |     inf, | ]
    8: shapes[0].center[2]: expected a finite number, found inf
[[shapes]] | type = "sphere" | center = 3
    5: shapes[0].center: invalid type: integer `3`, expected three numbers [x, y, z]
[[shapes]] | type = "sphere" | center = [0, 1e300, 0]
    5: shapes[0].center[1]: 1e300 is too large for single precision
[[shapes]] | type = "sphere" | center = [0, 1e20, 0]
    5: shapes[0].center: it reaches 1.000e20 scene units from the camera; expected less than 1e15
[[shapes]] | type = "spere"
    4: shapes[0].type: unknown variant `spere`, expected one of `sphere`, `rectangle`, `cube`, `disc`, `cylinder`, `mesh`, `curves`, `points`, `instances`
[[shapes]] | radius = 1
    3: shapes[0]: missing field `type`
[[shapes]] | type = "rectangle" | radius = 1
    5: shapes[0].radius: "rectangle" does not take this field; expected one of displacement, material, interior, exterior, boundary, priority, open, emission, transform, flip_normals, space
[[shapes]] | type = "cylinder" | center = [0, 0, 0]
    5: shapes[0].center: "cylinder" does not take this field; expected one of p0, p1, radius, material, interior, exterior, boundary, priority, open, emission, transform, flip_normals, space
[[shapes]] | type = "cylinder" | p0 = [1, 2, 3] | p1 = [1, 2, 3]
    6: shapes[0].p1: expected two different points as `p0` and `p1`
[[shapes]] | type = "cylinder" | p0 = [0, 0, 1]
    5: shapes[0].p0: expected two different points as `p0` and `p1`
[[shapes]] | type = "cylinder" | p0 = [1, 2, 3] | radius = 1e20
    5: shapes[0].p0: the shape's transform cannot be inverted: it makes the shape flat (for a rectangle or disc, leave the third factor of `scale` at 1), or it is too large or too small for single precision
[[shapes]] | type = "mesh" | file = "a.ply" | face_normals = true | smooth = true
    7: shapes[0].smooth: normals are those of faces (`face_normals`) or smooth (`smooth`): one of the two
[[shapes]] | type = "mesh"
    4: shapes[0].type: with this type the field `file` is required
[[shapes]] | type = "sphere" | flip_normals = 1
    5: shapes[0].flip_normals: invalid type: integer `1`, expected true or false
[[shapes]] | type = "sphere" | material = "glas" | [materials.glass] | type = "dielectric" | ior = 1.5
    5: shapes[0].material: there is no material "glas"; the scene defines "glass"
[[shapes]] | type = "sphere" | material = "glass"
    5: shapes[0].material: there is no material "glass"; the scene defines none
[[shapes]] | type = "sphere" | material = "glass" | interior = "fog" | [materials.glass] | type = "dielectric" | ior = 1.5
    6: shapes[0].interior: there is no medium "fog"; the scene defines "none"
[[shapes]] | type = "sphere" | interior = "none"
    5: shapes[0].interior: this surface bounds no medium; expected a material of type "dielectric", "rough_dielectric" or "null" without `opacity` on this shape, "principled" with `spec_trans`, or a blend of one with what lets no light through
[[shapes]] | type = "sphere" | priority = 1
    5: shapes[0].priority: this surface bounds no medium; expected a material of type "dielectric", "rough_dielectric" or "null" without `opacity` on this shape, "principled" with `spec_trans`, or a blend of one with what lets no light through
[[shapes]] | type = "instances" | shape = { type = "sphere" }
    4: shapes[0].type: with this type the field `transforms` is required
"#,
    );
}

#[test]
fn transforms_are_checked() {
    refused(
        r#"
[[shapes]] | type = "sphere" | transform = [{ scale = [1, 0, 1] }]
    5: shapes[0].transform: the shape's transform cannot be inverted: it makes the shape flat (for a rectangle or disc, leave the third factor of `scale` at 1), or it is too large or too small for single precision
[[shapes]] | type = "sphere" | transform = [{ scale = 1e-30 }]
    5: shapes[0].transform: the shape's transform cannot be inverted: it makes the shape flat (for a rectangle or disc, leave the third factor of `scale` at 1), or it is too large or too small for single precision
[[shapes]] | type = "sphere" | transform = [ |     { scale = 1 }, |     { scale = 1, translate = [1, 2, 3] }, | ]
    7: shapes[0].transform[1]: expected exactly one of scale, rotate, translate, matrix, look_at in a step
[[shapes]] | type = "sphere" | transform = [{}]
    5: shapes[0].transform[0]: expected exactly one of scale, rotate, translate, matrix, look_at in a step
[[shapes]] | type = "sphere" | transform = [{ rotat = 1 }]
    5: shapes[0].transform[0].rotat: unknown field `rotat`; did you mean `rotate`?
[[shapes]] | type = "sphere" | transform = [{ rotate = { axis = [0, 0, 0], angle = 1 } }]
    5: shapes[0].transform[0]: the axis of a rotation must not be [0, 0, 0]
[[shapes]] | type = "sphere" | transform = { scale = 2 }
    5: shapes[0].transform: invalid type: map, expected a list of steps such as [{ scale = 2.0 }, { translate = [0, 1, 0] }]
[[shapes]] | type = "sphere" | transform = [{ matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]] }]
    5: shapes[0].transform[0]: expected [0, 0, 0, 1] as the last row of `matrix`
[[shapes]] | type = "sphere" | transform = [{ matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }]
    5: shapes[0].transform[0]: expected four rows of four numbers as `matrix`
[[shapes]] | type = "sphere" | transform = [{ matrix = [[1, 0, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]
    5: shapes[0].transform[0]: expected four rows of four numbers as `matrix`
[[shapes]] | type = "sphere" | transform = [{ look_at = { origin = [0, 0, 0], target = [0, 2, 0] } }]
    5: shapes[0].transform[0]: `up` of `look_at` must not be zero or parallel to the direction from origin to target
[[shapes]] | type = "instances" | shape = { type = "sphere", emission = { radiance = 1 } } | transforms = []
    5: shapes[0].shape.emission: instances cannot emit; list shapes of their own
[[shapes]] | type = "instances" | shape = { type = "instances" } | transforms = []
    5: shapes[0].shape.type: instances of instances are not supported; expected the type of one shape
[[shapes]] | type = "instances" | shape = { type = "sphere" } | transforms = [[], [{ scale = 0 }]]
    6: shapes[0].transforms[1]: the shape's transform cannot be inverted: it makes the shape flat (for a rectangle or disc, leave the third factor of `scale` at 1), or it is too large or too small for single precision
[[shapes]] | type = "instances" | shape = { type = "sphere" } | transforms = [] | material = "x"
    7: shapes[0].material: "instances" does not take this field; expected one of shape, transforms
"#,
    );
}

#[test]
fn materials_are_checked() {
    refused(
        r#"
[materials.x] | type = "diffuse" | reflectance = 2
    5: materials.x.reflectance: expected a number from 0 to 1, found 2.0
[materials.x] | type = "diffuse" | reflectance = [0.5, 0.5, 1.5]
    5: materials.x.reflectance[2]: expected a number from 0 to 1, found 1.5
[materials.x] | type = "diffuse" | reflectance = "red"
    5: materials.x.reflectance: invalid type: string "red", expected a number from 0 to 1, or three of them in brackets, or { image = "file" }, or { checkerboard = [color, color] }
[materials.x] | type = "diffuse" | reflectance = { file = "a.png" }
    5: materials.x.reflectance.file: unknown field `file`, expected one of `image`, `attribute`, `checkerboard`, `raw`, `filter`, `wrap`, `channel`, `uv`
[materials.x] | type = "diffuse" | ior = 2
    5: materials.x.ior: "diffuse" does not take this field; expected one of reflectance, roughness, two_sided, opacity, bump, normal_map
[materials.x] | type = "dielectric"
    4: materials.x.type: with this type the field `ior` is required
[materials.x] | type = "dielectric" | ior = 0
    5: materials.x.ior: expected a number above 0, found 0.0
[materials.x] | type = "dielectric" | ior = 1e6
    5: materials.x.ior: expected `ior` / `exterior_ior` from 0.01 to 100, found 1000000
[materials.x] | type = "dielectric" | ior = { preset = "jelly" }
    5: materials.x.ior.preset: expected one of "acrylic", "bk7", "diamond", "fused silica", "polycarbonate", "polystyrene", "sapphire", "sf10", "sf11", "water", found "jelly"
[materials.x] | type = "dielectric" | ior = { nd = 1.5 }
    5: materials.x.ior: expected one of: `preset = "bk7"`, `cauchy = [a, b]`, `sellmeier = [[b, c], ...]`, or `nd` and `abbe`
[materials.x] | type = "dielectric" | ior = { preset = "bk7", cauchy = [1.5, 0.01] }
    5: materials.x.ior: expected one of: `preset = "bk7"`, `cauchy = [a, b]`, `sellmeier = [[b, c], ...]`, or `nd` and `abbe`
[materials.x] | type = "dielectric" | ior = { sellmeier = [[1.0, 0.25]] }
    5: materials.x.ior: expected an index of refraction from 0.001 to 1000 at all wavelengths from 380 to 780 nm, found NaN at 380 nm
[materials.x] | type = "dielectric" | ior = { glass = "bk7" }
    5: materials.x.ior.glass: unknown field `glass`, expected one of `preset`, `cauchy`, `sellmeier`, `nd`, `abbe`
[materials.x] | type = "dielectric" | ior = "bk7"
    5: materials.x.ior: invalid type: string "bk7", expected a number above 0, or one of `preset = "bk7"`, `cauchy = [a, b]`, `sellmeier = [[b, c], ...]`, or `nd` and `abbe` in braces
[materials.x] | type = "conductor" | nk = [[500, 1, 2], [400, 1, 2]]
    5: materials.x.nk: expected rows [nm, eta, k] in the order of their wavelengths, with numbers that are not negative, and eta and k not both 0
[materials.x] | type = "conductor" | nk = [[500, 0, 0]]
    5: materials.x.nk: expected rows [nm, eta, k] in the order of their wavelengths, with numbers that are not negative, and eta and k not both 0
[materials.x] | type = "rough_dielectric" | ior = 2 | alpha = 0.0001
    6: materials.x.alpha: expected a roughness from 0.001 to 1 (for less, take the smooth material), found 0.0001
[materials.x] | type = "conductor"
    4: materials.x.type: a conductor is given by `preset`, by `eta` and `k`, or by `nk`: one of these ways
[materials.x] | type = "conductor" | preset = "gold" | eta = 1
    4: materials.x.type: a conductor is given by `preset`, by `eta` and `k`, or by `nk`: one of these ways
[materials.x] | type = "conductor" | eta = [1, 0, 1] | k = [1, 0, 1]
    4: materials.x.type: eta and k are both 0 in one channel
[materials.x] | type = "conductor" | preset = "unobtainium"
    5: materials.x.preset: there is no metal "unobtainium"; expected one of aluminium, beryllium, chromium, copper, gold, iridium, lithium, mercury, molybdenum, nickel, niobium, potassium, rhodium, silver, sodium, tantalum, titanium nitride, tungsten, vanadium
[materials.x] | type = "rough_conductor" | distribution = "phong"
    5: materials.x.distribution: unknown variant `phong`, expected `ggx` or `beckmann`
[materials.x] | type = "dielectric" | ior = 2 | specular_transmittance = 1.5
    6: materials.x.specular_transmittance: expected a number from 0 to 1, found 1.5
[materials.x] | type = "thin_dielectric" | ior = 2 | alpha = 0.1
    6: materials.x.alpha: "thin_dielectric" does not take this field; expected one of ior, exterior_ior, specular_reflectance, specular_transmittance, opacity, bump, normal_map
[materials.x] | type = "plastic" | exterior_ior = 200
    4: materials.x.type: expected `ior` / `exterior_ior` from 0.01 to 100, found 0.00745
[materials.x] | type = "plastic" | nonlinear = 1
    5: materials.x.nonlinear: invalid type: integer `1`, expected true or false
[materials.x] | type = "rough_plastic"
    4: materials.x.type: with this type the field `alpha` is required
[materials.x] | type = "principled" | metallic = -0.1
    5: materials.x.metallic: expected a number from 0 to 1, found -0.1
[materials.x] | type = "principled" | specular = 0.5 | ior = 1.5
    5: materials.x.specular: the reflection is given by `specular` or by `ior`: one of the two ways
[materials.x] | type = "principled" | exterior_ior = 1.5
    5: materials.x.exterior_ior: `exterior_ior` goes with `ior`, which is missing
[materials.x] | type = "diffuse" | opacity = 1.5
    5: materials.x.opacity: expected a number from 0 to 1, found 1.5
[materials.x] | type = "null" | opacity = 0.5
    5: materials.x.opacity: "null" does not take this field; it takes none
[materials.x] | type = "diffuse" | bump = 0.5
    5: materials.x.bump: invalid type: floating point `0.5`, expected { image = "file", scale = 1.0 }
[materials.x] | type = "diffuse" | bump = { image = "h.png", height = 2 }
    5: materials.x.bump.height: unknown field `height`, expected one of `image`, `texture`, `output`, `raw`, `filter`, `wrap`, `uv`, `scale`, `strength`, `over`
[materials.x] | type = "diffuse" | bump = { image = "h.png", strength = 2 }
    5: materials.x.bump.strength: expected a number from 0 to 1, found 2.0
[[shapes]] | type = "sphere" | material = "x" | interior = "none" | [materials.x] | type = "dielectric" | ior = 1.5 | opacity = 0.5
    6: shapes[0].interior: this surface bounds no medium; expected a material of type "dielectric", "rough_dielectric" or "null" without `opacity` on this shape, "principled" with `spec_trans`, or a blend of one with what lets no light through
[materials.x] | type = "null" | two_sided = true
    5: materials.x.two_sided: "null" does not take this field; it takes none
"#,
    );
}

#[test]
fn lights_and_emission_are_checked() {
    refused(
        r#"
[[shapes]] | type = "sphere" | emission = { radiance = 1, power = 1 }
    5: shapes[0].emission: emission is given by `radiance` (W/(m^2 sr)) or by `power` (W): exactly one of them
[[shapes]] | type = "sphere" | emission = {}
    5: shapes[0].emission: emission is given by `radiance` (W/(m^2 sr)) or by `power` (W): exactly one of them
[[shapes]] | type = "sphere" | emission = { radiance = 1, scale = 2 }
    5: shapes[0].emission.scale: it multiplies a texture; `radiance` is none
[[shapes]] | type = "sphere" | emission = { power = 1, scale = 2 }
    5: shapes[0].emission.scale: it multiplies a texture; `radiance` is none
[[shapes]] | type = "sphere" | emission = { radiance = { checkerboard = [1, -1] } }
    5: shapes[0].emission.radiance.checkerboard[1]: expected a number that is not negative, found -1.0
[[shapes]] | type = "sphere" | emission = { power = 1, soft_falloff = true }
    5: shapes[0].emission.soft_falloff: expected a sphere that is not stretched, of a material of type `null`, with one medium on both sides: it is what a point in or near a lamp sees
[[shapes]] | type = "sphere" | emission = { radience = 1 }
    5: shapes[0].emission.radience: unknown field `radience`; did you mean `radiance`?
[[shapes]] | type = "sphere" | emission = { power = -1 }
    5: shapes[0].emission.power: expected a number that is not negative, found -1.0
[[shapes]] | type = "sphere" | radius = 1e-12 | emission = { power = 1e30 }
    6: shapes[0].emission: the radiance is too large for single precision
[[lights]] | type = "point" | position = [0, 0, 0]
    4: lights[0].type: this light is given by `intensity` (W/sr) or by `power` (W): exactly one of them
[[lights]] | type = "point" | position = [0, 0, 0] | power = 1 | intensity = 1
    4: lights[0].type: this light is given by `intensity` (W/sr) or by `power` (W): exactly one of them
[[lights]] | type = "point" | power = 1
    4: lights[0].type: with this type the field `position` is required
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [1, 2, 3] | power = 1
    6: lights[0].target: expected a point other than `position`
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | cutoff_angle = 180
    8: lights[0].cutoff_angle: expected an angle in degrees between 0 and 180, both excluded, found 180.0
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | radius = -0.1
    8: lights[0].radius: expected a number that is not negative, found -0.1
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | radius = nan
    8: lights[0].radius: expected a number that is not negative, found NaN
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | radius = 1e30
    8: lights[0].radius: it reaches 1.000e30 scene units from the camera; expected less than 1e15
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | falloff = "soft"
    8: lights[0].falloff: unknown variant `soft`, expected `linear` or `smooth`
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | intensity = 1 | radius = 0.1 | image = "a.png"
    8: lights[0].radius: a spot with an `image` takes no `radius`, `soft_falloff` or `falloff`
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | soft_falloff = true
    8: lights[0].soft_falloff: it is that of a ball; expected a `radius`
[[lights]] | type = "point" | position = [1, 2, 3] | power = 1 | soft_falloff = true
    7: lights[0].soft_falloff: "point" does not take this field; expected one of position, intensity, power, ies, scale, target, direction, up
[[lights]] | type = "point" | position = [1, 2, 3] | power = 1 | radius = 0.1
    7: lights[0].radius: "point" does not take this field; expected one of position, intensity, power, ies, scale, target, direction, up
[[lights]] | type = "directional" | direction = [0, 0, 1] | irradiance = 1 | angle = -1
    7: lights[0].angle: expected an angle in degrees from 0 to below 180, found -1.0
[[lights]] | type = "directional" | direction = [0, 0, 1] | irradiance = 1 | angle = 180
    7: lights[0].angle: expected an angle in degrees from 0 to below 180, found 180.0
[[lights]] | type = "directional" | direction = [0, 0, 1] | irradiance = 1 | angle = nan
    7: lights[0].angle: expected an angle in degrees from 0 to below 180, found NaN
[[lights]] | type = "spot" | position = [1, 2, 3] | target = [0, 0, 0] | power = 1 | cutoff_angle = 20 | beam_width = 20
    9: lights[0].beam_width: expected `beam_width` below `cutoff_angle` (default 20)
[[lights]] | type = "directional" | direction = [0, 0, 0] | irradiance = 1
    5: lights[0].direction: expected a direction other than [0, 0, 0]
[[lights]] | type = "directional" | direction = [0, 0, 1] | power = 1
    6: lights[0].power: "directional" does not take this field; expected one of direction, irradiance, angle
[[lights]] | type = "environment"
    4: lights[0].type: an environment is given by `radiance`, or by `image` or `texture` and perhaps `scale`
[[lights]] | type = "environment" | radiance = 1 | transform = [{ scale = 2 }]
    6: lights[0].transform: an environment is rotated and mirrored, not scaled or sheared
[[lights]] | type = "environment" | radiance = 1 | transform = [{ matrix = [[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]
    6: lights[0].transform: an environment is rotated and mirrored, not scaled or sheared
[[lights]] | type = "environment" | radiance = 1 | rotate_y = 3 | transform = [{ rotate = { axis = [0, 1, 0], angle = 3 } }]
    7: lights[0].transform: expected `rotate_y` or `transform`, not both
[[lights]] | type = "point" | position = [0, 0, 0] | power = 1 | transform = []
    7: lights[0].transform: "point" does not take this field; expected one of position, intensity, power, ies, scale, target, direction, up
[[lights]] | type = "environment" | radiance = 1 | scale = 2
    4: lights[0].type: an environment is given by `radiance`, or by `image` or `texture` and perhaps `scale`
[[lights]] | type = "candle"
    4: lights[0].type: unknown variant `candle`, expected one of `point`, `spot`, `projector`, `laser`, `directional`, `environment`
[[lights]] | type = "laser" | position = [0, 0, 0] | radius = 1 | power = 1
    4: lights[0].type: a laser is turned by `target` or by `direction`: exactly one of them
[[lights]] | type = "laser" | position = [0, 0, 0] | direction = [0, 0, 1] | power = 1
    4: lights[0].type: with this type the field `radius` is required
[[lights]] | type = "laser" | position = [0, 0, 0] | direction = [0, 0, 1] | power = 1 | radius = 0
    8: lights[0].radius: expected a radius above 0 whose square single precision holds
[[lights]] | type = "laser" | position = [0, 0, 0] | direction = [0, 0, 1] | radius = 1
    4: lights[0].type: a laser is given by `power` (W) or by `irradiance` (W/m^2): exactly one of them
[[lights]] | type = "laser" | position = [0, 0, 0] | direction = [0, 0, 1] | radius = 1e-15 | power = 1e20
    8: lights[0].power: too much power for single precision on so small a disc
[[lights]] | type = "point" | position = [0, 0, 0] | power = 1 | scale = 2
    7: lights[0].scale: `scale` is for lamps with `ies`
[[shapes]] | type = "sphere" | emission = { power = 1, spread = 0.5 }
    5: shapes[0].emission.spread: expected an angle in degrees from 1 to 180, found 0.5
"#,
    );
}

#[test]
fn settings_and_structure_are_checked() {
    refused(
        r#"
[world] | medium = "fog"
    4: world.medium: there is no medium "fog"; the scene defines "none"
[camera.x]
    3: cannot extend value of type inline table with a dotted key
[render] | alpha = 0
    4: render.alpha: expected a number between 0 and 1, both excluded, found 0.0
[render] | alpha = 1
    4: render.alpha: expected a number between 0 and 1, both excluded, found 1.0
[render] | passes = 0
    4: render.passes: expected a whole number from 1 to 9007199254740992, found 0
[render] | passes = -1
    4: render.passes: invalid value: integer `-1`, expected a whole number
[render] | paths = 1.5
    4: render.paths: invalid type: floating point `1.5`, expected a whole number
[render] | schedule = "pas"
    4: render.schedule: unknown variant `pas`, expected `pass` or `beam`
[render] | engine = "GPU"
    4: render.engine: unknown variant `GPU`, expected one of `cpu`, `gpu`, `auto`
[render] | view = "aces"
    4: render.view: unknown variant `aces`, expected one of `standard`, `filmic`, `agx`
[render] | white_balance = 999
    4: render.white_balance: expected a temperature from 1000 to 25000 kelvin, found 999.0
[render] | white_balance = "warm"
    4: render.white_balance: invalid type: string "warm", expected a temperature from 1000 to 25000 kelvin
[render] | radius = 0.0
    4: render.radius: expected a number above 0, found 0.0
[light]
    3: light: unknown field `light`; did you mean `lights`?
x = 1
    3: x: unknown field `x`, expected one of `image`, `render`, `animation`, `world`, `camera`, `media`, `textures`, `materials`, `shapes`, `lights`, `gltf`, `groups`, `rules`
x = 1 | x = 2
    4: duplicate key
"#,
    );
}

#[test]
fn cameras_and_images_are_checked() {
    for (from, to, expected) in [
        (
            "width = 8",
            "width = 0",
            "1: image.width: expected 1 to 32768 pixels, found 0",
        ),
        (
            "width = 8",
            "width = 40000",
            "1: image.width: expected 1 to 32768 pixels, found 40000",
        ),
        (
            "width = 8",
            "width = 8.5",
            "1: image.width: invalid type: floating point `8.5`, expected a whole number",
        ),
        ("width = 8, ", "", "1: image: missing field `width`"),
        (
            "fov = 40",
            "fov = 180",
            "2: camera.fov: expected an angle in degrees between 0 and 180, both excluded, found 180.0",
        ),
        (
            "fov = 40",
            "fov = 0",
            "2: camera.fov: expected an angle in degrees above 0, to 360, found 0.0",
        ),
        (", fov = 40", "", "2: camera: missing field `fov`"),
        (
            "target = [0, 0, 0]",
            "target = [0, 0, 5]",
            "2: camera.target: expected a point other than `origin`",
        ),
        (
            "fov = 40",
            "fov = 40, up = [0, 0, 2]",
            "2: camera.up: `up` must not be zero or parallel to the direction from `origin` to `target`",
        ),
        (
            "target = [0, 0, 0]",
            "target = [0, 1, 5]",
            "2: camera.target: `up` must not be zero or parallel to the direction from `origin` to `target`",
        ),
        (
            "fov = 40",
            "fov = 40, aperture = -1",
            "2: camera.aperture: expected a number that is not negative, found -1.0",
        ),
        (
            "fov = 40",
            "fov = 40, focus_distance = 0",
            "2: camera.focus_distance: expected a number above 0, found 0.0",
        ),
        (
            "fov = 40",
            "fov = 40, fov_axis = \"z\"",
            "2: camera.fov_axis: unknown variant `z`, expected one of `x`, `y`, `smaller`, `larger`",
        ),
        (
            "fov = 40",
            "fov = 40, view_width = 2",
            "2: camera.view_width: \"perspective\" does not take this field; expected one of fov, fov_axis",
        ),
        (
            "fov = 40",
            "projection = \"orthographic\", fov = 40, view_width = 2",
            "2: camera.fov: \"orthographic\" does not take this field; expected one of view_width",
        ),
        (
            "fov = 40",
            "projection = \"orthographic\"",
            "2: camera: missing field `view_width`",
        ),
        (
            "fov = 40",
            "projection = \"orthographic\", view_width = 0",
            "2: camera.view_width: expected a number above 0, found 0.0",
        ),
        (
            "fov = 40",
            "projection = \"parallel\", view_width = 1",
            "2: camera.projection: unknown variant `parallel`, expected one of `perspective`, `orthographic`, \
             `equirectangular`, `cylindrical`, `fisheye`",
        ),
        (
            "fov = 40",
            "fov = 40, medium = \"fog\"",
            "2: camera.medium: there is no medium \"fog\"; the scene defines \"none\"",
        ),
    ] {
        assert!(VIEW.contains(from));
        let found = error_of(&VIEW.replace(from, to), &[]).to_string();
        assert_eq!(found, format!("scene.toml:{expected}"));
    }
    assert_eq!(error_of("", &[]).to_string(), "scene.toml:1: missing field `image`");
    let no_camera = error_of("[image]\nwidth = 1\nheight = 1\n", &[]).to_string();
    assert_eq!(no_camera, "scene.toml:1: missing field `camera`");
}

/// Syntax errors come from the TOML parser; only the line matters.
#[test]
fn syntax_errors_have_lines() {
    for text in ["x =", "[[shapes]", "x = \"open", "x = 1 y = 2", "x = [1, 2"] {
        let error = error_of(&format!("{VIEW}\n{text}"), &[]);
        assert_eq!(error.line, Some(4), "{error}");
    }
    let mut bytes = VIEW.as_bytes().to_vec();
    bytes.extend(b"# \xff");
    let files = [("scene.toml".to_string(), bytes)].into_iter().collect();
    let scene = "scene.toml".to_string();
    let error = beamfarm_scene::load(&Bundle { scene, files }).unwrap_err();
    assert_eq!(error.to_string(), "scene.toml:3: the scene file is not UTF-8 text");
}

const MEDIA: &str = "[media.fog]
type = \"homogeneous\"
sigma_t = 1
albedo = 0.5
[materials.glass]
type = \"dielectric\"
ior = 1.5
[materials.empty]
type = \"null\"
";

/// Media need closed surfaces, or the same medium on both sides.
#[test]
fn boundaries_of_media_must_close() {
    const OPEN: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n";
    let assets = |faces: &str| [("a.obj", format!("{OPEN}{faces}").into_bytes())];
    let scene = |shape: &str, world: &str| format!("{VIEW}{MEDIA}[world]\nmedium = \"{world}\"\n[[shapes]]\n{shape}");
    let mesh = "type = \"mesh\"\nfile = \"a.obj\"\nmaterial = \"glass\"";
    for (shape, world, faces, reason) in [
        (
            "type = \"rectangle\"\nmaterial = \"glass\"",
            "fog",
            "",
            "belongs to one triangle only",
        ),
        (
            "type = \"disc\"\nmaterial = \"glass\"",
            "fog",
            "",
            "a disc has no inside",
        ),
        (
            "type = \"disc\"\nmaterial = \"empty\"\ninterior = \"fog\"",
            "none",
            "",
            "a disc has no inside",
        ),
        (
            "type = \"cylinder\"\nmaterial = \"glass\"",
            "fog",
            "",
            "a cylinder has no ends",
        ),
        (mesh, "fog", "", "belongs to one triangle only"),
    ] {
        let error = error_of(&scene(shape, world), &assets(faces)).to_string();
        assert!(
            error.contains("an open surface cannot be the boundary between the media"),
            "{error}"
        );
        assert!(error.contains(reason), "{error}");
        assert!(error.starts_with("scene.toml:1"), "{error}");
    }
    for (shape, world, faces) in [
        (mesh, "fog", "f 2 3 4\n"),
        // A triangle turned the wrong way: no other solid can be meant.
        (mesh, "fog", "f 2 4 3\n"),
        (mesh, "none", ""),
        (
            "type = \"rectangle\"\nmaterial = \"glass\"\ninterior = \"fog\"",
            "fog",
            "",
        ),
        (
            "type = \"sphere\"\nmaterial = \"empty\"\ninterior = \"fog\"",
            "none",
            "",
        ),
        ("type = \"cube\"\nmaterial = \"empty\"\ninterior = \"fog\"", "none", ""),
        ("type = \"rectangle\"", "fog", ""),
    ] {
        let mut files: std::collections::BTreeMap<_, _> = assets(faces)
            .into_iter()
            .map(|(name, bytes)| (name.to_string(), bytes))
            .collect();
        files.insert("scene.toml".to_string(), scene(shape, world).into_bytes());
        let bundle = Bundle {
            scene: "scene.toml".to_string(),
            files,
        };
        assert!(beamfarm_scene::load(&bundle).is_ok(), "{shape}");
    }
}

#[test]
fn light_from_infinity_needs_an_end_of_the_fog() {
    for light in [
        "type = \"environment\"\nradiance = 1",
        "type = \"directional\"\ndirection = [0, 0, 1]\nirradiance = 1",
    ] {
        let text = format!("{VIEW}{MEDIA}[world]\nmedium = \"fog\"\n[[lights]]\n{light}");
        let error = error_of(&text, &[]);
        assert_eq!(error.line, Some(15));
        assert!(error.message.contains("bound the medium by a shape"), "{error}");
    }
}

#[test]
fn bad_assets_are_named() {
    let ply = |vertex: &str, face: &str, count: u64| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n{vertex}\n{face}\n"
        )
        .into_bytes()
    };
    let mut cut = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    cut.extend([0; 36]);
    cut.extend([3, 0, 0, 0, 0, 1]);
    for (bytes, expected) in [
        (
            ply("0 1 0", "2 0 1", 3),
            "a.ply: the mesh is empty; expected at least one triangle",
        ),
        (
            ply("0 1 0", "3 0 1 3", 3),
            "a.ply: triangle 0 (from zero) names vertex 3, but there are 3",
        ),
        (
            ply("0 1 0", "3 0 1 2", 4_000_000_000),
            "a.ply: the file is too short for the 4000000000 `vertex` elements it claims",
        ),
        (b"solid".to_vec(), "a.ply:1: Expected magic number 'ply'."),
    ] {
        let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"a.ply\"");
        let error = error_of(&text, &[("a.ply", bytes)]).to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"a.ply\"");
    let nan = error_of(&text, &[("a.ply", ply("0 nan 0", "3 0 1 2", 3))]);
    assert_eq!((nan.file.to_str(), nan.line), (Some("a.ply"), Some(12)), "{nan}");
    let cut = error_of(&text, &[("a.ply", cut)]).to_string();
    assert!(
        cut.starts_with("a.ply: Unexpected end of file while reading binary element 'face'"),
        "{cut}"
    );

    let texture = "[materials.x]\ntype = \"diffuse\"\nreflectance = { image = \"a.png\" }";
    let sky = "[[lights]]\ntype = \"environment\"\nimage = \"a.png\"";
    for text in [texture, sky] {
        let error = error_of(&format!("{VIEW}{text}"), &[("a.png", b"JFIF".to_vec())]).to_string();
        assert_eq!(
            error,
            "a.png: unsupported kind of image; expected PNG, JPEG, WebP, BMP, KTX2, OpenEXR or Radiance HDR"
        );
    }
}

/// A missing file is an error of the line that names it.
#[test]
fn missing_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let absent = read_bundle(&path).unwrap_err();
    assert_eq!((absent.file.as_path(), absent.line), (path.as_path(), None));

    std::fs::create_dir(folder.path().join("folder")).unwrap();
    for (file, reason) in [("none.ply", "No such file"), ("folder", "not a regular file")] {
        let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"{file}\"");
        std::fs::write(&path, text).unwrap();
        let error = read_bundle(&path).unwrap_err();
        assert_eq!((error.file.as_path(), error.line), (path.as_path(), Some(5)));
        assert!(
            error
                .message
                .contains(&format!("shapes[0].file: the file \"{file}\": {reason}")),
            "{error}"
        );
    }
    let error = read_bundle(&folder.path().join("folder")).unwrap_err();
    assert_eq!(error.message, "not a regular file");
    let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"none.ply\"");
    assert_eq!(error_of(&text, &[]).line, Some(5));
}
