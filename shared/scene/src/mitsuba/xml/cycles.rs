//! Detects circular references.

use super::read::MAX_DEPTH;
use super::{Content, Objects};
use crate::mitsuba::log::Log;

impl Objects {
    /// Depth-first without recursion: a chain of references may be as long as the file.
    pub fn refuse_cycles(&self, log: &mut Log) -> Option<()> {
        let count = self.list.len();
        let mut done = vec![false; count];
        let mut within = vec![false; count];
        for start in 0..count {
            let mut path = vec![(start, 0)];
            while let Some((object, next)) = path.last_mut() {
                let object = *object;
                within[object] = true;
                let member = self.list[object].members.get(*next);
                *next += 1;
                match member {
                    _ if done[object] => {
                        within[object] = false;
                        path.pop();
                    }
                    None => {
                        done[object] = true;
                        within[object] = false;
                        path.pop();
                    }
                    Some(member) => {
                        if let Content::Object(inner) = member.content
                            && !done[inner]
                        {
                            if within[inner] {
                                let id = self.list[inner].id.clone();
                                let message = format!("the object \"{}\" refers to itself", id.unwrap_or_default());
                                let place = member.place;
                                return log.fatal(Some(place), message);
                            }
                            if path.len() > MAX_DEPTH {
                                let message = format!("more than {MAX_DEPTH} objects that refer to each other");
                                let place = member.place;
                                return log.fatal(Some(place), message);
                            }
                            path.push((inner, 0));
                        }
                    }
                }
            }
        }
        Some(())
    }
}
