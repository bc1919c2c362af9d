//! Volume files, as far as the conversion reads them.

use super::Converter;
use super::property::Named;
use super::transform::Step;
use super::value::Value;
use super::write::{Section, Toml};
use super::xml::{Content, Id, Kind};
use super::{FileLine, cie};

/// Size of the header: "VOL", version, encoding, samples along x, y, z, channels, box.
const HEAD: usize = 48;

/// The header of a .vol file.
struct Head {
    channels: i32,
    corners: [[f64; 3]; 2],
}

impl Converter<'_> {
    /// A volume file and its transform.
    pub(super) fn grid(&mut self, id: Id) -> Option<(Toml, Vec<Step>)> {
        let place = self.objects.list[id].place;
        let file = self.member(id, "filename").map_or(place, |m| m.place);
        let asset = self.asset(id, "filename");
        if self.word(id, "filter_type", &["trilinear", "nearest"]) == Some("nearest")
            && let Some(member) = self.member(id, "filter_type")
        {
            self.unsupported(id, member, "densities without interpolation are not supported");
        }
        // Nothing is sampled outside the grid, and its values are raw numbers.
        self.ignore(id, &["wrap_mode", "raw", "accel"]);
        let mut steps = Vec::new();
        if self.boolean(id, "use_grid_bbox") == Some(true)
            && let Some((_, path)) = &asset
        {
            match self.head(path).and_then(|head| head.box_of_its_own()) {
                Ok([low, high]) => {
                    steps.push(Step::Scale(std::array::from_fn(|i| high[i] - low[i])));
                    steps.push(Step::Translate(low));
                }
                Err(reason) => {
                    let message = format!("volume \"gridvolume\": {}: {reason}", path.path.display());
                    self.log.invalid(Some(file), message);
                }
            }
        }
        steps.extend_from_slice(self.transform(id, "to_world"));
        self.finish(id);
        Some((Toml::table([("file", asset?.0)]), steps))
    }

    /// The number of channels of a volume file; `None` if it cannot be read, which is reported when it is read.
    pub(super) fn channels(&mut self, id: Id) -> Option<i32> {
        let member = self.member(id, "filename")?;
        let Content::Value(Value::String(written)) = &member.content else {
            return None;
        };
        let path = self.objects.resolve(member.place, written);
        let written = member.place.author();
        self.head(&Named { path, written }).ok().map(|head| head.channels)
    }

    /// Write a medium without effect.
    pub(super) fn nothing(&mut self, place: FileLine, section: &mut Section) {
        section.set("type", Toml::string("homogeneous"), place);
        section.set("sigma_t", Toml::Float(0.0), place);
        section.set("albedo", Toml::Float(0.0), place);
    }

    /// The colour of a `volume` texture, if it is constant.
    pub(super) fn volume_color(&mut self, id: Id, kind: cie::Kind) -> Option<[f64; 3]> {
        let place = self.objects.list[id].place;
        let nested = self.nested(id, Kind::Volume);
        self.finish(id);
        let [(member, volume)] = nested[..] else {
            return self
                .log
                .fatal(Some(place), "texture \"volume\": expected one nested volume");
        };
        if self.objects.list[volume].plugin == "constvolume" {
            let color = self.color(volume, "value", kind);
            self.ignore(volume, &["to_world"]);
            self.finish(volume);
            return color;
        }
        if self.objects.list[volume].plugin != "gridvolume" {
            self.unsupported_plugin(volume);
            return None;
        }
        let (_, path) = self.asset(volume, "filename")?;
        // The grid's placement and wrapping do not matter if it has one colour.
        self.ignore(
            volume,
            &["to_world", "filter_type", "wrap_mode", "raw", "accel", "use_grid_bbox"],
        );
        self.finish(volume);
        match self.one_color(&path) {
            Ok(Some(color)) => Some(color),
            Ok(None) => {
                let message = "texture \"volume\": a grid of different colours is not supported";
                self.log.unsupported(member.place, message);
                None
            }
            Err(reason) => {
                let message = format!("volume \"gridvolume\": {}: {reason}", path.path.display());
                self.log.fatal(Some(place), message)
            }
        }
    }

    fn head(&self, file: &Named) -> Result<Head, String> {
        head(&self.reach.start(&file.path, HEAD, file.written)?)
    }

    fn one_color(&self, file: &Named) -> Result<Option<[f64; 3]>, String> {
        one_color(&self.read(file)?)
    }
}

/// The colour shared by all samples of a .vol file, if there is one.
fn one_color(bytes: &[u8]) -> Result<Option<[f64; 3]>, String> {
    let channels = head(bytes)?.channels;
    let (samples, _) = bytes.get(HEAD..).unwrap_or_default().as_chunks::<4>();
    let samples: Vec<f64> = samples.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect();
    let cells = match channels {
        1 | 3 => samples.chunks_exact(channels as usize),
        _ => return Err(format!("{channels} channels; expected 1 or 3")),
    };
    let Some(first) = cells.clone().next() else {
        return Err("there are no samples in it".to_string());
    };
    let same = cells.into_iter().all(|cell| cell == first);
    Ok(same.then(|| std::array::from_fn(|i| first[i % first.len()])))
}

fn head(bytes: &[u8]) -> Result<Head, String> {
    let Some(bytes) = bytes.first_chunk::<HEAD>() else {
        return Err("it ends within its header".to_owned());
    };
    if !bytes.starts_with(b"VOL") {
        return Err("not a Mitsuba volume: it does not begin with \"VOL\"".to_string());
    }
    let (words, _) = bytes.as_chunks::<4>();
    let number = |i: usize| f64::from(f32::from_le_bytes(words[i]));
    Ok(Head {
        channels: i32::from_le_bytes(words[5]),
        corners: [[number(6), number(7), number(8)], [number(9), number(10), number(11)]],
    })
}

impl Head {
    /// The box stored in the file.
    fn box_of_its_own(&self) -> Result<[[f64; 3]; 2], String> {
        let [low, high] = self.corners;
        match (0..3).all(|i| low[i] < high[i] && low[i].is_finite() && high[i].is_finite()) {
            true => Ok(self.corners),
            false => Err(format!("its bounding box from {low:?} to {high:?} is empty")),
        }
    }
}
