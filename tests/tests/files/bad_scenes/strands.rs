//! Curves, points, hair and displacement.

use super::{VIEW, error_of, refused};

#[test]
fn strands_say_what_they_lack() {
    refused(
        r#"
        [[shapes]] | type = "curves"
            4: shapes[0].type: with this type the field `file` is required
        [[shapes]] | type = "curves" | points = [[0, 0, 0, 1], [1, 0, 0, 1]]
            5: shapes[0].points: curve 0 (from zero) has 2 control point(s); expected 4 at least
        [[shapes]] | type = "points" | points = [[0, 0, 0, -1]]
            5: shapes[0].points: point 0 (from zero) is [0.0, 0.0, 0.0, -1.0]; expected finite coordinates and a radius that is not negative
        [[shapes]] | type = "points" | points = []
            5: shapes[0].points: it has no points
        [[shapes]] | type = "points" | basis = "linear" | points = [[0, 0, 0, 1]]
            5: shapes[0].basis: "points" does not take this field; expected one of file, points, radius, material, transform, space
        [materials.a] | type = "hair" | color = 0.5 | eumelanin = 1
            6: materials.a.eumelanin: hair is given by `color`, by `absorption`, or by `eumelanin` and `pheomelanin`: one of these ways
        "#,
    );
    let glass = format!(
        "{VIEW}[materials.a]\ntype = \"dielectric\"\nior = 1.5\n[[shapes]]\ntype = \"curves\"\nmaterial = \"a\"\n\
         points = [[0, 0, 0, 1], [1, 0, 0, 1], [2, 0, 0, 1], [3, 0, 0, 1]]\n"
    );
    assert!(error_of(&glass, &[]).to_string().contains("curves have no inside"));
    let emits = format!("{VIEW}[[shapes]]\ntype = \"points\"\nfile = \"a.txt\"\nemission = {{ radiance = 1 }}\n");
    assert!(
        error_of(&emits, &[("a.txt", b"0 0 0 1".to_vec())])
            .to_string()
            .contains("emission")
    );
    let text = format!("{VIEW}[[shapes]]\ntype = \"curves\"\nbasis = \"linear\"\nfile = \"a.txt\"\n");
    let said = error_of(&text, &[("a.txt", b"0 0 0 1\n0 0 x 1\n".to_vec())]).to_string();
    assert!(
        said.starts_with("a.txt:2: \"0 0 x 1\"; expected four numbers"),
        "{said}"
    );
}

#[test]
fn displacement_says_what_it_lacks() {
    let said = |shape: &str| error_of(&format!("{VIEW}[[shapes]]\n{shape}\n"), &[]).to_string();
    assert!(said("type = \"sphere\"\ndisplacement = { height = 1, edge = 1 }").contains("does not take this field"));
    assert!(said("type = \"cube\"\ndisplacement = { height = 1 }").contains("missing field `edge`"));
    assert!(said("type = \"cube\"\ndisplacement = { height = 1, edge = 0 }").contains("a number above 0"));
    let many = said("type = \"cube\"\ndisplacement = { height = 1, edge = 1, triangles = 0 }");
    assert!(many.contains("`triangles`: expected a number from 1"), "{many}");
}
