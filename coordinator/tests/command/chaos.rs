//! Rounds of misfortune with real processes only: a coordinator with a job directory and two workers are killed,
//! stopped and started again, and the image has the bits of an undisturbed run.
//!
//! `BEAMFARM_CHAOS_ROUNDS=100` makes it a long test; `BEAMFARM_CHAOS_SEED=17` repeats the round of that number.

use crate::setup::{LONG, Process, beamfarm, folder_with, line, random, scene, spawn, succeed};
use std::fs::File;
use std::path::Path;
use std::process::Stdio;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

const ACTS: u64 = 16;
const WORKERS: usize = 2;

struct Dice(u64);

impl Dice {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = random(self.0);
        self.0 % n
    }
}

struct Stage<'a> {
    folder: &'a Path,
    address: String,
    coordinator: Process,
    /// The output of all processes.
    said: Vec<String>,
    workers: Vec<Process>,
}

fn start_coordinator(folder: &Path, address: &str, passes: u64) -> Process {
    let mut command = beamfarm(folder, &["serve", "scene.toml", "--job", "a.job", "--quiet"]);
    command.args(["--listen", address, "--passes", &passes.to_string()]);
    command.args(["--log", "beamfarm_coordinator=debug,warn"]);
    command.stdout(Stdio::null());
    spawn(command)
}

fn start_worker(folder: &Path, address: &str, i: usize) -> Process {
    let name = format!("worker-{i}");
    let url = format!("http://{address}");
    let mut command = beamfarm(folder, &["worker", "--connect", &url, "--threads", "1"]);
    command.args(["--name", &name, "--log", "info"]);
    let log = File::options()
        .create(true)
        .append(true)
        .open(folder.join(name + ".log"));
    command.stdout(Stdio::null()).stderr(log.unwrap());
    spawn(command)
}

impl<'a> Stage<'a> {
    fn start(folder: &'a Path) -> Self {
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = port.local_addr().unwrap().to_string();
        drop(port);
        let coordinator = start_coordinator(folder, &address, 1_000_000);
        let workers = (0..WORKERS).map(|i| start_worker(folder, &address, i));
        Self {
            workers: workers.collect(),
            folder,
            address,
            coordinator,
            said: Vec::new(),
        }
    }

    /// The next line of the coordinator's log; `None` when it has ended.
    fn hear(&mut self) -> Option<&str> {
        match self.coordinator.log.next(Instant::now() + LONG) {
            Ok(line) => {
                self.said.push(line.trim_end().to_owned());
                self.said.last().map(String::as_str)
            }
            Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) => panic!("nothing happens: {}", self.tale()),
        }
    }

    /// The last output.
    fn tale(&self) -> String {
        let mut tale = self.said[self.said.len().saturating_sub(60)..].join("\n");
        for i in 0..WORKERS {
            let log = std::fs::read_to_string(self.folder.join(format!("worker-{i}.log")));
            tale += &format!("\nworker {i}:\n{}", log.unwrap_or_default());
        }
        tale
    }

    /// Waits for this many events.
    fn wait(&mut self, things: u64) {
        for _ in 0..things {
            if self.hear().is_none() {
                panic!("the coordinator has ended: {}", self.tale());
            }
        }
    }

    /// Waits until a checkpoint is being written, for a limited time.
    fn wait_for_checkpoint(&mut self) {
        let job = self.folder.join("a.job");
        let parts = [0, 1].map(|i| job.join(format!("checkpoint-{i}.part")));
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(3) && !parts.iter().any(|part| part.exists()) {
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// As when the machine loses power.
    fn kill_coordinator(&mut self) {
        let is_running = self.coordinator.is_running();
        self.coordinator.kill();
        while self.hear().is_some() {}
        assert!(is_running, "the coordinator has ended: {}", self.tale());
    }

    fn start_coordinator(&mut self, passes: u64) {
        self.coordinator = start_coordinator(self.folder, &self.address, passes);
    }

    fn restart_coordinator(&mut self) {
        self.kill_coordinator();
        self.start_coordinator(1_000_000);
    }

    fn replace_worker(&mut self, i: usize) {
        let is_running = self.workers[i].is_running();
        assert!(is_running, "worker {i} has ended: {}", self.tale());
        self.workers[i].kill();
        self.workers[i] = start_worker(self.folder, &self.address, i);
    }

    fn act(&mut self, dice: &mut Dice) {
        let things = dice.below(16);
        self.wait(things);
        let i = dice.below(WORKERS as u64) as usize;
        match dice.below(10) {
            0 | 1 => self.restart_coordinator(),
            2..=4 => {
                self.wait_for_checkpoint();
                self.restart_coordinator();
            }
            5 => self.replace_worker(i),
            6 => {
                self.workers[i].signal("-STOP");
                let things = 1 + dice.below(8);
                self.wait(things);
                self.workers[i].signal("-CONT");
            }
            7 => {
                self.workers[i].signal("-STOP");
                self.restart_coordinator();
                self.wait(1);
                self.workers[i].signal("-CONT");
            }
            8 => {
                self.coordinator.signal("-STOP");
                self.replace_worker(i);
                self.coordinator.signal("-CONT");
            }
            _ => {
                self.kill_coordinator();
                self.replace_worker(i);
                self.start_coordinator(1_000_000);
            }
        }
    }

    /// The first pass that nobody has been given.
    fn untouched(&self) -> u64 {
        let leased = self.said.iter().filter_map(|line| {
            let (_, lease) = line.split_once(" leased worker=")?;
            let (block, _) = lease.split_once(" lease=")?;
            let last = block.rsplit([' ', '.']).next()?;
            last.parse::<u64>().ok()
        });
        leased.max().map_or(0, |pass| pass + 1)
    }

    /// Ends the job soon and regularly; returns how many passes it has.
    fn finish(mut self) -> u64 {
        self.wait(20);
        self.kill_coordinator();
        let passes = self.untouched() + 10;
        self.start_coordinator(passes);
        while self.hear().is_some() {}
        let status = self.coordinator.wait();
        assert!(status.success(), "{status}: {}", self.tale());
        // They are told of the end.
        let until = Instant::now() + LONG;
        for i in 0..WORKERS {
            let Some(status) = self.workers[i].ends(until) else {
                panic!("worker {i} stays: {}", self.tale());
            };
            assert!(status.success(), "worker {i}: {status}: {}", self.tale());
        }
        let differs = |line: &&String| line.contains("different pixels");
        assert_eq!(self.said.iter().find(differs), None);
        passes
    }
}

fn round(seed: u64) {
    let folder = folder_with(&scene([48, 32], 1, 20_000));
    let path = folder.path();
    let mut stage = Stage::start(path);
    let mut dice = Dice(seed);
    for _ in 0..ACTS {
        stage.act(&mut dice);
    }
    let passes = stage.finish();
    let report = std::fs::read(path.join("a.job/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["prefix"], passes, "round {seed}");
    assert_eq!(report["stopped"], "complete", "round {seed}");
    let args = ["render", "scene.toml", "--passes", &passes.to_string()];
    let undisturbed = succeed(path, &[&args[..], &["-o", "whole.exr"]].concat());
    let pixels = report["pixels"].as_str().unwrap();
    assert_eq!(line(&undisturbed, "pixels"), format!("pixels {pixels}"), "round {seed}");
}

#[test]
fn processes_that_die_at_any_time_make_the_same_picture() {
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let rounds = match number("BEAMFARM_CHAOS_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("BEAMFARM_CHAOS_ROUNDS").unwrap_or(1),
    };
    rounds.for_each(round);
}
