//! Errors that name the device, the kernel and the request.

/// Why a device cannot be used, or failed a request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// No driver, or none with a device.
    #[error("no Vulkan device was found: is a driver installed?")]
    NoVulkan,
    /// The process was forked from one that had opened Vulkan.
    #[error(
        "this process was forked from one that has used Vulkan, whose drivers do not survive that: expected a new process \
         (of Python's multiprocessing the method \"spawn\")"
    )]
    Forked,
    /// A number or name that no device has.
    #[error("there is no device \"{asked}\"; there are: {there}")]
    NoSuchDevice {
        /// The request.
        asked: String,
        /// Numbers and names of all devices.
        there: String,
    },
    /// A device without features that kernels need.
    #[error("{device} cannot be used: it lacks {features}")]
    Missing {
        /// Its name.
        device: String,
        /// Names of the missing features, separated by commas.
        features: String,
    },
    /// A device whose arithmetic gives other bits than processors.
    #[error("{device} is not used: {wrong} of {count} results of {operation} have other bits than a processor's")]
    Arithmetic {
        /// Its name.
        device: String,
        /// The operation, in words.
        operation: &'static str,
        /// Number of differing results.
        wrong: usize,
        /// Number of all results.
        count: usize,
    },
    /// The device has no memory for a buffer.
    #[error("{device} has no memory for {what}: {reason}")]
    OutOfMemory {
        /// Its name.
        device: String,
        /// The buffer, or the call.
        what: String,
        /// Sizes, or the driver's message.
        reason: String,
    },
    /// The driver gave the device up.
    #[error("{device} was lost: {reason}")]
    Lost {
        /// Its name.
        device: String,
        /// The driver's message.
        reason: String,
    },
    /// The device did not finish in time.
    #[error("{device} did not finish within {seconds} s")]
    TimedOut {
        /// Its name.
        device: String,
        /// The limit, in seconds.
        seconds: u64,
    },
    /// The driver refused a call.
    #[error("{device} refused {what}: {reason}")]
    Refused {
        /// Its name.
        device: String,
        /// The call.
        what: String,
        /// The driver's message.
        reason: String,
    },
    /// A pass that no device renders, because its scene is invalid at its moment.
    #[error("pass {pass}: {why}")]
    NoMoment {
        /// Its index.
        pass: u64,
        /// The flaw.
        why: String,
    },
    /// A scene, or its plan, that kernels cannot render.
    #[error("{device} cannot render it: {reasons}")]
    Unsuitable {
        /// Its name.
        device: String,
        /// All reasons, separated by semicolons.
        reasons: String,
    },
    /// A kernel that is invalid WGSL.
    #[error("kernel \"{kernel}\" does not compile: {reason}")]
    Kernel {
        /// Its name.
        kernel: String,
        /// The compiler's message.
        reason: String,
    },
    /// A kernel with an operation whose bits differ between devices.
    #[error("kernel \"{kernel}\": function \"{function}\" uses {operation}, whose result differs between devices")]
    Forbidden {
        /// The kernel's name.
        kernel: String,
        /// The function's name.
        function: String,
        /// The operation, as WGSL calls it.
        operation: String,
    },
}

/// Results of this crate.
pub type Result<T> = std::result::Result<T, Error>;
