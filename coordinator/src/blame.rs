//! Finds the option that caused a scene error, as command-line values have no line in a file.

use beamfarm_scene::{ImportOptions, SceneError, errors};
use std::collections::BTreeSet;
use std::path::Path;

/// The errors; one that a field on the command line (`-D NAME=VALUE`) caused quotes that option in place of a line.
/// `is_native`: the scene is read as it is on disk.
pub fn blamed(scene: &Path, options: &ImportOptions, found: Vec<SceneError>, is_native: bool) -> Vec<SceneError> {
    let fields = &options.edits.fields;
    // Per field, the errors of the scene without it, computed on demand.
    let mut without: Vec<Option<BTreeSet<String>>> = vec![None; fields.len()];
    let mut is_from = |i: usize, message: &str| {
        let said = without[i].get_or_insert_with(|| {
            let mut options = options.clone();
            options.edits.fields.remove(i);
            errors(scene, &options).into_iter().map(|error| error.message).collect()
        });
        !said.contains(message)
    };
    let mut blame = |error: SceneError| {
        if error.file != scene || error.message.starts_with("-D ") {
            return error;
        }
        let named = fields.iter().position(|(name, _)| is_about(&error.message, name));
        let guilty = named.or_else(|| (0..fields.len()).find(|i| is_native && is_from(*i, &error.message)));
        match guilty.and_then(|i| fields.get(i)) {
            Some((name, value)) => SceneError {
                line: None,
                message: format!("-D {name}={value}: {}", error.message),
                ..error
            },
            None => error,
        }
    };
    found.into_iter().map(&mut blame).collect()
}

/// Whether a message is about this field or a part of it.
fn is_about(message: &str, name: &str) -> bool {
    let field = message.split(": ").next().unwrap_or_default();
    let rest = field.strip_prefix(name);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}
