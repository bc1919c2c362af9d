//! What to measure: from a TOML file or the command line.

use super::overrides::Overrides;
use super::run::Integrator;
use crate::failure::Failure;
use beamfarm_image::input;
use beamfarm_image::job::{EngineKind, MAX_PASSES};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Scenes, each with a reference and other renderers' results, and the configurations that render them.
#[derive(Clone, Debug)]
pub struct Suite {
    pub title: String,
    pub scenes: Vec<SceneCase>,
    pub runs: Vec<RunCase>,
    /// Seconds after which runs end, and at which errors are reported.
    pub seconds: Option<f64>,
}

#[derive(Clone, Debug)]
pub struct SceneCase {
    pub name: String,
    pub path: PathBuf,
    pub reference: Option<PathBuf>,
    /// relMSE of the reference's own noise, if its file does not contain it.
    pub reference_noise: Option<f64>,
    pub passes: Option<u64>,
    /// Left and top pixels of the crops to show.
    pub crops: Vec<[u32; 2]>,
    pub peers: Vec<Peer>,
}

/// Another renderer.
#[derive(Clone, Debug, PartialEq)]
pub struct Peer {
    pub name: String,
    pub points: Vec<Point>,
    pub image: Option<PeerImage>,
}

/// An error reached in a given time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    pub wall_seconds: f64,
    pub core_seconds: Option<f64>,
    pub rel_mse: f64,
}

/// An image whose error is measured here.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerImage {
    pub path: PathBuf,
    pub wall_seconds: f64,
    pub core_seconds: Option<f64>,
}

/// A configuration.
#[derive(Clone, Debug)]
pub struct RunCase {
    pub name: String,
    /// Names of the scenes that it renders; all if empty.
    pub scenes: Vec<String>,
    pub passes: Option<u64>,
    pub integrator: Integrator,
    pub overrides: Overrides,
}

impl RunCase {
    pub fn renders(&self, scene: &str) -> bool {
        self.scenes.is_empty() || self.scenes.iter().any(|name| name == scene)
    }
}

/// What a scene's run is compared with.
#[derive(Clone, Debug)]
pub enum Against {
    /// Another renderer.
    Peer(Peer),
    /// Another engine.
    Engine(EngineKind),
}

/// `--against`: an engine, or NAME=OTHER.exr,seconds[,core-seconds]. Without NAME the file's name is used.
pub fn against(text: &str) -> Result<Against, String> {
    match text.parse() {
        Ok(engine) => Ok(Against::Engine(engine)),
        Err(_) => peer(text).map(Against::Peer),
    }
}

fn peer(text: &str) -> Result<Peer, String> {
    const EXPECTED: &str = "expected cpu, gpu or [NAME=]OTHER.exr,SECONDS[,CORE-SECONDS]";
    let mut fields: Vec<&str> = text.split(',').collect();
    let mut times = Vec::new();
    // From the right, as file names may contain commas.
    while let (true, Some(Ok(time))) = (
        fields.len() > 1 && times.len() < 2,
        fields.last().map(|field| field.trim().parse::<f64>()),
    ) {
        times.insert(0, time);
        fields.pop();
    }
    let (file, (wall_seconds, core_seconds)) = match times[..] {
        [wall] => (fields.join(","), (wall, None)),
        [wall, cores] => (fields.join(","), (wall, Some(cores))),
        _ => return Err(EXPECTED.into()),
    };
    if !times.iter().all(|time| *time > 0.0 && time.is_finite()) {
        return Err(format!("{EXPECTED}, with times above zero"));
    }
    let (name, path) = match file.split_once('=') {
        Some((name, path)) => (name.to_owned(), PathBuf::from(path)),
        None => {
            let stem = Path::new(&file).file_stem().unwrap_or_default();
            (stem.to_string_lossy().into_owned(), PathBuf::from(&file))
        }
    };
    if name.is_empty() || path.as_os_str().is_empty() {
        return Err(EXPECTED.into());
    }
    Ok(Peer {
        name,
        points: Vec::new(),
        image: Some(PeerImage {
            path,
            wall_seconds,
            core_seconds,
        }),
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SuiteFile {
    #[serde(default)]
    title: String,
    seconds: Option<f64>,
    scenes: Vec<SceneEntry>,
    #[serde(default)]
    runs: Vec<RunEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneEntry {
    name: Option<String>,
    scene: PathBuf,
    reference: Option<PathBuf>,
    reference_noise: Option<f64>,
    passes: Option<u64>,
    #[serde(default)]
    crops: Vec<[u32; 2]>,
    #[serde(default)]
    peers: Vec<PeerEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PeerEntry {
    name: String,
    #[serde(default)]
    points: Vec<Vec<f64>>,
    image: Option<PathBuf>,
    seconds: Option<f64>,
    core_seconds: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RunEntry {
    name: String,
    #[serde(default)]
    scenes: Vec<String>,
    passes: Option<u64>,
    #[serde(default)]
    integrator: Integrator,
    #[serde(default)]
    overrides: Overrides,
}

/// The largest suite file, in bytes.
const MOST_BYTES: u64 = 16 << 20;

impl Suite {
    /// Read a suite file. Paths in it are relative to it.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let failure = |message: String| Failure::usage(format!("{}: {message}", path.display()));
        let bytes = input::read_given(path, MOST_BYTES).map_err(|error| failure(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|error| failure(error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let file: SuiteFile = toml::from_str(&text).map_err(|error| {
            let line = error.span().map(|span| {
                let before = text.as_bytes().get(..span.start).unwrap_or_default();
                1 + before.iter().filter(|byte| **byte == b'\n').count()
            });
            let line = line.map_or_else(String::new, |line| format!("{line}: "));
            Failure::usage(format!("{}:{line} {}", path.display(), error.message()))
        })?;
        Self::resolve(file, folder, &stem).map_err(|message| Failure::usage(format!("{}: {message}", path.display())))
    }

    fn resolve(file: SuiteFile, folder: &Path, stem: &str) -> Result<Self, String> {
        let scenes = file.scenes.into_iter().map(|entry| entry.resolve(folder));
        let scenes = scenes.collect::<Result<Vec<_>, _>>()?;
        let mut runs = Vec::new();
        for run in file.runs {
            let unknown = |name: &&String| !scenes.iter().any(|scene| scene.name == **name);
            if let Some(name) = run.scenes.iter().find(unknown) {
                return Err(format!("run `{}`: there is no scene `{name}`", run.name));
            }
            runs.push(RunCase {
                name: run.name,
                scenes: run.scenes,
                passes: checked_passes(run.passes)?,
                integrator: run.integrator,
                overrides: run.overrides,
            });
        }
        if runs.is_empty() {
            runs.push(RunCase::default());
        }
        let title = match file.title.is_empty() {
            true => stem.to_owned(),
            false => file.title,
        };
        let suite = Self {
            title,
            scenes,
            runs,
            seconds: file.seconds,
        };
        suite.check()?;
        Ok(suite)
    }

    /// A suite from the command line: scenes, and references in the same order or none.
    pub fn plain(
        scenes: &[PathBuf],
        references: &[PathBuf],
        noise: Option<f64>,
        peers: &[Peer],
    ) -> Result<Self, String> {
        if !references.is_empty() && references.len() != scenes.len() {
            return Err(format!(
                "{} scenes and {} references; expected one --reference for each scene, in the same order",
                scenes.len(),
                references.len()
            ));
        }
        if scenes.len() != 1 && !peers.is_empty() {
            return Err("--against: expected one scene; describe several in a file for --suite".into());
        }
        let cases = scenes.iter().enumerate().map(|(i, path)| SceneCase {
            name: stem(path),
            path: path.clone(),
            reference: references.get(i).cloned(),
            reference_noise: noise,
            passes: None,
            crops: Vec::new(),
            peers: peers.to_vec(),
        });
        let suite = Self {
            title: scenes.iter().map(|path| stem(path)).collect::<Vec<_>>().join(", "),
            scenes: cases.collect(),
            runs: vec![RunCase::default()],
            seconds: None,
        };
        suite.check()?;
        Ok(suite)
    }

    /// Have each of these engines render all scenes.
    pub fn by_engines(&mut self, engines: &[EngineKind]) {
        let run = |engine: &EngineKind| RunCase {
            name: engine.to_string(),
            overrides: Overrides {
                engine: Some(*engine),
                ..Overrides::default()
            },
            ..RunCase::default()
        };
        self.runs = engines.iter().map(run).collect();
    }

    /// Override passes, seconds and settings from the command line.
    pub fn set(&mut self, passes: Option<u64>, seconds: Option<f64>, overrides: &Overrides) {
        self.seconds = seconds.or(self.seconds);
        for run in &mut self.runs {
            run.passes = passes.or(run.passes);
            run.overrides = overrides.or(&run.overrides);
        }
    }

    pub fn check(&self) -> Result<(), String> {
        if self.scenes.is_empty() {
            return Err("expected at least one scene".into());
        }
        if let Some(seconds) = self.seconds
            && !(seconds > 0.0 && seconds.is_finite())
        {
            return Err(format!("seconds is {seconds}; expected a time above zero"));
        }
        unique("scenes", self.scenes.iter().map(|scene| scene.name.as_str()))?;
        for scene in &self.scenes {
            let runs = self.runs.iter().filter(|run| run.renders(&scene.name));
            let peers = scene.peers.iter().map(|peer| peer.name.as_str());
            let names = runs.map(|run| run.name.as_str()).chain(peers);
            unique("runs and other renderers", names)?;
            if let Some(noise) = scene.reference_noise
                && !(noise >= 0.0 && noise.is_finite())
            {
                return Err(format!(
                    "the reference's noise is {noise}; expected its relMSE, at least 0"
                ));
            }
            let images = scene.peers.iter().any(|peer| peer.image.is_some());
            if scene.reference.is_none() && (images || scene.reference_noise.is_some()) {
                return Err(format!(
                    "scene `{}`: images of others and the noise of a reference need a reference",
                    scene.name
                ));
            }
        }
        Ok(())
    }
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        if name.is_empty() || !seen.insert(name) {
            return Err(format!(
                "{what}: expected different names, found `{name}` twice or empty"
            ));
        }
    }
    Ok(())
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn checked_passes(passes: Option<u64>) -> Result<Option<u64>, String> {
    match passes {
        Some(passes) if !(1..=MAX_PASSES).contains(&passes) => Err(format!("passes is {passes}; expected at least 1")),
        passes => Ok(passes),
    }
}

impl Default for RunCase {
    fn default() -> Self {
        Self {
            name: "beamfarm".into(),
            scenes: Vec::new(),
            passes: None,
            integrator: Integrator::default(),
            overrides: Overrides::default(),
        }
    }
}

impl SceneEntry {
    fn resolve(self, folder: &Path) -> Result<SceneCase, String> {
        let name = self.name.unwrap_or_else(|| stem(&self.scene));
        let peers = self.peers.into_iter().map(|peer| {
            let peer_name = peer.name.clone();
            let resolved = peer.resolve(folder);
            resolved.map_err(|message| format!("scene `{name}`, `{peer_name}`: {message}"))
        });
        Ok(SceneCase {
            path: folder.join(&self.scene),
            reference: self.reference.map(|path| folder.join(path)),
            reference_noise: self.reference_noise,
            passes: checked_passes(self.passes)?,
            crops: self.crops,
            peers: peers.collect::<Result<_, _>>()?,
            name,
        })
    }
}

impl PeerEntry {
    fn resolve(self, folder: &Path) -> Result<Peer, String> {
        let positive = |v: &f64| *v > 0.0 && v.is_finite();
        let points = self.points.iter().map(|point| {
            let (wall_seconds, rel_mse, core_seconds) = match point[..] {
                [seconds, error] => (seconds, error, None),
                [seconds, error, cores] => (seconds, error, Some(cores)),
                _ => {
                    return Err("points are [seconds, relMSE] or [seconds, relMSE, core-seconds]");
                }
            };
            match point.iter().all(positive) {
                true => Ok(Point {
                    wall_seconds,
                    core_seconds,
                    rel_mse,
                }),
                false => Err("times and errors are above zero"),
            }
        });
        let mut points = points.collect::<Result<Vec<Point>, _>>()?;
        points.sort_by(|a, b| a.wall_seconds.total_cmp(&b.wall_seconds));
        let image = match (self.image, self.seconds) {
            (None, None) if self.core_seconds.is_none() => None,
            (Some(path), Some(wall_seconds)) if positive(&wall_seconds) && self.core_seconds.iter().all(positive) => {
                Some(PeerImage {
                    path: folder.join(path),
                    wall_seconds,
                    core_seconds: self.core_seconds,
                })
            }
            _ => return Err("an image comes with its seconds, above zero".into()),
        };
        if image.is_none() && points.is_empty() {
            return Err("expected points, or an image with its seconds".into());
        }
        Ok(Peer {
            name: self.name,
            points,
            image,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::overrides::load;
    use super::*;
    use beamfarm_image::job::ScheduleKind;

    fn read(text: &str) -> Result<Suite, String> {
        let file: SuiteFile = toml::from_str(text).map_err(|e| e.message().to_owned())?;
        Suite::resolve(file, Path::new("dir"), "bench")
    }

    #[test]
    fn a_suite_is_read_as_written() {
        let suite = read(
            r#"
            [[scenes]]
            scene = "a.toml"
            reference = "a.exr"
            reference_noise = 1e-4
            passes = 8
            [[scenes.peers]]
            name = "other"
            points = [[3.0, 1e-2], [1.0, 2e-2, 2.0]]
            [[scenes.peers]]
            name = "third"
            image = "third.exr"
            seconds = 2
            [[scenes]]
            name = "b"
            scene = "/elsewhere/c.toml"
            [[runs]]
            name = "slow"
            scenes = ["b"]
            overrides = { alpha = 0.9, schedule = "beam" }
            [[runs]]
            name = "plain"
            "#,
        )
        .unwrap();
        assert_eq!(suite.title, "bench");
        let [a, b] = &suite.scenes[..] else { panic!() };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
        assert_eq!(a.path, Path::new("dir/a.toml"));
        assert_eq!(b.path, Path::new("/elsewhere/c.toml"));
        let point = Point {
            wall_seconds: 1.0,
            core_seconds: Some(2.0),
            rel_mse: 2e-2,
        };
        assert_eq!(a.peers[0].points[0], point);
        assert_eq!(a.peers[1].image.as_ref().unwrap().wall_seconds, 2.0);
        let [slow, plain] = &suite.runs[..] else { panic!() };
        assert!(!slow.renders("a") && slow.renders("b") && plain.renders("a"));
        assert_eq!(slow.overrides.alpha, Some(0.9));
        assert_eq!(slow.overrides.schedule, Some(ScheduleKind::Beam));
    }

    #[test]
    fn the_command_line_comes_before_the_file() {
        let mut suite =
            read("[[scenes]]\nscene='a.toml'\n[[runs]]\nname='x'\npasses=9\noverrides={alpha=0.9,paths=7}").unwrap();
        let overrides = Overrides {
            alpha: Some(0.5),
            ..Overrides::default()
        };
        suite.set(Some(3), None, &overrides);
        let run = &suite.runs[0];
        assert_eq!(run.passes, Some(3));
        assert_eq!(run.overrides.alpha, Some(0.5));
        assert_eq!(run.overrides.paths, Some(7));
    }

    /// The suite that comes with the program.
    #[test]
    fn the_peers_suite_is_sound() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/peers");
        let suite = Suite::read(&folder.join("bench.toml")).unwrap();
        assert_eq!(suite.scenes.len(), 2);
        for scene in &suite.scenes {
            assert_eq!(scene.peers.len(), 2, "{}", scene.name);
            let (description, _) = load(&scene.path, &Overrides::default()).unwrap();
            assert_eq!((description.camera.width, description.camera.height), (512, 512));
        }
    }

    #[test]
    fn bad_suites_are_refused() {
        let scene = "[[scenes]]\nscene='a.toml'\n";
        let cases = [
            ("", "scenes"),
            ("scenes=[]", "at least one scene"),
            ("[[scenes]]\nscen='a'", "scen"),
            (&format!("{scene}{scene}"), "`a` twice"),
            (&format!("{scene}passes=0"), "passes is 0"),
            (&format!("{scene}reference='r'\nreference_noise=-1"), "noise is -1"),
            (&format!("{scene}reference_noise=1"), "need a reference"),
            (&format!("{scene}[[scenes.peers]]\nname='x'"), "expected points"),
            (
                &format!("{scene}[[scenes.peers]]\nname='x'\npoints=[[1]]"),
                "[seconds, relMSE]",
            ),
            (
                &format!("{scene}[[scenes.peers]]\nname='x'\npoints=[[1,0]]"),
                "above zero",
            ),
            (
                &format!("{scene}[[scenes.peers]]\nname='x'\npoints=[[1,nan]]"),
                "above zero",
            ),
            (&format!("{scene}[[scenes.peers]]\nname='x'\nimage='i'"), "its seconds"),
            (
                &format!("{scene}[[scenes.peers]]\nname='beamfarm'\npoints=[[1,1]]"),
                "twice",
            ),
            (&format!("{scene}[[runs]]\nname='x'\nscenes=['z']"), "no scene `z`"),
            (&format!("{scene}[[runs]]\nname='x'\noverrides={{alpa=1}}"), "alpa"),
        ];
        for (text, message) in cases {
            let error = read(text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
    }

    #[test]
    fn engines_are_told_from_images_of_others() {
        for (text, engine) in [("cpu", EngineKind::Cpu), ("gpu", EngineKind::Gpu)] {
            assert!(matches!(against(text), Ok(Against::Engine(found)) if found == engine));
        }
        assert!(matches!(against("cpu=a.exr,1"), Ok(Against::Peer(peer)) if peer.name == "cpu"));
        let mut suite = Suite::plain(&["a.toml".into()], &[], None, &[]).unwrap();
        suite.by_engines(&[EngineKind::Gpu, EngineKind::Cpu]);
        suite.set(None, Some(3.0), &Overrides::default());
        suite.check().unwrap();
        let runs: Vec<_> = suite
            .runs
            .iter()
            .map(|run| (run.name.as_str(), run.overrides.engine))
            .collect();
        assert_eq!(runs, [("gpu", Some(EngineKind::Gpu)), ("cpu", Some(EngineKind::Cpu))]);
    }

    #[test]
    fn images_of_others_are_named_with_their_times() {
        let other = peer("Tungsten=a,b.exr,12.5,24").unwrap();
        let image = PeerImage {
            path: "a,b.exr".into(),
            wall_seconds: 12.5,
            core_seconds: Some(24.0),
        };
        assert_eq!((other.name.as_str(), other.image), ("Tungsten", Some(image)));
        let other = peer("out/other.exr,3").unwrap();
        assert_eq!(other.name, "other");
        assert_eq!(other.image.unwrap().core_seconds, None);
        for bad in [
            "",
            "a.exr",
            "a.exr,",
            "a.exr,x",
            "a.exr,0",
            "a.exr,-1",
            "a.exr,nan",
            "a.exr,1,inf",
            "=a.exr,1",
            "x=,1",
            ",1",
        ] {
            assert!(
                against(bad).unwrap_err().starts_with("expected cpu, gpu or [NAME=]"),
                "{bad}"
            );
        }
    }
}
