//! The camera.

use crate::camera::Camera;
use crate::math::{Frame, Vec3};
use crate::scene::parse::{CameraRecord, Fault, FovAxis, ImageRecord};
use glam::DVec3;
use toml::Spanned;

const MAX_SIDE: u32 = 32768;

fn side(side: &Spanned<u32>) -> Result<u32, Fault> {
    match *side.get_ref() {
        n if (1..=MAX_SIDE).contains(&n) => Ok(n),
        n => Err(Fault::new(
            side.span(),
            format!("expected 1 to {MAX_SIDE} pixels, found {n}"),
        )),
    }
}

/// The camera at the origin of render space.
pub fn camera(image: &ImageRecord, record: &CameraRecord) -> Result<Camera, Fault> {
    let (width, height) = (side(&image.width)?, side(&image.height)?);
    let view = record.target.get_ref().0 - record.origin.0;
    let forward = view
        .try_normalize()
        .ok_or_else(|| Fault::new(record.target.span(), "expected a point other than `origin`"))?;
    let up = record.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0);
    let right = forward.cross(up.normalize_or_zero());
    if right.length() < 1e-9 {
        let span = record
            .up
            .as_ref()
            .map_or(record.target.span(), |up| up.span());
        return Err(Fault::new(
            span,
            "`up` must not be zero or parallel to the direction from `origin` to `target`",
        ));
    }
    let right = right.normalize();

    let tan = libm::tan(0.5 * record.fov.get_ref().0.to_radians());
    let aspect = f64::from(width) / f64::from(height);
    let horizontal = match record.fov_axis {
        FovAxis::X => true,
        FovAxis::Y => false,
        FovAxis::Smaller => width <= height,
        FovAxis::Larger => width >= height,
    };
    let tan_half_fov_x = if horizontal { tan } else { tan * aspect } as f32;
    let focus_distance = match record.focus_distance {
        Some(distance) => distance.f32(),
        None => view.length() as f32,
    };
    if !(1e-12..1e12).contains(&tan_half_fov_x) || !(1e-15..1e15).contains(&focus_distance) {
        return Err(Fault::new(
            record.fov.span(),
            "field of view or focus distance too extreme for single precision",
        ));
    }
    Ok(Camera {
        position: Vec3::ZERO,
        frame: Frame {
            s: right.as_vec3(),
            t: right.cross(forward).as_vec3(),
            n: forward.as_vec3(),
        },
        tan_half_fov_x,
        aperture: record.aperture.map_or(0.0, |radius| radius.f32()),
        focus_distance,
        width,
        height,
    })
}
