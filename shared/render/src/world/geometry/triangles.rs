//! Rays and triangles, four at a time.

use crate::math::{Vec2, Vec3};
use glam::Vec4;

/// A ray sheared so that it runs along +z: triangle tests without leaks along edges (Woop, Benthin, Wald 2013,
/// Watertight ray/triangle intersection).
pub(super) struct ShearedRay {
    axes: [usize; 3],
    /// Origin and shear by these axes, each four times.
    origin: [Vec4; 3],
    shear: [Vec4; 3],
}

impl ShearedRay {
    #[inline(always)]
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        /// The other two axes, by the sign of the direction along this one.
        const OTHERS: [[[usize; 2]; 3]; 2] = [[[1, 2], [2, 0], [0, 1]], [[2, 1], [0, 2], [1, 0]]];
        let z = dir.abs().max_position();
        // Arrays, because looking up a vector's component branches.
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

/// Which triangle of which object.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TriangleId {
    pub object: u32,
    pub triangle: u32,
}

/// Up to four triangles side by side.
#[derive(Clone, Debug)]
pub(super) struct Four {
    /// By corner and axis. Where there is no triangle, NaN, which no ray meets.
    corners: [[Vec4; 3]; 3],
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

    /// The triangles, by their objects and corners.
    pub fn each(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let corner = |four: &[Vec4; 3], place: usize| Vec3::new(four[0][place], four[1][place], four[2][place]);
        let all = (0..4).map(move |i| (self.ids[i].object, self.corners.each_ref().map(|four| corner(four, i))));
        all.filter(|(_, [a, ..])| !a.x.is_nan())
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
        // Not a number, and so no hit, where the determinant is zero.
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

/// The edge functions again where one of them is zero: on an edge as far as single precision can tell. In double, where
/// the products are exact.
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
