use crate::read_bundle;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::Shape;
use beamfarm_render::world::light::LightKind;
use std::path::Path;

const OBJ: &str = "mtllib lib/two.mtl\nv -1 -1 0\nv 0 -1 0\nv 1 -1 0\nv 1 1 0\nv 0 1 0\nv -1 1 0\nvt 0 0\nvt 1 1\n\
    usemtl red\nf 1/1 2/1 5/2 6/2\nusemtl dark green\nf 2/1 3/1 4/2 5/2\n";
const MTL: &str =
    "# by hand\nnewmtl unused\nmap_Kd none.png\nnewmtl red\nKd 0.8 0.1 0.1\nnewmtl dark green\nKd 0.1 0.8 0.1\n";

/// A one-pixel PNG: sRGB 255, 0, 128.
fn pixel(alpha: Option<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(if alpha.is_some() {
        png::ColorType::Rgba
    } else {
        png::ColorType::Rgb
    });
    let mut writer = encoder.write_header().unwrap();
    let data: Vec<u8> = [255, 0, 128].into_iter().chain(alpha).collect();
    writer.write_image_data(&data).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Load a scene of one shape and its files from a folder.
fn load(shape: &str, obj: &str, mtl: &str) -> Result<SceneDescription, String> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    std::fs::create_dir_all(folder.path().join("m/lib/tex")).unwrap();
    let text = format!(
        "image = {{ width = 8, height = 6 }}\ncamera = {{ origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }}\n\
         [materials.gold]\ntype = \"diffuse\"\nreflectance = [0.9, 0.7, 0.1]\n\
         [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n\
         [[shapes]]\nname = \"two\"\ntype = \"mesh\"\nfile = \"m/two.obj\"\n{shape}\n"
    );
    write("a.toml", text.as_bytes());
    write("m/two.obj", obj.as_bytes());
    write("m/lib/two.mtl", mtl.as_bytes());
    write("m/lib/tex/a b.png", &pixel(None));
    write("m/lib/tex/cut.png", &pixel(Some(0)));
    let path = folder.path().join("a.toml");
    let shown = |e: crate::SceneError| {
        let file = e.file.strip_prefix(folder.path()).unwrap_or(&e.file).to_owned();
        format!("{}:{}: {}", file.display(), e.line.unwrap_or(0), e.message)
    };
    let bundle = read_bundle(Path::new(&path)).map_err(shown)?;
    crate::load(&bundle).map_err(shown)
}

fn material(scene: &SceneDescription, object: usize) -> String {
    format!("{:?}", scene.materials[scene.objects[object].material as usize].kind)
}

fn names(scene: &SceneDescription) -> Vec<&str> {
    scene.objects.iter().map(|object| &object.name[..]).collect()
}

const UNUSED: &str = "newmtl unused\nmap_Kd none.png\n";

#[test]
fn each_material_is_an_object() {
    let mtl = MTL.replace(UNUSED, "");
    let scene = load("mtl = true", OBJ, &mtl).unwrap();
    assert_eq!(names(&scene), ["two[red]", "two[dark green]"]);
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
    for (object, color, left) in [(0, "0.8, 0.1, 0.1", -1.0), (1, "0.1, 0.8, 0.1", 0.0)] {
        let kind = material(&scene, object);
        assert!(kind.starts_with("Diffuse") && kind.contains(color), "{kind}");
        let Shape::Mesh { mesh, .. } = &scene.objects[object].shape else {
            panic!("no mesh");
        };
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (2, 4));
        let least = mesh.positions.iter().map(|p| p.x).fold(f32::MAX, f32::min);
        assert_eq!(least, left);
    }
    // Byte order marks before each text, and Windows paths.
    let other = format!("\u{feff}{}", OBJ.replace("lib/two.mtl", "lib\\two.mtl"));
    let scene = load("mtl = true", &other, &format!("\u{feff}{mtl}")).unwrap();
    assert_eq!(scene.objects.len(), 2);
}

/// One note, when the scene does not mention materials.
#[test]
fn materials_that_are_not_read_are_told_of() {
    let mtl = MTL.replace(UNUSED, "");
    let scene = load("", OBJ, &mtl).unwrap();
    assert_eq!(names(&scene), ["two"]);
    assert!(
        matches!(&scene.notes[..], [only] if only.contains("\"m/two.obj\"") && only.contains("`mtl = true`")),
        "{:?}",
        scene.notes
    );
    for told in ["mtl = false", "material = \"gold\"", "emission = { radiance = 1 }"] {
        assert!(load(told, OBJ, "").unwrap().notes.is_empty(), "{told}");
    }
    let plain = OBJ.replace("usemtl", "#");
    assert!(load("", &plain, "").unwrap().notes.is_empty());
}

/// Faces of an unknown material, or of none, take the shape's material.
#[test]
fn other_faces_have_the_material_of_the_shape() {
    let mtl = MTL.replace(UNUSED, "").replace("dark green", "other");
    for (shape, color) in [
        ("mtl = true", "0.5, 0.5, 0.5"),
        ("mtl = true\nmaterial = \"gold\"", "0.9, 0.7, 0.1"),
    ] {
        let scene = load(shape, OBJ, &mtl).unwrap();
        assert!(material(&scene, 1).contains(color), "{}", material(&scene, 1));
        assert!(
            matches!(&scene.notes[..], [only] if only.contains("lack the materials \"dark green\"")),
            "{:?}",
            scene.notes
        );
        let scene = load(shape, &OBJ.replace("usemtl red\n", ""), &MTL.replace(UNUSED, "")).unwrap();
        assert_eq!(names(&scene), ["two[]", "two[dark green]"]);
        assert!(scene.notes.is_empty() && material(&scene, 0).contains(color));
    }
}

#[test]
fn what_statements_become() {
    let green = "newmtl dark green\nKd 0.1 0.8 0.1\n";
    for (statements, expected) in [
        ("Kd 0.25", &["Diffuse", "0.25, 0.25, 0.25"][..]),
        ("Kd 0.2 0.3 0.4\nKs 1 1 1\nillum 1", &["Diffuse", "0.2, 0.3, 0.4"]),
        (
            "Kd 0.2 0.3 0.4\nKs 0.5 0.5 0.5\nNs 30",
            &["Principled", "0.2, 0.3, 0.4"],
        ),
        ("Kd 0 0 0\nKs 0.9 0.6 0.3\nillum 3", &["Principled", "0.9, 0.6, 0.3"]),
        ("Kd 0.2 0.3 0.4\nPr 0.3\nPm 1", &["Principled", "0.2, 0.3, 0.4"]),
        (
            "d 0.1\nNi 1.25\nTf 0.5 0.6 0.7\nillum 7",
            &["Dielectric", "1.25", "0.5, 0.6, 0.7"],
        ),
        ("Tr 0.9\nillum 6", &["Dielectric", "1.5", "1, 1, 1"]),
        // It is not glass where nothing is transmitted.
        ("Kd 0.3\nillum 7\nNi 1.5\nd 1", &["Diffuse", "0.3, 0.3, 0.3"]),
        (
            "Kd 0.9\nmap_Kd -clamp on -s 2 3 1 -o 0.5 tex\\a b.png",
            &["Image", "Clamp", "0.9"],
        ),
        ("map_Kd tex/a b.png", &["Diffuse", "Image", "Repeat"]),
    ] {
        // `open` is set, since the glass's mesh is not closed.
        let scene = load(
            "mtl = true\nopen = true",
            OBJ,
            &format!("newmtl red\n{statements}\n{green}"),
        )
        .unwrap();
        let kind = material(&scene, 0)
            .replace(".0,", ",")
            .replace(".0)", ")")
            .replace(".0]", "]");
        for part in expected {
            let close = part.replace("0.9", "0.899");
            assert!(
                kind.contains(part) || kind.contains(&close),
                "{statements}: {part} in {kind}"
            );
        }
        assert!(scene.notes.is_empty(), "{:?}", scene.notes);
    }
}

#[test]
fn opacity_bumps_and_light() {
    let green = "newmtl dark green\nKd 0.1 0.8 0.1\n";
    let of = |statements: &str| {
        // `open` is set, since the glass's mesh is not closed.
        let scene = load(
            "mtl = true\nopen = true",
            OBJ,
            &format!("newmtl red\n{statements}\n{green}"),
        )
        .unwrap();
        let index = scene.objects[0].material as usize;
        let (opacity, normals) = {
            let material = &scene.materials[index];
            (
                format!("{:?}", material.opacity),
                format!("{:?}", material.normal_perturbation),
            )
        };
        (scene, opacity, normals)
    };
    assert!(of("d 0.25\nTr 0.25").1.contains("0.25"));
    assert!(of("Tr 0.25").1.contains("0.75"));
    assert_eq!(of("d 1").1, "None");
    // The image's alpha if it has one, else its luminance.
    assert!(of("map_d tex/cut.png").1.contains("0.0, 0.0, 0.0"));
    assert!(of("map_d -imfchan r tex/cut.png").1.contains("1.0, 1.0, 1.0"));
    assert!(of("map_Bump -bm 0.1 tex/a b.png").2.contains("BumpMap"));
    assert!(of("norm tex/a b.png").2.contains("NormalMap"));
    let notes = |statements: &str| format!("{:?}", of(statements).0.notes);
    assert!(!notes("map_Kd -mm 0 1 -t 0 0 0 tex/a b.png").contains("map_Kd"));
    assert!(notes("map_Kd -mm 0.2 0.5 tex/a b.png").contains("map_Kd -mm does not count"));
    for (statements, bright) in [("Ke 3 2 1", "3, 2, 1"), ("Ke 2 2 2\nmap_Ke tex/a b.png", "2, 0")] {
        let (scene, ..) = of(statements);
        let light = scene.lights.iter().find_map(|light| match &light.kind {
            LightKind::Area {
                object: 0, radiance, ..
            } => Some(format!("{radiance:?}").replace(".0", "")),
            _ => None,
        });
        assert!(light.as_ref().is_some_and(|light| light.contains(bright)), "{light:?}");
    }
    let (scene, ..) = of("map_Ks tex/a b.png\ndisp x.png");
    assert!(
        scene.notes[0].contains("of the material \"red\" map_Ks, disp does not count"),
        "{:?}",
        scene.notes
    );
    assert_eq!(of("Ke 0 0 0").0.lights.len(), 1);
}

/// Faults name file and line, and are found before a farm gets anything.
#[test]
fn what_is_missing_or_wrong_is_told_by_file_and_line() {
    let plain = MTL.replace(UNUSED, "");
    for (shape, obj, mtl, expected) in [
        (
            "mtl = true",
            OBJ.replace("two.mtl", "no.mtl"),
            plain.clone(),
            "m/two.obj:1: the file \"m/lib/no.mtl\": No such",
        ),
        (
            "mtl = true",
            OBJ.to_owned(),
            MTL.to_owned(),
            "m/lib/two.mtl:3: the file \"m/lib/none.png\": No such",
        ),
        (
            "mtl = true",
            OBJ.to_owned(),
            plain.replace("0.8", "1.8"),
            "m/lib/two.mtl:3: Kd: expected numbers from 0 to 1",
        ),
        (
            "mtl = true",
            OBJ.to_owned(),
            plain.replace("0.8", "x"),
            "m/lib/two.mtl:3: Kd: expected three numbers",
        ),
        (
            "mtl = true",
            OBJ.to_owned(),
            plain.replace("Kd 0.8", "Ns -3 #"),
            "Ns: expected a number that is not negative",
        ),
        (
            "mtl = true",
            OBJ.to_owned(),
            plain.replace("Kd 0.8", "map_Kd -x 1 #"),
            "`-x` is no option of a map",
        ),
        (
            "mtl = true\nemission = { radiance = 1 }",
            OBJ.to_owned(),
            plain.clone(),
            "expected no `emission` beside it",
        ),
        (
            "mtl = true\ninterior = \"none\"",
            OBJ.to_owned(),
            plain.clone(),
            "none of its materials bounds a medium",
        ),
    ] {
        let error = load(shape, &obj, &mtl).map(|_| ()).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

/// Some editors put a byte order mark before a scene's text, too.
#[test]
fn scenes_may_begin_with_a_mark() {
    let text = "image = { width = 8, height = 6 }\ncamera = { origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }\n\
        [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n";
    let made = |text: &str| {
        let mut bundle = beamfarm_image::bundle::Bundle {
            scene: "a.toml".into(),
            ..Default::default()
        };
        bundle.files.insert("a.toml".into(), text.into());
        crate::load(&bundle).map_err(|e| (e.line, e.message))
    };
    assert_eq!(made(&format!("\u{feff}{text}")).unwrap().lights.len(), 1);
    let wrong = text.replace("power = 1", "power = -1");
    assert_eq!(
        made(&format!("\u{feff}{wrong}")).unwrap_err(),
        made(&wrong).unwrap_err()
    );
}
