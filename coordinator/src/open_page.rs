//! Prints a page's address and opens it in a browser.

use beamfarm_coordinator::security::ENTER;
use beamfarm_proto::Token;
use beamfarm_worker::complain;
use std::io::{IsTerminal, Write};

/// Open the page. Its link contains the token, and program arguments are visible to everyone. The browser therefore
/// gets a private file that redirects there; dropping the value removes it.
pub fn open_page(url: &str, token: &Token) -> Option<tempfile::NamedTempFile> {
    let make = || {
        let mut file = tempfile::Builder::new()
            .prefix("beamfarm-")
            .suffix(".html")
            .tempfile()?;
        let link = format!("{url}{ENTER}#{}", token.reveal());
        writeln!(
            file,
            "<!doctype html><meta http-equiv=\"refresh\" content=\"0; url={link}\"><a href=\"{link}\">The job</a>"
        )?;
        open::that_detached(file.path())?;
        Ok::<_, std::io::Error>(file)
    };
    match make() {
        Ok(file) => Some(file),
        Err(error) => {
            complain!("warning: no browser can be opened: {error}");
            None
        }
    }
}

/// Print the page's address with the token, wherever the output goes.
pub fn tell_whole_page(url: &str, token: &Token) {
    complain!("page: {url}{ENTER}#{}", token.reveal());
}

/// Print the page's address; with the token only on a terminal, where it is not stored.
pub fn tell_page(url: &str, token: &Token) {
    match std::io::stderr().is_terminal() {
        true => tell_whole_page(url, token),
        false => complain!("page: {url}/"),
    }
}
