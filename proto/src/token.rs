//! The secret that both sides may share, as written in files and in the environment.

use std::fmt;
use std::io::Read;
use std::path::Path;

/// The environment variable that may hold it.
pub const TOKEN_VARIABLE: &str = "BEAMFARM_TOKEN";
/// Fewest characters: 16 random ones of 64 kinds are 96 bits.
const SHORTEST: usize = 16;
/// Most characters, so that it fits in a header.
const LONGEST: usize = 1024;

/// A bearer token: 16 to 1024 visible ASCII characters. Compared in constant time and never displayed.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// The token in this text. Surrounding white space, as editors leave it, is ignored.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if !(SHORTEST..=LONGEST).contains(&text.len()) {
            return Err(format!(
                "a token of {} characters; expected {SHORTEST} to {LONGEST}, as `openssl rand -hex 32` makes them",
                text.len()
            ));
        }
        // HTTP Basic splits at the first colon, which ends the user name, so the password may contain colons.
        if !text.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err("expected one word of visible ASCII characters as token".into());
        }
        Ok(Self(text.into()))
    }

    /// The token in this file, or without a file the one in `BEAMFARM_TOKEN`; none if that is unset or empty.
    pub fn read(file: Option<&Path>) -> Result<Option<Self>, String> {
        let (place, text) = match file {
            Some(file) => {
                let place = file.display().to_string();
                let text = read_short(file);
                (place.clone(), text.map_err(|error| format!("{place}: {error}"))?)
            }
            None => match std::env::var(TOKEN_VARIABLE) {
                Ok(text) if text.is_empty() => return Ok(None),
                Ok(text) => (TOKEN_VARIABLE.into(), text),
                Err(std::env::VarError::NotPresent) => return Ok(None),
                Err(error) => return Err(format!("{TOKEN_VARIABLE}: {error}")),
            },
        };
        let token = Self::parse(&text).map_err(|message| format!("{place}: {message}"))?;
        Ok(Some(token))
    }

    /// A random token that cannot be guessed.
    pub fn random() -> Result<Self, String> {
        let halves = [getrandom::u64(), getrandom::u64()];
        let [Ok(a), Ok(b)] = halves else {
            return Err("this machine has no random numbers".into());
        };
        Ok(Self(format!("{a:016x}{b:016x}")))
    }

    /// The token itself, for those who must know it. Never for a log.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// The value of the `authorization` header.
    pub fn bearer(&self) -> String {
        format!("Bearer {}", self.0)
    }

    /// Whether `given` is this token. Hashes are compared, in constant time, so that the time does not reveal where
    /// they differ.
    pub fn matches(&self, given: &[u8]) -> bool {
        blake3::hash(self.0.as_bytes()) == blake3::hash(given)
    }
}

/// The text of a file, cut off beyond the length of any token, since it may be an endless device.
fn read_short(file: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    let most = 4 * LONGEST as u64;
    std::fs::File::open(file)?.take(most).read_to_string(&mut text)?;
    Ok(text)
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "0123456789abcdef";

    #[test]
    fn random_ones_are_tokens_and_differ() {
        let tokens = [(); 2].map(|()| Token::random().unwrap());
        assert!(tokens.iter().all(|token| Token::parse(token.reveal()).is_ok()));
        assert!(!tokens[0].matches(tokens[1].reveal().as_bytes()));
    }

    #[test]
    fn tokens_are_words_of_some_length() {
        let token = Token::parse(&format!(" {GOOD}\r\n")).unwrap();
        assert!(token.matches(GOOD.as_bytes()));
        assert_eq!(token.bearer(), format!("Bearer {GOOD}"));
        for wrong in [&GOOD[..15], &GOOD[1..], "", "0123456789abcdeF"] {
            assert!(!token.matches(wrong.as_bytes()));
        }
        assert!(!token.matches(format!("{GOOD}0").as_bytes()));
        let long = "x".repeat(1025);
        for bad in ["", "short", "0123456789 abcdef", "0123456789abcdéf", &long] {
            assert!(Token::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn no_message_shows_the_token() {
        let token = Token::parse(GOOD).unwrap();
        assert!(!format!("{token:?}").contains(GOOD));
        let two = format!("{GOOD} secret");
        assert!(!Token::parse(&two).unwrap_err().contains("secret"));
    }

    #[test]
    fn a_file_holds_one() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        assert!(Token::read(Some(&file)).unwrap_err().contains("token"));
        std::fs::write(&file, format!("{GOOD}\n")).unwrap();
        let token = Token::read(Some(&file)).unwrap().unwrap();
        assert!(token.matches(GOOD.as_bytes()));
    }

    #[cfg(unix)]
    #[test]
    fn a_file_without_an_end_is_no_token() {
        let error = Token::read(Some(Path::new("/dev/zero"))).unwrap_err();
        assert!(error.contains("/dev/zero: a token of 4096 characters"), "{error}");
    }
}
