//! Rough coats and principled surfaces: their rough lobe shows what rules for reflected rays allow, and their diffuse
//! lobe is lit as usual.

use super::{VIEW, different, same_means};

/// A panel, and a lamp above the picture.
const PANEL: &str = r#"
[materials.red]
type = "diffuse"
reflectance = [0.9, 0.2, 0.1]
[[shapes]]
name = "panel"
type = "rectangle"
material = "rough"
transform = [{ scale = 1.5 }, { translate = [0, 1, -0.5] }]
[[shapes]]
name = "lamp"
type = "disc"
emission = { radiance = 20 }
transform = [{ scale = 0.4 }, { look_at = { origin = [-1, 3, 3], target = [0, 0.5, 0.3] } }]
"#;

/// It is seen in the panel and throws no shadow.
const BALL: &str = r#"
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 0.7, 0.6]
radius = 0.5
material = "red"
visible = ["reflected", "photon"]
"#;

/// Gloss over black.
const GLOSS: [&str; 3] = [
    "type = \"rough_plastic\"\nalpha = 0.15\nior = 1.8\nreflectance = 0",
    "type = \"principled\"\nroughness = 0.4\nmetallic = 1\nbase_color = [0.9, 0.6, 0.3]",
    "type = \"principled\"\nroughness = 0.4\nspecular = 0.9\nbase_color = 0",
];
/// Coats over white or grey.
const COATS: [&str; 2] = [
    "type = \"rough_plastic\"\nalpha = 0.15\nior = 1.8\nreflectance = 0.6",
    "type = \"principled\"\nroughness = 0.4\nspecular = 0.9\nmetallic = 0.2\nbase_color = 0.6",
];

fn scene(material: &str) -> String {
    let view = VIEW.replace("passes = 4", "passes = 32");
    let view = view.replace("paths = 400", "paths = 4000\nradius = 0.06");
    format!("{view}[materials.rough]\n{material}\n{PANEL}")
}

const UNSEEN: &str = "[[rules]]\non = [\"panel\"]\nrays = [\"reflected\"]\nexclude = [\"ball\"]\n";

#[test]
fn gloss_over_black_shows_what_rules_leave_it() {
    for material in GLOSS {
        let without = scene(material);
        let with = format!("{without}{BALL}");
        different(&with, &without);
        same_means(&format!("{with}{UNSEEN}"), &without, 1e-5);
    }
}

/// A rule that hides nothing visible makes the renderer evaluate the lobes one by one.
#[test]
fn lobes_apart_are_the_whole() {
    let far = "[[shapes]]\nname = \"far\"\ntype = \"sphere\"\ncenter = [0, 0.7, -6]\nradius = 0.5\n\
               visible = [\"reflected\"]\n";
    for material in GLOSS.iter().chain(&COATS) {
        let plain = format!("{}{BALL}{far}", scene(material));
        let apart = UNSEEN.replace("\"ball\"", "\"far\"");
        same_means(&format!("{plain}{apart}"), &plain, 1e-3);
    }
}

/// A coat that reflects nothing: rules for reflected rays do not affect the light on the base.
#[test]
fn the_base_is_lit_by_what_gloss_does_not_show() {
    let without = scene(&format!("{}\nspecular_reflectance = 0", COATS[0]));
    let with = format!("{without}{BALL}");
    different(&with, &without);
    same_means(&format!("{with}{UNSEEN}"), &with, 1e-3);
}
