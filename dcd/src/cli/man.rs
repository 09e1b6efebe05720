//! Implements `dcd man`: prints the manual or writes its pages.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Command, CommandFactory};
use clap_mangen::Man as Page;

use super::Cli;
use super::common::{Common, print};
use super::failure::Failure;

/// Prints the manual page dcd(1), or writes one page per subcommand into a folder
///
/// Examples:
///   dcd man | man -l -
///   dcd man --out ~/.local/share/man/man1
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Man {
    /// Write dcd.1, dcd-run.1 and so on into this folder, which is created if it does not exist
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Man {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let Some(folder) = self.out else {
            let (_, page) = pages().swap_remove(0);
            print(page.trim_end())?;
            return Ok(ExitCode::SUCCESS);
        };
        std::fs::create_dir_all(&folder).map_err(|error| Failure::usage(refused(&folder, &error)))?;
        let pages = pages();
        for (name, page) in &pages {
            let path = folder.join(name);
            std::fs::write(&path, page).map_err(|error| Failure::run(refused(&path, &error)))?;
        }
        common.say(&format!("{} pages are in {}", pages.len(), folder.display()));
        Ok(ExitCode::SUCCESS)
    }
}

fn refused(path: &Path, error: &std::io::Error) -> String {
    format!("cannot write {}: {error}; give --out a folder that you may write to", path.display())
}

/// Returns file names and texts: the page of `dcd` first, then one per subcommand.
fn pages() -> Vec<(String, String)> {
    let mut dcd = Cli::command();
    dcd.build();
    let mut pages = vec![page(dcd.clone(), "dcd".to_owned())];
    for command in dcd.get_subcommands().filter(|command| command.get_name() != "help") {
        let name = format!("dcd-{}", command.get_name());
        pages.push(page(command.clone(), name));
    }
    pages
}

fn page(command: Command, name: String) -> (String, String) {
    let mut text = Vec::new();
    let page = Page::new(command.display_name(name.clone()));
    page.render(&mut text).expect("a vector takes all bytes");
    (format!("{name}.1"), String::from_utf8(text).expect("help texts are UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subcommand_has_a_page_that_names_its_options() {
        let pages = pages();
        let page = |name: &str| {
            let found = pages.iter().find(|(file, _)| file == name);
            // Hyphens are escaped.
            found.unwrap_or_else(|| panic!("{name} is missing")).1.replace(r"\-", "-")
        };
        let all = page("dcd.1");
        let mut count = 1;
        for command in Cli::command().get_subcommands() {
            let (name, own) = (command.get_name(), page(&format!("dcd-{}.1", command.get_name())));
            assert!(all.contains(&format!("dcd-{name}")), "{name}: {all}");
            for option in command.get_arguments().filter(|option| !option.is_hide_set()) {
                if let Some(long) = option.get_long() {
                    assert!(own.contains(&format!("--{long}")), "{name}: --{long}");
                }
            }
            count += 1;
        }
        assert_eq!(pages.len(), count);
        assert!(page("dcd.1").contains("Exit codes"));
        assert!(page("dcd-run.1").contains(".TH dcd-run 1"), "{}", page("dcd-run.1"));
    }
}
