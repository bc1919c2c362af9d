use super::*;
use crate::spirv;
use crate::testing::device;

fn kernel(device: &Device, source: &str) -> Result<Kernel> {
    let compiled = spirv::check("test", source)?.compile("main", device.controls())?;
    Ok(device.kernel("test", &compiled, "main")?.into())
}

const SQUARES: &str = "
    @group(0) @binding(0) var<storage, read> numbers: array<u32>;
    @group(0) @binding(1) var<storage, read_write> squares: array<u32>;
    @compute @workgroup_size(64)
    fn main(
        @builtin(workgroup_id) g: vec3u,
        @builtin(num_workgroups) n: vec3u,
        @builtin(local_invocation_index) l: u32,
    ) {
        let i = (g.x + g.y * n.x) * 64u + l;
        if (i < arrayLength(&numbers)) { squares[i] = numbers[i] * numbers[i] + squares[i]; }
    }";

#[test]
fn devices_are_listed_with_what_they_are() {
    match list() {
        Ok(all) => {
            assert!(!all.is_empty());
            for (i, listed) in all.iter().enumerate() {
                assert_eq!(listed.number, i);
                assert!(!listed.name.is_empty() && !listed.driver.is_empty(), "{listed:?}");
                assert!(listed.memory.is_none_or(|bytes| bytes > 1 << 20), "{listed:?}");
            }
            let missing = Device::open(&Choice::Number(all.len())).unwrap_err();
            assert!(matches!(missing, Error::NoSuchDevice { .. }), "{missing}");
        }
        Err(error) => assert_eq!(error, Error::NoVulkan),
    }
}

#[test]
fn dispatches_run_one_after_another() {
    let Some(device) = device() else { return };
    let numbers: Vec<u32> = (0..1000).collect();
    let kernel = kernel(&device, SQUARES).unwrap();
    let source = device.buffer("numbers", &numbers).unwrap();
    let squares = device.empty("squares", 4000).unwrap();
    let groups = device.buffer("groups", &[2u32, 8, 1]).unwrap();
    let mut work = device.work();
    for _ in 0..5 {
        work.run(&kernel, &[&source, &squares], Groups::Count(16)).unwrap();
        work.run(&kernel, &[&source, &squares], Groups::From(&groups)).unwrap();
        work.run(&kernel, &[&source, &squares], Groups::Count(0)).unwrap();
    }
    work.submit().unwrap();
    device.finish().unwrap();
    let expected: Vec<u32> = numbers.iter().map(|n| 10 * n * n).collect();
    assert_eq!(device.read::<u32>(&squares, 1000).unwrap(), expected);
}

#[test]
fn bindings_may_have_gaps() {
    let Some(device) = device() else { return };
    let source = "
        @group(0) @binding(0) var<storage, read> other: array<u32>;
        @group(0) @binding(3) var<storage, read> from_: array<u32>;
        @group(0) @binding(7) var<storage, read_write> to: array<u32>;
        @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) l: u32) { to[l] = from_[l] + 1u; }
        @compute @workgroup_size(1) fn others() { to[0] = other[0]; }";
    let kernel = kernel(&device, source).unwrap();
    let (from, to) = (
        device.buffer("from", &[1u32, 2, 3, 4]).unwrap(),
        device.empty("to", 16).unwrap(),
    );
    let mut work = device.work();
    work.run(&kernel, &[&from, &to], Groups::Count(1)).unwrap();
    work.submit().unwrap();
    assert_eq!(device.read::<u32>(&to, 4).unwrap(), [2, 3, 4, 5]);
}

#[test]
fn buffers_come_back_as_they_went() {
    let Some(device) = device() else { return };
    for length in [0, 1, 3, 4, 15, 16, 17, 1001] {
        let bytes: Vec<u8> = (0..length).map(|i| (i * 7) as u8).collect();
        let buffer = device.buffer("bytes", &bytes).unwrap();
        assert_eq!(device.read::<u8>(&buffer, length).unwrap(), bytes);
    }
}

#[test]
fn what_a_device_refuses_is_an_error() {
    let Some(device) = device() else { return };
    let name = device.listed().name.clone();
    let kernel = kernel(&device, SQUARES).unwrap();
    let buffer = device.buffer("numbers", &[1u32; 4]).unwrap();
    let error = device.work().run(&kernel, &[&buffer], Groups::Count(1)).err().unwrap();
    assert_eq!(
        error.to_string(),
        format!("{name} refused kernel \"test\": it was given 1 buffers, and wants numbers, squares")
    );
    // wgpu's own check: a buffer that is read and written at once.
    let both = || {
        let mut work = device.work();
        work.run(&kernel, &[&buffer, &buffer], Groups::Count(1))?;
        work.submit()
    };
    let message = both().unwrap_err().to_string();
    assert!(
        message.starts_with(&format!("{name} refused ")) && !message.contains('\n'),
        "{message}"
    );
    // The device still works.
    assert_eq!(device.read::<u32>(&buffer, 4).unwrap(), [1; 4]);
    let message = device.read::<u32>(&buffer, 5).unwrap_err().to_string();
    assert_eq!(
        message,
        format!("{name} refused reading numbers: it has 16 bytes, and not 20")
    );
    let message = device.empty("all there is", u64::MAX).err().unwrap().to_string();
    let expected = format!("{name} has no memory for all there is: it would have 18446744073709551615 bytes, and ");
    assert!(message.starts_with(&expected), "{message}");
}

#[test]
fn a_device_that_takes_too_long_is_an_error() {
    let Some(mut device) = device() else { return };
    let source = SQUARES.replace(
        "if (i <",
        "for (var k = 0u; k < 20000000u; k++) { squares[l] = squares[l] * 3u + k; } if (i <",
    );
    let kernel = kernel(&device, &source).unwrap();
    let (source, squares) = (device.empty("a", 256).unwrap(), device.empty("b", 256).unwrap());
    device.wait_at_most(Duration::from_millis(1));
    let mut work = device.work();
    work.run(&kernel, &[&source, &squares], Groups::Count(1)).unwrap();
    work.submit().unwrap();
    let error = device.finish().unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("{} did not finish within 0 s", device.listed().name)
    );
    device.wait_at_most(PATIENCE);
    device.finish().unwrap();
}

#[test]
fn a_device_that_is_lost_is_an_error() {
    let Some(device) = device() else { return };
    let buffer = device.buffer("numbers", &[1u32; 4]).unwrap();
    device.lose();
    let error = device.read::<u32>(&buffer, 4).unwrap_err();
    assert!(matches!(error, Error::Lost { .. }), "{error}");
    assert!(device.buffer("more", &[1u32; 4]).is_err());
}

/// Each dispatch is counted, and a thousand times the work takes longer.
#[test]
fn kernels_are_timed() {
    let Some(mut device) = device() else { return };
    if !device.time_kernels() {
        println!("not tried: the device has no clock");
        return;
    }
    let heavy = SQUARES.replace(
        "if (i <",
        "for (var k = 0u; k < 50000u; k++) { squares[l] = squares[l] * 3u + k; } if (i <",
    );
    let compile = |name: &str, source: &str| {
        let compiled = spirv::check(name, source)
            .unwrap()
            .compile("main", device.controls())
            .unwrap();
        Kernel::from(device.kernel(name, &compiled, "main").unwrap())
    };
    let (light, heavy) = (compile("light", SQUARES), compile("heavy", &heavy));
    let (source, squares) = (device.empty("a", 256).unwrap(), device.empty("b", 256).unwrap());
    for _ in 0..2 {
        let mut work = device.work();
        for kernel in [&light, &heavy, &light] {
            work.run(kernel, &[&source, &squares], Groups::Count(1)).unwrap();
        }
        work.submit().unwrap();
    }
    let times = device.kernel_times();
    let told: Vec<_> = times.iter().map(|t| (t.kernel.as_str(), t.dispatches)).collect();
    assert_eq!(told, [("heavy", 2), ("light", 4)]);
    assert!(
        times[0].time > times[1].time && times[0].time < Duration::from_secs(60),
        "{times:?}"
    );
    assert!(device.kernel_times().is_empty());
}
