//! Solids with flat faces: prisms and cut diamonds.

use super::Mesh;
use glam::DVec3;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_3, PI};

/// The side of a plane that a solid is on: normal . p <= offset.
struct HalfSpace {
    normal: DVec3,
    offset: f64,
}

/// Farther than anything of a solid.
const FAR: f64 = 16.0;
/// Vertices nearer than this are one.
const SAME: f64 = 1e-7;

fn sin_cos(x: f64) -> (f64, f64) {
    (libm::sin(x), libm::cos(x))
}

/// Unit normal that leans from +y towards the azimuth by so much.
fn leaning(azimuth: f64, by: f64) -> DVec3 {
    let ((sa, ca), (sb, cb)) = (sin_cos(azimuth), sin_cos(by));
    DVec3::new(sb * ca, cb, sb * sa)
}

/// What lies in all half-spaces: on each plane a square, cut by the others.
fn intersection(of: &[HalfSpace]) -> Mesh {
    let mut mesh = Mesh::default();
    for (number, plane) in of.iter().enumerate() {
        let (u, v) = plane.normal.any_orthonormal_pair();
        let centre = plane.normal * plane.offset;
        let mut polygon = vec![
            centre + (u + v) * FAR,
            centre + (v - u) * FAR,
            centre - (u + v) * FAR,
            centre + (u - v) * FAR,
        ];
        if u.cross(v).dot(plane.normal) < 0.0 {
            polygon.reverse();
        }
        for (_, cut) in of.iter().enumerate().filter(|(other, _)| *other != number) {
            polygon = clipped(&polygon, cut);
        }
        polygon.dedup_by(|a, b| a.distance(*b) < SAME);
        while polygon.len() > 1 && polygon[0].distance(polygon[polygon.len() - 1]) < SAME {
            polygon.pop();
        }
        if polygon.len() < 3 {
            continue;
        }
        let mut index = |p: DVec3| {
            let known = mesh.positions.iter().position(|q| q.distance(p) < SAME);
            known.unwrap_or_else(|| {
                mesh.positions.push(p);
                mesh.positions.len() - 1
            }) as u32
        };
        let face = polygon.into_iter().map(&mut index).collect();
        mesh.faces.push(face);
    }
    mesh
}

fn clipped(polygon: &[DVec3], by: &HalfSpace) -> Vec<DVec3> {
    let outside = |p: DVec3| by.normal.dot(p) - by.offset;
    let mut left = Vec::new();
    for (i, &p) in polygon.iter().enumerate() {
        let next = polygon[(i + 1) % polygon.len()];
        let (here, there) = (outside(p), outside(next));
        if here <= 0.0 {
            left.push(p);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            left.push(p.lerp(next, here / (here - there)));
        }
    }
    left
}

/// The sides of a prism along z with an equilateral triangle of side 1 around the origin, one edge on top.
fn prism_sides() -> [HalfSpace; 3] {
    let inradius = libm::sqrt(3.0) / 6.0;
    [0.0, 1.0, 2.0].map(|side| {
        let (sin, cos) = sin_cos(PI / 6.0 + side * 2.0 * FRAC_PI_3);
        HalfSpace {
            normal: DVec3::new(cos, sin, 0.0),
            offset: inradius,
        }
    })
}

/// The ends of a prism along z from -length to length.
fn prism_ends(length: f64) -> [HalfSpace; 2] {
    [DVec3::Z, DVec3::NEG_Z].map(|normal| HalfSpace { normal, offset: length })
}

/// A prism along z from -1 to 1 with an equilateral triangle of side 1 around the origin, one edge on top.
pub fn prism() -> Mesh {
    intersection(&prism_sides().into_iter().chain(prism_ends(1.0)).collect::<Vec<_>>())
}

/// The same from -0.4 to 0.4, its edges ground off by 0.012, as those of real ones are.
pub fn prism_ground() -> Mesh {
    let (length, off) = (0.4, 0.012);
    let (sides, ends) = (prism_sides(), prism_ends(length));
    let mut edges = Vec::new();
    for side in &sides {
        // Two sides meet opposite the third, a circumradius away from the axis.
        edges.push(HalfSpace {
            normal: -side.normal,
            offset: 2.0 * side.offset - off,
        });
        edges.extend(ends.iter().map(|end| HalfSpace {
            normal: (side.normal + end.normal).normalize(),
            offset: (side.offset + length) * FRAC_1_SQRT_2 - off,
        }));
    }
    intersection(&sides.into_iter().chain(ends).chain(edges).collect::<Vec<_>>())
}

/// A round brilliant of Tolkowsky's proportions (1919): the girdle has a radius of 1 and its lower edge at y = 0, the
/// table is on top.
pub fn brilliant() -> Mesh {
    let degrees = |x: f64| x * PI / 180.0;
    let eighth = PI / 4.0;
    let girdle = 0.04;
    let table_radius = 0.53;
    // Half of the azimuth between the corners of the table.
    let (_, cos_corner) = sin_cos(0.5 * eighth);
    let through = |normal: DVec3, point: DVec3| HalfSpace {
        normal,
        offset: normal.dot(point),
    };
    let around = |azimuth: f64, radius: f64, y: f64| {
        let (sin, cos) = sin_cos(azimuth);
        DVec3::new(radius * cos, y, radius * sin)
    };
    let crown = degrees(34.5);
    // Where the mains meet the table.
    let height = girdle + (1.0 - table_radius) * libm::tan(crown);
    let mut planes = vec![HalfSpace {
        normal: DVec3::Y,
        offset: height,
    }];
    for main in 0..8 {
        let azimuth = f64::from(main) * eighth;
        planes.push(through(leaning(azimuth, crown), around(azimuth, 1.0, girdle)));
        // Stars from the table's edges between two mains.
        let between = azimuth + 0.5 * eighth;
        let edge = table_radius * cos_corner;
        planes.push(through(leaning(between, degrees(22.0)), around(between, edge, height)));
        let pavilion = PI - degrees(40.75);
        planes.push(through(leaning(azimuth, pavilion), around(azimuth, 1.0, 0.0)));
        for half in [-0.25, 0.25] {
            let azimuth = azimuth + half * eighth;
            planes.push(through(leaning(azimuth, degrees(41.0)), around(azimuth, 1.0, girdle)));
            let lower = PI - degrees(42.2);
            planes.push(through(leaning(azimuth, lower), around(azimuth, 1.0, 0.0)));
        }
    }
    for side in 0..64 {
        let (sin, cos) = sin_cos(f64::from(side) * PI / 32.0);
        planes.push(HalfSpace {
            normal: DVec3::new(cos, 0.0, sin),
            offset: 0.995,
        });
    }
    intersection(&planes)
}

/// An emerald cut, 2 long along x and 1.44 wide, with corners cut off: three steps on each of the eight sides above the
/// girdle, whose lower edge is at y = 0, and three below, which meet in a keel.
pub fn emerald_cut() -> Mesh {
    let (long, wide, corner) = (1.0, 0.72, 0.24);
    let girdle = 0.05;
    // How far each step goes inwards, and the angle at which it leans.
    let crown = [(0.10, 46.0), (0.10, 37.0), (0.08, 27.0)];
    let pavilion = [(0.24, 50.0), (0.24, 43.0), (0.24, 37.0)];
    let sides = (0..8).map(|side| {
        let (sin, cos) = sin_cos(f64::from(side) * PI / 4.0);
        let apothem = [long, (long + wide - corner) * FRAC_1_SQRT_2, wide][[0, 1, 2, 1][side as usize % 4]];
        (DVec3::new(cos, 0.0, sin), apothem)
    });
    let sides: Vec<(DVec3, f64)> = sides.collect();
    let mut planes: Vec<HalfSpace> = (sides.iter())
        .map(|(normal, offset)| HalfSpace {
            normal: *normal,
            offset: *offset,
        })
        .collect();
    for (steps, up, from) in [(crown, 1.0, girdle), (pavilion, -1.0, 0.0)] {
        let (mut inset, mut height) = (0.0, 0.0);
        for (inwards, angle) in steps {
            let (sin, cos) = sin_cos(angle * PI / 180.0);
            planes.extend(sides.iter().map(|(outwards, apothem)| {
                let normal = *outwards * sin + DVec3::Y * (up * cos);
                let point = *outwards * (apothem - inset) + DVec3::Y * (from + up * height);
                HalfSpace {
                    normal,
                    offset: normal.dot(point),
                }
            }));
            inset += inwards;
            height += inwards * sin / cos;
        }
        if up > 0.0 {
            planes.push(HalfSpace {
                normal: DVec3::Y,
                offset: from + height,
            });
        }
    }
    intersection(&planes)
}

/// A drop of crystal with eight sides, as it hangs from a chandelier: its tip at y = -1, its flat top at y = 0.3.
pub fn drop() -> Mesh {
    let mut planes = vec![HalfSpace {
        normal: DVec3::Y,
        offset: 0.3,
    }];
    for i in 0..8 {
        let azimuth = 0.25 * PI * f64::from(i);
        let below = leaning(azimuth, 0.5 * PI + 0.3);
        let offset = -below.y;
        planes.extend([
            HalfSpace { normal: below, offset },
            HalfSpace {
                normal: leaning(azimuth + 0.125 * PI, 0.5 * PI + 0.04),
                offset: 0.29,
            },
            HalfSpace {
                normal: leaning(azimuth, 0.9),
                offset: 0.27,
            },
        ]);
    }
    intersection(&planes)
}
