//! What is said beside the work. Whoever reads it may have gone, or the disk that it goes to may be full: then it is
//! left out, and the work goes on.

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
