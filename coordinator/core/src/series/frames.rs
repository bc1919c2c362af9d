//! The jobs of a series as a list of frames.

use std::path::PathBuf;

/// The state of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameState {
    /// Not started.
    Waiting,
    /// Its passes are being handed out.
    Rendering,
    /// Its image is written.
    Done,
    /// Its image already existed.
    Kept,
    /// It was ended before it was complete.
    Stopped,
    /// It failed.
    Failed,
}

impl FrameState {
    /// The state as one word.
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
    /// Its number.
    pub frame: i64,
    /// Its state.
    pub state: FrameState,
    /// Passes in its image.
    pub passes: u64,
    /// Relative standard error of its image.
    pub error: Option<f64>,
    /// Time spent on it, seconds.
    pub seconds: Option<f64>,
    /// Why it failed.
    pub message: Option<String>,
    /// Path of its PNG, once written.
    pub picture: Option<PathBuf>,
}

impl FrameView {
    /// A frame that has not started.
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
