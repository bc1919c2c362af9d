//! Which devices there are, and which features they lack.

use crate::error::{Error, Result};
use crate::spirv::Controls;
#[cfg(not(target_vendor = "apple"))]
use ash::vk;
use std::sync::OnceLock;

/// The feature that wgpu must offer: unmodified SPIR-V.
pub(super) const FEATURES: wgpu::Features = wgpu::Features::PASSTHROUGH_SHADERS;

/// Limits of a kernel: buffers, threads per workgroup, and bytes that a workgroup shares.
pub(crate) const MOST_BUFFERS: u32 = 32;
pub(crate) const MOST_THREADS: u32 = 256;
pub(crate) const MOST_SHARED: u32 = 16_384;

/// A kind of device, in order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A card with its own memory.
    Discrete,
    /// Part of a processor.
    Integrated,
    /// A virtual machine's share of a card.
    Virtual,
    /// A driver that computes in software.
    Software,
    /// The driver does not say.
    Other,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Software => "software",
            Self::Other => "other",
        })
    }
}

/// A device of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// Its index in the list, from zero.
    pub number: usize,
    /// Its driver's name for it.
    pub name: String,
    /// Its kind.
    pub kind: Kind,
    /// The driver's name and version.
    pub driver: String,
    /// Bytes of its own memory, or of the memory shared with the processor.
    pub memory: Option<u64>,
    /// Required features that it lacks; empty for a usable one.
    pub missing: Vec<&'static str>,
}

/// Which device to open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The first device of the best [`Kind`] among those that lack nothing.
    #[default]
    Best,
    /// By index in the list.
    Number(usize),
    /// By part of its name, in any case: the best match.
    Name(String),
}

impl Choice {
    /// Parses a number, or else part of a name; an empty text means the best device.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        match (text.trim(), text.trim().parse()) {
            ("", _) => Self::Best,
            (_, Ok(number)) => Self::Number(number),
            (name, Err(_)) => Self::Name(name.to_owned()),
        }
    }
}

/// All Vulkan devices of this machine, including unusable ones.
///
/// # Errors
/// [`Error::NoVulkan`] where there is none.
pub fn list() -> Result<Vec<Listed>> {
    Ok(found()?.into_iter().map(|found| found.listed).collect())
}

pub(super) struct Found {
    pub adapter: wgpu::Adapter,
    pub listed: Listed,
    pub controls: Controls,
}

pub(super) fn find(choice: &Choice) -> Result<Found> {
    let mut all = found()?;
    let listed: Vec<&Listed> = all.iter().map(|found| &found.listed).collect();
    let at = choose(choice, &listed)?;
    Ok(all.swap_remove(at))
}

/// The index of the chosen device.
fn choose(choice: &Choice, all: &[&Listed]) -> Result<usize> {
    let suits = |listed: &Listed| match choice {
        Choice::Best => true,
        Choice::Number(number) => listed.number == *number,
        Choice::Name(part) => listed.name.to_lowercase().contains(&part.to_lowercase()),
    };
    let suitable = (0..all.len()).filter(|i| suits(all[*i]));
    let best = suitable.min_by_key(|i| (!all[*i].missing.is_empty(), all[*i].kind, *i));
    best.ok_or_else(|| Error::NoSuchDevice {
        asked: match choice {
            Choice::Best => String::new(),
            Choice::Number(number) => number.to_string(),
            Choice::Name(name) => name.clone(),
        },
        there: all
            .iter()
            .map(|listed| format!("{} {}", listed.number, listed.name))
            .collect::<Vec<_>>()
            .join(", "),
    })
}

/// A single instance for the whole process, which keeps its drivers loaded: some leave destructors behind that run at
/// process exit and would crash after the driver is unloaded.
///
/// A process forked from one that has an instance is refused: drivers have threads and locks that do not exist in it.
fn instance() -> Result<&'static wgpu::Instance> {
    static INSTANCE: OnceLock<(u32, wgpu::Instance)> = OnceLock::new();
    let own = std::process::id();
    let (process, instance) = INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        // No layers, and no checks of indirect calls by wgpu's own kernels.
        descriptor.flags = wgpu::InstanceFlags::empty();
        (own, wgpu::Instance::new(descriptor))
    });
    match *process == own {
        true => Ok(instance),
        false => Err(Error::Forked),
    }
}

fn found() -> Result<Vec<Found>> {
    let adapters = pollster::block_on(instance()?.enumerate_adapters(wgpu::Backends::VULKAN));
    if adapters.is_empty() {
        return Err(Error::NoVulkan);
    }
    let found = adapters.into_iter().enumerate().map(|(number, adapter)| {
        let info = adapter.get_info();
        let Looked {
            memory,
            mut missing,
            controls,
        } = look(&adapter);
        if !adapter.features().contains(FEATURES) {
            missing.push("passthrough of SPIR-V");
        }
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < MOST_BUFFERS {
            missing.push("32 storage buffers a kernel");
        }
        if limits.max_compute_invocations_per_workgroup < MOST_THREADS
            || limits.max_compute_workgroup_storage_size < MOST_SHARED
        {
            missing.push("workgroups of 256 threads that share 16 KiB");
        }
        let listed = Listed {
            number,
            name: info.name,
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => Kind::Discrete,
                wgpu::DeviceType::IntegratedGpu => Kind::Integrated,
                wgpu::DeviceType::VirtualGpu => Kind::Virtual,
                wgpu::DeviceType::Cpu => Kind::Software,
                wgpu::DeviceType::Other => Kind::Other,
            },
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            memory,
            missing,
        };
        Found {
            adapter,
            listed,
            controls,
        }
    });
    Ok(found.collect())
}

/// Properties that wgpu does not report.
#[derive(Default)]
struct Looked {
    /// Bytes.
    memory: Option<u64>,
    missing: Vec<&'static str>,
    controls: Controls,
}

/// Apple's machines have no Vulkan, and wgpu offers none there.
#[cfg(target_vendor = "apple")]
fn look(_: &wgpu::Adapter) -> Looked {
    Looked {
        missing: vec!["Vulkan"],
        ..Looked::default()
    }
}

#[cfg(not(target_vendor = "apple"))]
fn look(adapter: &wgpu::Adapter) -> Looked {
    // SAFETY: the handle is used only to query properties, and lives as long as the adapter.
    let Some(hal) = (unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }) else {
        return Looked {
            missing: vec!["Vulkan"],
            ..Looked::default()
        };
    };
    let instance = hal.shared_instance().raw_instance();
    let device = hal.raw_physical_device();
    // SAFETY: the physical device belongs to this instance.
    let memory = unsafe { instance.get_physical_device_memory_properties(device) };
    let heaps = memory.memory_heaps_as_slice();
    let own = heaps
        .iter()
        .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let memory = own.map(|heap| heap.size).max();

    // Core since that version.
    let driver = hal.physical_device_capabilities().properties().api_version;
    if driver.min(hal.shared_instance().instance_api_version()) < vk::API_VERSION_1_2 {
        return Looked {
            memory,
            missing: vec!["Vulkan 1.2"],
            ..Looked::default()
        };
    }
    let mut floats = vk::PhysicalDeviceFloatControlsProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut floats);
    // SAFETY: the chain of structures is well formed, and the physical device belongs to this instance.
    unsafe { instance.get_physical_device_properties2(device, &mut properties) };
    let controls = Controls {
        denormals: floats.shader_denorm_preserve_float32 == vk::TRUE,
        zeros: floats.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
        rounding: floats.shader_rounding_mode_rte_float32 == vk::TRUE,
    };
    Looked {
        memory,
        missing: Vec::new(),
        controls,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(number: usize, name: &str, kind: Kind, missing: Vec<&'static str>) -> Listed {
        Listed {
            number,
            name: name.to_owned(),
            kind,
            driver: "driver 1".to_owned(),
            memory: None,
            missing,
        }
    }

    #[test]
    fn the_best_device_is_a_card_that_lacks_nothing() {
        let all = [
            listed(0, "llvmpipe", Kind::Software, vec![]),
            listed(1, "Old Card", Kind::Discrete, vec!["Vulkan 1.2"]),
            listed(2, "Chip", Kind::Integrated, vec![]),
            listed(3, "New Card", Kind::Discrete, vec![]),
            listed(4, "New Card", Kind::Discrete, vec![]),
        ];
        let all: Vec<&Listed> = all.iter().collect();
        let choose = |text: &str| choose(&Choice::parse(text), &all).map_err(|e| e.to_string());
        assert_eq!(choose(""), Ok(3));
        assert_eq!(choose(" 1 "), Ok(1));
        assert_eq!(choose("card"), Ok(3));
        assert_eq!(choose("LLVM"), Ok(0));
        assert_eq!(choose("old card"), Ok(1));
        for wrong in ["5", "cart"] {
            let there = "0 llvmpipe, 1 Old Card, 2 Chip, 3 New Card, 4 New Card";
            let message = format!("there is no device \"{wrong}\"; there are: {there}");
            assert_eq!(choose(wrong), Err(message));
        }
    }
}
