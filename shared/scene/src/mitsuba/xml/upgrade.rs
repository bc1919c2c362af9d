//! Versions before 2 of the format: their names made those of version 2, as Mitsuba 3 does it when it reads them.

use super::{Content, Member, Objects};
use crate::mitsuba::transform::Step;
use crate::mitsuba::value::Value;
use std::cell::Cell;

/// The name of a parameter now: `toWorld` is `to_world`, `intIOR` is `int_ior`.
pub fn name(plugin: &str, name: &str) -> String {
    let mut new = String::with_capacity(name.len() + 4);
    let mut before = None;
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_some_and(|b: char| b.is_ascii_lowercase()) {
            new.push('_');
        }
        // Capitals at the beginning stay: Mitsuba takes down those that follow a small letter, and theirs.
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
    /// Offsets and scales of UVs become transforms, in the order that Mitsuba 3 gives them.
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
