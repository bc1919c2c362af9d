//! A grid's tree, 5-4-3: a root whose children have 32^3 children each, which have 16^3 leaves of 8^3 values. An entry
//! without a child is a tile with one value throughout. The topology comes first, with the tiles, depth-first; then the
//! leaves' values.

use super::values::{Mask, Scalar, ValueReader};
use crate::Flaw;
use crate::volume::bytes::Bytes;
use crate::volume::core;
use beamfarm_render::world::medium::bricks::{BRICK, Core};
use glam::IVec3;
use std::collections::BTreeMap;

const LEAF: usize = BRICK * BRICK * BRICK;
/// Samples along a child of the root.
const ROOT_CHILD: i32 = 4096;
/// Largest coordinate of a root child: far beyond any valid density, and safe from overflow in sums.
const FARTHEST: i32 = 1 << 28;
/// The most bricks made from tiles: one tile can become many and takes next to no space in the file.
const MAX_TILE_BRICKS: u64 = 4_000_000;

/// How a tree's values are stored.
pub struct Storage {
    /// The tree's number type.
    pub scalar: Scalar,
    /// Whether numbers are stored as half.
    pub as_half: bool,
    /// The grid's compression flags.
    pub compression: u32,
    /// Offset of the leaves' values.
    pub blocks: u64,
}

/// Read the bricks of the tree whose topology begins here.
pub fn read(bytes: &mut Bytes, storage: &Storage) -> Result<BTreeMap<[i32; 3], Core>, Flaw> {
    const WHAT: &str = "the tree's root";
    let buffers = bytes.i32(WHAT)?;
    if buffers != 1 {
        return Err(format!("its tree has {buffers} buffers; expected 1").into());
    }
    let background = storage.scalar.read(bytes, WHAT)?;
    if background != 0.0 {
        return Err(format!("its background is {background}; expected 0, as a fog volume has around it").into());
    }
    let tile_size = 12 + storage.scalar.size() + 1;
    let tiles = bytes.count(tile_size, "tiles of the root")?;
    let node_size = 12 + 2 * (1 << (3 * UPPER.log2)) / 8 + 1;
    let children = bytes.count(node_size, "nodes of the root")?;
    for _ in 0..tiles {
        let [x, y, z] = bytes.i32s(WHAT)?;
        let value = storage.scalar.read(bytes, WHAT)?;
        bytes.u8(WHAT)?;
        if value != 0.0 {
            return Err(format!(
                "its root has a tile of value {value} at ({x}, {y}, {z}), {ROOT_CHILD} samples along each side, which is too \
                 large"
            )
            .into());
        }
    }
    let mut tree = Reader {
        values: ValueReader::new(storage.scalar, storage.as_half, storage.compression, background)?,
        bricks: BTreeMap::new(),
        tile_bricks: 0,
        leaves: Vec::new(),
    };
    for _ in 0..children {
        let origin: [i32; 3] = bytes.i32s(WHAT)?;
        let fits = |c: i32| c % ROOT_CHILD == 0 && (-FARTHEST..=FARTHEST).contains(&c);
        if !origin.into_iter().all(fits) {
            let [x, y, z] = origin;
            return Err(format!(
                "its root has a node at ({x}, {y}, {z}); expected multiples of {ROOT_CHILD} up to {FARTHEST}"
            )
            .into());
        }
        tree.node(bytes, &UPPER, IVec3::from(origin) / BRICK as i32)?;
    }
    bytes.seek(storage.blocks, "its leaves' values")?;
    for leaf in std::mem::take(&mut tree.leaves) {
        tree.leaf(bytes, leaf)?;
    }
    Ok(tree.bricks)
}

/// A level of inner nodes.
struct Level {
    /// Binary logarithm of the number of children per side.
    log2: u32,
    /// Bricks along a child's side.
    child: i32,
    /// The children's level; `None` if they are leaves.
    below: Option<&'static Level>,
}

const UPPER: Level = Level {
    log2: 5,
    child: 16,
    below: Some(&LOWER),
};
const LOWER: Level = Level {
    log2: 4,
    child: 1,
    below: None,
};

struct Reader {
    values: ValueReader,
    bricks: BTreeMap<[i32; 3], Core>,
    /// Bricks made from tiles so far.
    tile_bricks: u64,
    /// Leaves in topology order.
    leaves: Vec<IVec3>,
}

impl Reader {
    /// Read an inner node whose first brick is `first`.
    fn node(&mut self, bytes: &mut Bytes, level: &Level, first: IVec3) -> Result<(), Flaw> {
        const WHAT: &str = "an inner node";
        let count = 1usize << (3 * level.log2);
        let children = Mask::read(bytes, count, WHAT)?;
        let active = Mask::read(bytes, count, WHAT)?;
        // z varies fastest.
        let place = |i: usize| {
            let (i, last) = (i as i32, (1 << level.log2) - 1);
            let child = IVec3::new(i >> (2 * level.log2), i >> level.log2 & last, i & last);
            first + child * level.child
        };
        let mut values = vec![0.0; count];
        self.values.read(bytes, active, &mut values)?;
        for (i, value) in values.into_iter().enumerate() {
            if value != 0.0 && !children.contains(i) {
                self.tile(place(i), level.child, value)?;
            }
        }
        for i in (0..count).filter(|i| children.contains(*i)) {
            match level.below {
                Some(below) => self.node(bytes, below, place(i))?,
                None => {
                    // The mask of active values; it is repeated with the values.
                    bytes.take(LEAF / 8, "a leaf")?;
                    self.leaves.push(place(i));
                }
            }
        }
        Ok(())
    }

    fn tile(&mut self, first: IVec3, side: i32, value: f32) -> Result<(), Flaw> {
        self.tile_bricks += u64::from(side.unsigned_abs()).pow(3);
        if self.tile_bricks > MAX_TILE_BRICKS {
            return Err(format!(
                "its tiles cover more than {MAX_TILE_BRICKS} blocks of 8 x 8 x 8 samples, which is too much"
            )
            .into());
        }
        for z in 0..side {
            for y in 0..side {
                for x in 0..side {
                    let brick = first + IVec3::new(x, y, z);
                    self.bricks.insert(brick.to_array(), Core::Constant(value));
                }
            }
        }
        Ok(())
    }

    fn leaf(&mut self, bytes: &mut Bytes, brick: IVec3) -> Result<(), Flaw> {
        let active = Mask::read(bytes, LEAF, "a leaf")?;
        let mut values = [0.0; LEAF];
        self.values.read(bytes, active, &mut values)?;
        // From z-fastest to x-fastest order.
        let samples = std::array::from_fn(|i| {
            let (x, y, z) = (i % BRICK, i / BRICK % BRICK, i / (BRICK * BRICK));
            values[z + BRICK * (y + BRICK * x)]
        });
        self.bricks.insert(brick.to_array(), core(samples));
        Ok(())
    }
}
