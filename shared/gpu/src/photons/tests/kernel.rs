//! The kernel, as it blurs over surfaces.

use super::{PHOTON, REQUEST, estimated};
use crate::photons::PhotonRequest;
use crate::testing::tested;
use beamfarm_render::cpu::photon_map::SurfacePhoton;
use beamfarm_render::math::Vec3;

/// On a plane tilted against the photon's, the kernel's area grows by one over the cosine, which the cosine of the
/// normals compensates. A plane farther away than a quarter of the radius counts as another surface.
#[test]
fn kernel_integrates_to_one_over_planes() {
    let Some(tested) = tested() else { return };
    for (tilt, off) in [(0.0f32, 0.0), (0.1, 0.0), (0.0, 0.3)] {
        let at = Vec3::new(0.3, -0.2, 1.0);
        let ng = Vec3::new(0.0, tilt, 1.0).normalize();
        let photon = SurfacePhoton {
            point: at,
            ng,
            wi: Vec3::Z,
            radius: 0.25,
            ..PHOTON
        };
        let n = 200;
        let requests: Vec<PhotonRequest> = (0..n * n)
            .map(|slot| {
                let (x, y) = ((slot % n) as f32, (slot / n) as f32);
                let p = [(x + 0.5) / n as f32 - 0.2, (y + 0.5) / n as f32 - 0.7, 1.0 + off * 0.25];
                PhotonRequest {
                    point: p,
                    slot,
                    value: [0.5, 1.5, 2.0],
                    ..REQUEST
                }
            })
            .collect();
        let (got, _) = estimated(tested, &[photon], &requests);
        // The second channel starts at zero.
        let sum = got.iter().map(|radiance| f64::from(radiance[1])).sum::<f64>() / f64::from(n * n);
        let expected = if off > 0.0 { 0.0 } else { 1.5 };
        assert!((sum - expected).abs() < 2e-3, "{tilt} {off} {sum}");
    }
}
