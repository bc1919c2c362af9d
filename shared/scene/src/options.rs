//! Options for reading a scene.

use crate::edits::Edits;
use std::path::PathBuf;

/// Options for reading a scene.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Values of `$name` parameters that override the file's defaults.
    pub parameters: Vec<(String, String)>,
    /// Leave out unsupported parts instead of failing.
    pub skip_unsupported: bool,
    /// Give a Mitsuba scene's named dielectrics a wavelength-dependent index of refraction.
    pub spectral: bool,
    /// Folders outside the scene's own that may be read even if the scene file itself does not name them.
    pub allow_outside: Vec<PathBuf>,
    /// Changes to the native scene.
    pub edits: Edits,
}
