//! Solids and mirrors of revolution around the z axis: lamps, a goblet, a ring, a tyre, furniture.

use super::{Mesh, loft};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A point (r, z) of a profile with the outline's normal there.
#[derive(Clone, Copy)]
struct Point {
    at: DVec2,
    normal: DVec2,
}

/// An outline in the (r, z) half plane. Walking along it, the outside is on the right.
#[derive(Default)]
pub struct Profile(Vec<Point>);

impl Profile {
    /// A straight stretch.
    pub fn line(mut self, from: DVec2, to: DVec2) -> Self {
        let along = (to - from).normalize();
        let normal = DVec2::new(along.y, -along.x);
        self.0.extend([from, to].map(|at| Point { at, normal }));
        self
    }

    /// The curve `at(t)` for t in [0, 1] with the tangent `along(t)`, in `steps` chords.
    fn curve(mut self, steps: u32, at: impl Fn(f64) -> DVec2, along: impl Fn(f64) -> DVec2) -> Self {
        for i in 0..=steps {
            let t = f64::from(i) / f64::from(steps);
            let along = along(t).normalize();
            let normal = DVec2::new(along.y, -along.x);
            self.0.push(Point { at: at(t), normal });
        }
        self
    }

    /// A circular arc around `center` from the angle `from` to the angle `to`, radians from the r axis.
    pub fn arc(self, steps: u32, center: DVec2, radius: f64, from: f64, to: f64) -> Self {
        let angle = |t: f64| libm::sincos(from + (to - from) * t);
        let turn = (to - from).signum();
        self.curve(
            steps,
            |t| {
                let (sin, cos) = angle(t);
                center + DVec2::new(cos, sin) * radius
            },
            |t| {
                let (sin, cos) = angle(t);
                DVec2::new(-sin, cos) * turn
            },
        )
    }

    /// A Catmull-Rom spline through points (r, z), in `steps` chords from each to the next.
    pub fn spline(mut self, steps: u32, points: &[[f64; 2]]) -> Self {
        for i in 0..=steps * (points.len() as u32 - 1) {
            let t = f64::from(i) / f64::from(steps);
            let at = |t: f64| DVec2::from(loft::spline(points, t));
            let along = (at(t + 1e-4) - at(t - 1e-4)).normalize();
            let normal = DVec2::new(along.y, -along.x);
            self.0.push(Point { at: at(t), normal });
        }
        self
    }

    /// Stretches meet exactly: a point that is but for rounding where the one before it is moves there.
    fn join(&mut self) {
        for i in 1..self.0.len() {
            if self.0[i].at.distance(self.0[i - 1].at) < 1e-9 {
                self.0[i].at = self.0[i - 1].at;
            }
        }
    }

    /// Turn the outline around the z axis, in `around` steps.
    pub fn revolve(mut self, around: u32) -> Mesh {
        self.join();
        let mut mesh = Mesh::default();
        let turns: Vec<(f64, f64)> = (0..around)
            .map(|i| libm::sincos(2.0 * PI * f64::from(i) / f64::from(around)))
            .collect();
        let mut rings: Vec<(DVec2, Vec<u32>)> = Vec::new();
        for point in &self.0 {
            let first = mesh.positions.len() as u32;
            // A point on the axis is one vertex, with a normal along the axis.
            let on_axis = point.at.x.abs() < 1e-9;
            let turns = if on_axis { &[(0.0, 1.0)][..] } else { &turns };
            for (sin, cos) in turns {
                let turned = |p: DVec2| DVec3::new(p.x * cos, p.x * sin, p.y);
                let at = if on_axis { point.at.with_x(0.0) } else { point.at };
                mesh.positions.push(turned(at));
                mesh.normals.push(match on_axis {
                    true => DVec3::Z * point.normal.y.signum(),
                    false => turned(point.normal),
                });
            }
            let ring = match on_axis {
                true => vec![first; around as usize],
                false => (first..first + around).collect(),
            };
            rings.push((point.at, ring));
        }
        for pair in rings.windows(2) {
            let [(from, low), (to, high)] = pair else {
                continue;
            };
            // Where two stretches meet, perhaps in a sharp edge, the ring is there twice.
            if from == to {
                continue;
            }
            for i in 0..around as usize {
                let j = (i + 1) % around as usize;
                let mut face = vec![low[i], low[j], high[j], high[i]];
                face.dedup();
                if face.first() == face.last() {
                    face.pop();
                }
                mesh.faces.push(face);
            }
        }
        mesh
    }
}

pub fn v(r: f64, z: f64) -> DVec2 {
    DVec2::new(r, z)
}

/// A parabolic mirror z = r^2 / (4 f), its inside out, from the edge at `r` to the vertex.
fn parabola(profile: Profile, r: f64, f: f64) -> Profile {
    profile.curve(
        20,
        |t| v(r * (1.0 - t), r * r * (1.0 - t) * (1.0 - t) / (4.0 * f)),
        |t| v(-1.0, -r * (1.0 - t) / (2.0 * f)),
    )
}

/// Sagitta of a sphere of radius `sphere` at `r` from the axis.
fn sagitta(r: f64, sphere: f64) -> f64 {
    sphere - (sphere * sphere - r * r).sqrt()
}

/// Focal length of the spotlight's mirror: light from the focus backwards leaves it parallel to the axis, and the
/// mirror ends in the focal plane, at r = 2 f, where light that goes sideways still meets it.
const SPOT_F: f64 = 0.07;
/// End of the spotlight's tube.
const SPOT_FRONT: f64 = 0.20;

/// Parabolic mirror and mirroring tube of a spotlight, open at the front.
pub fn spot_reflector() -> Mesh {
    let r = 2.0 * SPOT_F;
    let tube = Profile::default().line(v(r, SPOT_FRONT), v(r, SPOT_F));
    parabola(tube, r, SPOT_F).revolve(72)
}

/// Plano-convex lens of a spotlight, front radius 0.45: a focal length of 0.9 at index 1.5. Its edge sits in the wall.
pub fn spot_lens() -> Mesh {
    let (r, back, edge, sphere) = (2.0 * SPOT_F + 0.008, 0.178, 0.186, 0.45);
    let half_angle = libm::asin(r / sphere);
    let center = edge + sagitta(r, sphere) - sphere;
    Profile::default()
        .line(v(0.0, back), v(r, back))
        .line(v(r, back), v(r, edge))
        .arc(14, v(0.0, center), sphere, 0.5 * PI - half_angle, 0.5 * PI)
        .revolve(72)
}

/// A Fresnel lens of a lighthouse, radius 1, flat at z = 0. At index 1.5 it makes light from z = -1.2 parallel to the z
/// axis: rings of cones, each for the light through its middle.
pub fn fresnel_lens() -> Mesh {
    const RINGS: u32 = 24;
    const FOCUS: f64 = 1.2;
    const INDEX: f64 = 1.5;
    let thin = 0.03;
    let width = 1.0 / f64::from(RINGS);
    let mut profile = Profile::default()
        .line(v(0.0, 0.0), v(1.0, 0.0))
        .line(v(1.0, 0.0), v(1.0, thin));
    for ring in (0..RINGS).rev() {
        let [inner, outer] = [ring, ring + 1].map(|edge| f64::from(edge) * width);
        let middle = 0.5 * (inner + outer);
        // The sine of the angle to the axis inside of the glass. The front is inclined by b with
        // sin b = n sin(b - angle), so that light leaves along the axis.
        let sine = middle / (middle * middle + FOCUS * FOCUS).sqrt() / INDEX;
        let slope = INDEX * sine / (INDEX * (1.0 - sine * sine).sqrt() - 1.0);
        let top = thin + slope * width;
        profile = profile.line(v(outer, thin), v(inner, top));
        if ring > 0 {
            profile = profile.line(v(inner, top), v(inner, thin));
        }
    }
    profile.revolve(96)
}

/// The tower of a lighthouse up to the floor of its lantern, with a gallery around it.
pub fn lighthouse() -> Mesh {
    Profile::default()
        .spline(8, &[[3.0, 0.0], [2.2, 3.5], [1.85, 7.0], [1.7, 9.6]])
        .line(v(1.7, 9.6), v(2.6, 10.1))
        .line(v(2.6, 10.1), v(2.6, 10.3))
        .line(v(2.6, 10.3), v(0.0, 10.3))
        .revolve(64)
}

/// The roof of its lantern: a dome with a ball on top.
pub fn lantern_roof() -> Mesh {
    Profile::default()
        .line(v(0.0, 13.3), v(2.2, 13.3))
        .line(v(2.2, 13.3), v(2.2, 13.45))
        .spline(6, &[[2.2, 13.45], [1.9, 13.95], [1.2, 14.4], [0.15, 14.7]])
        .arc(10, v(0.0, 14.9), 0.25, -libm::acos(0.6), 0.5 * PI)
        .revolve(64)
}

/// Outside of a spotlight; its lip meets the mirroring tube's end.
pub fn spot_housing() -> Mesh {
    let r = 2.0 * SPOT_F;
    let corners = [
        v(0.0, -0.05),
        v(0.07, -0.05),
        v(r + 0.02, 0.05),
        v(r + 0.02, SPOT_FRONT + 0.02),
        v(r + 0.006, SPOT_FRONT + 0.02),
        v(r, SPOT_FRONT),
    ];
    outline(&corners).revolve(48)
}

fn outline(corners: &[DVec2]) -> Profile {
    corners
        .windows(2)
        .fold(Profile::default(), |p, pair| p.line(pair[0], pair[1]))
}

/// Focal length of the headlight's mirror.
const HEADLIGHT_F: f64 = 0.03;
/// Radius of the headlight's mirror.
const HEADLIGHT_R: f64 = 0.10;
/// End of the headlight's mirror.
const HEADLIGHT_FRONT: f64 = 0.10;

/// Parabolic mirror of a headlight, a short mirroring tube before it.
pub fn headlight_reflector() -> Mesh {
    let depth = HEADLIGHT_R * HEADLIGHT_R / (4.0 * HEADLIGHT_F);
    let tube = Profile::default().line(v(HEADLIGHT_R, HEADLIGHT_FRONT), v(HEADLIGHT_R, depth));
    parabola(tube, HEADLIGHT_R, HEADLIGHT_F).revolve(72)
}

/// Front glass of a headlight: 4 mm between two spheres of radius 0.25.
pub fn headlight_glass() -> Mesh {
    let (r, back, thickness, sphere) = (HEADLIGHT_R + 0.005, 0.090, 0.004, 0.25);
    let half_angle = libm::asin(r / sphere);
    let center = back + sagitta(r, sphere) - sphere;
    let arc = |p: Profile, z, from, to| p.arc(12, v(0.0, center + z), sphere, from, to);
    let (pole, rim) = (0.5 * PI, 0.5 * PI - half_angle);
    let inner = arc(Profile::default(), 0.0, pole, rim);
    let edge = inner.line(v(r, back), v(r, back + thickness));
    arc(edge, thickness, rim, pole).revolve(72)
}

/// Outside of a headlight.
pub fn headlight_housing() -> Mesh {
    outline(&[
        v(0.0, -0.03),
        v(0.05, -0.03),
        v(HEADLIGHT_R + 0.02, 0.05),
        v(HEADLIGHT_R + 0.02, HEADLIGHT_FRONT + 0.005),
        v(HEADLIGHT_R + 0.008, HEADLIGHT_FRONT + 0.012),
        v(HEADLIGHT_R, HEADLIGHT_FRONT),
    ])
    .revolve(48)
}

/// Outside of a headlight that stands on a wing: a bullet, open at the front.
pub fn headlight_pod() -> Mesh {
    let (lip, front) = (HEADLIGHT_R + 0.022, HEADLIGHT_FRONT);
    let bullet = [
        [0.001, -0.34],
        [0.03, -0.325],
        [0.07, -0.25],
        [0.105, -0.13],
        [0.125, 0.0],
        [lip + 0.006, front - 0.015],
    ];
    Profile::default()
        .spline(4, &bullet)
        .line(v(lip + 0.006, front - 0.015), v(lip + 0.006, front))
        .revolve(40)
}

/// Post of a street lamp, 3.6 high with a lantern's cap and foot; the lantern between them, from 3.0 to 3.35, is left
/// out.
pub fn lamp_post() -> Mesh {
    let shaft = outline(&[
        v(0.17, 0.0),
        v(0.17, 0.12),
        v(0.12, 0.18),
        v(0.11, 0.55),
        v(0.065, 0.65),
        v(0.05, 2.55),
        v(0.075, 2.6),
        v(0.045, 2.66),
        v(0.045, 2.85),
        v(0.13, 2.97),
        v(0.13, 3.0),
        v(0.0, 3.0),
    ]);
    let mut mesh = shaft.revolve(16);
    let cap = outline(&[
        v(0.0, 3.35),
        v(0.22, 3.35),
        v(0.22, 3.38),
        v(0.06, 3.5),
        v(0.03, 3.6),
        v(0.0, 3.62),
    ]);
    mesh.append(cap.revolve(16));
    mesh
}

/// A bar stool of height 1, or, made wider, a table.
pub fn stool() -> Mesh {
    Profile::default()
        .line(v(0.0, 0.0), v(0.24, 0.0))
        .line(v(0.24, 0.0), v(0.24, 0.012))
        .spline(3, &[[0.24, 0.012], [0.15, 0.03], [0.05, 0.05], [0.028, 0.10]])
        .line(v(0.028, 0.10), v(0.028, 0.93))
        .line(v(0.028, 0.93), v(0.17, 0.945))
        .arc(5, v(0.17, 0.9725), 0.0275, -0.5 * PI, 0.5 * PI)
        .line(v(0.17, 1.0), v(0.0, 1.0))
        .revolve(32)
}

/// Front of a loudspeaker of radius 1, facing +z: its rim, its rubber ring, its cone and the cap in the middle.
pub fn speaker() -> Mesh {
    Profile::default()
        .line(v(1.0, 0.0), v(1.0, 0.04))
        .line(v(1.0, 0.04), v(0.9, 0.04))
        .line(v(0.9, 0.04), v(0.9, 0.02))
        .arc(5, v(0.82, 0.02), 0.08, 0.0, PI)
        .line(v(0.74, 0.02), v(0.28, -0.22))
        .spline(4, &[[0.28, -0.22], [0.2, -0.14], [0.1, -0.1], [0.0, -0.09]])
        .revolve(32)
}

/// A bottle of height 1, without an inside.
pub fn bottle() -> Mesh {
    let body = [
        [0.145, 0.02],
        [0.15, 0.05],
        [0.15, 0.5],
        [0.148, 0.58],
        [0.11, 0.67],
        [0.055, 0.75],
    ];
    Profile::default()
        .line(v(0.0, 0.0), v(0.13, 0.0))
        .line(v(0.13, 0.0), v(0.145, 0.02))
        .spline(4, &body)
        .line(v(0.055, 0.75), v(0.05, 0.95))
        .line(v(0.05, 0.95), v(0.058, 0.955))
        .line(v(0.058, 0.955), v(0.058, 0.995))
        .line(v(0.058, 0.995), v(0.0, 1.0))
        .revolve(32)
}

/// Corners (r, z) of the goblet's outline: outside from the foot up to the rim, then down the inside.
const GOBLET: [[f64; 2]; 19] = [
    [0.0, 0.012],
    [0.18, 0.008],
    [0.34, 0.0],
    [0.37, 0.012],
    [0.34, 0.026],
    [0.16, 0.055],
    [0.055, 0.14],
    [0.042, 0.32],
    [0.05, 0.50],
    [0.14, 0.60],
    [0.30, 0.74],
    [0.37, 0.95],
    [0.35, 1.18],
    [0.315, 1.38],
    [0.300, 1.392],
    [0.288, 1.38],
    [0.325, 1.17],
    [0.345, 0.95],
    [0.275, 0.765],
];
/// Inner bottom of the goblet's bowl.
const GOBLET_BOTTOM: f64 = 0.655;

/// A wine glass: a Catmull-Rom spline through its outline's corners.
pub fn goblet() -> Mesh {
    let mut corners: Vec<DVec2> = GOBLET.iter().map(|c| DVec2::from(*c)).collect();
    corners.push(v(0.14, GOBLET_BOTTOM + 0.02));
    corners.push(v(0.0, GOBLET_BOTTOM));
    // Beyond the axis the outline goes on as its mirror image, so that the poles are flat.
    let mirrored = |p: DVec2| v(-p.x, p.y);
    let (first, last) = (mirrored(corners[1]), mirrored(corners[corners.len() - 2]));
    corners.insert(0, first);
    corners.push(last);
    let mut profile = Profile::default();
    for (i, c) in corners.windows(4).enumerate() {
        let [a, b, d, e] = [c[0], c[1], c[2], c[3]];
        let (p, q) = (0.5 * (d - a), 0.5 * (e - b));
        let (square, cube) = (3.0 * (d - b) - 2.0 * p - q, 2.0 * (b - d) + p + q);
        profile = profile.curve(
            5,
            |t| b + (p + (square + cube * t) * t) * t,
            |t| p + (2.0 * square + 3.0 * cube * t) * t,
        );
        // The next stretch starts with the point that this one ends with.
        if i + 4 < corners.len() {
            profile.0.pop();
        }
    }
    profile.revolve(80)
}

/// A pillar candle of radius 0.35 and height 1 that has burned a hollow.
pub fn candle() -> Mesh {
    let hollow = [
        [0.35, 0.93],
        [0.345, 0.98],
        [0.325, 1.0],
        [0.30, 0.98],
        [0.265, 0.92],
        [0.15, 0.875],
        [0.0, 0.865],
    ];
    Profile::default()
        .line(v(0.0, 0.0), v(0.33, 0.0))
        .arc(4, v(0.33, 0.02), 0.02, -0.5 * PI, 0.0)
        .line(v(0.35, 0.02), v(0.35, 0.93))
        .spline(4, &hollow)
        .revolve(96)
}

/// A bishop of chess, 1 high and 0.44 wide.
pub fn bishop() -> Mesh {
    let outline = [
        [0.21, 0.0],
        [0.22, 0.03],
        [0.205, 0.065],
        [0.18, 0.085],
        [0.185, 0.115],
        [0.14, 0.16],
        [0.095, 0.26],
        [0.075, 0.38],
        [0.075, 0.50],
        [0.12, 0.545],
        [0.125, 0.565],
        [0.085, 0.59],
        [0.11, 0.625],
        [0.135, 0.70],
        [0.12, 0.79],
        [0.07, 0.875],
        [0.03, 0.91],
        [0.045, 0.945],
        [0.035, 0.985],
        [0.0, 1.0],
    ];
    Profile::default()
        .line(v(0.0, 0.0), v(0.21, 0.0))
        .spline(4, &outline)
        .revolve(72)
}

/// A band of inner radius 1, outer radius 1.08 and height 0.42 that stands on z = 0, its edges rounded.
pub fn ring() -> Mesh {
    let (inner, outer, height, round) = (1.0, 1.08, 0.42, 0.03);
    let corners = [
        (v(outer - round, round), -0.5 * PI),
        (v(outer - round, height - round), 0.0),
        (v(inner + round, height - round), 0.5 * PI),
        (v(inner + round, round), PI),
    ];
    let mut profile = Profile::default();
    for (center, from) in corners {
        profile = profile.arc(4, center, round, from, from + 0.5 * PI);
    }
    closed(profile).revolve(128)
}

/// A tyre of outer radius 0.38 and width 0.24, with a hub.
pub fn tyre() -> Mesh {
    let (radius, half, round) = (0.38, 0.12, 0.05);
    Profile::default()
        .line(v(0.0, -half + 0.04), v(0.2, -half + 0.02))
        .line(v(0.2, -half + 0.02), v(0.24, -half))
        .line(v(0.24, -half), v(radius - round, -half))
        .arc(5, v(radius - round, -half + round), round, -0.5 * PI, 0.0)
        .arc(5, v(radius - round, half - round), round, 0.0, 0.5 * PI)
        .line(v(radius - round, half), v(0.24, half))
        .line(v(0.24, half), v(0.2, half - 0.02))
        .line(v(0.2, half - 0.02), v(0.0, half - 0.04))
        .revolve(48)
}

fn closed(mut profile: Profile) -> Profile {
    let first = profile.0[0];
    profile.0.push(first);
    profile
}
