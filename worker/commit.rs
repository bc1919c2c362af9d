//! Which commit a program is built from: what is asked when it is built.

use std::path::{Path, PathBuf};
use std::process::Command;

/// What is known of a checkout.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Commit {
    /// Its short name, with a `+` if what the programs are made of has been changed since.
    pub name: Option<String>,
    /// Files that are written when there is another commit.
    pub files: Vec<PathBuf>,
}

/// What git says of the checkout at `root`. Nothing where this is none, as in an archive of the sources, or where there
/// is no git. Of changes those in `sources` count.
pub fn ask(root: &Path, sources: &[&str]) -> Commit {
    // Sources that were unpacked inside of another checkout are not of that one's commit.
    if !root.join(".git").exists() {
        return Commit::default();
    }
    let git = |arguments: &[&str]| {
        let mut command = Command::new("git");
        // Only what is asked for is looked at, and nothing is written.
        command.arg("--no-optional-locks").arg("-C").arg(root).args(arguments);
        let output = command.output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8(output.stdout).ok()?.trim_end().to_owned())
    };
    let Some(name) = git(&["rev-parse", "--short=12", "HEAD"]) else {
        return Commit::default();
    };
    let changes = git(&[&["status", "--porcelain", "--"], sources].concat());
    let changed = match changes.as_deref() {
        Some("") => "",
        _ => "+",
    };
    let branch = git(&["symbolic-ref", "--quiet", "HEAD"]);
    let written = ["HEAD", "logs/HEAD"].into_iter().chain(branch.as_deref());
    let files = written.filter_map(|file| git(&["rev-parse", "--git-path", file]));
    let files = files.map(|file| root.join(file)).filter(|file| file.exists());
    Commit {
        name: Some(name + changed),
        files: files.collect(),
    }
}

/// What BEAMFARM_COMMIT says in place of git: one word.
///
/// # Errors
/// If it is something else.
pub fn told(variable: &str) -> Result<&str, String> {
    let is_word = !variable.is_empty() && variable.len() <= 80 && variable.bytes().all(|byte| byte.is_ascii_graphic());
    match is_word {
        true => Ok(variable),
        false => Err(format!(
            "BEAMFARM_COMMIT is {variable:?}; expected one word of at most 80 characters"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn git(root: &Path, arguments: &[&str]) -> String {
        let mut command = Command::new("git");
        let who = [
            "-c",
            "user.name=a",
            "-c",
            "user.email=a@b.example",
            "-c",
            "commit.gpgsign=false",
        ];
        let output = command.arg("-C").arg(root).args(who).args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap().trim_end().to_owned()
    }

    #[test]
    fn the_commit_of_a_checkout_and_its_changes() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let ask = || ask(root, &["kept"]);
        assert_eq!(ask(), Commit::default(), "no checkout");
        if Command::new("git").arg("--version").output().is_err() {
            return;
        }
        git(root, &["init", "--quiet", "--initial-branch=some"]);
        assert_eq!(ask().name, None, "no commit yet");
        fs::create_dir(root.join("kept")).unwrap();
        fs::write(root.join("kept/a"), "1").unwrap();
        git(root, &["add", "."]);
        git(root, &["commit", "--quiet", "-m", "one"]);
        let head = git(root, &["rev-parse", "HEAD"]);
        let commit = ask();
        assert_eq!(commit.name.as_deref(), Some(&head[..12]));
        assert!(commit.files.contains(&root.join(".git/refs/heads/some")), "{commit:?}");

        // What the programs are not made of does not count.
        fs::write(root.join("other"), "1").unwrap();
        assert_eq!(ask().name.as_deref(), Some(&head[..12]));
        fs::write(root.join("kept/b"), "1").unwrap();
        let changed = format!("{}+", &head[..12]);
        assert_eq!(ask().name, Some(changed.clone()));
        fs::remove_file(root.join("kept/b")).unwrap();
        fs::write(root.join("kept/a"), "22").unwrap();
        assert_eq!(ask().name, Some(changed));

        // Sources that lie in somebody else's checkout.
        fs::create_dir(root.join("unpacked")).unwrap();
        assert_eq!(super::ask(&root.join("unpacked"), &["kept"]), Commit::default());

        // Without a branch, and from another folder's checkout of it.
        git(root, &["checkout", "--quiet", "--force", "--detach"]);
        assert_eq!(ask().name.as_deref(), Some(&head[..12]));
        let place = tempfile::tempdir().unwrap();
        let place = place.path().join("second");
        git(root, &["worktree", "add", "--quiet", place.to_str().unwrap(), "some"]);
        let commit = super::ask(&place, &["kept"]);
        assert_eq!(commit.name.as_deref(), Some(&head[..12]));
        assert!(commit.files.iter().any(|file| file.ends_with("HEAD")), "{commit:?}");
    }

    #[test]
    fn one_word_is_taken_in_its_place() {
        assert_eq!(told("v0.2.0-3-gabc+"), Ok("v0.2.0-3-gabc+"));
        for wrong in ["", "two words", "line\nline", "\u{fc}", &"x".repeat(81)] {
            assert!(told(wrong).is_err(), "{wrong:?}");
        }
    }
}
