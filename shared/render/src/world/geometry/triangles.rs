//! Ray-triangle tests, four at a time.

use crate::math::{Vec2, Vec3};
use crate::wide::Around;
use glam::Vec4;

/// A ray sheared to run along +z: triangle tests without leaks along edges (Woop, Benthin, Wald 2013, Watertight
/// ray/triangle intersection).
pub(super) struct ShearedRay {
    axes: [usize; 3],
    /// Origin and shear in these axes, each four times.
    origin: [Vec4; 3],
    shear: [Vec4; 3],
}

impl ShearedRay {
    #[inline(always)]
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        /// The other two axes, by the sign of the direction along this one.
        const OTHERS: [[[usize; 2]; 3]; 2] = [[[1, 2], [2, 0], [0, 1]], [[2, 1], [0, 2], [1, 0]]];
        let z = dir.abs().max_position();
        // Arrays, because dynamic indexing of a vector branches.
        let (origin, dir) = (origin.to_array(), dir.to_array());
        let [x, y] = OTHERS[usize::from(dir[z] < 0.0)][z];
        let shear = Vec4::new(dir[x], dir[y], 1.0, 1.0) / Vec4::splat(dir[z]);
        Self {
            axes: [x, y, z],
            origin: [Vec4::splat(origin[x]), Vec4::splat(origin[y]), Vec4::splat(origin[z])],
            shear: [Vec4::splat(shear.x), Vec4::splat(shear.y), Vec4::splat(shear.z)],
        }
    }

    #[inline(always)]
    fn project(&self, corner: &[Vec4; 3]) -> [Vec4; 3] {
        let [x, y, z] = self.axes;
        let pz = corner[z] - self.origin[2];
        [
            corner[x] - self.origin[0] - self.shear[0] * pz,
            corner[y] - self.origin[1] - self.shear[1] * pz,
            self.shear[2] * pz,
        ]
    }
}

/// A triangle of an object.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TriangleId {
    pub object: u32,
    pub triangle: u32,
}

/// Up to four triangles side by side.
#[derive(Clone, Debug)]
pub(super) struct Four {
    /// By corner and axis; NaN for missing triangles, which no ray meets.
    pub corners: [[Vec4; 3]; 3],
    pub ids: [TriangleId; 4],
}

/// A hit of one of four triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct FourHit {
    pub t: f32,
    pub id: TriangleId,
    /// Barycentric weights of the second and third corner.
    pub uv: Vec2,
}

impl Four {
    /// No triangle yet.
    pub const EMPTY: Self = Self {
        corners: [[Vec4::NAN; 3]; 3],
        ids: [TriangleId { object: 0, triangle: 0 }; 4],
    };

    /// Put a triangle at one of the four places.
    pub fn set(&mut self, place: usize, id: TriangleId, corners: [Vec3; 3]) {
        for (four, one) in self.corners.iter_mut().zip(corners) {
            for axis in 0..3 {
                four[axis][place] = one[axis];
            }
        }
        self.ids[place] = id;
    }

    /// The objects of its triangles.
    pub fn objects(&self) -> impl Iterator<Item = u32> {
        let is_there = |place: &usize| !self.corners[0][0][*place].is_nan();
        (0..4).filter(is_there).map(|place| self.ids[place].object)
    }

    /// The triangles that may be near a segment, as objects and corners.
    pub fn near(&self, around: &Around) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let mask = self.near_mask(around);
        let corner = |four: &[Vec4; 3], place: usize| Vec3::new(four[0][place], four[1][place], four[2][place]);
        let near = (0..4).filter(move |place| mask >> place & 1 != 0);
        near.map(move |place| {
            let corners = self.corners.each_ref().map(|four| corner(four, place));
            (self.ids[place].object, corners)
        })
    }

    /// Excludes triangles behind one of the planes, and those before, beyond or beside the segment by more than the
    /// radius, as far as their own planes tell.
    #[inline(always)]
    fn near_mask(&self, around: &Around) -> u32 {
        let dot = |four: [Vec4; 3], n: Vec3| four[0] * n.x + four[1] * n.y + four[2] * n.z;
        let minus = |p: [Vec4; 3], q: [Vec4; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let [a, b, c] = self.corners;
        let origin = around.origin.to_array().map(Vec4::splat);
        let along = [a, b, c].map(|p| dot(minus(p, origin), around.dir));
        let reach = around.radius * around.dir.length();
        let beyond = Vec4::splat(around.length * around.dir.length_squared() + reach);
        let mut near = along[0].max(along[1]).max(along[2]).cmpge(Vec4::splat(-reach))
            & along[0].min(along[1]).min(along[2]).cmple(beyond);
        for [x, y, z, at] in around.planes {
            let [a, b, c] = [a, b, c].map(|p| dot(p, Vec3::new(x, y, z)));
            near &= a.max(b).max(c).cmpgt(Vec4::splat(at));
        }
        let (u, v) = (minus(b, a), minus(c, a));
        let n = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        let start = minus(origin, a);
        let start = n[0] * start[0] + n[1] * start[1] + n[2] * start[2];
        let end = start + dot(n, around.dir) * around.length;
        let apart = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (around.radius * around.radius);
        let is_beside = (start * end).cmpgt(Vec4::ZERO) & (start * start).min(end * end).cmpgt(apart);
        near.bitmask() & !is_beside.bitmask()
    }

    /// The nearest hit in (0, t_max) among the triangles of objects that are not ignored.
    #[inline(always)]
    pub fn intersect(&self, ray: &ShearedRay, t_max: f32, ignore: &dyn Fn(u32) -> bool) -> Option<FourHit> {
        let [a, b, c] = &self.corners;
        let (a, b, c) = (ray.project(a), ray.project(b), ray.project(c));
        let mut u = c[0] * b[1] - c[1] * b[0];
        let mut v = a[0] * c[1] - a[1] * c[0];
        let mut w = b[0] * a[1] - b[1] * a[0];
        let zero = Vec4::ZERO;
        if (u.cmpeq(zero) | v.cmpeq(zero) | w.cmpeq(zero)).any() {
            [u, v, w] = exactly([a, b, c], [u, v, w]);
        }
        let inside = (u.cmpge(zero) & v.cmpge(zero) & w.cmpge(zero)) | (u.cmple(zero) & v.cmple(zero) & w.cmple(zero));
        if !inside.any() {
            return None;
        }
        let det = u + v + w;
        // NaN, and so no hit, if the determinant is zero.
        let t = (u * a[2] + v * b[2] + w * c[2]) / det;
        let hit = inside & t.cmpgt(zero) & t.cmplt(Vec4::splat(t_max));
        let mut mask = hit.bitmask();
        if mask == 0 {
            return None;
        }
        let t = t.to_array();
        let mut best = None;
        let mut nearest = t_max;
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            if t[i] < nearest && !ignore(self.ids[i].object) {
                nearest = t[i];
                best = Some(i);
            }
        }
        let i = best?;
        let [v, w, det] = [v, w, det].map(|of_all| of_all.to_array()[i]);
        Some(FourHit {
            t: nearest,
            id: self.ids[i],
            uv: Vec2::new(v / det, w / det),
        })
    }
}

/// Repeats the edge functions where one of them is zero, that is, on an edge as far as single precision can tell. In
/// double precision the products are exact.
#[cold]
#[inline(never)]
fn exactly([a, b, c]: [[Vec4; 3]; 3], [mut u, mut v, mut w]: [Vec4; 3]) -> [Vec4; 3] {
    for i in 0..4 {
        if u[i] == 0.0 || v[i] == 0.0 || w[i] == 0.0 {
            let cross = |p: &[Vec4; 3], q: &[Vec4; 3]| {
                (f64::from(p[0][i]) * f64::from(q[1][i]) - f64::from(p[1][i]) * f64::from(q[0][i])) as f32
            };
            u[i] = cross(&c, &b);
            v[i] = cross(&a, &c);
            w[i] = cross(&b, &a);
        }
    }
    [u, v, w]
}
