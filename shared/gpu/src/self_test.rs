//! Checks at start whether a device computes as processors do, with operands of all kinds.

use crate::device::{Buffer, Choice, Device, Groups, Kernel, Ready, Work};
use crate::error::{Error, Result};
use crate::kernels::{Arithmetic, Needs, Program, SELF_TEST};
use crate::sine;
use crate::spirv::{self, Checked, Compiled};
use beamfarm_render::math;
use bytemuck::Pod;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::BTreeMap;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

/// Number of tested operand pairs: a device's own division, if inexact, is wrong for a few in a hundred of them.
const COUNT: usize = 1 << 17;

/// A program's text, checked once for all its entry points.
type OnceChecked = OnceLock<Result<Checked>>;

/// A device that computes as processors do.
#[derive(Debug)]
pub struct Tested {
    /// The device.
    pub device: Arc<Device>,
    /// Which of its own operations are exact.
    pub arithmetic: Arithmetic,
    kernels: Mutex<BTreeMap<(&'static str, String, Needs), Kernel>>,
    /// Kernels by their compiled form, as different needs may compile to the same.
    pipelines: Arc<Mutex<BTreeMap<Compiled, Kernel>>>,
    /// Texts of kernels that are being compiled.
    checked: Mutex<BTreeMap<String, Weak<OnceChecked>>>,
    /// Compiles several kernels at once: drivers are slow.
    compilers: ThreadPool,
}

impl Tested {
    /// Opens a device and tests it.
    ///
    /// # Errors
    /// As for [`Device::open`], and [`Error::Arithmetic`] for a device with different results.
    pub fn open(choice: &Choice) -> Result<Self> {
        Self::test(Device::open(choice)?)
    }

    /// Tests an open device.
    ///
    /// # Errors
    /// [`Error::Arithmetic`] for a device whose results differ from a processor's, and errors of running kernels.
    pub fn test(device: Device) -> Result<Self> {
        let operands = operands(COUNT);
        let source = SELF_TEST.source(Arithmetic::default());
        let wrong = differences(&device, &source, OPERATIONS, &operands)?;
        let arithmetic = Arithmetic {
            native_quotient: wrong[0] == 0,
            native_root: wrong[1] == 0,
        };
        judge(&device.listed().name, OPERATIONS, &wrong, operands.len())?;
        let source = SELF_TEST.source(arithmetic);
        let wrong = differences(&device, &source, FUNCTIONS, &operands)?;
        judge(&device.listed().name, FUNCTIONS, &wrong, operands.len())?;
        let compilers = ThreadPoolBuilder::new().thread_name(|i| format!("kernels {i}")).build();
        let compilers = compilers.map_err(|error| Error::Refused {
            device: device.listed().name.clone(),
            what: "kernels".to_owned(),
            reason: format!("no threads to compile them: {error}"),
        })?;
        Ok(Self {
            device: Arc::new(device),
            arithmetic,
            kernels: Mutex::default(),
            pipelines: Arc::default(),
            checked: Mutex::default(),
            compilers,
        })
    }

    /// Times each kernel from here on, see [`Device::time_kernels`]. Also returns false if kernels already exist.
    pub fn time_kernels(&mut self) -> bool {
        Arc::get_mut(&mut self.device).is_some_and(Device::time_kernels)
    }

    /// An entry point of a program. Each is compiled once, in a separate thread; programs are identified by name.
    #[must_use]
    pub fn kernel(&self, program: &Program, entry: &str) -> Kernel {
        self.kernel_for(program, entry, Needs::ALL)
    }

    /// The same for the needs of a scene.
    #[must_use]
    pub fn kernel_for(&self, program: &Program, entry: &str, needs: Needs) -> Kernel {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kernels.entry((program.name, entry.to_owned(), needs));
        let known = place.or_insert_with(|| {
            let compiling = Kernel::default();
            let (device, pipelines) = (self.device.clone(), self.pipelines.clone());
            let (kernel, entry) = (compiling.clone(), entry.to_owned());
            let (name, source) = (program.name, program.source_for(self.arithmetic, needs));
            let checked = self.checked(&source);
            self.compilers.spawn(move || {
                let made = guarded(name, || {
                    let checked = checked.get_or_init(|| spirv::check(name, &source));
                    let checked = checked.as_ref().map_err(Clone::clone)?;
                    pipeline(&device, &pipelines, checked, &entry)
                });
                kernel.compiled(made);
            });
            compiling
        });
        known.clone()
    }

    /// The checked form of a text, shared while something is compiled from it.
    fn checked(&self, source: &str) -> Arc<OnceChecked> {
        let mut all = self.checked.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.get(source).and_then(Weak::upgrade) {
            return known;
        }
        all.retain(|_, checked| checked.strong_count() > 0);
        let new = Arc::default();
        all.insert(source.to_owned(), Arc::downgrade(&new));
        new
    }

    /// Waits until all requested kernels are compiled.
    ///
    /// # Errors
    /// The first error of compiling them, or of the driver.
    pub fn compile(&self) -> Result<()> {
        let kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        kernels.values().try_for_each(|kernel| kernel.ready().map(drop))
    }
}

/// A device, and the number of passes rendered on it together.
#[derive(Clone, Copy, Debug)]
pub struct Together<'a> {
    /// The device.
    pub tested: &'a Tested,
    /// Number of passes with their own part of each buffer.
    pub passes: u32,
}

impl<'a> From<&'a Tested> for Together<'a> {
    /// A single pass.
    fn from(tested: &'a Tested) -> Self {
        Self { tested, passes: 1 }
    }
}

impl Deref for Together<'_> {
    type Target = Tested;

    fn deref(&self) -> &Tested {
        self.tested
    }
}

impl<'a> Together<'a> {
    /// A zeroed buffer with this many bytes for each pass.
    ///
    /// # Errors
    /// As for [`Device::empty`].
    pub fn empty(&self, name: &str, bytes: u64) -> Result<Buffer> {
        self.device.empty_parts(name, bytes, self.passes)
    }

    /// The same value for each pass.
    ///
    /// # Errors
    /// As for [`Device::empty`].
    pub fn value<T: Pod>(&self, name: &str, value: T) -> Result<Buffer> {
        self.device.parts(name, &vec![value; self.passes as usize], self.passes)
    }

    /// Work for all passes.
    #[must_use]
    pub fn work(&self) -> Work<'a> {
        self.tested.device.work_of(self.passes)
    }
}

/// The pipeline of an entry point. One thread makes it; others that need it wait.
fn pipeline(
    device: &Device,
    pipelines: &Mutex<BTreeMap<Compiled, Kernel>>,
    checked: &Checked,
    entry: &str,
) -> Result<Arc<Ready>> {
    let name = &checked.kernel;
    let compiled = checked.compile(entry, device.controls())?;
    let mut all = pipelines.lock().unwrap_or_else(PoisonError::into_inner);
    let known = all.get(&compiled).cloned();
    let kernel = known.clone().unwrap_or_default();
    if known.is_none() {
        all.insert(compiled.clone(), kernel.clone());
    }
    drop(all);
    if known.is_none() {
        let full_name = format!("{name}: {entry}");
        kernel.compiled(guarded(name, || {
            device.kernel(&full_name, &compiled, entry).map(Arc::new)
        }));
    }
    kernel.ready().cloned()
}

/// Turns a panic into an error, so that nobody waits forever.
fn guarded(kernel: &str, compile: impl FnOnce() -> Result<Arc<Ready>>) -> Result<Arc<Ready>> {
    catch_unwind(AssertUnwindSafe(compile)).unwrap_or_else(|_| {
        let (kernel, reason) = (kernel.to_owned(), "compiling it panicked".to_owned());
        Err(Error::Kernel { kernel, reason })
    })
}

fn compile(device: &Device, name: &str, source: &str, entry: &str) -> Result<Ready> {
    let compiled = spirv::check(name, source)?.compile(entry, device.controls())?;
    device.kernel(&format!("{name}: {entry}"), &compiled, entry)
}

/// An error for the first row that differs and must not.
fn judge(device: &str, rows: Rows, wrong: &[usize], count: usize) -> Result<()> {
    match rows.all.iter().zip(wrong).skip(rows.own).find(|(_, wrong)| **wrong > 0) {
        None => Ok(()),
        Some(((operation, _), wrong)) => Err(Error::Arithmetic {
            device: device.to_owned(),
            operation,
            wrong: *wrong,
            count,
        }),
    }
}

/// An operation's name, and its bits on a processor.
type Row = (&'static str, fn([u32; 2]) -> u32);

/// Operations of an entry point of `kernels/self_test.wgsl`, in its order.
#[derive(Clone, Copy)]
struct Rows {
    entry: &'static str,
    /// Number of initial operations that are the device's own and may differ: kernels have replacements for them.
    own: usize,
    all: &'static [Row],
}

/// A row of float operations.
macro_rules! float {
    ($name:literal, |$a:pat_param, $b:pat_param| $result:expr) => {
        ($name, |[a, b]| {
            let ($a, $b) = (f32::from_bits(a), f32::from_bits(b));
            canonical($result)
        })
    };
}

const OPERATIONS: Rows = Rows {
    entry: "operations",
    own: 2,
    all: &[
        float!("/", |a, b| a / b),
        float!("sqrt", |a, _| a.sqrt()),
        float!("own quotients", |a, b| a / b),
        float!("own roots", |a, _| a.sqrt()),
        float!("a + b", |a, b| a + b),
        float!("a - b", |a, b| a - b),
        float!("a * b", |a, b| a * b),
        float!("a * b + b", |a, b| a * b + b),
        float!("a * a - b * b", |a, b| a * a - b * b),
        float!("-a * b - a", |a, b| -a * b - a),
        float!("floor", |a, _| a.floor()),
        float!("ceil", |a, _| a.ceil()),
        float!("trunc", |a, _| a.trunc()),
        float!("round", |a, _| a.round_ties_even()),
        ("comparisons", |[a, b]| {
            let (a, b) = (f32::from_bits(a), f32::from_bits(b));
            u32::from(a < b) | u32::from(a <= b) << 1 | u32::from(a == b) << 2 | u32::from(a >= b) << 3
        }),
        float!("select", |a, b| if a > b { b } else { -a.abs() }),
        ("floats of unsigned integers", |[u, _]| (u as f32).to_bits()),
        ("floats of signed integers", |[u, _]| (u as i32 as f32).to_bits()),
        ("signed integers of floats", |[a, _]| within(a) as i32 as u32),
        ("unsigned integers of floats", |[a, _]| within(a).abs() as u32),
        ("low words of products", |[u, v]| u.wrapping_mul(v)),
        ("high words of products", |[u, v]| {
            ((u64::from(u) * u64::from(v)) >> 32) as u32
        }),
        ("leading zeros", |[u, _]| u.leading_zeros()),
        ("reversed bits", |[u, _]| u.reverse_bits()),
        ("shifts and quotients of integers", |[u, v]| {
            (u as i32 >> (v & 31)) as u32 ^ (u / v.max(1))
        }),
    ],
};

const FUNCTIONS: Rows = Rows {
    entry: "functions",
    own: 0,
    all: &[
        float!("quotients", |a, b| a / b),
        float!("roots", |a, _| a.sqrt()),
        float!("exponential", |a, _| math::exp(a)),
        float!("exp_neg", |a, _| math::exp_neg(-a.abs())),
        float!("ln", |a, _| math::ln(a)),
        float!("sines", |a, _| sine::sin_cos(a).0),
        float!("cosines", |a, _| sine::sin_cos(a).1),
        float!("arc_cos", |a, _| math::acos(a)),
        float!("arc_tan2", |a, b| math::atan2(a, b)),
        float!("power", |a, b| math::powf(a, b)),
    ],
};

/// All NaN count as equal.
fn canonical(x: f32) -> u32 {
    if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() }
}

fn within(bits: u32) -> f32 {
    let a = f32::from_bits(bits);
    if a.abs() < 2_147_483_648.0 { a } else { 0.0 }
}

/// Number of differing results in each row.
fn differences(device: &Device, source: &str, rows: Rows, operands: &[[u32; 2]]) -> Result<Vec<usize>> {
    let kernel = Kernel::from(compile(device, SELF_TEST.name, source, rows.entry)?);
    let input = device.buffer("operands", operands)?;
    let length = rows.all.len() * operands.len();
    let output = device.empty("results", 4 * length as u64)?;
    let mut work = device.work();
    let groups = Groups::Count(operands.len().div_ceil(64) as u32);
    work.run(&kernel, &[&input, &output], groups)?;
    work.submit()?;
    let results: Vec<u32> = device.read(&output, length)?;
    let differ = |bits: u32, exact: u32| bits != exact && canonical(f32::from_bits(bits)) != exact;
    let count = |((_, exact), got): (&Row, &[u32])| {
        let pairs = operands.iter().zip(got);
        pairs.filter(|(pair, bits)| differ(**bits, exact(**pair))).count()
    };
    Ok(rows
        .all
        .iter()
        .zip(results.chunks(operands.len().max(1)))
        .map(count)
        .collect())
}

/// Edge cases of floats.
const EDGES: [u32; 32] = [
    // 0, the smallest denormal numbers, the largest, the smallest normal ones, 2^-100.
    0,
    1,
    2,
    3,
    0x0000_ffff,
    0x0040_0000,
    0x007f_ffff,
    0x0080_0000,
    0x0080_0001,
    0x0100_0000,
    0x0d80_0000,
    // Around 2^-12, 1/2, pi/4, 1, 3/2, 2, 3, pi, 24 bits, 2^31, 2^100; the largest, infinity, NaN.
    0x3980_0000,
    0x3eff_ffff,
    0x3f00_0000,
    0x3f49_0fdb,
    0x3f7f_ffff,
    0x3f80_0000,
    0x3f80_0001,
    0x3fb5_04f3,
    0x3fc0_0000,
    0x4000_0000,
    0x4040_0000,
    0x4049_0fdb,
    0x42ae_ac50,
    0x42b1_7218,
    0x4b7f_ffff,
    0x4b80_0000,
    0x4f00_0000,
    0x7180_0000,
    0x7f7f_ffff,
    0x7f80_0000,
    0x7fc0_0000,
];

/// Pairs of bit patterns: first all edge cases with either sign, then random ones that tell operations apart, always
/// the same.
fn operands(count: usize) -> Vec<[u32; 2]> {
    const SIGN: u32 = 1 << 31;
    let signed: Vec<u32> = EDGES.iter().flat_map(|e| [*e, e | SIGN]).collect();
    let edges = signed.iter().flat_map(|a| signed.iter().map(|b| [*a, *b]));
    let mut state = 1u64;
    let mut draw = || {
        state = beamfarm_render::sampler::mix64(state);
        state as u32
    };
    let exponent = |bits: u32, e: u32| (bits & 0x807f_ffff) | (e & 255) << 23;
    let random = (0..).map(|i| {
        let (a, b) = (draw(), draw());
        match i % 8 {
            // Any pattern.
            0 | 1 => [a, b],
            // Near one, as most numbers are.
            2 | 3 => [exponent(a, 111 + (draw() & 31)), exponent(b, 111 + (draw() & 31))],
            // Quotients and products that are denormal or overflow.
            4 => [exponent(a, draw() & 31), exponent(b, 127 + (draw() & 63))],
            5 => [exponent(a, 192 + (draw() & 63)), exponent(b, 64 + (draw() & 127))],
            // Few bits: results that are exact, or halfway between two floats.
            6 => {
                let short = |bits: u32| bits & (u32::MAX << (8 + (bits & 15)));
                [
                    exponent(short(a), 100 + (draw() & 63)),
                    exponent(short(b), 100 + (draw() & 31)),
                ]
            }
            // Squares and their neighbours.
            _ => {
                let root = f32::from_bits(exponent(a & 0x7fff_f000, 64 + (draw() & 127)));
                let square = (root * root).to_bits();
                [square.wrapping_add(b % 3).wrapping_sub(1), root.to_bits()]
            }
        }
    });
    edges.chain(random).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::device;

    /// The rows that differ, and how often.
    fn found(device: &Device, source: &str, rows: Rows, operands: &[[u32; 2]]) -> Vec<(&'static str, usize)> {
        let wrong = differences(device, source, rows, operands).unwrap();
        let all = rows.all.iter().zip(wrong).filter(|(_, wrong)| *wrong > 0);
        all.map(|((name, _), wrong)| (*name, wrong)).collect()
    }

    #[test]
    fn a_device_computes_as_processors_do() {
        let Some(device) = device() else { return };
        let operands = operands(1 << 20);
        let mut own = found(&device, &SELF_TEST.source(Arithmetic::default()), OPERATIONS, &operands);
        // The device's own operations may differ; others may not.
        own.retain(|(name, _)| !["/", "sqrt"].contains(name));
        assert_eq!(own, []);
        let tested = Tested::test(device).unwrap();
        for arithmetic in [Arithmetic::default(), tested.arithmetic] {
            let wrong = found(&tested.device, &SELF_TEST.source(arithmetic), FUNCTIONS, &operands);
            assert_eq!(wrong, []);
        }
    }

    /// A device whose own division and root are off by a few units in the last place.
    #[test]
    fn quotients_and_roots_are_exact_where_a_device_is_not() {
        let Some(device) = device() else { return };
        let operands = operands(1 << 18);
        for off in ["+ 3u", "+ 1u", "- 1u", "- 3u"] {
            let source = SELF_TEST.source(Arithmetic::default());
            let source = source
                .replace(
                    "return a / b;",
                    &format!("return bitcast<f32>(bitcast<u32>(a / b) {off});"),
                )
                .replace(
                    "return sqrt(x);",
                    &format!("return bitcast<f32>(bitcast<u32>(sqrt(x)) {off});"),
                );
            let wrong = found(&device, &source, OPERATIONS, &operands);
            let names: Vec<&str> = wrong.iter().map(|(name, _)| *name).collect();
            assert_eq!(names, ["/", "sqrt"], "{off}");
        }
    }

    #[test]
    fn a_device_that_computes_otherwise_is_named() {
        let mut wrong = vec![0; OPERATIONS.all.len()];
        (wrong[0], wrong[1]) = (7, 8);
        assert_eq!(judge("card", OPERATIONS, &wrong, 100), Ok(()));
        (wrong[7], wrong[9]) = (3, 4);
        assert_eq!(
            judge("card", OPERATIONS, &wrong, 100).unwrap_err().to_string(),
            "card is not used: 3 of 100 results of a * b + b have other bits than a processor's"
        );
        // Contraction, as some drivers do it.
        let Some(device) = device() else { return };
        let source = SELF_TEST.source(Arithmetic::default());
        let source = source.replace("put_float(7u, i, a * b + b)", "put_float(7u, i, a * (b + 1e-7) + b)");
        let wrong = differences(&device, &source, OPERATIONS, &operands(5000)).unwrap();
        let error = judge("card", OPERATIONS, &wrong, 5000).unwrap_err();
        assert!(
            matches!(
                error,
                Error::Arithmetic {
                    operation: "a * b + b",
                    ..
                }
            ),
            "{error}"
        );
    }

    #[test]
    fn operands_are_of_all_kinds() {
        let all = operands(1 << 16);
        let floats = || all.iter().map(|[a, b]| (f32::from_bits(*a), f32::from_bits(*b)));
        let count = |of: fn(f32, f32) -> bool| floats().filter(|(a, b)| of(*a, *b)).count();
        assert!(count(|a, _| a.is_subnormal()) > 1000);
        assert!(count(|_, b| b.is_nan()) > 100);
        assert!(count(|a, b| (a / b).is_subnormal()) > 1000);
        assert!(count(|a, b| a.is_finite() && (a * b).is_infinite()) > 1000);
        assert!(count(|a, b| a != 0.0 && a / b * b == a) > 1000);
        assert!(count(|a, _| a > 0.0 && a.sqrt() * a.sqrt() == a) > 1000);
        let mut exponents = [0; 256];
        all.iter().for_each(|[a, _]| exponents[(a >> 23 & 255) as usize] += 1);
        assert!(exponents.iter().all(|n| *n > 20));
    }
}
