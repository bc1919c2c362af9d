//! A directory merged from others that hold parts of a job.

use super::folder::{self, Folder, LEDGER, SCENE};
use super::{Checkpoint, Description, StoreError};
use beamfarm_image::bundle::MAX_BYTES;
use beamfarm_image::input;
use beamfarm_proto::FileHash;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

impl Folder {
    /// Create a directory for the job that these directories hold parts of. Its passes start at 0 and are those of the
    /// checkpoint, which other coordinators may continue; its ledger file joins the lines of the parts.
    pub fn join(
        path: &Path,
        parts: &[PathBuf],
        mut description: Description,
        mut checkpoint: Checkpoint,
    ) -> Result<(), StoreError> {
        let (Some(first), true) = (parts.first(), !path.join(folder::JOB).exists()) else {
            return Err(StoreError::Exists(path.to_owned()));
        };
        fs::create_dir_all(path).map_err(StoreError::io(path))?;
        folder::refuse_foreign(path)?;
        let lock = folder::lock(path)?;
        folder::sync_parent(path)?;
        let scene = path.join(SCENE);
        fs::create_dir_all(&scene).map_err(StoreError::io(&scene))?;
        for file in &description.files {
            let from = first.join(SCENE).join(&file.hash);
            let bytes = input::read(&from, MAX_BYTES).map_err(StoreError::io(&from))?;
            if FileHash::of(&bytes).to_string() != file.hash {
                let damaged = io::Error::new(io::ErrorKind::InvalidData, "its checksum is wrong");
                return Err(StoreError::io(&from)(damaged));
            }
            folder::write_whole(&scene.join(&file.hash), &bytes)?;
        }
        let mut lines = Vec::new();
        for part in parts {
            let from = part.join(LEDGER);
            let read = input::read(&from, MAX_BYTES).map_err(StoreError::io(&from))?;
            // Whole lines: torn ones were cut off when the part was opened.
            lines.extend(read);
        }
        folder::write_whole(&path.join(LEDGER), &lines)?;
        checkpoint.ledger = lines.len() as u64;
        drop(lines);
        description.first_pass = 0;
        description.passes = Some(checkpoint.sum.prefix());
        let (mut folder, _) = Self::with(path, description, lock)?;
        folder.save(&mut checkpoint)?;
        // Last: a directory with a job.json is complete.
        folder.write_description()
    }
}
