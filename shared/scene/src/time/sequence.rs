//! Files of which there is one for each frame: `smoke_####.vdb` is `smoke_0012.vdb` at frame 12. Shapes are between two
//! of them, all others those of the nearest frame.

/// Fields that name files.
const FIELDS: [&str; 2] = ["file", "image"];

/// A `#` of a name that is one, and no digit of the frame.
const PLAIN: &str = "[#]";
/// What stands for it meanwhile. No file's name has it.
const MARK: &str = "\0";

/// Whether a field's text stands for a file of each frame, or has a `#` by [`PLAIN`].
pub fn is_one(field: &str, text: &str) -> bool {
    FIELDS.contains(&field) && text.contains('#')
}

/// Whether there is one for each frame.
pub fn has_frames(name: &str) -> bool {
    name.replace(PLAIN, "").contains('#')
}

/// The file of a frame. The last run of `#` in the name is the frame, with at least so many digits; `[#]` is a `#`.
pub fn of_frame(name: &str, frame: i64) -> String {
    numbered(&name.replace(PLAIN, MARK), frame).replace(MARK, "#")
}

/// The file of the frame that is nearest to a time.
pub fn at(name: &str, time: f64) -> String {
    of_frame(name, nearest(time))
}

/// The whole frame before a time, and how far it is from there to the next one, 0 to 1.
pub fn between(time: f64) -> (i64, f64) {
    let frame = time.floor();
    (frame as i64, time - frame)
}

/// Whole frames between these times.
pub fn frames([open, close]: [f64; 2]) -> impl Iterator<Item = f64> {
    let frames = open.ceil() as i64..=close.floor() as i64;
    frames.map(|frame| frame as f64)
}

/// The whole frame that is nearest; the later one of two.
fn nearest(time: f64) -> i64 {
    (time + 0.5).floor() as i64
}

/// The name with a frame in the place of its last run of `#`.
pub fn numbered(name: &str, frame: i64) -> String {
    let Some(end) = name.rfind('#').map(|last| last + 1) else {
        return name.to_owned();
    };
    let start = name[..end].trim_end_matches('#').len();
    let width = end - start;
    // The sign counts as a digit less, as elsewhere.
    format!("{}{frame:0width$}{}", &name[..start], &name[end..])
}

/// Times between these at which another frame is the nearest.
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
        // Names of pictures that are written have no such rule.
        assert_eq!(numbered("[#].png", 7), "[7].png");
    }
}
