//! Listen addresses from the command line.

use std::net::{SocketAddr, TcpListener, ToSocketAddrs};

const EXPECTED: &str = "expected ADDR:PORT or NAME:PORT, as in 127.0.0.1:7325, [::1]:7325 or localhost:0";

/// Parse an address and port, or a name and port. The name is resolved.
///
/// If a name has several addresses, the first that belongs to this machine is used, IPv4 before IPv6; without any, the
/// first.
pub fn listen(text: &str) -> Result<SocketAddr, String> {
    if let Ok(address) = text.parse() {
        return Ok(address);
    }
    let (name, port) = text.rsplit_once(':').ok_or(EXPECTED)?;
    if name.contains(':') && !name.starts_with('[') {
        return Err(format!("an IPv6 address stands in brackets: {EXPECTED}"));
    }
    let port: u16 = port
        .parse()
        .map_err(|_| format!("{port:?} is no port from 0 to 65535: {EXPECTED}"))?;
    if name.is_empty() || name.starts_with('[') {
        return Err(EXPECTED.into());
    }
    let found = (name, port).to_socket_addrs();
    let mut found: Vec<SocketAddr> = found
        .map_err(|error| format!("the name {name:?} cannot be resolved: {error}"))?
        .collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    let is_own = |address: &&SocketAddr| TcpListener::bind((address.ip(), 0)).is_ok();
    let first = found.iter().find(is_own).or(found.first());
    first
        .copied()
        .ok_or_else(|| format!("the name {name:?} has no address"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_taken_and_names_resolved() {
        for text in ["127.0.0.1:7325", "0.0.0.0:0", "[::1]:0", "[::]:80"] {
            assert_eq!(listen(text), Ok(text.parse().unwrap()));
        }
        let own = listen("localhost:7394").unwrap();
        assert!(own.ip().is_loopback() && own.port() == 7394, "{own}");
    }

    #[test]
    fn what_is_none_is_told_with_what_was_expected() {
        let refused = |text: &str, words: &str| {
            let said = listen(text).unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        };
        for text in ["", "localhost", "7325", ":7325", "[::1:7325", "[localhost]:1"] {
            refused(text, "expected ADDR:PORT or NAME:PORT");
        }
        refused("::1:7325", "stands in brackets");
        refused("localhost:", "\"\" is no port");
        refused("localhost:65536", "\"65536\" is no port from 0 to 65535");
        refused(
            "no-such-host.invalid:80",
            "the name \"no-such-host.invalid\" cannot be resolved: ",
        );
    }
}
