//! From WGSL to SPIR-V that computes the same bits everywhere.
//!
//! naga translates. `rules` rejects operations that no translation could make the same. `words` adds what naga omits
//! (no contraction; denormal numbers, signed zeros, infinities and NaN preserved; the rounding mode) and removes the
//! clearing of stacks. `passes` makes a kernel work on several passes at once, and `dead` removes code that a scene
//! cannot reach.

mod dead;
mod passes;
mod rules;
mod words;

pub use words::Controls;

use crate::error::{Error, Result};
use naga::back::spv;
use naga::compact::{KeepUnused, compact};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator};

/// A compiled entry point.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Compiled {
    /// SPIR-V 1.3.
    pub words: Vec<u32>,
    /// Threads per workgroup.
    pub workgroup: [u32; 3],
    /// The buffers that it uses, by binding: group 1 is numbered after group 0.
    pub bindings: Vec<Binding>,
}

/// A buffer of a kernel.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Binding {
    /// Its number, without gaps: buffers that the entry point does not use are skipped.
    pub number: u32,
    /// Its name in the kernel.
    pub name: String,
    /// Whether the kernel writes it.
    pub written: bool,
    /// Whether each pass of a dispatch has its own part of it: the buffers of group 1.
    pub of_pass: bool,
}

/// Source that has been parsed, validated and checked against the rules.
#[derive(Debug)]
pub struct Checked {
    /// Its naga module.
    pub module: naga::Module,
    /// Its name in errors.
    pub kernel: String,
}

/// Parses a kernel, including everything it uses.
///
/// # Errors
/// [`Error::Kernel`] if it is not WGSL, [`Error::Forbidden`] if it has an operation that differs between devices.
pub fn check(kernel: &str, source: &str) -> Result<Checked> {
    let mut module = naga::front::wgsl::parse_str(source).map_err(|e| wrong(kernel, e.emit_to_string(source)))?;
    let info = validator(ValidationFlags::all())
        .validate(&module)
        .map_err(|e| wrong(kernel, e.emit_to_string(source)))?;
    rules::check(kernel, &module, &info)?;
    passes::split(&mut module, &info).map_err(|reason| wrong(kernel, reason))?;
    Ok(Checked {
        module,
        kernel: kernel.to_owned(),
    })
}

/// With all capabilities, so that the rules report forbidden operations, not naga.
fn validator(flags: ValidationFlags) -> Validator {
    let mut validator = Validator::new(flags, Capabilities::all());
    validator
        .subgroup_stages(ShaderStages::COMPUTE)
        .subgroup_operations(SubgroupOperationSet::all());
    validator
}

impl Checked {
    /// SPIR-V of one entry point, for a device with these float controls.
    ///
    /// # Errors
    /// [`Error::Kernel`] if there is no such entry point, or its bindings are no storage buffers of groups 0 and 1.
    pub fn compile(&self, entry: &str, controls: Controls) -> Result<Compiled> {
        let wrong = |reason: String| wrong(&self.kernel, reason);
        let mut module = self.module.clone();
        module.entry_points.retain(|e| e.name == entry);
        let workgroup = module.entry_points.first().map(|e| e.workgroup_size);
        let workgroup = workgroup.ok_or_else(|| wrong(format!("it has no entry point \"{entry}\"")))?;
        // Only what the entry point uses: drivers process everything they are given.
        dead::leave_out(&mut module);
        compact(&mut module, KeepUnused::No);
        let mut bindings = Vec::new();
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else {
                continue;
            };
            let naga::AddressSpace::Storage { access } = variable.space else {
                return Err(wrong(format!("binding {} is no storage buffer", binding.binding)));
            };
            if binding.group > passes::OF_PASS {
                return Err(wrong(format!("binding {} is not of group 0 or 1", binding.binding)));
            }
            bindings.push(Binding {
                number: binding.binding,
                name: variable.name.clone().unwrap_or_default(),
                written: access.contains(naga::StorageAccess::STORE),
                of_pass: binding.group == passes::OF_PASS,
            });
        }
        bindings.sort_by_key(|b| b.number);
        // wgpu counts the bindings of a layout and ignores gaps in their numbers.
        let mut map = spv::BindingMap::default();
        for (number, binding) in (0..).zip(&mut bindings) {
            let from = naga::ResourceBinding {
                group: if binding.of_pass { passes::OF_PASS } else { 0 },
                binding: binding.number,
            };
            let to = spv::BindingInfo {
                descriptor_set: 0,
                binding: number,
                binding_array_size: None,
            };
            map.insert(from, to);
            binding.number = number;
        }
        Ok(Compiled {
            words: words::exact(&self.translate(&module, entry, map)?, controls)
                .ok_or_else(|| wrong("its SPIR-V is cut off".to_owned()))?,
            workgroup,
            bindings,
        })
    }

    /// naga's SPIR-V. The device checks buffer bounds, as wgpu requests robust access. Workgroup memory is not cleared
    /// and loops are not bounded, since the kernels are ours.
    fn translate(&self, module: &naga::Module, entry: &str, binding_map: spv::BindingMap) -> Result<Vec<u32>> {
        // All threads of a workgroup belong to one pass, which naga does not know when the pass is read.
        let info = validator(ValidationFlags::all() - ValidationFlags::CONTROL_FLOW_UNIFORMITY)
            .validate(module)
            .map_err(|e| wrong(&self.kernel, e.as_inner().to_string()))?;
        let options = spv::Options {
            lang_version: (1, 3),
            flags: spv::WriterFlags::empty(),
            bounds_check_policies: BoundsCheckPolicies {
                index: BoundsCheckPolicy::Unchecked,
                buffer: BoundsCheckPolicy::Unchecked,
                image_load: BoundsCheckPolicy::Unchecked,
                binding_array: BoundsCheckPolicy::Unchecked,
            },
            zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
            force_loop_bounding: false,
            binding_map,
            ..Default::default()
        };
        let pipeline = spv::PipelineOptions {
            shader_stage: naga::ShaderStage::Compute,
            entry_point: entry.to_owned(),
        };
        spv::write_vec(module, &info, &options, Some(&pipeline)).map_err(|e| wrong(&self.kernel, e.to_string()))
    }
}

fn wrong(kernel: &str, reason: impl Into<String>) -> Error {
    Error::Kernel {
        kernel: kernel.to_owned(),
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Groups;
    use crate::kernels::Program;
    use crate::testing::tested;

    const KERNEL: &str = "
        @group(0) @binding(0) var<storage, read> left: array<f32>;
        @group(0) @binding(1) var<storage, read_write> right: array<vec3f>;
        @group(0) @binding(2) var<storage, read> other: array<f32>;
        fn native_quotient(a: f32, b: f32) -> f32 { return a / b; }
        fn twice(a: f32) -> f32 { return a + a; }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let x = left[id.x];
            let y = native_quotient(x * x - 1.0, -x) + twice(x);
            right[id.x] = -(vec3f(y) * x + vec3f(1.0, y, x) * right[0] - right[1]);
        }
        @compute @workgroup_size(8, 2) fn copy() { right[0].x = other[0]; }";

    const ALL: Controls = Controls {
        denormals: true,
        zeros: true,
        rounding: true,
    };

    /// Instructions after the header: operation and operands.
    fn instructions(words: &[u32]) -> Vec<(u32, Vec<u32>)> {
        let (mut at, mut all) = (5, Vec::new());
        while at < words.len() {
            let length = (words[at] >> 16) as usize;
            all.push((words[at] & 0xffff, words[at + 1..at + length].to_vec()));
            at += length;
        }
        all
    }

    #[test]
    fn no_operation_may_be_contracted() {
        let compiled = check("test", KERNEL).unwrap().compile("main", ALL).unwrap();
        let all = instructions(&compiled.words);
        let decorated: Vec<u32> = all
            .iter()
            .filter(|(op, rest)| *op == 71 && rest[1] == 42)
            .map(|(_, rest)| rest[0])
            .collect();
        // FNegate, FAdd, FSub, FMul, FDiv, VectorTimesScalar.
        for wanted in [127, 129, 131, 133, 136, 142] {
            let mut found = all.iter().filter(|(op, _)| *op == wanted).peekable();
            assert!(found.peek().is_some(), "no operation {wanted}");
            for (_, rest) in found {
                assert!(decorated.contains(&rest[1]), "operation {wanted} may be contracted");
            }
        }
        // Nothing else is decorated.
        let of_floats = all
            .iter()
            .filter(|(op, _)| (127..=148).contains(op) && ![128, 130, 132].contains(op));
        assert_eq!(decorated.len(), of_floats.count());
    }

    /// OpVariable: its type, and its initial value if any.
    #[test]
    fn long_arrays_are_not_cleared() {
        let kernel = "
            struct Search { at: u32, stack: array<f32, 16> }
            @group(0) @binding(0) var<storage, read_write> all: array<f32>;
            var<workgroup> shared_list: array<f32, 64>;
            @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
                var short: array<f32, 15>;
                short[i % 15] = all[i];
                LONG
                shared_list[i] = short[i % 15];
                all[i] = shared_list[63 - i];
            }";
        let cleared = |long: &str| {
            let kernel = kernel.replace("LONG", long);
            let words = check("test", &kernel).unwrap().compile("main", ALL).unwrap().words;
            let all = instructions(&words);
            all.iter().filter(|(op, rest)| *op == 59 && rest.len() > 3).count()
        };
        assert_eq!(cleared(""), 1);
        assert_eq!(
            cleared("var list: array<f32, 16>; list[i % 16] = all[0]; all[1] = list[i % 16];"),
            1
        );
        assert_eq!(
            cleared("var search: Search; search.stack[i % 16] = all[0]; all[1] = search.stack[i % 16];"),
            1
        );
        assert_eq!(
            cleared("var few: array<f32, 3>; few[i % 3] = all[0]; all[1] = few[i % 3];"),
            2
        );
    }

    #[test]
    fn denormals_zeros_and_rounding_are_asked_for() {
        let all = instructions(&check("test", KERNEL).unwrap().compile("main", ALL).unwrap().words);
        let position = |op: u32, rest: &[u32]| all.iter().position(|(o, r)| *o == op && r.ends_with(rest));
        let entry = all.iter().find(|(op, _)| *op == 15).unwrap().1[1];
        let memory_model = all.iter().position(|(op, _)| *op == 14).unwrap();
        for (capability, mode) in [(4464, 4459), (4466, 4461), (4467, 4462)] {
            assert!(position(17, &[capability]).unwrap() < memory_model);
            assert!(position(16, &[entry, mode, 32]).unwrap() > memory_model);
        }
        let name: Vec<u8> = all
            .iter()
            .filter(|(op, _)| *op == 10)
            .flat_map(|(_, rest)| rest.iter().flat_map(|w| w.to_le_bytes()))
            .collect();
        assert_eq!(
            String::from_utf8(name).unwrap().trim_end_matches('\0'),
            "SPV_KHR_float_controls"
        );
        // Sections in their order: capabilities, extensions, imports, memory model, entry points, modes.
        let order = |op: u32| [17, 10, 11, 14, 15, 16].iter().position(|o| *o == op);
        let sections: Vec<usize> = all.iter().map_while(|(op, _)| order(*op)).collect();
        assert!(sections.is_sorted() && sections.last() == Some(&5));
    }

    #[test]
    fn a_device_is_asked_for_what_it_has() {
        let modes = |controls: Controls| {
            let compiled = check("test", KERNEL).unwrap().compile("main", controls).unwrap();
            let all = instructions(&compiled.words);
            let modes: Vec<u32> = all
                .iter()
                .filter(|(op, rest)| *op == 16 && rest[1] > 4000)
                .map(|(_, rest)| rest[1])
                .collect();
            (modes, all.iter().any(|(op, _)| *op == 10))
        };
        let none = Controls::default();
        assert_eq!(modes(none), (vec![], false));
        assert_eq!(
            modes(Controls {
                denormals: true,
                ..none
            }),
            (vec![4459], true)
        );
        assert_eq!(modes(Controls { zeros: true, ..none }), (vec![4461], true));
        assert_eq!(modes(Controls { rounding: true, ..none }), (vec![4462], true));
    }

    #[test]
    fn bindings_are_those_that_an_entry_point_uses() {
        let checked = check("test", KERNEL).unwrap();
        let of = |entry| {
            let compiled = checked.compile(entry, ALL).unwrap();
            let bindings = compiled.bindings.into_iter();
            (
                bindings.map(|b| (b.number, b.name, b.written)).collect::<Vec<_>>(),
                compiled.workgroup,
            )
        };
        let right = (1, "right".to_owned(), true);
        assert_eq!(
            of("main"),
            (vec![(0, "left".to_owned(), false), right.clone()], [64, 1, 1])
        );
        let right = (0, "right".to_owned(), true);
        assert_eq!(of("copy"), (vec![right, (1, "other".to_owned(), false)], [8, 2, 1]));
        // And so they are in its words: OpDecorate, Binding.
        let words = checked.compile("copy", ALL).unwrap().words;
        let all = instructions(&words)
            .into_iter()
            .filter(|(op, rest)| *op == 71 && rest[1] == 33);
        let mut numbers: Vec<u32> = all.map(|(_, rest)| rest[2]).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [0, 1]);
    }

    /// Lists and single values, read, written and measured, also by functions.
    const OF_PASSES: Program = Program {
        name: "of_passes",
        texts: &["
            struct Sum { first: u32, rest: array<u32, 2> }
            @group(1) @binding(0) var<storage, read> numbers: array<u32>;
            @group(1) @binding(1) var<storage, read_write> sums: Sum;
            @group(1) @binding(2) var<storage, read_write> single: u32;
            @group(0) @binding(3) var<storage, read> scale: array<u32, 2>;
            @group(1) @binding(4) var<storage, read_write> count: atomic<u32>;
            @group(1) @binding(5) var<storage, read_write> all: array<Sum>;
            fn length() -> u32 { return arrayLength(&numbers); }
            fn last() -> u32 { return numbers[length() - 1u]; }
            @compute @workgroup_size(1) fn main() {
                let second = numbers[1] * scale[1];
                sums = Sum(numbers[0], array<u32, 2>(second, last()));
                sums.rest[numbers[0] % 2u] += 100u;
                if (length() == 3u) { single = sums.first + scale[0]; }
                for (var i = 0u; i < length(); i++) { atomicAdd(&count, numbers[i]); }
                let copy = sums;
                all[1] = copy;
                all[0].rest[1] = all[1].rest[0];
            }"],
    };

    #[test]
    fn passes_have_their_own_parts_of_buffers() {
        let Some(tested) = tested() else { return };
        let device = &tested.device;
        let kernel = tested.kernel(&OF_PASSES, "main");
        let numbers = device.parts("numbers", &[1_u32, 2, 3, 40, 50, 60, 7, 8, 9], 3).unwrap();
        let sums = device.empty_parts("sums", 12, 3).unwrap();
        let single = device.empty_parts("single", 4, 3).unwrap();
        let scale = device.buffer("scale", &[1000_u32, 2]).unwrap();
        let count = device.empty_parts("count", 4, 3).unwrap();
        let all = device.empty_parts("all", 24, 3).unwrap();
        let buffers = [&numbers, &sums, &single, &scale, &count, &all];
        let mut work = device.work_of(3);
        work.run(&kernel, &buffers, Groups::Count(1)).unwrap();
        work.submit().unwrap();
        let got = |buffer, count| device.read::<u32>(buffer, count).unwrap();
        assert_eq!(got(&sums, 9), [1, 4, 103, 40, 200, 60, 7, 16, 109]);
        assert_eq!(got(&single, 3), [1001, 1040, 1007]);
        assert_eq!(got(&count, 3), [6, 150, 24]);
        let all = got(&all, 18);
        assert_eq!(all[..6], [0, 0, 4, 1, 4, 103]);
        assert_eq!(all[12..], [0, 0, 16, 7, 16, 109]);
        // More passes than there are parts, and buffers without parts.
        let mut work = device.work_of(4);
        let error = work.run(&kernel, &buffers, Groups::Count(1)).err().unwrap().to_string();
        assert!(error.ends_with("\"numbers\" is not for 4 passes"), "{error}");
        let mut work = device.work_of(2);
        let buffers = [&numbers, &scale, &single, &scale, &count, &sums];
        let error = work.run(&kernel, &buffers, Groups::Count(1)).err().unwrap().to_string();
        assert!(error.ends_with("\"scale\" is not for 2 passes"), "{error}");
    }

    #[test]
    fn buffers_of_passes_are_lists_or_single_values() {
        let refused = |text: &str| check("test", text).err().unwrap().to_string();
        let entry = "@compute @workgroup_size(1) fn main()";
        let text = refused(&format!(
            "@group(1) @binding(0) var<storage, read_write> list: array<u32>;
            {entry} {{ for (var i = 0; i < 2; i++) {{ list[i] = 1u; }} }}"
        ));
        assert!(
            text.ends_with("a buffer of a pass is looked into by a signed number"),
            "{text}"
        );
        let text = refused(&format!(
            "struct List {{ count: u32, all: array<u32> }}
            @group(1) @binding(0) var<storage, read_write> list: List;
            {entry} {{ list.all[0] = 1u; }}"
        ));
        assert!(text.ends_with("\"list\" of a pass ends in a list"), "{text}");
    }

    #[test]
    fn what_is_no_kernel_is_an_error() {
        let text = |source: &str, entry: &str| {
            let result = check("test", source).and_then(|c| c.compile(entry, ALL));
            result.unwrap_err().to_string()
        };
        let message = text("fn main() { let x = ; }", "main");
        assert!(message.starts_with("kernel \"test\" does not compile: "), "{message}");
        let message = text("fn main() -> f32 { return 1u; }", "main");
        assert!(message.starts_with("kernel \"test\" does not compile: "), "{message}");
        assert_eq!(
            text(KERNEL, "other"),
            "kernel \"test\" does not compile: it has no entry point \"other\""
        );
        let entry = "@group(0) @binding(0) var<storage, read_write> all: array<vec4f>;
            @compute @workgroup_size(1) fn main() { all[0] = x; }";
        assert_eq!(
            text(&format!("@group(0) @binding(3) var<uniform> x: vec4f; {entry}"), "main"),
            "kernel \"test\" does not compile: binding 3 is no storage buffer"
        );
        assert_eq!(
            text(&format!("@group(2) @binding(3) var<storage> x: vec4f; {entry}"), "main"),
            "kernel \"test\" does not compile: binding 3 is not of group 0 or 1"
        );
    }
}
