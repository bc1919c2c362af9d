//! The beams of a pass, laid out for evaluation, and pieces of them, laid out for search.

use super::PhotonBeam;
use super::lanes::{LANES, Lanes};
use super::order::order;
use super::walls::{self, Plane};
use crate::math::Vec3;
use crate::parallel;
use crate::world::medium::transmittance::StepFunctions;
use crate::world::spectrum::{WaveNumber, WaveSet};
use rayon::prelude::*;

/// Pieces that a beam of mean length is cut into. Short pieces near each other have tight bounds; long beams do not.
const PIECES: f32 = 4.0;

/// The most pieces of one beam.
const MAX_PIECES: u32 = 64;

/// Rounding of distances, relative to coordinates.
pub(super) const ROUNDING: f32 = 4e-6;

/// The beams of one pass.
pub struct BeamMap {
    beams: Vec<PhotonBeam>,
    steps: StepFunctions,
    walls: Vec<Plane>,
    /// By medium.
    media: Vec<PieceTree>,
}

/// The beams of a pass, as seen by camera paths without a wavelength, and by paths with one.
pub(crate) struct Beams {
    /// Power includes the weight of the beam's wavelength.
    white: ByWidth,
    /// Power counts for a path of the beam's wavelength. None without wavelengths.
    of_waves: Option<ByWidth>,
}

/// Beams by how wide their kernels are.
pub(crate) struct ByWidth {
    /// Beams that each camera segment gathers for itself.
    pub sharp: BeamMap,
    /// Beams whose light segments share: see [`super::estimate::Sharing`].
    pub smooth: BeamMap,
}

impl Beams {
    /// From the photons that a pass has traced. `waves`: if some surface disperses light.
    pub fn new(sharp: Traced, smooth: Traced, waves: Option<&WaveSet>) -> Self {
        let of_waves = waves.map(|waves| ByWidth {
            sharp: sharp.clone().seen_by(waves, true).map(),
            smooth: smooth.clone().seen_by(waves, true).map(),
        });
        let white = |traced: Traced| match waves {
            Some(waves) => traced.seen_by(waves, false).map(),
            None => traced.map(),
        };
        Self {
            white: ByWidth {
                sharp: white(sharp),
                smooth: white(smooth),
            },
            of_waves,
        }
    }

    /// The beams seen by camera paths of a wavelength, or of none.
    pub fn seen_by(&self, wave: Option<WaveNumber>) -> &ByWidth {
        match (wave, &self.of_waves) {
            (Some(_), Some(of_waves)) => of_waves,
            _ => &self.white,
        }
    }

    /// Memory used, bytes.
    pub fn bytes(&self) -> usize {
        let all = self.of_waves.iter().chain([&self.white]);
        all.map(|kinds| kinds.sharp.bytes() + kinds.smooth.bytes()).sum()
    }
}

/// Traced beams, and transmittance along those in heterogeneous media.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// In the order of paths.
    pub beams: Vec<PhotonBeam>,
    /// See [`PhotonBeam::steps`].
    pub steps: StepFunctions,
    /// See [`PhotonBeam::walls`].
    pub walls: Vec<Plane>,
}

impl Traced {
    fn map(self) -> BeamMap {
        BeamMap::new(self)
    }

    /// With the power that they have for camera paths of their wavelength (`with_wave`), or of none.
    fn seen_by(mut self, waves: &WaveSet, with_wave: bool) -> Self {
        for beam in &mut self.beams {
            if let Some(wave) = beam.wave {
                beam.power *= waves.factor(wave, with_wave.then_some(wave));
            }
        }
        self
    }
}

/// Pieces of the beams in one medium, with similar ones adjacent, bounds of every [`LANES`] of them, of every [`LANES`]
/// of these, and so on: a hierarchy without pointers.
#[derive(Default)]
pub(super) struct PieceTree {
    pub pieces: PieceList,
    /// The lowest first; the last has one chunk.
    pub levels: Vec<Vec<Cluster>>,
}

/// A piece of a beam: its kernel's cylinder between two distances from the beam's origin.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    pub middle: Vec3,
    pub dir: Vec3,
    pub range: PieceRange,
    /// The kernel's largest radius.
    radius: f32,
}

/// Which part of which beam a piece is.
#[derive(Clone, Copy, Default)]
pub(super) struct PieceRange {
    /// Index in the map.
    pub beam: u32,
    /// From `start`, exclusive, to `end` from the beam's origin.
    pub start: f32,
    pub end: f32,
    /// Where no wall is near; infinite if nowhere on the piece.
    pub clear: [f32; 2],
}

impl PieceRange {
    /// No wall is near any part of the piece.
    pub const ALL_CLEAR: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];
}

impl BeamMap {
    /// Build the map.
    pub fn new(traced: Traced) -> Self {
        let Traced { beams, steps, walls } = traced;
        let mut media: Vec<Vec<Piece>> = Vec::new();
        let lengths: f64 = beams
            .iter()
            .map(|beam| f64::from(beam.extent[1] - beam.extent[0]))
            .sum();
        let length = (lengths / beams.len().max(1) as f64) as f32 / PIECES;
        for (i, beam) in beams.iter().enumerate() {
            let medium = usize::from(beam.medium);
            if media.len() <= medium {
                media.resize_with(medium + 1, Vec::new);
            }
            media[medium].extend(beam.pieces(i as u32, length, walls_of(&walls, beam)));
        }
        let tree = |pieces: Vec<Piece>| PieceTree::new(&arranged(&pieces, length));
        Self {
            beams,
            steps,
            walls,
            media: media.into_iter().map(tree).collect(),
        }
    }

    /// The beams, in the order of tracing.
    pub fn beams(&self) -> &[PhotonBeam] {
        &self.beams
    }

    /// Transmittance along the beams in heterogeneous media.
    pub fn steps(&self) -> &StepFunctions {
        &self.steps
    }

    /// The planes of the walls near a beam.
    #[inline(always)]
    pub(super) fn walls_of(&self, beam: &PhotonBeam) -> &[Plane] {
        walls_of(&self.walls, beam)
    }

    /// The pieces in a medium, if there are any.
    pub(super) fn tree(&self, medium: u16) -> Option<&PieceTree> {
        self.media.get(usize::from(medium))
    }

    /// Whether a medium has any beams.
    pub fn has_beams(&self, medium: u16) -> bool {
        self.tree(medium).is_some_and(|tree| tree.pieces.len() > 0)
    }

    /// Mean kernel radius of the beams in a medium, weighted by length; 0 if there are none.
    pub fn mean_radius(&self, medium: u16) -> f32 {
        self.tree(medium).map_or(0.0, |tree| tree.pieces.mean_radius())
    }

    /// Memory used, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.beams[..])
            + size_of_val(&self.walls[..])
            + self.media.iter().map(PieceTree::bytes).sum::<usize>()
            + self.steps.bytes()
    }
}

#[inline(always)]
fn walls_of<'a>(all: &'a [Plane], beam: &PhotonBeam) -> &'a [Plane] {
    let [first, end] = beam.walls;
    &all[first as usize..end as usize]
}

/// Arranges similar pieces next to each other, in parts of the sizes that a [`PieceTree`] has. `length`: how long
/// pieces are. Directions count as far as they move the pieces' ends.
fn arranged(pieces: &[Piece], length: f32) -> Vec<Piece> {
    let place = |piece: &Piece| {
        let [x, y, z] = piece.middle.to_array();
        let [dx, dy, dz] = (piece.dir * (0.5 * length)).to_array();
        [x, y, z, dx, dy, dz]
    };
    let finer = |pieces: usize| {
        let larger = std::iter::successors(Some(LANES), |size| Some(size * LANES));
        larger.take_while(|size| *size < pieces).last()
    };
    let order = order(pieces.iter().map(place), finer);
    order.into_iter().map(|i| pieces[i as usize]).collect()
}

impl PhotonBeam {
    /// Pieces about `length` long.
    fn pieces(&self, index: u32, length: f32, walls: &[Plane]) -> impl Iterator<Item = Piece> {
        let [start, end] = self.extent;
        let count = ((end - start) / length).ceil().clamp(1.0, MAX_PIECES as f32) as u32;
        let at = move |n: u32| match n == count {
            true => end,
            false => start + (end - start) * (n as f32 / count as f32),
        };
        let beam = *self;
        (0..count).map(move |n| {
            let (start, end) = (at(n), at(n + 1));
            Piece {
                middle: beam.origin + beam.dir * (0.5 * (start + end)),
                dir: beam.dir,
                range: PieceRange {
                    beam: index,
                    start,
                    end,
                    clear: walls::clear_range(walls, start, end),
                },
                radius: beam.radius_at(start).max(beam.radius_at(end)),
            }
        })
    }
}

/// The cylinder of a piece, including its kernel.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub middle: [f32; 3],
    pub dir: [f32; 3],
    pub radius: f32,
    /// Half the length.
    pub half: f32,
}

/// Values of [`Bounds`], one row each, for `LANES` pieces.
pub(super) type Rows = [Lanes; 8];
const RADIUS: usize = 6;

/// Bounds of several pieces.
#[derive(Clone)]
pub(super) struct Cluster {
    pub rows: Rows,
    /// How far middles and directions may deviate from those given.
    pub ranges: [Lanes; 2],
    /// What follows from the ranges: the radius of a ball around all pieces; how far a line that meets a piece, kernel
    /// included, may be from the line given, times the sine; how much farther than half the length the nearest point
    /// may be from the middle, times the sine squared.
    pub reach: [Lanes; 3],
}

impl Bounds {
    /// Empty bounds: nothing meets them.
    const NONE: Self = Self {
        middle: [0.0; 3],
        dir: [0.0; 3],
        radius: f32::NEG_INFINITY,
        half: 0.0,
    };

    fn rows(self) -> [f32; 8] {
        let ([px, py, pz], [bx, by, bz]) = (self.middle, self.dir);
        [px, py, pz, bx, by, bz, self.radius, self.half]
    }

    /// [`Cluster::reach`].
    fn reach(self, [middles, dirs]: [f32; 2]) -> [f32; 3] {
        let [px, py, pz] = self.middle;
        let ball = self.half + self.radius + middles + ROUNDING * (px.abs() + py.abs() + pz.abs());
        // Deviating directions turn the pieces about their middles, which are at most this far from a line that meets
        // them.
        let slack = middles + dirs * (ball + middles) + ROUNDING * (px.abs() + py.abs() + pz.abs());
        [
            ball,
            self.radius + slack,
            slack + self.half * (2.0 * dirs + dirs * dirs),
        ]
    }

    /// The bounds in one lane.
    #[inline(always)]
    pub fn of_lane(rows: &Rows, lane: usize) -> Self {
        let row = |n: usize| rows[n][lane];
        Self {
            middle: [row(0), row(1), row(2)],
            dir: [row(3), row(4), row(5)],
            radius: row(RADIUS),
            half: row(7),
        }
    }
}

impl Piece {
    fn half(&self) -> f32 {
        0.5 * (self.range.end - self.range.start)
    }
}

impl PieceTree {
    fn new(pieces: &[Piece]) -> Self {
        let mut tree = Self::default();
        for piece in pieces {
            let bounds = Bounds {
                middle: piece.middle.to_array(),
                dir: piece.dir.to_array(),
                radius: piece.radius,
                half: piece.half(),
            };
            tree.pieces.push(piece.range, bounds);
        }
        let mut size = LANES;
        while size < pieces.len() {
            let chunks = pieces.par_chunks(size * LANES);
            tree.levels
                .push(parallel::collected(chunks.map(|all| Cluster::of(all, size))));
            size *= LANES;
        }
        tree
    }

    fn bytes(&self) -> usize {
        let levels = self.levels.iter().map(|level| size_of_val(&level[..]));
        self.pieces.bytes() + levels.sum::<usize>()
    }
}

impl Cluster {
    /// Bounds of each run of `size` pieces.
    fn of(pieces: &[Piece], size: usize) -> Self {
        let mut cluster = Self {
            rows: Bounds::NONE.rows().map(|x| [x; LANES]),
            ranges: [[0.0; LANES]; 2],
            reach: [[f32::NEG_INFINITY; LANES]; 3],
        };
        for (lane, pieces) in pieces.chunks(size).enumerate() {
            let (bounds, ranges) = Self::around(pieces);
            for (row, value) in cluster.rows.iter_mut().zip(bounds.rows()) {
                row[lane] = value;
            }
            for (row, value) in cluster.ranges.iter_mut().zip(ranges) {
                row[lane] = value;
            }
            for (row, value) in cluster.reach.iter_mut().zip(bounds.reach(ranges)) {
                row[lane] = value;
            }
        }
        cluster
    }

    fn around(pieces: &[Piece]) -> (Bounds, [f32; 2]) {
        let centre = |of: fn(&Piece) -> Vec3| {
            let bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let grow = |(min, max): (Vec3, Vec3), v: Vec3| (min.min(v), max.max(v));
            let (min, max) = pieces.iter().map(of).fold(bounds, grow);
            0.5 * (min + max)
        };
        let middle = centre(|piece| piece.middle);
        // Opposite directions have no middle: any direction will do.
        let dir = centre(|piece| piece.dir).normalize_or(Vec3::X);
        let mut bounds = Bounds {
            middle: middle.to_array(),
            dir: dir.to_array(),
            radius: f32::NEG_INFINITY,
            half: 0.0,
        };
        let (mut middles, mut dirs) = (0.0f32, 0.0f32);
        for piece in pieces {
            bounds.radius = bounds.radius.max(piece.radius);
            bounds.half = bounds.half.max(piece.half());
            middles = middles.max(piece.middle.distance(middle));
            dirs = dirs.max(piece.dir.distance(dir));
        }
        // Leaves room for rounding.
        (bounds, [1.0001 * middles, 1.0001 * dirs])
    }
}

/// Pieces with their bounds, `LANES` side by side, so that vector code can compare them with segments.
#[derive(Default)]
pub(super) struct PieceList {
    /// Unused lanes of the last chunk hold [`Bounds::NONE`].
    chunks: Vec<Rows>,
    ranges: Vec<PieceRange>,
    radii: f32,
}

impl PieceList {
    fn push(&mut self, range: PieceRange, bounds: Bounds) {
        let lane = self.ranges.len() % LANES;
        if lane == 0 {
            self.chunks.push(Bounds::NONE.rows().map(|x| [x; LANES]));
        }
        if let Some(chunk) = self.chunks.last_mut() {
            for (row, value) in chunk.iter_mut().zip(bounds.rows()) {
                row[lane] = value;
            }
        }
        self.ranges.push(range);
        self.radii += bounds.radius;
    }

    /// Replace the contents with the pieces at these positions of another list.
    #[inline(always)]
    pub fn select(&mut self, from: &Self, positions: &[u32]) {
        self.chunks.clear();
        self.ranges.clear();
        self.radii = 0.0;
        for group in positions.chunks(LANES) {
            let mut chunk = [[0.0; LANES]; 8];
            chunk[RADIUS] = [Bounds::NONE.radius; LANES];
            for (lane, &at) in group.iter().enumerate() {
                let rows = &from.chunks[at as usize / LANES];
                for n in 0..chunk.len() {
                    chunk[n][lane] = rows[n][at as usize % LANES];
                }
                self.radii += chunk[RADIUS][lane];
                self.ranges.push(from.ranges[at as usize]);
            }
            self.chunks.push(chunk);
        }
    }

    /// Number of pieces.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Mean of the kernels' radii; 0 if there are none.
    pub fn mean_radius(&self) -> f32 {
        self.radii / self.len().max(1) as f32
    }

    /// Which parts of which beams the pieces are.
    #[inline(always)]
    pub fn ranges(&self) -> &[PieceRange] {
        &self.ranges
    }

    /// Bounds, side by side.
    #[inline(always)]
    pub fn chunks(&self) -> &[Rows] {
        &self.chunks
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.chunks[..]) + size_of_val(&self.ranges[..])
    }
}
