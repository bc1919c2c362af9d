//! Number of workgroups for elements that are counted on the device.

use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::SIZES;
use crate::self_test::Together;
use bytemuck::{Pod, Zeroable};

/// Elements of a tile of `kernels/sizes.wgsl`.
pub(crate) const TILE: u32 = 2048;

/// The input of an indirect dispatch and of its kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Sizes {
    /// Workgroups in each dimension.
    pub groups: [u32; 3],
    /// Elements.
    pub count: u32,
}

/// A kernel that computes [`Sizes`] from a count or from earlier sizes, and its output.
pub(crate) struct Sizing {
    kernel: Kernel,
    pub sizes: Buffer,
}

impl Sizing {
    /// An entry point of `kernels/sizes.wgsl`.
    pub fn new<'a>(on: impl Into<Together<'a>>, entry: &str) -> Result<Self> {
        let on = on.into();
        Ok(Self {
            kernel: on.kernel(&SIZES, entry),
            sizes: on.empty("sizes", size_of::<Sizes>() as u64)?,
        })
    }

    pub fn run(&self, work: &mut Work, from: &Buffer) -> Result<()> {
        work.run(&self.kernel, &[from, &self.sizes], Groups::Count(1))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::GROUPS_PER_DIMENSION;
    use crate::kernels::{GROUPS, Program, SCAN, SORT, SORT_WIDE};
    use crate::testing::{same_layout, tested};

    #[test]
    fn sizes_lie_in_memory_as_kernels_have_them() {
        for program in [SIZES, SCAN, SORT, SORT_WIDE] {
            same_layout!(&program, Sizes { groups, count });
        }
    }

    const NUMBERS: Program = Program {
        name: "numbers",
        texts: &[
            GROUPS,
            crate::testing::EACH,
            "@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
            fn each(i: u32) {
                if (i < arrayLength(&numbers)) { numbers[i] += i + 1u; }
            }",
        ],
    };

    #[test]
    fn more_workgroups_run_than_a_dimension_has() {
        let Some(tested) = tested() else { return };
        let kernel = tested.kernel(&NUMBERS, "main");
        let length = 64 * (GROUPS_PER_DIMENSION + 2);
        let numbers = tested.device.empty("numbers", 4 * u64::from(length)).unwrap();
        let count = tested.device.buffer("count", &[length]).unwrap();
        let sizing = Sizing::new(tested, "threads").unwrap();
        let mut work = tested.device.work();
        sizing.run(&mut work, &count).unwrap();
        work.run(&kernel, &[&numbers], Groups::From(&sizing.sizes)).unwrap();
        work.run(&kernel, &[&numbers], Groups::Count(length / 64)).unwrap();
        work.submit().unwrap();
        let got = tested.device.read::<u32>(&numbers, length as usize).unwrap();
        assert_eq!((0..).zip(got).find(|(i, n)| *n != 2 * (i + 1)), None);
    }

    #[test]
    fn workgroups_are_worked_out_on_the_device() {
        let Some(tested) = tested() else { return };
        let sizes = |entries: &[&str], count: u32| {
            let mut from = tested.device.buffer("count", &[count]).unwrap();
            for entry in entries {
                let sizing = Sizing::new(tested, entry).unwrap();
                let mut work = tested.device.work();
                sizing.run(&mut work, &from).unwrap();
                work.submit().unwrap();
                from = sizing.sizes;
            }
            let sizes = tested.device.read::<Sizes>(&from, 1).unwrap()[0];
            (sizes.groups, sizes.count)
        };
        assert_eq!(sizes(&["tiles"], 0), ([1, 1, 1], 0));
        assert_eq!(sizes(&["tiles"], 2048), ([1, 1, 1], 2048));
        assert_eq!(sizes(&["tiles"], 2049), ([2, 1, 1], 2049));
        assert_eq!(sizes(&["tiles"], u32::MAX), ([63_551, 33, 1], u32::MAX));
        assert_eq!(sizes(&["tiles", "tiles_of_tiles"], 5000), ([1, 1, 1], 3));
        assert_eq!(sizes(&["tiles", "tiles_of_tiles"], u32::MAX), ([1024, 1, 1], 1 << 21));
        assert_eq!(sizes(&["threads"], 0), ([0, 1, 1], 0));
        assert_eq!(sizes(&["threads"], 65), ([2, 1, 1], 65));
        assert_eq!(sizes(&["threads"], 65_536 * 64), ([32_768, 2, 1], 65_536 * 64));
        assert_eq!(sizes(&["threads", "threads_of_four"], 0), ([1, 1, 1], 1));
        assert_eq!(sizes(&["threads", "threads_of_four"], 1025), ([5, 1, 1], 257));
    }
}
