//! Photometric files: IES LM-63, of 1986 to 2019, type C.
//!
//! Keywords come first, then a line `TILT=`. If that line asks for it, a table of dimming factors by tilt follows,
//! which is ignored. Then come numbers: the description of the lamps, vertical angles (0 is straight down), horizontal
//! angles, and for each horizontal angle the candela at all vertical angles.

use super::Flaw;
use std::f64::consts::PI;

/// Measured intensities.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Radians from the axis, within [0, pi], ascending.
    pub vertical: Vec<f64>,
    /// Radians around the axis, from 0 to 2 pi, ascending.
    pub horizontal: Vec<f64>,
    /// One row of vertical angles per horizontal angle; includes the multiplier and ballast factor.
    pub candela: Vec<f64>,
}

/// Numbers that continue across lines.
struct Numbers<'t> {
    words: Box<dyn Iterator<Item = (usize, &'t str)> + 't>,
    /// Line of the last number, from one.
    line: usize,
}

fn flaw(line: usize, message: impl Into<String>) -> Flaw {
    Flaw {
        line: Some(line),
        message: message.into(),
    }
}

impl Numbers<'_> {
    fn next(&mut self, what: &str) -> Result<f64, Flaw> {
        let Some((line, word)) = self.words.next() else {
            return Err(flaw(self.line, format!("the file ends before {what}")));
        };
        self.line = line;
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(flaw(line, format!("{what}: expected a number, found {word:?}"))),
        }
    }

    /// A count of at least one.
    fn count(&mut self, what: &str) -> Result<usize, Flaw> {
        let x = self.next(what)?;
        match (1.0..=1e6).contains(&x) && x.fract() == 0.0 {
            true => Ok(x as usize),
            false => Err(flaw(
                self.line,
                format!("{what}: expected a whole number from 1 to 1000000, found {x}"),
            )),
        }
    }

    fn factor(&mut self, what: &str) -> Result<f64, Flaw> {
        let x = self.next(what)?;
        match x >= 0.0 {
            true => Ok(x),
            false => Err(flaw(
                self.line,
                format!("{what}: expected a number that is not negative, found {x}"),
            )),
        }
    }

    /// Angles in degrees, ascending in single precision too.
    fn angles(&mut self, count: usize, what: &str, most: f64) -> Result<Vec<f64>, Flaw> {
        let mut angles: Vec<f64> = Vec::new();
        for _ in 0..count {
            let angle = self.next(what)?;
            if !(0.0..=most).contains(&angle) {
                let message = format!("{what}: expected degrees from 0 to {most}, found {angle}");
                return Err(flaw(self.line, message));
            }
            if let Some(last) = angles.last()
                && last.to_radians() as f32 >= angle.to_radians() as f32
            {
                let message = format!("{what}: expected more than the {last} before it, found {angle}");
                return Err(flaw(self.line, message));
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

/// Read a file.
pub fn read(bytes: &[u8]) -> Result<Photometry, Flaw> {
    let bytes = bytes.strip_prefix(super::mesh::BYTE_ORDER_MARK).unwrap_or(bytes);
    // Keyword values may be in any encoding.
    let text = String::from_utf8_lossy(bytes);
    let mut lines = (1..).zip(text.lines());
    let tilt = lines.find_map(|(line, text)| Some((line, text.trim().strip_prefix("TILT=")?.trim())));
    let Some((line, tilt)) = tilt else {
        return Err("expected a file of IES LM-63, which has a line TILT=".into());
    };
    let is_word = |c: char| !c.is_whitespace() && c != ',';
    let words = lines.flat_map(|(line, text)| {
        let words = text.split(move |c| !is_word(c)).filter(|word| !word.is_empty());
        words.map(move |word| (line, word))
    });
    let mut numbers = Numbers {
        words: Box::new(words),
        line,
    };
    if tilt.eq_ignore_ascii_case("INCLUDE") {
        numbers.next("how the lamp lies in the luminaire")?;
        let pairs = numbers.count("number of tilts")?;
        for _ in 0..2 * pairs {
            numbers.next("tilts and their factors")?;
        }
    }
    numbers.next("number of lamps")?;
    numbers.next("lumens per lamp")?;
    let multiplier = numbers.factor("candela multiplier")?;
    let rows = numbers.count("number of vertical angles")?;
    let columns = numbers.count("number of horizontal angles")?;
    let kind = numbers.next("photometric type")?;
    if kind != 1.0 {
        let message = format!("photometric type: expected 1 (type C), found {kind}");
        return Err(flaw(numbers.line, message));
    }
    for what in ["units", "width", "length", "height"] {
        numbers.next(what)?;
    }
    let ballast = numbers.factor("ballast factor")?;
    // Before 2002 this is the ballast-lamp photometric factor; since then it is 1.
    let photometric = numbers.factor("the factor after the ballast's")?;
    numbers.next("input watts")?;
    let vertical = numbers.angles(rows, "vertical angles", 180.0)?;
    if rows < 2 {
        return Err(flaw(numbers.line, "expected at least two vertical angles"));
    }
    let horizontal = numbers.angles(columns, "horizontal angles", 360.0)?;
    let factor = multiplier * ballast * photometric;
    let mut given: Vec<Vec<f64>> = Vec::new();
    for _ in 0..columns {
        let mut of_angle = Vec::new();
        for _ in 0..rows {
            let candela = numbers.factor("candela")? * factor;
            if candela > 1e30 {
                return Err(flaw(numbers.line, "candela: times their factors they are above 1e30"));
            }
            of_angle.push(candela);
        }
        given.push(of_angle);
    }
    let whole = all_around(&horizontal).ok_or_else(|| {
        let range = match &horizontal[..] {
            [only] => format!("{only} alone"),
            [first, .., last] => format!("{first} to {last}"),
            [] => String::new(),
        };
        flaw(
            line,
            format!(
                "horizontal angles: expected 0 alone, or from 0 to 90, 180 or 360, or from 90 to 270; found {range}"
            ),
        )
    })?;
    let at = |row: usize| {
        let given = &given;
        whole.iter().map(move |(_, column)| given[*column][row])
    };
    Ok(Photometry {
        candela: (0..rows).flat_map(at).collect(),
        vertical: vertical.iter().map(|angle| angle.to_radians()).collect(),
        horizontal: whole.iter().map(|(degrees, _)| degrees / 180.0 * PI).collect(),
    })
}

/// Horizontal angles from 0 to 360 degrees, each with the index of the given angle that it equals. Files give only part
/// of the circle for symmetric luminaires.
fn all_around(given: &[f64]) -> Option<Vec<(f64, usize)>> {
    let (first, last) = (*given.first()?, *given.last()?);
    let numbered = || given.iter().copied().zip(0..);
    let mut all: Vec<(f64, usize)> = match (first, last) {
        _ if given.len() == 1 => return Some(vec![(0.0, 0), (360.0, 0)]),
        (0.0, 90.0) => {
            let quarters = [0.0, 1.0, 2.0, 3.0].into_iter().flat_map(|quarter| {
                numbered().map(move |(angle, number)| match quarter {
                    0.0 | 2.0 => (90.0 * quarter + angle, number),
                    _ => (90.0 * (quarter + 1.0) - angle, number),
                })
            });
            quarters.collect()
        }
        (0.0, 180.0) => numbered()
            .flat_map(|(angle, number)| [(angle, number), (360.0 - angle, number)])
            .collect(),
        // Mirrored at the plane through 90 and 270 degrees.
        (90.0, 270.0) => {
            let other = |angle: f64| if angle <= 180.0 { 180.0 - angle } else { 540.0 - angle };
            let both = numbered().flat_map(|(angle, number)| [(angle, number), (other(angle), number)]);
            let mut all: Vec<(f64, usize)> = both.collect();
            // The values at 180 are also those at 0 and 360.
            if let Some((_, number)) = numbered().find(|(angle, _)| *angle == 180.0) {
                all.push((360.0, number));
            }
            all
        }
        (0.0, 360.0) => numbered().collect(),
        // A full circle without its last angle.
        (0.0, last) if last > 180.0 => numbered().chain([(360.0, 0)]).collect(),
        _ => return None,
    };
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by(|a, b| a.0 as f32 == b.0 as f32);
    let is_whole = all.first().is_some_and(|a| a.0 == 0.0) && all.last().is_some_and(|a| a.0 == 360.0);
    is_whole.then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(head: &str, horizontal: &[f64], candela: impl Fn(f64, f64) -> f64) -> String {
        let vertical = [0.0, 45.0, 90.0];
        let mut text = format!(
            "IESNA:LM-63-1995\n[TEST] none\n{head}\n1 1000 2.0 3 {} 1 2 0.1 0.1 0\n0.5, 1.0 100\n0 45 90\n",
            horizontal.len()
        );
        for angle in horizontal {
            text += &format!("{angle} ");
        }
        for angle in horizontal {
            text += "\n";
            for v in vertical {
                text += &format!("{} ", candela(v, *angle));
            }
        }
        text
    }

    fn value(of: &Photometry, vertical: usize, degrees: f64) -> Option<f64> {
        let column = of
            .horizontal
            .iter()
            .position(|angle| (angle.to_degrees() - degrees).abs() < 1e-9)?;
        Some(of.candela[vertical * of.horizontal.len() + column])
    }

    #[test]
    fn symmetric_lamps_are_whole() {
        let degrees = |of: &Photometry| {
            of.horizontal
                .iter()
                .map(|angle| angle.to_degrees().round())
                .collect::<Vec<f64>>()
        };
        let candela = |v: f64, h: f64| v + h;
        let round = read(file("TILT=NONE", &[0.0], candela).as_bytes()).unwrap();
        assert_eq!(
            (degrees(&round), value(&round, 1, 360.0)),
            (vec![0.0, 360.0], Some(45.0))
        );
        let quarter = read(file("TILT=NONE", &[0.0, 30.0, 90.0], candela).as_bytes()).unwrap();
        assert_eq!(
            degrees(&quarter),
            [0.0, 30.0, 90.0, 150.0, 180.0, 210.0, 270.0, 330.0, 360.0]
        );
        for (at, like) in [(150.0, 30.0), (210.0, 30.0), (330.0, 30.0), (270.0, 90.0), (180.0, 0.0)] {
            assert_eq!(value(&quarter, 2, at), Some(90.0 + like));
        }
        let half = read(file("TILT=NONE", &[0.0, 30.0, 180.0], candela).as_bytes()).unwrap();
        assert_eq!(
            (value(&half, 0, 330.0), value(&half, 0, 180.0)),
            (Some(30.0), Some(180.0))
        );
        let side = read(file("TILT=NONE", &[90.0, 100.0, 180.0, 270.0], candela).as_bytes()).unwrap();
        assert_eq!(degrees(&side), [0.0, 80.0, 90.0, 100.0, 180.0, 270.0, 360.0]);
        assert_eq!(
            (value(&side, 0, 80.0), value(&side, 0, 360.0)),
            (Some(100.0), Some(180.0))
        );
        let open = read(file("TILT=NONE", &[0.0, 120.0, 240.0], candela).as_bytes()).unwrap();
        assert_eq!(
            (degrees(&open), value(&open, 0, 360.0)),
            (vec![0.0, 120.0, 240.0, 360.0], Some(0.0))
        );
        // Doubled by the multiplier, halved by the ballast factor.
        let tilted = "TILT=INCLUDE\n1\n3\n0 45 90\n1.0 0.9 0.8";
        assert_eq!(read(file(tilted, &[0.0], candela).as_bytes()).unwrap(), round);
    }

    #[test]
    fn what_is_wrong_is_told_by_line() {
        let good = file("TILT=NONE", &[0.0, 90.0], |v, h| v + h);
        for (from, to, line, words) in [
            ("TILT=NONE", "TILT", None, "TILT="),
            (
                "1 1000",
                "1 many",
                Some(4),
                "lumens per lamp: expected a number, found \"many\"",
            ),
            ("3 2 1 2", "3 2 2 2", Some(4), "expected 1 (type C), found 2"),
            (
                "3 2 1 2",
                "3.5 2 1 2",
                Some(4),
                "number of vertical angles: expected a whole number",
            ),
            (
                "0 45 90",
                "0 45 45",
                Some(6),
                "expected more than the 45 before it, found 45",
            ),
            (
                "0 45 90",
                "0 45 190",
                Some(6),
                "expected degrees from 0 to 180, found 190",
            ),
            ("\n0 90 ", "\n0 91 ", Some(3), "found 0 to 91"),
            ("\n0 45 90 \n", "\n0 -45 90 \n", Some(8), "not negative, found -45"),
        ] {
            let text = good.replacen(from, to, 1);
            assert_ne!(text, good, "{from}");
            let flaw = read(text.as_bytes()).unwrap_err();
            assert!(flaw.line == line && flaw.message.contains(words), "{from}: {flaw:?}");
        }
        for end in 0..good.len() {
            let whole = read(&good.as_bytes()[..end]);
            assert!(whole.is_err() || end >= good.trim_end().len() - 2, "{end}");
        }
    }

    #[test]
    fn damaged_files_are_no_panic() {
        let good = file("TILT=INCLUDE\n1\n1\n0\n1", &[0.0, 90.0], |v, h| v + h);
        crate::assets::damage::damage(&[good.into_bytes()], |bytes| drop(read(bytes)));
    }
}
