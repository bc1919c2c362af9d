//! Messages to a live view from a grammar: every kind, with extreme values in every field.

use crate::live::View;
use crate::setup::{folder_with, scene};
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde_json::json;
use std::collections::BTreeSet;
use std::path::Path;
use tungstenite::Message;

const MESSAGES: usize = 200;

/// N stands for a number, I for an integer, T for a text, and V for a value.
const KINDS: [&str; 18] = [
    r#"{"type":"camera","seq":I,"gesture":T,"origin":[N,N,N],"target":[N,N,N]}"#,
    r#"{"type":"camera","seq":I,"gesture":T,"origin":[N,N,N],"target":[N,N,N],"up":[N,N,N],"fov":N}"#,
    r#"{"type":"set","seq":I,"gesture":T,"path":T,"value":V}"#,
    r#"{"type":"set","seq":I,"gesture":T,"path":T,"value":V}"#,
    r#"{"type":"move","seq":I,"gesture":T,"thing":T,"by":[N,N,N]}"#,
    r#"{"type":"turn","seq":I,"gesture":T,"thing":T,"axis":[N,N,N],"angle":N}"#,
    r#"{"type":"rest"}"#,
    r#"{"type":"pick","x":N,"y":N}"#,
    r#"{"type":"focus","seq":I,"x":N,"y":N}"#,
    r#"{"type":"undo","seq":I}"#,
    r#"{"type":"redo","seq":I}"#,
    r#"{"type":"revert","seq":I}"#,
    r#"{"type":"written","seq":I}"#,
    r#"{"type":"save"}"#,
    r#"{"type":"size","width":I}"#,
    r#"{"type":"drawn","frame":I}"#,
    r#"{"type":"passes","passes":I}"#,
    r#"{"type":T,"seq":V}"#,
];
const NUMBERS: [&str; 16] = [
    "0",
    "-0.0",
    "1",
    "0.5",
    "-1",
    "2",
    "2.0000001",
    "360",
    "1e-45",
    "5e-324",
    "1e18",
    "-1e18",
    "1.1e18",
    "3.5e38",
    "1e308",
    "1e999",
];
const WHOLE: [&str; 8] = [
    "0",
    "1",
    "64",
    "100",
    "4294967295",
    "9007199254740993",
    "18446744073709551615",
    "-1",
];
const TEXTS: [&str; 22] = [
    "",
    "g",
    "camera.fov",
    "camera",
    "camera.origin",
    "lights.0",
    "lights.0.power",
    "lights.18446744073709551616",
    "lights.-1",
    "shapes.0",
    "shapes.0.radius",
    "shapes.0.file",
    "shapes.1.file",
    "image.width",
    "render.passes",
    "render.paths",
    "media",
    "include",
    "..",
    "\u{202e}",
    "a.b.c.d.e.f",
    "save",
];
const VALUES: [&str; 16] = [
    "null",
    "true",
    "N",
    "[N,N,N]",
    "[]",
    "{}",
    "[[[[[[[[]]]]]]]]",
    r#""T""#,
    r#"{"type":"mesh","file":"PRIVATE"}"#,
    r#""PRIVATE""#,
    r#""../../../../etc/passwd""#,
    r#""/dev/zero""#,
    "1e15",
    "-5",
    r#"{"file":"PRIVATE"}"#,
    r#"[{"radius":N}]"#,
];

struct Dice(Pcg32);

impl Dice {
    fn pick<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.0.next_u32() as usize % of.len()]
    }

    fn message(&mut self, private: &str) -> String {
        let text = |dice: &mut Self| serde_json::to_string(dice.pick(&TEXTS)).unwrap();
        let mut message = String::new();
        let mut kind = self.pick(&KINDS).to_owned();
        // A letter that stands alone is replaced.
        for place in ["V", "N", "I", "T"] {
            let is_alone = |at: usize, text: &str| {
                let beside = |byte: Option<&u8>| byte.is_none_or(|byte| b":,[]}".contains(byte));
                let bytes = text.as_bytes();
                beside(at.checked_sub(1).and_then(|at| bytes.get(at))) && beside(bytes.get(at + 1))
            };
            message.clear();
            for (at, c) in kind.char_indices() {
                match c.to_string() == place && is_alone(at, &kind) {
                    true => {
                        message += &match place {
                            "V" => self.pick(&VALUES).replace("PRIVATE", private),
                            "N" => self.pick(&NUMBERS).to_owned(),
                            "I" => self.pick(&WHOLE).to_owned(),
                            _ => text(self),
                        }
                    }
                    false => message.push(c),
                }
            }
            kind.clone_from(&message);
        }
        message
    }
}

fn files(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect()
}

/// It survives, answers, and neither writes nor reveals anything outside the scene's folder.
#[test]
fn a_view_takes_any_message() {
    const SECRET: &str = "words that nobody may read";
    let elsewhere = tempfile::tempdir().unwrap();
    let private = elsewhere.path().join("private.ply");
    std::fs::write(&private, SECRET).unwrap();
    let folder = folder_with(&scene([48, 32], 2, 300));
    let rounds = if std::env::var_os("BEAMFARM_LONG").is_some() {
        20
    } else {
        1
    };
    for seed in 1..=rounds {
        let mut view = View::of(&folder, &[]);
        view.hear_until("the scene", |view| view.last.get("scene").map(|_| ()));
        let before = files(folder.path());
        let mut dice = Dice(Pcg32::new(seed, 1));
        for _ in 0..MESSAGES {
            let message = dice.message(private.to_str().unwrap());
            view.socket.send(Message::text(message)).unwrap();
        }
        // Reverts to the state on disk, then makes another change. Others may have used up the sequence numbers.
        view.say(json!({"type": "revert", "seq": 1}));
        view.set("camera.fov", json!(41));
        view.hear_until("the change", |view| {
            let said = format!("{:?}", view.last);
            assert!(!said.contains(SECRET), "seed {seed}: {said}");
            let fields = view.last.get("scene")?["fields"].as_array()?;
            let fov = fields.iter().find(|field| field["path"] == "camera.fov")?;
            (fov["value"].as_f64() == Some(41.0)).then_some(())
        });
        assert!(view.process.is_running(), "seed {seed}");
        let new: Vec<_> = files(folder.path()).difference(&before).cloned().collect();
        assert!(new.is_empty(), "seed {seed}: {new:?}");
        assert_eq!(files(elsewhere.path()), ["private.ply".to_owned()].into());
        assert_eq!(std::fs::read_to_string(&private).unwrap(), SECRET);
    }
}
