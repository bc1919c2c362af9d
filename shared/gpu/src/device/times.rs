//! Kernel times by the device's own clock.

use super::Device;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Features that timing requires.
pub(super) const CLOCK: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);

/// Timestamps per piece of work, the most in a wgpu query set.
const STAMPS: u32 = 4096;

/// Accumulated time of one kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelTime {
    /// Its program and entry point.
    pub kernel: String,
    /// Timed dispatches, including empty ones.
    pub dispatches: u64,
    /// Total time from the end of the previous dispatch to the end of its own.
    pub time: Duration,
}

/// Sums by kernel.
#[derive(Default)]
pub(super) struct Times(Mutex<BTreeMap<String, (u64, f64)>>);

impl Times {
    /// Adds the times of a piece of work, from [`Stamps::readings`] clock readings in units of `period` seconds.
    pub(super) fn add(&self, stamps: &Stamps, readings: &[u64], period: f64) {
        let mut times = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for (kernel, pair) in stamps.kernels.iter().zip(readings.windows(2)) {
            let (dispatches, seconds) = times.entry(kernel.clone()).or_default();
            *dispatches += 1;
            *seconds += pair[1].saturating_sub(pair[0]) as f64 * period;
        }
    }
}

/// The clock readings of a piece of work: one at its start, and one after each dispatch.
pub(super) struct Stamps {
    set: wgpu::QuerySet,
    kernels: Vec<String>,
}

impl Stamps {
    pub(super) fn begin(device: &wgpu::Device, pass: &mut wgpu::ComputePass<'_>) -> Self {
        let set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: STAMPS,
        });
        pass.write_timestamp(&set, 0);
        let kernels = Vec::new();
        Self { set, kernels }
    }

    /// Reads the clock after a dispatch. Dispatches beyond the end of the set are not timed.
    pub(super) fn after(&mut self, kernel: &str, pass: &mut wgpu::ComputePass<'_>) {
        let number = self.kernels.len() as u32 + 1;
        if number < STAMPS {
            pass.write_timestamp(&self.set, number);
            self.kernels.push(kernel.to_owned());
        }
    }

    /// The number of readings.
    pub(super) fn readings(&self) -> usize {
        self.kernels.len() + 1
    }

    /// Writes the readings to a buffer once the work is done.
    pub(super) fn resolve(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) -> wgpu::Buffer {
        let count = self.readings() as u32;
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: (u64::from(count) * 8).next_multiple_of(16),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.resolve_query_set(&self.set, 0..count, &buffer, 0);
        buffer
    }
}

impl Device {
    /// Times each kernel from here on; submitted work is then waited for. Returns false if the device has no clock for
    /// it.
    pub fn time_kernels(&mut self) -> bool {
        let has_clock = self.inner.features().contains(CLOCK);
        self.times = has_clock.then(Times::default);
        has_clock
    }

    /// Kernel times since [`Self::time_kernels`] or the previous call; the longest first.
    #[must_use]
    pub fn kernel_times(&self) -> Vec<KernelTime> {
        let Some(Times(times)) = &self.times else {
            return Vec::new();
        };
        let sums = std::mem::take(&mut *times.lock().unwrap_or_else(PoisonError::into_inner));
        let mut all: Vec<KernelTime> = sums
            .into_iter()
            .map(|(kernel, (dispatches, seconds))| KernelTime {
                kernel,
                dispatches,
                time: Duration::from_secs_f64(seconds.max(0.0)),
            })
            .collect();
        all.sort_by(|a, b| b.time.cmp(&a.time).then_with(|| a.kernel.cmp(&b.kernel)));
        all
    }
}
