//! Shell completions and manual pages.

use crate::failure::Failure;
use crate::output::{make_folder, print_text};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::path::PathBuf;

pub const COMPLETIONS: &str = "\
Examples:
  beamfarm completions bash > ~/.local/share/bash-completion/completions/beamfarm
  beamfarm completions zsh > ~/.zfunc/_beamfarm        with ~/.zfunc in fpath
  beamfarm completions fish > ~/.config/fish/completions/beamfarm.fish";

pub const SCHEMA: &str = "\
Examples:
  beamfarm schema > beamfarm.schema.json               then the first line of a scene: #:schema ./beamfarm.schema.json";

pub const MAN: &str = "\
Examples:
  beamfarm man ~/.local/share/man/man1                 then: man beamfarm-render";

#[derive(Args)]
pub struct CompletionsArgs {
    /// Which shell
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Args)]
pub struct ManArgs {
    /// Where to write them; made if it is not there
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

pub fn completions<C: CommandFactory>(args: CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut C::command(), "beamfarm", &mut script);
    print_text(&String::from_utf8_lossy(&script))
}

/// One page for the command and one for each visible subcommand.
pub fn man<C: CommandFactory>(args: &ManArgs) -> Result<(), Failure> {
    let folder = &args.folder;
    make_folder(folder)?;
    clap_mangen::generate_to(C::command(), folder)
        .map_err(|error| Failure::io(format!("cannot write to {}: {error}", folder.display())))
}
