use super::*;
use crate::exr::{decode_rgb, pixel_hash, read_rgb, read_standard_error};
use crate::job::ScheduleKind;
use crate::matte;
use crate::merge::{Node, TreeSum};
use exr::prelude::{ReadChannels, ReadLayers};
use std::collections::BTreeMap;

fn average() -> Average {
    let mut sum = TreeSum::new(7, 5).with_layers(2);
    for pass in 0..3u32 {
        let mut film = Film::new(7, 5);
        for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
            *value = 1.0 / (i as u32 * 7 + pass * 3 + 1) as f32;
        }
        let layers = vec![film.clone(), film.clone()];
        let leaf = Node::leaf(pass.into(), film).with_layers(layers);
        sum.insert(leaf).unwrap();
    }
    sum.average().unwrap()
}

fn meta() -> ImageMeta {
    ImageMeta {
        scene: SceneHash([0xab; 32]),
        scene_file: Some("fog/scene.toml".into()),
        maker: Maker::Passes(JobSettings {
            seed: u64::MAX,
            alpha: 2.0 / 3.0,
            schedule: ScheduleKind::Beam,
            budget: None,
            paths_per_pass: 1000,
            reference_paths: 500,
            techniques: Techniques::default(),
            engine: EngineKind::Cpu,
        }),
        render_seconds: 1.5,
        version: "0.1.0".into(),
        layers: vec![layer::Layer::Depth, layer::Layer::Normal],
        standard_error: true,
        drops_photons: false,
        names: Names::default(),
        empty_depth: None,
    }
}

#[test]
fn passes_of_another_engine_are_another_set_and_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let average = average();
    let Maker::Passes(settings) = meta().maker else {
        panic!("not of passes");
    };
    let by = |engine| ImageMeta {
        maker: Maker::Passes(JobSettings { engine, ..settings }),
        ..meta()
    };
    let sets = [EngineKind::Cpu, EngineKind::Gpu].map(|engine| {
        let path = folder.path().join(format!("{engine}.exr"));
        write_image(&path, &average, &by(engine)).unwrap();
        assert_eq!(MadeOf::read(&path).unwrap().engine, engine.identity());
        by(engine).pass_set(&JobSettings { engine, ..settings }, &average)
    });
    assert_ne!(sets[0], sets[1]);
}

#[test]
fn every_bit_survives() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    let average = average();
    write_image(&path, &average, &meta()).unwrap();
    let film = read_rgb(&path).unwrap();
    assert_eq!(pixel_hash(&film), pixel_hash(&average.beauty));
    let error = read_standard_error(&path).unwrap().unwrap();
    assert_eq!(pixel_hash(&error), pixel_hash(&average.standard_error));
    let without = ImageMeta {
        standard_error: false,
        ..meta()
    };
    let plain = folder.path().join("plain.exr");
    write_image(&plain, &average, &without).unwrap();
    assert_eq!(read_standard_error(&plain).unwrap(), None);

    let image = exr::image::read::read_first_flat_layer_from_file(&path).unwrap();
    let channels = &image.layer_data.channel_data.list;
    let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
    #[rustfmt::skip]
    let expected =
        ["B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z", "stderr.B", "stderr.G", "stderr.R"];
    assert_eq!(names, expected);
    let red: Vec<f32> = average.standard_error.pixels.iter().map(|pixel| pixel[0]).collect();
    assert_eq!(channels[9].sample_data, FlatSamples::F32(red));
    let depth = average.layers[0].pixels.iter();
    let depth = depth.map(|pixel| layer::distance(pixel).unwrap_or(f32::INFINITY));
    assert_eq!(channels[3].sample_data, FlatSamples::F32(depth.collect()));

    let attributes = &image.layer_data.attributes;
    assert_eq!(attributes.software_name, Some("beamfarm 0.1.0".into()));
    let Maker::Passes(settings) = meta().maker else {
        panic!("not of passes");
    };
    let pass_set = meta().pass_set(&settings, &average);
    assert_eq!(pass_set.len(), 64);
    let other = JobSettings { seed: 0, ..settings };
    assert_ne!(meta().pass_set(&other, &average), pass_set);
    let mut longer = average.clone();
    longer.passes += 1;
    assert_ne!(meta().pass_set(&settings, &longer), pass_set);
    let expected = [
        ("beamfarmAlpha", AttributeValue::F64(2.0 / 3.0)),
        (
            "beamfarmEngine",
            AttributeValue::Text(EngineKind::Cpu.identity().as_str().into()),
        ),
        ("beamfarmFirstPass", AttributeValue::Text("0".into())),
        ("beamfarmLastPass", AttributeValue::Text("2".into())),
        ("beamfarmPassSet", AttributeValue::Text(pass_set.as_str().into())),
        ("beamfarmPasses", AttributeValue::Text("3".into())),
        ("beamfarmPathsPerPass", AttributeValue::Text("1000".into())),
        ("beamfarmReferencePaths", AttributeValue::Text("500".into())),
        (
            "beamfarmRelativeError",
            AttributeValue::F64(average.relative_standard_error()),
        ),
        ("beamfarmRenderSeconds", AttributeValue::F64(1.5)),
        ("beamfarmScene", AttributeValue::Text("ab".repeat(32).as_str().into())),
        ("beamfarmSceneFile", AttributeValue::Text("fog/scene.toml".into())),
        ("beamfarmSchedule", AttributeValue::Text("beam".into())),
        ("beamfarmSeed", AttributeValue::Text("18446744073709551615".into())),
        ("beamfarmVersion", AttributeValue::Text("0.1.0".into())),
    ];
    assert_eq!(attributes.other.len(), expected.len());
    for (name, value) in expected {
        assert_eq!(attributes.other[&exr::prelude::Text::from(name)], value, "{name}");
    }
}

#[test]
fn reference_images_say_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    let settings = ReferenceSettings {
        seed: 7,
        max_depth: Some(12),
    };
    let meta = ImageMeta {
        maker: Maker::Reference(settings),
        ..meta()
    };
    write_image(&path, &average(), &meta).unwrap();
    let image = exr::image::read::read_first_flat_layer_from_file(&path).unwrap();
    let attributes = &image.layer_data.attributes.other;
    for (name, value) in [
        ("beamfarmSamples", "3"),
        ("beamfarmSeed", "7"),
        ("beamfarmMaxDepth", "12"),
    ] {
        let attribute = &attributes[&exr::prelude::Text::from(name)];
        assert_eq!(*attribute, AttributeValue::Text(value.into()), "{name}");
    }
    assert!(!attributes.contains_key(&exr::prelude::Text::from("beamfarmAlpha")));
    let says = |of_samples: bool, scene_file: Option<String>| Provenance { of_samples, scene_file };
    assert_eq!(Provenance::read(&path), Some(says(true, meta.scene_file.clone())));
    let meta = ImageMeta {
        scene_file: None,
        ..self::meta()
    };
    write_image(&path, &average(), &meta).unwrap();
    assert_eq!(Provenance::read(&path), Some(says(false, None)));
    assert_eq!(Provenance::read(&folder.path().join("none.exr")), None);
}

#[test]
fn biased_images_say_so() {
    let attributes = |drops_photons: bool| {
        let meta = ImageMeta {
            drops_photons,
            ..meta()
        };
        let bytes = encode_image(&average(), &meta).unwrap();
        let header = exr::meta::MetaData::read_from_buffered(&bytes[..], true).unwrap();
        header.headers[0].own_attributes.other.clone()
    };
    let name = exr::prelude::Text::from("beamfarmBiased");
    assert_eq!(attributes(false).get(&name), None);
    match &attributes(true)[&name] {
        AttributeValue::Text(text) => assert!(text.to_string().contains("\"reject\"")),
        other => panic!("{other:?}"),
    }
}

/// As compositors read them: pairs of id and coverage by rank, and the names of the ids.
#[test]
fn mattes_are_those_of_the_convention() {
    let names = Names {
        objects: ["ball", "wall \"b\"", "Würfel", "unseen"].map(String::from).to_vec(),
        materials: Vec::new(),
    };
    let [ball, wall, cube] = [0, 1, 2].map(|i| matte::id_of_name(&names.objects[i]));
    let mut sum = TreeSum::new(3, 1).with_layers(LayerCounts { films: 0, mattes: 1 });
    for (pass, ids) in [[ball, wall, 0], [wall, wall, 0], [wall, cube, 0], [cube, cube, ball]]
        .iter()
        .enumerate()
    {
        let leaf = Node::leaf(pass as u64, Film::new(3, 1));
        sum.insert(leaf.with_mattes(vec![matte::Matte::leaf(ids)])).unwrap();
    }
    let meta = ImageMeta {
        layers: vec![layer::Layer::Objects],
        standard_error: false,
        names,
        ..meta()
    };
    let bytes = encode_image(&sum.average().unwrap(), &meta).unwrap();
    assert!(encode_image(&sum.average().unwrap(), &meta).unwrap() == bytes);
    let reader = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels();
    let image = reader
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(&bytes))
        .unwrap();
    let channel = |name: &str| {
        let mut list = image.layer_data.channel_data.list.iter();
        let found = list.find(|channel| channel.name.to_string() == name).unwrap();
        found.sample_data.values_as_f32().collect::<Vec<f32>>()
    };
    let ids = |name: &str| channel(name).iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let first = if wall < cube { wall } else { cube };
    assert_eq!(ids("CryptoObject00.R"), [wall, first, ball]);
    assert_eq!(channel("CryptoObject00.G"), [0.5, 0.5, 0.25]);
    let second = if ball < cube { ball } else { cube };
    assert_eq!(
        ids("CryptoObject00.B"),
        [second, if first == wall { cube } else { wall }, 0]
    );
    assert_eq!(channel("CryptoObject00.A"), [0.25, 0.5, 0.0]);
    assert_eq!(channel("CryptoObject01.G"), [0.25, 0.0, 0.0]);
    assert_eq!(channel("CryptoObject02.A"), [0.0; 3]);
    let attributes = &image.layer_data.attributes.other;
    let says = |name: &str| match &attributes[&exr::prelude::Text::from(&*format!("cryptomatte/3ae39a5/{name}"))] {
        AttributeValue::Text(text) => text.to_string(),
        other => panic!("{other:?}"),
    };
    assert_eq!(says("name"), "CryptoObject");
    assert_eq!(
        (says("hash"), says("conversion")),
        ("MurmurHash3_32".into(), "uint32_to_float32".into())
    );
    let manifest = says("manifest");
    assert!(manifest.is_ascii(), "{manifest}");
    let manifest: BTreeMap<String, String> = serde_json::from_str(&manifest).unwrap();
    let id = |name: &str| u32::from_str_radix(&manifest[name], 16).unwrap();
    assert_eq!(
        (manifest.len(), id("ball"), id("Würfel"), id("wall \"b\"")),
        (3, ball, cube, wall)
    );
}

/// The `exr` crate keeps attributes in a hash map, whose order differs each time.
#[test]
fn equal_images_are_equal_files() {
    let first = encode_image(&average(), &meta()).unwrap();
    for _ in 0..20 {
        assert!(encode_image(&average(), &meta()).unwrap() == first);
    }
    let later = ImageMeta {
        render_seconds: 99.0,
        ..meta()
    };
    let second = encode_image(&average(), &later).unwrap();
    let differing = first.iter().zip(&second).filter(|(a, b)| a != b).count();
    assert!(first.len() == second.len() && differing <= 8);
}

#[test]
fn metadata_that_exr_cannot_hold_are_refused() {
    let odd = ImageMeta {
        version: "0.1.0 \u{3b2}".into(),
        ..meta()
    };
    let error = encode_image(&average(), &odd).unwrap_err();
    assert_eq!(
        error.to_string(),
        "cannot encode version: `0.1.0 β` is not 1 to 255 characters of ASCII"
    );
}

/// Damaged files give an image or an error.
#[test]
fn damaged_files_do_no_harm() {
    let bytes = encode_image(&average(), &meta()).unwrap();
    for len in 0..bytes.len() {
        let _ = decode_rgb(&bytes[..len]);
    }
    for i in 0..bytes.len() {
        for value in [0, 1, 0x7f, 0xff] {
            let mut damaged = bytes.clone();
            damaged[i] = value;
            let _ = decode_rgb(&damaged);
        }
    }
}
