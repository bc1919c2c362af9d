//! Reports about a bias, in words.

use super::{Bias, Channel, Finding, MIN_PASSES, PartBias, TILE};
use std::fmt;

/// Tiles to list.
const LISTED: usize = 3;

impl Channel {
    /// `red` and so on; empty for the mean of all channels.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mean => "",
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
        }
    }
}

/// `blue -1.20 % ± 0.30 %`
impl fmt::Display for PartBias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (channel, _) = self.clearest();
        if channel != Channel::Mean {
            write!(f, "{} ", channel.as_str())?;
        }
        let (bias, error) = self.relative();
        write!(f, "{:+.2} % ± {:.2} %", 100.0 * bias, 100.0 * error)
    }
}

impl Bias {
    /// A report on the tiles, unless nothing is known or the image is a single tile.
    pub fn tiles_in_words(&self) -> Option<String> {
        if !self.is_known() || self.tiles.len() < 2 {
            return None;
        }
        let named = self.named();
        let count = match named.len() {
            0 => "none".into(),
            count => count.to_string(),
        };
        let mut text = format!(
            "bias by tiles of {TILE} x {TILE} pixels: found in {count} of {}",
            self.tiles.len()
        );
        match self.unknown() {
            0 => {}
            unknown => text += &format!(", {unknown} too noisy to tell"),
        }
        for (i, tile) in named.iter().take(LISTED).enumerate() {
            let before = if i == 0 { "; worst" } else { "," };
            text += &format!("{before} {tile} at ({}, {})", tile.x, tile.y);
        }
        Some(text)
    }
}

/// A report on the image as a whole.
impl fmt::Display for Bias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.passes < MIN_PASSES {
            return write!(f, "bias not known: fewer than {MIN_PASSES} passes");
        }
        if !self.radii_differ {
            return f.write_str("bias not known: all passes have the same radii");
        }
        if !self.is_known() {
            return f.write_str("bias not known: the image is black");
        }
        let least = 100.0 * self.least_seen();
        match self.image.finding {
            Finding::Biased => write!(f, "bias of the mean radiance: {}", self.image),
            Finding::NotSeen => write!(
                f,
                "bias of the mean radiance: none found; one of {least:.2} % would show"
            ),
            Finding::NotKnown => write!(
                f,
                "bias of the mean radiance: unknown; noise would hide one below {least:.2} %"
            ),
        }
    }
}
