//! A point light in fog in a black box, and its single scattering by quadrature.

use glam::{DVec2, DVec3};

/// The fog, with Henyey and Greenstein's phase function.
#[derive(Clone, Copy, Debug)]
pub struct PointInFog {
    /// Scattering, RGB, per scene unit.
    pub sigma_s: [f64; 3],
    /// Absorption, RGB, per scene unit.
    pub sigma_a: [f64; 3],
}

const LIGHT: DVec3 = DVec3::new(0.3, 0.4, -1.0);
const INTENSITY: [f64; 3] = [3.0, 2.0, 1.0];
const G: f64 = 0.4;

impl PointInFog {
    /// Pixels along a side of the picture.
    pub const SIZE: usize = 24;

    /// The scene, without `[render]`.
    pub fn scene(&self) -> String {
        let Self { sigma_s, sigma_a } = self;
        let size = Self::SIZE;
        format!(
            r#"
[image]
width = {size}
height = {size}
[world]
medium = "fog"
[camera]
origin = [0.0, 0.0, 2.0]
target = [0.0, 0.0, 0.0]
fov = 60.0
[media.fog]
type = "homogeneous"
sigma_a = {sigma_a:?}
sigma_s = {sigma_s:?}
phase = {{ type = "hg", g = {G} }}
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "cube"
flip_normals = true
material = "black"
transform = [ {{ scale = 3.0 }} ]
[[lights]]
type = "point"
position = {:?}
intensity = {INTENSITY:?}
"#,
            LIGHT.to_array()
        )
    }

    /// Radiance of light scattered once, averaged over 4 x 4 rays through the pixel with this top left corner, and the
    /// smallest distance of one of them to the light.
    pub fn pixel_integral(&self, corner: DVec2) -> (DVec3, f64) {
        let origin = DVec3::new(0.0, 0.0, 2.0);
        let tan = libm::tan(30f64.to_radians());
        let (mut sum, mut nearest) = (DVec3::ZERO, f64::INFINITY);
        for i in 0..16 {
            let sub = DVec2::new(f64::from(i % 4) + 0.5, f64::from(i / 4) + 0.5) / 4.0;
            let p = (corner + sub) / Self::SIZE as f64 * 2.0 - 1.0;
            let dir = DVec3::new(p.x * tan, -p.y * tan, -1.0).normalize();
            // To the wall of the box [-3, 3]^3.
            let walls = (0..3).map(|axis| (3f64.copysign(dir[axis]) - origin[axis]) / dir[axis]);
            let length = walls.fold(f64::INFINITY, f64::min);
            let middle = (LIGHT - origin).dot(dir);
            let height = (origin + dir * middle - LIGHT).length();
            nearest = nearest.min(height);
            // t = middle + height tan(a) makes the integrand smooth.
            let from = libm::atan2(-middle, height);
            let to = libm::atan2(length - middle, height);
            let steps = 400;
            for k in 0..steps {
                let a = from + (to - from) * (f64::from(k) + 0.5) / f64::from(steps);
                let t = middle + height * libm::tan(a);
                let from_light = origin + dir * t - LIGHT;
                let distance = from_light.length();
                let cos = -from_light.dot(dir) / distance;
                let q = 1.0 + G * G - 2.0 * G * cos;
                let phase = (1.0 - G * G) / (4.0 * std::f64::consts::PI * q * q.sqrt());
                // dt = distance^2 / height da, which cancels the square of the distance.
                let step = (to - from) / f64::from(steps) / height;
                for c in 0..3 {
                    let tr = libm::exp(-(self.sigma_a[c] + self.sigma_s[c]) * (t + distance));
                    sum[c] += self.sigma_s[c] * phase * tr * INTENSITY[c] * step;
                }
            }
        }
        (sum / 16.0, nearest)
    }
}
