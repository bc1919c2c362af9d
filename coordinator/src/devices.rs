//! `beamfarm devices`: the devices for `--engine gpu`.

use crate::failure::Failure;
use crate::output::print_text;
use beamfarm_worker::engine::{self, Found, Test};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use indicatif::BinaryBytes;

pub const MEANING: &str = "\
Examples:
  beamfarm devices
  beamfarm render scene.toml --engine gpu --gpu 1     by number, or by a part of the name

Each device is tested, as it is before its first pass: some hundred thousand operations must give the bits that a
processor computes. Where a device's own division or roots are not exact, kernels emulate them, which takes longer and
gives the same bits. The exit code is 1 where no device can be used.";

pub fn main() -> Result<(), Failure> {
    let all = engine::devices()?;
    print_text(&table(&all))?;
    match all.iter().any(|device| device.test.is_ok()) {
        true => Ok(()),
        false => Err(Failure::io("none of these devices can be used")),
    }
}

/// One line per device, under a heading.
fn table(all: &[Found]) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["", "device", "kind", "memory", "driver", "test"]);
    for device in all {
        table.add_row([
            device.number.to_string(),
            device.name.clone(),
            device.kind.clone(),
            device
                .memory
                .map_or_else(|| "unknown".into(), |bytes| BinaryBytes(bytes).to_string()),
            device.driver.clone(),
            match &device.test {
                Ok(test) => passed(test),
                Err(why) => why.clone(),
            },
        ]);
    }
    for number in [0, 3] {
        if let Some(column) = table.column_mut(number) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    format!("{}\n", table.trim_fmt())
}

fn passed(test: &Test) -> String {
    let whose = |is_native| if is_native { "native" } else { "emulated" };
    let (division, roots) = (whose(test.native_division), whose(test.native_roots));
    let seconds = test.time.as_secs_f64();
    format!("passed in {seconds:.1} s: division {division}, roots {roots}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn each_device_has_a_line_with_its_test_or_what_it_lacks() {
        let device = |number, name: &str, memory, test| Found {
            number,
            name: name.into(),
            kind: "discrete".into(),
            driver: "driver 1.2".into(),
            memory,
            test,
        };
        let test = Test {
            native_division: true,
            native_roots: false,
            time: Duration::from_millis(1234),
        };
        let text = table(&[
            device(0, "Card", Some(3 << 29), Ok(test)),
            device(1, "Old Card", None, Err("lacks Vulkan 1.2".into())),
        ]);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(lines[0], ["device", "kind", "memory", "driver", "test"]);
        let first = "0 Card discrete 1.50 GiB driver 1.2 passed in 1.2 s: division native, roots emulated";
        assert_eq!(lines[1].join(" "), first);
        assert_eq!(
            lines[2].join(" "),
            "1 Old Card discrete unknown driver 1.2 lacks Vulkan 1.2"
        );
    }
}
