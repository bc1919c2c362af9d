//! Balls: one with bumps, one of mirror tiles.

use super::Mesh;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Waves (a, k, phi) of the bumpy sphere's radius.
const BUMPS: [(f64, DVec3, f64); 7] = [
    (0.030, DVec3::new(7.1, 2.4, -3.2), 0.4),
    (0.030, DVec3::new(-2.7, 7.8, 3.6), 1.9),
    (0.030, DVec3::new(3.4, -3.1, 8.3), 3.1),
    (0.022, DVec3::new(-7.6, 5.8, -4.4), 5.2),
    (0.022, DVec3::new(5.3, 7.3, 6.4), 0.9),
    (0.018, DVec3::new(8.9, -6.7, 2.1), 2.6),
    (0.018, DVec3::new(1.2, 6.9, -9.4), 4.0),
];

/// Radius r(d) = 1 + sum of a sin(k . d + phi) in the direction d, on an icosahedron whose triangles were split in four
/// five times. The normal is along r d - g, with g the part of r's gradient that is perpendicular to d.
pub fn bumpy() -> Mesh {
    let mut mesh = icosphere(5);
    for i in 0..mesh.positions.len() {
        let d = mesh.positions[i];
        let mut radius = 1.0;
        let mut gradient = DVec3::ZERO;
        for (a, k, phi) in BUMPS {
            let (sin, cos) = libm::sincos(k.dot(d) + phi);
            radius += a * sin;
            gradient += k * (a * cos);
        }
        mesh.positions[i] = d * radius;
        let across = gradient - d * gradient.dot(d);
        mesh.normals.push((d * radius - across).normalize());
    }
    mesh
}

/// The unit sphere.
fn icosphere(levels: u32) -> Mesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut positions = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        positions.push(DVec3::new(0.0, a, b).normalize());
        positions.push(DVec3::new(a, b, 0.0).normalize());
        positions.push(DVec3::new(b, 0.0, a).normalize());
    }
    // The faces are the triples of vertices that are neighbours: at the least distance from each other.
    let near = |i: usize, j: usize| positions[i].dot(positions[j]) > 0.4;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(i, k) {
                    let [a, b, c] = [i, j, k].map(|v| positions[v]);
                    let outwards = (b - a).cross(c - a).dot(a) > 0.0;
                    let (j, k) = if outwards { (j, k) } else { (k, j) };
                    triangles.push([i as u32, j as u32, k as u32]);
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = positions[a as usize] + positions[b as usize];
                positions.push(sum.normalize());
                positions.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh {
        positions,
        normals: Vec::new(),
        faces: triangles.iter().map(|t| t.to_vec()).collect(),
    }
}

/// Bands of mirror tiles from pole to pole.
const BANDS: u32 = 18;
/// Side of a tile over the distance of tiles.
const TILE: f64 = 0.94;

/// Flat square tiles that touch the unit sphere at their centres, in bands of equal height around the y axis; a band
/// holds as many as fit.
pub fn mirror_ball() -> Mesh {
    let mut mesh = Mesh::default();
    let height = PI / f64::from(BANDS);
    for band in 0..BANDS {
        let polar = (f64::from(band) + 0.5) * height;
        let (sin_polar, cos_polar) = libm::sincos(polar);
        let count = (2.0 * PI * sin_polar / height).round().max(3.0) as u32;
        for tile in 0..count {
            // Every other band is turned by half a tile.
            let turn = f64::from(tile) + 0.5 * f64::from(band % 2);
            let (sin_azimuth, cos_azimuth) = libm::sincos(2.0 * PI * turn / f64::from(count));
            let out = DVec3::new(sin_polar * cos_azimuth, cos_polar, sin_polar * sin_azimuth);
            let right = DVec3::new(sin_azimuth, 0.0, -cos_azimuth);
            let up = out.cross(right);
            let half_height = TILE * libm::tan(0.5 * height);
            // A band's tiles narrow towards its pole.
            let half_width = |edge: f64| TILE * libm::sin(edge) * libm::tan(PI / f64::from(count));
            let (upper, lower) = (half_width(polar - 0.5 * height), half_width(polar + 0.5 * height));
            mesh.push_polygon(&[
                out - right * lower - up * half_height,
                out + right * lower - up * half_height,
                out + right * upper + up * half_height,
                out - right * upper + up * half_height,
            ]);
        }
    }
    mesh
}
