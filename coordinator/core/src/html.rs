//! Pieces of HTML and SVG. Values put into a piece are escaped, unless they are pieces themselves.

use beamfarm_proto::misleads;
use std::fmt::{Display, Formatter, Result, Write};

/// HTML ready for output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Html(String);

impl Html {
    /// Wrap text that is already HTML and does not come from outside.
    pub fn trusted(html: impl Into<String>) -> Self {
        Self(html.into())
    }

    /// A fixed piece, or nothing.
    pub fn when(condition: bool, html: &'static str) -> Self {
        Self(if condition { html } else { "" }.to_owned())
    }

    /// The HTML as a string.
    pub fn into_string(self) -> String {
        self.0
    }
}

impl FromIterator<Html> for Html {
    fn from_iter<I: IntoIterator<Item = Html>>(pieces: I) -> Self {
        Self(pieces.into_iter().map(|piece| piece.0).collect())
    }
}

/// Anything that can be put into a piece of HTML.
pub trait Shown {
    /// Write it: HTML unchanged, text escaped, numbers as the formatter says.
    fn show(&self, out: &mut Formatter<'_>) -> Result;
}

impl Shown for Html {
    fn show(&self, out: &mut Formatter<'_>) -> Result {
        out.write_str(&self.0)
    }
}

impl Shown for str {
    fn show(&self, out: &mut Formatter<'_>) -> Result {
        for character in self.chars() {
            match character {
                '"' | '&' | '\'' | '<' | '>' => write!(out, "&#{};", u32::from(character))?,
                _ if misleads(character) => write!(out, "{}", character.escape_unicode())?,
                _ => out.write_char(character)?,
            }
        }
        Ok(())
    }
}

impl Shown for String {
    fn show(&self, out: &mut Formatter<'_>) -> Result {
        self.as_str().show(out)
    }
}

impl<T: Shown + ?Sized> Shown for &T {
    fn show(&self, out: &mut Formatter<'_>) -> Result {
        (**self).show(out)
    }
}

/// `None` becomes nothing.
impl<T: Shown> Shown for Option<T> {
    fn show(&self, out: &mut Formatter<'_>) -> Result {
        self.iter().try_for_each(|shown| shown.show(out))
    }
}

macro_rules! numbers {
    ($($kind:ty)*) => {$(
        impl Shown for $kind {
            fn show(&self, out: &mut Formatter<'_>) -> Result {
                self.fmt(out)
            }
        }
    )*};
}

numbers!(f32 f64 i64 u32 u64 usize);

/// A value in a placeholder; created by [`html!`](crate::html!).
#[doc(hidden)]
pub struct Placed<'a, T: ?Sized>(pub &'a T);

impl<T: Shown + ?Sized> Display for Placed<'_, T> {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        self.0.show(out)
    }
}

/// A piece of HTML, like `format!`, with a name and a value for each `{name}`.
#[macro_export]
macro_rules! html {
    ($text:literal $(, $name:ident = $value:expr)* $(,)?) => {
        // `concat` keeps `format!` from capturing variables, so that nothing bypasses the escaping.
        $crate::html::Html::trusted(format!(concat!($text) $(, $name = $crate::html::Placed(&$value))*))
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        let text = String::from("<b title='\"'> & co");
        let inner = html!("<i>{text}</i>", text = text);
        let outer = html!(
            "<p id=\"{id}\">{inner}{none}</p>",
            id = text,
            inner = inner,
            none = None::<Html>
        );
        assert_eq!(inner.0, "<i>&#60;b title=&#39;&#34;&#39;&#62; &#38; co</i>");
        assert!(outer.0.ends_with(&format!(">{}</p>", inner.0)) && !outer.0.contains("<b"));
    }

    #[test]
    fn text_turns_nothing_around_it() {
        let name = "gnp\u{202e}exe\u{1b}[2J";
        assert_eq!(html!("{x}", x = name).0, "gnp\\u{202e}exe\\u{1b}[2J");
    }

    #[test]
    fn numbers_are_formatted() {
        assert_eq!(html!("{x:.1} {n}", x = 2.25f64, n = 3u32).0, "2.2 3");
        assert_eq!(
            ["a", "<"].iter().map(|s| html!("{s},", s = s)).collect::<Html>().0,
            "a,&#60;,"
        );
    }
}
