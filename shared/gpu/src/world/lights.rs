//! Lights, as in `kernels/emission.wgsl`.

use super::reason::{Of, Reason, Why};
use beamfarm_render::math::{PI, Rgb, Vec3, sin};
use beamfarm_render::warp;
use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
use beamfarm_render::world::light::{self, Environment, LightKind, Pattern, Projector, Ramp, SceneBounds, Spot, Sun};
use beamfarm_render::world::texture::{Texture, TextureFilter, Wrap};
use beamfarm_render::world::{Scene, StartMedium};
use bytemuck::{Pod, Zeroable};

pub(crate) const POINT: u32 = 0;
pub(crate) const SPOT: u32 = 1;
pub(crate) const SMOOTH_SPOT: u32 = 2;
pub(crate) const DIRECTIONAL: u32 = 3;
pub(crate) const SUN: u32 = 4;
pub(crate) const AREA: u32 = 5;
pub(crate) const TWO_SIDED_AREA: u32 = 6;
pub(crate) const ENVIRONMENT: u32 = 7;
pub(crate) const ENVIRONMENT_MAP: u32 = 8;
pub(crate) const PROJECTOR: u32 = 9;

const SOFT: (&str, &str) = ("soft_falloff", "lamps with soft falloff");

pub(crate) const DISC_LIGHT: u32 = 1;
pub(crate) const TURNED_LIGHT: u32 = 2;

/// A light; unused fields are zero. Render space.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Light {
    /// Position of a point, a spot, a projecting lamp or a round surface; for distant lights, the centre of the scene.
    pub position: [f32; 3],
    /// Point, spot, smooth spot, directional, sun, area, two-sided area, environment, image environment, projector: 0
    /// to 9.
    pub kind: u32,
    /// Flux of every sample, W; for spots the intensity on the axis, W/sr. With a texture, the emission where that is
    /// one: intensity, W/sr, or radiance, W/(m^2 sr).
    pub power: [f32; 3],
    /// Radius of a spot or a ball; of a disc with the same area for a disc; of the scene for distant lights. Zero for
    /// other surfaces. Scene units.
    pub radius: f32,
    /// Axis of a spot's frame; right of an image; axis of an environment's space.
    pub s: [f32; 3],
    /// Density of the position per area.
    pub pdf_pos: f32,
    /// Axis of a spot's frame; up of an image; axis of an environment's space.
    pub t: [f32; 3],
    /// Density of the direction per solid angle, if it is constant.
    pub pdf_dir: f32,
    /// Axis of a spot's frame; away from an image; axis of an environment's space; direction of travel of a directional
    /// light.
    pub n: [f32; 3],
    /// First triangle of a surface; for a round one its kind: 0 for a ball, 1 for a disc, plus 2 if flipped.
    pub first: u32,
    /// A spot's plateau, or a sun's cone, as 1 - cos.
    pub plateau: f32,
    /// A spot's cone, as 1 - cos.
    pub cone: f32,
    /// Integral of a spot's falloff, sr.
    pub solid_angle: f32,
    /// Share of a spot's plateau in that.
    pub share: f32,
    /// Half angle of a spot's plateau, radians.
    pub beam_width: f32,
    /// Half angle of a spot's cone, radians.
    pub cutoff: f32,
    /// Number of a surface's triangles.
    pub count: u32,
    /// Number of the medium that photons start in, or [`VACUUM`](super::VACUUM).
    pub medium: u32,
    /// Two corners of the lit part of an image; the image spans (-1, -1), the lower left, to (1, 1).
    pub lit: [f32; 4],
    /// Half the width and half the height of an image at distance 1; the sides of a rectangle with constant radiance,
    /// from `position` along s and t.
    pub half: [f32; 2],
    /// Number of its emission texture, or [`NONE`](super::NONE).
    pub texture: u32,
    /// Offset of its part of [`Lights::tables`].
    pub table: u32,
}

/// A triangle of an emitting surface.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Emitter {
    /// A corner.
    pub a: [f32; 3],
    /// Uniform numbers from here on choose later triangles.
    pub end: f32,
    /// A corner.
    pub b: [f32; 3],
    padding: u32,
    /// A corner.
    pub c: [f32; 3],
    padding_2: u32,
    /// Unit normal.
    pub normal: [f32; 3],
    padding_3: u32,
    /// Texture coordinates of a corner.
    pub uv_a: [f32; 2],
    /// Texture coordinates of another corner.
    pub uv_b: [f32; 2],
    /// Texture coordinates of the third corner.
    pub uv_c: [f32; 2],
    padding_4: [u32; 2],
}

/// Lights, and the triangles of emitting surfaces.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// By light number.
    pub lights: Vec<Light>,
    /// Triangles of all lights, one light after another.
    pub emitters: Vec<Emitter>,
    /// Running sums of the lights' powers, and then by light: for an image environment, running sums of rows, running
    /// sums over the columns of each, and a cell's solid angle by row; for a projecting lamp, the normals of four
    /// planes; for a mesh of varying radiance, the density of points in each triangle.
    pub tables: Vec<f32>,
}

/// A light's emission texture, if kernels look it up.
pub(super) fn texture_of(light: &light::Light) -> Option<Texture> {
    let picture = |image, filter| Texture::Image {
        image,
        filter,
        wrap: Wrap::Repeat,
        image_from_uv: Default::default(),
    };
    match &light.kind {
        LightKind::Environment(environment) => {
            let map = environment.map()?;
            Some(picture(map.image.clone(), TextureFilter::Bilinear))
        }
        LightKind::Projector(projector) => Some(picture(projector.image.clone(), projector.filter)),
        LightKind::Area {
            pattern: Some(pattern), ..
        } => match pattern.texture() {
            // The constant is uniform anyway.
            Texture::Constant(value) => Some(Texture::Checkerboard {
                colors: [*value; 2],
                squares_from_uv: Default::default(),
            }),
            other => Some(other.clone()),
        },
        LightKind::Area { pattern: None, .. }
        | LightKind::Point { .. }
        | LightKind::Spot(_)
        | LightKind::Goniometric(_)
        | LightKind::Laser(_)
        | LightKind::Directional(_)
        | LightKind::Volume(_) => None,
    }
}

impl Lights {
    /// Adds a light, whose photons start in the medium with this number.
    ///
    /// # Errors
    /// Each field that kernels do not support, and why.
    pub fn add(
        &mut self,
        light: &light::Light,
        medium: u32,
        (objects, bounds): (&[Object], &SceneBounds),
    ) -> Result<(), Vec<(&'static str, &'static str)>> {
        let flat = match &light.kind {
            LightKind::Point { position, intensity } => Light {
                position: position.to_array(),
                kind: POINT,
                power: (*intensity * (4.0 * PI)).to_array(),
                pdf_dir: warp::uniform_sphere_pdf(),
                pdf_pos: f32::INFINITY,
                ..Light::zeroed()
            },
            LightKind::Spot(spot) if spot.soft => return Err(vec![SOFT]),
            LightKind::Spot(spot) => of_spot(spot),
            LightKind::Directional(sun) => of_sun(sun, bounds),
            LightKind::Environment(environment) => self.of_environment(environment, bounds),
            LightKind::Projector(projector) => self.of_projector(projector),
            LightKind::Goniometric(_) => return Err(vec![("ies", "lamps by tables of directions")]),
            LightKind::Laser(_) => return Err(vec![("type", "lasers")]),
            LightKind::Volume(_) => return Err(vec![("emission", "media that emit")]),
            LightKind::Area {
                object,
                radiance,
                pattern,
                two_sided,
                spread,
                soft,
            } => {
                let mut missing = Vec::new();
                if *soft {
                    missing.push(SOFT);
                }
                if spread.is_some() {
                    missing.push(("spread", "surfaces that emit into a cone"));
                }
                let texture = pattern.as_ref().map(|pattern| pattern.texture());
                if let Some(Texture::Graph(_)) = texture {
                    missing.push(("radiance", "graphs of nodes"));
                }
                if texture.is_some_and(Texture::reads_colors) {
                    missing.push(("radiance", "colours of vertices"));
                }
                let shape = &objects[*object as usize].shape;
                let flat = match shape {
                    Shape::Mesh { mesh, placement: _ } => Some(self.of_mesh(mesh)),
                    Shape::Disc { placement, flip } => Some(of_disc(placement, *flip)),
                    Shape::Sphere { placement, flip } => {
                        let radius = placement.uniform_scale();
                        if radius.is_none() {
                            missing.push(("shape", "spheres that emit and are stretched"));
                        }
                        radius.map(|radius| of_ball(placement, radius, *flip))
                    }
                    Shape::Strands { .. } => {
                        missing.push(("shape", "curves and points that emit"));
                        None
                    }
                    Shape::Cylinder { .. } => {
                        missing.push(("shape", "cylinders that emit"));
                        None
                    }
                };
                let (true, Some(flat)) = (missing.is_empty(), flat) else {
                    return Err(missing);
                };
                let pdf_pos = shape.pdf_area(Vec3::Z);
                let sides = if *two_sided { 2.0 } else { 1.0 };
                let flat = Light {
                    kind: if *two_sided { TWO_SIDED_AREA } else { AREA },
                    power: (*radiance * (sides * PI / pdf_pos)).to_array(),
                    pdf_pos,
                    ..flat
                };
                match pattern {
                    None => flat,
                    Some(pattern) => self.of_pattern(pattern, shape, flat),
                }
            }
        };
        let texture = match texture_of(light) {
            Some(_) => self.lights.len() as u32,
            None => super::NONE,
        };
        self.lights.push(Light {
            medium,
            texture,
            ..flat
        });
        Ok(())
    }

    fn of_environment(&mut self, environment: &Environment, bounds: &SceneBounds) -> Light {
        let Some(map) = environment.map() else {
            let radiance = environment.constant().unwrap_or(Vec3::ZERO);
            return Light {
                kind: ENVIRONMENT,
                pdf_dir: warp::uniform_sphere_pdf(),
                ..from_afar(radiance / warp::uniform_sphere_pdf(), bounds)
            };
        };
        let table = self.tables.len() as u32;
        for part in [map.rows, map.cells, map.solid_angles] {
            self.tables.extend_from_slice(part);
        }
        let [s, t, n] = map.axes.map(|axis| axis.to_array());
        Light {
            kind: ENVIRONMENT_MAP,
            power: map.scale.to_array(),
            s,
            t,
            n,
            table,
            ..from_afar(Vec3::ZERO, bounds)
        }
    }

    fn of_projector(&mut self, projector: &Projector) -> Light {
        let table = self.tables.len() as u32;
        self.tables
            .extend(projector.planes().into_iter().flat_map(|plane| plane.to_array()));
        let [s, t, n] = projector.axes.map(|axis| axis.to_array());
        let [cutoff, beam_width] = projector.cone.unwrap_or_default();
        let [low, high] = projector.lit;
        Light {
            kind: PROJECTOR,
            position: projector.position.to_array(),
            power: projector.intensity.to_array(),
            pdf_pos: f32::INFINITY,
            s,
            t,
            n,
            beam_width,
            cutoff,
            lit: [low.x, low.y, high.x, high.y],
            half: projector.half.to_array(),
            table,
            ..Light::zeroed()
        }
    }

    /// A surface of varying radiance, given its common values.
    fn of_pattern(&mut self, pattern: &Pattern, shape: &Shape, light: Light) -> Light {
        let table = self.tables.len() as u32;
        // Round shapes have none.
        let own = self.emitters.len() - light.count as usize;
        for ((number, emitter), sum) in (0..).zip(&mut self.emitters[own..]).zip(pattern.sums()) {
            emitter.end = least_beyond(*sum, 1.0);
            self.tables.push(pattern.pdf_area(shape, Vec3::Z, number));
        }
        Light {
            power: pattern.scale().to_array(),
            table,
            half: [0.0; 2],
            ..light
        }
    }

    /// The triangles of a mesh without a placement: emitting meshes are not instanced.
    fn of_mesh(&mut self, mesh: &Mesh) -> Light {
        let sums = mesh.area_sums();
        let total = sums.last().copied().unwrap_or(0.0);
        let first = self.emitters.len() as u32;
        self.emitters.extend((0..).zip(sums).map(|(triangle, sum)| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.to_array());
            let uv = |corner: u32| mesh.uvs.get(corner as usize).copied().unwrap_or_default().to_array();
            let [uv_a, uv_b, uv_c] = match mesh.uvs.is_empty() {
                // The weights of the second and third corner.
                true => [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
                false => mesh.triangles[triangle as usize].map(uv),
            };
            Emitter {
                a,
                end: least_beyond(*sum, total),
                b,
                c,
                normal: mesh.normal(triangle).to_array(),
                uv_a,
                uv_b,
                uv_c,
                ..Emitter::zeroed()
            }
        }));
        let flat = Light {
            first,
            count: sums.len() as u32,
            ..Light::zeroed()
        };
        let Some(rectangle) = mesh.rectangle() else {
            return flat;
        };
        let [s, t] = rectangle.along.map(|side| side.to_array());
        Light {
            position: rectangle.corner.to_array(),
            half: rectangle.sides.to_array(),
            s,
            t,
            n: mesh.normal(0).to_array(),
            ..flat
        }
    }
}

/// The kind of a round surface.
fn of_round(placement: &Placement, flip: bool) -> Light {
    let map = &placement.render_from_object;
    Light {
        position: map.translation.to_array(),
        s: map.matrix3.x_axis.to_array(),
        t: map.matrix3.y_axis.to_array(),
        n: map.matrix3.z_axis.to_array(),
        first: if flip { TURNED_LIGHT } else { 0 },
        ..Light::zeroed()
    }
}

fn of_ball(placement: &Placement, radius: f32, flip: bool) -> Light {
    Light {
        radius,
        ..of_round(placement, flip)
    }
}

fn of_disc(placement: &Placement, flip: bool) -> Light {
    let round = of_round(placement, flip);
    let area = Vec3::from(round.s).cross(round.t.into()).length();
    Light {
        radius: area.sqrt(),
        n: placement.normal(Vec3::Z).normalize().to_array(),
        first: round.first | DISC_LIGHT,
        ..round
    }
}

/// The smallest uniform number that chooses a triangle after one with this running sum of areas, matching the
/// renderer's double-precision comparison; 2 if there is none.
fn least_beyond(sum: f64, total: f64) -> f32 {
    let is_beyond = |u: f32| sum <= f64::from(u) * total;
    if !is_beyond(1.0) {
        return 2.0;
    }
    // Positive floats are ordered like their bits.
    let (mut low, mut high) = (0, 1.0f32.to_bits());
    while low < high {
        let middle = (low + high) / 2;
        if is_beyond(f32::from_bits(middle)) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    f32::from_bits(low)
}

fn of_spot(spot: &Spot) -> Light {
    let [plateau, cone] = [spot.beam_width, spot.cutoff].map(one_minus_cos);
    let solid_angle = spot.solid_angle();
    Light {
        position: spot.position.to_array(),
        kind: match spot.ramp {
            Ramp::Linear => SPOT,
            Ramp::Smooth => SMOOTH_SPOT,
        },
        power: spot.intensity.to_array(),
        radius: spot.radius,
        s: spot.frame.s.to_array(),
        pdf_pos: 1.0 / (PI * spot.radius * spot.radius),
        t: spot.frame.t.to_array(),
        n: spot.frame.n.to_array(),
        plateau,
        cone,
        solid_angle,
        share: (2.0 * PI * plateau / solid_angle).min(1.0),
        beam_width: spot.beam_width,
        cutoff: spot.cutoff,
        ..Light::zeroed()
    }
}

fn one_minus_cos(angle: f32) -> f32 {
    let half = sin(0.5 * angle);
    2.0 * half * half
}

fn of_sun(sun: &Sun, bounds: &SceneBounds) -> Light {
    let (kind, pdf_dir) = match sun.is_parallel() {
        true => (DIRECTIONAL, f32::INFINITY),
        false => (SUN, sun.pdf()),
    };
    Light {
        kind,
        pdf_dir,
        n: sun.direction.to_array(),
        plateau: sun.one_minus_cos(),
        ..from_afar(sun.fluence(), bounds)
    }
}

/// Through the disc that covers the scene.
fn from_afar(irradiance: Rgb, bounds: &SceneBounds) -> Light {
    let area = PI * bounds.radius * bounds.radius;
    Light {
        position: bounds.center.to_array(),
        power: (irradiance * area).to_array(),
        radius: bounds.radius,
        pdf_pos: 1.0 / area,
        ..Light::zeroed()
    }
}

/// A scene's lights, with their tables appended to the given ones. Adds reasons to the list.
pub(super) fn flatten(scene: &Scene, tables: Vec<f32>, reasons: &mut Vec<Reason>) -> Lights {
    let description = scene.description();
    let around = (&*description.objects, &description.bounds);
    let mut lights = Lights {
        tables,
        ..Lights::default()
    };
    for (light, medium) in description.lights.iter().zip(scene.light_media()) {
        let mut no = |field: &'static str, what: &'static str| {
            reasons.push(Reason {
                of: Of::Light(light.name.clone()),
                field,
                why: Why::Missing(what),
            });
        };
        let medium = match medium {
            StartMedium::One(medium) => super::medium(*medium),
            StartMedium::ByPlace => {
                if !matches!(light.kind, LightKind::Volume(_)) {
                    no("position", "lights that are in several media");
                }
                super::VACUUM
            }
        };
        for (field, what) in lights.add(light, medium, around).err().into_iter().flatten() {
            no(field, what);
        }
    }
    lights
}
