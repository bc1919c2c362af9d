//! Programs that the live view starts: a job of the scene, and an editor for its file.

use super::messages::ToPage;
use super::view::{LiveView, error};
use beamfarm_coordinator::security::ENTER;
use beamfarm_proto::{TOKEN_VARIABLE, Token};
#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;
use std::sync::Arc;
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::{Child, Command};

/// What `render` prints before its page's address.
const PAGE: &str = "page: ";

/// Save the scene, start a job of its file, and tell all pages the job's address. One job runs at a time; it ends with
/// the view.
pub fn render(view: Arc<LiveView>) {
    let Some(place) = view.jobs.begin() else {
        view.tell(error(
            0,
            "a job of this scene is under way: end it on its page first"
                .to_owned()
                .into(),
        ));
        return;
    };
    tokio::spawn(async move {
        let _place = place;
        if let Err(message) = begin(&view).await {
            view.tell(error(0, message.into()));
        }
    });
}

async fn begin(view: &Arc<LiveView>) -> Result<(), String> {
    let (is_dirty, file) = {
        let bench = view.bench();
        (bench.is_dirty(), bench.file().to_owned())
    };
    if is_dirty {
        let text = view.save()?;
        view.tell(ToPage::Told { text });
    }
    let token = Token::random().map_err(|error| error.to_string())?;
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut child = Command::new(program)
        // It ends with this process, however that ends.
        .args(["render", "--with-parent"])
        .arg(&file)
        .args(view.args.of_native())
        .args(["--log", "warn"])
        // Only this user can read a process's environment.
        .env(TOKEN_VARIABLE, token.reveal())
        .env_remove("BEAMFARM_TOKEN_FILE")
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .kill_on_drop(true)
        .spawn()
        .map_err(|error| format!("no job can be started: {error}"))?;
    let Some(stderr) = child.stderr.take() else {
        return Err("the job says nothing".into());
    };
    let mut lines = BufReader::new(stderr).lines();
    let mut said = Vec::new();
    let mut is_open = false;
    let mut over = view.jobs.over();
    let mut is_ending = false;
    loop {
        let line = tokio::select! {
            line = lines.next_line() => line,
            _ = over.wait_for(|over| *over), if !is_ending => {
                is_ending = true;
                interrupt(&mut child);
                continue;
            }
        };
        let Ok(Some(line)) = line else { break };
        match line.strip_prefix(PAGE) {
            Some(address) if !is_open => {
                is_open = true;
                // There are not enough cores for both.
                view.give_way();
                let url = format!("{}{ENTER}#{}", address.trim_end_matches('/'), token.reveal());
                view.tell(ToPage::Open { url });
            }
            // The job's output is passed on to the terminal.
            _ => {
                eprintln!("{}", beamfarm_worker::visible(&line));
                said.push(line);
                said.drain(..said.len().saturating_sub(5));
            }
        }
    }
    let status = child.wait().await.map_err(|error| error.to_string())?;
    match status.success() {
        true => {
            let text = format!("the job of {} is done", file.display());
            view.tell(ToPage::Told { text });
            Ok(())
        }
        false => Err(said.join("\n")),
    }
}

/// Ctrl-C where there are signals; elsewhere closing its standard input ends it.
fn interrupt(child: &mut Child) {
    #[cfg(unix)]
    if let Some(process) = child.id().and_then(|id| i32::try_from(id).ok()).and_then(Pid::from_raw) {
        // It may have just ended.
        let _ = kill_process(process, Signal::INT);
    }
    #[cfg(not(unix))]
    drop(child.stdin.take());
}

/// Open the scene file in the system's default editor.
pub fn editor(view: &LiveView) -> Result<String, String> {
    let file = {
        let bench = view.bench();
        bench.file().to_owned()
    };
    open::that_detached(&file).map_err(|error| format!("{} cannot be opened: {error}", file.display()))?;
    Ok(format!("{} is open; what is saved there is shown here", file.display()))
}
