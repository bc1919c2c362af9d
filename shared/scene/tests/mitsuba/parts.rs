//! Parts of scenes that become others, or what the conversion makes of them.

use super::{assert_has, convert, folder, read, refused};
use beamfarm_render::world::geometry::Shape;
use beamfarm_scene::{ImportOptions, SceneFile};
use tempfile::TempDir;

/// The shares of parts within parts are what is left to them.
#[test]
fn mixtures_are_blends_of_blends() {
    let mixture = |weights: &str| {
        let parts = ["a", "b", "c"]
            .map(|id| format!(r#"<bsdf type="diffuse" id="{id}"/>"#))
            .concat();
        format!(r#"<bsdf type="mixturebsdf" id="m"><string name="weights" value="{weights}"/>{parts}</bsdf>"#)
    };
    let (text, _) = read("0.6.0", &mixture("0.2, 0.3, 0.5"));
    assert_has(
        &text,
        &[
            "[materials.mix]\ntype = \"blend\"\nmaterials = [\"a-part\", \"b-part\"]\nweight = 0.6",
            "[materials.m]\ntype = \"blend\"\nmaterials = [\"mix\", \"c-part\"]\nweight = 0.5",
        ],
    );
    // What is left reflects nothing, shares of nothing are no parts, and too much is made less.
    let (text, _) = read("0.6.0", &mixture("0.25 0 0.25"));
    assert_has(
        &text,
        &["materials = [\"mix\", \"black\"]\nweight = 0.5", "[materials.black]"],
    );
    assert!(!text.contains("b-part"), "{text}");
    let (text, notes) = read("0.6.0", &mixture("1 1 2"));
    assert_has(&text, &["materials = [\"mix\", \"c-part\"]\nweight = 0.5"]);
    assert_has(&notes, &["the weights add up to 4, and are made less"]);
    let (text, _) = read("0.6.0", &mixture("0 1 0"));
    assert_has(&text, &["[materials.m]\ntype = \"diffuse\""]);
    for weights in ["1 1", "-1 1 1", "0 0 0"] {
        assert_has(
            &refused("0.6.0", &mixture(weights)),
            &["expected 3 numbers that are not negative"],
        );
    }
}

#[test]
fn a_roughness_by_direction_may_be_a_checkerboard() {
    let squares = |name: &str, colors: [f64; 2], size: u32| {
        let [a, b] = colors;
        format!(
            r#"<texture name="{name}" type="checkerboard"><float name="color0" value="{a}"/><float name="color1" value="{b}"/>
            <transform name="to_uv"><scale x="{size}" y="{size}"/></transform></texture>"#
        )
    };
    let metal = |size: u32| {
        let [u, v] = [squares("alpha_u", [0.1, 0.2], 9), squares("alpha_v", [0.4, 0.05], size)];
        format!(r#"<bsdf type="roughconductor" id="m">{u}{v}</bsdf>"#)
    };
    let (text, notes) = read("3.0.0", &metal(9));
    // Mitsuba takes colours the other way round where it wants numbers.
    assert_has(
        &text,
        &[
            "alpha_u = { checkerboard = [0.2, 0.1], uv",
            "alpha_v = { checkerboard = [0.05, 0.4], uv",
        ],
    );
    assert_eq!(notes, "");
    let (text, _) = read("3.0.0", &metal(8));
    assert_has(&text, &["alpha_u = { checkerboard = [0.2, 0.1], uv"]);
    let aniso = squares("anisotropic", [0.1, 0.2], 9);
    let (text, notes) = read("3.0.0", &format!(r#"<bsdf type="principled" id="p">{aniso}</bsdf>"#));
    assert_has(&text, &["anisotropic = { checkerboard = [0.2, 0.1], uv"]);
    assert_eq!(notes, "");
}

fn vol(channels: i32, samples: &[f32]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    bytes.extend([1, 2, 1, 1, channels].map(i32::to_le_bytes).concat());
    bytes.extend([0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0].map(f32::to_le_bytes).concat());
    bytes.extend(samples.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
#[allow(clippy::unwrap_used)]
fn volumes_are_textures_where_they_are_of_one_colour() {
    let texture = |name: &str| {
        format!(
            r#"<bsdf type="diffuse"><texture type="volume" name="reflectance"><volume type="gridvolume" name="volume">
            <string name="filename" value="{name}"/></volume></texture></bsdf>"#
        )
    };
    let medium = r#"<shape type="sphere"><bsdf type="null"/><medium type="heterogeneous" name="interior">
        <volume name="sigma_t" type="gridvolume"><string name="filename" value="two.vol"/></volume></medium></shape>"#;
    let write = |folder: &TempDir| {
        std::fs::write(
            folder.path().join("one.vol"),
            vol(3, &[0.5, 0.25, 0.75, 0.5, 0.25, 0.75]),
        )
        .unwrap();
        std::fs::write(
            folder.path().join("two.vol"),
            vol(3, &[0.5, 0.25, 0.75, 0.5, 0.25, 0.5]),
        )
        .unwrap();
    };
    let one = folder("3.0.0", &texture("one.vol"));
    write(&one);
    let text = convert(one.path(), false).unwrap().text;
    assert_has(&text, &["reflectance = [0.5, 0.25, 0.75]"]);
    for (elements, words) in [
        (texture("two.vol"), "a grid of different colours is not supported"),
        (
            medium.to_string(),
            "a grid of extinctions that differ by colour is not supported",
        ),
    ] {
        let two = folder("3.0.0", &elements);
        write(&two);
        assert_has(&convert(two.path(), false).unwrap_err(), &[words]);
        let skipped = convert(two.path(), true).unwrap();
        assert_has(&skipped.left_out.join("\n"), &[words]);
    }
}

#[test]
#[allow(clippy::unwrap_used)]
fn skies_become_pictures() {
    let folder = folder(
        "3.0.0",
        r#"<emitter type="sunsky"><vector name="sun_direction" value="0, 1, 1"/></emitter>"#,
    );
    let imported = convert(folder.path(), false).unwrap();
    assert_has(&imported.text, &["type = \"environment\"\nimage = \"scene-sky.exr\""]);
    assert_eq!(imported.made.keys().collect::<Vec<_>>(), ["scene-sky.exr"]);
    // It need not be on the disk.
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    assert_eq!(file.made, ["scene-sky.exr"]);
    assert!(!file.load().unwrap().lights.is_empty());
    for (element, words) in [
        (
            r#"<vector name="sun_direction" value="0, 1, -1"/>"#,
            "below the horizon",
        ),
        (
            r#"<float name="turbidity" value="11"/>"#,
            "expected a number from 1 to 10, found 11",
        ),
        (r#"<float name="sky_scale" value="-1"/>"#, "not negative"),
    ] {
        assert_has(
            &refused("3.0.0", &format!(r#"<emitter type="sunsky">{element}</emitter>"#)),
            &[words],
        );
    }
}

#[test]
#[allow(clippy::unwrap_used)]
fn orthographic_sensors_see_as_much_as_their_transform_scales() {
    let xml = |scale: &str| {
        format!(
            r#"<scene version="3.0.0"><sensor type="orthographic"><transform name="to_world"><scale {scale}/>
            <lookat origin="1 2 3" target="1 2 4" up="0 1 0"/></transform></sensor></scene>"#
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, xml(r#"x="1.5" y="1.5""#)).unwrap();
    let text = convert(folder.path(), false).unwrap().text;
    assert_has(
        &text,
        &[
            "projection = \"orthographic\"\nview_width = 3.0",
            "origin = [1.0, 2.0, 3.0]",
        ],
    );
    SceneFile::read(&path, &ImportOptions::default())
        .unwrap()
        .load()
        .unwrap();
    std::fs::write(&path, xml(r#"x="1.5" y="3""#)).unwrap();
    assert_has(
        &convert(folder.path(), false).unwrap_err(),
        &["pixels that are not square"],
    );
}

#[test]
#[allow(clippy::unwrap_used)]
fn area_lights_have_textures() {
    let squares = r#"<shape type="rectangle"><emitter type="area"><texture type="checkerboard" name="radiance">
        <rgb name="color0" value="12 0 0"/><float name="color1" value="3"/></texture></emitter></shape>"#;
    let folder = folder("3.0.0", squares);
    let text = convert(folder.path(), false).unwrap().text;
    assert_has(
        &text,
        &["emission = { radiance = { checkerboard = [[12.0, 0.0, 0.0], 3.0] } }"],
    );
    let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
    file.load().unwrap();
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float color_0\nproperty float color_1\nproperty float color_2\nelement face 2\n\
    property list uchar int vertex_indices\nproperty float weight_0\nend_header\n\
    0 0 0 1 0 0\n1 0 0 0 1 0\n1 1 0 0 0 1\n0 1 0 0.5 0.5 0.5\n3 0 1 2 0.25\n3 0 2 3 0.75\n";

/// Of vertices as they are; of faces each has its own vertices.
#[test]
#[allow(clippy::unwrap_used)]
fn attributes_become_colours_of_a_copy() {
    let with = |name: &str, scale: f64| {
        let shape = format!(
            r#"<shape type="ply"><string name="filename" value="m.ply"/><bsdf type="diffuse">
            <texture type="mesh_attribute" name="reflectance"><string name="name" value="{name}"/>
            <float name="scale" value="{scale}"/></texture></bsdf></shape>"#
        );
        let folder = folder("3.0.0", &shape);
        std::fs::write(folder.path().join("m.ply"), PLY).unwrap();
        folder
    };
    for (name, scale, expected) in [
        (
            "vertex_color",
            1.0,
            vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.5]],
        ),
        ("face_weight", 0.5, [vec![[0.125; 3]; 3], vec![[0.375; 3]; 3]].concat()),
    ] {
        let folder = with(name, scale);
        let imported = convert(folder.path(), false).unwrap();
        assert_has(
            &imported.text,
            &["file = \"scene-mesh1.ply\"", "reflectance = { attribute = \"color\" }"],
        );
        let file = SceneFile::read(&folder.path().join("scene.xml"), &ImportOptions::default()).unwrap();
        let scene = file.load().unwrap();
        let Shape::Mesh { mesh, .. } = &scene.objects[0].shape else {
            panic!("{:?}", scene.objects[0].shape);
        };
        let colors: Vec<[f32; 3]> = mesh.colors.iter().map(|c| c.to_array()).collect();
        let expected: Vec<[f32; 3]> = expected;
        assert_eq!(colors, expected);
    }
    for (name, words) in [
        ("face_color", "expected one property or three, from color_0 on"),
        ("color", "begins with vertex_ or face_"),
    ] {
        let folder = with(name, 1.0);
        assert_has(&convert(folder.path(), false).unwrap_err(), &[words]);
        assert_has(&convert(folder.path(), true).unwrap().left_out.join("\n"), &[words]);
    }
}

/// A lens of 50 mm where nothing is said, by the diagonal; the angle along y or the smaller side becomes that along x.
#[test]
#[allow(clippy::unwrap_used)]
fn projectors_have_the_angle_of_their_pictures() {
    // 2 x 1 pixels of 24 bits: a header of 14 bytes, one of 40, and a row filled up to 8 bytes.
    let mut bmp = b"BM".to_vec();
    bmp.extend([62u32, 0, 54, 40, 2, 1].map(u32::to_le_bytes).concat());
    bmp.extend([1, 0, 24, 0]);
    bmp.extend([0; 24]);
    bmp.extend([255, 0, 0, 0, 0, 255, 0, 0]);
    let fov = |fields: &str| {
        let picture = r#"<texture name="irradiance" type="bitmap"><string name="filename" value="a.bmp"/></texture>"#;
        let folder = folder(
            "3.0.0",
            &format!(r#"<emitter type="projector">{picture}{fields}</emitter>"#),
        );
        std::fs::write(folder.path().join("a.bmp"), &bmp).unwrap();
        let text = convert(folder.path(), false).unwrap().text;
        let line = text
            .lines()
            .filter_map(|line| line.strip_prefix("fov = "))
            .next_back()
            .unwrap();
        line.parse::<f64>().unwrap()
    };
    let half = |degrees: f64| libm::tan(0.5 * degrees.to_radians());
    for (fields, expected) in [
        ("", f64::hypot(36.0, 24.0) / 100.0 / 1.25f64.sqrt()),
        (
            r#"<string name="focal_length" value="100mm"/>"#,
            f64::hypot(36.0, 24.0) / 200.0 / 1.25f64.sqrt(),
        ),
        (r#"<float name="fov" value="30"/>"#, half(30.0)),
        (
            r#"<float name="fov" value="30"/><string name="fov_axis" value="y"/>"#,
            2.0 * half(30.0),
        ),
        (
            r#"<float name="fov" value="30"/><string name="fov_axis" value="smaller"/>"#,
            2.0 * half(30.0),
        ),
        (
            r#"<float name="fov" value="30"/><string name="fov_axis" value="larger"/>"#,
            half(30.0),
        ),
    ] {
        let found = half(fov(fields));
        assert!((found / expected - 1.0).abs() < 1e-9, "{fields}: {found}, {expected}");
    }
}

/// In a group as outside of one: the pane, and the boundary of the medium at the same place.
#[test]
fn panes_in_groups_have_media_around_them() {
    let pane = r#"<shape type="sphere"><bsdf type="thindielectric"/>
        <medium name="interior" type="homogeneous" id="fog"/></shape>"#;
    let group = format!(
        r#"<shape type="shapegroup" id="g">{pane}</shape>
        <shape type="instance"><ref id="g"/></shape>
        <shape type="instance"><ref id="g"/><transform name="to_world"><translate x="3"/></transform></shape>"#
    );
    let (text, _) = read("3.0.0", &group);
    let shapes: Vec<&str> = text.split("[[shapes]]").skip(1).collect();
    assert_eq!(shapes.len(), 2, "{text}");
    for shape in &shapes {
        assert_has(shape, &["type = \"instances\"", "translate = [3.0, 0.0, 0.0]"]);
    }
    assert!(!shapes[0].contains("interior"), "{text}");
    assert_has(shapes[1], &["interior = \"fog\""]);
    assert_has(&text, &["type = \"thin_dielectric\"", "type = \"null\""]);
}

#[test]
fn sheets_scatter_to_both_sides() {
    let sheet = |more: &str| {
        format!(
            r#"<shape type="rectangle"><bsdf type="principledthin"><rgb name="base_color" value="0.5, 0.25, 0.125"/>
               <float name="roughness" value="0.25"/><float name="eta" value="1.33"/>{more}</bsdf></shape>"#
        )
    };
    let (text, _) = read("3.0.0", &sheet(r#"<float name="diff_trans" value="0.5"/>"#));
    assert_has(
        &text,
        &[
            "type = \"blend\"",
            "weight = 0.25",
            "type = \"translucent\"",
            "transmittance = [0.5, 0.25, 0.125]",
            "type = \"principled\"",
            "roughness = 0.25",
            "specular = 0.0",
            "two_sided = true",
        ],
    );
    let (text, _) = read("3.0.0", &sheet(""));
    assert_has(&text, &["type = \"principled\"", "specular = 0.0", "two_sided = true"]);
    assert!(!text.contains("translucent"), "{text}");
}

#[test]
fn what_a_picture_lacks_is_said() {
    let thin =
        r#"<shape type="sphere"><bsdf type="principledthin"><float name="spec_trans" value="1"/></bsdf></shape>"#;
    assert_has(
        &refused("3.0.0", thin),
        &["\"principledthin\" is not supported", "spec_trans", "grey and diffuse"],
    );
    let scene = folder("3.0.0", thin);
    let skipped = convert(scene.path(), true).unwrap();
    assert_has(&skipped.left_out.join("\n"), &["\"principledthin\" is not supported"]);
    let integrator =
        |depth| format!(r#"<integrator type="aov"><integrator type="path">{depth}</integrator></integrator>"#);
    let (_, notes) = read("3.0.0", &integrator(r#"<integer name="max_depth" value="4"/>"#));
    assert_has(&notes, &["the light that its max_depth of 4 leaves out is there"]);
    for endless in ["", r#"<integer name="max_depth" value="-1"/>"#] {
        let (_, notes) = read("3.0.0", &integrator(endless));
        assert!(!notes.contains("max_depth"), "{notes}");
    }
}
