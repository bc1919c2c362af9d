//! Worker identities, independent of the names workers give themselves.

use std::fmt;
use std::str::FromStr;

/// Size of a worker's secret, bytes.
const BYTES: usize = 32;

/// The secret that identifies a worker to coordinators. Nobody without it can pass for that worker, and a worker that
/// loses it counts as new. Like a password, it is sent to coordinators only and never displayed.
#[derive(Clone, PartialEq, Eq)]
pub struct Identity([u8; BYTES]);

impl Identity {
    /// A new random identity.
    ///
    /// # Errors
    /// No random numbers are available.
    pub fn random() -> Result<Self, String> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| format!("this machine has no random numbers: {error}"))?;
        Ok(Self(bytes))
    }

    /// From its bytes; `None` if their number is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        bytes.try_into().ok().map(Self)
    }

    /// The secret itself, for coordinators and for the file that stores it.
    pub fn reveal(&self) -> &[u8] {
        &self.0
    }

    /// A public fingerprint, which reveals nothing about the secret.
    pub fn fingerprint(&self) -> Fingerprint {
        let hash = blake3::derive_key("beamfarm 2026 fingerprint of a worker's identity", &self.0);
        let mut bytes = [0; 16];
        bytes.copy_from_slice(&hash[..16]);
        Fingerprint(bytes)
    }
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Identity(..)")
    }
}

/// Identifies a worker's [`Identity`] publicly, for people and for stored job data, as 32 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fingerprint([u8; 16]);

impl Fingerprint {
    /// Its first digits, enough to tell a farm's workers apart.
    pub fn short(&self) -> String {
        let mut text = self.to_string();
        text.truncate(8);
        text
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Fingerprint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no fingerprint; expected 32 hexadecimal digits");
        if text.len() != 32 || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        u128::from_str_radix(text, 16)
            .map(|value| Self(value.to_be_bytes()))
            .map_err(|_| wrong())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprints_are_read_as_they_are_written() {
        let [one, other] = [(); 2].map(|()| Identity::random().unwrap());
        let fingerprint = one.fingerprint();
        assert_eq!(fingerprint.to_string().parse(), Ok(fingerprint));
        assert_ne!(fingerprint, other.fingerprint());
        assert_eq!(Identity::from_bytes(one.reveal()), Some(one.clone()));
        assert_eq!(Identity::from_bytes(&one.reveal()[1..]), None);
        assert_eq!(format!("{one:?}"), "Identity(..)");
        for wrong in ["", "12", "+2345678901234567890123456789012", &"g".repeat(32)] {
            assert!(wrong.parse::<Fingerprint>().is_err());
        }
    }
}
