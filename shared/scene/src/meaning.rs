//! What a scene file means, independent of its notation. Comments, white space, key order, the number of passes or
//! frames and the way the image is written do not change the render.

use std::fmt::Display;
use toml::{Table, Value};

/// Fields of `render` that no pixel depends on.
const LOOKS: [&str; 5] = ["passes", "exposure", "white_balance", "view", "empty_depth"];
/// Name of the scene file in canonical bundles.
pub const CANONICAL_NAME: &str = "scene.toml";
/// Integers up to here are exact as floats.
const EXACT: f64 = 9_007_199_254_740_992.0;
/// The most characters shown of a value.
const SHOWN: usize = 60;

/// The canonical form, equal for all files of the same meaning; `None` if the text is not TOML.
pub fn canonical(text: &str) -> Option<String> {
    toml::to_string(&table(text)?).ok()
}

/// The fields in which two scene files differ, with both values.
pub fn differences(there: &str, here: &str) -> Vec<String> {
    let mut found = Vec::new();
    if let (Some(there), Some(here)) = (table(there), table(here)) {
        compare("", Some(&Value::Table(there)), Some(&Value::Table(here)), &mut found);
    }
    found
}

fn table(text: &str) -> Option<Table> {
    let mut table: Table = toml::from_str(text).ok()?;
    if let Some(Value::Table(render)) = table.get_mut("render") {
        for name in LOOKS {
            render.remove(name);
        }
        if render.is_empty() {
            table.remove("render");
        }
    }
    if let Some(Value::Table(animation)) = table.get_mut("animation") {
        // The other frames do not affect this one.
        let frames = animation.remove("frames");
        let first = frames.and_then(|frames| frames.as_array()?.first().cloned());
        let first = first.unwrap_or(Value::Integer(1));
        animation.entry("frame").or_insert(first);
    }
    table.iter_mut().for_each(|(_, value)| simplify(value));
    Some(table)
}

/// 1.0 becomes 1, which is valid wherever a number is expected.
fn simplify(value: &mut Value) {
    match value {
        Value::Float(number) if number.fract() == 0.0 && number.abs() < EXACT && !is_negative_zero(*number) => {
            *value = Value::Integer(*number as i64);
        }
        Value::Array(items) => items.iter_mut().for_each(simplify),
        Value::Table(table) => table.iter_mut().for_each(|(_, value)| simplify(value)),
        _ => {}
    }
}

fn is_negative_zero(number: f64) -> bool {
    number == 0.0 && number.is_sign_negative()
}

fn compare(path: &str, there: Option<&Value>, here: Option<&Value>, found: &mut Vec<String>) {
    let below = |key: &dyn Display| match path {
        "" => key.to_string(),
        _ => format!("{path}.{key}"),
    };
    match (there, here) {
        (Some(there), Some(here)) if there == here => {}
        (Some(Value::Table(there)), Some(Value::Table(here))) => {
            let mut keys: Vec<&String> = there.keys().chain(here.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                compare(&below(key), there.get(key), here.get(key), found);
            }
        }
        (Some(Value::Array(there)), Some(Value::Array(here))) if are_tables(there) || are_tables(here) => {
            for i in 0..there.len().max(here.len()) {
                compare(&below(&i), there.get(i), here.get(i), found);
            }
        }
        _ => found.push(format!("{path} {} there, {} here", shown(there), shown(here))),
    }
}

fn are_tables(items: &[Value]) -> bool {
    items.iter().any(Value::is_table)
}

fn shown(value: Option<&Value>) -> String {
    let Some(value) = value else {
        return "none".to_owned();
    };
    let text = value.to_string().replace('\n', " ");
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "\
# A comment.
image = { width = 64, height = 48 }
[render]
passes = 8
exposure = 1
seed = 3
[camera]
fov = 40.0
target = [0, 0, -1.5]
[[lights]]
type = \"point\"
power = 10
[[lights]]
type = \"point\"
power = 20
";

    #[test]
    fn what_makes_no_other_picture_is_left_out() {
        let same = "\
[camera]
target = [ 0.0,0,
  -1.5 ] # elsewhere
fov = 40
[image]
height = 48
width = 64
[render]
seed = 3
exposure = 2.5
white_balance = 3000
view = \"agx\"
empty_depth = 1e10
[[lights]]
power = 10.0
type = 'point'
[[lights]]
type = \"point\"
power = 2e1
";
        let canonical = |text: &str| super::canonical(text).unwrap();
        assert_eq!(canonical(SCENE), canonical(same));
        assert_eq!(differences(SCENE, same), Vec::<String>::new());
        // The canonical form is a scene file itself, and its own canonical form.
        assert_eq!(canonical(&canonical(SCENE)), canonical(SCENE));
        for (before, after) in [("fov = 40.0", "fov = 40.5"), ("seed = 3", "seed = 4"), ("-1.5", "-0.0")] {
            assert_ne!(canonical(SCENE), canonical(&SCENE.replace(before, after)), "{after}");
        }
        let turned = SCENE
            .replace("= 10", "= 0")
            .replace("= 20", "= 10")
            .replace("= 0\n", "= 20\n");
        assert_ne!(canonical(SCENE), canonical(&turned), "the order of lists matters");
        assert_ne!(canonical("a = 0.0"), canonical("a = -0.0"));
    }

    #[test]
    fn of_an_animation_only_the_frame_matters() {
        let canonical = |animation: &str| super::canonical(&format!("{SCENE}[animation]\n{animation}")).unwrap();
        let first = canonical("frames = [3, 9]");
        for same in ["frames = [3, 90]", "frame = 3", "frames = [1, 9]\nframe = 3.0"] {
            assert_eq!(canonical(same), first, "{same}");
        }
        assert_ne!(canonical("frame = 4"), first);
        assert_eq!(super::canonical(&first).unwrap(), first);
        assert_eq!(canonical("shutter = [0, 1]"), canonical("frame = 1\nshutter = [0, 1]"));
    }

    #[test]
    fn differences_have_paths_and_values() {
        let other = SCENE
            .replace("fov = 40.0", "fov = 45")
            .replace("power = 20", "power = 20\nradius = 0.1")
            .replace("[0, 0, -1.5]", "[0, 1, -1.5]");
        let expected = [
            "camera.fov 40 there, 45 here",
            "camera.target [0, 0, -1.5] there, [0, 1, -1.5] here",
            "lights.1.radius none there, 0.1 here",
        ];
        assert_eq!(differences(SCENE, &other), expected);
        let fewer = &SCENE[..SCENE.rfind("[[lights]]").unwrap()];
        let said = differences(SCENE, fewer);
        assert!(said.len() == 1 && said[0].starts_with("lights.1 {"), "{said:?}");
    }
}
