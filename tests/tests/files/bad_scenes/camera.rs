//! Windows, filters and principal points.

use super::{VIEW, error_of};

#[test]
fn windows_filters_and_principal_points_are_checked() {
    const FILTERS: &str = "\"box\", \"tent\", \"gaussian\", { type = \"tent\", radius = pixels } \
        or { type = \"gaussian\", stddev = pixels }";
    let no_window = "1: image.crop: expected at least one pixel, all of them within the image of 8 x 8";
    let image = "width = 8, height = 8";
    let fov = "fov = 40";
    for (after, given, expected) in [
        (image, "crop = { width = 9, height = 1 }", no_window.to_string()),
        (image, "crop = { x = 3, width = 6, height = 1 }", no_window.to_string()),
        (image, "crop = { y = 8, width = 8, height = 1 }", no_window.to_string()),
        (image, "crop = { width = 0, height = 1 }", no_window.to_string()),
        (
            image,
            "crop = { y = 4294967295, width = 1, height = 1 }",
            no_window.to_string(),
        ),
        (
            image,
            "crop = { width = 1 }",
            "1: image.crop: missing field `height`".to_string(),
        ),
        (
            image,
            "crop = { x = -1, width = 1, height = 1 }",
            "1: image.crop.x: invalid value: integer `-1`, expected a whole number".to_string(),
        ),
        (
            image,
            "filter = \"mitchell\"",
            format!("1: image.filter: expected {FILTERS}, found \"mitchell\""),
        ),
        (
            image,
            "filter = { type = \"tent\", stddev = 1 }",
            format!("1: image.filter: expected {FILTERS}"),
        ),
        (
            image,
            "filter = { type = \"gaussian\", stddev = 0 }",
            "1: image.filter.stddev: expected a number of pixels from 0.01 to 100, found 0.0".to_string(),
        ),
        (
            fov,
            "principal_point = [0, 0, 0]",
            "2: camera.principal_point: expected two numbers [x, y], found 3 numbers".to_string(),
        ),
        (
            fov,
            "principal_point = [0, nan]",
            "2: camera.principal_point[1]: expected a finite number, found NaN".to_string(),
        ),
        (
            fov,
            "principal_point = [1e20, 0]",
            "2: camera.principal_point: too far from the middle for single precision".to_string(),
        ),
        (
            fov,
            "flip_x = 1",
            "2: camera.flip_x: invalid type: integer `1`, expected true or false".to_string(),
        ),
    ] {
        let text = VIEW.replace(after, &format!("{after}, {given}"));
        let found = error_of(&text, &[]).to_string();
        assert_eq!(found, format!("scene.toml:{expected}"));
    }
}
