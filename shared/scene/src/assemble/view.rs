//! The camera.

use crate::parse::{CameraRecord, CropRecord, Extent, Eye, Fault, FovAxis, ImageRecord, PanoramaExtent};
use crate::transform::single;
use crate::values::Spanned;
use beamfarm_render::math::{Frame, Vec2, Vec3};
use beamfarm_render::world::camera::{Camera, Projection};
use beamfarm_render::world::panorama::Panorama;
use glam::{Affine3A, DAffine3, DMat3, DVec2, DVec3};

const MAX_SIDE: u32 = 32768;

/// The pixel window that is rendered.
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

/// To camera coordinates: x right, y up, z backwards. An eye without a direction gets the world's axes; it is refused
/// elsewhere.
pub fn camera_from_world(eye: &Eye) -> Affine3A {
    let up = eye.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0);
    let back = (eye.origin.0 - eye.target.get_ref().0).normalize_or(DVec3::Z);
    let right = up.cross(back).normalize_or(DVec3::X);
    let turn = DMat3::from_cols(right, back.cross(right), -back).transpose();
    single(&(DAffine3::from_mat3(turn) * DAffine3::from_translation(-eye.origin.0)))
}

/// Whether the field of view is measured along the width.
fn is_horizontal(axis: FovAxis, [width, height]: [u32; 2]) -> bool {
    match axis {
        FovAxis::X => true,
        FovAxis::Y => false,
        FovAxis::Smaller => width <= height,
        FovAxis::Larger => width >= height,
    }
}

/// A panorama, and half its width on the film.
fn panorama(extent: &PanoramaExtent, [width, height]: [u32; 2]) -> (Panorama, f64) {
    let PanoramaExtent { mapping, fov, .. } = *extent;
    let on_film = |degrees: f64| mapping.distance(0.5 * degrees.to_radians());
    let aspect = f64::from(width) / f64::from(height);
    let half = match is_horizontal(extent.axis, [width, height]) {
        true => on_film(fov),
        false => on_film(fov) * aspect,
    };
    let row = extent
        .vertical_fov
        .map_or(1.0, |vertical| on_film(vertical) / half * aspect);
    let panorama = Panorama {
        mapping,
        row: row as f32,
        circle: on_film(extent.image_circle) as f32,
    };
    (panorama, half)
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
            let tan = libm::tan(0.5 * fov.get_ref().to_radians());
            let aspect = f64::from(width) / f64::from(height);
            let tan = if is_horizontal(*axis, [width, height]) {
                tan
            } else {
                tan * aspect
            };
            (Projection::Perspective, tan, fov.span())
        }
        Extent::Width(width) => (Projection::Orthographic, 0.5 * width.get_ref().0, width.span()),
        Extent::Panorama(extent) => {
            let (panorama, half) = panorama(extent, [width, height]);
            let place = record.fov.as_ref().map_or(eye.target.span(), |fov| fov.span());
            (Projection::Panoramic(panorama), half, place)
        }
    };
    let row = match projection {
        Projection::Perspective | Projection::Orthographic => 1.0,
        Projection::Panoramic(panorama) => f64::from(panorama.row),
    };
    // Everything below concerns the window, whose centre is offset from the image's in the same plane.
    let window = window(image, [width, height])?;
    let pixel = 2.0 * half / f64::from(width);
    let [x, y] = record.principal_point.as_ref().map_or([0.0; 2], |p| p.get_ref().0);
    let off_middle = |start: u32, side: u32, all: u32, offset: f64| {
        f64::from(start) + 0.5 * f64::from(side) + (offset - 0.5) * f64::from(all)
    };
    let shift = DVec2::new(
        off_middle(window.x, window.width, width, x),
        -off_middle(window.y, window.height, height, y) * row,
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
                Projection::Perspective | Projection::Panoramic(_) => {
                    "field of view or focus distance too extreme for single precision"
                }
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

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::bundle::Bundle;

    fn camera(fields: &str, image: &str) -> Result<Camera, String> {
        let text = format!("image = {{ {image} }}\n[camera]\norigin = [1, 2, 3]\ntarget = [1, 2, 9]\n{fields}\n");
        let mut bundle = Bundle {
            scene: "scene.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("scene.toml".into(), text.into());
        let description = crate::load(&bundle).map_err(|error| error.to_string())?;
        Ok(description.camera)
    }

    /// The camera looks along z, so that image right is -x. Points of the image are in [0, 1].
    fn assert_sees(fields: &str, image: &str, rays: &[([f32; 2], Option<Vec3>)]) {
        let camera = camera(fields, image).unwrap();
        for ([x, y], expected) in rays {
            let at = Vec2::new(x * camera.width as f32, y * camera.height as f32);
            let found = camera.sees(at).then(|| camera.ray(at, Vec2::ZERO).dir);
            let is_alike = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected.normalize()).length() < 1e-5,
                (None, None) => true,
                _ => false,
            };
            assert!(is_alike, "{fields} {image}: {x} {y} {found:?} {expected:?}");
        }
    }

    #[test]
    fn panoramas_see_what_their_fields_say() {
        let (right, up, ahead) = (Vec3::NEG_X, Vec3::Y, Vec3::Z);
        let whole = "projection = \"equirectangular\"";
        let wide = "width = 60, height = 20";
        let all = [
            ([0.5, 0.5], Some(ahead)),
            ([0.75, 0.5], Some(right)),
            ([0.0, 0.5], Some(-ahead)),
            ([0.25, 0.5], Some(-right)),
            ([0.5, 0.25], Some(ahead + up)),
            ([0.3, 0.0], Some(up)),
        ];
        assert_sees(whole, wide, &all);
        // The window right of the centre, and above.
        let window = format!("{wide}, crop = {{ x = 30, y = 0, width = 30, height = 10 }}");
        assert_sees(
            whole,
            &window,
            &[([0.5, 1.0], Some(right)), ([0.0, 0.5], Some(ahead + up))],
        );
        let part = format!("{whole}\nfov = 90\nvertical_fov = 60\nprincipal_point = [0.5, -0.5]");
        // The centre is 45 degrees to the right and 30 up.
        let middle = (ahead + right).normalize() * 3f32.sqrt() + up;
        assert_sees(
            &part,
            wide,
            &[
                ([0.5, 0.5], Some(middle)),
                ([0.0, 1.0], Some(ahead)),
                ([1.0, 1.0], Some(right)),
            ],
        );
        let cylinder = "projection = \"cylindrical\"\nfov = 180";
        // As high as 1 / 3 of pi.
        let top = ahead + up * (std::f32::consts::PI / 6.0);
        assert_sees(cylinder, wide, &[([1.0, 0.5], Some(right)), ([0.5, 0.0], Some(top))]);
        let fisheye = "projection = \"fisheye\"\nfov_axis = \"y\"";
        let round = [
            ([0.5, 0.0], Some(up)),
            ([0.5 - 0.5 / 6.0, 0.5], Some(ahead - right)),
            ([0.1, 0.5], None),
        ];
        assert_sees(fisheye, wide, &round);
        let equisolid = format!("{fisheye}\nmapping = \"equisolid\"\nfov = 120\nimage_circle = 200");
        // sin(30 degrees) at the top edge. Twice that would be 180 degrees, which is outside the field. `share`: the
        // sine of 45 degrees over that of 30, times a sixth of the width.
        let share = 2f32.sqrt() / 6.0;
        let round = [
            ([0.5, 0.0], Some(up * 3f32.sqrt() + ahead)),
            ([0.5 + share, 0.5], Some(right)),
            ([0.5 + 1.6 / 6.0, 0.5], None),
        ];
        assert_sees(&equisolid, wide, &round);
    }

    #[test]
    fn what_no_camera_is_is_told() {
        for (fields, words) in [
            (
                "fov = 180",
                "camera.fov: expected an angle in degrees between 0 and 180, both excluded, found 180.0",
            ),
            ("fov = 400", "expected an angle in degrees above 0, to 360"),
            (
                "fov = 40\nimage_circle = 40",
                "camera.image_circle: \"perspective\" does not take this field",
            ),
            (
                "projection = \"equirectangular\"\nvertical_fov = 181",
                "camera.vertical_fov: expected at most 180 degrees",
            ),
            (
                "projection = \"cylindrical\"\nview_width = 1",
                "camera.view_width: \"cylindrical\" does not take",
            ),
            (
                "projection = \"fisheye\"\naperture = 0.1",
                "panoramas are in focus everywhere",
            ),
        ] {
            let error = camera(fields, "width = 4, height = 4").unwrap_err();
            assert!(error.contains(words), "{fields}: {error}");
        }
    }
}
