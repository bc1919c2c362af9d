//! glTF files: they hold what a native scene with the same numbers holds, and their claims are checked.

use beamfarm_harness::render::{average, scene_with};
use beamfarm_image::bundle::Bundle;
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::geometry::{Mesh, Object, Shape};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::texture::{Texture, TextureFilter, Wrap};
use beamfarm_scene::read_bundle;

const VIEW: &str = "image = { width = 12, height = 8 }
render = { passes = 2, paths = 200 }
";
const CAMERA: &str = "camera = { origin = [0.5, 1, 6], target = [0.5, 1, 0], fov = 50 }
";

/// A square's corners: positions, normals, texture coordinates; then two triangles as bytes, and as a strip as 16-bit
/// numbers.
fn square() -> Vec<u8> {
    let mut bytes = Vec::new();
    let corners = [[0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut put = |values: &[f32]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    corners.iter().for_each(|[x, y]| put(&[*x, *y, 0.25]));
    (0..4).for_each(|_| put(&[0.0, 0.6, 0.8]));
    corners.iter().for_each(|[x, y]| put(&[*x, 1.0 - *y]));
    bytes.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    bytes.extend([0u16, 1, 3, 2].iter().flat_map(|i| i.to_le_bytes()));
    assert_eq!(bytes.len(), 144);
    bytes
}

/// Buffer views and accessors of [`square`].
const SQUARE: &str = r#"
    "buffers": [{ "byteLength": 144 }],
    "bufferViews": [
        { "buffer": 0, "byteOffset": 0, "byteLength": 96 },
        { "buffer": 0, "byteOffset": 96, "byteLength": 32 },
        { "buffer": 0, "byteOffset": 128, "byteLength": 16 }
    ],
    "accessors": [
        { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0.25], "max": [1, 1, 0.25] },
        { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3" },
        { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
        { "bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR" },
        { "bufferView": 2, "byteOffset": 8, "componentType": 5123, "count": 4, "type": "SCALAR" }
    ]"#;

fn json(body: &str) -> String {
    format!("{{ \"asset\": {{ \"version\": \"2.0\" }},\n{body} }}")
}

/// A binary file from this JSON and buffer.
fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let chunk = |kind: &[u8], bytes: Vec<u8>| {
        let length = (bytes.len() as u32).to_le_bytes();
        [&length[..], kind, &bytes].concat()
    };
    let body = [chunk(b"JSON", pad(json.as_bytes(), b' ')), chunk(b"BIN\0", pad(bin, 0))].concat();
    let length = (body.len() as u32 + 12).to_le_bytes();
    [b"glTF", &2u32.to_le_bytes()[..], &length, &body].concat()
}

/// A file of the square with these nodes, materials and the rest; `{}` stands for a primitive's attributes.
fn file(body: &str) -> Vec<u8> {
    let attributes = r#""attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }"#;
    let body = body.replace("@", attributes);
    glb(&json(&format!("{body},\n{SQUARE}")), &square())
}

fn load(text: &str, files: &[(&str, Vec<u8>)]) -> Result<SceneDescription, String> {
    let mut bundle = Bundle {
        scene: "scene.toml".into(),
        ..Bundle::default()
    };
    for (name, bytes) in files {
        bundle.files.insert(name.to_string(), bytes.clone());
    }
    bundle.files.insert("scene.toml".into(), text.into());
    beamfarm_scene::load(&bundle).map_err(|error| error.to_string())
}

fn load_file(body: &str) -> SceneDescription {
    let text = format!("{VIEW}{CAMERA}[[gltf]]\nfile = \"a.glb\"");
    load(&text, &[("a.glb", file(body))]).unwrap()
}

fn error_of(bytes: Vec<u8>) -> String {
    let text = format!("{VIEW}{CAMERA}[[gltf]]\nfile = \"a.glb\"");
    load(&text, &[("a.glb", bytes)]).unwrap_err()
}

fn mesh(object: &Object) -> &Mesh {
    match &object.shape {
        Shape::Mesh { mesh, .. } => mesh,
        other => panic!("{other:?}"),
    }
}

fn assert_near(found: Vec3, expected: [f32; 3]) {
    let expected = Vec3::from(expected);
    assert!((found - expected).length() < 1e-5, "{found}, {expected}");
}

/// The same bits as the scene with the same numbers written out.
#[test]
fn a_file_renders_as_its_native_twin() {
    let body = r#"
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "plate", "mesh": 0, "matrix": [2, 0, 0, 0, 0, 3, 0, 0, 0, 0.5, 1, 0, 0.5, 0.25, 0, 1] }],
        "meshes": [{ "primitives": [{ @, "indices": 3, "material": 0 }] }],
        "materials": [{
            "doubleSided": true,
            "emissiveFactor": [0.25, 0.5, 1],
            "extras": [1, "own"],
            "extensions": { "KHR_materials_clearcoat": {}, "KHR_materials_emissive_strength": { "emissiveStrength": 2 }, "KHR_materials_ior": { "ior": 1.75 } },
            "pbrMetallicRoughness": { "baseColorFactor": [0.75, 0.5, 0.25, 1], "metallicFactor": 0.25, "roughnessFactor": 0.5 }
        }]"#;
    let light = "[[lights]]\ntype = \"point\"\nposition = [0, 2, 5]\nintensity = 3\n";
    let gltf = format!(
        "{VIEW}{CAMERA}{light}[[gltf]]\nfile = \"a.glb\"\ntransform = [{{ scale = 0.5 }}, {{ translate = [0, 0, -1] }}]"
    );
    let native = format!(
        "{VIEW}{CAMERA}{light}[materials.plate]\ntype = \"principled\"\nbase_color = [0.75, 0.5, 0.25]\nmetallic = 0.25\n\
         roughness = 0.5\nior = 1.75\ntwo_sided = true\n[[shapes]]\ntype = \"mesh\"\nfile = \"a.obj\"\nmaterial = \"plate\"\n\
         emission = {{ radiance = [0.5, 1, 2], two_sided = true }}\n\
         transform = [{{ matrix = [[2, 0, 0, 0.5], [0, 3, 0.5, 0.25], [0, 0, 1, 0], [0, 0, 0, 1]] }}, {{ scale = 0.5 }}, \
         {{ translate = [0, 0, -1] }}]"
    );
    let obj = "v 0 0 0.25\nv 1 0 0.25\nv 1 1 0.25\nv 0 1 0.25\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        vn 0 0.6000000238418579 0.800000011920929\nf 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n";
    let one = average(&scene_with(&gltf, &[("a.glb", &file(body))]));
    let two = average(&scene_with(&native, &[("a.obj", obj.as_bytes())]));
    assert!(two.beauty.pixels.iter().flatten().any(|v| *v > 0.0));
    assert_eq!(one.beauty.pixels, two.beauty.pixels);
}

#[test]
fn nodes_are_placed_below_their_parents() {
    let description = load_file(
        r#"
        "scenes": [{ "nodes": [2, 0] }],
        "nodes": [
            { "name": "leaf", "mesh": 0, "scale": [2, 2, 2] },
            { "name": "not in the scene", "mesh": 0 },
            { "translation": [1, 2, 3], "rotation": [0, 0.70710677, 0, 0.70710677], "children": [3] },
            { "name": "child", "mesh": 1, "translation": [0, 0, 10] }
        ],
        "meshes": [
            { "primitives": [{ @, "indices": 3 }] },
            { "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 4, "mode": 5 }, { @, "mode": 6 }, { @, "mode": 1 }] }
        ]"#,
    );
    let names: Vec<&str> = description.objects.iter().map(|o| &*o.name).collect();
    assert_eq!(names, ["leaf", "child (0)", "child (1)"]);
    let [leaf, strip, fan] = &description.objects[..] else {
        panic!();
    };
    // Relative to the camera at (0.5, 1, 6).
    assert_near(mesh(leaf).positions[2], [1.5, 1.0, -5.5]);
    assert_near(mesh(leaf).normals[2], [0.0, 0.6, 0.8]);
    assert!((mesh(leaf).uvs[2] - Vec2::new(1.0, 1.0)).length() < 1e-6);
    // +z becomes +x, and +x becomes -z.
    for child in [strip, fan] {
        assert_near(
            mesh(child).positions[1],
            [1.0 + 10.25 - 0.5, 2.0 - 1.0, 3.0 - 1.0 - 6.0],
        );
    }
    assert_near(mesh(fan).normals[0], [0.8, 0.6, 0.0]);
    assert!(mesh(strip).normals.is_empty() && mesh(strip).uvs.is_empty());
    assert_eq!(mesh(strip).triangles, [[0, 1, 3], [1, 2, 3]]);
    for triangle in 0..2 {
        assert!(mesh(strip).normal(triangle).x > 0.0, "winding");
        assert!(mesh(fan).normal(triangle).x > 0.0, "winding");
    }
}

#[test]
fn nodes_share_a_mesh() {
    let description = load_file(
        r#"
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "mesh": 0, "translation": [3, 0, 0], "scale": [-1, 1, 1] }],
        "meshes": [{ "primitives": [{ @, "indices": 3 }] }]"#,
    );
    assert_eq!(description.objects.len(), 2);
    assert_eq!(description.materials.len(), 1);
}

#[test]
fn base_materials_are_principled() {
    let png = include_bytes!("../../fuzz/seeds/png/rgb.png");
    let body = r#"
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ @, "material": 0 }, { @ }, { @, "material": 1 }] }],
        "images": [{ "uri": "tex%20tures/a.png" }],
        "samplers": [{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33071 }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "materials": [
            { "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 1, 1, 1],
                "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.25, 0.5], "scale": [2, 4] } } },
                "metallicRoughnessTexture": { "index": 0 },
                "roughnessFactor": 0.5
            } },
            { "emissiveFactor": [1, 0, 0] }
        ]"#;
    let text = format!("{VIEW}{CAMERA}[[gltf]]\nfile = \"in/a.glb\"");
    let files = [("in/a.glb", file(body)), ("in/tex tures/a.png", png.to_vec())];
    let description = load(&text, &files).unwrap();
    let kinds: Vec<_> = description
        .objects
        .iter()
        .map(|o| &description.materials[o.material as usize].kind)
        .collect();
    let [
        MaterialKind::Principled {
            base_color:
                Texture::Image {
                    image,
                    filter: TextureFilter::Nearest,
                    wrap: Wrap::Clamp,
                    image_from_uv,
                    ..
                },
            metallic,
            roughness,
            ..
        },
        MaterialKind::Principled {
            base_color: Texture::Constant(white),
            metallic: all_metal,
            roughness: all_rough,
            ..
        },
        MaterialKind::Principled { .. },
    ] = kinds[..]
    else {
        panic!("{kinds:?}");
    };
    assert_eq!(*white, Rgb::ONE);
    assert_eq!((all_metal.range(), all_rough.range()), ([1.0; 2], [1.0; 2]));
    // Column 1, row 0 is (60, 80, 100) / 255 in sRGB.
    let expected = [60.0, 80.0, 100.0].map(|v: f64| libm::pow((v / 255.0 + 0.055) / 1.055, 2.4) as f32);
    assert_near(image.pixels[1], [expected[0] * 0.5, expected[1], expected[2]]);
    // Columns 0 to 3 and rows 0 to 2; the value is 60 x + 20 c + y.
    for (found, expected) in [
        (metallic.range(), [40.0 / 255.0, 222.0 / 255.0]),
        (roughness.range(), [0.5 * 20.0 / 255.0, 0.5 * 202.0 / 255.0]),
    ] {
        assert!(
            (found[0] - expected[0]).abs() < 1e-6 && (found[1] - expected[1]).abs() < 1e-6,
            "{found:?}"
        );
    }
    // Scaled by (2, 4), moved by (0.25, 0.5), v from below.
    let textured = mesh(&description.objects[0]);
    for (corner, expected) in [(2, Vec2::new(2.25, 0.5)), (0, Vec2::new(0.25, 1.0 - 4.5))] {
        assert!((image_from_uv.transform_point2(textured.uvs[corner]) - expected).length() < 1e-6);
    }
    let [light] = &description.lights[..] else {
        panic!("{:?}", description.lights);
    };
    assert!(matches!(light.kind, LightKind::Area { object: 2, radiance, .. } if radiance == Rgb::new(1.0, 0.0, 0.0)));

    let plain = format!("{text}\nmaterials = false");
    let description = load(&plain, &files).unwrap();
    assert!(description.lights.is_empty());
    assert!(matches!(description.materials[..], [ref m] if matches!(m.kind, MaterialKind::Diffuse { .. })));
}

const LIGHTS_AND_CAMERAS: &str = r#"
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": { "KHR_lights_punctual": { "lights": [
        { "type": "point", "color": [1, 0.5, 0.25], "intensity": 8 },
        { "type": "directional", "intensity": 3 },
        { "type": "spot", "intensity": 5, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "spot", "spot": { "innerConeAngle": 0.5, "outerConeAngle": 0.5 } }
    ] } },
    "cameras": [
        { "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } },
        { "type": "perspective", "name": "second", "perspective": { "yfov": 0.5, "aspectRatio": 2, "znear": 0.1 } },
        { "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 0.5, "zfar": 10, "znear": 0.1 } }
    ],
    "scenes": [{ "nodes": [0, 1, 2, 3, 4, 5, 6] }],
    "nodes": [
        { "name": "bulb", "translation": [1, 2, 3], "scale": [5, 5, 5], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        { "name": "sun", "rotation": [-0.70710677, 0, 0, 0.70710677], "extensions": { "KHR_lights_punctual": { "light": 1 } } },
        { "name": "spot", "translation": [0, 1, 0], "extensions": { "KHR_lights_punctual": { "light": 2 } } },
        { "name": "hard", "extensions": { "KHR_lights_punctual": { "light": 3 } } },
        { "name": "eye", "camera": 0, "translation": [0, 0, 9], "rotation": [0, 0.70710677, 0, 0.70710677] },
        { "name": "other", "camera": 1, "translation": [4, 5, 6] },
        { "name": "flat", "camera": 2 }
    ]"#;

#[test]
fn punctual_lights_are_lights() {
    let description = load_file(LIGHTS_AND_CAMERAS);
    let names: Vec<&str> = description.lights.iter().map(|l| &*l.name).collect();
    assert_eq!(names, ["bulb", "sun", "spot", "hard"]);
    let kinds: Vec<&LightKind> = description.lights.iter().map(|l| &l.kind).collect();
    let [
        LightKind::Point { position, intensity },
        LightKind::Directional(sun),
        LightKind::Spot(soft),
        LightKind::Spot(hard),
    ] = kinds[..]
    else {
        panic!("{kinds:?}");
    };
    assert_near(*position, [0.5, 1.0, -3.0]);
    assert_eq!(*intensity, Rgb::new(8.0, 4.0, 2.0));
    assert_near(sun.direction, [0.0, -1.0, 0.0]);
    assert_eq!(sun.irradiance, Rgb::splat(3.0));
    assert_near(soft.position, [-0.5, 0.0, -6.0]);
    assert_near(soft.frame.n, [0.0, 0.0, -1.0]);
    assert_eq!(soft.intensity, Rgb::splat(5.0));
    assert!((soft.cutoff - 0.5).abs() < 1e-6 && (soft.beam_width - 0.25).abs() < 1e-6);
    assert!((hard.cutoff - 0.5).abs() < 1e-6 && (hard.beam_width - 0.4995).abs() < 1e-6);

    let text = format!("{VIEW}{CAMERA}[[gltf]]\nfile = \"a.glb\"\nlights = false");
    let description = load(&text, &[("a.glb", file(LIGHTS_AND_CAMERAS))]).unwrap();
    assert!(description.lights.is_empty());
}

#[test]
fn cameras_are_found_by_name() {
    let with_camera = |camera: &str, rest: &str| {
        let text = format!("{VIEW}camera = {{ gltf = \"a.glb\"{camera} }}\n{rest}");
        load(&text, &[("a.glb", file(LIGHTS_AND_CAMERAS))])
    };
    let first = with_camera("", "").unwrap().camera;
    // It looks along -x; the field of view is vertical, for 12 x 8 pixels.
    assert_near(first.frame.n, [-1.0, 0.0, 0.0]);
    assert_near(first.frame.t, [0.0, 1.0, 0.0]);
    assert_near(first.frame.s, [0.0, 0.0, -1.0]);
    assert!((f64::from(first.half_width) - 1.5 * libm::tan(0.4)).abs() < 1e-6);
    for name in ["other", "second"] {
        let camera = format!(", gltf_camera = \"{name}\", aperture = 0.25, focus_distance = 3");
        let placed = "[[gltf]]\nfile = \"a.glb\"\ntransform = [{ rotate = { axis = [0, 1, 0], angle = 90 } }]";
        let description = with_camera(&camera, placed).unwrap();
        assert_near(description.camera.frame.n, [-1.0, 0.0, 0.0]);
        assert_eq!(description.camera.aperture, 0.25);
        assert!((f64::from(description.camera.half_width) - 1.5 * libm::tan(0.25)).abs() < 1e-6);
        // The bulb at (1, 2, 3) and the camera at (4, 5, 6), both turned to (z, y, -x).
        let LightKind::Point { position, .. } = description.lights[0].kind else {
            panic!();
        };
        assert_near(position, [-3.0, -3.0, 3.0]);
    }
    // As wide as twice its magnification.
    let flat = with_camera(", gltf_camera = \"flat\"", "").unwrap().camera;
    assert_eq!((flat.projection, flat.half_width), (Projection::Orthographic, 1.0));
    for (camera, expected) in [
        (
            ", gltf_camera = \"none\"",
            "a.glb: its scene has no camera \"none\"; it has \"eye\", \"other\", \"flat\"",
        ),
        (
            ", fov = 30",
            "scene.toml:3: camera.fov: the camera of a glTF file has its own `fov`",
        ),
    ] {
        assert_eq!(with_camera(camera, "").unwrap_err(), expected);
    }
    let text = format!("{VIEW}{}", CAMERA.replace(" }", ", gltf_camera = \"x\" }"));
    let error = load(&text, &[]).unwrap_err();
    assert!(
        error.contains("camera.gltf_camera: it names one of the cameras"),
        "{error}"
    );
}

/// A `.gltf` with separate files, and one that contains them.
#[test]
fn files_beside_the_file_are_in_the_bundle() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["scenes", "scenes/models", "scenes/data files"] {
        std::fs::create_dir(at(name)).unwrap();
    }
    let nodes = r#"
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 3 }] }]"#;
    let with_buffer = |uri: &str| {
        let buffer = format!("{{ \"byteLength\": 144, \"uri\": \"{uri}\" }}");
        json(&format!("{nodes},\n{SQUARE}")).replace("{ \"byteLength\": 144 }", &buffer)
    };
    std::fs::write(at("scenes/models/a.gltf"), with_buffer("../data%20files/a.bin")).unwrap();
    std::fs::write(at("scenes/data files/a.bin"), square()).unwrap();
    let scene = at("scenes/scene.toml");
    std::fs::write(&scene, format!("{VIEW}{CAMERA}[[gltf]]\nfile = \"models/a.gltf\"")).unwrap();
    let bundle = read_bundle(&scene).unwrap();
    let keys: Vec<&str> = bundle.files.keys().map(|key| &**key).collect();
    assert_eq!(keys, ["models/%2E%2E/data files/a.bin", "models/a.gltf", "scene.toml"]);
    let outside = beamfarm_scene::load(&bundle).unwrap();

    let text = with_buffer(&format!("data:application/octet-stream;base64,{}", base64(&square())));
    std::fs::write(at("scenes/models/a.gltf"), text).unwrap();
    let bundle = read_bundle(&scene).unwrap();
    assert_eq!(bundle.files.len(), 2);
    let inside = beamfarm_scene::load(&bundle).unwrap();
    assert_eq!(mesh(&inside.objects[0]).positions, mesh(&outside.objects[0]).positions);

    std::fs::write(at("scenes/models/a.gltf"), with_buffer("b.bin")).unwrap();
    let error = read_bundle(&scene).unwrap_err().to_string();
    assert!(
        error.contains("scene.toml:5: gltf[0].file: the file \"models/b.bin\": No such file"),
        "{error}"
    );
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    assert_eq!(bytes.len() % 3, 0);
    let digit = |n: u32| char::from(DIGITS[n as usize & 63]);
    bytes
        .chunks(3)
        .flat_map(|c| {
            let n = u32::from(c[0]) << 16 | u32::from(c[1]) << 8 | u32::from(c[2]);
            [digit(n >> 18), digit(n >> 12), digit(n >> 6), digit(n)]
        })
        .collect()
}

/// Invalid files: the error names the file and the place.
#[test]
fn bad_files_say_why() {
    let body = r#"
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "plate", "mesh": 0 }],
        "meshes": [{ "primitives": [{ @, "indices": 3 }] }]"#;
    let all =
        format!("{body},\n{SQUARE}").replace('@', r#""attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }"#);
    let plate = "a.glb: the node \"plate\": primitive 0 of its mesh: ";
    for (from, to, expected) in [
        (
            r#""componentType": 5121, "count": 6"#,
            r#""componentType": 5121, "count": 17"#,
            format!("{plate}the indices (accessor 3): 17 elements, 1 bytes apart, are claimed, but its view has 16"),
        ),
        (
            r#""componentType": 5126, "count": 4, "type": "VEC2""#,
            r#""componentType": 5126, "count": 4294967295, "type": "VEC2""#,
            format!("{plate}the texture coordinates (accessor 2): 4294967295 elements"),
        ),
        (
            r#""byteOffset": 96, "byteLength": 32"#,
            r#""byteOffset": 96, "byteLength": 3200000000"#,
            format!("{plate}buffer view 1 reaches beyond its buffer"),
        ),
        (
            r#""byteLength": 144"#,
            r#""byteLength": 1000000000000"#,
            "a.glb: buffer 0 has 144 bytes; 1000000000000 are claimed".into(),
        ),
        (
            r#""componentType": 5126, "count": 4, "type": "VEC2""#,
            r#""componentType": 5126, "count": 3, "type": "VEC2""#,
            format!("{plate}it has 4 positions and 3 texture coordinates"),
        ),
        (
            r#""bufferView": 1, "componentType": 5126, "count": 4"#,
            r#""componentType": 5126, "count": 2, "sparse": { "count": 3, "indices": { "bufferView": 2, "componentType": 5121 }, "values": { "bufferView": 1 } }"#,
            format!("{plate}the texture coordinates (accessor 2): a sparse index is 2, but there are 2 elements"),
        ),
        (
            r#""componentType": 5126, "count": 4, "type": "VEC2""#,
            r#""componentType": 5122, "count": 4, "type": "VEC3""#,
            format!("{plate}the texture coordinates (accessor 2) are Vec3 of I16, which is not supported"),
        ),
        (
            r#""byteOffset": 48, "componentType": 5126, "count": 4"#,
            r#""byteOffset": 9000000000, "componentType": 5126, "count": 4"#,
            format!("{plate}the normals (accessor 1): 4 elements"),
        ),
        (
            r#""scenes""#,
            r#""extensionsUsed": ["EXT_texture_avif"], "extensionsRequired": ["EXT_texture_avif"], "scenes""#,
            "a.glb: it says that it cannot do without EXT_texture_avif, which is not supported".into(),
        ),
        (
            r#""mesh": 0"#,
            r#""mesh": 7"#,
            "a.glb: not a usable glTF file: ".into(),
        ),
        (
            r#""POSITION": 0"#,
            r#""POSITION": 70"#,
            "a.glb: not a usable glTF file: mesh 0 (from zero) names accessor 70, but there are 5".into(),
        ),
        (
            r#""mesh": 0"#,
            r#""mesh": 0, "children": [0]"#,
            "a.glb: the node \"plate\" is in the scene more than once".into(),
        ),
        (
            r#""mesh": 0"#,
            r#""mesh": 0, "rotation": [0, 0, 0, 0]"#,
            "a.glb: the node \"plate\": its rotation is no quaternion of length 1".into(),
        ),
        (
            r#""mesh": 0"#,
            r#""mesh": 0, "scale": [1, 0, 0]"#,
            "a.glb: shapes[\"plate\"].transform: the shape's transform cannot be inverted".into(),
        ),
        (
            r#""mesh": 0"#,
            r#""mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1]"#,
            "a.glb: the node \"plate\": its matrix is not affine".into(),
        ),
        (
            r#""indices": 3"#,
            r#""indices": 3, "material": 0 }] }], "materials": [{ "name": "wood", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }], "textures": [{ "source": 0 }], "images": [{ "bufferView": 0, "mimeType": "image/png" }], "extras": [{ "a": [{ "#,
            "a.glb: the material \"wood\": image 0: unsupported kind of image; expected PNG, JPEG, WebP, BMP, KTX2, OpenEXR or Radiance HDR".into(),
        ),
    ] {
        assert!(all.contains(from), "{from}");
        let body = all.replacen(from, to, 1);
        let error = error_of(glb(&json(&body), &square()));
        assert!(error.starts_with(&expected), "{from} -> {to}: {error}");
    }
    let whole = file(body);
    for length in 0..whole.len() {
        error_of(whole[..length].to_vec());
    }
    for (from, to, expected) in [
        (
            "\"spot\": {",
            "\"none\": {",
            "invalid glTF: extensions.khrLightsPunctual.lights[2].spot: Missing data",
        ),
        (
            "\"perspective\": {",
            "\"none\": {",
            "invalid glTF: cameras[0]: Missing data",
        ),
        (
            "\"scenes\"",
            "\"images\": [{ \"bufferView\": 0 }], \"scenes\"",
            "image 0 (from zero) has no `mimeType`",
        ),
        (
            "\"scenes\"",
            "\"images\": [{}], \"scenes\"",
            "image 0 (from zero) has no `uri`",
        ),
    ] {
        let error = error_of(file(&LIGHTS_AND_CAMERAS.replacen(from, to, 1)));
        assert_eq!(error, format!("a.glb: not a usable glTF file: {expected}"));
    }
    for bytes in [
        b"{".to_vec(),
        "[".repeat(100_000).into_bytes(),
        format!("{{\"extras\":{}", "[".repeat(100_000)).into_bytes(),
    ] {
        let error = error_of(bytes);
        assert!(error.starts_with("a.glb: not a usable glTF file: "), "{error}");
    }
}
