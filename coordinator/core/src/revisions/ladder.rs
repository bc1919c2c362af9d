//! How coarse sketches are: few pixels and photon paths while things move, more of both while nothing does.

use std::time::Duration;

/// Width and photon paths of the coarsest sketch, from what a slow machine can show in time to what a fast one can.
const COARSEST: [(u32, u32); 8] = [
    (64, 500),
    (96, 700),
    (128, 1000),
    (160, 1000),
    (200, 1000),
    (240, 1200),
    (320, 1500),
    (400, 2000),
];
const FIRST: usize = 3;
/// The same for the first sketch of an unknown scene: even a very slow scene shows something.
const GLANCE: (u32, u32) = (32, 64);
/// Above `SLOW` the next coarsest sketch is coarser, below `QUICK` it is finer.
const SLOW: Duration = Duration::from_millis(42);
const QUICK: Duration = Duration::from_millis(18);
/// Each step multiplies the pixels along each side and the photon paths by these.
const PIXELS: u32 = 2;
const PATHS: u32 = 2;

/// A sketch's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Photon paths.
    pub paths: u32,
}

/// The steps of sketches, from one that appears at once to full size.
#[derive(Clone, Debug)]
pub struct Ladder {
    full: [u32; 2],
    coarsest: usize,
}

impl Ladder {
    /// Steps up to a picture of this width and height in pixels.
    pub fn new(full: [u32; 2]) -> Self {
        Self {
            full: full.map(|side| side.max(1)),
            coarsest: FIRST,
        }
    }

    /// Change the full size, and keep what was learnt.
    pub fn resize(&mut self, full: [u32; 2]) {
        self.full = full.map(|side| side.max(1));
    }

    /// The first sketch of a scene.
    pub fn glance(&self) -> Step {
        let (width, paths) = GLANCE;
        self.step(width.min(self.full[0]), paths)
    }

    fn step(&self, width: u32, paths: u32) -> Step {
        let [full_width, full_height] = self.full;
        let height = f64::from(full_height) * f64::from(width) / f64::from(full_width);
        Step {
            width,
            height: (height.round() as u32).max(1),
            paths,
        }
    }

    /// The steps from coarse to fine; at least one.
    pub fn steps(&self) -> Vec<Step> {
        let full_width = self.full[0];
        let (mut width, mut paths) = COARSEST[self.coarsest];
        let mut steps = Vec::new();
        loop {
            // No step lies within a factor 1.5 of the full width.
            let is_last = 3 * width >= 2 * full_width;
            let width_here = if is_last { full_width } else { width };
            steps.push(self.step(width_here, paths));
            if is_last {
                return steps;
            }
            width *= PIXELS;
            paths *= PATHS;
        }
    }

    /// Note how long the coarsest sketch took, and adjust the next one.
    pub fn learn(&mut self, took: Duration) {
        if took > 3 * SLOW {
            self.coarsest = self.coarsest.saturating_sub(2);
        } else if took > SLOW {
            self.coarsest = self.coarsest.saturating_sub(1);
        } else if took < QUICK {
            self.coarsest = (self.coarsest + 1).min(COARSEST.len() - 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_lead_from_coarse_to_the_full_size() {
        for full in [[960, 540], [512, 400], [64, 64], [1, 1], [150, 9000], [4000, 1]] {
            let mut ladder = Ladder::new(full);
            for took in [0, 0, 30, 0, 0, 0, 0, 0, 500, 500, 50, 50, 500, 500] {
                ladder.learn(Duration::from_millis(took));
                let steps = ladder.steps();
                let last = steps[steps.len() - 1];
                assert_eq!([last.width, last.height], full);
                for pair in steps.windows(2) {
                    assert!(pair[0].width < pair[1].width && pair[0].paths < pair[1].paths);
                    assert!(pair[0].height >= 1 && pair[0].height <= pair[1].height);
                }
            }
            assert_eq!(ladder.coarsest, 0);
        }
    }

    #[test]
    fn a_pace_that_suits_stays() {
        let mut ladder = Ladder::new([960, 540]);
        let before = ladder.steps();
        ladder.learn(Duration::from_millis(30));
        assert_eq!(ladder.steps(), before);
    }
}
