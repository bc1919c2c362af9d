//! ledger.jsonl: one line for each event of a block. Each line has a checksum, so that no worker is accused because of
//! a damaged line.

use super::StoreError;
use crate::farm::{DoneBlock, Entry, EntryState};
use crate::ledger::Who;
use beamfarm_image::input;
use beamfarm_image::job::Block;
use beamfarm_proto::VERSION;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;
use tracing::warn;

/// The most bytes that wait for a failing disk. Beyond it lines are lost, but not the job.
const WAITING: usize = 4 << 20;
/// Bytes of lines after which they are synced to the disk.
const UNSYNCED: usize = 1 << 20;
/// The longest line that is read, in bytes.
const MAX_LINE: u64 = 1 << 16;
/// The most damaged lines that are listed in the log.
const NAMED: usize = 3;
/// Text around the checksum: the first digits of the BLAKE3 of everything before it.
const CHECK: [&[u8]; 2] = [b",\"check\":\"", b"\"}"];
const CHECK_DIGITS: usize = 16;

#[derive(Serialize, Deserialize)]
struct Line {
    block: (u32, u64),
    state: String,
    worker: String,
    /// Fingerprint of the worker's key. Missing in jobs from before keys existed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    key: Option<String>,
    radius_scale: f64,
    seed: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hash: Option<String>,
    seconds: f64,
    build: String,
    /// Seconds since 1970.
    time: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

/// The ledger file, open for appending.
pub(super) struct Lines {
    path: PathBuf,
    file: File,
    /// Bytes of lines that are synced to the disk.
    synced: u64,
    /// Later lines. They are kept until they are synced: a disk that disappeared may come back without them.
    behind: Vec<u8>,
    /// Bytes of these that were written.
    written: usize,
    /// What was written may be lost; the file must be opened again.
    is_doubtful: bool,
    seed: u64,
    lost: u64,
}

impl Lines {
    /// Open or create the file, and cut off a last line that was torn when the coordinator died.
    pub fn open(path: &Path, seed: u64) -> Result<Self, StoreError> {
        let file = open(path, true).map_err(StoreError::io(path))?;
        let mut lines = Self {
            path: path.to_owned(),
            file,
            synced: 0,
            behind: Vec::new(),
            written: 0,
            is_doubtful: false,
            seed,
            lost: 0,
        };
        lines.cut().map_err(StoreError::io(path))?;
        Ok(lines)
    }

    fn cut(&mut self) -> io::Result<()> {
        let size = self.file.seek(SeekFrom::End(0))?;
        let mut end = size;
        let mut buffer = [0; 4096];
        // Search backwards for the last end of a line.
        while end > 0 {
            let start = end.saturating_sub(buffer.len() as u64);
            let part = &mut buffer[..(end - start) as usize];
            self.file.seek(SeekFrom::Start(start))?;
            self.file.read_exact(part)?;
            if let Some(at) = part.iter().rposition(|byte| *byte == b'\n') {
                end = start + at as u64 + 1;
                break;
            }
            end = start;
        }
        if end < size {
            warn!(
                "{}: the last {} bytes are half a line and are cut off",
                self.path.display(),
                size - end
            );
            self.file.set_len(end)?;
        }
        self.synced = end;
        Ok(())
    }

    /// Add a line in memory.
    pub fn push(&mut self, entry: &Entry) {
        let line = Line {
            block: (entry.block.level, entry.block.index),
            state: entry.state.as_str().into(),
            worker: entry.worker.name.clone(),
            key: entry.worker.key.map(|key| key.to_string()),
            radius_scale: entry.radius_scale,
            seed: self.seed,
            hash: entry.hash.map(|hash| blake3::Hash::from_bytes(hash).to_string()),
            seconds: entry.took.as_secs_f64(),
            build: VERSION.into(),
            time: entry
                .time
                .duration_since(UNIX_EPOCH)
                .map_or(0.0, |time| time.as_secs_f64()),
            message: entry.message.clone(),
        };
        if self.behind.len() > WAITING {
            self.lost += 1;
            return;
        }
        // Cannot fail: the line has no maps with non-string keys, and writes to memory succeed.
        if let Ok(mut json) = serde_json::to_vec(&line) {
            json.pop();
            let check = check(&json);
            let parts = [&json, CHECK[0], &check, CHECK[1], b"\n"];
            parts.iter().for_each(|part| self.behind.extend_from_slice(part));
        }
    }

    /// Write the lines in memory to the file. After an error they stay in memory, and the file ends with a whole line.
    pub fn append(&mut self) -> io::Result<()> {
        if self.written == self.behind.len() && !self.is_doubtful {
            return Ok(());
        }
        if self.is_doubtful {
            self.open_again()?;
        }
        let mut write = || {
            self.file.seek(SeekFrom::Start(self.synced + self.written as u64))?;
            self.file.write_all(&self.behind[self.written..])
        };
        if let Err(error) = write() {
            self.is_doubtful = true;
            // If this fails too, the next write goes to the same position.
            let _ = self.file.set_len(self.synced + self.written as u64);
            return Err(error);
        }
        self.written = self.behind.len();
        if self.lost > 0 {
            warn!(
                "{}: {} lines were lost while the disk did not take them",
                self.path.display(),
                self.lost
            );
            self.lost = 0;
        }
        match self.written > UNSYNCED {
            true => self.sync_written(),
            false => Ok(()),
        }
    }

    /// A file system may come back under the same path after an outage, but handles opened before stay dead.
    fn open_again(&mut self) -> io::Result<()> {
        let file = open(&self.path, false)?;
        let size = file.metadata()?.len();
        if size < self.synced {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                format!("{size} bytes, less than the {} that were written", self.synced),
            ));
        }
        self.file = file;
        // Lines that are already there do no harm: they are written again to the same position.
        self.written = 0;
        self.is_doubtful = false;
        Ok(())
    }

    /// Append and wait until the lines are on the disk.
    pub fn sync(&mut self) -> io::Result<()> {
        self.append()?;
        self.sync_written()
    }

    fn sync_written(&mut self) -> io::Result<()> {
        if let Err(error) = self.file.sync_data() {
            // A repeated sync may succeed although data was lost.
            self.is_doubtful = true;
            return Err(error);
        }
        self.behind.drain(..self.written);
        self.synced += self.written as u64;
        self.written = 0;
        Ok(())
    }

    /// Bytes of all lines, including those in memory.
    pub fn end(&self) -> u64 {
        self.synced + self.behind.len() as u64
    }

    /// Blocks that count, by their last lines, in pass order. Where runs of the job found different pixels and nobody
    /// has decided which are right, the older ones follow at the end. Damaged lines are left out and listed in the log.
    pub fn done(&self) -> io::Result<Vec<DoneBlock>> {
        // By first pass. Disjoint: of overlapping blocks, which come from different runs of the job, the last counts.
        let mut done: BTreeMap<u64, DoneBlock> = BTreeMap::new();
        let mut contested: Vec<DoneBlock> = Vec::new();
        let damaged = self.each(0, |line, block, is_whole| {
            let hash = line.hash.and_then(|hash| blake3::Hash::from_hex(hash).ok());
            if line.state == EntryState::Dropped.as_str() {
                take_out(&mut done, block);
                contested.retain(|known| known.block != block);
            } else if !is_whole {
                // Reported below.
            } else if line.state == EntryState::Audited.as_str() {
                let known = done.get_mut(&block.start());
                if let Some(known) = known.filter(|known| known.block == block) {
                    known.audited = true;
                    contested.retain(|known| known.block != block);
                }
            } else if line.state == EntryState::Done.as_str()
                && let Some(hash) = hash
            {
                let new = DoneBlock {
                    block,
                    hash: *hash.as_bytes(),
                    worker: who(line.worker, line.key),
                    audited: false,
                };
                let before = done.get(&block.start());
                let before = before.filter(|b| b.block == block && b.hash != new.hash);
                contested.extend(before.cloned());
                take_out(&mut done, block);
                done.insert(block.start(), new);
            }
        })?;
        for line in damaged.iter().take(NAMED) {
            let path = self.path.display();
            warn!("{path}: line {line} is damaged: nothing that it says is believed");
        }
        if damaged.len() > NAMED {
            warn!("{}: {} lines are damaged in all", self.path.display(), damaged.len());
        }
        Ok(done.into_values().chain(contested).collect())
    }

    /// Workers that were shut out for wrong pixels, each once.
    pub fn convicted(&self) -> io::Result<Vec<Who>> {
        let mut workers: Vec<Who> = Vec::new();
        self.each(0, |line, _, is_whole| {
            if is_whole && line.state == EntryState::ShutOut.as_str() {
                let who = who(line.worker, line.key);
                if !workers.contains(&who) {
                    workers.push(who);
                }
            }
        })?;
        Ok(workers)
    }

    /// Blocks dropped according to the lines from byte `from` on. Lines with a wrong or missing checksum are believed
    /// as well: that costs passes that are rendered again, but lets no wrong one come back.
    pub fn dropped(&self, from: u64) -> io::Result<Vec<Block>> {
        let mut dropped = Vec::new();
        self.each(from, |line, block, _| {
            if line.state == EntryState::Dropped.as_str() {
                dropped.push(block);
            }
        })?;
        Ok(dropped)
    }

    /// Call `tell` for each line from byte `from` on that can be parsed, with whether its checksum is right. Returns
    /// the numbers, from 1, of damaged lines.
    fn each(&self, from: u64, mut tell: impl FnMut(Line, Block, bool)) -> io::Result<Vec<u64>> {
        let mut damaged = Vec::new();
        let mut number = 0;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(from))?;
        let mut reader = BufReader::new(file);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let mut line = reader.by_ref().take(MAX_LINE);
            if line.read_until(b'\n', &mut bytes)? == 0 {
                return Ok(damaged);
            }
            number += 1;
            let text = bytes.trim_ascii_end();
            let is_whole = is_whole(text);
            if !is_whole {
                damaged.push(number);
            }
            if let Ok(line) = serde_json::from_slice::<Line>(text)
                && let Some(block) = Block::new(line.block.0, line.block.1)
            {
                tell(line, block, is_whole);
            }
        }
    }
}

fn open(path: &Path, create: bool) -> io::Result<File> {
    let mut options = File::options();
    options.read(true).write(true).create(create).truncate(false);
    input::open_as(path, &mut options, false)
}

fn who(name: String, key: Option<String>) -> Who {
    let key = key.and_then(|key| key.parse().ok());
    Who { name, key }
}

fn check(json: &[u8]) -> Vec<u8> {
    blake3::hash(json).to_hex().as_bytes()[..CHECK_DIGITS].to_vec()
}

/// Whether the line's checksum is right.
fn is_whole(line: &[u8]) -> bool {
    let [before, behind] = CHECK;
    let json = || {
        let rest = line.strip_suffix(behind)?;
        let (rest, digits) = rest.split_at_checked(rest.len().checked_sub(CHECK_DIGITS)?)?;
        Some((rest.strip_suffix(before)?, digits))
    };
    json().is_some_and(|(json, digits)| digits == check(json))
}

fn take_out(done: &mut BTreeMap<u64, DoneBlock>, block: Block) {
    let passes = block.passes();
    let before = done.range(..passes.start).next_back();
    let before = before.filter(|(_, known)| known.block.passes().end > passes.start);
    let starts: Vec<u64> = before
        .into_iter()
        .chain(done.range(passes))
        .map(|(start, _)| *start)
        .collect();
    for start in starts {
        done.remove(&start);
    }
}

#[cfg(test)]
mod tests;
