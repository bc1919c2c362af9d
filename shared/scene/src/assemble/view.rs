//! The camera.

use super::texture::graph::single;
use crate::parse::{CameraRecord, CropRecord, Extent, Eye, Fault, FovAxis, ImageRecord};
use crate::values::Spanned;
use beamfarm_render::math::{Frame, Vec2, Vec3};
use beamfarm_render::world::camera::{Camera, Projection};
use glam::{Affine3A, DAffine3, DMat3, DVec2, DVec3};

const MAX_SIDE: u32 = 32768;

/// The pixels that are rendered.
fn window(image: &ImageRecord, [width, height]: [u32; 2]) -> Result<CropRecord, Fault> {
    let Some(crop) = &image.crop else {
        return Ok(CropRecord {
            x: 0,
            y: 0,
            width,
            height,
        });
    };
    let window = *crop.get_ref();
    let fits = |start: u32, side: u32, all: u32| side >= 1 && start.checked_add(side).is_some_and(|end| end <= all);
    if !fits(window.x, window.width, width) || !fits(window.y, window.height, height) {
        return Err(Fault::new(
            crop.span(),
            format!("expected at least one pixel, all of them within the image of {width} x {height}"),
        ));
    }
    Ok(window)
}

fn side(side: &Spanned<u32>) -> Result<u32, Fault> {
    match *side.get_ref() {
        n if (1..=MAX_SIDE).contains(&n) => Ok(n),
        n => Err(Fault::new(
            side.span(),
            format!("expected 1 to {MAX_SIDE} pixels, found {n}"),
        )),
    }
}

/// To the camera's coordinates: x to the right, y up, and z away from it. What looks nowhere has those of
/// the world; it is refused elsewhere.
pub fn camera_from_world(eye: &Eye) -> Affine3A {
    let up = eye.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0);
    let back = (eye.origin.0 - eye.target.get_ref().0).normalize_or(DVec3::Z);
    let right = up.cross(back).normalize_or(DVec3::X);
    let turn = DMat3::from_cols(right, back.cross(right), -back).transpose();
    single(&(DAffine3::from_mat3(turn) * DAffine3::from_translation(-eye.origin.0)))
}

/// The camera at the origin of render space.
pub fn camera(image: &ImageRecord, record: &CameraRecord, eye: &Eye) -> Result<Camera, Fault> {
    let (width, height) = (side(&image.width)?, side(&image.height)?);
    let view = eye.target.get_ref().0 - eye.origin.0;
    let forward = view
        .try_normalize()
        .ok_or_else(|| Fault::new(eye.target.span(), "expected a point other than `origin`"))?;
    let up = eye.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0);
    let right = forward.cross(up.normalize_or_zero());
    if right.length() < 1e-9 {
        let span = eye.up.as_ref().map_or(eye.target.span(), |up| up.span());
        return Err(Fault::new(
            span,
            "`up` must not be zero or parallel to the direction from `origin` to `target`",
        ));
    }
    let right = right.normalize();

    let (projection, half, place) = match &eye.extent {
        Extent::Angle(fov, axis) => {
            let tan = libm::tan(0.5 * fov.get_ref().0.to_radians());
            let aspect = f64::from(width) / f64::from(height);
            let horizontal = match axis {
                FovAxis::X => true,
                FovAxis::Y => false,
                FovAxis::Smaller => width <= height,
                FovAxis::Larger => width >= height,
            };
            let tan = if horizontal { tan } else { tan * aspect };
            (Projection::Perspective, tan, fov.span())
        }
        Extent::Width(width) => (Projection::Orthographic, 0.5 * width.get_ref().0, width.span()),
    };
    // Everything below is of the window; its middle is off that of the image, whose plane it lies in.
    let window = window(image, [width, height])?;
    let pixel = 2.0 * half / f64::from(width);
    let [x, y] = record.principal_point.as_ref().map_or([0.0; 2], |p| p.get_ref().0);
    let off_middle = |start: u32, side: u32, all: u32, offset: f64| {
        f64::from(start) + 0.5 * f64::from(side) + (offset - 0.5) * f64::from(all)
    };
    let shift = DVec2::new(
        off_middle(window.x, window.width, width, x),
        -off_middle(window.y, window.height, height, y),
    ) * pixel;
    if let Some(point) = &record.principal_point
        && shift.abs().max_element() >= 1e12
    {
        return Err(Fault::new(point.span(), "too far from the middle for single precision"));
    }
    let half_width = (half * (f64::from(window.width) / f64::from(width))) as f32;
    let focus_distance = match record.focus_distance {
        Some(distance) => distance.f32(),
        None => view.length() as f32,
    };
    if !(1e-12..1e12).contains(&half_width) || !(1e-15..1e15).contains(&focus_distance) {
        return Err(Fault::new(
            place,
            match projection {
                Projection::Perspective => "field of view or focus distance too extreme for single precision",
                Projection::Orthographic => "width or focus distance too extreme for single precision",
            },
        ));
    }
    let to_the_right = if record.flip_x { -right } else { right };
    Ok(Camera {
        projection,
        position: Vec3::ZERO,
        frame: Frame {
            s: to_the_right.as_vec3(),
            t: right.cross(forward).as_vec3(),
            n: forward.as_vec3(),
        },
        half_width,
        // The difference of equal halves may be -0.
        shift: shift.as_vec2() + Vec2::ZERO,
        aperture: record.aperture.map_or(0.0, |radius| radius.f32()),
        focus_distance,
        width: window.width,
        height: window.height,
        filter: image.filter.0,
    })
}
