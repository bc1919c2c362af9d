//! A sequential reader of binary files. Every length is checked against the rest of the file.

use super::Flaw;

/// The unread rest of a file. Numbers are little-endian.
#[derive(Clone, Copy)]
pub struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(all: &'a [u8]) -> Self {
        Self { all, at: 0 }
    }

    /// Offset of the next byte from the start of the file.
    pub fn position(&self) -> usize {
        self.at
    }

    /// Number of remaining bytes.
    pub fn left(&self) -> usize {
        self.all.len() - self.at
    }

    /// Move to an offset from the start of the file.
    pub fn seek(&mut self, offset: u64, what: &str) -> Result<(), Flaw> {
        let inside = usize::try_from(offset).ok().filter(|o| *o <= self.all.len());
        self.at = inside.ok_or_else(|| {
            format!(
                "{what} should be at byte {offset}, but the file has {} bytes",
                self.all.len()
            )
        })?;
        Ok(())
    }

    /// The next bytes.
    pub fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], Flaw> {
        let rest = self.all.get(self.at..).unwrap_or_default();
        let taken = rest.get(..count).ok_or_else(|| {
            format!(
                "the file ends within {what}: {count} bytes expected at byte {}, {} left",
                self.at,
                rest.len()
            )
        })?;
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Flaw> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    pub fn u8(&mut self, what: &str) -> Result<u8, Flaw> {
        Ok(u8::from_le_bytes(self.array(what)?))
    }

    pub fn u32(&mut self, what: &str) -> Result<u32, Flaw> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    pub fn i32(&mut self, what: &str) -> Result<i32, Flaw> {
        Ok(i32::from_le_bytes(self.array(what)?))
    }

    pub fn u64(&mut self, what: &str) -> Result<u64, Flaw> {
        Ok(u64::from_le_bytes(self.array(what)?))
    }

    pub fn i64(&mut self, what: &str) -> Result<i64, Flaw> {
        Ok(i64::from_le_bytes(self.array(what)?))
    }

    pub fn f64(&mut self, what: &str) -> Result<f64, Flaw> {
        Ok(f64::from_le_bytes(self.array(what)?))
    }

    pub fn i32s<const N: usize>(&mut self, what: &str) -> Result<[i32; N], Flaw> {
        let mut numbers = [0; N];
        for number in &mut numbers {
            *number = self.i32(what)?;
        }
        Ok(numbers)
    }

    /// Bytes preceded by their count.
    pub fn counted(&mut self, what: &str) -> Result<&'a [u8], Flaw> {
        let count = self.u32(what)?;
        self.take(count as usize, what)
    }

    /// A count of things that take at least `least` bytes each.
    pub fn count(&mut self, least: usize, what: &str) -> Result<usize, Flaw> {
        let at = self.at;
        let count = self.u32(what)? as usize;
        if count > self.left() / least {
            return Err(format!(
                "{count} {what} are claimed at byte {at}, but only {} bytes follow",
                self.left()
            )
            .into());
        }
        Ok(count)
    }
}
