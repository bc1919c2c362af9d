//! Shared by the tests of kernels.

use crate::device::{Choice, Device, Groups};
use crate::error::{Error, Result};
use crate::kernels::{Needs, Program};
use crate::self_test::Tested;
use beamfarm_render::math::{Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use bytemuck::Pod;
use std::sync::OnceLock;

/// The opened device; None without Vulkan, in which case a test prints that and passes.
fn there<T>(opened: Result<T>) -> Option<T> {
    match opened {
        Ok(device) => Some(device),
        Err(Error::NoVulkan) => {
            println!("not tried: there is no Vulkan device");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A device for tests that make it fail.
pub fn device() -> Option<Device> {
    there(Device::open(&Choice::Best))
}

/// A device shared by all other tests, tested once.
pub fn tested() -> Option<&'static Tested> {
    static TESTED: OnceLock<Option<Tested>> = OnceLock::new();
    TESTED.get_or_init(|| there(Tested::open(&Choice::Best))).as_ref()
}

/// The entry `main` of programs that call `fn each(i: u32)` for each number. On groups.
pub const EACH: &str = "@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) { each(group_number(group, groups) * 64u + thread); }
";

/// Results of a program whose entry `main` has workgroups of 64 threads, one thread per number. It gets the input and
/// writes this many values.
pub fn results<I: Pod, T: Pod>(
    tested: &Tested,
    program: &Program,
    input: &[I],
    threads: usize,
    length: usize,
) -> Vec<T> {
    let kernel = tested.kernel(program, "main");
    let device = &tested.device;
    let source = device.buffer("input", input).unwrap();
    let results = device.empty("results", (length * size_of::<T>()) as u64).unwrap();
    let mut work = device.work();
    let groups = Groups::Count(threads.div_ceil(64) as u32);
    work.run(&kernel, &[&source, &results], groups).unwrap();
    work.submit().unwrap();
    device.read(&results, length).unwrap()
}

/// The size of a struct in a program's text, and its members' names and offsets.
pub fn layout(program: &Program, name: &str) -> (u32, Vec<(String, u32)>) {
    let needs = Needs {
        varies: true,
        disperses: true,
        aims: true,
        ..Needs::ALL
    };
    let source = program.source_for(crate::kernels::Arithmetic::default(), needs);
    let checked = crate::spirv::check(program.name, &source).unwrap();
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(checked.module.to_ctx()).unwrap();
    let (handle, ty) = checked
        .module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref() == Some(name))
        .unwrap();
    let naga::TypeInner::Struct { members, .. } = &ty.inner else {
        panic!("{name} is no struct");
    };
    let members = members.iter().map(|m| (m.name.clone().unwrap(), m.offset));
    (layouter[handle].size, members.collect())
}

/// Asserts that a kernel's struct has the same layout as the Rust one of that name: size, members' names and offsets.
macro_rules! same_layout {
    ($program:expr, $name:ident { $($member:ident),* $(,)? }) => {
        assert_eq!(
            $crate::testing::layout($program, stringify!($name)),
            (
                size_of::<$name>() as u32,
                vec![$((stringify!($member).to_owned(), std::mem::offset_of!($name, $member) as u32)),*],
            ),
        )
    };
}
pub(crate) use same_layout;

/// Counts around the sizes of workgroups and tiles.
pub const COUNTS: [u32; 9] = [0, 1, 63, 64, 65, 4095, 4096, 4097, 1 << 20];

/// Whether both have the same bits, apart from those of NaN.
pub fn same(a: &[f32], b: &[f32]) -> bool {
    let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Random numbers, always the same.
pub struct Chance(Sampler);

impl Chance {
    pub fn new(chunk: u64) -> Self {
        Self(Sampler::new(11, 0, Purpose::Test, chunk))
    }

    /// In [0, 1), with frequent extremes.
    pub fn unit(&mut self) -> f32 {
        match self.0.next_u32() % 16 {
            0 => 0.0,
            1 => 1.0 - f32::EPSILON / 2.0,
            _ => self.0.next_1d(),
        }
    }

    pub fn two(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    pub fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.0.next_u32() as usize % list.len()]
    }

    /// Unit vectors; some along an axis, some barely above or below the plane z = 0.
    pub fn direction(&mut self) -> Vec3 {
        let dir = warp::uniform_sphere(self.0.next_2d());
        let sign = self.of(&[1.0, -1.0]);
        match self.0.next_u32() % 8 {
            0 => self.of(&[Vec3::X, Vec3::Y, Vec3::Z]) * sign,
            1 => {
                let exponent = self.0.next_u32() % 40;
                dir.with_z(sign / (1u64 << exponent) as f32 * dir.z).normalize()
            }
            2 => dir.with_z(sign * 0.0).normalize(),
            _ => dir,
        }
    }
}
