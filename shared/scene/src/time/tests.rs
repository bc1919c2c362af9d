//! Tests of interpolation and of faulty keys.

use toml::de::DeTable;

use super::{Clock, Moving};

const VIEW: &str = "\
[image]
width = 8
height = 8
[animation]
frames = [1, 48]
shutter = [0, 0.5]
";

/// A field's value at a time, as TOML.
fn at(field: &str, time: f64) -> String {
    let text = format!("{VIEW}[world]\nvalue = {field}\n");
    let root = DeTable::parse(&text).unwrap();
    let clock = Clock::of(root.get_ref()).unwrap();
    let moving = Moving::of(root.get_ref(), &text, &clock, time).unwrap();
    let root = moving.put(root).unwrap();
    let table = toml::Table::try_from(toml::Value::from(deserialized(root))).unwrap();
    table["world"]["value"].to_string()
}

fn deserialized(root: toml::Spanned<DeTable<'_>>) -> toml::Table {
    serde::Deserialize::deserialize(toml::de::Deserializer::from(root)).unwrap()
}

fn number(field: &str, time: f64) -> f64 {
    at(field, time).parse().unwrap()
}

#[test]
fn numbers_and_lists_lie_between_their_keys() {
    let line = "{ keys = [[1, 2], [3, 6.0], [50, 6]] }";
    for (time, expected) in [(1.0, 2.0), (1.5, 3.0), (2.0, 4.0), (3.0, 6.0), (7.0, 6.0)] {
        assert_eq!(number(line, time), expected, "{time}");
    }
    let colour = "{ keys = [[1, [0, 1, 2]], [51, [50, 1, 2]]] }";
    assert_eq!(at(colour, 2.0), "[1.0, 1.0, 2.0]");
    let grey = "{ keys = [[1, 0], [3, [2, 4, 6]], [50, 0]] }";
    assert_eq!(at(grey, 2.0), "[1.0, 2.0, 3.0]");
    // Nested in another value.
    let inner = "{ a = [1, { keys = [[1, 0], [51, 50]] }], b = \"c\" }";
    assert_eq!(at(inner, 2.0), "{ a = [1, 1.0], b = \"c\" }");
    let step = "{ keys = [[1, \"a.ply\"], [3, \"b.ply\"]], interpolation = \"step\" }";
    let step = step.replace("]],", "], [50, \"c\"]],");
    assert_eq!(at(&step, 2.999), "\"a.ply\"");
    assert_eq!(at(&step, 3.0), "\"b.ply\"");
}

/// Two keys: 3 u^2 - 2 u^3. With more keys, the curve passes through all with continuous speed and no overshoot.
#[test]
fn smooth_ways_have_no_jumps() {
    let two = "{ keys = [[0, 0], [100, 1]], interpolation = \"smooth\" }";
    for time in [0.0f64, 12.5, 50.0, 99.0] {
        let u = time / 100.0;
        assert!((number(two, time) - u * u * (3.0 - 2.0 * u)).abs() < 1e-15);
    }
    let more = "{ keys = [[0, 0], [10, 1], [12, 5], [40, 5], [100, -3]], interpolation = \"smooth\" }";
    let value = |time| number(more, time);
    for (time, expected) in [(0.0, 0.0), (10.0, 1.0), (12.0, 5.0), (40.0, 5.0), (100.0, -3.0)] {
        assert_eq!(value(time), expected);
        let (h, eps) = (1e-5, 1e-3);
        let slopes = [(value(time) - value(time - h)) / h, (value(time + h) - value(time)) / h];
        assert!(
            (slopes[0] - slopes[1]).abs() < eps || time == 0.0 || time == 100.0,
            "{time}: {slopes:?}"
        );
    }
    for step in 0..=1000 {
        let (time, x) = (f64::from(step) / 10.0, value(f64::from(step) / 10.0));
        assert!((-3.0..=5.0).contains(&x), "{time}: {x}");
        if (12.0..=40.0).contains(&time) {
            assert_eq!(x, 5.0);
        }
    }
}

#[test]
fn rotations_are_rotations() {
    // Angles around one axis, over any number of turns.
    let spin =
        "{ rotate = { keys = [[0, { axis = [0, 1, 0], angle = 0 }], [100, { axis = [0, 1, 0], angle = 720 }]] } }";
    assert_eq!(at(spin, 25.0), "{ rotate = { angle = 180.0, axis = [0.0, 1.0, 0.0] } }");
    // Constant-speed rotation from one axis to another: from the identity, half of a third of a turn around [1, 1, 1].
    let keys = "[[0, [{ rotate = { axis = [1, 1, 1], angle = 0 } }]], [100, [{ rotate = { axis = [2, 2, 2], angle = 120 } }]]]";
    let text = at(&format!("{{ keys = {keys} }}"), 50.0);
    let steps: toml::Table = format!("steps = {text}").parse().unwrap();
    let turn = &steps["steps"][0]["rotate"];
    assert!((turn["angle"].as_float().unwrap() - 60.0).abs() < 1e-12, "{text}");
    for x in turn["axis"].as_array().unwrap() {
        assert!((x.as_float().unwrap() - 1.0 / 3f64.sqrt()).abs() < 1e-12, "{text}");
    }
}

/// A quarter turn with a scale of 2, halfway: an eighth turn with a scale of 1.5.
#[test]
fn matrices_are_turned_and_stretched() {
    for sign in [1.0, -1.0] {
        let to = [
            0.0,
            -2.0 * sign,
            0.0,
            10.0,
            2.0 * sign,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            2.0 * sign,
            4.0,
        ];
        let from = [sign, 0.0, 0.0, 0.0, 0.0, sign, 0.0, 0.0, 0.0, 0.0, sign, 0.0];
        let rows = |m: [f64; 12]| format!("[{:?}, {:?}, {:?}, [0, 0, 0, 1]]", &m[..4], &m[4..8], &m[8..]);
        let field = format!(
            "{{ keys = [[0, [{{ matrix = {} }}]], [100, [{{ matrix = {} }}]]] }}",
            rows(from),
            rows(to)
        );
        let text = at(&field, 50.0);
        let steps: toml::Table = format!("steps = {text}").parse().unwrap();
        let x = 1.5 * 0.5f64.sqrt() * sign;
        let expected = [x, -x, 0.0, 5.0, x, x, 0.0, 0.0, 0.0, 0.0, 1.5 * sign, 2.0];
        let rows = steps["steps"][0]["matrix"].as_array().unwrap();
        let found = rows[..3].iter().flat_map(|row| row.as_array().unwrap());
        for (found, expected) in found.zip(expected) {
            assert!((found.as_float().unwrap() - expected).abs() < 1e-12, "{text}");
        }
    }
}

/// Shapes are interpolated between the frames' files; everything else uses the nearest.
#[test]
fn sequences_have_the_files_of_their_time() {
    let of = |table: &str, time: f64| {
        let text = format!("{VIEW}{table}\n");
        let root = DeTable::parse(&text).unwrap();
        let clock = Clock::of(root.get_ref()).unwrap();
        let moving = Moving::of(root.get_ref(), &text, &clock, time).unwrap();
        let table = deserialized(moving.put(root).unwrap());
        table["shapes"][0].to_string()
    };
    let mesh = "[[shapes]]\nfile = \"a_##.ply\"";
    assert_eq!(of(mesh, 3.0), "{ file = \"a_03.ply\" }");
    let between = "{ file = \"a_03.ply\", toward = { file = \"a_04.ply\", weight = 0.25 } }";
    assert_eq!(of(mesh, 3.25), between);
}

/// Files of all frames that the exposure covers.
#[test]
fn files_of_an_exposure() {
    let times = |shutter: &str, fields: &str| {
        let view = VIEW.replace("shutter = [0, 0.5]", shutter);
        let text = format!("{view}[world]\n{fields}\n");
        let root = DeTable::parse(&text).unwrap();
        let clock = Clock::of(root.get_ref()).unwrap();
        let moving = Moving::of(root.get_ref(), &text, &clock, 0.0).unwrap();
        (moving.blurs(), moving.times_of_files(&clock))
    };
    let smoke = "file = \"smoke_##.vdb\"";
    assert_eq!(times("shutter = [0, 0.4]", smoke), (false, vec![1.0, 1.2, 1.4]));
    let (blurs, found) = times("shutter = [0, 2]", smoke);
    assert!(
        blurs && found.contains(&1.5) && found.contains(&2.5) && found.contains(&2.0),
        "{found:?}"
    );
    let still = "a = { keys = [[1, 5], [50, 5]] }";
    assert!(!times("shutter = [0, 2]", still).0);
    assert!(times("shutter = [0, 2]", "a = { keys = [[1, 5], [50, 6]] }").0);
    assert!(!times("shutter = [0, 0]", "a = { keys = [[1, 5], [50, 6]] }").0);
}
