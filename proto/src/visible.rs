//! Makes untrusted text safe to display.

use std::borrow::Cow;

/// Whether a character moves or hides its surroundings: control characters other than line ends and tabs, marks that
/// change the text direction, and characters without width.
pub fn misleads(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let hides = matches!(
        c,
        '\u{ad}' | '\u{200b}' | '\u{2028}' | '\u{2029}' | '\u{2060}' | '\u{feff}'
    );
    turns || hides || c.is_control() && c != '\n' && c != '\t'
}

/// The text with misleading characters escaped, as `\u{1b}`.
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(misleads) {
        return text.into();
    }
    let spelt = text.chars().map(|c| match misleads(c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    });
    spelt.collect::<String>().into()
}

#[cfg(test)]
mod tests {
    use super::visible;

    #[test]
    fn characters_that_mislead_are_spelt_out() {
        assert_eq!(visible("a\tb\nµ│ שלום, 👩‍🚀"), "a\tb\nµ│ שלום, 👩‍🚀");
        assert_eq!(visible("\u{1b}]0;x\u{7}\u{9b}A"), "\\u{1b}]0;x\\u{7}\\u{9b}A");
        assert_eq!(visible("a\u{202e}gnp\u{2066}.exe"), "a\\u{202e}gnp\\u{2066}.exe");
    }
}
