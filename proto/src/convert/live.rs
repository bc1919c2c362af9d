//! Conversions for live.proto.

use super::{WireError, require};
use crate::domain::FileHash;
use crate::revision::{Revision, RevisionNumber, Task, TaskNumber, Work};
use crate::wire;
use beamfarm_image::job::MAX_PASSES;

/// The most pixels along a side.
const MAX_SIDE: u32 = 32768;

impl From<&Revision> for wire::Revision {
    fn from(revision: &Revision) -> Self {
        Self {
            number: revision.number.0,
            manifest: Some((&revision.manifest).into()),
            text: revision.text.clone(),
        }
    }
}

impl TryFrom<wire::Revision> for Revision {
    type Error = WireError;
    fn try_from(revision: wire::Revision) -> Result<Self, WireError> {
        let manifest: crate::Manifest = require(revision.manifest, "revision.manifest")?.try_into()?;
        let entry = manifest.files.iter().find(|file| file.path == manifest.scene);
        if entry.is_none_or(|file| file.hash != FileHash::of(&revision.text)) {
            return Err(WireError::new("revision.text", "is not what the manifest says"));
        }
        Ok(Self {
            number: RevisionNumber(revision.number),
            manifest,
            text: revision.text,
        })
    }
}

impl From<Task> for wire::Task {
    fn from(task: Task) -> Self {
        use wire::task::What;
        let what = match task.work {
            Work::Sketch {
                settings,
                index,
                origin: [origin_x, origin_y, origin_z],
            } => What::Sketch(wire::Sketch {
                settings: Some(settings.into()),
                index,
                origin_x,
                origin_y,
                origin_z,
            }),
            Work::Pass { settings, pass_index } => What::Pass(wire::Pass {
                settings: Some(settings.into()),
                pass_index,
            }),
        };
        Self {
            number: task.number.0,
            revision: task.revision.0,
            width: task.width,
            height: task.height,
            what: Some(what),
        }
    }
}

impl TryFrom<wire::Task> for Task {
    type Error = WireError;
    fn try_from(task: wire::Task) -> Result<Self, WireError> {
        use wire::task::What;
        let index = |index: u64| match index < MAX_PASSES {
            true => Ok(index),
            false => Err(WireError::new("task.index", format!("expected less than {MAX_PASSES}"))),
        };
        let work = match require(task.what, "task.what")? {
            What::Sketch(sketch) => {
                let origin = [sketch.origin_x, sketch.origin_y, sketch.origin_z];
                if !origin.iter().all(|x| x.is_finite()) {
                    return Err(WireError::new("task.origin", "is not finite"));
                }
                Work::Sketch {
                    settings: require(sketch.settings, "task.settings")?.try_into()?,
                    index: index(sketch.index)?,
                    origin,
                }
            }
            What::Pass(pass) => Work::Pass {
                settings: require(pass.settings, "task.settings")?.try_into()?,
                pass_index: index(pass.pass_index)?,
            },
        };
        for side in [task.width, task.height] {
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(WireError::new(
                    "task.size",
                    format!("expected 1 to {MAX_SIDE} pixels, found {side}"),
                ));
            }
        }
        Ok(Self {
            number: TaskNumber(task.number),
            revision: RevisionNumber(task.revision),
            width: task.width,
            height: task.height,
            work,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::settings;
    use super::*;
    use crate::domain::{FileEntry, Manifest};

    fn task(work: Work) -> Task {
        Task {
            number: TaskNumber(3),
            revision: RevisionNumber(2),
            width: 40,
            height: 30,
            work,
        }
    }

    #[test]
    fn tasks_survive_the_wire_and_impossible_ones_are_refused() {
        let settings = settings();
        let sketch = |origin| {
            task(Work::Sketch {
                settings,
                index: 5,
                origin,
            })
        };
        let pass = |pass_index| task(Work::Pass { settings, pass_index });
        for task in [sketch([1.0, -2.5, 1e6]), pass(7)] {
            assert_eq!(Task::try_from(wire::Task::from(task)), Ok(task));
        }
        let empty = Task { width: 0, ..pass(1) };
        let large = Task {
            height: MAX_SIDE + 1,
            ..pass(1)
        };
        for wrong in [sketch([f64::NAN, 0.0, 0.0]), pass(MAX_PASSES), empty, large] {
            assert!(Task::try_from(wire::Task::from(wrong)).is_err(), "{wrong:?}");
        }
        assert!(Task::try_from(wire::Task::default()).is_err());
    }

    #[test]
    fn a_revision_is_its_text() {
        let text: &[u8] = b"width = 3";
        let file = FileEntry {
            path: "scene.toml".into(),
            hash: FileHash::of(text),
            size: text.len() as u64,
        };
        let revision = Revision {
            number: RevisionNumber(9),
            manifest: Manifest {
                scene: "scene.toml".into(),
                files: vec![file],
            },
            text: text.into(),
        };
        assert_eq!(
            Revision::try_from(wire::Revision::from(&revision)),
            Ok(revision.clone())
        );
        let mut other = wire::Revision::from(&revision);
        other.text = (&b"width = 4"[..]).into();
        assert!(Revision::try_from(other).is_err());
    }
}
