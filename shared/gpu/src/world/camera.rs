//! The camera, as in `kernels/camera.wgsl`.

use super::reason::{Of, Reason, Why};
use beamfarm_render::world::camera::{self, Projection};
use beamfarm_render::world::filter::PixelFilter;
use beamfarm_render::world::{Scene, StartMedium};
use bytemuck::{Pod, Zeroable};

/// A pinhole, a thin lens, or parallel rays. Render space.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Camera {
    /// Centre of the lens, or of the plane that parallel rays start on.
    pub position: [f32; 3],
    /// Pixels per row.
    pub width: u32,
    /// To the right of the image.
    pub s: [f32; 3],
    /// Rows.
    pub height: u32,
    /// Up.
    pub t: [f32; 3],
    /// Radius of the lens, scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Forward.
    pub n: [f32; 3],
    /// Distance of the plane in focus along the axis, scene units.
    pub focus_distance: f32,
    /// Centre of the image, on the plane at distance 1; with parallel rays, in scene units.
    pub shift: [f32; 2],
    /// Side of a pixel there.
    pub pixel: f32,
    /// Number of the medium that its rays start in, or [`VACUUM`](super::VACUUM).
    pub medium: u32,
    /// 1: rays are parallel.
    pub is_parallel: u32,
    padding: [u32; 3],
}

impl Camera {
    /// A camera whose rays start in the medium with this number.
    #[must_use]
    pub fn new(camera: &camera::Camera, medium: u32) -> Self {
        Self {
            position: camera.position.to_array(),
            width: camera.width,
            s: camera.frame.s.to_array(),
            height: camera.height,
            t: camera.frame.t.to_array(),
            aperture: camera.aperture,
            n: camera.frame.n.to_array(),
            focus_distance: camera.focus_distance,
            shift: camera.shift.to_array(),
            pixel: 2.0 * camera.half_width / camera.width as f32,
            medium,
            is_parallel: u32::from(camera.projection == Projection::Orthographic),
            padding: [0; 3],
        }
    }
}

/// A scene's camera. Adds reasons to the list.
pub(super) fn flatten(scene: &Scene, reasons: &mut Vec<Reason>) -> Camera {
    let camera = &scene.description().camera;
    let mut no = |of: Of, field: &'static str, what: &'static str| {
        reasons.push(Reason {
            of,
            field,
            why: Why::Missing(what),
        });
    };
    // If samples count for several pixels, films are reconstructed afterwards.
    match camera.filter {
        PixelFilter::Box => {}
        PixelFilter::Tent { .. } | PixelFilter::Gaussian { .. } => {
            if !camera.filter.spreads() {
                no(Of::Scene, "filter", "filters that are narrower than a pixel");
            }
        }
    }
    if let Projection::Panoramic(_) = camera.projection {
        no(Of::Camera, "projection", "panoramas");
    }
    let medium = match scene.camera_medium() {
        StartMedium::One(medium) => super::medium(medium),
        StartMedium::ByPlace => {
            no(Of::Camera, "position", "cameras that are in several media");
            super::VACUUM
        }
    };
    Camera::new(camera, medium)
}
