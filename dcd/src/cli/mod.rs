//! Implements the command line `dcd`: one file per subcommand.
//!
//! To add a subcommand, write a file with a struct that derives [`clap::Args`] (its doc comment is the help
//! text) and has `fn execute(self, common: &Common) -> Result<ExitCode, Failure>`. Add its `mod` line, and a
//! line in `subcommands!`.

mod backup;
mod bandwidth;
mod client;
mod common;
mod completions;
mod config_file;
mod demo;
mod diff;
mod draft;
mod drain;
mod end;
mod failure;
mod fidelity;
mod film;
mod interrupt;
mod join_token;
mod man;
mod node;
mod notify;
mod replay;
mod requests;
mod restore;
mod run;
mod save;
mod scenes;
mod serve;
mod simulate;
mod status;
mod summary;
mod token;
mod truth;
mod values;
mod view;
mod world;

use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::path::Path;
use std::process::ExitCode;
use std::sync::LazyLock;

use clap::{CommandFactory, Parser};

use common::Common;
use failure::Failure;

/// Makes the enum into which clap parses, and which hands each command to its file.
macro_rules! subcommands {
    ($($name:ident in $file:ident),* $(,)?) => {
        #[derive(clap::Subcommand)]
        enum Command {
            $($name($file::$name)),*
        }

        impl Command {
            fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
                match self {
                    $(Self::$name(command) => command.execute(common)),*
                }
            }
        }
    };
}

subcommands! {
    Run in run,
    Scenes in scenes,
    Serve in serve,
    Node in node,
    Client in client,
    Token in token,
    Status in status,
    Drain in drain,
    Save in save,
    Backup in backup,
    Restore in restore,
    End in end,
    Replay in replay,
    Diff in diff,
    Demo in demo,
    Simulate in simulate,
    Completions in completions,
    Man in man,
}

/// One rigid-body world computed by many Rapier worlds, on the cores of one machine or on many machines.
#[derive(Parser)]
#[command(name = "dcd", version = version(), after_help = EXIT_CODES, propagate_version = true, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Returns the version of the program and that of the protocol: processes of unlike protocols refuse each
/// other.
fn version() -> &'static str {
    static TEXT: LazyLock<String> =
        LazyLock::new(|| format!("{} (protocol {})", env!("CARGO_PKG_VERSION"), crate::protocol::VERSION));
    &TEXT
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 failed while it ran; 2 what was given cannot be used (options, files, tokens), nothing was done; 3 a
server's world, or a node's part in it, has ended with something to report: it is not to be started again by itself, a server would begin the world anew; 130 ended by Ctrl-C, with what there was to report (a server keeps its world: 0). A second Ctrl-C ends at once; `dcd serve --help` says what it does there. Results go to standard output, everything else to standard error.";

/// Runs the command line with the process's arguments.
pub fn main() -> ExitCode {
    let args = match config_file::expand(Cli::command(), std::env::args_os().collect()) {
        Ok(args) => args,
        Err(failure) => return failure.report(),
    };
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version come this way too. A closed pipe is the reader's choice.
            return match error.print() {
                Err(cause) if cause.kind() != ErrorKind::BrokenPipe => {
                    Failure::run(format!("cannot print: {cause}")).report()
                }
                _ => ExitCode::from(error.exit_code() as u8),
            };
        }
    };
    cli.common.start_log();
    cli.command.execute(&cli.common).unwrap_or_else(|failure| cli.common.report(failure))
}

/// Returns whether `dcd serve` or `dcd node` accepts a file of options (`--config`). For tests, as such a
/// file may have anything in it.
#[doc(hidden)]
pub fn reads_config(path: &Path) -> bool {
    ["serve", "node"].into_iter().any(|subcommand| {
        let args = [OsStr::new("dcd"), OsStr::new(subcommand), OsStr::new("--config"), path.as_os_str()];
        let Ok(args) = config_file::expand(Cli::command(), args.map(OsString::from).to_vec()) else {
            return false;
        };
        let parsed = Cli::try_parse_from(args);
        let forgets = matches!(&parsed, Ok(Cli { command: Command::Serve(serve), .. }) if serve.is_fresh());
        assert!(!forgets, "a file begins a world anew");
        parsed.is_ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_of_all_subcommands_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_argument_of_every_subcommand_has_a_help_text() {
        for command in Cli::command().get_subcommands() {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            for arg in command.get_arguments() {
                assert!(arg.get_help().is_some(), "{} {}", command.get_name(), arg.get_id());
            }
        }
    }
}
