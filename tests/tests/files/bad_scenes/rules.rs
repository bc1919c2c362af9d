//! Visibility rules that are not valid, and those that have no effect.

use super::{VIEW, error_of, refused};
use beamfarm_image::bundle::Bundle;

const THINGS: &str = r#"[[shapes]]
name = "floor"
type = "rectangle"
[[shapes]]
name = "ball"
type = "sphere"
material = "glass"
[[shapes]]
name = "lamp"
type = "disc"
emission = { radiance = 1 }
[[lights]]
name = "bulb"
type = "point"
position = [0, 2, 0]
power = 10
group = "practicals"
[materials.glass]
type = "dielectric"
ior = 1.5
[groups]
things = ["ball", "lamp"]
"#;

#[test]
fn rules_are_checked() {
    refused(
        r#"
[[rules]] | rays = ["shadow"]
    4: rules[0].rays: a rule has a list `exclude` or a list `include`
[[rules]] | rays = [] | exclude = ["all"]
    4: rules[0].rays: expected a type of ray
[[rules]] | rays = ["shade"] | exclude = ["all"]
    4: rules[0].rays[0]: unknown variant `shade`, expected one of `camera`, `reflected`, `refracted`, `shadow`, `photon`
[[rules]] | rays = ["shadow"] | include = []
    5: rules[0].include: expected a name; to hide everything, write exclude = ["all"]
[[rules]] | rays = ["shadow"] | exclude = ["all"] | include = ["all"]
    6: rules[0].include: a rule has `exclude` or `include`; write two rules
[[rules]] | rays = ["shadow"] | exclude = ["ball"]
    5: rules[0].exclude[0]: there is no shape, light or group "ball"; the scene defines none
[groups] | all = []
    4: groups.all: "all" is a rule's own word; choose another name
[groups] | things = ["stone"]
    4: groups.things[0]: there is no shape, light or group "stone"; the scene defines none
[[shapes]] | type = "sphere" | visible = ["shadows"]
    5: shapes[0].visible[0]: unknown variant `shadows`, expected one of `camera`, `reflected`, `refracted`, `shadow`, `photon`
[[shapes]] | type = "instances" | shape = { type = "cube", visible = [] } | transforms = []
    5: shapes[0].shape.visible: this field belongs to the instances, not to their shape
"#,
    );
}

/// The error of rules that stand on the lines from 1 before some objects.
fn error(rules: &str) -> String {
    let before = 1 + VIEW.lines().count() + THINGS.lines().count();
    let error = error_of(&format!("{VIEW}{THINGS}{rules}"), &[]);
    let line = error.line.map(|line| line + 1 - before);
    format!("{}: {}", line.unwrap_or(0), error.message)
}

#[test]
fn names_and_contradictions_are_refused() {
    assert_eq!(
        error("[[rules]]\non = [\"flor\"]\nrays = [\"shadow\"]\nexclude = [\"bulb\"]"),
        "2: rules[0].on[0]: there is no shape, light or group \"flor\"; the scene defines \"ball\", \"bulb\", \"floor\", \
         \"lamp\", \"practicals\", \"things\""
    );
    assert_eq!(
        error(
            "[[rules]]\nrays = [\"shadow\"]\nexclude = [\"things\"]\n\
             [[rules]]\non = [\"floor\"]\nrays = [\"photon\", \"shadow\"]\ninclude = [\"lamp\", \"floor\"]"
        ),
        "7: rules[1].include: one rule includes \"lamp\", another excludes it, for the same shadow rays"
    );
}

fn notes(rules: &str) -> Vec<String> {
    let text = format!("{VIEW}{THINGS}{rules}");
    let scene = "scene.toml".to_string();
    let files = [(scene.clone(), text.into_bytes())].into();
    match beamfarm_scene::load(&Bundle { scene, files }) {
        Ok(description) => description.notes,
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn rules_without_effect_are_noted() {
    let before = VIEW.lines().count() + THINGS.lines().count();
    for (rule, expected) in [
        ("rays = [\"shadow\"]\nexclude = [\"bulb\"]", None),
        (
            "on = [\"floor\"]\nrays = [\"photon\"]\nexclude = [\"practicals\"]",
            None,
        ),
        (
            "on = [\"floor\"]\nrays = [\"camera\"]\nexclude = [\"ball\"]",
            Some("3: rules[0].rays[0]: no camera rays start there: no effect on them; they start at the \"camera\""),
        ),
        (
            "on = [\"floor\"]\nrays = [\"shadow\", \"reflected\"]\nexclude = [\"ball\"]",
            Some("3: rules[0].rays[1]: no reflected rays start there: no effect on them"),
        ),
        (
            "on = [\"ball\"]\nrays = [\"shadow\"]\nexclude = [\"bulb\"]",
            Some("3: rules[0].rays[0]: no shadow rays start there: no effect on them"),
        ),
        (
            "on = [\"ball\"]\nrays = [\"photon\"]\nexclude = [\"bulb\"]",
            Some("3: rules[0].rays[0]: photons leave nothing there, whatever light they come from: no effect on them"),
        ),
        (
            "on = [\"camera\"]\nrays = [\"camera\"]\nexclude = [\"bulb\"]",
            Some(
                "3: rules[0].rays[0]: camera rays meet shapes and the environment, but no light of another kind: no effect on them",
            ),
        ),
        (
            "on = [\"floor\"]\nrays = [\"shadow\"]\nexclude = []",
            Some("4: rules[0].exclude: nothing is listed: this rule has no effect"),
        ),
        (
            "rays = [\"shadow\"]\nexclude = [\"things\"]\n[[rules]]\non = [\"floor\"]\nrays = [\"shadow\"]\nexclude = [\"ball\"]",
            Some("6: rules[1].rays[0]: an earlier rule says the same of shadow rays"),
        ),
    ] {
        let notes = notes(&format!("[[rules]]\n{rule}"));
        let expected = expected.map(|text: &str| {
            let (line, text) = text.split_once(':').unwrap();
            let line: usize = line.parse().unwrap();
            format!("scene.toml:{}:{text}", before + line)
        });
        assert_eq!(notes, expected.into_iter().collect::<Vec<_>>(), "{rule}");
    }
}

/// One medium in two objects with different photon rules.
#[test]
fn a_medium_has_one_set_of_rules() {
    let fog = "[media.fog]\ntype = \"homogeneous\"\nsigma_a = 0\nsigma_s = 1\n\
               [[shapes]]\nname = \"one\"\ntype = \"sphere\"\nmaterial = \"glass\"\ninterior = \"fog\"\n\
               [[shapes]]\nname = \"two\"\ntype = \"sphere\"\nmaterial = \"glass\"\ninterior = \"fog\"\ncenter = [4, 0, 0]\n";
    let rule = "[[rules]]\non = [\"two\"]\nrays = [\"photon\"]\nexclude = [\"bulb\"]";
    assert_eq!(
        error(&format!("{fog}{rule}")),
        format!(
            "{}: rules[0].exclude: photons in the medium \"fog\" cannot obey the rules of both \"one\" and \"two\", which it \
             fills; give each a medium of its own",
            fog.lines().count() + 4
        )
    );
    let both = rule.replace("[\"two\"]", "[\"one\", \"two\"]");
    assert!(notes(&format!("{fog}{both}")).is_empty());
}
