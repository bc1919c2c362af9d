//! Kernels and buffers of a device, and the work it is given.

use super::times::Stamps;
use super::{Device, one_line};
use crate::error::{Error, Result};
use crate::spirv::{Binding, Compiled};
use bytemuck::Pod;
use std::borrow::Cow;
use std::num::NonZero;
use std::sync::{Arc, OnceLock, mpsc};

/// Most workgroups per dimension that Vulkan guarantees.
pub const GROUPS_PER_DIMENSION: u32 = 65_535;

/// An entry point, possibly still being compiled: whoever needs it waits. Copies share it.
#[derive(Clone, Debug, Default)]
pub struct Kernel(Arc<OnceLock<Result<Arc<Ready>>>>);

/// A kernel that is ready to run.
#[derive(Debug)]
pub(crate) struct Ready {
    name: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<Binding>,
}

impl Kernel {
    /// Stores the compiled kernel and wakes those that wait.
    pub(crate) fn compiled(&self, ready: Result<Arc<Ready>>) {
        // There is only one compiler of it.
        let _ = self.0.set(ready);
    }

    /// Waits until it is compiled.
    ///
    /// # Errors
    /// Compilation errors.
    pub(crate) fn ready(&self) -> Result<&Arc<Ready>> {
        self.0.wait().as_ref().map_err(Clone::clone)
    }
}

impl From<Ready> for Kernel {
    fn from(ready: Ready) -> Self {
        Self(Arc::new(OnceLock::from(Ok(Arc::new(ready)))))
    }
}

impl Ready {
    /// Its names for its buffers, in binding order.
    pub(crate) fn buffer_names(&self) -> impl Iterator<Item = &str> {
        self.bindings.iter().map(|binding| binding.name.as_str())
    }
}

/// Memory of a device. Copies share it.
#[derive(Clone, Debug)]
pub struct Buffer {
    inner: wgpu::Buffer,
    name: String,
    /// For a buffer with one part per pass: bytes per part, and the number of passes.
    parts: Option<(u64, u32)>,
}

impl Buffer {
    /// Its size in bytes, a multiple of 16.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.inner.size()
    }
}

/// Buffer values on their way back.
#[derive(Debug)]
pub struct Reading {
    staging: wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    mapped: mpsc::Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    name: String,
    count: usize,
}

/// The number of workgroups. A kernel numbers them with `group_number` of `kernels/groups.wgsl` and skips the surplus
/// ones.
#[derive(Clone, Copy)]
pub enum Groups<'a> {
    /// At least this many, in rows of at most [`GROUPS_PER_DIMENSION`].
    Count(u32),
    /// Three numbers in a buffer, written by `kernels/groups.wgsl`.
    From(&'a Buffer),
}

/// Dispatches that are submitted together and run in order: each sees what earlier ones wrote.
pub struct Work<'a> {
    device: &'a Device,
    encoder: wgpu::CommandEncoder,
    /// All dispatches share one compute pass: wgpu inserts barriers where one reads what another writes.
    pass: wgpu::ComputePass<'static>,
    /// Present if kernels are timed.
    stamps: Option<Stamps>,
    /// Number of passes per dispatch.
    passes: u32,
}

impl Device {
    /// Passes a compiled kernel to the driver.
    ///
    /// # Errors
    /// Driver errors, and a kernel with more buffers than the device can bind.
    pub(crate) fn kernel(&self, name: &str, compiled: &Compiled, entry: &str) -> Result<Ready> {
        let [x, y, z] = compiled.workgroup;
        // SAFETY: the words are naga's for a kernel that it validated, with only harmless additions; the entry point is
        // one of theirs.
        let module = unsafe {
            self.inner
                .create_shader_module_passthrough(wgpu::ShaderModuleDescriptorPassthrough {
                    label: Some(name),
                    entry_points: Cow::Owned(vec![wgpu::PassthroughShaderEntryPoint {
                        name: Cow::Borrowed(entry),
                        workgroup_size: (x, y, z),
                    }]),
                    spirv: Some(Cow::Borrowed(&compiled.words)),
                    ..Default::default()
                })
        };
        let entries: Vec<_> = compiled
            .bindings
            .iter()
            .map(|binding| wgpu::BindGroupLayoutEntry {
                binding: binding.number,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage {
                        read_only: !binding.written,
                    },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout = self.inner.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(name),
            entries: &entries,
        });
        let layouts = self.inner.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.inner.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&layouts),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.after(&format!("kernel \"{name}\""))?;
        Ok(Ready {
            name: name.to_owned(),
            pipeline,
            layout,
            bindings: compiled.bindings.clone(),
        })
    }

    /// A zeroed buffer of at least this many bytes. Errors call it `name`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] if the device cannot allocate that size.
    pub fn empty(&self, name: &str, bytes: u64) -> Result<Buffer> {
        let most = self.largest_buffer() / 16 * 16;
        if bytes > most {
            return Err(Error::OutOfMemory {
                device: self.listed.name.clone(),
                what: name.to_owned(),
                reason: format!("it would have {bytes} bytes, and {most} are the most"),
            });
        }
        let inner = self.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size: bytes.max(16).next_multiple_of(16),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::INDIRECT
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.after(name)?;
        Ok(Buffer {
            inner,
            name: name.to_owned(),
            parts: None,
        })
    }

    /// The same with this many bytes for each of several passes.
    ///
    /// # Errors
    /// As for [`Self::empty`].
    pub fn empty_parts(&self, name: &str, bytes: u64, passes: u32) -> Result<Buffer> {
        let bytes = bytes.max(4);
        let mut buffer = self.empty(name, bytes.saturating_mul(passes.into()))?;
        buffer.parts = Some((bytes, passes));
        Ok(buffer)
    }

    /// A buffer that begins with these values, divided evenly among several passes.
    ///
    /// # Errors
    /// As for [`Self::empty`].
    pub fn parts<T: Pod>(&self, name: &str, values: &[T], passes: u32) -> Result<Buffer> {
        if !values.len().is_multiple_of(passes.max(1) as usize) {
            let (device, what) = (self.listed.name.clone(), name.to_owned());
            let reason = format!("{} values are not as many for each of {passes} passes", values.len());
            return Err(Error::Refused { device, what, reason });
        }
        let mut buffer = self.buffer(name, values)?;
        let bytes = size_of_val(values) as u64 / u64::from(passes.max(1));
        buffer.parts = Some((bytes.max(4), passes));
        Ok(buffer)
    }

    /// A buffer that begins with these values.
    ///
    /// # Errors
    /// As for [`Self::empty`].
    pub fn buffer<T: Pod>(&self, name: &str, values: &[T]) -> Result<Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let buffer = self.empty(name, bytes.len() as u64)?;
        // Copies are by whole words.
        let whole = bytes.len() / 4 * 4;
        self.queue.write_buffer(&buffer.inner, 0, &bytes[..whole]);
        if whole < bytes.len() {
            let mut last = [0; 4];
            last[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
            self.queue.write_buffer(&buffer.inner, whole as u64, &last);
        }
        self.after(name)?;
        Ok(buffer)
    }

    /// The first `count` values of a buffer, after all work submitted before.
    ///
    /// # Errors
    /// A buffer of fewer values, or a device that is lost or takes too long.
    pub fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Result<Vec<T>> {
        self.end_read(self.begin_read::<T>(buffer, count)?)
    }

    /// The same without waiting: more work may be submitted in the meantime.
    ///
    /// # Errors
    /// A buffer of fewer values, and driver errors.
    pub fn begin_read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Result<Reading> {
        let bytes = (count * size_of::<T>()) as u64;
        if bytes > buffer.size() {
            let reason = format!("it has {} bytes, and not {bytes}", buffer.size());
            return Err(self.not_read(&buffer.name, reason));
        }
        let size = bytes.max(16).next_multiple_of(16);
        let staging = self.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some(&buffer.name),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.after(&buffer.name)?;
        let mut encoder = self.inner.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&buffer.inner, 0, &staging, 0, size);
        let submission = self.queue.submit([encoder.finish()]);
        self.after(&buffer.name)?;
        let (sender, mapped) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| _ = sender.send(result));
        Ok(Reading {
            staging,
            submission,
            mapped,
            name: buffer.name.clone(),
            count,
        })
    }

    /// Waits for a read that was [begun](Self::begin_read), with the same type.
    ///
    /// # Errors
    /// A device that is lost or takes too long.
    pub fn end_read<T: Pod>(&self, reading: Reading) -> Result<Vec<T>> {
        let Reading {
            staging,
            submission,
            mapped,
            name,
            count,
        } = reading;
        self.wait(&name, Some(submission))?;
        // Another waiting thread may be about to report it.
        match mapped.recv_timeout(self.patience) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(self.not_read(&name, one_line(&error.to_string()))),
            Err(_) => return Err(self.not_read(&name, "it was not mapped".to_owned())),
        }
        let view = staging.get_mapped_range(..);
        let view = view.map_err(|e| self.not_read(&name, one_line(&e.to_string())))?;
        let mut values = vec![T::zeroed(); count];
        let bytes = bytemuck::cast_slice_mut::<T, u8>(&mut values);
        let length = bytes.len();
        bytes.copy_from_slice(&view[..length]);
        Ok(values)
    }

    fn not_read(&self, name: &str, reason: String) -> Error {
        Error::Refused {
            device: self.listed.name.clone(),
            what: format!("reading {name}"),
            reason,
        }
    }

    /// Begins a piece of work.
    #[must_use]
    pub fn work(&self) -> Work<'_> {
        self.work_of(1)
    }

    /// The same with dispatches for this many passes together.
    #[must_use]
    pub fn work_of(&self, passes: u32) -> Work<'_> {
        let mut encoder = self.inner.create_command_encoder(&Default::default());
        let pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let mut pass = pass.forget_lifetime();
        let stamps = (self.times.as_ref()).map(|_| Stamps::begin(&self.inner, &mut pass));
        Work {
            device: self,
            encoder,
            pass,
            stamps,
            passes,
        }
    }
}

impl Work<'_> {
    /// Runs a kernel, with its buffers in binding order.
    ///
    /// # Errors
    /// A wrong number of buffers, fewer parts than passes, too many workgroups, and driver errors.
    pub fn run(&mut self, kernel: &Kernel, buffers: &[&Buffer], groups: Groups) -> Result<&mut Self> {
        let kernel = kernel.ready()?;
        let what = format!("kernel \"{}\"", kernel.name);
        let refused = |reason: String| Error::Refused {
            device: self.device.listed.name.clone(),
            what: what.clone(),
            reason,
        };
        if buffers.len() != kernel.bindings.len() {
            let names: Vec<&str> = kernel.bindings.iter().map(|b| b.name.as_str()).collect();
            let (given, names) = (buffers.len(), names.join(", "));
            return Err(refused(format!("it was given {given} buffers, and wants {names}")));
        }
        let rows = match groups {
            Groups::Count(0) => return Ok(self),
            Groups::Count(count) => Some(rows(count)),
            Groups::From(_) => None,
        };
        let mut entries = Vec::new();
        for (binding, buffer) in kernel.bindings.iter().zip(buffers) {
            let (bytes, has_all) = match buffer.parts {
                Some((bytes, passes)) => (bytes * u64::from(self.passes), self.passes <= passes),
                None => (buffer.size(), self.passes == 1 || !binding.of_pass),
            };
            if !has_all {
                let name = &buffer.name;
                return Err(refused(format!("\"{name}\" is not for {} passes", self.passes)));
            }
            entries.push(wgpu::BindGroupEntry {
                binding: binding.number,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &buffer.inner,
                    offset: 0,
                    size: NonZero::new(bytes),
                }),
            });
        }
        let group = self.device.inner.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&kernel.name),
            layout: &kernel.layout,
            entries: &entries,
        });
        self.pass.set_pipeline(&kernel.pipeline);
        self.pass.set_bind_group(0, &group, &[]);
        match (groups, rows) {
            (Groups::From(buffer), _) => self.pass.dispatch_workgroups_indirect(&buffer.inner, 0),
            (_, Some([x, y])) => self.pass.dispatch_workgroups(x, y, self.passes),
            (_, None) => {}
        }
        if let Some(stamps) = &mut self.stamps {
            stamps.after(&kernel.name, &mut self.pass);
        }
        self.device.after(&what)?;
        Ok(self)
    }

    /// Submits the work and returns at once; [`Device::read`] and [`Device::finish`] wait. If kernels are timed, this
    /// waits too.
    ///
    /// # Errors
    /// Driver errors.
    pub fn submit(self) -> Result<()> {
        let Self {
            device,
            mut encoder,
            pass,
            stamps,
            ..
        } = self;
        drop(pass);
        let readings = (stamps.as_ref()).map(|stamps| stamps.resolve(&device.inner, &mut encoder));
        device.queue.submit([encoder.finish()]);
        device.after("work")?;
        if let (Some(times), Some(stamps), Some(inner)) = (&device.times, stamps, readings) {
            let name = "times".to_owned();
            let readings = device.read(
                &Buffer {
                    inner,
                    name,
                    parts: None,
                },
                stamps.readings(),
            )?;
            times.add(
                &stamps,
                &readings,
                f64::from(device.queue.get_timestamp_period()) * 1e-9,
            );
        }
        Ok(())
    }
}

impl Device {
    /// Waits until all submitted work is done.
    ///
    /// # Errors
    /// A device that is lost or takes too long.
    pub fn finish(&self) -> Result<()> {
        self.wait("work", None)
    }
}

/// The shortest rows for this many workgroups.
fn rows(count: u32) -> [u32; 2] {
    let rows = count.div_ceil(GROUPS_PER_DIMENSION).max(1);
    [count.div_ceil(rows), rows]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workgroups_are_in_rows_that_any_device_can_run() {
        for (count, expected) in [
            (1, [1, 1]),
            (65_535, [65_535, 1]),
            (65_536, [32_768, 2]),
            (200_000, [50_000, 4]),
            (u32::MAX, [65_535, 65_537]),
        ] {
            assert_eq!(rows(count), expected);
        }
    }
}
