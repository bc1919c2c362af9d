//! Textures.

use super::{VIEW, error_of, refused};

#[test]
fn textures_are_checked() {
    refused(
        r#"
[materials.x] | type = "diffuse" | reflectance = {}
    5: materials.x.reflectance: a texture is given by `image` or by `checkerboard`: one of the two ways
[materials.x] | type = "diffuse" | reflectance = { image = "a.png", checkerboard = [0, 1] }
    5: materials.x.reflectance: a texture is given by `image` or by `checkerboard`: one of the two ways
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 2] }
    5: materials.x.reflectance.checkerboard[1]: expected a number from 0 to 1, found 2.0
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1, 0] }
    5: materials.x.reflectance: a checkerboard has 2 colors, found 3
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], wrap = "clamp" }
    5: materials.x.reflectance: a checkerboard takes only `uv`; `raw`, `filter`, `wrap` and `channel` are for an `image`
[materials.x] | type = "diffuse" | reflectance = { image = "a.png", raw = 1 }
    5: materials.x.reflectance.raw: invalid type: integer `1`, expected true or false
[materials.x] | type = "diffuse" | reflectance = { image = "a.png", filter = "trilinear" }
    5: materials.x.reflectance.filter: unknown variant `trilinear`, expected `bilinear` or `nearest`
[materials.x] | type = "diffuse" | reflectance = { image = "a.png", wrap = "black" }
    5: materials.x.reflectance.wrap: unknown variant `black`, expected one of `repeat`, `mirror`, `clamp`
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ scale = [1, 2, 3] }] }
    5: materials.x.reflectance.uv[0]: texture coordinates are scaled by one number or by [u, v, 1]
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ rotate = { axis = [0, 1, 1], angle = 3 } }] }
    5: materials.x.reflectance.uv[0]: texture coordinates are rotated around the axis [0, 0, 1]
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ translate = [1, 2, 3] }] }
    5: materials.x.reflectance.uv[0]: texture coordinates are moved by [u, v, 0]
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ scale = 2, translate = [1, 2, 0] }] }
    5: materials.x.reflectance.uv[0]: expected exactly one of scale, rotate, translate, matrix in a step
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ matrix = [[1, 0, 0], [0, 1, 0], [0, 1, 1]] }] }
    5: materials.x.reflectance.uv[0]: expected [0, 0, 1] as the last row of `matrix`
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }] }
    5: materials.x.reflectance.uv[0]: expected three rows of three numbers as `matrix`
[materials.x] | type = "diffuse" | reflectance = { checkerboard = [0, 1], uv = [{ scale = 1e20 }, { scale = 1e20 }] }
    5: materials.x.reflectance.uv: the numbers of this transform are too large for single precision
[materials.x] | type = "diffuse" | reflectance = { attribute = "colour" }
    5: materials.x.reflectance.attribute: unknown variant `colour`, expected `color`
[materials.x] | type = "diffuse" | reflectance = { attribute = "color", wrap = "clamp" }
    5: materials.x.reflectance: an `attribute` takes no other field, but for an `image` and its fields
[materials.x] | type = "diffuse" | reflectance = { attribute = "color", checkerboard = [0, 1] }
    5: materials.x.reflectance: a texture is given by `image` or by `checkerboard`: one of the two ways
[materials.x] | type = "principled" | roughness = { attribute = "color" }
    5: materials.x.roughness: colours of vertices are no number; expected a number or an image
[materials.x] | type = "diffuse" | normal_map = { attribute = "color" }
    5: materials.x.normal_map: colours of vertices are no normals; expected an image
[materials.x] | type = "diffuse" | reflectance = { attribute = "color" } | [[shapes]] | type = "sphere" | material = "x"
    8: shapes[0].material: it takes the colours of vertices, which meshes from files alone have
[[shapes]] | type = "cube" | emission = { radiance = { attribute = "color" } }
    5: shapes[0].emission: it takes the colours of vertices, which meshes from files alone have
"#,
    );
}

/// A mesh whose vertices have no colours, or colours that reflect more than arrives.
#[test]
fn meshes_have_the_colours_that_materials_take() {
    let scene = |of_shape: &str| {
        format!(
            "{VIEW}[materials.x]\ntype = \"diffuse\"\nreflectance = {{ attribute = \"color\" }}\n\
             [[shapes]]\ntype = \"mesh\"\nfile = \"a.ply\"\n{of_shape}"
        )
    };
    let file = |property: &str, value: &str| {
        let names = ["red", "green", "blue"].map(|name| format!("property {property} {name}\n"));
        let vertex = |place: &str| format!("{place} {value} 0 0\n");
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{}\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{}{}{}3 0 1 2\n",
            names.concat(),
            vertex("0 0 0"),
            vertex("1 0 0"),
            vertex("0 1 0"),
        )
    };
    let error = |of_shape: &str, file: String| error_of(&scene(of_shape), &[("a.ply", file.into_bytes())]).to_string();
    let glowing = "emission = { radiance = { attribute = \"color\" } }";
    let plain = file("float", "0").replace("red", "scarlet");
    for of_shape in ["material = \"x\"", glowing] {
        let said = error(of_shape, plain.clone());
        assert!(said.starts_with("a.ply: its vertices have no colours"), "{said}");
    }
    let said = error("material = \"x\"", file("float", "2"));
    assert!(
        said.starts_with("a.ply: vertex 0 (from zero) has the colour [2, 0, 0]; expected numbers from 0 to 1"),
        "{said}"
    );
    let said = error(glowing, file("float", "-1"));
    assert!(said.starts_with("a.ply: vertex 0 (from zero) has the colour"), "{said}");
    let said = error(glowing, file("ushort", "3"));
    assert!(said.starts_with("a.ply"), "{said}");
}

#[test]
fn blends_and_numbers_are_checked() {
    refused(
        r#"
[materials.a] | type = "blend" | materials = ["b", "a"] | weight = 0.5 | [materials.b] | type = "diffuse"
    5: materials.a.materials[1]: the blend "a" is made of itself
[materials.a] | type = "blend" | materials = ["b", "c"] | weight = 0.5 | [materials.b] | type = "diffuse"
    5: materials.a.materials[1]: there is no material "c"; the scene defines "a", "b"
[materials.a] | type = "blend" | materials = ["b", "b"] | [materials.b] | type = "diffuse"
    4: materials.a.type: with this type the field `weight` is required
[materials.a] | type = "blend" | materials = ["b", "b"] | weight = 2 | [materials.b] | type = "diffuse"
    6: materials.a.weight: expected a number from 0 to 1, found 2.0
[materials.x] | type = "rough_plastic" | alpha = { checkerboard = [0, 1] }
    5: materials.x.alpha: the roughness of a rough plastic is the same everywhere; expected a number
[materials.x] | type = "principled" | spec_trans = 1 | two_sided = true
    6: materials.x.two_sided: with `spec_trans` the other side is the inside; expected false
[materials.x] | type = "principled" | roughness = { image = "a.png", channel = "x" }
    5: materials.x.roughness.channel: unknown variant `x`, expected one of `r`, `g`, `b`, `luminance`, `a`
"#,
    );
}

/// Pixels of images are checked as reflectances, too.
#[test]
fn pixels_are_checked() {
    let file = tempfile::Builder::new().suffix(".exr").tempfile().unwrap();
    let pixel = |x, _| {
        if x == 1 { (0.5, 1.5, 0.5) } else { (0.5, 0.5, 0.5) }
    };
    exr::prelude::write_rgb_file(file.path(), 2, 1, pixel).unwrap();
    let texture = "[materials.x]\ntype = \"diffuse\"\nreflectance = { image = \"a.exr\", raw = true }";
    let assets = [("a.exr", std::fs::read(file.path()).unwrap())];
    assert_eq!(
        error_of(&format!("{VIEW}{texture}"), &assets).to_string(),
        "a.exr: the pixel in column 1, row 0 (from zero) is [0.5, 1.5, 0.5]; expected a number from 0 to 1 in each channel"
    );
}
