//! Whole scenes against native ones written by hand: equal pixels.

use super::*;
use beamfarm_harness::render::plan_of;
use beamfarm_image::exr::pixel_hash;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::world::Scene;

fn pixels(description: SceneDescription) -> String {
    let scene = Scene::new(description);
    let plan = plan_of(&scene);
    pixel_hash(&render_pass(&scene, &plan, 0).expect("a pass").film).to_string()
}

pub const XML: &str = r#"<scene version="3.0.0">
<default name="paths" value="8"/>
<integrator type="volpath"/>
<sensor type="thinlens"><string name="fov_axis" value="y"/><float name="fov" value="35"/>
<float name="aperture_radius" value="0.05"/><float name="focus_distance" value="3.5"/>
<transform name="to_world"><lookat origin="0, 1, 3.6" target="0, 0.9, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/><rfilter type="box"/></film>
<sampler type="independent"><integer name="sample_count" value="$paths"/></sampler></sensor>
<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.5, 0.75, 1"/><float name="scale" value="0.5"/><float name="albedo" value="0.5"/>
<phase type="hg"><float name="g" value="0.5"/></phase></medium>
<shape type="cube"><transform name="to_world"><scale x="1.25" y="0.96875" z="1.25"/><translate y="1"/></transform>
<bsdf type="null"/><ref name="interior" id="fog"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="2.5"/><rotate x="1" angle="-90"/></transform>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.25 0.75"/></bsdf></bsdf></shape>
<shape type="sphere"><point name="center" x="-0.4" y="0.5" z="0"/><float name="radius" value="0.3"/>
<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf><ref name="exterior" id="fog"/></shape>
<shape type="disk"><transform name="to_world"><rotate y="1" angle="180"/><translate z="1.5"/></transform>
<emitter type="area"><rgb name="radiance" value="1 2 3"/></emitter></shape>
<emitter type="spot"><transform name="to_world"><lookat origin="0.5 1.9 0.25" target="0 0 0" up="1 0 0"/></transform>
<rgb name="intensity" value="8 6 4"/><float name="cutoff_angle" value="25"/></emitter>
<emitter type="constant"><float name="radiance" value="0.125"/></emitter>
</scene>"#;

const TOML: &str = r#"
[image]
width = 24
height = 16
[render]
passes = 8
[camera]
origin = [0, 1, 3.6]
target = [0, 0.9, 0]
fov = 35
fov_axis = "y"
aperture = 0.05
focus_distance = 3.5
[media.fog]
type = "homogeneous"
sigma_t = [0.25, 0.375, 0.5]
albedo = 0.5
phase = { type = "hg", g = 0.5 }
[materials.null]
type = "null"
[materials.floor]
type = "diffuse"
reflectance = [0.5, 0.25, 0.75]
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
transform = [{ scale = [1.25, 0.96875, 1.25] }, { translate = [0, 1, 0] }]
material = "null"
interior = "fog"
[[shapes]]
type = "rectangle"
transform = [{ scale = 2.5 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
material = "floor"
[[shapes]]
type = "sphere"
center = [-0.4, 0.5, 0]
radius = 0.3
material = "glass"
exterior = "fog"
[[shapes]]
type = "disc"
transform = [{ rotate = { axis = [0, 1, 0], angle = 180 } }, { translate = [0, 0, 1.5] }]
emission = { radiance = [1, 2, 3] }
[[lights]]
type = "spot"
position = [0.5, 1.9, 0.25]
target = [0, 0, 0]
intensity = [8, 6, 4]
cutoff_angle = 25
[[lights]]
type = "environment"
radiance = 0.125
"#;

#[test]
fn a_scene_and_its_native_twin_render_alike() {
    let folder = folder(&[("scene.xml", XML), ("twin.toml", TOML)]);
    let from = |name: &str| {
        let file = SceneFile::read(&folder.path().join(name), &ImportOptions::default()).unwrap();
        file.load().unwrap()
    };
    let (xml, toml) = (from("scene.xml"), from("twin.toml"));
    assert_eq!(xml.defaults.passes, 8);
    assert_eq!(pixels(xml), pixels(toml));
}

/// The camera sees neither lamps nor the sky, but it sees what lies behind lamps, what they light, and their images in
/// mirrors.
#[test]
fn hidden_emitters_are_passed_through() {
    let integrator = |value: &str| {
        format!(
            "<integrator type=\"aov\"><integrator type=\"path\"><boolean name=\"hide_emitters\" value=\"{value}\"/>\
             </integrator></integrator>"
        )
    };
    // In front of the camera and facing it, with a wall behind.
    let panel = "<shape type=\"rectangle\" id=\"panel\"><transform name=\"to_world\"><translate z=\"1\"/></transform>\
                 <emitter type=\"area\"><rgb name=\"radiance\" value=\"4 0 0\"/></emitter></shape>";
    let sky = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0 1 0\"/></emitter>";
    let wall = "<shape type=\"rectangle\" id=\"wall\"><transform name=\"to_world\"><scale value=\"0.5\"/></transform>";
    let wall = |bsdf: &str| format!("{wall}<bsdf type=\"{bsdf}\"/></shape>");
    let text = |value: &str, bsdf: &str| {
        let wall = wall(bsdf);
        with_sensor(&format!("{}{panel}{sky}{wall}", integrator(value)))
    };
    let rays = "[\"reflected\", \"refracted\", \"shadow\", \"photon\"]";
    let hidden = native(&text("true", "diffuse"));
    assert_eq!(hidden.matches("visible = ").count(), 2, "{hidden}");
    assert_eq!(field(&hidden, "[[shapes]]", "visible"), Some(rays));
    assert!(!native(&text("false", "diffuse")).contains("visible"));

    let image = |value: &str, bsdf: &str| {
        let scene = Scene::new(scene(&text(value, bsdf)));
        let plan = plan_of(&scene);
        render_pass(&scene, &plan, 0).expect("a pass").film.pixels
    };
    let middle = 4 * 16 + 8;
    let seen = image("false", "diffuse");
    assert_eq!((seen[0], seen[middle]), ([0.0, 1.0, 0.0], [4.0, 0.0, 0.0]));
    let hidden = image("true", "diffuse");
    assert_eq!(hidden[0], [0.0; 3]);
    // The wall behind the panel, lit by the part of the sky that the panel does not hide.
    let [red, green, blue] = hidden[middle];
    assert!(green > 0.1 && green < 0.9, "{green}");
    assert_eq!([red, blue], [0.0; 2]);
    // A mirror in its place would show the sky, but for the panel's back.
    assert_eq!(image("true", "conductor")[middle], [0.0; 3]);
}
