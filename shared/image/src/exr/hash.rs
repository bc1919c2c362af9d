//! Hashes of pictures' contents.

use crate::film::Film;
use crate::merge::Node;

/// BLAKE3, in hexadecimal, of width, height and the pixels' bits, all little-endian. Equal for equal pictures in any
/// files.
pub fn pixel_hash(film: &Film) -> String {
    let mut hasher = blake3::Hasher::new();
    add_to_hash(film, &mut hasher);
    hasher.finalize().to_string()
}

/// BLAKE3 of everything that a block adds to an image, in the same form: its sum and layers and, for more than one
/// pass, its squared differences and [`RadiusSums`](crate::bias::RadiusSums), which for one pass follow from the rest.
///
/// For one pass without layers, this is the [`pixel_hash`].
pub fn node_hash(node: &Node) -> [u8; 32] {
    node_hashes(node).1
}

/// [`pixel_hash`] of the sum, and [`node_hash`]: the first is a step towards the second.
pub fn node_hashes(node: &Node) -> (String, [u8; 32]) {
    let mut hasher = blake3::Hasher::new();
    add_to_hash(&node.sum, &mut hasher);
    let pixels = hasher.finalize().to_string();
    for layer in &node.layers {
        add_to_hash(layer, &mut hasher);
    }
    for matte in &node.mattes {
        for entries in matte.by_pixel() {
            hasher.update(&(entries.len() as u32).to_le_bytes());
            for entry in entries {
                hasher.update(&entry.id.to_le_bytes());
                hasher.update(&entry.passes.to_le_bytes());
            }
        }
    }
    if node.block.level > 0 {
        add_to_hash(&node.squared_difference, &mut hasher);
        if let Some(sums) = &node.radius_sums {
            hasher.update(&sums.to_bytes());
        }
    }
    (pixels, *hasher.finalize().as_bytes())
}

const HASHED_AT_ONCE: usize = 1 << 16;

fn add_to_hash(film: &Film, hasher: &mut blake3::Hasher) {
    hasher.update(&film.width.to_le_bytes());
    hasher.update(&film.height.to_le_bytes());
    // In large pieces, for which the hash is fastest.
    let mut bytes = Vec::new();
    for values in film.pixels.as_flattened().chunks(HASHED_AT_ONCE) {
        bytes.clear();
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        hasher.update(&bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_hash_is_of_all_that_a_block_adds() {
        let film = |value: f32| Film {
            pixels: vec![[value, 1.0, 2.0]; 6],
            ..Film::new(2, 3)
        };
        let leaf = |pass: u64, value: f32| {
            let leaf = Node::leaf(pass, film(value));
            leaf.with_radius_scale(1.0 / (pass + 1) as f64)
        };
        let (pixels, hash) = node_hashes(&leaf(5, 3.0));
        assert_eq!(pixels, pixel_hash(&film(3.0)));
        assert_eq!(blake3::Hash::from_bytes(hash).to_string(), pixels);
        let layered = leaf(5, 3.0).with_layers(vec![film(4.0)]);
        assert_eq!(node_hashes(&layered).0, pixels);
        assert_ne!(node_hash(&layered), hash);

        let pair = |left, right| Node::join(leaf(4, left), leaf(5, right)).unwrap();
        let known = pair(3.0, 5.0);
        assert_eq!(node_hash(&known), node_hash(&pair(3.0, 5.0)));
        // The same sum from other passes.
        let other = pair(2.0, 6.0);
        assert_eq!(known.sum, other.sum);
        assert_eq!(node_hashes(&known).0, node_hashes(&other).0);
        assert_ne!(node_hash(&known), node_hash(&other));
        let mut radii = known.clone();
        radii.radius_sums = other.radius_sums;
        assert_ne!(node_hash(&known), node_hash(&radii));
    }

    #[test]
    fn pixel_hash_tells_pictures_apart() {
        let mut film = Film::new(2, 3);
        let black = pixel_hash(&film);
        assert_eq!(black.len(), 64);
        assert_ne!(black, pixel_hash(&Film::new(3, 2)));
        film.pixels[0][0] = -0.0;
        assert_ne!(black, pixel_hash(&film));
        // By definition, BLAKE3 of the words' bytes.
        let bytes = [2u32, 3, 1 << 31].into_iter().chain([0; 17]).flat_map(u32::to_le_bytes);
        assert_eq!(pixel_hash(&film), blake3::hash(&bytes.collect::<Vec<u8>>()).to_string());
    }
}
