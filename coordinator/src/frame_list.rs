//! The list of frames from the command line.

use clap::Args;
use std::collections::BTreeSet;
use std::str::FromStr;

/// The most frames of one command.
const MOST: usize = 100_000;

/// Frames of an animation.
#[derive(Args, Clone, Debug)]
pub struct FrameArgs {
    /// Render frames of the animation: 1-100, 1-100x2, 1-10,20,30-40x5, or all
    ///
    /// 1-100x2 is every second frame. Frames are rendered one after the other. Each is the image of `-D
    /// animation.frame=N`, in a file of its own: see -o. Files that are there already stay as they are.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, conflicts_with_all = ["first_pass", "resume"])]
    #[arg(help_heading = "Frames")]
    pub frames: Option<FrameList>,

    /// Give each frame another seed [default: the same seed]
    ///
    /// The seed then depends on the frame's number: noise moves like film grain, where with one seed it stands still.
    #[arg(long, requires = "frames", help_heading = "Frames")]
    pub seed_per_frame: bool,
}

/// What `--frames` takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameList {
    /// All frames of the scene's animation.
    All,
    /// These frames, in order.
    Listed(Vec<i64>),
}

impl FromStr for FrameList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self::All);
        }
        let mut frames = BTreeSet::new();
        for part in text.split(',') {
            for frame in range(part.trim())? {
                frames.insert(frame);
                if frames.len() > MOST {
                    return Err(format!("more than {MOST} frames"));
                }
            }
        }
        Ok(Self::Listed(frames.into_iter().collect()))
    }
}

/// `7`, `1-100` or `1-100x2`; numbers may be negative.
fn range(text: &str) -> Result<impl Iterator<Item = i64>, String> {
    let wrong = || format!("{text:?}: expected a frame as in 7, frames as in 1-100 or 1-100x2, or all");
    let (ends, step) = match text.split_once('x') {
        Some((ends, step)) => (ends, step.parse::<usize>().map_err(|_| wrong())?),
        None => (text, 1),
    };
    // The first character may be a sign.
    let dash = ends.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(i, _)| i);
    let number = |text: &str| text.parse::<i64>().ok().filter(|n| n.unsigned_abs() <= 1_000_000);
    let (first, last) = match dash {
        Some(dash) => (number(&ends[..dash]), number(&ends[dash + 1..])),
        None => (number(ends), number(ends)),
    };
    let (first, last) = first.zip(last).ok_or_else(wrong)?;
    if first > last {
        return Err(format!("{text:?}: the first frame comes after the last"));
    }
    match (step, dash) {
        (0, _) | (2.., None) => Err(wrong()),
        _ => Ok((first..=last).step_by(step)),
    }
}

/// The seed of a frame when each frame has its own.
pub fn seed_of(seed: u64, frame: i64) -> u64 {
    let bytes = [seed.to_le_bytes(), frame.to_le_bytes()].concat();
    let hash = blake3::hash(&bytes);
    let first = hash.as_bytes().iter().take(8);
    first.fold(0, |number, byte| number << 8 | u64::from(*byte))
}

impl FrameList {
    /// The frames to render, given the scene's first and last frame.
    pub fn of(&self, [first, last]: [i64; 2]) -> Result<Vec<i64>, String> {
        match self {
            Self::All => {
                let all: Vec<i64> = (first..=last).take(MOST + 1).collect();
                match all.len() > MOST {
                    true => Err(format!("all: more than {MOST} frames")),
                    false => Ok(all),
                }
            }
            Self::Listed(frames) => {
                let beyond = frames.iter().find(|frame| !(first..=last).contains(frame));
                match beyond {
                    Some(frame) => Err(format!("frame {frame}: the scene has frames {first} to {last}")),
                    None => Ok(frames.clone()),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_frames_in_order() {
        let listed = |text: &str| match text.parse::<FrameList>() {
            Ok(FrameList::Listed(frames)) => frames,
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(listed("7"), [7]);
        assert_eq!(listed("1-3"), [1, 2, 3]);
        assert_eq!(listed("1-10x4"), [1, 5, 9]);
        assert_eq!(listed("30-40x5, 20,1-2,2"), [1, 2, 20, 30, 35, 40]);
        assert_eq!(listed("-3--1,0-1"), [-3, -2, -1, 0, 1]);
        assert_eq!("all".parse(), Ok(FrameList::All));
    }

    #[test]
    fn what_is_no_list_says_what_was_expected() {
        for text in [
            "", "a", "1-", "-", "1-2x", "1-2x0", "1x2", "1..3", "1,,2", "1.5", "1-2-3", "9999999",
        ] {
            let said = text.parse::<FrameList>().unwrap_err();
            assert!(said.contains("expected a frame as in 7"), "{text}: {said}");
        }
        let said = "5-3".parse::<FrameList>().unwrap_err();
        assert!(said.contains("the first frame comes after the last"), "{said}");
        let said = "-1000000-1000000".parse::<FrameList>().unwrap_err();
        assert!(said.contains("more than 100000 frames"), "{said}");
    }

    #[test]
    fn frames_are_those_of_the_scene() {
        let listed = FrameList::Listed(vec![1, 5]);
        assert_eq!(listed.of([1, 5]), Ok(vec![1, 5]));
        assert_eq!(listed.of([1, 4]), Err("frame 5: the scene has frames 1 to 4".into()));
        assert_eq!(FrameList::All.of([-1, 1]), Ok(vec![-1, 0, 1]));
    }

    #[test]
    fn seeds_of_frames_differ() {
        let seeds: BTreeSet<u64> = (0..1000).map(|frame| seed_of(7, frame)).collect();
        assert_eq!(seeds.len(), 1000);
        assert_ne!(seed_of(7, 1), seed_of(8, 1));
    }
}
