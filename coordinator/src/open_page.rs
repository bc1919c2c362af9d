//! Where a page is, told to people and to their browser.

use beamfarm_coordinator::security::ENTER;
use beamfarm_proto::Token;
use beamfarm_worker::complain;
use std::io::{IsTerminal, Write};

/// Open the page. Its link holds the token, and what programs are started with is for all to see: the browser gets a
/// file that leads there, and that nobody else can read. It is removed with the value.
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

/// Say where the page is, with what opens it, wherever that is written.
pub fn tell_whole_page(url: &str, token: &Token) {
    complain!("page: {url}{ENTER}#{}", token.reveal());
}

/// Say where the job can be watched: to people with what opens it, but not where it would stay in a file.
pub fn tell_page(url: &str, token: &Token) {
    match std::io::stderr().is_terminal() {
        true => tell_whole_page(url, token),
        false => complain!("page: {url}/"),
    }
}
