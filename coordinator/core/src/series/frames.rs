//! The jobs of a series as a list for people.

use std::path::PathBuf;

/// How a frame stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameState {
    /// Its turn has not come.
    Waiting,
    /// Passes of it are handed out.
    Rendering,
    /// Its image is written.
    Done,
    /// Its image was there already.
    Kept,
    /// It was ended before it was complete.
    Stopped,
    /// It failed.
    Failed,
}

impl FrameState {
    /// One word.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Rendering => "rendering",
            Self::Done => "done",
            Self::Kept => "kept",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// A frame in the list.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameView {
    /// Which one.
    pub frame: i64,
    /// How it stands.
    pub state: FrameState,
    /// Passes of its image.
    pub passes: u64,
    /// Relative standard error of its image.
    pub error: Option<f64>,
    /// Time that it took, seconds.
    pub seconds: Option<f64>,
    /// Why it failed.
    pub message: Option<String>,
    /// Its picture as a PNG, once it is written.
    pub picture: Option<PathBuf>,
}

impl FrameView {
    /// A frame that waits.
    pub fn waiting(frame: i64) -> Self {
        Self {
            frame,
            state: FrameState::Waiting,
            passes: 0,
            error: None,
            seconds: None,
            message: None,
            picture: None,
        }
    }
}
