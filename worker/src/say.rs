//! Output besides the work itself. If its reader is gone or the disk is full, it is dropped and the work goes on.

/// Like `println!`, but never fails, and names of files and scenes cannot control the terminal.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stdout(), "{}", $crate::visible(&text));
    }};
}

/// Like `eprintln!`, but never fails, and names of files and scenes cannot control the terminal.
#[macro_export]
macro_rules! complain {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stderr(), "{}", $crate::visible(&text));
    }};
}
