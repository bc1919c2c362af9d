//! Wavefront MTL: materials of OBJ files, as written.

use super::Flaw;

/// One material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    pub name: String,
    pub diffuse: Option<[f64; 3]>,
    pub specular: Option<[f64; 3]>,
    pub emission: Option<[f64; 3]>,
    /// Colour of transmitted light.
    pub filter: Option<[f64; 3]>,
    /// Phong exponent.
    pub shininess: Option<f64>,
    pub ior: Option<f64>,
    /// Share of light that interacts with the surface.
    pub opacity: Option<f64>,
    pub illumination: Option<f64>,
    pub roughness: Option<f64>,
    pub metallic: Option<f64>,
    pub diffuse_map: Option<Map>,
    pub emission_map: Option<Map>,
    pub opacity_map: Option<Map>,
    pub bump: Option<Map>,
    pub normal_map: Option<Map>,
    /// Ignored statements.
    pub left_out: Vec<String>,
}

/// An image and its placement on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Path relative to the .mtl file, with slashes.
    pub file: String,
    /// Line that names it, from one.
    pub line: usize,
    pub scale: [f64; 2],
    pub offset: [f64; 2],
    pub clamp: bool,
    /// Factor on heights.
    pub bump: f64,
    pub channel: Option<&'static str>,
    /// Ignored options that would change it.
    pub left_out: Vec<&'static str>,
}

impl Material {
    /// Its images.
    pub fn maps(&self) -> impl Iterator<Item = &Map> {
        let all = [
            &self.diffuse_map,
            &self.emission_map,
            &self.opacity_map,
            &self.bump,
            &self.normal_map,
        ];
        all.into_iter().flatten()
    }
}

/// Read the materials of a file. Unknown statements are ignored.
pub fn read(bytes: &[u8]) -> Result<Vec<Material>, Flaw> {
    let bytes = bytes.strip_prefix(super::mesh::BYTE_ORDER_MARK).unwrap_or(bytes);
    let text = String::from_utf8_lossy(bytes);
    let mut materials: Vec<Material> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let flaw = |message: String| Flaw {
            line: Some(i + 1),
            message: format!("{keyword}: {message}"),
        };
        if keyword.eq_ignore_ascii_case("newmtl") {
            materials.push(Material {
                name: rest.to_owned(),
                ..Material::default()
            });
        } else if let Some(material) = materials.last_mut() {
            statement(material, keyword, rest, i + 1).map_err(flaw)?;
        }
    }
    Ok(materials)
}

fn statement(material: &mut Material, keyword: &str, rest: &str, line: usize) -> Result<(), String> {
    let mut left_out = Vec::new();
    let unit = |color: [f64; 3]| match color.iter().all(|c| (0.0..=1.0).contains(c)) {
        true => Ok(Some(color)),
        false => Err(format!("expected numbers from 0 to 1, found `{rest}`")),
    };
    let mut map = |rest: &str| {
        let map = map(rest, line)?;
        left_out.extend(map.left_out.iter().map(|option| format!("{keyword} {option}")));
        Ok::<_, String>(map)
    };
    match keyword.to_ascii_lowercase().as_str() {
        "kd" => material.diffuse = unit(color(rest)?)?,
        "ks" => material.specular = Some(color(rest)?),
        "ke" => material.emission = Some(color(rest)?),
        "tf" => material.filter = unit(color(rest)?)?,
        "ns" => material.shininess = Some(number(rest)?),
        "ni" => material.ior = Some(number(rest)?),
        "illum" => material.illumination = Some(number(rest)?),
        "pr" => material.roughness = Some(number(rest)?.min(1.0)),
        "pm" => material.metallic = Some(number(rest)?.min(1.0)),
        // In files with both, `d` is the correct one.
        "d" => material.opacity = Some(number(rest.trim_start_matches("-halo"))?.min(1.0)),
        "tr" if material.opacity.is_none() => material.opacity = Some(1.0 - number(rest)?.min(1.0)),
        "map_kd" => material.diffuse_map = Some(map(rest)?),
        "map_ke" => material.emission_map = Some(map(rest)?),
        "map_d" => material.opacity_map = Some(map(rest)?),
        "map_bump" | "bump" => material.bump = Some(map(rest)?),
        "norm" => material.normal_map = Some(map(rest)?),
        word if word.starts_with("map_") || ["disp", "decal", "refl"].contains(&word) => {
            material.left_out.push(keyword.to_owned());
        }
        _ => {}
    }
    material.left_out.extend(left_out);
    Ok(())
}

fn number(text: &str) -> Result<f64, String> {
    let expected = || format!("expected a number that is not negative, found `{text}`");
    let number: f64 = text
        .split_whitespace()
        .next()
        .and_then(|word| word.parse().ok())
        .ok_or_else(expected)?;
    match number.is_finite() && number >= 0.0 {
        true => Ok(number),
        false => Err(expected()),
    }
}

/// Three numbers, or one for a grey.
fn color(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let color = match numbers[..] {
        [grey] => [grey; 3],
        [r, g, b, ..] => [r, g, b],
        _ => [f64::NAN; 3],
    };
    match color.iter().all(|c| c.is_finite() && *c >= 0.0) {
        true => Ok(color),
        false => Err(format!("expected three numbers that are not negative, found `{text}`")),
    }
}

/// Options and a file name, which may contain spaces.
fn map(text: &str, line: usize) -> Result<Map, String> {
    let mut map = Map {
        file: String::new(),
        line,
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
        bump: 1.0,
        channel: None,
        left_out: Vec::new(),
    };
    let mut rest = text;
    while let Some(option) = rest.strip_prefix('-') {
        let (name, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        rest = after.trim_start();
        let word = |rest: &mut &str| {
            let (word, after) = rest.split_once(char::is_whitespace)?;
            *rest = after.trim_start();
            Some(word.to_owned())
        };
        // Up to three numbers; trailing ones may be missing.
        let numbers = |rest: &mut &str, most: usize| {
            let mut found = Vec::new();
            while found.len() < most
                && let Some((first, after)) = rest.split_once(char::is_whitespace)
                && let Ok(number) = first.parse::<f64>()
            {
                found.push(number);
                *rest = after.trim_start();
            }
            found
        };
        match name {
            "s" | "o" => {
                let slot = if name == "s" { &mut map.scale } else { &mut map.offset };
                for (slot, number) in slot.iter_mut().zip(numbers(&mut rest, 3)) {
                    *slot = number;
                }
            }
            "t" => {
                if numbers(&mut rest, 3).iter().any(|x| *x != 0.0) {
                    map.left_out.push("-t");
                }
            }
            "mm" => {
                let given = numbers(&mut rest, 2);
                if given.iter().zip([0.0, 1.0]).any(|(x, neutral)| *x != neutral) {
                    map.left_out.push("-mm");
                }
            }
            "bm" => map.bump = numbers(&mut rest, 1).first().copied().unwrap_or(1.0),
            "clamp" => map.clamp = word(&mut rest).as_deref() == Some("on"),
            "imfchan" => {
                map.channel = match word(&mut rest).as_deref() {
                    Some("r") => Some("r"),
                    Some("g") => Some("g"),
                    Some("b") => Some("b"),
                    Some("m") => Some("a"),
                    _ => Some("luminance"),
                }
            }
            "blendu" | "blendv" | "boost" | "cc" | "texres" | "type" => drop(word(&mut rest)),
            _ => return Err(format!("`-{name}` is no option of a map")),
        }
    }
    map.file = rest.trim().trim_matches('"').replace('\\', "/");
    let is_number = [map.scale, map.offset].as_flattened().iter().all(|x| x.is_finite()) && map.bump.is_finite();
    match map.file.is_empty() || !is_number {
        true => Err(format!("expected the name of an image, found `{text}`")),
        false => Ok(map),
    }
}

/// The path of `file`, which the file at `path` names.
pub fn beside(path: &str, file: &str) -> String {
    super::gltf::beside(path, &file.replace('\\', "/"))
}

/// Images of a file's materials, each once, with the lines that name them.
pub fn files(bytes: &[u8]) -> Result<Vec<(usize, String)>, Flaw> {
    let materials = read(bytes)?;
    let maps = materials.iter().flat_map(Material::maps);
    Ok(maps.map(|map| (map.line, map.file.clone())).collect())
}
