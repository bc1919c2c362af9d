//! What reading a scene may be told.

use crate::edits::Edits;
use std::path::PathBuf;

/// What reading a scene may be told.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Values of `$name` parameters, in place of the file's defaults.
    pub parameters: Vec<(String, String)>,
    /// Leave out what is not supported instead of failing.
    pub skip_unsupported: bool,
    /// Let the substances that a Mitsuba scene names as dielectrics bend light of each wavelength by another angle.
    pub spectral: bool,
    /// Folders beside the scene file's that files may be read from which it does not name itself.
    pub allow_outside: Vec<PathBuf>,
    /// What to change of the native scene.
    pub edits: Edits,
}
