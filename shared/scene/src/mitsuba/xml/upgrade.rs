//! Converts names from versions before 2 to those of version 2, as Mitsuba 3 does.

use super::{Content, Member, Objects};
use crate::mitsuba::transform::Step;
use crate::mitsuba::value::Value;
use std::cell::Cell;

/// The current name of a parameter: `toWorld` is `to_world`, `intIOR` is `int_ior`.
pub fn name(plugin: &str, name: &str) -> String {
    let mut new = String::with_capacity(name.len() + 4);
    let mut before = None;
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_some_and(|b: char| b.is_ascii_lowercase()) {
            new.push('_');
        }
        // Like Mitsuba, lower-case only capitals after a small letter, and those that follow; leading capitals stay.
        match new.contains('_') || before.is_some_and(|b: char| b.is_ascii_lowercase()) {
            true => new.push(c.to_ascii_lowercase()),
            false => new.push(c),
        }
        before = Some(c);
    }
    match (plugin, new.as_str()) {
        ("diffuse", "diffuse_reflectance") => "reflectance".to_string(),
        _ => new,
    }
}

impl Objects {
    /// Turn UV offsets and scales into transforms, in Mitsuba 3's order.
    pub fn upgrade(&mut self) {
        for object in self.list.iter_mut().filter(|object| object.old) {
            let mut place = None;
            let [mut offset, mut scale] = [[0.0; 3], [1.0, 1.0, 1.0]];
            object.members.retain(|member| {
                let (Some(name), Content::Value(value)) = (&member.name, &member.content) else {
                    return true;
                };
                let number = match value {
                    Value::Float(x) => *x,
                    Value::Integer(n) => *n as f64,
                    _ => return true,
                };
                match name.as_str() {
                    "uoffset" => offset[0] = number,
                    "voffset" => offset[1] = number,
                    "uscale" => scale[0] = number,
                    "vscale" => scale[1] = number,
                    _ => return true,
                }
                place = Some(member.place);
                false
            });
            if let Some(place) = place {
                object.members.push(Member {
                    name: Some("to_uv".to_string()),
                    place,
                    content: Content::Value(Value::Transform(vec![Step::Translate(offset), Step::Scale(scale)])),
                    used: Cell::new(false),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::name;

    #[test]
    fn names_of_old_versions_become_those_of_now() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("sigmaT", "sigma_t"),
            ("fovAxis", "fov_axis"),
            ("alphaU", "alpha_u"),
            ("maxDepth", "max_depth"),
            ("diffuseReflectance", "diffuse_reflectance"),
            ("flipTexCoords", "flip_tex_coords"),
            ("g", "g"),
            ("p0", "p0"),
        ] {
            assert_eq!(name("plastic", old), new);
        }
        assert_eq!(name("diffuse", "diffuseReflectance"), "reflectance");
    }
}
