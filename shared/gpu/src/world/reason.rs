//! What keeps a scene from a device.

/// One of the reasons, of which a scene may have many.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{of}{field}: {why}")]
pub struct Reason {
    /// What it is a reason of.
    pub of: Of,
    /// What of it.
    pub field: &'static str,
    /// What is wrong with that.
    pub why: Why,
}

/// What has reasons, by its name in the scene file.
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
    /// More than a buffer holds.
    #[error("it takes a buffer of {bytes} bytes, and the device's largest has {most}")]
    Large {
        /// Its size.
        bytes: u64,
        /// The device's limit.
        most: u64,
    },
    /// More than can be numbered.
    #[error("there are {count}, and {most} are the most")]
    Many {
        /// So many there are.
        count: u64,
        /// So many there may be.
        most: u64,
    },
    /// Something that no kernel can do.
    #[error("kernels have no {0}")]
    Missing(&'static str),
    /// What is where two objects are depends on both.
    #[error("it reaches into \"{other}\" or touches it, and kernels cannot tell what is there")]
    Meets {
        /// The other object's name.
        other: String,
    },
    /// A hierarchy of more levels than rays have room for.
    #[error("its hierarchy is so deep that rays need {entries} entries on their stack, and {most} are the most")]
    Deep {
        /// Entries.
        entries: u64,
        /// The limit.
        most: u64,
    },
}
