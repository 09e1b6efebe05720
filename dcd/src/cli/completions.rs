//! Implements `dcd completions`: prints the script by which a shell completes the command line.

use std::process::ExitCode;

use clap::CommandFactory;
use clap_complete::Shell;

use super::Cli;
use super::common::{Common, print};
use super::failure::Failure;

/// Prints the script by which a shell completes `dcd` with the tab key
///
/// Examples:
///   dcd completions bash > ~/.local/share/bash-completion/completions/dcd
///   dcd completions zsh > ~/.zfunc/_dcd         (a folder of your fpath)
///   dcd completions fish > ~/.config/fish/completions/dcd.fish
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Completions {
    /// For which shell
    shell: Shell,
}

impl Completions {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        print(script(self.shell).trim_end())?;
        Ok(ExitCode::SUCCESS)
    }
}

fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "dcd", &mut script);
    String::from_utf8(script).expect("help texts are UTF-8")
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn every_shell_learns_of_every_subcommand_and_its_options() {
        for shell in Shell::value_variants() {
            let script = script(*shell);
            for command in Cli::command().get_subcommands() {
                assert!(script.contains(command.get_name()), "{shell}: {}", command.get_name());
            }
            for option in ["island-limit", "coupling", "out"] {
                let known = script.contains(option);
                assert!(known, "{shell}: {option}");
            }
        }
    }
}
