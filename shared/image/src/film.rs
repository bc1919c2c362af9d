//! The film: linear RGB, row by row from the top left.

/// An image of linear RGB radiance; or a sum of such images, or of their squares, as the owner says.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_are_not_finite_are_counted_once() {
        let mut film = Film::new(3, 2);
        assert_eq!(film.non_finite(), 0);
        film.pixels[1] = [f32::NAN, f32::INFINITY, 0.0];
        film.pixels[5][2] = f32::NEG_INFINITY;
        film.pixels[0] = [f32::MAX, f32::MIN, -0.0];
        assert_eq!(film.non_finite(), 2);
    }
}
