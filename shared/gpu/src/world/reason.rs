//! Why a device cannot render a scene.

/// One reason; a scene may have many.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{of}{field}: {why}")]
pub struct Reason {
    /// The part of the scene.
    pub of: Of,
    /// Its field.
    pub field: &'static str,
    /// What is wrong with it.
    pub why: Why,
}

/// The part of the scene, by its name in the scene file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Of {
    /// The scene as a whole.
    #[error("")]
    Scene,
    /// Its camera.
    #[error("camera: ")]
    Camera,
    /// An object.
    #[error("object \"{0}\": ")]
    Object(String),
    /// A material that has a name.
    #[error("material \"{0}\": ")]
    Material(String),
    /// A light.
    #[error("light \"{0}\": ")]
    Light(String),
    /// What is done in each pass.
    #[error("plan: ")]
    Plan,
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Why {
    /// More than a buffer can hold.
    #[error("it takes a buffer of {bytes} bytes, and the device's largest has {most}")]
    Large {
        /// Its size.
        bytes: u64,
        /// The device's limit.
        most: u64,
    },
    /// Too many to be numbered.
    #[error("there are {count}, and {most} are the most")]
    Many {
        /// Their number.
        count: u64,
        /// The most that are supported.
        most: u64,
    },
    /// Something that no kernel supports.
    #[error("kernels have no {0}")]
    Missing(&'static str),
    /// Its interior depends on another object, too.
    #[error("it reaches into \"{other}\" or touches it, and kernels cannot tell what is there")]
    Meets {
        /// The other object's name.
        other: String,
    },
    /// A hierarchy deeper than a ray's stack.
    #[error("its hierarchy is so deep that rays need {entries} entries on their stack, and {most} are the most")]
    Deep {
        /// Entries.
        entries: u64,
        /// The limit.
        most: u64,
    },
}
