//! Implements `dcd save`: saves the world of a running server.

use std::path::PathBuf;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::requests::{Verb, ask_about_file};

/// Saves the world of a running server, as it is after one tick
///
/// The nodes stop for that, for some ticks. The server writes the file, so it needs the permissions for that.
/// `dcd restore` goes back to the saved world, `dcd serve` serves it anew, and `dcd run` goes on with it
/// alone. How contacts were found is kept too, as far as the manual's page on limits says.
///
/// Example:
///   dcd save --data /var/lib/dcd before-the-boss.dcd
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Save {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// The file to write; an existing one is replaced once the new one is whole
    file: PathBuf,
}

impl Save {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        print(&ask_about_file(&self.data, Verb::Save, &self.file)?)?;
        Ok(ExitCode::SUCCESS)
    }
}
