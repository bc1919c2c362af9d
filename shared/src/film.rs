//! The film: linear RGB, row by row from the top left.

/// An image of linear RGB radiance (or of a sum of such images, or of their squares, as the owner says).
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, row by row from the top left.
    pub pixels: Vec<[f32; 3]>,
}

impl Film {
    /// A black film.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            pixels: vec![[0.0; 3]; width as usize * height as usize],
        }
    }
    /// Number of pixels with a channel that is NaN or infinite.
    pub fn non_finite(&self) -> u64 {
        let bad = |p: &&[f32; 3]| !p.iter().all(|c| c.is_finite());
        self.pixels.iter().filter(bad).count() as u64
    }
}
