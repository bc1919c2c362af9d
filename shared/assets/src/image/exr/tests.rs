use super::super::{Encoding, read_picture};
use super::*;
use ::exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage,
};

type Channels = AnyChannels<FlatSamples>;

/// Channels of a constant value each.
fn channels([width, height]: [usize; 2], channels: &[(&str, f32)]) -> Channels {
    let list = channels
        .iter()
        .map(|(name, value)| AnyChannel::new(*name, FlatSamples::F32(vec![*value; width * height])));
    AnyChannels::sort(list.collect())
}

fn written<L>(image: &exr::Image<L>) -> Vec<u8>
where
    L: for<'i> ::exr::image::write::layers::WritableLayers<'i>,
{
    let mut bytes = Cursor::new(Vec::new());
    WritableImage::write(image).to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// An image of constant channels.
pub fn exr_with(width: usize, height: usize, of: &[(&str, f32)]) -> Vec<u8> {
    written(&exr::Image::from_channels(
        (width, height),
        channels([width, height], of),
    ))
}

/// A row of pixels.
pub fn rgb<const N: usize>(row: [Rgb; N]) -> Vec<u8> {
    let pixel = move |at: Vec2<usize>| (row[at.0].x, row[at.0].y, row[at.0].z);
    written(&exr::Image::from_channels((N, 1), SpecificChannels::rgb(pixel)))
}

/// Data of `size` at `at`, whose red and green are their coordinates counted from 1, seen through a window.
fn windowed(size: [usize; 2], at: [i32; 2], window: IntegerBounds) -> Vec<u8> {
    let pixel = |p: Vec2<usize>| (p.0 as f32 + 1.0, p.1 as f32 + 1.0, 0.25f32);
    let attributes = LayerAttributes {
        layer_position: Vec2(at[0], at[1]),
        ..LayerAttributes::default()
    };
    let encoding = exr::Encoding::SMALL_LOSSLESS;
    let layer = Layer::new((size[0], size[1]), attributes, encoding, SpecificChannels::rgb(pixel));
    written(&exr::Image::from_layer(layer).with_window(window))
}

trait WithWindow {
    fn with_window(self, window: IntegerBounds) -> Self;
}

impl<L> WithWindow for exr::Image<L> {
    fn with_window(mut self, window: IntegerBounds) -> Self {
        self.attributes.display_window = window;
        self
    }
}

fn bounds(at: [i32; 2], size: [usize; 2]) -> IntegerBounds {
    IntegerBounds::new((at[0], at[1]), (size[0], size[1]))
}

fn image(bytes: &[u8]) -> Image {
    super::read(bytes, None).unwrap().0
}

/// Named layers as parts of a file.
fn parts(of: &[(&str, &[(&str, f32)])]) -> Vec<u8> {
    let layer = |(name, of): &(&str, &[(&str, f32)])| {
        let attributes = LayerAttributes::named(*name);
        Layer::new((2, 1), attributes, exr::Encoding::SMALL_LOSSLESS, channels([2, 1], of))
    };
    let layers: Vec<Layer<Channels>> = of.iter().map(layer).collect();
    let attributes = exr::ImageAttributes::new(bounds([0, 0], [2, 1]));
    written(&exr::Image::from_layers(attributes, layers))
}

#[test]
fn exr_is_linear_by_channel_name() {
    for names in [["R", "G", "B"], ["r", "g", "b"]] {
        let of = [("A", 9.0), (names[0], 1.5), (names[1], 2.0), (names[2], 3.0)];
        let image = image(&exr_with(3, 2, &of));
        assert_eq!((image.width, image.height), (3, 2));
        assert!(image.pixels.iter().all(|p| *p == Rgb::new(1.5, 2.0, 3.0)));
    }
    let grey = image(&exr_with(3, 2, &[("Y", 0.25)]));
    assert!(grey.pixels.iter().all(|p| *p == Rgb::splat(0.25)));
}

/// Data windows that exceed the display window on all sides, lie within it, overlap one corner, and lie far away.
#[test]
fn the_picture_is_the_display_window() {
    let dark = Rgb::ZERO;
    for (size, at, window_at) in [
        ([6, 5], [-2, -1], [0, 0]),
        ([2, 1], [1, 1], [0, 0]),
        ([3, 3], [2, 1], [0, 0]),
        ([3, 3], [8, 18], [10, 20]),
        ([3, 3], [-13, -23], [-10, -20]),
        ([3, 3], [100, 0], [0, 0]),
        ([3, 2], [i32::MAX / 4, 0], [i32::MIN / 4, 0]),
    ] {
        let image = image(&windowed(size, at, bounds(window_at, [4, 3])));
        assert_eq!((image.width, image.height), (4, 3));
        for (i, found) in image.pixels.iter().enumerate() {
            let x = window_at[0] as i64 + i as i64 % 4 - at[0] as i64;
            let y = window_at[1] as i64 + i as i64 / 4 - at[1] as i64;
            let is_within = (0..size[0] as i64).contains(&x) && (0..size[1] as i64).contains(&y);
            let expected = match is_within {
                true => Rgb::new(x as f32 + 1.0, y as f32 + 1.0, 0.25),
                false => dark,
            };
            assert_eq!(
                *found, expected,
                "data of {size:?} at {at:?}, window at {window_at:?}: pixel {i}"
            );
        }
    }
}

/// A mostly empty display window cannot claim more memory than the file allows.
#[test]
fn windows_are_not_believed() {
    let around = windowed([1, 1], [0, 0], bounds([0, 0], [4096, 4096]));
    assert_eq!(image(&around).pixels.len(), 1 << 24);
    for size in [[16384, 8192], [40000, 1], [1, 40000]] {
        let said = super::read(&windowed([1, 1], [0, 0], bounds([0, 0], size)), None).unwrap_err();
        let words = said.message;
        assert!(
            words.contains("too short") || words.contains("pixels; expected 1 to"),
            "{words}"
        );
    }
}

#[test]
fn layers_of_channels_and_parts_are_read_by_name() {
    let channels = [
        ("a.R", 1.0),
        ("a.G", 2.0),
        ("a.B", 3.0),
        ("V.Combined.R", 4.0),
        ("V.Combined.G", 5.0),
        ("V.Combined.B", 6.0),
        ("V.Depth.Z", 7.0),
    ];
    let in_channels = exr_with(2, 1, &channels);
    let parts = parts(&[
        ("a", &channels[0..3]),
        ("V.Combined", &[("R", 4.0), ("G", 5.0), ("B", 6.0)]),
        ("V.Depth", &channels[6..7]),
    ]);
    for bytes in [in_channels, parts] {
        for (layer, expected) in [
            ("a", [1.0, 2.0, 3.0]),
            ("V.Combined", [4.0, 5.0, 6.0]),
            ("V.Depth", [7.0; 3]),
        ] {
            let picture = read_picture(&bytes, Encoding::Srgb, Some(layer)).unwrap();
            assert_eq!(picture.image.pixels, [Rgb::from_array(expected); 2], "{layer}");
            assert!(picture.notes.is_empty());
        }
        let picture = read_picture(&bytes, Encoding::Srgb, None).unwrap();
        assert_eq!(picture.image.pixels, [Rgb::new(4.0, 5.0, 6.0); 2]);
        assert!(
            picture.notes[0].contains("\"V.Combined\" is taken"),
            "{:?}",
            picture.notes
        );
        let said = read_picture(&bytes, Encoding::Srgb, Some("b")).unwrap_err().message;
        assert!(said.starts_with("there is no layer \"b\"; there are "), "{said}");
    }
}

/// Y, (R - Y) / Y and (B - Y) / Y of (0.5, 0.25, 1), with the weights of Rec. 709 and of other primaries.
#[test]
fn luminance_and_chroma_make_colours() {
    let color = [0.5f32, 0.25, 1.0];
    for weights in [[0.2126, 0.7152, 0.0722], [0.3, 0.6, 0.1]] {
        let y = color.iter().zip(weights).map(|(c, w)| c * w).sum::<f32>();
        let found = rgb_of_chroma([y, (color[0] - y) / y, (color[2] - y) / y], weights);
        assert!(found.iter().zip(color).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    }
    let y = 0.5 * 0.2126 + 0.25 * 0.7152 + 0.0722;
    let whole = exr_with(2, 1, &[("Y", y), ("RY", (0.5 - y) / y), ("BY", (1.0 - y) / y)]);
    let pixel = image(&whole).pixels[1];
    assert!((pixel - Rgb::from_array(color)).abs().max_element() < 1e-6, "{pixel}");
    assert_eq!(rgb_of_chroma([0.0, 0.3, 0.4], [0.2126, 0.7152, 0.0722]), [0.0; 3]);
    let rec_709 = exr::attribute::Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.3, 0.6),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    };
    let found = luminance_weights(Some(&rec_709));
    let expected = luminance_weights(None);
    assert!(
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4),
        "{found:?}"
    );
    let flat = exr::attribute::Chromaticities {
        green: Vec2(0.64, 0.33),
        ..rec_709
    };
    assert_eq!(luminance_weights(Some(&flat)), expected);
}

/// Offset of an attribute's value.
fn value_at(bytes: &[u8], attribute: &[u8]) -> usize {
    bytes.windows(attribute.len()).position(|w| w == attribute).unwrap() + attribute.len()
}

/// Made by patching files, since the library cannot write these.
#[test]
fn what_is_not_read_says_how_to_convert_it() {
    let plain = exr_with(2, 2, &[("R", 1.0), ("G", 1.0), ("B", 1.0)]);
    let compression = value_at(&plain, b"compression\0compression\0\x01\0\0\0");
    for (number, name) in [(8, "DWAA"), (9, "DWAB"), (10, "HTJ2K"), (11, "HTJ2K")] {
        let mut bytes = plain.clone();
        bytes[compression] = number;
        let said = super::read(&bytes, None).unwrap_err().message;
        assert!(
            said.starts_with(&format!("it is compressed by {name}, which is not read")),
            "{said}"
        );
        assert!(said.contains("oiiotool in.exr --compression zip -o out.exr"), "{said}");
    }
    // Name and type (float), then the linearity flag and the sampling steps.
    let mut halved = exr_with(2, 2, &[("BY", 0.0), ("RY", 0.0), ("Y", 1.0)]);
    let sampling = value_at(&halved, b"BY\0\x02\0\0\0") + 4;
    halved[sampling] = 2;
    halved[sampling + 4] = 2;
    let said = super::read(&halved, None).unwrap_err().message;
    assert!(said.starts_with("its channels of colour have fewer pixels"), "{said}");
    assert!(said.contains("convert it to RGB"), "{said}");
}
