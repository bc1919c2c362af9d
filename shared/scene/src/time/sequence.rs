//! Numbered files, one per frame: `smoke_####.vdb` is `smoke_0012.vdb` at frame 12. Shapes are interpolated between two
//! files; everything else uses the nearest frame's.

/// Fields that name files.
const FIELDS: [&str; 2] = ["file", "image"];

/// An escaped `#`, which is not a digit of the frame.
const PLAIN: &str = "[#]";
/// Temporary substitute for it; no file name contains it.
const MARK: &str = "\0";

/// Whether a field's text names numbered files, or has an escaped `#` as in [`PLAIN`].
pub fn is_one(field: &str, text: &str) -> bool {
    FIELDS.contains(&field) && text.contains('#')
}

/// Whether there is a file per frame.
pub fn has_frames(name: &str) -> bool {
    name.replace(PLAIN, "").contains('#')
}

/// A frame's file. The last run of `#` in the name becomes the frame number, with at least as many digits; `[#]` is a
/// literal `#`.
pub fn of_frame(name: &str, frame: i64) -> String {
    numbered(&name.replace(PLAIN, MARK), frame).replace(MARK, "#")
}

/// The file of the frame nearest to a time.
pub fn at(name: &str, time: f64) -> String {
    of_frame(name, nearest(time))
}

/// The whole frame before a time, and the fraction from there to the next, 0 to 1.
pub fn between(time: f64) -> (i64, f64) {
    let frame = time.floor();
    (frame as i64, time - frame)
}

/// The whole frames between these times.
pub fn frames([open, close]: [f64; 2]) -> impl Iterator<Item = f64> {
    let frames = open.ceil() as i64..=close.floor() as i64;
    frames.map(|frame| frame as f64)
}

/// The nearest whole frame; the later of two.
fn nearest(time: f64) -> i64 {
    (time + 0.5).floor() as i64
}

/// The name with its last run of `#` replaced by the frame number.
pub fn numbered(name: &str, frame: i64) -> String {
    let Some(end) = name.rfind('#').map(|last| last + 1) else {
        return name.to_owned();
    };
    let start = name[..end].trim_end_matches('#').len();
    let width = end - start;
    // The sign counts as one of the digits, as elsewhere.
    format!("{}{frame:0width$}{}", &name[..start], &name[end..])
}

/// Times in the interval at which the nearest frame changes.
pub fn breaks([open, close]: [f64; 2]) -> impl Iterator<Item = f64> {
    let frames = nearest(open)..nearest(close);
    frames.map(|frame| frame as f64 + 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_names() {
        for (name, time, expected) in [
            ("smoke_####.vdb", 12.0, "smoke_0012.vdb"),
            ("smoke_####.vdb", 12.5, "smoke_0013.vdb"),
            ("smoke_####.vdb", 12.49, "smoke_0012.vdb"),
            ("v#/a_##.ply", 123.0, "v#/a_123.ply"),
            ("a#.ply", -1.0, "a-1.ply"),
            ("a###.ply", -1.0, "a-01.ply"),
            ("wood [#]1.png", 7.0, "wood #1.png"),
            ("[#][#]/a_##.ply", 7.0, "##/a_07.ply"),
            ("a_##[#].ply", 7.0, "a_07#.ply"),
            ("[#", 7.0, "[7"),
        ] {
            assert_eq!(at(name, time), expected);
        }
        assert_eq!(breaks([1.0, 3.0]).collect::<Vec<_>>(), [1.5, 2.5]);
        assert_eq!(breaks([1.0, 1.4]).count(), 0);
        assert!(has_frames("[#]_#.png") && !has_frames("wood [#]1.png") && !has_frames("a.png"));
        // `[#]` is not an escape in names of output images.
        assert_eq!(numbered("[#].png", 7), "[7].png");
    }
}
