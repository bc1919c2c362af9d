//! What workers are known by, whatever they call themselves.

use std::fmt;
use std::str::FromStr;

/// Bytes of a worker's secret.
const BYTES: usize = 32;

/// The secret by which a worker is known at coordinators: whoever lacks it cannot be taken for that worker, and a
/// worker that loses it is a new one. As a password: it is told to coordinators alone, and never shown.
#[derive(Clone, PartialEq, Eq)]
pub struct Identity([u8; BYTES]);

impl Identity {
    /// A new one.
    ///
    /// # Errors
    /// There are no random numbers.
    pub fn random() -> Result<Self, String> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| format!("this machine has no random numbers: {error}"))?;
        Ok(Self(bytes))
    }

    /// From its bytes; `None` if they are not as many as it has.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        bytes.try_into().ok().map(Self)
    }

    /// Itself, for coordinators and for the file that keeps it.
    pub fn reveal(&self) -> &[u8] {
        &self.0
    }

    /// What it is told from others by, which says nothing about it.
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

/// What tells the [`Identity`] of a worker from all others: for people, and for what is kept of a job. 32 hexadecimal
/// digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fingerprint([u8; 16]);

impl Fingerprint {
    /// Its first digits, which tell the workers of a farm apart.
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
