//! What is said beside the work. Whoever reads it may have gone, or the disk that it goes to may be full: then it is
//! left out, and the work goes on.

use std::borrow::Cow;

/// As `println!`, but it cannot fail, and names of files and scenes steer no terminal.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stdout(), "{}", $crate::visible(&text));
    }};
}

/// As `eprintln!`, but it cannot fail, and names of files and scenes steer no terminal.
#[macro_export]
macro_rules! complain {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stderr(), "{}", $crate::visible(&text));
    }};
}

/// The text with its control characters spelt out, as `\u{1b}`, but for those that end lines and set columns.
pub fn visible(text: &str) -> Cow<'_, str> {
    let steers = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(steers) {
        return text.into();
    }
    let spelt = text.chars().map(|c| match steers(c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    });
    spelt.collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::visible;

    #[test]
    fn control_characters_are_spelt_out() {
        assert_eq!(visible("a\tb\nµ│"), "a\tb\nµ│");
        assert_eq!(visible("\u{1b}]0;x\u{7}\u{9b}A"), "\\u{1b}]0;x\\u{7}\\u{9b}A");
    }
}
