//! Recent events, for people who watch.

use std::collections::VecDeque;
use std::time::SystemTime;

/// The most events that are remembered.
const REMEMBERED: usize = 500;

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum EventKind {
    /// A worker registered.
    Joined,
    /// A worker signed off, or its connection broke.
    Left,
    /// Leases ended without a result.
    Lost,
    /// An attempt at a block failed.
    Failed,
    /// What a worker sent was refused.
    Refused,
    /// Two workers delivered different bits for the same block, or a third decided which are right.
    Divergent,
    /// A worker does not offer the job's engine.
    Unable,
    /// A worker is shut out.
    ShutOut,
    /// Passes that counted were taken back and are rendered again.
    Dropped,
    /// Somebody paused the job, resumed it, or asked for more passes.
    Control,
    /// The job is over.
    Ended,
}

impl EventKind {
    /// One word, for logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Joined => "joined",
            Self::Left => "left",
            Self::Lost => "lost",
            Self::Failed => "failed",
            Self::Refused => "refused",
            Self::Divergent => "divergent",
            Self::Unable => "unable",
            Self::ShutOut => "shut-out",
            Self::Dropped => "dropped",
            Self::Control => "control",
            Self::Ended => "ended",
        }
    }
}

/// An event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Events are numbered from zero. Old ones are forgotten, so the list may begin later.
    pub number: u64,
    /// When it happened.
    pub time: SystemTime,
    /// What kind of event it is.
    pub kind: EventKind,
    /// What happened, in a sentence. Workers' names in it come from outside and are quoted.
    pub text: String,
}

/// The most recent events.
#[derive(Debug, Default)]
pub(super) struct Events {
    next: u64,
    ring: VecDeque<Event>,
}

impl Events {
    pub fn push(&mut self, kind: EventKind, text: String) {
        if self.ring.len() >= REMEMBERED {
            self.ring.pop_front();
        }
        self.ring.push_back(Event {
            number: self.next,
            time: SystemTime::now(),
            kind,
            text,
        });
        self.next += 1;
    }

    pub fn since(&self, number: u64) -> Vec<Event> {
        let new = self.ring.iter().filter(|event| event.number >= number);
        new.cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_events_are_forgotten() {
        let mut events = Events::default();
        for i in 0..REMEMBERED + 3 {
            events.push(EventKind::Joined, i.to_string());
        }
        let all = events.since(0);
        assert_eq!(all.len(), REMEMBERED);
        assert_eq!((all[0].number, &*all[0].text), (3, "3"));
        assert_eq!(events.since(REMEMBERED as u64 + 2).len(), 1);
    }
}
