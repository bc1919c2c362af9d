//! The edges of a mesh's triangles.

/// An edge: its lower vertex, and the sides of the triangles there.
pub(super) type Edge<'a> = (u32, &'a [Side]);

/// A triangle at an edge, packed: the edge's higher vertex, the triangle's number, and whether the triangle goes
/// upwards.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side(u64);

impl Side {
    fn new(from: u32, to: u32, face: usize) -> Self {
        Self(u64::from(from.max(to)) << 32 | (face as u64) << 1 | u64::from(from < to))
    }

    pub fn high(self) -> u32 {
        (self.0 >> 32) as u32
    }

    pub fn face(self) -> usize {
        (self.0 as u32 >> 1) as usize
    }

    pub fn is_up(self) -> bool {
        self.0 & 1 == 1
    }
}

/// All edges, ordered by lower and then by higher vertex.
pub(super) struct Edges {
    /// For each lower vertex, where its edges' sides begin; then the end of all.
    starts: Vec<u32>,
    sides: Vec<Side>,
    /// Whether each edge belongs to two triangles with consistent winding.
    pub are_simple: bool,
}

/// Whether a triangle has three distinct corners.
pub(super) fn has_corners([a, b, c]: [u32; 3]) -> bool {
    a != b && b != c && c != a
}

impl Edges {
    /// The edges of triangles with three distinct corners, given the number of vertices.
    pub fn new(faces: &[[u32; 3]], vertices: usize) -> Self {
        let of_face = |face: &[u32; 3]| {
            let [a, b, c] = *face;
            [(a, b), (b, c), (c, a)]
        };
        let are_faces = || faces.iter().enumerate().filter(|(_, face)| has_corners(**face));
        let mut starts = vec![0u32; vertices + 1];
        for (_, face) in are_faces() {
            of_face(face)
                .iter()
                .for_each(|(from, to)| starts[*from.min(to) as usize] += 1);
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        // Counts down from the ends to the starts.
        let mut sides = vec![Side(0); sum as usize];
        for (number, face) in are_faces() {
            for (from, to) in of_face(face) {
                let place = &mut starts[from.min(to) as usize];
                *place -= 1;
                sides[*place as usize] = Side::new(from, to, number);
            }
        }
        let mut are_simple = true;
        for ends in starts.windows(2) {
            let own = &mut sides[ends[0] as usize..ends[1] as usize];
            own.sort_unstable();
            let (twos, rest) = own.as_chunks();
            are_simple &= rest.is_empty();
            let mut last = None;
            for [one, other] in twos {
                let fit = one.high() == other.high() && one.is_up() != other.is_up();
                are_simple &= fit && last != Some(one.high());
                last = Some(one.high());
            }
        }
        Self {
            starts,
            sides,
            are_simple,
        }
    }

    /// Calls `visit` with each pair of consecutive triangles at an edge.
    pub fn neighbours(&self, mut visit: impl FnMut(usize, usize)) {
        for ends in self.starts.windows(2) {
            for pair in self.sides[ends[0] as usize..ends[1] as usize].windows(2) {
                if pair[0].high() == pair[1].high() {
                    visit(pair[0].face(), pair[1].face());
                }
            }
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = Edge<'_>> {
        (0..).zip(self.starts.windows(2)).flat_map(|(low, ends)| {
            let sides = &self.sides[ends[0] as usize..ends[1] as usize];
            let edges = sides.chunk_by(|one, other| one.high() == other.high());
            edges.map(move |edge| (low, edge))
        })
    }
}

/// Whether as many triangles pass the edge in one direction as in the other.
pub(super) fn is_balanced((_, sides): &Edge) -> bool {
    2 * sides.iter().filter(|side| side.is_up()).count() == sides.len()
}
