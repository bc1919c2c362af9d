//! Thumbnails.

use beamfarm_image::png::encode_rgb;
use std::io::Cursor;

/// A thumbnail of a picture written by [`write_png`](beamfarm_image::png::write_png), with the longer side at most
/// `side`. It averages squares of encoded pixel values. `None` for other files.
pub(super) fn thumbnail(png: &[u8], side: u32) -> Option<Vec<u8>> {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().ok()?;
    let mut data = vec![0; reader.output_buffer_size()?];
    let info = reader.next_frame(&mut data).ok()?;
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgb, png::BitDepth::Eight) {
        return None;
    }
    let (width, height) = (info.width as usize, info.height as usize);
    let step = width.max(height).div_ceil(side.max(1) as usize).max(1);
    let (columns, rows) = (width.div_ceil(step), height.div_ceil(step));
    let mut small = Vec::with_capacity(3 * columns * rows);
    for square in 0..columns * rows {
        let (x, y) = (square % columns * step, square / columns * step);
        let (x, y) = (x..(x + step).min(width), y..(y + step).min(height));
        for channel in 0..3 {
            let value = |(x, y): (usize, usize)| u64::from(data[3 * (y * width + x) + channel]);
            let row = |y: usize| x.clone().map(move |x| (x, y));
            let sum: u64 = y.clone().flat_map(row).map(value).sum();
            small.push((sum / (x.len() * y.len()) as u64) as u8);
        }
    }
    encode_rgb(columns as u32, rows as u32, &small).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::film::Film;
    use beamfarm_image::png::encode_png;
    use beamfarm_image::view::View;

    fn decode(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width, info.height, pixels)
    }

    #[test]
    fn thumbnails_have_the_means_of_squares() {
        let mut film = Film::new(5, 3);
        film.pixels.fill([0.0, 1.0, 0.0]);
        film.pixels[0] = [1.0; 3];
        film.pixels[4] = [1.0, 0.0, 1.0];
        let png = encode_png(&film, View::default()).unwrap();
        let (width, height, pixels) = decode(&thumbnail(&png, 3).unwrap());
        assert_eq!((width, height), (3, 2));
        assert_eq!(pixels[..9], [63, 255, 63, 0, 255, 0, 127, 127, 127]);
        // A picture that is small enough stays as it is.
        assert_eq!(decode(&thumbnail(&png, 5).unwrap()), decode(&png));
        assert_eq!(thumbnail(b"no picture", 5), None);
    }
}
