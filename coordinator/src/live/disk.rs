//! Detects changes of the scene's files on disk.

use super::view::LiveView;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::time::{MissedTickBehavior, interval};

/// Time between checks.
const LOOK: Duration = Duration::from_millis(250);

/// Modification time and size of a file.
type Mark = Option<(SystemTime, u64)>;

fn mark(path: &Path) -> Mark {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

fn marks(paths: Vec<PathBuf>) -> Vec<(PathBuf, Mark)> {
    let with_mark = |path: PathBuf| {
        let mark = mark(&path);
        (path, mark)
    };
    paths.into_iter().map(with_mark).collect()
}

/// Read the scene again whenever one of its files changes.
pub async fn watch(view: Arc<LiveView>) {
    let mut looks = interval(LOOK);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut known = marks(view.bench().paths());
    loop {
        looks.tick().await;
        let (of_view, before) = (view.clone(), known);
        let looked = tokio::task::spawn_blocking(move || {
            let now = marks(of_view.bench().paths());
            let was = |path: &PathBuf| before.iter().find(|(known, _)| known == path).map(|(_, mark)| *mark);
            // A newly named file was just read; a missing one may be about to be written.
            let is_new = now
                .iter()
                .any(|(path, mark)| mark.is_some() && was(path).is_some_and(|was| was != *mark));
            if is_new {
                of_view.read_again();
            }
            now
        });
        known = looked.await.unwrap_or_default();
    }
}
