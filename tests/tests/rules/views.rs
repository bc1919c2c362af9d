//! Camera, reflected, refracted and shadow rays, and photons on surfaces.

use super::{VIEW, different, same_bits, same_means};
use beamfarm_harness::render::scene;

/// Glass, a mirror, fog in a box, an area light, a spot, a sky: every kind of ray. The object that some tests remove
/// comes last.
const EVERYTHING: &str = r#"
[media.fog]
type = "homogeneous"
sigma_a = 0.05
sigma_s = 0.4
phase = { type = "hg", g = 0.4 }
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.silver]
type = "mirror"
[materials.boundary]
type = "null"
[materials.red]
type = "diffuse"
reflectance = [0.7, 0.1, 0.1]
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "wall"
type = "rectangle"
material = "red"
transform = [{ scale = 4 }, { translate = [0, 2, -2] }]
[[shapes]]
name = "mirror"
type = "rectangle"
material = "silver"
transform = [{ scale = 0.6 }, { rotate = { axis = [0, 1, 0], angle = 30 } }, { translate = [-1.2, 0.7, -1] }]
[[shapes]]
name = "glass"
type = "sphere"
center = [0.9, 0.5, 0.6]
radius = 0.4
material = "glass"
[[shapes]]
name = "box"
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = [0.6, 0.6, 0.4] }, { translate = [0, 0.7, -0.3] }]
[[shapes]]
name = "lamp"
type = "disc"
emission = { radiance = 4 }
transform = [{ scale = 0.4 }, { look_at = { origin = [-2, 3, 1], target = [0, 0, 0] } }]
[[lights]]
name = "spot"
type = "spot"
position = [1.5, 3, 2]
target = [0.6, 0, 0]
intensity = [6, 8, 10]
cutoff_angle = 30
[[lights]]
name = "sky"
type = "environment"
radiance = [0.1, 0.12, 0.2]
"#;

const BALL: &str = r#"
[[shapes]]
name = "ball"
type = "sphere"
center = [0.1, 0.4, 1.2]
radius = 0.35
"#;

#[test]
fn what_no_ray_sees_is_not_there() {
    let without = format!("{VIEW}{EVERYTHING}");
    let with = format!("{without}{BALL}");
    different(&with, &without);
    same_bits(&format!("{with}visible = []"), &without);
    let all = "rays = [\"camera\", \"reflected\", \"refracted\", \"shadow\", \"photon\"]";
    same_bits(&format!("{with}[[rules]]\n{all}\nexclude = [\"ball\"]"), &without);
    let others = "\"floor\", \"wall\", \"mirror\", \"glass\", \"box\", \"lamp\"";
    same_bits(
        &format!(
            "{with}[groups]\nothers = [{others}]\n[[rules]]\non = [\"all\"]\n{all}\ninclude = [\"others\", \"spot\", \"sky\"]"
        ),
        &without,
    );
}

#[test]
fn rules_that_say_nothing_change_nothing() {
    let plain = format!("{VIEW}{EVERYTHING}{BALL}");
    for rule in [
        "rays = [\"shadow\"]\nexclude = []",
        "on = [\"ball\"]\nrays = [\"photon\", \"camera\"]\nexclude = []",
        "rays = [\"camera\", \"reflected\", \"refracted\", \"shadow\", \"photon\"]\ninclude = [\"all\"]",
        "except = [\"all\"]\nrays = [\"shadow\"]\nexclude = [\"all\"]",
    ] {
        let ruled = format!("{plain}[[rules]]\n{rule}");
        assert!(scene(&ruled).description().rules.is_none());
        same_bits(&ruled, &plain);
    }
}

/// A shining wall with a black ball between it and the camera.
const BACKDROP: &str = r#"
[materials.black]
type = "diffuse"
reflectance = 0
[materials.silver]
type = "mirror"
[materials.pane]
type = "thin_dielectric"
ior = 1.5
[[shapes]]
name = "wall"
type = "rectangle"
emission = { radiance = [1, 2, 3] }
transform = [{ scale = 8 }, { translate = [0, 0, -9] }]
[[shapes]]
name = "behind"
type = "rectangle"
emission = { radiance = [3, 1, 0.5] }
transform = [{ scale = 8 }, { rotate = { axis = [0, 1, 0], angle = 180 } }, { translate = [0, 0, 9] }]
"#;

const BLACK_BALL: &str = r#"
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 0.7, 2]
radius = 0.5
material = "black"
"#;

#[test]
fn the_camera_sees_what_rules_leave_it() {
    let without = format!("{VIEW}{BACKDROP}");
    let with = format!("{without}{BLACK_BALL}");
    different(&with, &without);
    let rule = |list: &str| format!("{with}[[rules]]\nrays = [\"camera\"]\n{list}");
    same_bits(&rule("exclude = [\"ball\"]"), &without);
    same_bits(&rule("on = [\"camera\"]\nexclude = [\"ball\"]"), &without);
    same_bits(&rule("include = [\"wall\"]"), &without);
    // The sky, which is a light.
    let sky = "[[lights]]\nname = \"sky\"\ntype = \"environment\"\nradiance = 1\n";
    let ball = format!("{VIEW}{BLACK_BALL}[materials.black]\ntype = \"diffuse\"\n{sky}");
    let lit = "[[shapes]]\nname = \"lit\"\ntype = \"sphere\"\ncenter = [0, 0.7, 0]\n";
    let sees = scene(&format!(
        "{ball}{lit}[[rules]]\nrays = [\"camera\"]\nexclude = [\"sky\"]"
    ));
    let seen = super::pixels(&sees);
    assert_eq!(seen[0], [0.0; 3]);
    assert!(seen.iter().any(|p| p[0] > 0.3), "lit by what is not seen");
}

#[test]
fn skies_add_up_by_what_rays_see_them() {
    let lit = "[[shapes]]\nname = \"lit\"\ntype = \"sphere\"\ncenter = [0, 0.7, 0]\n";
    let sky = |radiance: &str, rays: &str| {
        format!("[[lights]]\ntype = \"environment\"\nradiance = {radiance}\nvisible = [{rays}]\n")
    };
    let all = "\"camera\", \"reflected\", \"refracted\", \"shadow\", \"photon\"";
    let others = all.trim_start_matches("\"camera\", ");
    let alone = format!("{VIEW}{lit}{}", sky("[0.2, 0.6, 1]", all));
    let parts = [sky("[0.2, 0, 0.7]", all), sky("[0, 0.6, 0.3]", all)].concat();
    super::same_means(&format!("{VIEW}{lit}{parts}"), &alone, 0.0);
    // The camera's sky does not light the scene.
    let two = [sky("[5, 6, 7]", "\"camera\""), sky("[0.2, 0.6, 1]", others)].concat();
    let two = super::pixels(&scene(&format!("{VIEW}{lit}{two}")));
    let one = super::pixels(&scene(&alone));
    assert!(two[..4].iter().all(|p| *p == [5.0, 6.0, 7.0]), "behind the ball");
    let middle = 8 * 24 + 12;
    for (seen, lit) in two[middle].iter().zip(one[middle]) {
        assert!((seen / lit - 1.0).abs() < 0.2, "{seen} beside {lit}");
    }
}

#[test]
fn glass_gathers_no_light_that_photons_do_not_see() {
    let room = "[materials.glass]\ntype = \"dielectric\"\nior = 1.5\n[[shapes]]\ntype = \"sphere\"\ncenter = [0, 0.5, 0]\n\
                radius = 0.4\nmaterial = \"glass\"\n[[shapes]]\ntype = \"rectangle\"\n\
                transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 4 }]\n";
    let lit = format!("{VIEW}{room}[[lights]]\nname = \"sky\"\ntype = \"environment\"\nradiance = 1\n")
        .replace("caustics = \"photons\"", "caustics = \"paths\"");
    let sky = |rays: &str| super::pixels(&scene(&format!("{lit}visible = [{rays}]\n")));
    let floor = 11 * 24..16 * 24;
    let is_lit = |seen: &[[f32; 3]]| seen[floor.clone()].iter().any(|p| p[0] > 0.0);
    assert!(is_lit(&sky("\"photon\"")), "by way of the glass");
    assert!(!is_lit(&sky("\"camera\"")), "by what only the camera sees");
}

#[test]
fn mirrors_show_what_rules_leave_them() {
    let mirror = "[[shapes]]\nname = \"mirror\"\ntype = \"rectangle\"\nmaterial = \"silver\"\n\
                  transform = [{ scale = 3 }, { translate = [0, 0.7, 0] }]\n";
    let without = format!("{VIEW}{BACKDROP}{mirror}");
    let with = format!("{without}{BLACK_BALL}");
    let unseen = "[[rules]]\nrays = [\"camera\"]\nexclude = [\"ball\"]\n";
    different(&format!("{with}{unseen}"), &without);
    for rule in [
        "on = [\"mirror\"]\nexclude = [\"ball\"]",
        "exclude = [\"ball\"]",
        "on = [\"mirror\"]\ninclude = [\"behind\"]",
    ] {
        let rule = format!("[[rules]]\nrays = [\"reflected\"]\n{rule}\n");
        same_bits(&format!("{with}{unseen}{rule}"), &without);
        different(&format!("{with}{rule}"), &without);
    }
    let dark = format!("{with}[[rules]]\nrays = [\"reflected\"]\nexclude = [\"behind\"]\n");
    let image = super::pixels(&scene(&dark));
    assert!(image.iter().all(|p| *p == [0.0; 3]), "what shines is hidden");
}

#[test]
fn panes_show_what_rules_leave_them() {
    let pane = "[[shapes]]\nname = \"pane\"\ntype = \"rectangle\"\nmaterial = \"pane\"\n\
                transform = [{ scale = 3 }, { translate = [0, 0.7, 3] }]\n";
    let without = format!("{VIEW}{BACKDROP}{pane}");
    let with = format!("{without}{BLACK_BALL}");
    different(&with, &without);
    for rule in [
        "on = [\"pane\"]\nexclude = [\"ball\"]",
        "on = [\"pane\"]\ninclude = [\"wall\"]",
    ] {
        let rule = format!("[[rules]]\nrays = [\"refracted\"]\n{rule}\n");
        same_bits(&format!("{with}{rule}"), &without);
    }
    let reflected = "[[rules]]\nrays = [\"reflected\"]\nexclude = [\"ball\"]\n";
    same_bits(&format!("{with}{reflected}"), &with);
}

/// A floor that no other object lights, and two lamps that a ray may meet.
const LAMPS: &str = r#"
[materials.black]
type = "diffuse"
reflectance = 0
[materials.satin]
type = "rough_conductor"
alpha = 0.3
preset = "silver"
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "satin"
type = "rectangle"
material = "satin"
transform = [{ scale = 0.8 }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [0, 0.01, 1] }]
[[shapes]]
name = "one"
type = "sphere"
center = [-1, 3.5, 1]
radius = 0.5
emission = { radiance = [4, 3, 2] }
"#;
const OTHER_LAMP: &str = r#"
[[shapes]]
name = "two"
type = "disc"
emission = { radiance = [2, 3, 5], group = "twos" }
transform = [{ scale = 0.7 }, { look_at = { origin = [2, 3, 0], target = [0, 0, 1] } }]
[[lights]]
name = "three"
type = "point"
position = [0, 2.5, 3]
intensity = [1, 5, 1]
"#;

#[test]
fn shadow_rays_see_the_lights_that_rules_leave_them() {
    // Lamps above the picture: only their light is seen, and no other light reaches the floor.
    let one = format!("{VIEW}{LAMPS}").replace("passes = 4", "passes = 64");
    let both = format!("{one}{OTHER_LAMP}");
    different(&both, &one);
    for rule in [
        "exclude = [\"two\", \"three\"]",
        "include = [\"one\"]",
        "exclude = [\"twos\", \"three\"]",
        "on = [\"floor\", \"satin\"]\ninclude = [\"one\"]",
    ] {
        // Two and three still shine: their photons stand for what gather rays would find on other surfaces, of which
        // there are none.
        let rule = format!("[[rules]]\nrays = [\"shadow\"]\n{rule}\n");
        same_means(&format!("{both}{rule}"), &one, 1e-5);
    }
    // Linked one by one: the satin to one lamp, the floor to the others.
    let linked = format!(
        "{both}[[rules]]\nrays = [\"shadow\"]\non = [\"floor\"]\nexclude = [\"one\"]\n\
         [[rules]]\nrays = [\"shadow\"]\non = [\"satin\"]\ninclude = [\"one\"]\n"
    );
    let floor_black = "name = \"floor\"\ntype";
    let satin_black = "material = \"satin\"";
    let by_hand = [
        linked.replace(floor_black, "name = \"floor\"\nmaterial = \"black\"\ntype"),
        one.replace(floor_black, "name = \"floor\"\nmaterial = \"black\"\ntype"),
    ];
    same_means(&by_hand[0], &by_hand[1], 1e-5);
    let others = both.replace("emission = { radiance = [4, 3, 2] }", "emission = { radiance = 0 }");
    same_means(
        &linked.replace(satin_black, "material = \"black\""),
        &others.replace(satin_black, "material = \"black\""),
        1e-5,
    );
}

/// As long as it lights nothing, its photons are not even emitted.
#[test]
fn a_light_that_lights_nothing_is_no_light() {
    let without = format!("{VIEW}{EVERYTHING}");
    let light = "[[lights]]\nname = \"off\"\ntype = \"point\"\nposition = [0, 2, 1]\nintensity = 50\n";
    let with = format!("{without}{light}");
    different(&with, &without);
    same_bits(&format!("{with}visible = []\n"), &without);
    let rule = "[[rules]]\nrays = [\"shadow\", \"photon\"]\nexclude = [\"off\"]\n";
    same_bits(&format!("{with}{rule}"), &without);
    let by_group = "group = \"unused\"\n[[rules]]\nrays = [\"shadow\", \"photon\"]\nexclude = [\"unused\"]\n";
    same_bits(&format!("{with}{by_group}"), &without);
}

#[test]
fn shadow_rays_pass_what_rules_hide() {
    let without = format!("{VIEW}{LAMPS}{OTHER_LAMP}").replace("passes = 4", "passes = 32");
    let with = format!("{without}{BLACK_BALL}[[rules]]\nrays = [\"camera\"]\nexclude = [\"ball\"]\n");
    different(&with, &without);
    for rule in [
        "exclude = [\"ball\"]",
        "on = [\"floor\", \"satin\"]\nexclude = [\"ball\"]",
        "include = [\"one\", \"two\", \"three\", \"floor\"]",
    ] {
        let rule = format!("[[rules]]\nrays = [\"shadow\"]\n{rule}\n");
        same_means(&format!("{with}{rule}"), &without, 1e-5);
    }
}

/// A lamp above glass: a caustic on the floor.
const CAUSTIC: &str = r#"
[materials.black]
type = "diffuse"
reflectance = 0
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[lights]]
name = "lamp"
type = "spot"
position = [0.5, 4, 0.5]
target = [0, 0.6, 1]
intensity = 20
cutoff_angle = 25
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 0.7, 1]
radius = 0.5
"#;

#[test]
fn photons_leave_nothing_where_rules_keep_them_off() {
    let glass = format!("{VIEW}{CAUSTIC}material = \"glass\"\nvisible = [\"shadow\", \"photon\"]\n");
    let black = format!("{VIEW}{CAUSTIC}material = \"black\"\nvisible = [\"shadow\", \"photon\"]\n");
    different(&glass, &black);
    let rule = |rule: &str| format!("{glass}[[rules]]\nrays = [\"photon\"]\n{rule}\n");
    same_bits(&rule("on = [\"floor\"]\nexclude = [\"lamp\"]"), &black);
    // Photons of no other light: the same bits, as there is no other.
    same_bits(&rule("on = [\"floor\"]\ninclude = [\"lamp\"]"), &glass);
}

#[test]
fn photons_pass_what_rules_hide() {
    let without = format!("{VIEW}{}", CAUSTIC.split("[[shapes]]\nname = \"ball\"").next().unwrap());
    let glass = format!("{VIEW}{CAUSTIC}material = \"glass\"\nvisible = [\"photon\"]\n");
    different(&glass, &without);
    let rule = |rule: &str| format!("{glass}[[rules]]\nrays = [\"photon\"]\n{rule}\n");
    // Direct light passes what shadow rays do not see; the caustic comes on top unless photons pass as well.
    for on in ["on = [\"lamp\", \"floor\"]", "on = [\"all\"]"] {
        same_bits(&rule(&format!("{on}\nexclude = [\"ball\"]")), &without);
        same_bits(&rule(&format!("{on}\ninclude = [\"floor\"]")), &without);
    }
}
