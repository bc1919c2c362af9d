//! Shared by the tests of beams: random beams, segments and media.

mod crossing;
mod estimate;
mod expectation;
mod sums;
mod varying;
mod walls;

use super::gather::PieceParts;
use super::{Beam, BeamEnds, Brought, Piece, Scattering, Segment};
use crate::hierarchy::{Bounds, Level};
use crate::kernels::{GATHER, PIECES};
use crate::sizes::Sizes;
use crate::testing::same_layout;
use beamfarm_render::math::{Frame, Rgb, Vec3, sin_cos};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::medium::{Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;

pub fn sampler(number: u64) -> Sampler {
    Sampler::new(1, 0, Purpose::Test, number)
}

/// Uniform in a cube around the origin.
pub fn point(sampler: &mut Sampler, half: f32) -> Vec3 {
    let [x, y, z] = [(); 3].map(|_| half * (2.0 * sampler.next_1d() - 1.0));
    Vec3::new(x, y, z)
}

pub fn dir(sampler: &mut Sampler) -> Vec3 {
    warp::uniform_sphere(sampler.next_2d())
}

/// A direction at an angle with this sine to another, at a random azimuth.
pub fn dir_at(sampler: &mut Sampler, from: Vec3, sine: f32) -> Vec3 {
    let angle = std::f32::consts::TAU * sampler.next_1d();
    let (sine_around, cosine_around) = sin_cos(angle);
    let along = (1.0 - sine * sine).max(0.0).sqrt();
    Frame::from_normal(from)
        .to_world(Vec3::new(sine * cosine_around, sine * sine_around, along))
        .normalize()
}

pub fn media() -> [Homogeneous; 4] {
    let medium = |a: [f32; 3], s: [f32; 3], phase| Homogeneous {
        sigma_a: Rgb::from_array(a),
        sigma_s: Rgb::from_array(s),
        phase,
    };
    [
        medium([0.1; 3], [0.4; 3], Phase::Isotropic),
        medium([0.0, 0.1, 0.3], [0.5, 0.2, 1.5], Phase::HenyeyGreenstein { g: 0.85 }),
        medium([0.3; 3], [0.1, 0.2, 0.3], Phase::HenyeyGreenstein { g: -0.6 }),
        medium([0.2, 0.0, 0.1], [0.5; 3], Phase::blend(0.3, [0.999, -0.4])),
    ]
}

pub fn scatterings() -> [Scattering; 4] {
    media().map(|medium| Scattering::from(&Medium::Homogeneous(medium)))
}

#[test]
fn beams_and_what_gathers_them_lie_in_memory_as_kernels_have_them() {
    for program in [PIECES, GATHER] {
        same_layout!(&program, Sizes { groups, count });
        same_layout!(
            &program,
            Beam {
                origin,
                radius,
                dir,
                radius_slope,
                power,
                length,
                extent,
                medium,
                walls
            }
        );
        same_layout!(
            &program,
            BeamEnds {
                start,
                start_is,
                end,
                end_is
            }
        );
        same_layout!(
            &program,
            Piece {
                origin,
                start,
                dir,
                end,
                power,
                radius,
                radius_slope,
                max_radius,
                beam,
                medium
            }
        );
        same_layout!(
            &program,
            Bounds {
                low,
                spare_low,
                high,
                spare_high
            }
        );
    }
    same_layout!(&GATHER, Level { here, below });
    same_layout!(
        &GATHER,
        PieceParts {
            first,
            end,
            level,
            spare
        }
    );
    same_layout!(
        &GATHER,
        Segment {
            origin,
            length,
            dir,
            medium,
            pixel,
            steps,
            step_count,
            bits
        }
    );
    same_layout!(
        &GATHER,
        Scattering {
            sigma_s,
            spare_s,
            sigma_t,
            spare_t,
            lobes
        }
    );
    same_layout!(&GATHER, Brought { radiance, count });
}
