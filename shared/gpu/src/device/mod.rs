//! Devices: the list of them, an open one, its buffers and its work.

mod list;
mod times;
mod work;

pub use list::{Choice, Kind, Listed, list};
#[cfg(test)]
pub(crate) use list::{MOST_BUFFERS, MOST_SHARED, MOST_THREADS};
pub use times::KernelTime;
pub(crate) use work::Ready;
pub use work::{Buffer, GROUPS_PER_DIMENSION, Groups, Kernel, Reading, Work};

use crate::error::{Error, Result};
use crate::spirv::Controls;
use list::Found;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

/// Longest time for a single submission. Desktop drivers stop it sooner.
const PATIENCE: Duration = Duration::from_secs(60);

/// An open device. Its results are not yet verified: [`crate::self_test`] does that.
pub struct Device {
    inner: wgpu::Device,
    queue: wgpu::Queue,
    listed: Listed,
    controls: Controls,
    patience: Duration,
    faults: Arc<Faults>,
    /// Present if kernels are timed.
    times: Option<times::Times>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Device").field(&self.listed).finish()
    }
}

/// The driver's first complaint of its kind. It arrives by callbacks and is checked after each call; errors arrive in
/// the thread that made the call.
#[derive(Default)]
struct Faults {
    errors: Mutex<HashMap<ThreadId, Fault>>,
    lost: Mutex<Option<String>>,
}

enum Fault {
    Memory(String),
    Other(String),
}

impl Device {
    /// Opens a device with all its limits.
    ///
    /// # Errors
    /// No Vulkan, no such device, or one that lacks something that kernels need.
    pub fn open(choice: &Choice) -> Result<Self> {
        let Found {
            adapter,
            listed,
            controls,
        } = list::find(choice)?;
        if !listed.missing.is_empty() {
            return Err(Error::Missing {
                device: listed.name,
                features: listed.missing.join(", "),
            });
        }
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: None,
            required_features: list::FEATURES | adapter.features() & times::CLOCK,
            required_limits: adapter.limits(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        });
        let (inner, queue) = pollster::block_on(request).map_err(|e| Error::Refused {
            device: listed.name.clone(),
            what: "to be opened".to_owned(),
            reason: e.to_string(),
        })?;
        let faults = Arc::new(Faults::default());
        let shared = Arc::clone(&faults);
        inner.on_uncaptured_error(Arc::new(move |error| {
            let fault = match error {
                wgpu::Error::OutOfMemory { source } => Fault::Memory(source.to_string()),
                wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                    Fault::Other(description)
                }
            };
            let mut errors = shared.errors.lock().unwrap_or_else(PoisonError::into_inner);
            errors.entry(thread::current().id()).or_insert(fault);
        }));
        let shared = Arc::clone(&faults);
        inner.set_device_lost_callback(move |reason, message| {
            let text = format!("{reason:?}: {message}");
            shared
                .lost
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(text);
        });
        Ok(Self {
            inner,
            queue,
            listed,
            controls,
            patience: PATIENCE,
            faults,
            times: None,
        })
    }

    /// The device's description.
    #[must_use]
    pub fn listed(&self) -> &Listed {
        &self.listed
    }

    /// The float controls that its kernels are compiled with.
    #[must_use]
    pub fn controls(&self) -> Controls {
        self.controls
    }

    /// The largest buffer that a kernel can bind, in bytes.
    #[must_use]
    pub fn largest_buffer(&self) -> u64 {
        let limits = self.inner.limits();
        limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)
    }

    /// Sets how long [`Self::finish`] and [`Self::read`] wait.
    pub fn wait_at_most(&mut self, patience: Duration) {
        self.patience = patience;
    }

    /// Acts as a driver that has given the device up.
    #[cfg(test)]
    pub(crate) fn lose(&self) {
        self.inner.destroy();
    }

    /// A lost device reports it on the next query.
    fn ask_whether_lost(&self) {
        let _ = catch_unwind(AssertUnwindSafe(|| self.inner.poll(wgpu::PollType::Poll)));
    }

    /// The error of the latest call, if any.
    fn after(&self, what: &str) -> Result<()> {
        let device = || self.listed.name.clone();
        let mut errors = self.faults.errors.lock().unwrap_or_else(PoisonError::into_inner);
        let fault = errors.remove(&thread::current().id());
        drop(errors);
        if fault.is_some() {
            // A lost device refuses everything.
            self.ask_whether_lost();
        }
        let lost = self.faults.lost.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(reason) = &*lost {
            return Err(Error::Lost {
                device: device(),
                reason: one_line(reason),
            });
        }
        drop(lost);
        match fault {
            None => Ok(()),
            Some(Fault::Memory(reason)) => Err(Error::OutOfMemory {
                device: device(),
                what: what.to_owned(),
                reason: one_line(&reason),
            }),
            Some(Fault::Other(reason)) => Err(Error::Refused {
                device: device(),
                what: what.to_owned(),
                reason: one_line(&reason),
            }),
        }
    }

    /// Waits for a submission, or for all.
    fn wait(&self, what: &str, submission: Option<wgpu::SubmissionIndex>) -> Result<()> {
        let wait = wgpu::PollType::Wait {
            submission_index: submission,
            timeout: Some(self.patience),
        };
        // wgpu panics here if the device is lost.
        match catch_unwind(AssertUnwindSafe(|| self.inner.poll(wait))) {
            Ok(Ok(_)) => self.after(what),
            Ok(Err(wgpu::PollError::Timeout)) => {
                self.after(what)?;
                Err(Error::TimedOut {
                    device: self.listed.name.clone(),
                    seconds: self.patience.as_secs(),
                })
            }
            Ok(Err(error)) => {
                // Work given to a lost device was never submitted.
                self.ask_whether_lost();
                self.after(what)?;
                Err(Error::Refused {
                    device: self.listed.name.clone(),
                    what: what.to_owned(),
                    reason: one_line(&error.to_string()),
                })
            }
            Err(_) => {
                self.after(what)?;
                Err(Error::Lost {
                    device: self.listed.name.clone(),
                    reason: format!("waiting for {what} failed"),
                })
            }
        }
    }
}

/// wgpu prints causes line by line.
fn one_line(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests;
