//! What `kernels/emission.wgsl` computes: where photons start. The renderer's own values, except for the kernels' sine
//! and cosine.

use super::{sin_cos, warp};
use crate::world::lights::{
    AREA, DIRECTIONAL, DISC_LIGHT, ENVIRONMENT, Emitter, Light, POINT, SMOOTH_SPOT, SPOT, SUN, TURNED_LIGHT,
    TWO_SIDED_AREA,
};
use beamfarm_render::math::{Frame, PI, Vec2, Vec3, atan2};
use beamfarm_render::warp as own;
use beamfarm_render::world::light::EmissionUniforms;

/// The start of a photon path.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Start.
    pub origin: Vec3,
    /// Density of the direction per solid angle; infinite for parallel light.
    pub pdf_dir: f32,
    /// Unit direction of travel.
    pub dir: Vec3,
    /// Density of the position per area; infinite for point lights.
    pub pdf_pos: f32,
    /// Flux that the sample would carry if it were the only one, W.
    pub power: Vec3,
    /// The emitting triangle.
    pub triangle: u32,
    /// Its normal, on the side of the photon; zero for all other lights.
    pub normal: Vec3,
}

/// `emit`. `emitters`: those of all lights. None: this kind of light is not supported.
#[must_use]
pub fn emit(light: &Light, emitters: &[Emitter], u: &EmissionUniforms) -> Option<Emission> {
    let n = Vec3::from(light.n);
    Some(match light.kind {
        POINT => Emission {
            origin: light.position.into(),
            ..parallel(light, warp::uniform_sphere(u.direction))
        },
        SPOT | SMOOTH_SPOT => spot(light, u),
        DIRECTIONAL => from_afar(light, n, u.position),
        SUN => {
            let local = warp::uniform_cap(u.direction, light.plateau);
            from_afar(light, Frame::from_normal(n).to_world(local), u.position)
        }
        AREA | TWO_SIDED_AREA => area(light, emitters, u),
        ENVIRONMENT => from_afar(light, -warp::uniform_sphere(u.direction), u.position),
        _ => return None,
    })
}

/// Everything that does not depend on the starting point.
fn parallel(light: &Light, dir: Vec3) -> Emission {
    Emission {
        origin: Vec3::ZERO,
        pdf_dir: light.pdf_dir,
        dir,
        pdf_pos: light.pdf_pos,
        power: light.power.into(),
        triangle: 0,
        normal: Vec3::ZERO,
    }
}

fn from_afar(light: &Light, dir: Vec3, u: Vec2) -> Emission {
    let disc = warp::concentric_disk(u);
    let offset = Frame::from_normal(dir).to_world(Vec3::new(disc.x, disc.y, -1.0));
    Emission {
        origin: Vec3::from(light.position) + offset * light.radius,
        ..parallel(light, dir)
    }
}

fn spot(light: &Light, u: &EmissionUniforms) -> Emission {
    let frame = Frame {
        s: light.s.into(),
        t: light.t.into(),
        n: light.n.into(),
    };
    let width = light.cone - light.plateau;
    let (h, pdf_dir) = if u.direction.x < light.share || light.cone <= light.plateau {
        let part = (u.direction.x / light.share).min(1.0);
        (part * light.plateau, 1.0 / light.solid_angle)
    } else {
        let left = (1.0 - u.direction.x) / (1.0 - light.share);
        let root = left.min(1.0).sqrt();
        (light.cone - width * root, (1.0 - light.share) * root / (PI * width))
    };
    let sin_theta = (h * (2.0 - h)).max(0.0).sqrt();
    let (sine, cosine) = sin_cos(2.0 * PI * u.direction.y);
    let dir = Vec3::new(sin_theta * cosine, sin_theta * sine, 1.0 - h);
    let falloff = falloff(light, atan2(sin_theta, 1.0 - h));
    let position = Vec3::from(light.position);
    let origin = if light.radius == 0.0 {
        position
    } else {
        let across = warp::concentric_disk(u.position);
        let half_chord = (1.0 - across.length_squared()).max(0.0).sqrt();
        let (along, _) = sin_cos(PI * (u.primitive - 0.5));
        position + frame.to_world(across.extend(half_chord * along)) * light.radius
    };
    Emission {
        origin,
        pdf_dir,
        power: Vec3::from(light.power) * (falloff / pdf_dir),
        ..parallel(light, frame.to_world(dir))
    }
}

fn falloff(light: &Light, angle: f32) -> f32 {
    if angle <= light.beam_width {
        1.0
    } else if angle >= light.cutoff {
        0.0
    } else if light.kind == SMOOTH_SPOT {
        let (half, _) = sin_cos(0.5 * angle);
        let x = ((light.cone - 2.0 * half * half) / (light.cone - light.plateau)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    } else {
        (light.cutoff - angle) / (light.cutoff - light.beam_width)
    }
}

/// A point of an emitting surface, its normal, and its triangle.
fn on_surface(light: &Light, emitters: &[Emitter], u: &EmissionUniforms) -> (Vec3, Vec3, u32) {
    if light.radius > 0.0 {
        return on_round(light, u.position);
    }
    let own_emitters = &emitters[light.first as usize..][..light.count as usize];
    let behind = own_emitters.partition_point(|emitter| emitter.end <= u.primitive);
    let triangle = behind.min(own_emitters.len() - 1);
    let emitter = &own_emitters[triangle];
    let [a, b, c, normal] = [emitter.a, emitter.b, emitter.c, emitter.normal].map(Vec3::from);
    let w = own::uniform_triangle(u.position);
    (a * (1.0 - w.x - w.y) + b * w.x + c * w.y, normal, triangle as u32)
}

fn on_round(light: &Light, u: Vec2) -> (Vec3, Vec3, u32) {
    let [s, t, n] = [light.s, light.t, light.n].map(Vec3::from);
    let (offset, normal) = if light.first & DISC_LIGHT != 0 {
        let p = warp::concentric_disk(u);
        (s * p.x + t * p.y, n)
    } else {
        let p = warp::uniform_sphere(u);
        let offset = s * p.x + t * p.y + n * p.z;
        (offset, offset.normalize())
    };
    let is_turned = light.first & TURNED_LIGHT != 0;
    let normal = if is_turned { -normal } else { normal };
    (offset + Vec3::from(light.position), normal, 0)
}

fn area(light: &Light, emitters: &[Emitter], u: &EmissionUniforms) -> Emission {
    let (origin, mut normal, triangle) = on_surface(light, emitters, u);
    let mut direction = u.direction;
    let mut sides = 1.0;
    if light.kind == TWO_SIDED_AREA {
        sides = 2.0;
        direction.x *= 2.0;
        if direction.x >= 1.0 {
            normal = -normal;
            direction.x -= 1.0;
        }
    }
    let local = warp::cosine_hemisphere(direction);
    Emission {
        origin,
        pdf_dir: own::cosine_hemisphere_pdf(local.z) / sides,
        triangle,
        normal,
        ..parallel(light, Frame::from_normal(normal).to_world(local))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Groups;
    use crate::kernels::{ARITHMETIC, EMISSION, GROUPS, MATH, Program, TEXELS, TEXTURE, VECTORS, WARP, WIDE};
    use crate::testing::{Chance, same, same_layout, tested};
    use crate::world::lights::Lights;
    use crate::world::textures::SurfaceTexture;
    use beamfarm_image::layer::LightGroup;
    use beamfarm_render::math::{Rgb, mean};
    use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
    use beamfarm_render::world::light::{self, Environment, LightKind, Ramp, SceneBounds, Spot, Sun};
    use bytemuck::{Pod, Zeroable};
    use glam::{Affine3A, Mat3, Quat};
    use std::sync::Arc;

    const STARTS: Program = Program {
        name: "starts",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            WARP,
            VECTORS,
            TEXELS,
            TEXTURE,
            EMISSION,
            "@group(0) @binding(0) var<storage, read> lights: array<Light>;
            @group(0) @binding(1) var<storage, read> numbers: array<array<f32, 5>>;
            @group(0) @binding(2) var<storage, read_write> starts: array<Emission>;
            fn each(i: u32) {
                if (i >= arrayLength(&numbers)) { return; }
                let u = numbers[i];
                let uniforms = EmissionUniforms(vec2f(u[0], u[1]), vec2f(u[2], u[3]), u[4]);
                starts[i] = emit(lights[i % arrayLength(&lights)], uniforms);
            }",
        ],
    };

    /// As the kernel writes it.
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    #[repr(C)]
    struct Written {
        origin: [f32; 3],
        pdf_dir: f32,
        dir: [f32; 3],
        pdf_pos: f32,
        power: [f32; 3],
        triangle: u32,
        normal: [f32; 3],
        padding: f32,
    }

    fn floats(origin: [f32; 3], dir: [f32; 3], power: [f32; 3], normal: [f32; 3], pdfs: [f32; 2]) -> Vec<f32> {
        [&origin[..], &dir, &power, &normal, &pdfs].concat()
    }

    const BOUNDS: SceneBounds = SceneBounds {
        center: Vec3::new(0.5, -2.0, 7.0),
        radius: 3.25,
    };

    /// A rough sheet of triangles of many sizes, one with zero area.
    fn sheet() -> Arc<Mesh> {
        let mut chance = Chance::new(8);
        let mut positions: Vec<Vec3> = (0..40).map(|_| 2.0 * chance.direction() * chance.unit()).collect();
        positions.push(positions[0]);
        let mut triangles: Vec<[u32; 3]> = (0..37).map(|i| [i, i + 1, i + 2]).collect();
        triangles.insert(5, [0, 40, 7]);
        triangles.push([3, 3, 3]);
        Arc::new(Mesh {
            positions,
            triangles,
            ..Mesh::default()
        })
    }

    fn lights() -> (Vec<light::Light>, Vec<Object>) {
        let mut chance = Chance::new(9);
        let value = Rgb::new(1.5, 0.25, 30.0);
        let spot = |[beam_width, cutoff]: [f32; 2], ramp: Ramp, radius: f32, chance: &mut Chance| {
            LightKind::Spot(Spot {
                position: chance.direction() * 4.0,
                frame: Frame::from_normal(chance.direction()),
                intensity: value,
                cutoff,
                beam_width,
                ramp,
                radius,
                soft: false,
            })
        };
        let area = |object: u32, two_sided: bool| LightKind::Area {
            object,
            radiance: value,
            pattern: None,
            two_sided,
            spread: None,
            soft: false,
        };
        let sun = |half_angle: f32, chance: &mut Chance| {
            LightKind::Directional(Sun {
                direction: chance.direction(),
                irradiance: value,
                half_angle,
            })
        };
        let position = Vec3::new(1.0, -2.5, 3.0);
        let kinds = vec![
            LightKind::Point {
                position,
                intensity: value,
            },
            spot([0.2, 0.35], Ramp::Linear, 0.0, &mut chance),
            spot([0.0, 1.2], Ramp::Linear, 0.4, &mut chance),
            spot([0.3, 0.300_01], Ramp::Linear, 0.0, &mut chance),
            spot([0.1, 0.5], Ramp::Smooth, 0.4, &mut chance),
            spot([0.0, 1.5], Ramp::Smooth, 0.0, &mut chance),
            spot([0.001, 0.002], Ramp::Linear, 0.0, &mut chance),
            sun(0.0, &mut chance),
            sun(0.0047, &mut chance),
            sun(1.2, &mut chance),
            area(0, false),
            area(0, true),
            area(1, false),
            area(2, true),
            area(3, false),
            area(4, false),
            LightKind::Environment(Environment::new(None, value, Mat3::IDENTITY)),
        ];
        let light = |kind| light::Light {
            name: String::new(),
            kind,
            group: LightGroup::named("all"),
        };
        let object = |shape: Shape| Object {
            light: Some(0),
            ..Object::new(shape)
        };
        // Rotated and moved; mirrored; stretched.
        let placed = |scale: Vec3| {
            let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
            let map = Affine3A::from_scale_rotation_translation(scale, turn, Vec3::new(2.0, -1.0, 0.5));
            Placement {
                render_from_object: map,
                object_from_render: map.inverse(),
            }
        };
        let shapes = vec![
            Shape::Mesh {
                mesh: sheet(),
                placement: Placement::IDENTITY,
            },
            Shape::Sphere {
                placement: placed(Vec3::splat(0.75)),
                flip: false,
            },
            Shape::Sphere {
                placement: placed(Vec3::new(-1.5, 1.5, 1.5)),
                flip: true,
            },
            Shape::Disc {
                placement: placed(Vec3::new(0.5, 2.0, 1.0)),
                flip: false,
            },
            Shape::Disc {
                placement: placed(Vec3::splat(1.25)),
                flip: true,
            },
        ];
        (
            kinds.into_iter().map(light).collect(),
            shapes.into_iter().map(object).collect(),
        )
    }

    fn flat(lights: &[light::Light], objects: &[Object]) -> Lights {
        let mut flat = Lights::default();
        for light in lights {
            flat.add(light, 0, (objects, &BOUNDS)).unwrap();
        }
        flat
    }

    fn numbers(count: usize) -> Vec<[f32; 5]> {
        let mut chance = Chance::new(10);
        (0..count).map(|_| std::array::from_fn(|_| chance.unit())).collect()
    }

    fn uniforms(u: &[f32; 5]) -> EmissionUniforms {
        EmissionUniforms {
            position: Vec2::new(u[0], u[1]),
            direction: Vec2::new(u[2], u[3]),
            primitive: u[4],
        }
    }

    #[test]
    fn photons_start_with_their_twins_bits() {
        let Some(tested) = tested() else { return };
        let device = &tested.device;
        let (lights, objects) = lights();
        let flat = flat(&lights, &objects);
        let numbers = numbers(260_000);
        let output = device.empty("starts", 64 * numbers.len() as u64).unwrap();
        let buffers = [
            &device.buffer("lights", &flat.lights).unwrap(),
            &device.buffer("numbers", &numbers).unwrap(),
            &output,
            &device.buffer("emitters", &flat.emitters).unwrap(),
            // For lights that do not occur here.
            &device.buffer("tables", &[0.0_f32]).unwrap(),
            &device.buffer("textures", &[SurfaceTexture::default()]).unwrap(),
            &device.buffer("texels", &[[0.0_f32; 3]]).unwrap(),
        ];
        let kernel = tested.kernel(&STARTS, "main");
        let mut work = device.work();
        let groups = Groups::Count(numbers.len().div_ceil(64) as u32);
        work.run(&kernel, &buffers, groups).unwrap();
        work.submit().unwrap();
        let got = device.read::<Written>(&output, numbers.len()).unwrap();
        for (i, (u, got)) in numbers.iter().zip(&got).enumerate() {
            let light = &flat.lights[i % flat.lights.len()];
            let twin = emit(light, &flat.emitters, &uniforms(u)).unwrap();
            let [origin, dir, power, normal] = [twin.origin, twin.dir, twin.power, twin.normal].map(|v| v.to_array());
            let expected = floats(origin, dir, power, normal, [twin.pdf_dir, twin.pdf_pos]);
            let floats = floats(got.origin, got.dir, got.power, got.normal, [got.pdf_dir, got.pdf_pos]);
            assert_eq!(got.triangle, twin.triangle, "{light:?} {u:?}");
            assert!(same(&floats, &expected), "{light:?} {u:?}: {got:?} {twin:?}");
        }
    }

    /// Without a sine, flux, densities and triangles are identical; places and directions agree up to rounding.
    #[test]
    fn twins_are_the_renderers_photons() {
        let (lights, objects) = lights();
        let flat = flat(&lights, &objects);
        for (i, u) in numbers(130_000).iter().enumerate() {
            let (light, flat_light) = (&lights[i % lights.len()], &flat.lights[i % lights.len()]);
            let own = light.sample_emission(&objects, &BOUNDS, uniforms(u));
            let twin = emit(flat_light, &flat.emitters, &uniforms(u)).unwrap();
            let place = format!("{light:?} {u:?}: {own:?} {twin:?}");
            // Near the rim of a ball, very short chords lose half of their digits.
            let is_ball = flat_light.kind <= SMOOTH_SPOT && flat_light.radius > 0.0;
            let room = if is_ball { 3e-4 } else { 4e-6 };
            assert!((own.origin - twin.origin).abs().max_element() < room, "{place}");
            assert!((own.dir - twin.dir).abs().max_element() < 1e-6, "{place}");
            let normal = own.normal.unwrap_or(Vec3::ZERO);
            let is_round = [AREA, TWO_SIDED_AREA].contains(&flat_light.kind) && flat_light.radius > 0.0;
            if is_round {
                let near = |a: f32, b: f32| a == b || (a / b - 1.0).abs() < 2e-6;
                assert!((normal - twin.normal).abs().max_element() < 1e-6, "{place}");
                assert!(
                    near(own.pdf_pos, twin.pdf_pos) && near(own.pdf_dir, twin.pdf_dir),
                    "{place}"
                );
                assert!(near(mean(own.power), mean(twin.power)), "{place}");
                continue;
            }
            assert_eq!(normal, twin.normal, "{place}");
            assert_eq!(own.primitive, twin.triangle, "{place}");
            assert_eq!(own.pdf_dir.to_bits(), twin.pdf_dir.to_bits(), "{place}");
            assert_eq!(own.pdf_pos.to_bits(), twin.pdf_pos.to_bits(), "{place}");
            if flat_light.kind == SMOOTH_SPOT {
                let falloff = |power: Rgb| mean(power) * own.pdf_dir / mean(flat_light.power.into());
                assert!((falloff(own.power) - falloff(twin.power)).abs() < 1e-5, "{place}");
            } else {
                assert_eq!(
                    own.power.to_array().map(f32::to_bits),
                    twin.power.to_array().map(f32::to_bits),
                    "{place}"
                );
            }
        }
    }

    /// Uniform numbers near the boundary between two triangles.
    #[test]
    fn triangles_end_where_the_renderers_do() {
        let (lights, objects) = lights();
        let flat = flat(&lights, &objects);
        let area = flat.lights.iter().find(|light| light.kind == AREA).unwrap();
        let Shape::Mesh { mesh, .. } = &objects[0].shape else {
            panic!()
        };
        let mut tried = 0;
        for emitter in &flat.emitters[..mesh.triangles.len()] {
            for bits in emitter.end.to_bits().saturating_sub(3)..emitter.end.to_bits() + 3 {
                let u = f32::from_bits(bits);
                if u >= 1.0 {
                    continue;
                }
                let expected = objects[0].shape.sample_area(Vec2::splat(0.25), u).primitive;
                let numbers = uniforms(&[0.25, 0.25, 0.5, 0.5, u]);
                assert_eq!(emit(area, &flat.emitters, &numbers).unwrap().triangle, expected, "{u}");
                tried += 1;
            }
        }
        assert!(tried > 100, "{tried}");
    }

    /// The samples' mean flux is the light's emission.
    #[test]
    fn flux_is_the_lights_power() {
        let (lights, objects) = lights();
        let flat = flat(&lights, &objects);
        for (light, flat_light) in lights.iter().zip(&flat.lights) {
            let n = 200u16;
            let at = |i: u16| (f32::from(i) + 0.5) / f32::from(n);
            let flux = |i: u16| {
                let u = uniforms(&[0.3, 0.6, at(i), 0.4, 0.2]);
                f64::from(mean(emit(flat_light, &flat.emitters, &u).unwrap().power))
            };
            let flux = (0..n).map(flux).sum::<f64>() / f64::from(n);
            let power = f64::from(mean(light.power(&objects, &BOUNDS)));
            assert!((flux / power - 1.0).abs() < 0.01, "{light:?}: {flux} {power}");
        }
    }

    #[test]
    fn lights_lie_in_memory_as_kernels_have_them() {
        same_layout!(
            &STARTS,
            Light {
                position,
                kind,
                power,
                radius,
                s,
                pdf_pos,
                t,
                pdf_dir,
                n,
                first,
                plateau,
                cone,
                solid_angle,
                share,
                beam_width,
                cutoff,
                count,
                medium,
                lit,
                half,
                texture,
                table
            }
        );
        same_layout!(
            &STARTS,
            Emitter {
                a,
                end,
                b,
                c,
                normal,
                uv_a,
                uv_b,
                uv_c
            }
        );
    }
}
