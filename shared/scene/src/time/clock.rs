//! Frames and shutter times.

use crate::source::Fault;
use crate::values::{Finite, Number, Pair, Positive, Spanned};
use schemars::JsonSchema;
use serde::Deserialize;
use std::ops::Range;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Frames of an animation.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnimationRecord {
    /// First and last frame, whole numbers. They do not affect the images.
    pub frames: Option<Spanned<[i64; 2]>>,
    /// When the shutter opens and closes, in frames relative to the frame's time. Default: [0, 0], no motion blur.
    pub shutter: Option<Spanned<Pair>>,
    /// The frame to render. Default: the first, or 1.
    pub frame: Option<Spanned<Number<Finite>>>,
    /// Frames per second, for glTF animations, which count in seconds from frame 0. Default: 24.
    pub fps: Option<Number<Positive>>,
}

/// A moment of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// The middle of the exposure.
    Middle,
    /// A time in frames.
    At(f64),
}

/// The times given in a scene file.
#[derive(Clone, Debug)]
pub struct Clock {
    /// When the shutter opens and closes, in frames; `None` without frames.
    open: Option<[f64; 2]>,
    fps: f64,
}

/// Default frames per second.
pub const FPS: f64 = 24.0;

impl Clock {
    /// Read a scene file's `animation` table, if there is one.
    pub fn of(root: &DeTable<'_>) -> Result<Self, Fault> {
        match AnimationRecord::of(root)? {
            Some(animation) => animation.clock(),
            None => Ok(Self { open: None, fps: FPS }),
        }
    }

    /// Whether the scene file has frames.
    pub fn is_given(&self) -> bool {
        self.open.is_some()
    }

    /// When the shutter opens and closes, in frames.
    pub fn open(&self) -> [f64; 2] {
        self.open.unwrap_or_default()
    }

    /// [`Self::open`], or an error if the scene has no frames, which the thing at `place` needs.
    pub fn needed(&self, place: &Range<usize>) -> Result<[f64; 2], Fault> {
        let missing = || {
            let message = "something moves here, and the scene has no frames; \
                expected a table such as `[animation]` with `frames = [1, 48]`";
            Fault::new(place.clone(), message)
        };
        self.open.ok_or_else(missing)
    }

    /// Seconds from frame 0 to a moment, if there are frames.
    pub fn seconds(&self, when: When) -> Option<f64> {
        self.is_given().then(|| self.time(when) / self.fps)
    }

    /// The time of a moment in frames.
    pub fn time(&self, when: When) -> f64 {
        let [open, close] = self.open();
        match when {
            When::Middle => 0.5 * (open + close),
            When::At(time) => time,
        }
    }
}

/// A scene file's first and last frame, if it has frames.
pub fn frames(root: &DeTable<'_>) -> Result<Option<[i64; 2]>, Fault> {
    let Some(animation) = AnimationRecord::of(root)? else {
        return Ok(None);
    };
    animation.clock()?;
    Ok(animation.frames.map(|frames| *frames.get_ref()))
}

impl AnimationRecord {
    fn of(root: &DeTable<'_>) -> Result<Option<Self>, Fault> {
        let Some((_, value)) = root.iter().find(|(key, _)| key.get_ref() == "animation") else {
            return Ok(None);
        };
        let place = value.span();
        let table = DeValue::Table(match value.get_ref() {
            DeValue::Table(table) => table.clone(),
            _ => return Err(Fault::new(place, "expected a table, with `frames` for example")),
        });
        let deserializer = ValueDeserializer::from(toml::Spanned::new(place, table));
        Ok(Some(Self::deserialize(deserializer)?))
    }

    fn clock(&self) -> Result<Clock, Fault> {
        let [first, last] = self.frames.as_ref().map_or([1, 1], |frames| *frames.get_ref());
        if let Some(frames) = &self.frames
            && (first > last || [first, last].iter().any(|frame| frame.unsigned_abs() > 1_000_000))
        {
            let message = "expected the first frame and the last one, not before it, within a million";
            return Err(Fault::new(frames.span(), message));
        }
        let shutter = self.shutter.as_ref().map_or([0.0; 2], |pair| pair.get_ref().0);
        if let Some(pair) = &self.shutter
            && !(shutter[0] <= shutter[1] && shutter.iter().all(|time| time.abs() <= 100.0))
        {
            let message = "expected when it opens and when it closes, not before that, within 100 frames";
            return Err(Fault::new(pair.span(), message));
        }
        let frame = match &self.frame {
            Some(frame) if frame.get_ref().0.abs() > 1e6 => {
                return Err(Fault::new(frame.span(), "expected a frame within a million"));
            }
            Some(frame) => frame.get_ref().0,
            None => first as f64,
        };
        Ok(Clock {
            open: Some(shutter.map(|offset| frame + offset)),
            fps: self.fps.map_or(FPS, |fps| fps.0),
        })
    }
}
