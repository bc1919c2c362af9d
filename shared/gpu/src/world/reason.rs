//! What keeps a scene from a device.

/// One of the reasons, of which a scene may have many.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{field}: {why}", self.prefix())]
pub struct Reason {
    /// The object, by its name in the scene file; none where it is the scene as a whole.
    pub object: Option<String>,
    /// What of it.
    pub field: &'static str,
    /// What is wrong with that.
    pub why: Why,
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
    /// A hierarchy of more levels than rays have room for.
    #[error("its hierarchy is so deep that rays need {entries} entries on their stack, and {most} are the most")]
    Deep {
        /// Entries.
        entries: u64,
        /// The limit.
        most: u64,
    },
}

impl Reason {
    fn prefix(&self) -> String {
        (self.object.as_ref()).map_or_else(String::new, |name| format!("object \"{name}\": "))
    }
}
